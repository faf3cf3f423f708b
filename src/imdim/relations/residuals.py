"""The residuals of constraints on a program's numbers, with their derivatives by the nine coordinates that `pose` gives each leaf.

Residuals are lengths, or sines of angles; both vanish exactly where the constraint holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import Pose, Row
from imdim.program.constraints import AXES, AXES_OF, WORLD, Constraint, ConstraintError, Ref, check, describe
from imdim.program.tree import Program, envelope, leaves

HOLDS = 1e-7  # of the largest size: what a residual may be off, where files keep nine digits of each number
DEPENDENT = 1e-7  # a row shorter than this share of what it was is a combination of the others


@dataclass(frozen=True)
class ResidualRows:
    """Residuals [m], their Jacobian [m, 9 k], and the number of the constraint that each row belongs to."""

    residual: np.ndarray
    jacobian: np.ndarray
    owner: np.ndarray


def rows_of(constraints: Iterable[Constraint], numbers: Lowered | Pose) -> ResidualRows:
    """All constraints at the numbers of a program, which must be well-formed for it (see `check`)."""
    pose = numbers if isinstance(numbers, Pose) else Pose.of(numbers)
    residual: list[float] = []
    jacobian: list[np.ndarray] = []
    owner: list[int] = []
    for number, constraint in enumerate(constraints):
        for value, slope in _ROWS[constraint.kind](constraint, pose):
            residual.append(value)
            jacobian.append(slope)
            owner.append(number)
    width = 9 * len(pose.numbers.kinds)
    return ResidualRows(np.array(residual), np.array(jacobian).reshape(-1, width), np.array(owner, int))


def verify(program: Program, constraints: Sequence[Constraint], tolerance: float = HOLDS) -> None:
    """Raise ConstraintError, one line that names the constraint, unless all are well-formed and hold to `tolerance` times the largest size.

    Where those that hold leave no room for the one at fault, they are named as what it contradicts.
    """
    parts = list(leaves(program))
    for number, constraint in enumerate(constraints):
        check(number, constraint, parts)
    found = rows_of(constraints, lower(program))
    off = np.abs(found.residual) / max(max(envelope(p).size) for p in parts)
    wrong = np.flatnonzero(~(off <= tolerance))
    if len(wrong):
        row = int(wrong[np.argmax(off[wrong])])
        number = int(found.owner[row])
        others = _implying(found.jacobian, row, found.owner)
        reason = f"contradicts constraints {', '.join(map(str, others))}" if others else f"is off by {found.residual[row]:.3g}"
        raise ConstraintError(f"{describe(number, constraints[number])}: {reason}")


def holding(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Those of the constraints that hold for `program`, whose numbers have changed."""
    offsets = _offsets(program, constraints)
    return tuple(c for c, off in zip(constraints, offsets, strict=True) if off is None)


