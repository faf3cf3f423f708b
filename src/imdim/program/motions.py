"""Rigid motions of primitives: steps, turns about a line, and mirror images.

Every primitive but a drawn one is its own mirror image in its local x, so that a mirrored one is a turned one again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from imdim.program.rewrite.containment import axes
from imdim.program.tree import FULL_TURN, Primitive, Program, Vec3, map_leaves
from imdim.program.vectors import dot

Matrix = tuple[Vec3, Vec3, Vec3]  # rows

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ROUND = ("cylinder", "cone", "torus")
SAME_DIRECTION = 1e-12
ANGLE_DIGITS = 10


@dataclass(frozen=True, slots=True)
class Motion:
    """``world -> linear @ world + shift``; `mirrors` where `linear` has determinant -1."""

    linear: Matrix
    shift: Vec3
    mirrors: bool = False

    def point(self, p: Vec3) -> Vec3:
        """Where a point comes to lie."""
        x, y, z = (dot(row, p) + t for row, t in zip(self.linear, self.shift, strict=True))
        return x, y, z

    def direction(self, d: Vec3) -> Vec3:
        """Where a direction comes to point."""
        x, y, z = (dot(row, d) for row in self.linear)
        return x, y, z


def step(vector: Vec3) -> Motion:
    """A translation."""
    return Motion(IDENTITY, vector)


def turn(point: Vec3, axis: Vec3, degrees: float) -> Motion:
    """A turn about the line through `point` along the unit vector `axis` (Rodrigues' formula); exact for right angles."""
    cosine, sine = _cosine_sine(degrees)
    x, y, z = axis
    skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [[cosine * (i == j) + (1 - cosine) * axis[i] * axis[j] + sine * skew[i][j] for j in range(3)] for i in range(3)]
    return _about(point, tuple(tuple(row) for row in rows), False)  # type: ignore[arg-type]


def mirror(point: Vec3, normal: Vec3) -> Motion:
    """The image in the plane through `point` with the unit `normal`."""
    rows = [[float(i == j) - 2 * normal[i] * normal[j] for j in range(3)] for i in range(3)]
    return _about(point, tuple(tuple(row) for row in rows), True)  # type: ignore[arg-type]


def after(second: Motion, first: Motion) -> Motion:
    """`first`, and then `second`."""
    columns = [tuple(row[j] for row in first.linear) for j in range(3)]
    rows = tuple(tuple(dot(row, column) for column in columns) for row in second.linear)  # type: ignore[arg-type]
    return Motion(rows, second.point(first.shift), first.mirrors != second.mirrors)  # type: ignore[arg-type]


def move_program(program: Program, motion: Motion) -> Program:
    """The program as a rigid whole in another place."""
    return map_leaves(program, lambda _, leaf: move_leaf(leaf, motion))


def move_leaf(leaf: Primitive, motion: Motion) -> Primitive:
    """A primitive elsewhere; angles stay as they are where the motion does not change what they say."""
    center = motion.point(leaf.center)
    if motion.linear == IDENTITY or leaf.kind == "sphere":
        return replace(leaf, center=center)
    frame = axes(leaf)
    if is_round(leaf) and math.dist(motion.direction(frame[2]), frame[2]) < SAME_DIRECTION:
        return replace(leaf, center=center)
    x, y, z = (motion.direction(axis) for axis in frame)
    if not motion.mirrors:
        return replace(leaf, center=center, rotation=euler(x, y, z))
    if leaf.kind == "revolve":  # its image turns the other way: it starts where that ends
        cosine, sine = _cosine_sine(leaf.size[0])
        start = _weigh(x, cosine, y, sine)
        return replace(leaf, center=center, rotation=euler(start, _weigh(x, sine, y, -cosine), z))
    x = (-x[0], -x[1], -x[2])
    return replace(leaf, center=center, rotation=euler(x, y, z), outline=leaf.outline and leaf.outline.mirror())


def is_round(leaf: Primitive) -> bool:
    """Whether turns about local z change nothing."""
    return leaf.kind in ROUND or (leaf.kind == "revolve" and leaf.size[0] == FULL_TURN)


def _weigh(a: Vec3, s: float, b: Vec3, t: float) -> Vec3:
    return (s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2])


def _about(point: Vec3, linear: Matrix, mirrors: bool) -> Motion:
    x, y, z = (p - dot(row, point) for row, p in zip(linear, point, strict=True))
    return Motion(linear, (x, y, z), mirrors)


def _cosine_sine(degrees: float) -> tuple[float, float]:
    quarter, rest = divmod(degrees, 90.0)
    cosine = 0.5 if rest == 60 else math.cos(math.radians(rest))
    sine = 0.5 if rest == 30 else math.sin(math.radians(rest))
    return ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))[int(quarter) % 4]


def euler(x: Vec3, y: Vec3, z: Vec3) -> Vec3:
    """Degrees (rx, ry, rz) of the rotation with these columns, R = Rz Ry Rx."""
    flat = math.hypot(x[0], x[1])
    ry = math.atan2(-x[2], flat)
    if flat > 1e-9:
        rx, rz = math.atan2(y[2], z[2]), math.atan2(x[1], x[0])
    else:
        rx, rz = math.atan2(-z[1], y[1]), 0.0
    a, b, c = (round(math.degrees(angle), ANGLE_DIGITS) + 0.0 for angle in (rx, ry, rz))
    return a, b, c
