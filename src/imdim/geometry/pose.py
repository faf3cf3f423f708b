"""Features of a program's leaves, such as axes, faces and centres, with their derivatives by its numbers.

A leaf moves by nine coordinates, all lengths: its sizes, its shift along its own axes, and its rotation vector about them times its
bounding radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imdim.geometry.lowering import Lowered, row_curve
from imdim.geometry.rotations import skew
from imdim.program.constraints import WORLD, Ref
from imdim.program.outline import curve_bounds
from imdim.program.tree import KINDS, OUTLINED, SIZE_NAMES

Row = tuple[float, np.ndarray]


@dataclass(frozen=True)
class Vector:
    """A point or direction [3] with its derivative [3, 9 k]."""

    value: np.ndarray
    slope: np.ndarray

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.value - other.value, self.slope - other.slope)

    def __add__(self, other: Vector) -> Vector:
        return Vector(self.value + other.value, self.slope + other.slope)

    def dot(self, other: Vector) -> Row:
        return float(self.value @ other.value), self.value @ other.slope + other.value @ self.slope


@dataclass(frozen=True)
class Pose:
    """The features of leaves at given numbers."""

    numbers: Lowered
    radii: np.ndarray

    @staticmethod
    def of(numbers: Lowered) -> Pose:
        return Pose(numbers, radii(numbers))

    def _zeros(self) -> np.ndarray:
        return np.zeros((3, 9 * len(self.numbers.kinds)))

    def direction(self, leaf: int, axis: int) -> Vector:
        """A local axis of a leaf, or one of the world."""
        slope = self._zeros()
        if leaf == WORLD:
            return Vector(np.eye(3)[axis], slope)
        rotation = self.numbers.rotations[leaf]
        # a small turn w in the local frame moves R e by R (w x e)
        slope[:, 9 * leaf + 6 : 9 * leaf + 9] = -rotation @ skew(np.eye(3)[axis]) / self.radii[leaf]
        return Vector(rotation[:, axis], slope)

    def axis(self, ref: Ref) -> Vector:
        return self.direction(ref.leaf, ref.axis)

    def center(self, leaf: int) -> Vector:
        slope = self._zeros()
        slope[:, 9 * leaf + 3 : 9 * leaf + 6] = self.numbers.rotations[leaf]
        return Vector(self.numbers.centers[leaf], slope)

    def position(self, ref: Ref) -> Vector:
        """A point of a face (its centre), or a leaf's centre."""
        center = self.center(ref.leaf)
        if not ref.side:
            return center
        outward, column = self.axis(ref), self.column(ref.leaf, ref.axis)
        half = ref.side * self.numbers.sizes[ref.leaf, column] / 2
        slope = center.slope + half * outward.slope
        slope[:, 9 * ref.leaf + column] += ref.side / 2 * outward.value
        return Vector(center.value + half * outward.value, slope)

    def column(self, leaf: int, axis: int) -> int:
        """The size across a plane face."""
        kind = KINDS[self.numbers.kinds[leaf]]
        # the other sizes of a drafted outline come behind its height, those of other kinds before
        return axis if kind == "box" else 0 if kind == "drafted" else len(SIZE_NAMES[kind]) - 1

    def size(self, ref: Ref) -> Row:
        column = SIZE_NAMES[KINDS[self.numbers.kinds[ref.leaf]]].index(ref.feature)
        slope = np.zeros(9 * len(self.numbers.kinds))
        slope[9 * ref.leaf + column] = 1.0
        return float(self.numbers.sizes[ref.leaf, column]), slope

    def across(self, ref: Ref) -> tuple[Vector, Vector]:
        """Two directions that, with the axis `ref`, make a right-handed frame."""
        return self.direction(ref.leaf, (ref.axis + 1) % 3), self.direction(ref.leaf, (ref.axis + 2) % 3)

    def kind(self, leaf: int) -> str:
        return KINDS[self.numbers.kinds[leaf]]


def radii(numbers: Lowered) -> np.ndarray:
    """Bounding radii [k] of the leaves."""
    a, b, c = numbers.sizes.T
    of_kind = {
        "box": np.sqrt(a * a + b * b + c * c) / 2,
        "sphere": a,
        "cylinder": np.hypot(a, b / 2),
        "cone": np.hypot(np.maximum(a, b), c / 2),
        "torus": a + b,
        "ellipsoid": np.maximum(np.maximum(a, b), c),
    }
    rows = np.stack([of_kind.get(kind, np.zeros(len(a))) for kind in KINDS])
    out = rows[numbers.kinds, np.arange(len(a))]
    for leaf in np.flatnonzero(np.isin(numbers.kinds, [KINDS.index(kind) for kind in OUTLINED])):
        out[leaf] = _drawn_radius(numbers, int(leaf))
    return out


def extent_of(numbers: Lowered) -> float:
    """A length as large as the part."""
    return float(np.linalg.norm(np.ptp(numbers.centers, axis=0)) + 2 * radii(numbers).max())


def _drawn_radius(numbers: Lowered, leaf: int) -> float:
    """Bounding radius of an extruded or turned outline: that of the box or cylinder about its frame which holds it."""
    rows = numbers.outlines.curves[slice(*numbers.outlines.spans[leaf])]
    (left, low), (right, high) = curve_bounds(list(map(row_curve, rows)))
    beside, reach = max(-left, right), max(-low, high)
    along = 0.0 if KINDS[numbers.kinds[leaf]] == "revolve" else numbers.sizes[leaf, 0] / 2
    return math.hypot(beside, reach, along)
