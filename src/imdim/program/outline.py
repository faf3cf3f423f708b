"""Outlines: closed loops in a plane, what extrusions and turned solids are drawn from.

A loop is a ring of vertices ``(x, y, bulge)``, or one whole ellipse. The curve from a vertex to the next is a line where the bulge is 0
and else the arc that turns by ``4 atan(bulge)``, counter-clockwise where it is positive: DXF's polyline, three numbers a curve, whose ends
always meet. Two vertices of bulge 1 are a circle. A point belongs to the outline where an odd number of loops hold it: outer loops, holes,
islands in holes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

from imdim.program.ellipse import (
    Ellipse,
    are_near_ellipses,
    check_ellipse,
    ellipse_conic,
    ellipse_distance,
    ellipse_extent,
    ellipse_point,
    holds_point,
    meet_conic,
)

Point = tuple[float, float]
Vertex = tuple[float, float, float]
Ring = tuple[Vertex, ...]
Loop = Ring | Ellipse
Curve = tuple[float, float, float, float, float]  # x and y of the start and of the end, bulge

MOST_CURVES = 2000  # of one outline
TOUCHING = 1e-9  # of the outline's extent, within which two curves touch
SPREAD = 1e-6  # sine of the angle between two lines, from which rounding does not move where they cross
AT_END = 1e-4  # of the step between corners of a circle: one as near to an arc's end is that end
ONE_CIRCLE = 1e-6  # of a radius, by which centres and radii differ that files keep of one circle
PARTING = 5e-5  # of the extent, by which neighbours that are all but tangent may part before they meet again
UPRIGHT = 1e-7  # of a unit normal, below which its x is none
LEAST_BULGE, MOST_BULGE = 1e-9, 1e9  # of an arc whose centre, or whose ends, can be told from its other numbers


@dataclass(frozen=True, slots=True)
class Outline:
    """`loops`: rings of two or more vertices each, and ellipses. Raises ValueError, a line that names loop and curve, for loops that bound
    nothing."""

    loops: tuple[Loop, ...]
    # asked for ten thousand times in a long program; no part of what an outline is
    _bounds: tuple[Point, Point] | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.loops:
            raise ValueError("an outline needs at least one loop")
        if (total := sum(map(len, self.loops))) > MOST_CURVES:
            raise ValueError(f"an outline of {total} curves; at most {MOST_CURVES} are read")
        for i, loop in enumerate(self.loops):
            _check_loop(i, loop)

    @property
    def curves(self) -> list[Curve | Ellipse]:
        """The curves of all loops, loop after loop."""
        return [curve for loop in self.loops for curve in loop_curves(loop)]

    @property
    def rings(self) -> list[Ring]:
        """The loops that have vertices."""
        return [loop for loop in self.loops if not isinstance(loop, Ellipse)]

    @property
    def curve_count(self) -> int:
        """How many curves one would count on a drawing: a full circle, which is two arcs here, is one."""
        return sum(1 if circle_of(loop) else len(loop) for loop in self.loops)

    @property
    def bounds(self) -> tuple[Point, Point]:
        """Low and high corner."""
        if self._bounds is None:
            object.__setattr__(self, "_bounds", curve_bounds(self.curves))
        assert self._bounds is not None
        return self._bounds

    @property
    def area(self) -> float:
        """What the loops enclose, holes taken off."""
        return abs(sum(loop_area(loop) * sign for loop, sign in zip(self.loops, _signs(self.loops), strict=True)))

    def map_lengths(self, change: Callable[[float], float]) -> Outline:
        """With all coordinates changed by one factor."""
        return Outline(tuple(_scale_loop(loop, change) for loop in self.loops))

    def shift(self, dx: float, dy: float) -> Outline:
        """Moved in its plane."""
        return Outline(tuple(shift_loop(loop, dx, dy) for loop in self.loops))

    def mirror(self) -> Outline:
        """The image in the y axis, loops turned round so that they run as before."""
        return Outline(tuple(_mirror_loop(loop) for loop in self.loops))


def rectangle(width: float, height: float) -> Outline:
    """A rectangle about the origin."""
    x, y = width / 2, height / 2
    return Outline((((-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)),))


def circle(radius: float, x: float = 0.0, y: float = 0.0) -> Ring:
    """A circle as a loop of two half arcs, counter-clockwise."""
    return ((x - radius, y, 1.0), (x + radius, y, 1.0))


def ellipse(rx: float, ry: float, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> Loop:
    """An ellipse as a loop, its first semi-axis at `angle` degrees; a circle where both are equal. ValueError for what is none."""
    return circle(rx, x, y) if rx == ry and rx > 0 else Ellipse(rx, ry, x, y, angle)


def shift_loop(loop: Loop, dx: float, dy: float) -> Loop:
    """Moved in its plane."""
    if isinstance(loop, Ellipse):
        return replace(loop, x=loop.x + dx, y=loop.y + dy)
    return tuple((x + dx, y + dy, b) for x, y, b in loop)


def _scale_loop(loop: Loop, change: Callable[[float], float]) -> Loop:
    if isinstance(loop, Ellipse):
        return Ellipse(change(loop.rx), change(loop.ry), change(loop.x), change(loop.y), loop.angle)
    return tuple((change(x), change(y), b) for x, y, b in loop)


def _mirror_loop(loop: Loop) -> Loop:
    if isinstance(loop, Ellipse):
        return replace(loop, x=-loop.x + 0.0, angle=-loop.angle + 0.0)
    return reverse_ring(tuple((-x, y, -b) for x, y, b in loop))


def has_ellipse(outline: Outline) -> bool:
    """Whether one of the loops is an ellipse."""
    return len(outline.rings) < len(outline.loops)


def circle_of(loop: Loop) -> tuple[float, float, float] | None:
    """Centre and radius of a loop that is one circle, else None."""
    if isinstance(loop, Ellipse) or len(loop) != 2 or loop[0][2] != loop[1][2] or abs(loop[0][2]) != 1:
        return None
    (ax, ay, _), (bx, by, _) = loop
    return (ax + bx) / 2, (ay + by) / 2, math.hypot(bx - ax, by - ay) / 2


def are_near(a: Outline | None, b: Outline | None, tolerance: float) -> bool:
    """Whether two outlines have the same curves in the same order, all within `tolerance`; or both are None."""
    if a is None or b is None:
        return a is b
    if [len(loop) for loop in a.loops] != [len(loop) for loop in b.loops]:
        return False
    return all(_are_near_curves(c, d, tolerance) for c, d in zip(a.curves, b.curves, strict=True))


def _are_near_curves(c: Curve | Ellipse, d: Curve | Ellipse, tolerance: float) -> bool:
    if isinstance(c, Ellipse) or isinstance(d, Ellipse):
        return isinstance(c, Ellipse) and isinstance(d, Ellipse) and are_near_ellipses(c, d, tolerance)
    # an arc's height is half its chord times its bulge
    return math.dist(c[:4], d[:4]) <= tolerance and abs(c[4] - d[4]) * math.dist(c[:2], c[2:4]) / 2 <= tolerance


def loop_curves(loop: Loop) -> Sequence[Curve | Ellipse]:
    """The curves of one loop, in order; an ellipse is its own."""
    return [loop] if isinstance(loop, Ellipse) else ring_curves(loop)


def ring_curves(ring: Ring) -> list[Curve]:
    """The curves from vertex to vertex, in order."""
    return [(x, y, u, v, b) for (x, y, b), (u, v, _) in zip(ring, (*ring[1:], ring[0]), strict=True)]


def start_of(loop: Loop) -> Point:
    """A point on a loop: its first vertex, or where the first semi-axis of an ellipse ends."""
    return ellipse_point(loop, 0.0) if isinstance(loop, Ellipse) else loop[0][:2]


def reverse_loop(loop: Loop) -> Loop:
    """The same loop run the other way, from the same vertex; an ellipse runs no way of its own."""
    return loop if isinstance(loop, Ellipse) else reverse_ring(loop)


def reverse_ring(loop: Ring) -> Ring:
    """As `reverse_loop`, of vertices."""
    bulges = [-b for _, _, b in reversed(loop)]
    corners = [loop[0], *reversed(loop[1:])]
    return tuple((x, y, b) for (x, y, _), b in zip(corners, bulges, strict=True))


def loop_area(loop: Loop) -> float:
    """Signed area, positive for a loop that runs counter-clockwise, and of an ellipse."""
    if isinstance(loop, Ellipse):
        return math.pi * loop.rx * loop.ry
    out = 0.0
    for x, y, u, v, b in ring_curves(loop):
        out += (x * v - u * y) / 2
        if b:
            radius, turn = arc_radius((x, y, u, v, b)), 4 * math.atan(b)
            out += radius * radius * (turn - math.sin(turn)) / 2
    return out


def curve_bounds(curves: Sequence[Curve | Ellipse]) -> tuple[Point, Point]:
    """Low and high corner of one or more curves."""
    xs, ys = zip(*(p for curve in curves for p in _extremes(curve)), strict=True)
    return (min(xs), min(ys)), (max(xs), max(ys))


def _bounds_of(curve: Curve | Ellipse) -> tuple[Point, Point]:
    """As `curve_bounds`, of one, and sooner of a line."""
    if isinstance(curve, Ellipse) or curve[4]:
        return curve_bounds([curve])
    x, y, u, v, _ = curve
    return (min(x, u), min(y, v)), (max(x, u), max(y, v))


def arc_radius(curve: Curve) -> float:
    """Radius of an arc."""
    x, y, u, v, b = curve
    return math.hypot(u - x, v - y) * (1 + b * b) / (4 * abs(b))


def arc_radii(outline: Outline) -> list[float]:
    """The radii of all arcs, in their order."""
    return [arc_radius(curve) for ring in outline.rings for curve in ring_curves(ring) if curve[4]]


def arc_center(curve: Curve) -> Point:
    """Centre of an arc."""
    x, y, u, v, b = curve
    along = (1 - b * b) / (4 * b)  # of the chord, from its middle along its left normal
    return (x + u) / 2 - (v - y) * along, (y + v) / 2 + (u - x) * along


def arc_middle(curve: Curve) -> Point:
    """The point halfway along an arc."""
    x, y, u, v, b = curve
    return (x + u + b * (v - y)) / 2, (y + v - b * (u - x)) / 2


def line_of(curve: Curve) -> tuple[float, float, float]:
    """Unit normal of a line, of one sense whichever way it runs, and its distance from the origin along that."""
    x, y, u, v, _ = curve
    length = math.dist((x, y), (u, v))
    a, b = (v - y) / length, (x - u) / length
    if a < -UPRIGHT or (a < UPRIGHT and b < 0):
        a, b = -a, -b
    return a, b, a * (x + u) / 2 + b * (y + v) / 2


def is_in_loop(loop: Loop, x: float, y: float) -> bool:
    """Whether a loop winds round a point: by the parity of its chords, turned where the point lies between an arc and its chord.

    A point on a chord counts as a little right of it, or above a level one. The side is reckoned along the chord upward whichever way the
    curve runs, so that both halves of a circle agree on it.
    """
    if isinstance(loop, Ellipse):
        return holds_point(loop, x, y)
    odd = False
    for ax, ay, bx, by, bulge in ring_curves(loop):
        falls = (by, bx) < (ay, ax)
        px, py, qx, qy = (bx, by, ax, ay) if falls else (ax, ay, bx, by)
        side = (qx - px) * (y - py) - (qy - py) * (x - px)
        left = side > 0 or (side == 0 and qy == py)
        if (ay > y) != (by > y) and left:
            odd = not odd
        if bulge and left == ((bulge > 0) == falls):
            curve = (ax, ay, bx, by, bulge)
            if math.dist(arc_center(curve), (x, y)) < arc_radius(curve):
                odd = not odd
    return odd


def orient_loops(loops: Sequence[Loop]) -> tuple[Loop, ...]:
    """Outer loops counter-clockwise, holes clockwise: what is inside lies on the left of every curve. Ellipses stay as they are."""
    return tuple(
        loop if (loop_area(loop) > 0) == (sign > 0) else reverse_loop(loop) for loop, sign in zip(loops, nesting(loops), strict=True)
    )


def regions(outline: Outline) -> list[tuple[Loop, ...]]:
    """The separate areas of an outline: each its outer loop, counter-clockwise, and behind it its holes, clockwise."""
    oriented = zip(orient_loops(outline.loops), nesting(outline.loops), strict=True)
    ordered = sorted(oriented, key=lambda pair: abs(loop_area(pair[0])))
    outer = [[loop] for loop, side in ordered if side > 0]
    for hole in (loop for loop, side in ordered if side < 0):
        # the smallest outer loop that holds a hole is the one around it
        next((area for area in outer if is_in_loop(area[0], *start_of(hole))), outer[-1]).append(hole)
    return [tuple(area) for area in reversed(outer)]


def nesting(loops: Sequence[Loop]) -> list[int]:
    """1 for outer loops and islands, -1 for holes: by how many other loops hold a vertex."""
    if len(loops) == 1:
        return [1]
    starts, depth = [start_of(loop) for loop in loops], [0] * len(loops)
    for other in loops:
        (left, low), (right, high) = curve_bounds(loop_curves(other))
        for i, (x, y) in enumerate(starts):
            # few points lie in the box of another loop, and a box is soon asked
            if left <= x <= right and low <= y <= high and loops[i] is not other:
                depth[i] += is_in_loop(other, x, y)
    return [1 if d % 2 == 0 else -1 for d in depth]


def _signs(loops: Sequence[Loop]) -> list[int]:
    """What each loop's signed area counts with."""
    return [sign if loop_area(loop) > 0 else -sign for loop, sign in zip(loops, nesting(loops), strict=True)]


