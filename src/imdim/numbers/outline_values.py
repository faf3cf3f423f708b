"""The numbers that a person would have typed for an outline: snapping it makes carriers equal, parallel, tangent and round.

An outline is described by its carriers: the line of each edge by its direction and its offset, the circle of each arc by its centre and
radius. These are rounded as `design_values` rounds sizes, to the coarsest decimal grid that moves nothing by more than a tolerance; arcs
that touched their neighbours touch them exactly. The vertices then are where consecutive carriers meet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.carriers import (
    Arc,
    Carrier,
    Line,
    bulge_of,
    carrier_of,
    crossings,
    fit_between_parallels,
    fold_degrees,
    goes_on,
    move_onto,
    offset_of,
    tangency,
    tangent_distance,
    tangent_point,
    tidy,
    unit,
)
from imdim.numbers.design_values import decimal, is_level, round_to_grid
from imdim.numbers.ellipse_values import STEPS_DEG, snap_ellipse
from imdim.numbers.mirrored_loops import mirror_halves
from imdim.numbers.outline_grids import OutlineGrids
from imdim.numbers.polygon_values import snap_polygon
from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Loop,
    Outline,
    Point,
    Ring,
    check_crossings,
    circle,
    circle_of,
    loop_area,
    ring_curves,
)
from imdim.program.regular_polygon import regular_of
from imdim.program.tree import ACROSS, Primitive

FLATTEST = 0.05  # sine of the angle to an axis below which a line's crossing with the axis is no number of its own
FARTHEST = 20.0  # tolerances that a vertex may move: where curves meet at small angles it moves further than they do
SHARPEST = 5.0  # degrees between lines below which the corner where they would meet is no place of its own
HUB = 0.5  # of its radius, that the middle of an arc is beyond its chord where lines touch it and do not meet beyond: 120 degrees
MOST_HUBS = 8
EXACT = 1e-9  # degrees by which equal directions differ
TENTH = 10.0  # of an outline's size is the coarsest grid that its middle is put on, a hundredth of that the finest
ROUND = 1e-9  # of its size: a middle as near to the finest is round as it is
REGULAR = 5e-3  # of a polygon's extent, within which it is a regular one
KEPT = 4096  # leaves that were snapped: one that does not bear a rounding is offered it again with other leaves', and more cautiously


def snap_outline(outline: Outline, tolerance: float, offset: Point = (0.0, 0.0), inches: bool = False, bits: float = 0.0) -> Outline:
    """The outline with round numbers in coordinates whose origin is at minus `offset`; the same one where a loop would degenerate.
    Of a part in `inches` fractions of these are round too. Numbers that are within `bits` of a grid that is far wider are on that.

    No carrier moves by more than about `tolerance`, along the curve that lies on it.
    """
    placed = outline.shift(*offset)
    return _redraw(outline, placed, offset, OutlineGrids.of(placed, tolerance, inches, bits))


def _redraw(outline: Outline, placed: Outline, offset: Point, grids: OutlineGrids) -> Outline:
    try:
        loops = (_tidy_loop(loop, *offset) for loop in _snap_loops(placed, grids))
        snapped = Outline(tuple(loop if isinstance(loop, Ellipse) else mirror_halves(loop, grids.tolerance) for loop in loops))
        check_crossings(snapped)
    except (ValueError, ZeroDivisionError):
        return outline
    same_way = all(
        isinstance(b, Ellipse) or circle_of(b) or loop_area(a) * loop_area(b) > 0 for a, b in zip(outline.loops, snapped.loops, strict=True)
    )
    return snapped if same_way else outline


def _snap_loops(outline: Outline, grids: OutlineGrids) -> Iterator[Loop]:
    """The loops with round numbers; regular polygons and ellipses after the others, so that they take the centres and sizes that these
    have."""
    regular = [regular_of(loop, min(grids.tolerance, REGULAR * _extent(loop))) for loop in outline.loops]
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
        snapped = snap_ellipse(loop, grids.tolerance, grids.widths, centers, lengths)
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
        return replace(loop, x=tidy(loop.x - dx), y=tidy(loop.y - dy))
    return tuple((tidy(x - dx), tidy(y - dy), b) for x, y, b in loop)


@lru_cache(KEPT)
def snap_leaf(leaf: Primitive, tolerance: float, inches: bool = False, bits: float = 0.0) -> Primitive:
    """The leaf with a round outline, about whose middle its centre is; of one along the world's axes, the places in the world are round.
    See `snap_outline`."""
    return redraw_leaf(leaf, lambda placed: OutlineGrids.of(placed, tolerance, inches, bits))


def redraw_leaf(leaf: Primitive, grids: Callable[[Outline], OutlineGrids], stays: bool = False) -> Primitive:
    """The leaf with its outline on `grids` of what it is where it stands, as `snap_leaf` has it; its centre may be one that `stays`."""
    if leaf.outline is None:
        return leaf
    rotation = matrix_from_euler(leaf.rotation)
    rotation = np.round(rotation) if is_level(leaf) else rotation
    x, y, z = (rotation.T @ leaf.center).tolist() if is_level(leaf) else (0.0, 0.0, 0.0)
    across = leaf.kind in ACROSS
    offset = (x, y) if across else (0.0, z)
    placed = leaf.outline.shift(*offset)
    snapped = _redraw(leaf.outline, placed, offset, grids(placed))
    # an arc that comes near the axis that a part is turned about may cross it with round numbers
    if snapped is leaf.outline or (leaf.kind == "revolve" and snapped.bounds[0][0] < 0):
        return leaf
    try:
        return _place_outline(leaf, snapped, rotation, offset, stays)
    except ValueError:  # the walls of a drafted one would meet, or no arc touch its neighbours
        return leaf


def _place_outline(leaf: Primitive, snapped: Outline, rotation: np.ndarray, offset: Point, stays: bool) -> Primitive:
    """The leaf with another outline, about its own centre or about one that `stays`."""
    across = leaf.kind in ACROSS
    if stays:
        return replace(leaf, outline=snapped)
    (left, low), (right, high) = snapped.bounds
    size = max(right - left, high - low)
    middle = (_round_middle(left, right, offset[0], size) if across else 0.0, _round_middle(low, high, offset[1], size))
    a, b, c = (tidy(float(v)) for v in leaf.center + rotation @ ((*middle, 0.0) if across else (0.0, 0.0, middle[1])))
    return replace(leaf, center=(a, b, c), outline=Outline(tuple(_tidy_loop(loop, *middle) for loop in snapped.loops)))


def _round_middle(low: float, high: float, offset: float, size: float) -> float:
    """About the middle of two ends: where that is no round place by itself, one that leaves round corners round."""
    grid = 10.0 ** math.floor(math.log10(size / TENTH))
    middle = decimal((low + high) / 2 + offset)
    near = round_to_grid(middle, grid / TENTH**2)
    return decimal((near if abs(near - middle) <= ROUND * size else round_to_grid(middle, grid)) - offset)


@dataclass
class _Snapping:
    """The carriers of `given` loops, changed step by step; `carriers[i][k]` is that of curve k of loop i, and stays if (i, k) is `held`."""

    given: tuple[Ring, ...]
    grids: OutlineGrids
    held: set[tuple[int, int]]
    carriers: list[list[Carrier]] = field(init=False)

    def __post_init__(self) -> None:
        self.carriers = [[carrier_of(curve) for curve in ring_curves(loop)] for loop in self.given]

    @property
    def tolerance(self) -> float:
        return self.grids.tolerance

    def loops(self) -> list[Ring]:
        """The loops with all numbers round; raises ValueError where curves no longer meet."""
        touching = [self._touching(row) for row in self.carriers]
        self._turn_lines()
        self._settle_arcs()
        self._settle_lines()
        for i, touches in enumerate(touching):
            self._settle_corners(i, touches)
        for row, touches in zip(self.carriers, touching, strict=True):
            self._make_tangent(row, touches)
        for i, k in self.held:
            self.carriers[i][k] = carrier_of(ring_curves(self.given[i])[k])
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
            return abs(abs(offset_of(line, arc.center)) - arc.radius) <= self.tolerance
        apart = math.dist(a.center, b.center)
        return apart > self.tolerance and abs(apart - tangent_distance(a, b)) <= self.tolerance

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
            if all(abs(fold_degrees(turned - degrees, 90.0)) > EXACT for degrees in known):
                known.append(turned)
            nx, ny = (-unit(turned)[1], unit(turned)[0])
            self.carriers[i][k] = replace(line, degrees=turned, offset=nx * line.middle[0] + ny * line.middle[1])

    def _direction(self, line: Line, known: Sequence[float]) -> float:
        offers = [round(line.degrees / STEPS_DEG[0]) * STEPS_DEG[0]]
        offers += [line.degrees - fold_degrees(line.degrees - degrees, 90.0) for degrees in known]
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
        radii = list(self.grids.radii)
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

    def _settle_corners(self, i: int, touches: Sequence[bool]) -> None:
        """A line of loop i that leans at no round angle has round corners with the lines beside it: the vertices of a polygon, the radii
        and levels of a cone. An arc may round a corner off: it has a round radius then, and its centre follows."""
        row, given = self.carriers[i], [carrier_of(curve) for curve in ring_curves(self.given[i])]  # not yet turned to round angles
        settled = list(row)
        for k, line in enumerate(row):
            if not isinstance(line, Line) or not self._leans(line):
                continue
            beside = [self._beside(row, given, touches, k, step) for step in (-1, 1)]
            start, end = (self._round_corner(row, given, k, other) for other in beside)
            if start is None or end is None or math.dist(start, end) <= FARTHEST * self.tolerance:
                continue
            (ax, ay), (bx, by) = start, end
            degrees = math.degrees(math.atan2(by - ay, bx - ax)) % 180.0
            c, s = unit(degrees)
            settled[k] = replace(line, degrees=degrees, offset=-s * ax + c * ay)
            for arc, between in ((given[m], m) for m in (k - 1, (k + 1) % len(row)) if m % len(row) not in beside):
                assert isinstance(arc, Arc)
                settled[between] = replace(arc, radius=self.grids.round(arc.radius)[0])
        row[:] = settled

    def _leans(self, line: Line) -> bool:
        """Whether a line leans at no round angle."""
        return 0.0 not in line.normal and fold_degrees(line.degrees, STEPS_DEG[0]) != 0

    def _is_alone(self, line: Line) -> bool:
        """Whether no other line is parallel or square to a line: those of a turned rectangle are, and its corners are round by chance."""
        return sum(abs(fold_degrees(other.degrees - line.degrees, 90.0)) <= EXACT for _, _, other in self._lines()) == 1

    def _beside(self, row: Sequence[Carrier], given: Sequence[Carrier], touches: Sequence[bool], k: int, step: int) -> int | None:
        """The line before or after line k, also across an arc that rounds off the corner of both; None where there is none."""
        n = len(row)
        first, second = (k + step) % n, (k + 2 * step) % n
        arc = given[first]
        if isinstance(arc, Line):
            return first
        joints = (k, first) if step > 0 else (first, second)
        smooth = second != k and isinstance(row[second], Line) and all(touches[j] for j in joints)
        return second if smooth and not self._is_hub(arc) else None

    def _is_hub(self, arc: Arc) -> bool:
        """Whether lines follow from an arc that they touch: it turns far, or its centre was typed."""
        (start, middle, end), typed = arc.points, [self.grids.read(c)[0] for c in arc.center]
        turns_far = math.dist(middle, ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)) > arc.radius * HUB
        return turns_far or None not in typed

    def _round_corner(self, row: Sequence[Carrier], given: Sequence[Carrier], k: int, beside: int | None) -> Point | None:
        """Where line k meets the one beside it, as round as may be; None where that line has another say in it."""
        if beside is None:
            return None
        line, other, turned, end = given[k], given[beside], row[k], row[beside]
        assert isinstance(line, Line)
        assert isinstance(other, Line)
        assert isinstance(turned, Line)
        assert isinstance(end, Line)
        if 0.0 in end.normal:
            return self._round_end(line, end)
        if abs(fold_degrees(line.degrees - other.degrees, 180.0)) < SHARPEST or not all(map(self._is_alone, (turned, end))):
            return None
        x, y = next(crossings(line, other, line.middle))
        return self.grids.round(x)[0], self.grids.round(y)[0]

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
            return sign * self.grids.place(int(normal[0] == 0.0), sign * offset)
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
        """Move the centres of arcs so that they touch what they touched: lines, and arcs that were moved before. Neighbours on one circle
        stay on one; where they turn by more than half of it and touch arcs alone, it is these that follow."""
        n = len(row)
        beside = {k: [m for m, touch in (((k - 1) % n, touches[k - 1]), ((k + 1) % n, touches[k])) if touch] for k in range(n)}
        found = [(run, [m for k in run for m in beside[k]]) for run in _list_runs_on_circles(row)]
        lines = {run: sum(isinstance(row[m], Line) for m in others) for run, others in found}
        settled = {k for run, others in found if not others or (not lines[run] and _measure_turn(row, run) > math.pi) for k in run}
        # arcs between lines first: the others have to follow them
        for run, others in sorted(found, key=lambda pair: -lines[pair[0]]):
            arc = row[run[0]]
            assert isinstance(arc, Arc)
            known = [] if settled.issuperset(run) else [row[m] for m in others if isinstance(row[m], Line) or m in settled]
            arc = fit_between_parallels(arc, known)
            center = move_onto(arc.center, [tangency(arc, other) for other in known])
            for k in run:
                same = row[k]
                assert isinstance(same, Arc)
                row[k] = replace(same, center=center, radius=arc.radius)
            settled.update(run)

    # --- vertices -----------------------------------------------------------------------------------------------------

    def _circle(self, row: Sequence[Carrier]) -> Ring:
        arc = row[0]
        assert isinstance(arc, Arc)
        return circle(arc.radius, *arc.center)

    def _meet(self, i: int, touches: Sequence[bool]) -> Ring:
        """Loop i with its vertices where carriers meet; a vertex between two edges on one line goes."""
        row = self.carriers[i]
        kept = [k for k, carrier in enumerate(row) if not goes_on(row[k - 1], carrier)]
        if len(kept) < 2:
            raise ValueError("a loop of one line")
        at = {k: self._meeting(i, k, touches[k - 1]) for k in kept}
        out = []
        for k, following in zip(kept, [*kept[1:], kept[0]], strict=True):
            carrier = row[k]
            out.append((*at[k], bulge_of(carrier, at[k], at[following]) if isinstance(carrier, Arc) else 0.0))
        return tuple(out)

    def _meeting(self, i: int, k: int, touch: bool) -> Point:
        """Where curve k of loop i begins; raises _PartedError where that is nowhere near the place where it did."""
        a, b, near = self.carriers[i][k - 1], self.carriers[i][k], self.given[i][k][:2]
        curves = {(i, (k - 1) % len(self.given[i])), (i, k)}
        if curves <= self.held:
            return near
        found = tangent_point(a, b, near) if touch else min(crossings(a, b, near), key=lambda p: math.dist(p, near), default=None)
        if found is None or math.dist(found, near) > FARTHEST * self.tolerance:
            raise _PartedError(curves, near)
        return found


def _list_runs_on_circles(row: Sequence[Carrier]) -> list[tuple[int, ...]]:
    """The numbers of the arcs of a loop, those that follow one another on one circle together."""

    def goes_on_from(k: int) -> bool:
        a, b = row[k - 1], row[k]
        return isinstance(a, Arc) and isinstance(b, Arc) and (a.center, a.radius, a.sense) == (b.center, b.radius, b.sense)

    first = next((k for k in range(len(row)) if not goes_on_from(k)), 0)
    runs: list[tuple[int, ...]] = []
    for k in [*range(first, len(row)), *range(first)]:
        if not isinstance(row[k], Arc):
            continue
        if k != first and goes_on_from(k):
            runs[-1] = (*runs[-1], k)
        else:
            runs.append((k,))
    return runs


def _measure_turn(row: Sequence[Carrier], run: Sequence[int]) -> float:
    """The angle by which arcs turn in all."""
    arcs = [arc for arc in (row[k] for k in run) if isinstance(arc, Arc)]
    return sum(4 * math.asin(min(1.0, math.dist(*arc.points[:2]) / (2 * arc.radius))) for arc in arcs)
