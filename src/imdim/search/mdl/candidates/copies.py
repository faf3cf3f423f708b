"""Copies of a part, put in as one change: along a row or a grid, about an axis, in a mirror, and where a part like its neighbour is.

Each of a row of small things explains too few points to pay for its numbers; copies share theirs (`numbers.ties`). Where copies of a part
could be is told by what each of them alone would explain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from imdim.geometry.lowering import lower
from imdim.geometry.surface import vec
from imdim.numbers.shared_rotations import frames
from imdim.numbers.ties import have_same_shape
from imdim.program.motions import Motion, after, axes, euler, is_round, mirror, move_leaf, step, turn
from imdim.program.rewrite.containment import bounding_radius, reach
from imdim.program.tree import Primitive, Program, Vec3, leaves
from imdim.program.vectors import minus, times

MOST_TURNING = 1  # lines that copies are about
TURNS = (2, 3, 4, 5, 6, 8, 10, 12)  # copies in a full circle about an axis, the part itself counted
PLACES = 24  # to either side along an axis that are looked at
FINE, PARTED = 1.5, 5.0  # deviations of the noise, and parts of its length, by which a part is shifted at least
CLOSE = 0.9  # of a part's length, that copies are apart at least
PITCHES = 2  # of one part and axis
ALIKE = 1.0  # deviations of the noise by which parts differ that are taken for copies
MOST_CLASSES = 4


@dataclass(frozen=True)
class CopyPlaces:
    """Where copies of parts of a `program` could be: its points lie within `low` and `high` [3] along the `axes` [3, 3], as columns, and
    have noise of a deviation `sigma`."""

    program: Program
    axes: np.ndarray
    low: np.ndarray
    high: np.ndarray
    sigma: float

    @staticmethod
    def of(program: Program, points: np.ndarray, axes: np.ndarray, sigma: float, parallel_deg: float) -> CopyPlaces:
        """Along the program's own directions where it has some; `axes` [3, 3] are the part's."""
        numbers = lower(program)
        member, _ = frames(numbers, parallel_deg)
        own = numbers.rotations[int(np.flatnonzero(member == 0)[0])] if (member == 0).any() else axes
        along = points @ own
        low, high = np.quantile(along, (0.005, 0.995), axis=0)
        return CopyPlaces(program, own, low, high, sigma)

    @cached_property
    def _parts(self) -> list[Primitive]:
        return [*leaves(self.program)]

    @cached_property
    def classes(self) -> list[list[Primitive]]:
        """Leaves of one shape, of as many as have it."""
        out: list[list[Primitive]] = []
        for part in self._parts:
            own = next((group for group in out if have_same_shape(group[0], part, ALIKE * self.sigma)), None)
            if own is None:
                out.append([part])
            else:
                own.append(part)
        return sorted((group for group in out if len(group) > 1), key=len, reverse=True)[:MOST_CLASSES]

    def sets(self, part: Primitive) -> Iterator[list[Primitive]]:
        """Copies of a part that belong together: in the places of the copies of its neighbours, in mirrors, and about axes."""
        for group in self.classes:
            near = min(group, key=lambda p: math.dist(p.center, part.center))
            yield [move_leaf(part, step(minus(p.center, near.center))) for p in group if p is not near]
        for point in self._middles():
            images = [mirror(point, vec(self.axes[:, k])) for k in range(3)]
            across = [m for m, k in zip(images, range(3), strict=True) if self._is_off(part, point, k)]
            for m in across:
                yield [_image(part, m)]
            for one, other in combinations(across, 2):
                yield [_image(part, m) for m in (one, other, after(one, other))]
        for point, axis in self._turning():
            if _away(part.center, point, axis) > 2 * self.sigma:
                for n in TURNS:
                    yield [move_leaf(part, turn(point, axis, 360 * k / n)) for k in range(1, n)]

    def line(self, parts: Sequence[Primitive], axis: int, length: float) -> tuple[float, list[int]]:
        """The step between the places of copies along an axis, of parts that have some `length` there, and by how many steps they can be
        shifted within the cloud."""
        centers = np.array([part.center for part in parts]) @ self.axes[:, axis]
        room = centers.min() - self.low[axis], self.high[axis] - centers.max()
        fine = max(FINE * self.sigma, length / PARTED, (self.high[axis] - self.low[axis]) / (2 * PLACES))
        return fine, [*range(-int(max(room[0], 0.0) / fine), int(max(room[1], 0.0) / fine) + 1)]

    def shift(self, part: Primitive, axis: int, by: float) -> Primitive:
        """The part `by` so far along an axis."""
        return move_leaf(part, step(vec(by * self.axes[:, axis])))

    def length(self, part: Primitive, axis: int) -> float:
        """How long a part is along an axis at least, for copies that do not run into one another."""
        way = self.axes[:, axis]
        return reach(part, vec(way)) + reach(part, vec(-way))

    def _middles(self) -> list[Vec3]:
        """Points that planes of mirrors go through: the middle of the cloud, and that of the largest part where it is another."""
        middle = self.axes @ (self.low + self.high) / 2
        own = max(self._parts, key=bounding_radius).center
        return [vec(middle), *([own] if math.dist(own, middle) > self.sigma else [])]

    def _is_off(self, part: Primitive, point: Sequence[float], axis: int) -> bool:
        away = abs(float((np.array(part.center) - point) @ self.axes[:, axis]))
        return away > max(self.sigma, CLOSE * self.length(part, axis) / 2)

    def _turning(self) -> list[tuple[Vec3, Vec3]]:
        """Lines that what is round turns about, each once."""
        out: list[tuple[Vec3, Vec3]] = []
        for part in sorted((p for p in self._parts if is_round(p) and p.kind != "sphere"), key=bounding_radius, reverse=True):
            axis = axes(part)[2]
            if not any(abs(float(np.dot(a, axis))) > 0.999 and _away(part.center, p, a) < self.sigma for p, a in out):
                out.append((part.center, axis))
        return out[:MOST_TURNING]


def find_rows(gain: np.ndarray, at: int, least: int, enough: float) -> list[tuple[float, int, int]]:
    """Even rows of places through the one of index `at`, by what a copy at each would `gain` [m]: steps from one to the next, in places,
    how many there are before and how many after it; the most gained first. Steps are `least` or more, and each copy gains `enough`."""
    smooth = np.max([np.roll(gain, k) for k in (-1, 0, 1)], axis=0)
    smooth[[0, -1]] = gain[[0, -1]]
    found = []
    for pitch in range(max(least, 1), len(gain)):
        runs = []
        for way in (-1, 1):
            k = 0
            while 0 <= at + way * (k + 1) * pitch < len(gain) and smooth[at + way * (k + 1) * pitch] > enough:
                k += 1
            runs.append(k)
        before, behind = runs
        if before + behind:
            ks = [k for k in range(-before, behind + 1) if k]
            total = float(sum(smooth[at + k * pitch] for k in ks))
            # the best places near the even ones say how far apart they are
            best = [max((o for o in (-1, 0, 1) if 0 <= at + k * pitch + o < len(gain)), key=lambda o: gain[at + k * pitch + o]) for k in ks]
            exact = sum(k * (k * pitch + o) for k, o in zip(ks, best, strict=True)) / sum(k * k for k in ks)
            found.append((total, exact, before, behind))
    return [(exact, before, behind) for _, exact, before, behind in sorted(found, reverse=True)[:PITCHES]]


def _image(part: Primitive, motion: Motion) -> Primitive:
    """The mirror image of a part, with the same drawing: an extrusion is as it was seen from its other end, and what is turned all around
    from its other side."""
    if part.outline is None or not motion.mirrors or not (part.kind == "extrude" or is_round(part)):
        return move_leaf(part, motion)
    x, y, z = (motion.direction(axis) for axis in axes(part))
    turned = euler(x, y, times(z, -1.0)) if part.kind == "extrude" else euler(x, times(y, -1.0), z)
    return replace(part, center=motion.point(part.center), rotation=turned)


def _away(point: Sequence[float], on: Sequence[float], axis: Sequence[float]) -> float:
    """How far a point is from a line."""
    arm = np.subtract(point, on)
    return float(np.linalg.norm(arm - (arm @ axis) * np.array(axis)))
