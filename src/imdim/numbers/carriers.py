"""The lines and circles that the curves of an outline lie on: where they cross, and where they touch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.numbers.design_values import decimal
from imdim.program.outline import Curve, Point, arc_center, arc_middle, arc_radius

RESIDUE = 4e-15  # of a coordinate: what binary fractions add to decimal ones


@dataclass(frozen=True)
class Line:
    """All points p with ``normal . p = offset``, along `degrees` (0 to 180); `middle` and `length` are the curve's."""

    degrees: float
    offset: float
    middle: Point
    length: float

    @property
    def direction(self) -> Point:
        return unit(self.degrees)

    @property
    def normal(self) -> Point:
        x, y = self.direction
        return -y + 0.0, x


@dataclass(frozen=True)
class Arc:
    """A circle, +1 where the curve runs counter-clockwise, else -1, and the curve's start, middle and end as they were given."""

    center: Point
    radius: float
    sense: int
    points: tuple[Point, Point, Point]

    def spread(self, center: Point) -> list[float]:
        """Distances of the points from another centre."""
        return [math.dist(center, p) for p in self.points]


Carrier = Line | Arc
Condition = Callable[[Point], tuple[float, Point]]  # of a centre: how far it is from holding, and the derivative


def unit(degrees: float) -> Point:
    """Cosine and sine, exact for quarter turns."""
    quarter, rest = divmod(degrees, 90.0)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    return ((c, s), (-s, c), (-c, -s), (s, -c))[int(quarter) % 4]


def carrier_of(curve: Curve) -> Carrier:
    x, y, u, v, bulge = curve
    if bulge:
        return Arc(arc_center(curve), arc_radius(curve), 1 if bulge > 0 else -1, ((x, y), arc_middle(curve), (u, v)))
    degrees, middle = math.degrees(math.atan2(v - y, u - x)) % 180.0, ((x + u) / 2, (y + v) / 2)
    c, s = unit(degrees)
    return Line(degrees, -s * middle[0] + c * middle[1], middle, math.hypot(u - x, v - y))


def offset_of(line: Line, point: Point) -> float:
    """Signed distance of a point."""
    nx, ny = line.normal
    return nx * point[0] + ny * point[1] - line.offset


def tangent_distance(a: Arc, b: Arc) -> float:
    """How far apart the centres are where one circle touches the other, from without or from within, whichever is nearer to what is."""
    apart = math.dist(a.center, b.center)
    return min((a.radius + b.radius, abs(a.radius - b.radius)), key=lambda d: abs(d - apart))


def fold_degrees(degrees: float, period: float) -> float:
    """The same modulo `period`, around 0."""
    return (degrees + period / 2) % period - period / 2


def fit_between_parallels(arc: Arc, others: Sequence[Carrier]) -> Arc:
    """An arc that joins two parallel lines has their distance as its diameter."""
    lines = [other for other in others if isinstance(other, Line)]
    if len(lines) == 2 and lines[0].degrees == lines[1].degrees and lines[0].offset != lines[1].offset:
        return replace(arc, radius=decimal(abs(lines[0].offset - lines[1].offset) / 2))
    return arc


def tangency(arc: Arc, other: Carrier) -> Condition:
    """That an arc's centre is a radius away from a line, or as far as it takes from another centre."""
    if isinstance(other, Line):
        side = math.copysign(arc.radius, offset_of(other, arc.center))
        return lambda center: (offset_of(other, center) - side, other.normal)
    wanted, (x, y) = tangent_distance(arc, other), other.center

    def from_center(center: Point) -> tuple[float, Point]:
        apart = math.dist(center, other.center)
        return apart - wanted, ((center[0] - x) / apart, (center[1] - y) / apart)

    return from_center


