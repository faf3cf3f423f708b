"""Plain three-vectors."""

from __future__ import annotations

import math

from imdim.program.tree import Vec3


def minus(a: Vec3, b: Vec3) -> Vec3:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def plus(a: Vec3, b: Vec3) -> Vec3:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(a: Vec3, factor: float) -> Vec3:
    """A multiple of a."""
    return a[0] * factor, a[1] * factor, a[2] * factor


def along(p: Vec3, direction: Vec3, t: float) -> Vec3:
    """p + t * direction."""
    return p[0] + t * direction[0], p[1] + t * direction[1], p[2] + t * direction[2]


def dot(a: Vec3, b: Vec3) -> float:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def unit(v: Vec3) -> Vec3:
    """The direction of v, which must not be 0."""
    return times(v, 1 / math.hypot(*v))


def round_vector(v: Vec3, decimals: int) -> Vec3:
    """v to `decimals` decimals, without negative zeros."""
    x, y, z = (round(c, decimals) + 0.0 for c in v)
    return x, y, z


def is_forward(v: Vec3, tolerance: float = 1e-9) -> bool:
    """Whether the first coordinate that is not nothing is positive."""
    return next((c > 0 for c in v if abs(c) > tolerance), False)
