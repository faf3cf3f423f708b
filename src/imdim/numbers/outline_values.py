"""The numbers that a person would have typed for an outline: snapping it makes carriers equal, parallel, tangent and round.

An outline is described by its carriers: the line of each edge by its direction and its offset, the circle of each arc by its centre and
radius. These are rounded as `design_values` rounds sizes, to the coarsest decimal grid that moves nothing by more than a tolerance; arcs
that touched their neighbours touch them exactly. The vertices then are where consecutive carriers meet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import decimal, is_level, round_to_grid
from imdim.numbers.ellipse_values import STEPS_DEG, snap_ellipse
from imdim.numbers.outline_grids import OutlineGrids
from imdim.numbers.polygon_values import snap_polygon
from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Curve,
    Loop,
    Outline,
    Point,
    Ring,
    arc_center,
    arc_middle,
    arc_radius,
    check_crossings,
    circle,
    circle_of,
    loop_area,
    ring_curves,
)
from imdim.program.regular_polygon import regular_of
from imdim.program.tree import Primitive

FLATTEST = 0.05  # sine of the angle to an axis below which a line's crossing with the axis is no number of its own
FARTHEST = 20.0  # tolerances that a vertex may move: where curves meet at small angles it moves further than they do
MOST_HUBS = 8
EXACT = 1e-9  # degrees by which equal directions differ
TENTH = 10.0  # of an outline's size is the coarsest grid that its middle is put on, a hundredth of that the finest
ROUND = 1e-9  # of its size: a middle as near to the finest is round as it is
REGULAR = 5e-3  # of a polygon's extent, within which it is a regular one
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


def snap_outline(outline: Outline, tolerance: float, offset: Point = (0.0, 0.0), inches: bool = False, bits: float = 0.0) -> Outline:
    """The outline with round numbers in coordinates whose origin is at minus `offset`; the same one where a loop would degenerate.
    Of a part in `inches` fractions of these are round too. Numbers that are within `bits` of a grid that is far wider are on that.

    No carrier moves by more than about `tolerance`, along the curve that lies on it.
    """
    placed = outline.shift(*offset)
    try:
        snapped = Outline(tuple(_tidy_loop(loop, *offset) for loop in _snap_loops(placed, tolerance, inches, bits)))
        check_crossings(snapped)
    except (ValueError, ZeroDivisionError):
        return outline
    same_way = all(
        isinstance(b, Ellipse) or circle_of(b) or loop_area(a) * loop_area(b) > 0 for a, b in zip(outline.loops, snapped.loops, strict=True)
    )
    return snapped if same_way else outline


def _snap_loops(outline: Outline, tolerance: float, inches: bool, bits: float) -> Iterator[Loop]:
    """The loops with round numbers; regular polygons and ellipses after the others, so that they take the centres and sizes that these
    have."""
    grids = OutlineGrids.of(outline, tolerance, inches, bits)
    regular = [regular_of(loop, min(tolerance, REGULAR * _extent(loop))) for loop in outline.loops]
    free = tuple(loop for loop, polygon in zip(outline.loops, regular, strict=True) if not isinstance(loop, Ellipse) and polygon is None)
    rings = _snap_rings(free, grids) if free else []
    circles = [found for found in map(circle_of, rings) if found]
    centers, lengths = [c[:2] for c in circles], [c[2] for c in circles]
    left = iter(rings)
    for loop, polygon in zip(outline.loops, regular, strict=True):
        if polygon is not None:
            yield snap_polygon(polygon, grids, centers).ring()[:: 1 if loop_area(loop) > 0 else -1]
            continue
        if not isinstance(loop, Ellipse):
            yield next(left)
            continue
        snapped = snap_ellipse(loop, tolerance, grids.widths, centers, lengths)
        if isinstance(snapped, Ellipse):
            centers.append((snapped.x, snapped.y))
            lengths += [snapped.rx, snapped.ry]
        yield snapped


def _extent(loop: Loop) -> float:
    (left, low), (right, high) = Outline((loop,)).bounds
    return max(right - left, high - low)


class _PartedError(ValueError):
    """Two curves, each told by its loop and its number, no longer meet."""

    def __init__(self, curves: set[tuple[int, int]], near: Point) -> None:
        super().__init__(f"curves no longer meet near {near}")
        self.curves = curves


def _snap_rings(rings: tuple[Ring, ...], grids: OutlineGrids) -> list[Ring]:
    """Loops with round numbers. Curves that would no longer meet keep theirs, for one rounding among many is no reason to leave all odd."""
    held: set[tuple[int, int]] = set()
    while True:
        try:
            return _Snapping(rings, grids, held).loops()
        except _PartedError as parted:
            # an arc first, for a line may go on beyond it
            arcs = {(i, k) for i, k in parted.curves if rings[i][k][2]}
            held = held | (arcs if arcs - held else parted.curves)
            if 2 * len(held) > sum(map(len, rings)):
                raise


def _tidy_loop(loop: Loop, dx: float, dy: float) -> Loop:
    """The loop moved back by an offset."""
    if isinstance(loop, Ellipse):
        return replace(loop, x=_tidy(loop.x - dx), y=_tidy(loop.y - dy))
    return tuple((_tidy(x - dx), _tidy(y - dy), b) for x, y, b in loop)


def snap_leaf(leaf: Primitive, tolerance: float, inches: bool = False, bits: float = 0.0) -> Primitive:
    """The leaf with a round outline, about whose middle its centre is; of one along the world's axes, the places in the world are round.
    See `snap_outline`."""
    if leaf.outline is None:
        return leaf
    rotation = matrix_from_euler(leaf.rotation)
    rotation = np.round(rotation) if is_level(leaf) else rotation
    x, y, z = (rotation.T @ leaf.center).tolist() if is_level(leaf) else (0.0, 0.0, 0.0)
    across = leaf.kind == "extrude"
    offset = (x, y) if across else (0.0, z)
    snapped = snap_outline(leaf.outline, tolerance, offset, inches, bits)
    if snapped is leaf.outline:
        return leaf
    (left, low), (right, high) = snapped.bounds
    size = max(right - left, high - low)
    middle = (_round_middle(left, right, offset[0], size) if across else 0.0, _round_middle(low, high, offset[1], size))
    a, b, c = (_tidy(float(v)) for v in leaf.center + rotation @ ((*middle, 0.0) if across else (0.0, 0.0, middle[1])))
    return replace(leaf, center=(a, b, c), outline=Outline(tuple(_tidy_loop(loop, *middle) for loop in snapped.loops)))


def _round_middle(low: float, high: float, offset: float, size: float) -> float:
    """About the middle of two ends: where that is no round place by itself, one that leaves round corners round."""
    grid = 10.0 ** math.floor(math.log10(size / TENTH))
    middle = decimal((low + high) / 2 + offset)
    near = round_to_grid(middle, grid / TENTH**2)
    return decimal((near if abs(near - middle) <= ROUND * size else round_to_grid(middle, grid)) - offset)


def unit(degrees: float) -> Point:
    """Cosine and sine, exact for quarter turns."""
    quarter, rest = divmod(degrees, 90.0)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    return ((c, s), (-s, c), (-c, -s), (s, -c))[int(quarter) % 4]


@dataclass
class _Snapping:
    """The carriers of `given` loops, changed step by step; `carriers[i][k]` is that of curve k of loop i, and stays if (i, k) is `held`."""

    given: tuple[Ring, ...]
    grids: OutlineGrids
    held: set[tuple[int, int]]
    carriers: list[list[Carrier]] = field(init=False)

    def __post_init__(self) -> None:
        self.carriers = [[_carrier(curve) for curve in ring_curves(loop)] for loop in self.given]

    @property
    def tolerance(self) -> float:
        return self.grids.tolerance

    def loops(self) -> list[Ring]:
        """The loops with all numbers round; raises ValueError where curves no longer meet."""
        touching = [self._touching(row) for row in self.carriers]
        self._turn_lines()
        self._settle_arcs()
        self._settle_lines()
        for row, loop in zip(self.carriers, self.given, strict=True):
            self._settle_ends(row, loop)
        for row, touches in zip(self.carriers, touching, strict=True):
            self._make_tangent(row, touches)
        for i, k in self.held:
            self.carriers[i][k] = _carrier(ring_curves(self.given[i])[k])
        whole = [self._is_circle(loop, row) for loop, row in zip(self.given, self.carriers, strict=True)]
        return [self._circle(self.carriers[i]) if is_whole else self._meet(i, touching[i]) for i, is_whole in enumerate(whole)]

    # --- which curves touch -------------------------------------------------------------------------------------------

    def _touching(self, row: Sequence[Carrier]) -> list[bool]:
        """Whether curve k touches the next one, without a corner."""
        return [self._touches(a, b) for a, b in zip(row, [*row[1:], row[0]], strict=True)]

    def _touches(self, a: Carrier, b: Carrier) -> bool:
        if isinstance(a, Line) and isinstance(b, Line):
            return False
        if isinstance(a, Line) or isinstance(b, Line):
            line, arc = (a, b) if isinstance(a, Line) else (b, a)
            assert isinstance(line, Line)
            assert isinstance(arc, Arc)
            return abs(abs(_off(line, arc.center)) - arc.radius) <= self.tolerance
        apart = math.dist(a.center, b.center)
        return apart > self.tolerance and abs(apart - _tangent_distance(a, b)) <= self.tolerance

    def _is_circle(self, loop: Ring, row: Sequence[Carrier]) -> bool:
        a, b = row[0], row[-1]
        return len(loop) == 2 and isinstance(a, Arc) and isinstance(b, Arc) and a.sense == b.sense and self._one_circle(a, b)

    def _one_circle(self, a: Arc, b: Arc) -> bool:
        return math.dist(a.center, b.center) <= self.tolerance and abs(a.radius - b.radius) <= self.tolerance

    # --- directions ---------------------------------------------------------------------------------------------------

    def _turn_lines(self) -> None:
        """Round directions, the longest edge first; those that are nearly parallel or square to it take its own."""
        known: list[float] = []
        for i, k, line in sorted(self._lines(), key=lambda found: -found[2].length):
            turned = self._direction(line, known)
            if all(abs(_fold(turned - degrees, 90.0)) > EXACT for degrees in known):
                known.append(turned)
            nx, ny = (-unit(turned)[1], unit(turned)[0])
            self.carriers[i][k] = replace(line, degrees=turned, offset=nx * line.middle[0] + ny * line.middle[1])

    def _direction(self, line: Line, known: Sequence[float]) -> float:
        offers = [round(line.degrees / STEPS_DEG[0]) * STEPS_DEG[0]]
        offers += [line.degrees - _fold(line.degrees - degrees, 90.0) for degrees in known]
        offers += [round(decimal(line.degrees / step)) * step for step in STEPS_DEG[1:]]
        for degrees in offers:
            if line.length / 2 * abs(math.sin(math.radians(degrees - line.degrees))) <= self.tolerance:
                return decimal(degrees % 180.0)
        return line.degrees

    # --- numbers ------------------------------------------------------------------------------------------------------

    def _settle_arcs(self) -> None:
        """Round centres and radii, the arc that turns furthest first; others take its centre and radius if their points allow it.

        The centre of a short arc is poorly known, so that it is the points that must not move.
        """
        centers: list[Point] = []
        radii: list[float] = []
        for i, k, arc in sorted(self._arcs(), key=lambda found: -math.dist(*found[2].points[:2]) / found[2].radius):
            center = next((c for c in centers if self._radius(arc, c, radii) is not None), None) or self._center(arc, radii)
            radius = self._radius(arc, center, radii) or arc.radius
            centers += [center] if center not in centers else []
            radii += [radius] if radius not in radii else []
            self.carriers[i][k] = replace(arc, center=center, radius=radius)

    def _center(self, arc: Arc, radii: Sequence[float]) -> Point:
        """The arc's own centre as it was typed or on the coarsest grid, which is not far away even where the points would allow it."""
        (x, _), (y, _) = map(self.grids.read, arc.center)
        typed = [] if x is None or y is None else [(x, y)]
        rounded = ((round_to_grid(arc.center[0], width), round_to_grid(arc.center[1], width)) for width in self.grids.widths)
        for center in (*typed, *rounded):
            if math.dist(center, arc.center) <= FARTHEST * self.tolerance and self._radius(arc, center, radii) is not None:
                return center
        return arc.center

    def _radius(self, arc: Arc, center: Point, known: Sequence[float]) -> float | None:
        """One that is known or round and passes by all points of the arc; None where the centre has none."""
        spread = arc.spread(center)
        low, high = max(spread) - self.tolerance, min(spread) + self.tolerance
        if low > high:
            return None
        rounded, _ = self.grids.round((low + high) / 2, (high - low) / 2)
        return next((radius for radius in known if low <= radius <= high), rounded)

    def _settle_lines(self) -> None:
        """Equal and round offsets, line by line of one direction."""
        hubs = self._hubs()
        lines = list(self._lines())
        for degrees in dict.fromkeys(line.degrees for _, _, line in lines):
            alike = [found for found in lines if found[2].degrees == degrees]
            offsets = self._merged([line.offset for _, _, line in alike])
            for (i, k, line), offset in zip(alike, offsets, strict=True):
                self.carriers[i][k] = replace(line, offset=self._round_offset(line.normal, offset, hubs))

    def _settle_ends(self, row: list[Carrier], loop: Ring) -> None:
        """A line that leans at no round angle between two along the axes has round ends on these: the radii and levels of a cone."""
        for k, (line, curve) in enumerate(zip(row, ring_curves(loop), strict=True)):
            before, after = row[k - 1], row[(k + 1) % len(row)]
            ends = [other for other in (before, after) if isinstance(other, Line) and 0.0 in other.normal]
            if not isinstance(line, Line) or 0.0 in line.normal or len(ends) < 2 or _fold(line.degrees, STEPS_DEG[0]) == 0:
                continue
            given = _carrier(curve)  # not yet turned to a round angle
            assert isinstance(given, Line)
            (ax, ay), (bx, by) = (self._round_end(given, end) for end in ends)
            if math.hypot(bx - ax, by - ay) <= FARTHEST * self.tolerance:
                continue
            degrees = math.degrees(math.atan2(by - ay, bx - ax)) % 180.0
            c, s = unit(degrees)
            row[k] = replace(line, degrees=degrees, offset=-s * ax + c * ay)

    def _round_end(self, line: Line, end: Line) -> Point:
        """Where the line meets one along an axis, that place rounded."""
        (nx, ny), level = line.normal, end.offset * (end.normal[0] + end.normal[1])
        slack = self.tolerance / max(abs(ny if end.normal[1] == 0.0 else nx), FLATTEST)
        if end.normal[1] == 0.0:
            return level, self.grids.round((line.offset - nx * level) / ny, slack)[0]
        return self.grids.round((line.offset - ny * level) / nx, slack)[0], level

    def _round_offset(self, normal: Point, offset: float, hubs: Sequence[Point]) -> float:
        """Of a line along an axis its place; of others the distance from a hub, or where they cross a line along an axis through it,
        whichever is rounder."""
        if 0.0 in normal:
            sign = normal[0] + normal[1]
            return sign * self.grids.round(sign * offset)[0]
        best, width = offset, 0.0
        for hub in hubs:
            start = normal[0] * hub[0] + normal[1] * hub[1]
            for scale in (1.0, *(c for c in normal if abs(c) > FLATTEST)):
                number, grid = self.grids.round((offset - start) / scale, self.tolerance / abs(scale))
                if grid > width:
                    best, width = start + scale * number, grid
        return best

    def _hubs(self) -> list[Point]:
        """What offsets may be measured from: the origin, centres of arcs, and the middles of polygons."""
        means = [(math.fsum(v[0] for v in loop) / len(loop), math.fsum(v[1] for v in loop) / len(loop)) for loop in self.given]
        middles = [(self.grids.round(x)[0], self.grids.round(y)[0]) for x, y in means]
        return list(dict.fromkeys([(0.0, 0.0), *(arc.center for _, _, arc in self._arcs()), *middles]))[:MOST_HUBS]

    def _merged(self, numbers: Sequence[float]) -> list[float]:
        """Numbers that span no more than the tolerance become their median, or what one of them was typed as."""
        out, order = list(numbers), sorted(range(len(numbers)), key=numbers.__getitem__)
        while order:
            close = [i for i in order if numbers[i] <= numbers[order[0]] + self.tolerance]
            typed = {place for i in close if (place := self.grids.read(numbers[i])[0]) is not None}
            if len(typed) > 1:  # each is what it is
                close = [i for i in close if numbers[i] <= numbers[order[0]] + 2 * self.grids.bits]
            middle = typed.pop() if len(typed) == 1 else float(np.median([numbers[i] for i in close]))
            for i in close:
                out[i] = middle
            order = order[len(close) :]
        return out

    def _lines(self) -> Iterator[tuple[int, int, Line]]:
        yield from ((i, k, c) for i, row in enumerate(self.carriers) for k, c in enumerate(row) if isinstance(c, Line))

    def _arcs(self) -> Iterator[tuple[int, int, Arc]]:
        yield from ((i, k, c) for i, row in enumerate(self.carriers) for k, c in enumerate(row) if isinstance(c, Arc))

    # --- tangency -----------------------------------------------------------------------------------------------------

    def _make_tangent(self, row: list[Carrier], touches: Sequence[bool]) -> None:
        """Move the centres of arcs so that they touch what they touched: lines, and arcs that were moved before."""
        n = len(row)
        arcs = [k for k, carrier in enumerate(row) if isinstance(carrier, Arc)]
        beside = {k: [m for m, touch in (((k - 1) % n, touches[k - 1]), ((k + 1) % n, touches[k])) if touch] for k in arcs}
        settled = {k for k in arcs if not beside[k]}
        # arcs between lines first: the others have to follow them
        for k in sorted(arcs, key=lambda k: -sum(isinstance(row[m], Line) for m in beside[k])):
            arc = row[k]
            assert isinstance(arc, Arc)
            others = [row[m] for m in beside[k] if isinstance(row[m], Line) or m in settled]
            arc = _between_parallels(arc, others)
            row[k] = replace(arc, center=_onto(arc.center, [_tangency(arc, other) for other in others]))
            settled.add(k)

    # --- vertices -----------------------------------------------------------------------------------------------------

    def _circle(self, row: Sequence[Carrier]) -> Ring:
        arc = row[0]
        assert isinstance(arc, Arc)
        return circle(arc.radius, *arc.center)

    def _meet(self, i: int, touches: Sequence[bool]) -> Ring:
        """Loop i with its vertices where carriers meet; a vertex between two edges on one line goes."""
        row = self.carriers[i]
        kept = [k for k, carrier in enumerate(row) if not _goes_on(row[k - 1], carrier)]
        if len(kept) < 2:
            raise ValueError("a loop of one line")
        at = {k: self._meeting(i, k, touches[k - 1]) for k in kept}
        out = []
        for k, following in zip(kept, [*kept[1:], kept[0]], strict=True):
            carrier = row[k]
            out.append((*at[k], _bulge(carrier, at[k], at[following]) if isinstance(carrier, Arc) else 0.0))
        return tuple(out)

    def _meeting(self, i: int, k: int, touch: bool) -> Point:
        """Where curve k of loop i begins; raises _PartedError where that is nowhere near the place where it did."""
        a, b, near = self.carriers[i][k - 1], self.carriers[i][k], self.given[i][k][:2]
        curves = {(i, (k - 1) % len(self.given[i])), (i, k)}
        if curves <= self.held:
            return near
        found = _tangent_point(a, b, near) if touch else min(_crossings(a, b, near), key=lambda p: math.dist(p, near), default=None)
        if found is None or math.dist(found, near) > FARTHEST * self.tolerance:
            raise _PartedError(curves, near)
        return found


