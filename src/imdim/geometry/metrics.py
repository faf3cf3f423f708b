"""Distances between point sets: the Chamfer distance and the directed nearest distances that it sums up.

All are unsquared and in model units. Distances to triangle surfaces are in `triangles`, volumes and IoU in `solid`.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree


def nearest_distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance [n] of each of `a` [n, 3] to the nearest of `b` [m, 3]; raises ValueError when either is empty."""
    if not len(a) or not len(b):
        raise ValueError(f"distance between sets of {len(a)} and {len(b)} points is not defined")
    return KDTree(b).query(a)[0]


def chamfer(a: np.ndarray, b: np.ndarray) -> float:
    """Sum of both directed mean nearest distances between `a` [n, 3] and `b` [m, 3]; raises ValueError when either is empty."""
    return float(nearest_distances(a, b).mean() + nearest_distances(b, a).mean())


def diagonal(points: np.ndarray) -> float:
    """Length of the diagonal of the axis-aligned box around `points` [n, 3]."""
    return float(np.linalg.norm(np.ptp(np.asarray(points, np.float64), axis=0)))
