"""By how much the surfaces that a depth camera saw are bent, where what it saw is not.

The errors of such a camera hang together: neighbouring points are off by as much, and lie on smooth waves that tell less noise the nearer
one looks. What tells them from shapes is that they are everywhere, on the calmest of places too.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.sampling import subsample

POINTS = 8192  # of the cloud that are looked at
PLACES = 150  # where
REACH = 0.1  # of the cloud's diagonal, around each
FEWEST = 30  # points of a place: six of them a quadric meets in any case
CALM = 0.25  # share of the places that no shape bends more than a quadric
LONGER = 2.0  # times as high as a place shows are waves that are longer than it


def measure_bulges(points: np.ndarray) -> float:
    """The deviation of a cloud's `points` [n, 3] from smooth shapes, in their units, by quadrics through the points around some of them; 0
    where points are too few."""
    some = subsample(points, POINTS)
    reach = REACH * float(np.linalg.norm(np.ptp(some, axis=0)))
    around = KDTree(some).query_ball_point(subsample(some, PLACES), reach)
    off = [_deviation(some[near]) for near in around if len(near) >= FEWEST]
    return LONGER * float(np.quantile(off, CALM)) if off else 0.0


def _deviation(points: np.ndarray) -> float:
    """The root mean square distance of points [n, 3] from a quadric over their plane, along its normal."""
    arms = points - points.mean(0)
    w, v, u = (arms @ np.linalg.eigh(arms.T @ arms)[1]).T
    quadric = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    left = w - quadric @ np.linalg.lstsq(quadric, w, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
