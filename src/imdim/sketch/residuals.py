"""The constraint layers of the design (section 2.2) as residuals with their derivatives, row by row.

A function takes points [r, k, 3] and targets [r] and returns residuals [r, c] and Jacobians [r, c, k, 3]. Points and lengths come in
units of the theory's own length, angles in radians: a point that moves by a share of that length turns a line by as many radians, so
both weigh alike. Angles use atan2, whose slope is bounded where that of acos is not. Targets at which the plain residual has a kink
(two points that coincide, a straight angle, a point on a line) have a vector residual instead, whose rank is the true number of
freedoms removed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from imdim.geometry.rotations import skew
from imdim.sketch.theory import SketchConstraint

TINY = 1e-12  # lengths below it, in units of the theory's length, are treated as this long
STRAIGHT = 1e-9  # an angle this close to 0 or pi is meant to be straight

Rows = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Form:
    """`width` residuals of one constraint, and the smallest of the reference sizes [r] that the definition divides by."""

    width: int
    residual: Callable[[np.ndarray, np.ndarray], Rows]
    reference: Callable[[np.ndarray], np.ndarray]


def form_of(constraint: SketchConstraint) -> str:
    """The key of FORMS under which the constraint is evaluated."""
    kind, value = constraint.kind, constraint.value
    if kind == "angle":
        return "straight" if math.pi - value < STRAIGHT else "folded" if value < STRAIGHT else "angle"
    return {"distance": "coincident", "line_distance": "collinear", "plane_distance": "coplanar"}.get(kind, kind) if value == 0 else kind


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ri,ri->r", a, b)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rowwise; several times as fast as np.cross on short arrays."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def norm(a: np.ndarray) -> np.ndarray:
    return np.maximum(np.sqrt(dot(a, a)), TINY)


def _unit(a: np.ndarray) -> np.ndarray:
    return a / norm(a)[:, None]


def _outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, :, None] * b[:, None, :]


def _scalar(residual: np.ndarray, *slopes: np.ndarray) -> Rows:
    return residual[:, None], np.stack(slopes, axis=1)[:, None]


def distance(x: np.ndarray, target: np.ndarray) -> Rows:
    u = x[:, 0] - x[:, 1]
    length = norm(u)
    slope = u / length[:, None]
    return _scalar(length - target, slope, -slope)


def coincident(x: np.ndarray, _: np.ndarray) -> Rows:
    eye = np.broadcast_to(np.eye(3), (len(x), 3, 3))
    return x[:, 0] - x[:, 1], np.stack([eye, -eye], axis=2)


def angle(x: np.ndarray, target: np.ndarray) -> Rows:
    u, v = x[:, 0] - x[:, 1], x[:, 2] - x[:, 1]
    value, axis = _turn(u, v)
    by_u = -cross(axis, u) / (norm(u) ** 2)[:, None]
    by_v = cross(axis, v) / (norm(v) ** 2)[:, None]
    return _scalar(value - target, by_u, -by_u - by_v, by_v)


def _turn(u: np.ndarray, v: np.ndarray) -> Rows:
    """The angle [r] from u to v and the unit axis [r, 3] of that turn; any normal of u where they are parallel."""
    normal = cross(u, v)
    size = np.sqrt(dot(normal, normal))
    flat = size <= 1e-14 * norm(u) * norm(v)
    if flat.any():
        normal = normal.copy()
        normal[flat] = cross(u[flat], np.eye(3)[np.argmin(np.abs(u[flat]), axis=1)])
    return np.arctan2(size, dot(u, v)), _unit(normal)


def _parallel(x: np.ndarray, _: np.ndarray, sign: float) -> Rows:
    """The turn from u to v, or to -v, as a rotation vector [r, 3]: smooth where the angle itself is a cone."""
    u, v = x[:, 0] - x[:, 1], sign * (x[:, 2] - x[:, 1])
    value, axis = _turn(u, v)
    size = norm(u) * norm(v)
    sine = np.maximum(np.sin(value), 1e-9)
    per_normal = np.where(value < 1e-6, 1.0, value / sine) / size  # residual = per_normal * (u x v)
    across = np.eye(3) - _outer(axis, axis)
    along_u, along_v = -cross(axis, u) / (norm(u) ** 2)[:, None], cross(axis, v) / (norm(v) ** 2)[:, None]
    by_u = _outer(axis, along_u) - (across @ skew(v)) * per_normal[:, None, None]
    by_v = _outer(axis, along_v) + (across @ skew(u)) * per_normal[:, None, None]
    return value[:, None] * axis, np.stack([by_u, -by_u - sign * by_v, sign * by_v], axis=2)


def _from_line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The line's unit direction and length, the share of it at the foot, and the vector from the foot to the point."""
    t, w = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    length = norm(t)
    direction = t / length[:, None]
    along = dot(w, direction)
    return direction, length, along / length, w - along[:, None] * direction


