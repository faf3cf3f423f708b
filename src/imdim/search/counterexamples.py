"""Counterexamples: cells that no sample fell into, on which a found sequence is wrong.

An arrangement of many planes and cylinders has far more cells than samples, and what is not sampled a search cannot see. More samples
everywhere would cost it as much time as they give sight. So it is asked where the found program is wrong on samples that it has not
seen, and just those cells are added: counterexample-guided inductive synthesis (Solar-Lezama 2008; Du et al. 2018, section 5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from imdim.program.sequence import map_terms
from imdim.search.candidate_families import Families
from imdim.search.cells import compress_samples, label_samples, pool_cells
from imdim.search.lns import RatedSequence
from imdim.search.sequence import Covered, Sequence, run

WORTH = 0.5  # of a primitive's price; cells that a sequence is wrong about on less are no reason to search again


class Sharpener:
    """Looks for counterexamples to sequences over families; `price` is a primitive's, in volume.

    Each look draws `count` fresh samples, labelled by their probability [n] of being inside. Where a sequence was ever wrong, a cell
    counts with the mean volume of all looks; elsewhere the first look holds alone, and cells that only later ones saw are left out.
    Either is without bias. To add counterexamples with all of their volume would count what is wrong twice.
    """

    def __init__(
        self, families: Families, label: Callable[[np.ndarray], np.ndarray], count: int, price: float, rng: np.random.Generator
    ) -> None:
        self._arrangement, self._label, self._count, self._price, self._rng = families.arrangement, label, count, price, rng
        self._cells, self._outlines = families.cells, families.outlines.outlines
        self._first = families.cells
        self._doubted = np.zeros(len(families.cells.points), bool)
        self._known = np.ones(len(families.cells.points), bool)
        self._looks = 1

    def sharpen(self, found: list[RatedSequence]) -> Families | None:
        """Families with the counterexamples to what was found; None where that is hardly wrong on cells it does not know."""
        self._look()
        every = self.every
        wrong = [np.where(run(transfer(f.sequence, every), len(self._doubted)), self._cells.w_out, self._cells.w_in) for f in found]
        self._doubted |= np.max(wrong, axis=0) > 0
        if max(float(w[~self._known].sum()) for w in wrong) < WORTH * self._price:
            return None
        self._known |= self._doubted
        # all cells with the volumes that count
        w_in, w_out = (np.where(self._doubted, *w) for w in ((self._cells.w_in, self._first.w_in), (self._cells.w_out, self._first.w_out)))
        return Families(self._arrangement, replace(self._cells, w_in=w_in, w_out=w_out).choose(self._known), self._outlines)

    @property
    def every(self) -> Families:
        """Families over all cells that any look has seen."""
        return Families(self._arrangement, self._cells, self._outlines)

    def _look(self) -> None:
        """Pool what is known with fresh samples; new cells are neither known nor doubted yet."""
        fresh = compress_samples(self._arrangement, label_samples(self._arrangement, self._label, self._count, self._rng))
        empty = replace(fresh, w_in=np.zeros(len(fresh.points)), w_out=np.zeros(len(fresh.points)))
        old = self._looks / (self._looks + 1)
        self._first, _ = pool_cells(self._first, empty, (1.0, 1.0))
        self._cells, place = pool_cells(self._cells, fresh, (old, 1 - old))
        count = len(self._cells.points)
        self._doubted, self._known = (np.bincount(place[: len(flags)], flags, count) > 0 for flags in (self._doubted, self._known))
        self._looks += 1


def transfer(sequence: Sequence, families: Families) -> Sequence:
    """The same steps over the cells of other families of the same arrangement."""
    return map_terms(sequence, lambda covered: Covered.of(covered.shape, families))
