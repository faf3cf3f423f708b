"""The last word on a found program: a proof that nothing shorter explains the body over its candidates, or the shorter program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imdim.geometry import kernels
from imdim.program.cost import count
from imdim.program.patterns.detect import extent, fold_repeats
from imdim.program.patterns.weigh import NEAR
from imdim.program.repeats import repeats, size
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.observation import Observation
from imdim.search.candidate_families import Families
from imdim.search.exact.prove import OUT_OF_TIME, TOO_HARD, Proof, Prover

PROOF_S = 8.0  # for all proofs about a body, at most: of the proofs that end few take longer
EASY, FALL = 16, 8  # primitives, up to which all of that is given, and the power that less is given with beyond: few proofs end there
EARLY_SHARE = 0.6  # of what is left of that, for one proof before the search has ended
MOST_EARLY = 3  # proofs before the search has ended


BESIDE = "proved minimal over these candidates, beside what repeats"
SHORTER = "fewer primitives do beside what repeats"
DEARER = "not proved: what has fewer primitives costs more in all"


def _part_repeats(program: Program) -> tuple[list[Primitive], int]:
    """The leaves of a program that repeat, and the number of the others."""
    folding = fold_repeats(program, NEAR * extent(program))
    every = list(leaves(program))
    if folding is None:
        return [], len(every)
    parts, given = list(leaves(folding.program)), set[int]()
    for first, repeat in repeats(folding.folded):
        given |= {first + i for i in range(size(repeat.part) * repeat.number)}
    return [leaf for i, leaf in enumerate(parts) if i in given], len(parts) - len(given)


@dataclass
class Proofs:
    """Asks for proofs about programs of one body, which may take a `share` of the time left."""

    seen: Observation
    budget: Budget
    share: float = 1.0
    asked: int = 0
    fewest: int | None = None
    spent_s: float = 0.0
    is_too_hard: bool = False

    @cached_property
    def _prover(self) -> Prover:
        return Prover(self.seen.families, self.seen.size_weight)

    def of(self, program: Program, share: float = 1.0) -> tuple[Program, Proof]:
        """A proof about a program, and a shorter or the same program; it may take a share of the time for proofs."""
        start, primitives = self.budget.seconds(), count(program).primitives
        most_s = share * (PROOF_S * min(1.0, EASY / primitives) ** FALL - self.spent_s)
        deadline = self.budget.within(most_s).earlier(self.budget.part_of("prove", self.share))
        if not self.spent_s and deadline.has_passed():  # to list the candidates alone takes most of a second
            return program, Proof(False, primitives, 0, OUT_OF_TIME)
        error = self.seen.error(program) * self.seen.cells.volume
        proof = self._prover.prove(primitives, error, deadline)
        self.spent_s += self.budget.seconds() - start
        return proof.program or program, proof

    def beside_repeats(self, program: Program) -> str | None:
        """Whether beside the features that repeat, each a single one with its counts, no fewer primitives do: over the cells that none of
        the copies holds. None where nothing repeats, where nothing of the body is beside the copies, where each copy counts, and where time
        is out."""
        if self.budget.end_of("prove").has_passed():
            return None
        given, others = _part_repeats(program)
        if not given or not self.seen.copies_once:
            return None
        cells = self.seen.cells
        rest = cells.choose(~np.logical_or.reduce([kernels.inside(leaf, cells.points) for leaf in given]))
        if rest.volume == 0:
            return None
        prover = Prover(Families(self.seen.families.arrangement, rest), self._prover.unit / rest.volume)
        error = float(np.where(kernels.inside(program, rest.points), rest.w_out, rest.w_in).sum())
        proof = prover.prove(others, error, self.budget.within(PROOF_S - self.spent_s).earlier(self.budget.part_of("prove", self.share)))
        # what is shorter there need not be the part where the copies are
        return BESIDE if proof.minimal and proof.program is None else f"not proved: {proof.why or SHORTER}"

    def early(self, program: Program) -> tuple[Program, Proof] | None:
        """As `of`, for a program that the search passes through, where it is shorter than those before; None where that is not worth it: a
        body whose cells were too hard to tell apart for the solver once are so for shorter programs too, and the last word is left."""
        primitives = count(program).primitives
        if self.is_too_hard or self.asked == MOST_EARLY or (self.fewest is not None and primitives >= self.fewest):
            return None
        self.asked, self.fewest = self.asked + 1, primitives
        shorter, proof = self.of(program, EARLY_SHARE)
        self.is_too_hard = proof.why == TOO_HARD
        return shorter, proof