def flatten_loop(loop: Loop, segments: int) -> list[Point]:
    """The corners of a polygon whose vertices lie on the loop. Those of an arc are its ends and where the corners of a regular polygon of
    so many `segments` lie, the first along x from the centre, so that walls on one circle have the same facets, whatever drew them: where
    arcs go on in one another is no corner. Those of an ellipse are these stretched."""
    if isinstance(loop, Ellipse):
        return [ellipse_point(loop, 2 * math.pi * k / segments) for k in range(segments)]
    out: list[Point] = []
    step = 2 * math.pi / segments
    curves = ring_curves(loop)
    for before, curve in zip((curves[-1], *curves[:-1]), curves, strict=True):
        x, y, _, _, b = curve
        if not b:
            out.append((x, y))
            continue
        (cx, cy), radius, turn = arc_center(curve), arc_radius(curve), 4 * math.atan(b)
        ends = math.atan2(y - cy, x - cx) / step, (math.atan2(y - cy, x - cx) + turn) / step
        if abs(ends[0] - round(ends[0])) <= AT_END or not _goes_on(before, curve):
            out.append((x, y))
        inner = range(math.floor(min(ends) + AT_END) + 1, math.ceil(max(ends) - AT_END))
        angles = [step * k for k in (inner if b > 0 else reversed(inner))]
        out += [(cx + radius * math.cos(a), cy + radius * math.sin(a)) for a in angles]
    return out


