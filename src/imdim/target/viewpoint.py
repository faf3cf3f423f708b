"""Whether a cloud was seen from the origin of its coordinates, where depth cameras and their drivers put themselves.

No point of such a cloud lies behind another one as seen from there. Of a cloud from all sides about half of the points do: those of the
backs. A point is behind another one that is nearer in nearly the same line of sight and lies before the plane of its own neighbours, so
that points at a slant, which lie behind one another along their own surface, do not count.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.sampling import EIGHTH, subsample, surface_spacing

ASKED = 2048  # points
NEIGHBOURS = 24  # of a point, through which its plane is laid
BESIDE = 12  # points in nearly the same line of sight that are looked at
SIGHT = 1.5  # spacings, across the line of sight
BEFORE = 0.3  # of a spacing, by which a point must lie before a plane; depth cameras write steps of their resolution
BULGE = 0.012  # of the cloud's diagonal, likewise: noise and bulges
FEWEST = 2  # points that must lie before one: a stray hides nothing
OPEN = 0.1  # share of the points behind others, below which all were seen from there: those at folds may seem to be
AWAY = 0.5  # of the diagonal, that a camera stands before the cloud's box at least
AHEAD = 0.5  # least cosine between the camera's sight of the cloud's middle and of each point


def find_camera(points: np.ndarray) -> np.ndarray | None:
    """The origin, as the only scanner [1, 3] of a cloud of `points` [n, 3], if all of it could be seen from there; else None."""
    low, high = points.min(0), points.max(0)
    diagonal = float(np.linalg.norm(high - low))
    if np.linalg.norm(np.clip(0.0, low, high)) < AWAY * diagonal:
        return None
    some = subsample(points, ASKED)
    sight = some / np.linalg.norm(some, axis=1, keepdims=True)
    middle = sight.mean(0) / max(float(np.linalg.norm(sight.mean(0))), 1e-300)
    if (sight @ middle).min() < AHEAD or len(some) <= NEIGHBOURS:
        return None
    return np.zeros((1, 3)) if _share_behind(some, sight, middle, BULGE * diagonal) < OPEN else None


def _share_behind(points: np.ndarray, sight: np.ndarray, middle: np.ndarray, bulge: float) -> float:
    """Share of the points [n, 3] that lie behind others for a camera at the origin; `sight` [n, 3] are their directions, `middle` [3] the
    mean of these."""
    far, near = KDTree(points).query(points, k=NEIGHBOURS + 1)
    spacing = surface_spacing(far[:, EIGHTH])
    center = points[near].mean(1)
    arms = points[near] - center[:, None]
    normal = np.linalg.eigh(np.einsum("nki,nkj->nij", arms, arms))[1][:, :, 0]
    depth = np.linalg.norm(points, axis=1)
    across = np.linalg.svd(middle[None])[2][1:]
    places = (sight @ across.T) / (sight @ middle)[:, None] * np.median(depth)
    away, beside = KDTree(places).query(places, k=min(BESIDE + 1, len(points)), distance_upper_bound=SIGHT * spacing)
    there = np.isfinite(away)
    beside = np.where(there, beside, 0)
    towards = -np.sign(np.einsum("ni,ni->n", sight, normal))
    before = np.einsum("nki,ni->nk", points[beside] - center[:, None], normal) * towards[:, None]
    hides = there & (before > max(BEFORE * spacing, bulge)) & (depth[beside] < depth[:, None])
    return float((hides.sum(1) >= FEWEST).mean())
