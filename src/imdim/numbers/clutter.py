"""Where the points of a cloud lie that belong to no surface: mostly in a box of their own, which is seldom that of all points.

The box of all points is wider than that of the clutter where noise reaches out of it. A density that is then too low within thin walls, and
too high beside them, draws both skins inwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imdim.geometry.point_grid import find_bounds

ELSEWHERE = 0.05  # of the clutter, which may lie anywhere in the box of all points
FEWEST = 40.0  # points of clutter that tell where it is
UNIFORM = math.sqrt(3.0)  # half the side of a box in deviations of what is even in it


@dataclass(frozen=True, eq=False)
class ClutterBox:
    """The corners `low` and `high` [3] of the box in which most of the clutter lies."""

    low: np.ndarray
    high: np.ndarray

    @staticmethod
    def of(points: np.ndarray, weights: np.ndarray) -> ClutterBox | None:
        """By the moments of `points` [n, 3] each of which is clutter with the probability of its weight [n]; None for too few."""
        held = float(weights.sum())
        if held < FEWEST:
            return None
        middle = weights @ points / held
        half = UNIFORM * np.sqrt(weights @ (points - middle) ** 2 / held)
        low, high = find_bounds(points)
        return ClutterBox(np.maximum(middle - half, low), np.minimum(middle + half, high))


def clutter_density(points: np.ndarray, sigma: float, box: ClutterBox | None) -> np.ndarray:
    """The density [n] of clutter at `points` [n, 3], per cubed unit: even in the box of the points if nobody knows better, whose sides are
    taken to be `sigma` long at least."""
    low, high = find_bounds(points)
    even = np.full(len(points), 1 / float(np.prod(np.maximum(high - low, sigma))))
    if box is None:
        return even
    within = ((points >= box.low) & (points <= box.high)).all(1)
    return ELSEWHERE * even + (1 - ELSEWHERE) * within / float(np.prod(np.maximum(box.high - box.low, sigma)))
