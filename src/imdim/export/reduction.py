"""Linear equations that are solved one by one, each for one variable, and to which more can be added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

ZERO = 1e-9  # coefficients


@dataclass
class Reduced:
    """Equations as rows of a `matrix` [m, n] of coefficients. `pivots` says of each variable that one is solved for which that is; no other
    one holds it."""

    matrix: np.ndarray
    pivots: dict[int, int]

    @staticmethod
    def of(rows: Sequence[Mapping[int, float]], width: int) -> Reduced:
        """Equations over `width` variables, none of them solved."""
        return Reduced(_dense(rows, width), {})

    def add(self, rows: Sequence[Mapping[int, float]], width: int) -> Reduced:
        """With more equations, over no fewer variables; what is solved for is taken out of these."""
        wider = np.pad(self.matrix, ((0, 0), (0, width - self.matrix.shape[1])))
        more = _dense(rows, width)
        known = list(self.pivots)
        more -= more[:, known] @ wider[[self.pivots[v] for v in known]]
        more[np.abs(more) <= ZERO] = 0.0
        return Reduced(np.concatenate([wider, more]), dict(self.pivots))

    def solve_for(self, v: int, i: int) -> None:
        """Solve equation `i` for variable `v` and take that out of the other ones."""
        matrix = self.matrix
        matrix[i] /= matrix[i, v]
        others = np.flatnonzero(np.abs(matrix[:, v]) > 0)
        others = others[others != i]
        columns = np.flatnonzero(matrix[i])
        changed = matrix[np.ix_(others, columns)] - np.outer(matrix[others, v], matrix[i, columns])
        matrix[np.ix_(others, columns)] = np.where(np.abs(changed) <= ZERO, 0.0, changed)
        self.pivots[v] = i

    def read(self) -> dict[int, dict[int, float]]:
        """Of each variable that an equation is solved for the others that it follows from, with their coefficients."""
        return {v: {int(w): -float(self.matrix[i, w]) for w in np.flatnonzero(self.matrix[i]) if w != v} for v, i in self.pivots.items()}


def _dense(rows: Sequence[Mapping[int, float]], width: int) -> np.ndarray:
    out = np.zeros((len(rows), width))
    for i, row in enumerate(rows):
        out[i, list(row)] = list(row.values())
    return out
