"""What designers draw with: dimensions in millimetres as people choose them, and features that stand on faces or go through."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from imdim.program.outline import Loop, Outline
from imdim.program.tree import Primitive, Program, Vec3, combine_all

BEYOND = 1.0  # by which cutters stick out of what they cut, as OpenSCAD needs it
GRIDS, SHARES = (1.0, 0.5, 0.1), (0.7, 0.2, 0.1)  # of which dimensions are multiples, and how often
SCREWS = ((3.4, 6.5), (4.5, 8.0), (5.5, 10.0), (6.6, 11.0), (9.0, 15.0))  # clearance holes and counterbores: ISO 273 medium, ISO 4762
TURNS: tuple[Vec3, ...] = ((0.0, 90.0, 0.0), (-90.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # which bring z to x, y and z
UPRIGHT: Vec3 = (90.0, 0.0, 0.0)  # which brings an outline's y to z
QUARTER = math.tan(math.pi / 8)  # bulge of a quarter of a circle


class Draw:
    """A designer's choices, from a generator of their own."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def length(self, low: float, high: float) -> float:
        """A dimension between two, in whole, half or tenths of millimetres."""
        grid = self.rng.choice(GRIDS, p=SHARES)
        return round(float(max(round(self.rng.uniform(low, max(low, high)) / grid), 1) * grid), 9)

    def count(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high + 1))

    def coin(self, share: float = 0.5) -> bool:
        return bool(self.rng.random() < share)

    def screw(self) -> tuple[float, float]:
        """Diameters of a screw's clearance hole and of its head's counterbore."""
        return SCREWS[self.count(0, len(SCREWS) - 1)]


