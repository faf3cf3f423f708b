"""Exact carriers in spite of corners that lie on chords.

Where two tessellated surfaces cut each other, the corners of the cut lie on the facets of both, up to a sagitta inside of the true
surfaces, and a least-squares fit is drawn inwards by them: a sphere of radius 10 becomes one of 9.953. Corners of the tessellation
itself lie on the surface to the last digit of the file. They are the outermost, so a fit that is repeated to the outer points alone
finds them, as trimmed least squares does (Rousseeuw 1984), and says so itself: then half of all points, or many, lie on it to that digit.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from imdim.detection.fit_surface import fit_surface
from imdim.geometry.surface import Patch, signed_distance

BENT_ONE_WAY = ("sphere", "cylinder", "cone", "ellipsoid", "elliptic")  # all of whose chords lie on one side
EXACT = 2e-6  # of the diagonal: what single precision leaves of corners that lie on a surface
INNER = 0.25  # share of the points, the innermost, that each round leaves out
LEAST_SHARE, LEAST_POINTS = 0.5, 9  # of a patch's points, that must lie on the surface; nine fix an ellipsoid
# points, which lie on no surface by chance, whatever their share, where they are spread over the patch nearly as far as all are,
# and are no ring alone, as the widest of a fillet's that a cylinder goes on in: nine grooves leave a knob few corners of its own
ENOUGH, SPREAD = 24, 0.8
ROUNDS = 12


def onto_corners(patch: Patch, diagonal: float) -> Patch:
    """The patch on the surface that the corners of its tessellation lie on exactly, or the same one if there is none.

    `diagonal` is that of the mesh's box, in the patch's units.
    """
    limit, points = EXACT * diagonal, patch.points
    distance = signed_distance(patch.surface, points)
    if patch.surface.kind not in BENT_ONE_WAY or np.abs(distance).max() <= limit:
        return patch
    surface, kept = patch.surface, np.arange(len(points))
    for _ in range(ROUNDS):
        kept = kept[distance[kept] >= np.quantile(distance[kept], INNER)]
        if len(kept) < LEAST_POINTS:
            return patch
        surface, _ = fit_surface(surface.kind, points[kept], start=surface)
        distance = signed_distance(surface, points)
        if np.abs(distance[kept]).max() <= limit:
            on = np.abs(distance) <= limit
            least = min(max(LEAST_POINTS, LEAST_SHARE * len(points)), ENOUGH if _are_spread(points, on) else math.inf)
            exact = np.count_nonzero(on) >= least and not (distance > 10 * limit).any()
            return replace(patch, surface=surface) if exact else patch
    return patch


def _are_spread(points: np.ndarray, chosen: np.ndarray) -> bool:
    """Whether those of the points [n, 3] that are `chosen` [n] are spread nearly as far as all, along each of their main directions."""
    along = (points - points.mean(0)) @ np.linalg.eigh(np.cov(points.T))[1]
    return bool((along[chosen].std(0) >= SPREAD * along.std(0)).all())