def _goes_on(arc: Curve, following: Curve) -> bool:
    """Whether an arc follows another on one circle, the same way round."""
    if arc[4] * following[4] <= 0:
        return False
    radius, other = arc_radius(arc), arc_radius(following)
    return max(abs(radius - other), math.dist(arc_center(arc), arc_center(following))) <= ONE_CIRCLE * radius


class CrossingError(ValueError):
    """Two `curves`, each the number of its loop and its own, that cross or touch."""

    def __init__(self, first: tuple[int, int], second: tuple[int, int]) -> None:
        super().__init__(f"loop {first[0]} curve {first[1]} crosses or touches loop {second[0]} curve {second[1]}")
        self.curves = first, second


def check_crossings(outline: Outline) -> None:
    """Raise ValueError, a line that names both curves, a CrossingError where two curves cross or touch other than in a common vertex.

    An arc that is all but tangent to its neighbour may cross it again beside their vertex, as long as neither leaves the other by then.
    Refused too are curves that are too short, too flat or too round for that to be told.
    """
    _check_bulges(outline)
    boxes = [_bounds_of(curve) for curve in outline.curves]
    power = _power_to_unit(boxes)
    loops = [_scale_loop(loop, lambda length: math.ldexp(length, -power)) for loop in outline.loops]
    tolerance = TOUCHING * math.ldexp(_extent(boxes), -power)
    named = [(i, k, c) for i, loop in enumerate(loops) for k, c in enumerate(loop_curves(loop))]
    for i, k, curve in named:
        if isinstance(curve, Ellipse):
            if min(curve.rx, curve.ry) <= tolerance:
                raise ValueError(f"loop {i} is too narrow: a semi-axis is shorter than {TOUCHING:g} of the outline's extent")
        elif math.dist(curve[:2], curve[2:4]) <= tolerance:
            raise ValueError(f"loop {i} curve {k} is too short: its ends are nearer than {TOUCHING:g} of the outline's extent")
    for m, n in _near_pairs([[math.ldexp(v, -power) for corner in box for v in corner] for box in boxes], tolerance):
        (i, k, a), (j, other, b) = named[m], named[n]
        if _meets_apart(a, b, tolerance, i == j):
            raise CrossingError((i, k), (j, other))