def _carrier(curve: Curve) -> Carrier:
    x, y, u, v, bulge = curve
    if bulge:
        return Arc(arc_center(curve), arc_radius(curve), 1 if bulge > 0 else -1, ((x, y), arc_middle(curve), (u, v)))
    degrees, middle = math.degrees(math.atan2(v - y, u - x)) % 180.0, ((x + u) / 2, (y + v) / 2)
    c, s = unit(degrees)
    return Line(degrees, -s * middle[0] + c * middle[1], middle, math.hypot(u - x, v - y))


def _off(line: Line, point: Point) -> float:
    """Signed distance of a point."""
    nx, ny = line.normal
    return nx * point[0] + ny * point[1] - line.offset


def _tangent_distance(a: Arc, b: Arc) -> float:
    """How far apart the centres are where one circle touches the other, from without or from within, whichever is nearer to what is."""
    apart = math.dist(a.center, b.center)
    return min((a.radius + b.radius, abs(a.radius - b.radius)), key=lambda d: abs(d - apart))


def _fold(degrees: float, period: float) -> float:
    """The same modulo `period`, around 0."""
    return (degrees + period / 2) % period - period / 2


def _between_parallels(arc: Arc, others: Sequence[Carrier]) -> Arc:
    """An arc that joins two parallel lines has their distance as its diameter."""
    lines = [other for other in others if isinstance(other, Line)]
    if len(lines) == 2 and lines[0].degrees == lines[1].degrees and lines[0].offset != lines[1].offset:
        return replace(arc, radius=decimal(abs(lines[0].offset - lines[1].offset) / 2))
    return arc


