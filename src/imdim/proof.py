"""The last word on a found program: a proof that nothing shorter explains the body over its candidates, or the shorter program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from imdim.body import Seen
from imdim.clock import Clock
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.search.exact.prove import Proof, Prover

PROOF_S, EARLY_S = 8.0, 5.0  # for one proof, at most; before the search has ended
PROOF_SHARE = 0.55  # of the budget; a search that took all of its own leaves some for the last proof
MOST_EARLY = 3  # proofs before the search has ended


@dataclass
class Proofs:
    """Asks for proofs about programs of one body, which may take a `share` of the time left."""

    seen: Seen
    clock: Clock
    share: float = 1.0
    asked: int = 0
    fewest: int | None = None

    @cached_property
    def _prover(self) -> Prover:
        return Prover(self.seen.families, self.seen.size_weight)

    def of(self, program: Program, most_s: float = PROOF_S) -> tuple[Program, Proof]:
        """A proof about a program in the body's units, and a shorter or the same program."""
        start = self.clock.seconds()
        end = start + min(most_s, self.share * (PROOF_SHARE * self.clock.budget_s - start))
        error = self.seen.error(program) * self.seen.cells.volume
        proof = self._prover.prove(count(program).primitives, error, lambda: end - self.clock.seconds())
        return program if proof.program is None else self.seen.frame.undo(proof.program), proof

    def early(self, program: Program) -> tuple[Program, Proof] | None:
        """As `of`, for a program that the search passes through, where it is shorter than those before; None where that is not worth it."""
        primitives = count(program).primitives
        if self.asked == MOST_EARLY or (self.fewest is not None and primitives >= self.fewest):
            return None
        self.asked, self.fewest = self.asked + 1, primitives
        return self.of(program, EARLY_S)