def _near_pairs(boxes: Sequence[Sequence[float]], margin: float) -> Iterator[tuple[int, int]]:
    """The pairs of boxes (left, low, right, high) that meet once each is wider by a margin on all sides."""
    wider = [(left - margin, low - margin, right + margin, high + margin) for left, low, right, high in boxes]
    for m, (left, low, right, high) in enumerate(wider):
        for n in range(m + 1, len(wider)):
            other = wider[n]
            if left <= other[2] and other[0] <= right and low <= other[3] and other[1] <= high:
                yield m, n


def _meets_apart(a: Curve | Ellipse, b: Curve | Ellipse, tolerance: float, same_loop: bool) -> bool:
    """Whether two curves meet other than in a vertex that they share."""
    if isinstance(a, Ellipse) or isinstance(b, Ellipse):
        return any(True for _ in _meeting_points(a, b, tolerance, ()))
    shared = {c for c in ((a[0], a[1]), (a[2], a[3])) if c in ((b[0], b[1]), (b[2], b[3]))} if same_loop else set()
    if len(shared) == 1 and not a[4] and not b[4] and _spread(a, b, tolerance):
        return False
    return any(_apart(a, b, _nearest(p, shared)) > tolerance for p in _meeting_points(a, b, tolerance, shared))


def _spread(a: Curve, b: Curve, tolerance: float) -> bool:
    """Whether two lines with a common end are so far from one direction that they cannot meet elsewhere."""
    dx, dy, ex, ey = a[2] - a[0], a[3] - a[1], b[2] - b[0], b[3] - b[1]
    length, other, cross = math.hypot(dx, dy), math.hypot(ex, ey), abs(dx * ey - dy * ex)
    return cross > max(SPREAD * length * other, 2 * tolerance * max(length, other))


