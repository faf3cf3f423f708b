"""From where a cloud was seen of which nobody said so: the origin of its coordinates, where depth cameras and their drivers put themselves.

No point of such a cloud lies behind another one as seen from there. Of a cloud from all sides about half of the points do: those of the
backs. A point is behind another one that is nearer in nearly the same line of sight and lies before the plane of its own neighbours, so
that points at a slant, which lie behind one another along their own surface, do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

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
FLAT = 0.65  # of the spread of most points' neighbours along their plane, across it: of a sheet less, of a heap more
AS_GOOD = 0.01  # more of the points may lie behind others, seen along another way
WAYS, FAR = 96, 1000.0  # directions from which a cloud of another place may have been seen, and how many diagonals away
SURE_OF, SURE_BULGE = 8192, 0.003  # points, and bulge, by which a cloud certainly is of one side
DEEP = 0.1  # of the diagonal, the least extent of such a cloud: both faces of a thin plate may lie within its noise
FACING = 0.2  # least cosine to the line of sight, of points whose spacing tells how far they were
PLAIN = 0.5  # of the scatter of the spacings' logarithm, by which they must widen over the depth's to tell where the camera was


def find_camera(points: np.ndarray) -> np.ndarray | None:
    """The origin, as the only scanner [1, 3] of a cloud of `points` [n, 3], if all of it could be seen from there; else None."""
    low, high = points.min(0), points.max(0)
    diagonal = float(np.linalg.norm(high - low))
    if np.linalg.norm(np.clip(0.0, low, high)) < AWAY * diagonal:
        return None
    some = subsample(points, ASKED)
    if len(some) <= NEIGHBOURS:
        return None
    return np.zeros((1, 3)) if _Sheet.of(some, BULGE * diagonal).share_behind(np.zeros(3)) < OPEN else None


def guess_camera(points: np.ndarray) -> np.ndarray | None:
    """A far place from which all of a cloud of `points` [n, 3] could be seen, its only scanner [1, 3]; None where there is none.

    What is seen from one side could as well be the inside of what is seen from the other. A camera's points lie wider apart the farther
    they are; where their spacing does not tell, the way is taken along which the cloud bulges towards the camera. So this is for clouds
    that show no inside otherwise, and for those that are `certainly_one_side`.
    """
    some = subsample(points, ASKED)
    if len(some) <= NEIGHBOURS:
        return None
    diagonal = float(np.linalg.norm(np.ptp(some, axis=0)))
    sheet, middle = _Sheet.of(some, BULGE * diagonal), some.mean(0)
    if sheet.thickness > FLAT:
        return None
    height = 1 - (2 * np.arange(WAYS) + 1) / WAYS
    turn, out = np.pi * (1 + np.sqrt(5)) * np.arange(WAYS), np.sqrt(1 - height**2)  # a Fibonacci lattice (González 2010)
    ways = np.column_stack([out * np.cos(turn), out * np.sin(turn), height])
    shares = np.array([sheet.share_behind(middle + FAR * diagonal * way) for way in ways])
    if shares.min() >= OPEN:
        return None
    best = ways[shares <= shares.min() + AS_GOOD].mean(0)
    length = float(np.linalg.norm(best))
    way = best / length if length > AHEAD else ways[shares.argmin()]  # those from opposite sides have no mean
    return (middle + _side_towards(subsample(points, SURE_OF), way) * FAR * diagonal * way)[None]


def certainly_one_side(points: np.ndarray, camera: np.ndarray) -> bool:
    """Whether a cloud of `points` [n, 3] that was perhaps seen from a `camera` [1, 3] has no other side: walls as thin as its noise allows
    would show theirs."""
    some = subsample(points, SURE_OF)
    diagonal = float(np.linalg.norm(np.ptp(some, axis=0)))
    middle = some - some.mean(0)
    if np.ptp(middle @ np.linalg.svd(middle, full_matrices=False)[2][2]) < DEEP * diagonal:
        return False
    return _Sheet.of(some, SURE_BULGE * diagonal).share_behind(camera[0]) < OPEN


def _side_towards(points: np.ndarray, way: np.ndarray) -> float:
    """1 if the camera of `points` [n, 3] stood where `way` [3] leads to, -1 if on the other side of them."""
    middle = points - points.mean(0)
    depth = middle @ way
    facing = np.abs(_Sheet.of(points, 0.0).normal @ way)
    shown = facing > FACING
    if shown.sum() > NEIGHBOURS:
        apart = np.log(KDTree(points).query(points[shown], k=EIGHTH + 1)[0][:, EIGHTH] + 1e-300)
        # pixels of one angle: their spacing grows with the distance, and along the sight where the surface is at a slant
        of = np.column_stack([np.ones(shown.sum()), np.log(facing[shown]), depth[shown]])
        solved = np.linalg.lstsq(of, apart, rcond=None)[0]
        if abs(solved[2]) * depth[shown].std() > PLAIN * (apart - of @ solved).std():
            return -float(np.sign(solved[2]))
    aside = np.linalg.norm(middle - depth[:, None] * way, axis=1)
    return 1.0 if np.corrcoef(depth, aside)[0, 1] < 0 else -1.0  # what lies aside is farther off


@dataclass(frozen=True, eq=False)
class _Sheet:
    """Points [n, 3], the `normal` [n, 3] of a plane through the neighbours of each, their `center` [n, 3], the points' `spacing`, by
    how much a point must lie before a plane to hide what is in it, and the median `thickness` of neighbours across their plane, as a share
    of their spread along it."""

    points: np.ndarray
    normal: np.ndarray
    center: np.ndarray
    spacing: float
    before: float
    thickness: float

    @staticmethod
    def of(points: np.ndarray, bulge: float) -> _Sheet:
        far, near = KDTree(points).query(points, k=NEIGHBOURS + 1)
        spacing, center = surface_spacing(far[:, EIGHTH]), points[near].mean(1)
        arms = points[near] - center[:, None]
        spread, ways = np.linalg.eigh(np.einsum("nki,nkj->nij", arms, arms))
        thickness = np.sqrt(np.maximum(spread[:, 0], 0.0) / np.maximum(spread[:, 1], 1e-300))
        return _Sheet(points, ways[:, :, 0], center, spacing, max(BEFORE * spacing, bulge), float(np.median(thickness)))

    def share_behind(self, camera: np.ndarray) -> float:
        """Share of the points that lie behind others for a `camera` [3]; 1 where they are not all before it."""
        depth = np.linalg.norm(self.points - camera, axis=1)
        sight = (self.points - camera) / depth[:, None]
        middle = sight.mean(0) / max(float(np.linalg.norm(sight.mean(0))), 1e-300)
        if (sight @ middle).min() < AHEAD:
            return 1.0
        across = np.linalg.svd(middle[None])[2][1:]
        places = (sight @ across.T) / (sight @ middle)[:, None] * np.median(depth)
        away, beside = KDTree(places).query(places, k=min(BESIDE + 1, len(depth)), distance_upper_bound=SIGHT * self.spacing)
        there = np.isfinite(away)
        beside = np.where(there, beside, 0)
        towards = -np.sign(np.einsum("ni,ni->n", sight, self.normal))
        before = np.einsum("nki,ni->nk", self.points[beside] - self.center[:, None], self.normal) * towards[:, None]
        hides = there & (before > self.before) & (depth[beside] < depth[:, None])
        return float((hides.sum(1) >= FEWEST).mean())