def move_onto(center: Point, conditions: Sequence[Condition]) -> Point:
    """The nearest centre that meets all conditions, by Newton's method."""
    for _ in range(30 if conditions else 0):
        rows = [condition(center) for condition in conditions]
        step = np.linalg.lstsq(np.array([slope for _, slope in rows]), -np.array([off for off, _ in rows]), rcond=1e-9)[0]
        center = (center[0] + float(step[0]), center[1] + float(step[1]))
        if np.abs(step).max() <= RESIDUE * max(map(abs, center)):
            break
    return tidy(center[0]), tidy(center[1])


def goes_on(a: Carrier, b: Carrier) -> bool:
    """Whether two edges are on one line."""
    return isinstance(a, Line) and isinstance(b, Line) and (a.degrees, a.offset) == (b.degrees, b.offset)


def tangent_point(a: Carrier, b: Carrier, near: Point) -> Point:
    if isinstance(a, Arc) and isinstance(b, Arc):
        apart = math.dist(a.center, b.center)
        way = ((b.center[0] - a.center[0]) / apart, (b.center[1] - a.center[1]) / apart)
        ends = [(a.center[0] + s * a.radius * way[0], a.center[1] + s * a.radius * way[1]) for s in (1, -1)]
        return min(ends, key=lambda p: math.dist(p, near))
    line, arc = (a, b) if isinstance(a, Line) else (b, a)
    assert isinstance(line, Line)
    assert isinstance(arc, Arc)
    off, (nx, ny) = offset_of(line, arc.center), line.normal
    return arc.center[0] - off * nx, arc.center[1] - off * ny


def crossings(a: Carrier, b: Carrier, near: Point) -> Iterator[Point]:
    if isinstance(a, Line) and isinstance(b, Line):
        (ax, ay), (bx, by) = a.normal, b.normal
        cross = ax * by - ay * bx
        if abs(cross) > 1e-9:
            yield (a.offset * by - b.offset * ay) / cross, (ax * b.offset - bx * a.offset) / cross
    elif isinstance(a, Arc) and isinstance(b, Arc):
        yield from _circle_crossings(a, b, near)
    else:
        line, arc = (a, b) if isinstance(a, Line) else (b, a)
        assert isinstance(line, Line)
        assert isinstance(arc, Arc)
        yield from _line_crossings(line, arc)


def _line_crossings(line: Line, arc: Arc) -> Iterator[Point]:
    off, (nx, ny), (ux, uy) = offset_of(line, arc.center), line.normal, line.direction
    if abs(off) <= arc.radius:
        half = math.sqrt(arc.radius**2 - off**2)
        for t in (half, -half):
            yield arc.center[0] - off * nx + t * ux, arc.center[1] - off * ny + t * uy


def _circle_crossings(a: Arc, b: Arc, near: Point) -> Iterator[Point]:
    dx, dy = b.center[0] - a.center[0], b.center[1] - a.center[1]
    apart = math.hypot(dx, dy)
    if apart == 0:
        if a.radius == b.radius:  # one circle: the vertex stays at its angle
            far = math.dist(near, a.center)
            yield tuple(c + a.radius * (p - c) / far for c, p in zip(a.center, near, strict=True))  # type: ignore[misc]
        return
    along = (apart**2 + a.radius**2 - b.radius**2) / (2 * apart)
    if abs(along) <= a.radius:
        half = math.sqrt(a.radius**2 - along**2)
        for t in (half, -half):
            yield a.center[0] + (along * dx - t * dy) / apart, a.center[1] + (along * dy + t * dx) / apart


def bulge_of(arc: Arc, start: Point, end: Point) -> float:
    (ax, ay), (bx, by) = ((x - arc.center[0], y - arc.center[1]) for x, y in (start, end))
    sweep = math.atan2(ax * by - ay * bx, ax * bx + ay * by) * arc.sense % (2 * math.pi)
    return arc.sense * tidy(math.tan(sweep / 4))


def tidy(number: float) -> float:
    """Without what binary fractions add to a decimal number; other numbers keep all their digits."""
    rounded = decimal(number)
    return rounded if abs(rounded - number) <= RESIDUE * max(abs(number), 1.0) else number + 0.0