def _apart(a: Curve, b: Curve, away: float) -> float:
    """How far two curves that leave one vertex and meet again so far `away` part in between, at most."""
    if away > min(math.dist(c[:2], c[2:4]) for c in (a, b)) / 2:
        return away
    return away * away / 8 * sum(1 / arc_radius(c) for c in (a, b) if c[4]) * TOUCHING / PARTING


def _check_bulges(outline: Outline) -> None:
    """Raise ValueError for an arc that is too flat or too round."""
    for i, loop in enumerate(outline.loops):
        for k, (_, _, bulge) in enumerate(() if isinstance(loop, Ellipse) else loop):
            if bulge and not LEAST_BULGE <= abs(bulge) <= MOST_BULGE:
                raise ValueError(f"loop {i} curve {k} needs a bulge of 0 or between {LEAST_BULGE:g} and {MOST_BULGE:g}, got {bulge:g}")


def _power_to_unit(boxes: Sequence[tuple[Point, Point]]) -> int:
    """The power of two by which curves with these bounds have to be divided, and so exactly, for an extent of 1/2 to 1: no square of it
    leaves the range of numbers."""
    extent, farthest = _extent(boxes), max(abs(v) for box in boxes for corner in box for v in corner)
    if not math.isfinite(extent) or TOUCHING * extent < math.ulp(farthest):
        raise ValueError(f"coordinates up to {farthest:g} cannot tell what touches in an outline that measures {extent:g}")
    return math.frexp(extent)[1]


