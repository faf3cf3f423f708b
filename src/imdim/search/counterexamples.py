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
from imdim.search.outline_families import find_faces
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
        self._cells, self._outlines, self._faces = families.cells, families.outlines.outlines, families.outlines.faces
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
        cells, faces = replace(self._cells, w_in=w_in, w_out=w_out), [face[self._known] for face in self._faces]
        return Families(self._arrangement, cells.choose(self._known), self._outlines, faces)

    @property
    def every(self) -> Families:
        """Families over all cells that any look has seen."""
        return Families(self._arrangement, self._cells, self._outlines, self._faces)

    def _look(self) -> None:
        """Pool what is known with fresh samples; new cells are neither known nor doubted yet."""
        fresh = compress_samples(self._arrangement, label_samples(self._arrangement, self._label, self._count, self._rng))
        old, known = self._looks / (self._looks + 1), len(self._cells.points)
        self._cells, place = pool_cells(self._cells, fresh, (old, 1 - old))
        place, count = place[:known], len(self._cells.points)
        w_in, w_out = (_spread(w, place, np.zeros(count)) for w in (self._first.w_in, self._first.w_out))
        self._first = replace(self._cells, w_in=w_in, w_out=w_out)
        self._doubted, self._known = (_spread(flags, place, np.zeros(count, bool)) for flags in (self._doubted, self._known))
        # a cell's face is asked for once, which takes longer than all else that families know of it
        new = _spread(False, place, np.ones(count, bool))
        found = find_faces(self._outlines.planes, self._cells.choose(new))
        self._faces = [
            _spread(face, place, _spread(add, new, np.empty(count, face.dtype))) for face, add in zip(self._faces, found, strict=True)
        ]
        self._looks += 1


def _spread(values: np.ndarray | bool, place: np.ndarray, out: np.ndarray) -> np.ndarray:
    """`out` with values at their places."""
    out[place] = values
    return out


def transfer(sequence: Sequence, families: Families) -> Sequence:
    """The same steps over the cells of other families of the same arrangement."""
    return map_terms(sequence, lambda covered: Covered.of(covered.shape, families))
