"""How curves of a loop go on where what was between them is taken out: in each other, or until they meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from imdim.program.outline import Curve, Point, Ring, arc_center, arc_radius

SQUARE = 1e-3  # of a sine, below which two lines meet too far away


class CurveJoint(NamedTuple):
    """Where a curve ends and the next one starts; None where the two are one."""

    corner: Point | None


def join(a: Curve, b: Curve, slack: float) -> CurveJoint | None:
    """How a goes on into b, lengths being equal within `slack`; None where it does not."""
    if _is_one(a, b, slack):
        return CurveJoint(None)
    corner = _corner(a, b, slack)
    return None if corner is None else CurveJoint(corner)


def close_ring(curves: Sequence[Curve], joints: Sequence[CurveJoint]) -> tuple[Ring, list[list[int]]] | None:
    """The ring of curves that are joined so, `joints[j]` being behind curve j, and by their numbers those that each of its curves is made
    of; None where all are one, or two make nothing."""
    first = next((j for j, joint in enumerate(joints) if joint.corner is not None), None)
    if first is None:
        return None
    vertices: list[tuple[float, float, float]] = []
    runs: list[list[int]] = []
    start, run = joints[first].corner, list[int]()
    for j in (*range(first + 1, len(curves)), *range(first + 1)):
        run.append(j)
        if (corner := joints[j].corner) is not None:
            assert start is not None
            vertices.append((*start, _bulge([curves[i] for i in run])))
            runs.append(run)
            start, run = corner, []
    return (tuple(vertices), runs) if len(vertices) > 2 or (len(vertices) == 2 and any(b for _, _, b in vertices)) else None


def _is_one(a: Curve, b: Curve, slack: float) -> bool:
    """Whether b goes on where a goes."""
    if bool(a[4]) != bool(b[4]):
        return False
    if a[4]:
        return a[4] * b[4] > 0 and math.dist(arc_center(a), arc_center(b)) <= slack and abs(arc_radius(a) - arc_radius(b)) <= slack
    ahead, normal = direction(a), turn_left(direction(a))
    off = [dot(normal, minus(p, a[:2])) for p in (b[:2], b[2:4])]
    return max(map(abs, off)) <= slack and dot(ahead, minus(b[:2], a[2:4])) > 0 and dot(ahead, direction(b)) > 0


def _corner(a: Curve, b: Curve, slack: float) -> Point | None:
    """Where a line goes on to, and another one comes from."""
    if a[4] or b[4]:
        return None
    (dx, dy), (ex, ey) = direction(a), direction(b)
    cross = dx * ey - dy * ex
    if abs(cross) < SQUARE:
        return None
    gx, gy = minus(b[:2], a[2:4])
    ahead, back = (gx * ey - gy * ex) / cross, (gx * dy - gy * dx) / cross
    return (a[2] + ahead * dx, a[3] + ahead * dy) if ahead > -slack and back < slack else None


def _bulge(run: Sequence[Curve]) -> float:
    """Of the curve from the start of the first to the end of the last, which go on in each other."""
    if len(run) == 1 or not run[0][4]:
        return run[0][4]
    center, way = arc_center(run[0]), math.copysign(1.0, run[0][4])
    turns = [4 * math.atan(curve[4]) for curve in run]
    for a, b in pairwise(run):
        turns.append(way * (way * (angle_at(b[:2], center) - angle_at(a[2:4], center)) % (2 * math.pi)))
    return math.tan(sum(turns) / 4)


def minus(a: Point, b: Point) -> Point:
    """a - b."""
    return a[0] - b[0], a[1] - b[1]


def dot(a: Point, b: Point) -> float:
    """The product of two vectors."""
    return a[0] * b[0] + a[1] * b[1]


def turn_left(v: Point) -> Point:
    """The vector turned to its left."""
    return -v[1], v[0]


def direction(curve: Curve) -> Point:
    """Of a curve's chord, of length 1."""
    x, y, u, v, _ = curve
    length = math.dist((x, y), (u, v))
    return (u - x) / length, (v - y) / length


def angle_at(p: Point, center: Point) -> float:
    """In which direction a point is from a centre, in radians."""
    return math.atan2(p[1] - center[1], p[0] - center[0])