def line_distance(x: np.ndarray, target: np.ndarray) -> Rows:
    _, _, share, away = _from_line(x)
    slope = _unit(away)
    return _scalar(np.sqrt(dot(away, away)) - target, -(1 - share)[:, None] * slope, -share[:, None] * slope, slope)


def collinear(x: np.ndarray, _: np.ndarray) -> Rows:
    direction, length, share, away = _from_line(x)
    across = np.eye(3) - _outer(direction, direction)
    by_end = -share[:, None, None] * across - _outer(direction, away / length[:, None])
    return away, np.stack([-across - by_end, by_end, across], axis=2)


def equal_length(x: np.ndarray, _: np.ndarray) -> Rows:
    """The difference over the mean, which no shrinking of the whole can make small."""
    u, v = x[:, 0] - x[:, 1], x[:, 2] - x[:, 3]
    a, b = norm(u), norm(v)
    by_u = u / a[:, None] * (4 * b / (a + b) ** 2)[:, None]
    by_v = v / b[:, None] * (-4 * a / (a + b) ** 2)[:, None]
    return _scalar(2 * (a - b) / (a + b), by_u, -by_u, by_v, -by_v)


def torsion(x: np.ndarray, target: np.ndarray) -> Rows:
    """Derivatives: Blondel and Karplus, J. Comput. Chem. 17 (1996), without a division by the sine."""
    f, g, h = x[:, 0] - x[:, 1], x[:, 1] - x[:, 2], x[:, 3] - x[:, 2]
    a, b, length = cross(f, g), cross(h, g), norm(g)
    per_a, per_b = a / (norm(a) ** 2)[:, None], b / (norm(b) ** 2)[:, None]
    value = np.arctan2(dot(cross(b, a), g) / length, dot(a, b))
    by_i, by_l = -length[:, None] * per_a, length[:, None] * per_b
    lean = (dot(f, g) / length)[:, None] * per_a - (dot(h, g) / length)[:, None] * per_b
    error = value - target
    return _scalar(np.arctan2(np.sin(error), np.cos(error)), by_i, lean - by_i, -lean - by_l, by_l)


def _height(x: np.ndarray) -> Rows:
    """The signed height [r] over the plane of the first three points, and its slopes [r, 4, 3]."""
    e, f, w = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
    normal = cross(e, f)
    area = norm(normal)
    unit = normal / area[:, None]
    b, c = dot(cross(w, f), unit) / area, dot(cross(e, w), unit) / area
    shares = np.stack([b + c - 1, -b, -c, np.ones(len(x))], axis=1)
    return dot(w, unit), shares[:, :, None] * unit[:, None]


def coplanar(x: np.ndarray, _: np.ndarray) -> Rows:
    height, slopes = _height(x)
    return height[:, None], slopes[:, None]


def plane_distance(x: np.ndarray, target: np.ndarray) -> Rows:
    height, slopes = _height(x)
    side = np.where(height < 0, -1.0, 1.0)
    return (side * height - target)[:, None], (side[:, None, None] * slopes)[:, None]


def _no_reference(x: np.ndarray) -> np.ndarray:
    return np.ones(len(x))


def _shortest(x: np.ndarray, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """The length [r] of the shortest of some segments between points."""
    return np.min([norm(x[:, a] - x[:, b]) for a, b in pairs], axis=0)


def _triangle(x: np.ndarray) -> np.ndarray:
    return np.sqrt(norm(cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])))


_line = partial(_shortest, pairs=((0, 1),))
_two_legs = partial(_shortest, pairs=((0, 1), (2, 1)))
_two_lengths = partial(_shortest, pairs=((0, 1), (2, 3)))

FORMS = {
    "distance": Form(1, distance, _no_reference),
    "coincident": Form(3, coincident, _no_reference),
    "angle": Form(1, angle, _two_legs),
    "folded": Form(3, partial(_parallel, sign=1.0), _two_legs),
    "straight": Form(3, partial(_parallel, sign=-1.0), _two_legs),
    "line_distance": Form(1, line_distance, _line),
    "collinear": Form(3, collinear, _line),
    "equal_length": Form(1, equal_length, _two_lengths),
    "torsion": Form(1, torsion, lambda x: np.minimum(_triangle(x[:, :3]), _triangle(x[:, 1:]))),
    "plane_distance": Form(1, plane_distance, _triangle),
    "coplanar": Form(1, coplanar, _triangle),
}
