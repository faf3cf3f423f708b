"""Where the points of a cloud lie that belong to no surface: mostly in a box of their own, which is seldom that of all points.

The box of all points is wider than that of the clutter where noise reaches out of it. A density that is then too low within thin walls, and
too high beside them, draws both skins inwards. Which points are clutter does not tell where it ends: beside a surface, whatever density was
taken for granted has its share of the points. So ends are moved where that makes all points likelier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.geometry.point_grid import find_bounds

SHARE = 0.95  # of the clutter, that lies in its box; the rest may lie anywhere in that of all points
TELLING = 0.03  # share of the points that are clutter, from which it matters where it lies
BINS = 64  # along each side of the box of all points, at whose borders that of the clutter may end
STEPS = (16, 4, 1)  # bins by which an end is moved at once
SHORTEST = 16  # bins


@dataclass(frozen=True)
class ClutterBox:
    """The corners `low` and `high` of the box in which most of the clutter lies, in bins of the box of all points."""

    low: tuple[int, int, int] = (0, 0, 0)
    high: tuple[int, int, int] = (BINS, BINS, BINS)

    def fit(self, points: np.ndarray, signal: np.ndarray, clutter: float, sigma: float) -> ClutterBox:
        """The box with each of its ends moved to where `points` [n, 3], to which the surface lends the densities `signal` [n], are
        likeliest among as large a share of `clutter`."""
        if clutter < TELLING:
            return self
        low, edges = _box_of(points, sigma)
        places = (points - low) / edges * BINS
        scale = clutter / float(np.prod(edges))
        ends = np.array([self.low, self.high], np.int64)
        _move_ends(places, signal, scale, ends, np.array(STEPS), SHARE, SHORTEST, BINS)
        (a, b, c), (d, e, f) = ends.tolist()
        return ClutterBox((a, b, c), (d, e, f))

    def density(self, points: np.ndarray, sigma: float) -> np.ndarray:
        """The density [n] of the clutter at `points` [n, 3], per cubed unit; their box is taken to be `sigma` wide at least."""
        low, edges = _box_of(points, sigma)
        even = 1 / float(np.prod(edges))
        if self == EVERYWHERE:
            return np.full(len(points), even)
        places, sides = (points - low) / edges * BINS, np.subtract(self.high, self.low) / BINS
        within = ((places >= self.low) & (places <= self.high)).all(1)
        return np.where(within, even * (1 - SHARE + SHARE / float(np.prod(sides))), even * (1 - SHARE))


EVERYWHERE = ClutterBox()  # in the box of all points


def _box_of(points: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """The lower corner and the edges [3] of the box of points."""
    low, high = find_bounds(points)
    return low, np.maximum(high - low, sigma)


@njit(nogil=True, cache=True)
def _move_ends(places, signal, scale, ends, steps, share, shortest, bins):  # pragma: no cover - compiled
    """Move the `ends` [2, 3] in place, one after the other, as long as the points, `places` [n, 3] in bins, become likelier."""
    best = _tell(places, signal, scale, ends, share, bins)
    for axis in range(3):
        for side in range(2):
            for step in steps:
                for way in (-1, 1):
                    before = ends[side, axis]
                    ends[side, axis] = min(max(before + way * step, 0), bins)
                    if ends[1, axis] - ends[0, axis] < shortest or ends[side, axis] == before:
                        ends[side, axis] = before
                        continue
                    told = _tell(places, signal, scale, ends, share, bins)
                    if told > best:
                        best = told
                    else:
                        ends[side, axis] = before


@njit(nogil=True, cache=True)
def _tell(places, signal, scale, ends, share, bins):  # pragma: no cover - compiled
    """The logarithm of the likelihood, but for what is the same for all ends."""
    volume = 1.0
    for axis in range(3):
        volume *= (ends[1, axis] - ends[0, axis]) / bins
    within, beside, out = scale * (1 - share + share / volume), scale * (1 - share), 0.0
    for i in range(len(places)):
        inside = True
        for axis in range(3):
            inside = inside and ends[0, axis] <= places[i, axis] <= ends[1, axis]
        out += np.log(signal[i] + (within if inside else beside))
    return out