def rebase_constraints(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints as they hold for `program`, whose numbers have changed.

    Faces and centres that were level keep the distance that they now have; what else no longer holds is left out.
    """
    out: list[Constraint] = []
    for constraint, off in zip(constraints, _offsets(program, constraints), strict=True):
        if off is None:
            out.append(constraint)
        elif constraint.kind in ("coplanar", "aligned"):
            out.append(replace(constraint, value=float(f"{constraint.value + off[0]:.9g}")))
    return tuple(out)


def _offsets(program: Program, constraints: Sequence[Constraint]) -> Iterator[np.ndarray | None]:
    """The residuals of each constraint, None where it holds as well as the nine digits of a file let it."""
    numbers = lower(program)
    largest = max(max(envelope(p).size) for p in leaves(program))
    for constraint in constraints:
        off = rows_of([constraint], numbers).residual
        yield None if np.abs(off).max(initial=0.0) <= HOLDS * largest / 2 else off


def _implying(jacobian: np.ndarray, row: int, owner: np.ndarray) -> list[int]:
    """The constraints of other rows of which `row` is a combination, none if it is none."""
    others = np.flatnonzero(owner != owner[row])
    weights = np.linalg.lstsq(jacobian[others].T, jacobian[row], rcond=DEPENDENT)[0]
    rest = jacobian[row] - weights @ jacobian[others]
    if np.linalg.norm(rest) > DEPENDENT * np.linalg.norm(jacobian[row]):
        return []
    return sorted({int(owner[i]) for i, w in zip(others, weights, strict=True) if abs(w) > 1e-6})


def _minus(a: Row, b: Row) -> Row:
    return a[0] - b[0], a[1] - b[1]


def _equal(c: Constraint, pose: Pose) -> list[Row]:
    first, *others = (pose.size(ref) for ref in c.of)
    return [_minus(other, first) for other in others]


def _value(c: Constraint, pose: Pose) -> list[Row]:
    size, slope = pose.size(c.of[0])
    return [(size - c.value, slope)]


def _parallel(c: Constraint, pose: Pose) -> list[Row]:
    first, *others = c.of
    u, v = pose.across(first)
    return [side.dot(pose.axis(other)) for other in others for side in (u, v)]


def _coplanar(c: Constraint, pose: Pose) -> list[Row]:
    first, second = c.of
    value, slope = (pose.position(second) - pose.position(first)).dot(pose.axis(first))
    return [(first.side * value - c.value, first.side * slope)]


def _rows_of_aligned(c: Constraint, pose: Pose) -> list[Row]:
    assert c.about is not None
    first, second = c.of
    value, slope = (pose.position(second) - pose.position(first)).dot(pose.axis(c.about))
    return [(value - c.value, slope)]


def _coaxial(c: Constraint, pose: Pose) -> list[Row]:
    first, *others = c.of
    offsets = [pose.center(other.leaf) - pose.center(first.leaf) for other in others]
    return [side.dot(offset) for offset in offsets for side in pose.across(first)]


def _concentric(c: Constraint, pose: Pose) -> list[Row]:
    first, *others = c.of
    offsets = [pose.center(other.leaf) - pose.center(first.leaf) for other in others]
    return [pose.direction(WORLD, axis).dot(offset) for offset in offsets for axis in range(3)]


def _tangent(c: Constraint, pose: Pose) -> list[Row]:
    first, second = c.of
    radius = pose.size(first)
    if second.side:
        away, slope = (pose.center(first.leaf) - pose.position(second)).dot(pose.axis(second))
        return [_minus((abs(away), math.copysign(1.0, away) * slope), radius)]
    offset, other = pose.center(second.leaf) - pose.center(first.leaf), pose.size(second)
    # a ball touches a wall across the wall's axis
    tube = next((ref for ref in c.of if pose.kind(ref.leaf) == "cylinder"), None)
    sides = [pose.direction(WORLD, axis) for axis in range(3)] if tube is None else pose.across(Ref(tube.leaf, "z"))
    apart = _norm([side.dot(offset) for side in sides])
    outside, inside = (radius[0] + other[0], radius[1] + other[1]), _minus(*sorted((radius, other), key=lambda row: -row[0]))
    return [_minus(apart, outside if abs(apart[0] - outside[0]) <= abs(apart[0] - inside[0]) else inside)]


def _norm(rows: Sequence[Row]) -> Row:
    """The length of a vector of lengths; where it has none, that of its first."""
    value = math.hypot(*(row[0] for row in rows))
    if value == 0.0:
        return rows[0]
    return value, sum((row[0] / value * row[1] for row in rows), np.zeros_like(rows[0][1]))


def _symmetric(c: Constraint, pose: Pose) -> list[Row]:
    assert c.about is not None
    first, second, middle = (pose.position(ref) for ref in c.of)
    return [((first - middle) + (second - middle)).dot(pose.axis(c.about))]


def _linear(c: Constraint, pose: Pose) -> list[Row]:
    first = c.of[0].leaf
    axes = range(2) if AXES_OF[pose.kind(first)] == ("z",) else range(3)
    points = [pose.center(ref.leaf) for ref in c.of]
    bends = [(a - b) + (d - b) for a, b, d in zip(points, points[1:], points[2:], strict=False)]
    return [pose.direction(first, axis).dot(bend) for bend in bends for axis in axes]


def _circular(c: Constraint, pose: Pose) -> list[Row]:
    assert c.about is not None
    sides = pose.across(c.about)
    members = [ref.leaf for ref in c.of]
    points = [[side.dot(pose.center(leaf)) for side in sides] for leaf in members]
    angle = 2 * math.pi / len(members)
    rows: list[Row] = []
    for a, b, d in zip(points, points[1:], points[2:], strict=False):
        back, ahead = [_minus(q, p) for p, q in zip(a, b, strict=True)], [_minus(q, p) for p, q in zip(b, d, strict=True)]
        rows += [_minus(q, p) for p, q in zip(_turn(back, angle), ahead, strict=True)]
    if c.about.leaf not in members:
        for i, side in enumerate(sides):
            values, slopes = zip(*(p[i] for p in points), strict=True)
            mean = sum(values) / len(values), np.mean(slopes, axis=0)
            rows.append(_minus(mean, side.dot(pose.center(c.about.leaf))))
    turning = [ref for ref in c.of if ref.feature and len(AXES_OF[pose.kind(ref.leaf)]) == 3]
    axes = [[side.dot(pose.axis(ref)) for side in sides] for ref in turning]
    rows += [_cross(_turn(a, angle), b) for a, b in pairwise(axes)]
    return rows


def _turn(point: list[Row], angle: float) -> list[Row]:
    (x, dx), (y, dy) = point
    c, s = math.cos(angle), math.sin(angle)
    return [(c * x - s * y, c * dx - s * dy), (s * x + c * y, s * dx + c * dy)]


def _cross(a: list[Row], b: list[Row]) -> Row:
    (ax, dax), (ay, day), (bx, dbx), (by, dby) = *a, *b
    return ax * by - ay * bx, ax * dby + by * dax - ay * dbx - bx * day


def _rows_of_fixed(c: Constraint, pose: Pose) -> list[Row]:
    """What a person holds while the rest is solved; no document knows it. A size, a centre measured along the axis `about`, or the turn
    about a local axis, which stays what it is."""
    ref = c.of[0]
    if c.about is not None:
        value, slope = pose.center(ref.leaf).dot(pose.axis(c.about))
        return [(value - c.value, slope)]
    if ref.feature in AXES:
        slope = np.zeros(9 * len(pose.numbers.kinds))
        slope[9 * ref.leaf + 6 + ref.axis] = 1.0
        return [(0.0, slope)]
    return _value(c, pose)


_ROWS: Mapping[str, Callable[[Constraint, Pose], list[Row]]] = {
    "fixed": _rows_of_fixed,
    "equal": _equal,
    "value": _value,
    "parallel": _parallel,
    "perpendicular": lambda c, pose: [pose.axis(c.of[0]).dot(pose.axis(c.of[1]))],
    "coplanar": _coplanar,
    "aligned": _rows_of_aligned,
    "coaxial": _coaxial,
    "concentric": _concentric,
    "tangent": _tangent,
    "symmetric": _symmetric,
    "linear": _linear,
    "circular": _circular,
}