def _tangency(arc: Arc, other: Carrier) -> Condition:
    """That an arc's centre is a radius away from a line, or as far as it takes from another centre."""
    if isinstance(other, Line):
        side = math.copysign(arc.radius, _off(other, arc.center))
        return lambda center: (_off(other, center) - side, other.normal)
    wanted, (x, y) = _tangent_distance(arc, other), other.center

    def from_center(center: Point) -> tuple[float, Point]:
        apart = math.dist(center, other.center)
        return apart - wanted, ((center[0] - x) / apart, (center[1] - y) / apart)

    return from_center


def _onto(center: Point, conditions: Sequence[Condition]) -> Point:
    """The nearest centre that meets all conditions, by Newton's method."""
    for _ in range(30 if conditions else 0):
        rows = [condition(center) for condition in conditions]
        step = np.linalg.lstsq(np.array([slope for _, slope in rows]), -np.array([off for off, _ in rows]), rcond=1e-9)[0]
        center = (center[0] + float(step[0]), center[1] + float(step[1]))
        if np.abs(step).max() <= RESIDUE * max(map(abs, center)):
            break
    return _tidy(center[0]), _tidy(center[1])


def _goes_on(a: Carrier, b: Carrier) -> bool:
    """Whether two edges are on one line."""
    return isinstance(a, Line) and isinstance(b, Line) and (a.degrees, a.offset) == (b.degrees, b.offset)