def unite(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def cut(body: Program, *cuts: Program) -> Program:
    return combine_all("difference", [body, *cuts]) if cuts else body


def block(low: Vec3, size: Vec3) -> Primitive:
    """A box by its low corner."""
    return Primitive("box", size, _vec(c + s / 2 for c, s in zip(low, size, strict=True)))


def stand(x: float, y: float, z: float, size: Vec3) -> Primitive:
    """A box about (x, y) that stands at z."""
    return Primitive("box", size, (x, y, z + size[2] / 2))


def rod(diameter: float, at: Vec3, length: float, axis: int = 2) -> Primitive:
    """A cylinder that begins at a point and runs along an axis."""
    return Primitive("cylinder", (diameter / 2, length), _along(at, axis, length / 2), TURNS[axis])


def taper(bottom: float, top: float, at: Vec3, height: float) -> Primitive:
    """A cone by its diameters that stands at a point."""
    return Primitive("cone", (bottom / 2, top / 2, height), _along(at, 2, height / 2))


def ball(diameter: float, at: Vec3) -> Primitive:
    return Primitive("sphere", (diameter / 2,), at)


def through(diameter: float, at: Vec3, length: float, axis: int = 2) -> Primitive:
    """A round hole through so much of the part, from a point along an axis."""
    return rod(diameter, _along(at, axis, -BEYOND), length + 2 * BEYOND, axis)


def blind(diameter: float, at: Vec3, depth: float) -> Primitive:
    """A round hole from a top face at a point down."""
    return rod(diameter, _along(at, 2, -depth), depth + BEYOND)


def pocket(x: float, y: float, top: float, size: Vec3) -> Primitive:
    """A rectangular pocket about (x, y), as deep as `size` says, from a top face."""
    return stand(x, y, top - size[2], (size[0], size[1], size[2] + BEYOND))


def window(x: float, y: float, low: float, size: Vec3) -> Primitive:
    """A rectangular hole through so much of the part along z."""
    return stand(x, y, low - BEYOND, (size[0], size[1], size[2] + 2 * BEYOND))


def countersink(hole: float, head: float, at: Vec3) -> Primitive:
    """The cone of 90 degrees of a screw's head, from a top face at a point."""
    depth = (head - hole) / 2
    return taper(hole, head + 2 * BEYOND, _along(at, 2, -depth), depth + BEYOND)


def extrusion(loops: Sequence[Loop], at: Vec3, height: float, rotation: Vec3 = (0.0, 0.0, 0.0)) -> Primitive:
    """An outline swept so far, about a point."""
    return Primitive("extrude", (height,), at, rotation, Outline(tuple(loops)))


def turned(ring: Sequence[tuple[float, float]], at: Vec3 = (0.0, 0.0, 0.0)) -> Primitive:
    """A section of radius and height turned about z."""
    return Primitive("revolve", (360.0,), at, outline=Outline((tuple((r, z, 0.0) for r, z in ring),)))


def rounded(width: float, depth: float, radius: float) -> Loop:
    """A rectangle about the origin with round corners."""
    x, y, r = width / 2, depth / 2, radius
    corners = ((x, y), (-x, y), (-x, -y), (x, -y))
    ring: list[tuple[float, float, float]] = []
    for (cx, cy), (dx, dy) in zip(corners, ((0, -r), (r, 0), (0, r), (-r, 0)), strict=True):
        ring += [(cx + dx, cy + dy, QUARTER), (cx - abs(dy) * _sign(cx), cy - abs(dx) * _sign(cy), 0.0)]
    return tuple(ring)


def slot(length: float, width: float) -> Loop:
    """Two half circles, so far between their centres, and the lines between them."""
    x, y = length / 2, width / 2
    return ((x, -y, 1.0), (x, y, 0.0), (-x, y, 1.0), (-x, -y, 0.0))


def ring(points: Sequence[tuple[float, float]]) -> Loop:
    """Straight lines from corner to corner."""
    return tuple((x, y, 0.0) for x, y in points)


def round_off(points: Sequence[tuple[float, float]], radii: Sequence[float]) -> Loop:
    """A ring of straight lines whose corners are rounded, each by its radius; a radius of 0 leaves a corner sharp."""
    out: list[tuple[float, float, float]] = []
    for i, ((x, y), radius) in enumerate(zip(points, radii, strict=True)):
        (x0, y0), (x1, y1) = points[i - 1], points[(i + 1) % len(points)]
        before, after = math.atan2(y - y0, x - x0), math.atan2(y1 - y, x1 - x)
        turn = math.remainder(after - before, 2 * math.pi)
        reach = radius * math.tan(abs(turn) / 2)
        if radius:
            out.append((x - reach * math.cos(before), y - reach * math.sin(before), math.tan(turn / 4)))
        out.append((x + reach * math.cos(after), y + reach * math.sin(after), 0.0))
    return tuple(out)


def wrap(circles: Sequence[tuple[float, float, float]]) -> Loop:
    """Arcs of circles (x, y, radius) that go counterclockwise about a convex shape, and the lines that touch two of them each."""
    normals = []
    for i, (x0, y0, r0) in enumerate(circles):
        x1, y1, r1 = circles[(i + 1) % len(circles)]
        normals.append(math.atan2(y1 - y0, x1 - x0) - math.acos((r0 - r1) / math.dist((x0, y0), (x1, y1))))
    out: list[tuple[float, float, float]] = []
    for i, (x, y, r) in enumerate(circles):
        first, last = normals[i - 1], normals[i]
        bulge = math.tan((last - first) % (2 * math.pi) / 4)
        out += [(x + r * math.cos(first), y + r * math.sin(first), bulge), (x + r * math.cos(last), y + r * math.sin(last), 0.0)]
    return tuple(out)


def bend(path: Sequence[tuple[float, float]], thick: float, inside: float) -> Loop:
    """The section of a sheet that lies to the left of a path, with such a radius on the inside of its bends."""
    turns = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(path)]
    left = [_offset(path[0], turns[0], turns[0], thick)]
    left += [_offset(p, a, b, thick) for p, (a, b) in zip(path[1:-1], pairwise(turns), strict=True)]
    left.append(_offset(path[-1], turns[-1], turns[-1], thick))
    to_left = [math.remainder(b - a, 2 * math.pi) > 0 for a, b in pairwise(turns)]
    lower = [0.0, *(inside + thick if left else inside for left in to_left), 0.0]
    upper = [0.0, *(inside if left else inside + thick for left in to_left), 0.0]
    return round_off([*path, *reversed(left)], [*lower, *reversed(upper)])


def _offset(point: tuple[float, float], before: float, after: float, distance: float) -> tuple[float, float]:
    middle, reach = (before + math.remainder(after - before, 2 * math.pi) / 2) + math.pi / 2, distance
    reach /= math.cos(math.remainder(after - before, 2 * math.pi) / 2)
    return point[0] + reach * math.cos(middle), point[1] + reach * math.sin(middle)


def hexagon(flats: float) -> Loop:
    """A regular hexagon about the origin, by the distance between two of its sides."""
    return ring(circle(flats / 3**0.5, 6))


def four(x: float, y: float) -> list[tuple[float, float]]:
    """The corners of a rectangle about the origin, by half its sides."""
    return [(sx * x, sy * y) for sx in (1, -1) for sy in (1, -1)]


def circle(radius: float, count: int) -> list[tuple[float, float]]:
    """Places on a circle about the origin."""
    return [(radius * math.cos(2 * math.pi * i / count), radius * math.sin(2 * math.pi * i / count)) for i in range(count)]


def _sign(value: float) -> int:
    return 1 if value > 0 else -1


def _along(at: Vec3, axis: int, length: float) -> Vec3:
    return _vec(c + length * (i == axis) for i, c in enumerate(at))


def _vec(values: Iterable[float]) -> Vec3:
    x, y, z = values
    return x, y, z