def _extent(boxes: Sequence[tuple[Point, Point]]) -> float:
    """The larger side of what holds some boxes."""
    lows, highs = zip(*boxes, strict=True)
    return max(max(high) - min(low) for low, high in zip(zip(*lows, strict=True), zip(*highs, strict=True), strict=True))


def _nearest(point: Point, others: set[Point]) -> float:
    return min((math.dist(point, q) for q in others), default=math.inf)


def _meeting_points(a: Curve | Ellipse, b: Curve | Ellipse, tolerance: float, shared: Collection[Point]) -> Iterator[Point]:
    """Where two curves cross or touch, but for ends that they are known to share; where they run along each other, ends of one that lie on
    the other."""
    if isinstance(a, Ellipse) or isinstance(b, Ellipse):
        one, other = (a, b) if isinstance(a, Ellipse) else (b, a)
        assert isinstance(one, Ellipse)
        ends = [ellipse_point(other, 0.0)] if isinstance(other, Ellipse) else [other[:2], other[2:4]]
        points = [*ends, *meet_conic(one, _conic_of(other))]
        yield from (p for p in points if curve_distance(one, p) <= tolerance and curve_distance(other, p) <= tolerance)
        return
    yield from (p for p in ((a[0], a[1]), (a[2], a[3])) if p not in shared and curve_distance(b, p) <= tolerance)
    yield from (p for p in ((b[0], b[1]), (b[2], b[3])) if p not in shared and curve_distance(a, p) <= tolerance)
    yield from (p for p in _carrier_crossings(a, b) if curve_distance(a, p) <= tolerance and curve_distance(b, p) <= tolerance)


def _conic_of(curve: Curve | Ellipse) -> tuple[float, float, float, float, float, float]:
    """Factors of x x, x y, y y, x, y and 1 whose sum is 0 on the whole line, circle or ellipse of a curve."""
    if isinstance(curve, Ellipse):
        return ellipse_conic(curve)
    if curve[4]:
        (x, y), radius = arc_center(curve), arc_radius(curve)
        return 1.0, 0.0, 1.0, -2 * x, -2 * y, x * x + y * y - radius * radius
    x, y, u, v, _ = curve
    return 0.0, 0.0, 0.0, y - v, u - x, x * v - u * y


def _carrier_crossings(a: Curve, b: Curve) -> Iterator[Point]:
    """Where the whole lines or circles of two curves meet."""
    if not a[4] and not b[4]:
        dx, dy, ex, ey = a[2] - a[0], a[3] - a[1], b[2] - b[0], b[3] - b[1]
        cross = dx * ey - dy * ex
        if abs(cross) > 1e-12 * math.hypot(dx, dy) * math.hypot(ex, ey):
            t = ((b[0] - a[0]) * ey - (b[1] - a[1]) * ex) / cross
            yield a[0] + t * dx, a[1] + t * dy
    elif not a[4] or not b[4]:
        line, arc = (a, b) if b[4] else (b, a)
        yield from _line_circle(line, arc_center(arc), arc_radius(arc))
    else:
        yield from _circle_circle(arc_center(a), arc_radius(a), arc_center(b), arc_radius(b))


