"""An edge that is blended: the curve in which two faces meet, and the stretch of it along which a fillet or a chamfer runs.

Nothing here is compiled: the process that writes STEP reads and sweeps edges without a second of loading kernels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from imdim.geometry.rotations import cross
from imdim.geometry.rows import lengths
from imdim.program.edges import EdgeKind

QUADRANTS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])


@dataclass(frozen=True, eq=False)
class Track:
    """The curve in which two faces meet: a line from `origin` along the third column of `frame`, or with a `radius`
    a circle about that. `normals` [2, 2]
    are those of the two faces in the section: across the line along the first two columns of `frame`, in the half plane (r, z) of the
    circle."""

    origin: np.ndarray
    frame: np.ndarray
    normals: np.ndarray
    radius: float = 0.0

    @property
    def is_round(self) -> bool:
        return self.radius > 0

    def at(self, t: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Points [n, 3] at lengths or angles `t` [n], moved by `across` [n, 2] in the section."""
        if not self.is_round:
            return self.origin + t[:, None] * self.frame[:, 2] + across @ self.frame[:, :2].T
        r = self.radius + across[:, 0]
        local = np.stack([r * np.cos(t), r * np.sin(t), across[:, 1]], axis=1)
        return self.origin + local @ self.frame.T

    @cached_property
    def quadrants(self) -> np.ndarray:
        """The ways [4, 2] in the section that lead into the QUADRANTS of the two faces."""
        return QUADRANTS @ np.linalg.inv(self.normals).T

    def around(self, t: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Points [k n, 3] as `at` gives for lengths or angles [n] and each of some `ways` [k, 2] in turn."""
        if not self.is_round:
            along = self.origin + t[:, None] * self.frame[:, 2]
            return (along + (ways @ self.frame[:, :2].T)[:, None]).reshape(-1, 3)
        radii, local = self.radius + ways[:, :1], np.empty((len(ways), len(t), 3))
        local[..., 0], local[..., 1], local[..., 2] = radii * np.cos(t), radii * np.sin(t), ways[:, 1:]
        return self.origin + local.reshape(-1, 3) @ self.frame.T


class Interval(NamedTuple):
    """A piece of a track, from `low` to `high`, along which one quadrant (`sides` of the two faces) is material alone, or air alone."""

    low: float
    high: float
    sides: tuple[int, int]
    is_convex: bool
    is_closed: bool = False


@dataclass(frozen=True, eq=False)
class BlendedEdge:
    """A stretch of an edge of a solid along which edge number `edge` of feature number `feature` is blended: with `sizes`, the first along
    the first face. `goes_on` says for each end whether what lies beyond it is as what the blend is swept through."""

    feature: int
    edge: int
    track: Track
    stretch: Interval
    sizes: tuple[float, float]
    kind: EdgeKind
    goes_on: tuple[bool, bool]

    @property
    def size(self) -> float:
        return max(self.sizes)

    @property
    def length(self) -> float:
        return (self.stretch.high - self.stretch.low) * (self.track.radius if self.track.is_round else 1.0)

    @property
    def first_along(self) -> np.ndarray:
        """The unit vector [3] from the middle of the stretch along its first face."""
        inward = self.track.normals * np.array(self.stretch.sides)[:, None]
        middle = np.array([(self.stretch.low + self.stretch.high) / 2])
        return (self.track.at(middle, _into(inward[0], inward[1])[None]) - self.track.at(middle, np.zeros((1, 2))))[0]

    def points(self, count: int) -> np.ndarray:
        """Points [count, 3] along the stretch at equal distances, both ends among them."""
        return self.track.at(np.linspace(self.stretch.low, self.stretch.high, count), np.zeros((count, 2)))

    def distances(self, points: np.ndarray) -> np.ndarray:
        """How far points [n, 3] are from the stretch, [n]."""
        t = self._along(points)
        nearest = t if self.stretch.is_closed else np.clip(t, self.stretch.low, self.stretch.high)
        return lengths(points - self.track.at(nearest, np.zeros((len(points), 2))))

    def share_of(self, points: np.ndarray) -> float:
        """How much of the way along the track from the first to the last of points [n, 3] is the stretch's."""
        t = self._along(points)
        if self.stretch.is_closed or np.ptp(t) == 0:
            return 1.0
        low, high = max(self.stretch.low, float(t.min())), min(self.stretch.high, float(t.max()))
        return max(high - low, 0.0) / float(np.ptp(t))

    def _along(self, points: np.ndarray) -> np.ndarray:
        """The lengths or angles [n] at which points [n, 3] lie along the track, angles about the middle of the stretch."""
        local = (points - self.track.origin) @ self.track.frame
        if not self.track.is_round:
            return local[:, 2]
        middle = (self.stretch.low + self.stretch.high) / 2
        return middle + np.remainder(np.arctan2(local[:, 1], local[:, 0]) - middle + math.pi, 2 * math.pi) - math.pi

    def end(self, k: int) -> np.ndarray:
        """The point [3] in which the stretch begins, k = 0, or ends."""
        return self.track.at(np.array([self.stretch[k]]), np.zeros((1, 2)))[0]

    def direction(self, at: np.ndarray) -> np.ndarray:
        """The unit vector [3] along the edge at a point of it."""
        axis = self.track.frame[:, 2]
        if not self.track.is_round:
            return axis
        out = cross(axis, at - self.track.origin)
        return out / np.linalg.norm(out)


def meet_faces(
    normals: np.ndarray, sides: tuple[int, int], sizes: tuple[float, float], kind: str
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], float]:
    """In a section about the edge's point: the normals [2, 2] from both faces into the quadrant, where the blend meets either face, and
    half the angle between these."""
    inward = normals * np.array(sides)[:, None]
    along = np.array([_into(inward[0], inward[1]), _into(inward[1], inward[0])])
    half = math.acos(float(np.clip(along[0] @ along[1], -1, 1))) / 2
    one, two = (s / math.tan(half) if kind == "fillet" else s for s in sizes)
    return inward, (along[0] * one, along[1] * two), half


def _into(normal: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The unit vector across `normal` that leads to where `other` points."""
    way = np.array([-normal[1], normal[0]])
    return way if way @ other > 0 else -way
