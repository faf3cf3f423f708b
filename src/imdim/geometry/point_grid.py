"""Points sorted into the cells of a grid, so that compiled loops find those near a place in a few ranges of one array.

A tree is built and asked point by point; where the same reach is asked everywhere, cells of its side answer from their neighbours alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

MOST_CELLS = 1 << 18  # a reach that is short for the points' extent gets longer cells: more is looked at, the same is found


def find_bounds(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest coordinates [3] of `points` [n, 3], n > 0: numpy goes through short rows an element at a time."""
    return _find_bounds(np.ascontiguousarray(points, float))


@njit(nogil=True, cache=True)
def _find_bounds(points):  # pragma: no cover - compiled
    low, high = points[0].copy(), points[0].copy()
    for i in range(len(points)):
        for c in range(3):
            low[c], high[c] = min(low[c], points[i, c]), max(high[c], points[i, c])
    return low, high


def measure_diagonal(points: np.ndarray) -> float:
    """Of the box about `points` [n, 3]; 0 where there are none."""
    if not len(points):
        return 0.0
    low, high = find_bounds(points)
    return float(np.linalg.norm(high - low))


@dataclass(frozen=True)
class PointGrid:
    """`order` [n] are the points' indices cell after cell; those of cell c are `first[c]` to `first[c + 1]` of it, with c the cell's place
    in a grid of `shape` [3], the last axis fastest. Cells have the side `cell`, the first its low corner at `low` [3]. Around the points is
    a margin of one empty cell."""

    order: np.ndarray
    first: np.ndarray
    low: np.ndarray
    cell: float
    shape: np.ndarray

    @staticmethod
    def of(points: np.ndarray, reach: float) -> PointGrid:
        """Of `points` [n, 3], for what lies no farther than `reach` from a place: it is in the place's cell or in one beside it."""
        low, high = find_bounds(points)
        extent = np.maximum(high - low, 1e-300)
        cell = max(reach, 1e-300)
        while np.prod(np.minimum(extent / cell, 1e6) + 3) > MOST_CELLS:
            cell *= 1.5
        shape = np.floor(extent / cell).astype(np.int64) + 3
        at = np.floor((points - low) / cell).astype(np.int64) + 1
        flat = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
        order = np.argsort(flat, kind="stable")
        first = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=int(shape.prod())))])
        return PointGrid(order, first, low - cell, cell, shape)