def _line_circle(line: Curve, center: Point, radius: float) -> Iterator[Point]:
    dx, dy = line[2] - line[0], line[3] - line[1]
    length = math.hypot(dx, dy)
    dx, dy = dx / length, dy / length
    along = (center[0] - line[0]) * dx + (center[1] - line[1]) * dy
    foot = (line[0] + along * dx, line[1] + along * dy)
    half = math.sqrt(max(radius * radius - math.dist(foot, center) ** 2, 0.0))
    yield foot[0] + half * dx, foot[1] + half * dy
    yield foot[0] - half * dx, foot[1] - half * dy


def _circle_circle(p: Point, r: float, q: Point, s: float) -> Iterator[Point]:
    d = math.dist(p, q)
    if d < 1e-12 * (r + s):
        return
    ux, uy = (q[0] - p[0]) / d, (q[1] - p[1]) / d
    along = (d * d + r * r - s * s) / (2 * d)
    half = math.sqrt(max(r * r - along * along, 0.0))
    yield p[0] + along * ux - half * uy, p[1] + along * uy + half * ux
    yield p[0] + along * ux + half * uy, p[1] + along * uy - half * ux


def curve_distance(curve: Curve | Ellipse, point: Point) -> float:
    """Distance of a point to a curve."""
    if isinstance(curve, Ellipse):
        return ellipse_distance(curve, point)
    x, y, u, v, b = curve
    ends = min(math.dist((x, y), point), math.dist((u, v), point))
    if not b:
        length2 = (u - x) ** 2 + (v - y) ** 2
        t = ((point[0] - x) * (u - x) + (point[1] - y) * (v - y)) / length2
        return math.dist((x + t * (u - x), y + t * (v - y)), point) if 0 < t < 1 else ends
    (cx, cy), radius = arc_center(curve), arc_radius(curve)
    away = math.dist((cx, cy), point)
    if away == 0:
        return radius
    px, py = cx + (point[0] - cx) * radius / away, cy + (point[1] - cy) * radius / away
    return min(ends, abs(away - radius)) if ((u - x) * (py - y) - (v - y) * (px - x)) * b <= 0 else ends


def _extremes(curve: Curve | Ellipse) -> Iterator[Point]:
    """The ends of a curve, and the points of an arc that are farthest along the axes; of an ellipse corners of its bounding box."""
    if isinstance(curve, Ellipse):
        across, up = ellipse_extent(curve)
        yield curve.x - across, curve.y - up
        yield curve.x + across, curve.y + up
        return
    x, y, u, v, b = curve
    yield x, y
    yield u, v
    if b:
        (cx, cy), radius = arc_center(curve), arc_radius(curve)
        for px, py in ((cx + radius, cy), (cx - radius, cy), (cx, cy + radius), (cx, cy - radius)):
            if ((u - x) * (py - y) - (v - y) * (px - x)) * b < 0:
                yield px, py


def _check_loop(i: int, loop: Loop) -> None:
    if isinstance(loop, Ellipse):
        try:
            check_ellipse(loop)
        except ValueError as error:
            raise ValueError(f"loop {i}: {error}") from None
        return
    if len(loop) < 2:
        raise ValueError(f"loop {i} has {len(loop)} vertices; it needs 2 or more")
    for k, (x, y, u, v, b) in enumerate(ring_curves(loop)):
        if not all(map(math.isfinite, (x, y, b))):
            raise ValueError(f"loop {i} curve {k} needs finite numbers, got {(x, y, b)}")
        if (x, y) == (u, v):
            raise ValueError(f"loop {i} curve {k} has no length: it starts and ends at {(x, y)}")
    if len(loop) == 2 and loop[0][2] + loop[1][2] == 0:
        raise ValueError(f"loop {i} encloses nothing: its two curves are one")
