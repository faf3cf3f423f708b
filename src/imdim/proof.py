"""The last word on a found program: a proof that nothing shorter explains the body over its candidates, or the shorter program."""

from __future__ import annotations

from imdim.body import Seen
from imdim.clock import Clock
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.search.exact.prove import Proof, prove

PROOF_S = 8.0  # at most, of the search's share of the budget


def proof_of(program: Program, seen: Seen, clock: Clock, share: float = 1.0) -> tuple[Program, Proof]:
    """A proof about a program in the body's units, and a shorter or the same program."""
    start, over = clock.seconds(), clock.part(share)

    def late() -> bool:
        return over() or clock.seconds() - start > PROOF_S

    error = seen.error(program) * seen.cells.volume
    proof = prove(seen.families, seen.size_weight, count(program).primitives, error, late)
    return program if proof.program is None else seen.frame.undo(proof.program), proof