def _tangent_point(a: Carrier, b: Carrier, near: Point) -> Point:
    if isinstance(a, Arc) and isinstance(b, Arc):
        apart = math.dist(a.center, b.center)
        way = ((b.center[0] - a.center[0]) / apart, (b.center[1] - a.center[1]) / apart)
        ends = [(a.center[0] + s * a.radius * way[0], a.center[1] + s * a.radius * way[1]) for s in (1, -1)]
        return min(ends, key=lambda p: math.dist(p, near))
    line, arc = (a, b) if isinstance(a, Line) else (b, a)
    assert isinstance(line, Line)
    assert isinstance(arc, Arc)
    off, (nx, ny) = _off(line, arc.center), line.normal
    return arc.center[0] - off * nx, arc.center[1] - off * ny


def _crossings(a: Carrier, b: Carrier, near: Point) -> Iterator[Point]:
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
    off, (nx, ny), (ux, uy) = _off(line, arc.center), line.normal, line.direction
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


def _bulge(arc: Arc, start: Point, end: Point) -> float:
    (ax, ay), (bx, by) = ((x - arc.center[0], y - arc.center[1]) for x, y in (start, end))
    sweep = math.atan2(ax * by - ay * bx, ax * bx + ay * by) * arc.sense % (2 * math.pi)
    return arc.sense * _tidy(math.tan(sweep / 4))


def _tidy(number: float) -> float:
    """Without what binary fractions add to a decimal number; other numbers keep all their digits."""
    rounded = decimal(number)
    return rounded if abs(rounded - number) <= RESIDUE * max(abs(number), 1.0) else number + 0.0
