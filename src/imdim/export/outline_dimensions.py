"""The dimensions of outlines as variables and equations: where lines lie, how round corners are, where holes are and how large.

Lines along the two axes of an outline have places, chamfers between them a length, arcs a centre and a radius. What lies about the middle
of an outline is measured from that; where nothing does, a foot is as thick as it is, from the end on its side. All directions stay: arcs
that touch such lines, or end square to them, keep their angles, so that the vertices there are sums of these numbers. Where an arc crosses
such a line the vertex is as far from the centre as the arc reaches along it. Corners at which lines lean have places of their own. Arcs
that meet anything else are loose: their ends have places, and they round a corner with a radius, touch a neighbour, or have a radius; those
that turn far an angle. A regular polygon has a count of sides, a centre, a radius, and an angle where that is none that one would draw.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from imdim.export.outline_joints import NEARLY, DrawnArc, DrawnCurve, DrawnLine, Joint, OutlineJoints, Row, X, Y, sum_rows
from imdim.export.outline_walls import EXACT
from imdim.export.slot_sizes import has_round_ends, size_slot
from imdim.program.outline import Outline, Point
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

NEAR = 0.2  # of a place: what lies no further inside another is measured from that
ROUNDS = {  # what the radius of an arc is called: one that turns by half, one that bounds a hole
    (False, False): "corner_radius",
    (True, False): "end_radius",
    (False, True): "window_corner_radius",
    (True, True): "slot_radius",
}


class _Corner(NamedTuple):
    """A coordinate of a corner; at an `edge` a line along an axis meets one that leans."""

    axis: int
    place: float
    inner: bool
    edge: bool


class _CornerDatum(NamedTuple):
    """What a corner may be measured from: where it is, and what to call the distance."""

    row: Row
    word: str


class OutlineDimensions:
    """The variables of one outline, and the equations between them."""

    def __init__(self, system: LinearSystem, leaf: int, part: Primitive, cuts: bool, axes: Sequence[Point] = ()) -> None:
        assert part.outline is not None
        self.cuts = cuts
        self.may_be_slot = cuts and part.kind == "extrude" and has_round_ends(part.outline)
        self.system, self.leaf, self.part, self.outline = system, leaf, part, part.outline
        self.slack = EXACT * system.length
        # heights of what is turned have levels of their own
        self.joints = OutlineJoints(part.outline, self.slack, has_webs=part.kind == "extrude", axes=axes)
        self.known: dict[tuple[str, int, int], Row] = {}  # by word, axis, place on a grid
        self.places: dict[tuple[str, int, int], float] = {}
        self.about_middle = {axis for axis in (X, Y) if self._lies_about_middle(axis)}
        self.following = {} if part.kind == "revolve" else dict(self._find_following())
        self._add_places()

    # --- variables ----------------------------------------------------------------------------------------------------

    def _add_places(self) -> None:
        """One variable for each place of lines, of circles and of arcs; two that lie alike about the middle are an extent."""
        self._add_lines()
        rounds = [*self.joints.centers, *(r.center for r in self.joints.regular if r)]
        centers = [(axis, c[axis]) for c in rounds for axis in (X, Y)]
        across = "ring_radius" if self.part.kind == "revolve" else "hole_x"
        self._add("center", centers, ("hole_spacing_x", "hole_spacing_y"), (across, "hole_y"))
        self._add_arcs(rounds)
        for inner, prefix in ((False, ""), (True, "window_")):
            self._add_corners(inner, prefix, about_ends=True)
        for joint in self.joints.all():
            self.system.rows += [row for row in self._equations(joint) if row]

    def _lies_about_middle(self, axis: int) -> bool:
        """Whether more than the outline's two ends lies alike about the middle along an axis: lines, circles or arcs."""
        rounds = [*self.joints.centers, *(r.center for r in self.joints.regular if r), *(arc.center for arc in self.joints.arcs())]
        cells = {self.joints.cell(c[axis]) for c in rounds} | {self.joints.cell(c.place) for c in self.joints.lines() if c.across == axis}
        ends = {self.joints.cell(corner[axis]) for corner in self.outline.bounds}
        return any(-cell in cells for cell in cells - ends)

    def _add_lines(self) -> None:
        turned = self.part.kind == "revolve"
        words = (("diameter", "level"),) * 2 if turned else (("length", "width"), ("edge_x", "edge_y"))
        for inner, prefix in ((False, ""), (True, "window_")):
            lines = [c for c in self.joints.lines() if c.inner == inner and c.across is not None]
            corners = [corner for corner in self._corners() if corner.inner == inner]
            places = [(c.across or X, c.place) for c in lines] + [(c.axis, c.place) for c in corners if c.edge or turned]
            places = [(axis, place) for axis, place in places if (side_of(inner), axis, self.joints.cell(place)) not in self.following]
            extents, single = ((prefix + x, prefix + y) for x, y in words)
            if turned:
                self._add_levels(side_of(inner), sorted({self.joints.cell(place): place for axis, place in places if axis == Y}.values()))
            self._add(side_of(inner), places, extents, single)
            self._add_corners(inner, prefix, about_ends=False)

    def _add_levels(self, what: str, levels: Sequence[float]) -> None:
        """Heights of turned parts from the end that is nearer, the lowest level or the top, or from the next level on the way there that a
        wall leads from: sections of a shaft are as long as they are, wherever it begins. The lowest level lies half the whole height below
        the middle, or has a name."""
        low, high = (corner[Y] for corner in self.outline.bounds)
        if not any(abs(level - low) <= self.slack for level in levels):
            return  # what is round below has levels from the middle
        top = levels[-1]
        if abs(low + top) <= self.slack and abs(high - top) <= self.slack:
            if self.leaf not in self.system.heights:
                self.system.heights[self.leaf] = self._new("height", top - low)
            base, roof = ({self.system.heights[self.leaf]: half} for half in (-0.5, 0.5))
        else:
            base = {self._new("base", low): 1.0} if abs(low) > self.slack else {}
            roof = sum_rows((base, 1.0), ({self._new("height", top - low): 1.0}, 1.0))
        rows = {self.joints.cell(low): base, self.joints.cell(top): roof}
        beside, half = self._levels_beside(), (low + top) / 2
        between = [level for level in levels if low + self.slack < level < top - self.slack]
        for end, side, word in ((low, 1.0, "level"), (top, -1.0, "depth")):
            for level in sorted((v for v in between if (v < half) == (side > 0)), key=lambda v: side * v):
                on_the_way = (v for v in beside.get(self.joints.cell(level), ()) if side * (level - v) > self.slack)
                before = [v for v in on_the_way if self.joints.cell(v) in rows]
                start = max(before, key=lambda v: side * v, default=end)
                size = self._new(word if start == end else "step", side * (level - start))
                rows[self.joints.cell(level)] = sum_rows((rows[self.joints.cell(start)], 1.0), ({size: 1.0}, side))
        self.known |= {(what, Y, cell): row for cell, row in rows.items()}

    def _levels_beside(self) -> dict[int, list[float]]:
        """The levels that a wall leads to from each, by its cell."""
        found: dict[int, list[float]] = defaultdict(list)
        for joints in filter(None, self.joints.loops):
            for joint, following in zip(joints, [*joints[1:], joints[0]], strict=True):
                one, two = joint.at[Y], following.at[Y]
                found[self.joints.cell(one)].append(two)
                found[self.joints.cell(two)].append(one)
        return found

    def _add_arcs(self, holes: Sequence[tuple[float, float]]) -> None:
        """Centres of arcs that lie about a hole follow it, others the lines and arcs that they touch, as far as these say where; the lines
        beside an arc that turns far follow that."""
        arcs = [arc for arc in self.joints.arcs() if arc.end or not arc.loose]
        if self.may_be_slot and size_slot(arcs, self._new, self.slack):
            self._let_lines_follow()
            return
        for arc in arcs:
            arc.size = self.name_radius(
                "arc_radius" if arc.rim or (arc.crossed and not arc.end) else ROUNDS[arc.half or arc.end, arc.inner], arc.radius
            )
            near = NEARLY * arc.radius if arc.rim else self.slack
            hole = next((center for center in holes if math.dist(center, arc.center) <= near), None)
            if hole:
                arc.at = [self.find_place("center", axis, hole[axis]) for axis in (X, Y)]
        held = {(id(arc), axis) for arc, axis in self._held()}
        self._place_by_apex([(arc, axis) for arc in arcs for axis in (X, Y) if (id(arc), axis) not in held and arc.at[axis] is None])
        loose = [(axis, arc.center[axis]) for arc in arcs for axis in (X, Y) if (id(arc), axis) not in held and arc.at[axis] is None]
        self._add("arc", loose, ("round_spacing_x", "round_spacing_y"), ("round_x", "round_y"))
        for arc in arcs:
            for axis in (X, Y):
                if arc.at[axis] is None and (id(arc), axis) in held:
                    arc.at[axis] = {self._new("arc_center", arc.center[axis]): 1.0}
                elif arc.at[axis] is None:
                    arc.at[axis] = self.find_place("arc", axis, arc.center[axis])
        self._let_lines_follow()

    def _place_by_apex(self, free: Sequence[tuple[DrawnArc, int]]) -> None:
        """Flat arcs are where their apex is, if that is nearer than their centre: of a radius that is ten times as large as the part,
        a tenth more would move them out of it."""
        apexes = {(id(arc), axis): side for arc, axis, side in self.joints.apexes()}
        flat = [(arc, axis, apexes[id(arc), axis]) for arc, axis in free if (id(arc), axis) in apexes]
        flat = [(arc, axis, side) for arc, axis, side in flat if abs(arc.center[axis] + side * arc.radius) < abs(arc.center[axis])]
        places = [(axis, arc.center[axis] + side * arc.radius) for arc, axis, side in flat]
        self._add("apex", places, ("apex_spacing_x", "apex_spacing_y"), ("apex_x", "apex_y"))
        for (arc, axis, side), (_, place) in zip(flat, places, strict=True):
            arc.at[axis] = sum_rows((self.find_place("apex", axis, place), 1.0), (arc.size, -side))

    def _let_lines_follow(self) -> None:
        for (what, axis, cell), (arc, side) in self.following.items():
            self.known[what, axis, cell] = sum_rows((arc.at[axis] or {}, 1.0), (arc.size, side))

    def _find_following(self) -> Iterator[tuple[tuple[str, int, int], tuple[DrawnArc, float]]]:
        """The lines that touch an arc of more than a quarter turn, by word, axis and place, with that and the side where they lie: a
        round end, which is somewhere and has a radius, unlike a rounded corner, which is where its lines are."""
        for joint in self.joints.all():
            for arc, line in ((joint.before, joint.after), (joint.after, joint.before)):
                if not isinstance(arc, DrawnArc) or not isinstance(line, DrawnLine) or not (arc.wide and joint.fits) or arc.loose:
                    continue
                place = (joint.along or X, self.joints.cell(line.place))
                if joint.along is not None and line.across == joint.along:
                    yield (side_of(line.inner), *place), (arc, math.copysign(1.0, line.place - arc.center[joint.along]))

    def _corners(self) -> Iterator[_Corner]:
        """The coordinates of corners at which leaning lines or loose arcs meet, those that no line along an axis says."""
        for joint in self.joints.all():
            lines = [c.across for c in (joint.before, joint.after) if isinstance(c, DrawnLine)]
            edge = len(lines) == 2 and lines != [None, None]
            if not joint.is_placed:
                yield from (_Corner(axis, joint.at[axis], joint.after.inner, edge) for axis in (X, Y) if axis not in lines)

    def _held(self) -> Iterator[tuple[DrawnArc, int]]:
        """Arcs and the axes along which a line or another arc says where their centres are."""
        for joint in self.joints.all():
            for arc, other in ((joint.before, joint.after), (joint.after, joint.before)):
                if isinstance(arc, DrawnArc) and joint.fits and other is not arc:
                    yield from ((arc, axis) for axis in (X, Y) if self._says_where(other, axis))

    def _says_where(self, curve: DrawnCurve, axis: int) -> bool:
        if isinstance(curve, DrawnArc):
            return not curve.loose
        return curve.across == axis and (side_of(curve.inner), axis, self.joints.cell(curve.place)) not in self.following

    def _add_corners(self, inner: bool, prefix: str, about_ends: bool) -> None:
        """Variables for the other corners: of those that mirror each other how far they are apart, of others how far from the axis, or from
        what is nearer of their loop and has a place, the nearest first. Small things move whole, and run into nothing beside them.

        Of loops with arcs about places of their own, or of the others: the tip of a teardrop is as far from the middle of its arc as it is.
        """
        loops = [loop for loop in self.joints.loops if loop and loop[0].after.inner == inner]
        what, found = side_of(inner), [loop for loop in loops if about_ends == bool(_ends_of(loop))]
        drawn = [([joint for joint in loop if not joint.is_placed], _ends_of(loop)) for loop in found]
        every = {(axis, self.joints.cell(joint.at[axis])) for loop, _ in drawn for joint in loop for axis in (X, Y)}
        for axis, (loop, ends) in product((X, Y), drawn):
            places = {self.joints.cell(joint.at[axis]): joint.at[axis] for joint in loop if abs(joint.at[axis]) > self.slack}
            placed = {0.0: _CornerDatum({}, "step")}
            placed |= {end.center[axis]: _CornerDatum(end.at[axis] or {}, "step" if end.rim else "tip") for end in ends}
            known = {cell: place for cell, place in places.items() if (what, axis, cell) in self.known}
            placed |= {place: _CornerDatum(self.known[what, axis, cell], "step") for cell, place in known.items()}
            left = [p for cell, p in places.items() if (what, axis, cell) not in self.known and (what, axis, cell) not in self.following]
            while left:
                place, base = min(product(left, placed), key=lambda pair: abs(pair[0] - pair[1]))
                left.remove(place)
                cell, mirrored = (self.joints.cell(p) for p in (place, -place))
                if (what, axis, cell) not in self.known:
                    both = (axis, mirrored) in every and (what, axis, mirrored) not in self.known
                    self.known[what, axis, cell] = row = self._corner_row(axis, place, base, placed[base], both, prefix)
                    if both:
                        self.known[what, axis, mirrored] = sum_rows((row, -1.0))
                placed[place] = _CornerDatum(self.known[what, axis, cell], "step")

    def _corner_row(self, axis: int, place: float, start: float, base: _CornerDatum, both: bool, prefix: str) -> Row:
        """A coordinate of a corner as a step from a `base` at `start`, as its own, or, of `both` that mirror each other, as half a
        spacing."""
        if base.row and not (both and abs(place - start) > NEAR * abs(place)):
            if abs(place - start) <= self.slack:
                return base.row
            step = self._new(f"{prefix}{base.word}_{'xy'[axis]}", place - start)
            return sum_rows((base.row, 1.0), ({step: 1.0}, 1.0))
        word, size = ("corner_spacing", 2 * abs(place)) if both else ("corner", place)
        return {self._new(f"{prefix}{word}_{'xy'[axis]}", size): place / size}

    def _add(self, what: str, places: Iterable[tuple[int, float]], extents: tuple[str, str], single: tuple[str, str]) -> None:
        """Variables for places along an axis, those farthest out first; none for what lies on the axis itself."""
        turned = self.part.kind == "revolve"
        found = {(axis, self.joints.cell(place)): place for axis, place in places if abs(place) > self.slack}
        for axis, cell in sorted(found, key=lambda k: (k[0], -abs(k[1]), k[1])):
            place = found[axis, cell]
            self.places[what, axis, cell] = place
            if (what, axis, cell) in self.known:
                continue
            if turned and axis == Y:
                self.known[what, axis, cell] = {self._new("level", place): 1.0}
                continue
            both = (axis, self.joints.cell(-place)) in found and not turned
            outer = self._next_out(what, axis, place, from_end=not both and not turned and axis not in self.about_middle)
            if outer is None and (self._add_walls(what, axis, abs(place)) if both else self._add_wall(what, axis, place)):
                continue
            if outer is not None and (not both or (what, axis, self.joints.cell(-outer)) in self.known):
                gap = self._new("thickness" if turned else f"inset_{'xy'[axis]}", abs(outer) - abs(place))
                for side in (1, -1) if both else (math.copysign(1.0, place),):
                    known = self.find_place(what, axis, side * abs(outer))
                    self.known[what, axis, self.joints.cell(side * abs(place))] = sum_rows((known, 1.0), ({gap: 1.0}, -side))
            elif both:
                extent = self._new(extents[axis], 2 * abs(place))
                for side in (1, -1):
                    self.known[what, axis, self.joints.cell(side * abs(place))] = {extent: side / 2}
            else:
                share = 0.5 if single[axis].endswith("diameter") else 1.0
                self.known[what, axis, cell] = {self._new(single[axis], place / share): share}

    def _add_wall(self, what: str, axis: int, place: float) -> bool:
        """Of a window on one side what is left between its edge and the outline's, where that is thin."""
        outer = self._next_out(side_of(False), axis, place) if what == side_of(True) else None
        edge = {} if outer is None else self.find_place(side_of(False), axis, outer)
        if outer is None or not edge:
            return False
        wall = self._new(f"wall_{'xy'[axis]}", abs(outer - place))
        self.known[what, axis, self.joints.cell(place)] = sum_rows((edge, 1.0), ({wall: 1.0}, -math.copysign(1.0, place)))
        return True

    def _add_walls(self, what: str, axis: int, place: float) -> bool:
        """Of a window that reaches from side to side what is left beside it, where that is thin."""
        windows = (loop for loop in self.joints.loops if loop and loop[0].after.inner)
        sides = ({c.place for c in (j.after for j in loop) if isinstance(c, DrawnLine) and c.across == axis} for loop in windows)
        if what != side_of(True) or not any(_has(places, place, self.slack) and _has(places, -place, self.slack) for places in sides):
            return False
        outer = self._next_out(side_of(False), axis, place)
        if outer is None or (side_of(False), axis, self.joints.cell(-outer)) not in self.known:
            return False
        wall = self._new(f"wall_{'xy'[axis]}", outer - place)
        for side in (1, -1):
            edge = self.find_place(side_of(False), axis, side * outer)
            self.known[what, axis, self.joints.cell(side * place)] = sum_rows((edge, 1.0), ({wall: 1.0}, -side))
        return True

    def _next_out(self, what: str, axis: int, place: float, from_end: bool = False) -> float | None:
        """The place next further out that is near enough to be measured from, or however far the outline's end, if `from_end`; of lines of
        an extrusion and of thin rings that are cut alone, others are told by radii."""
        if what not in (side_of(False), side_of(True)) or (self.part.kind == "revolve" and not self._is_in_ring(place)):
            return None
        outer = [
            p
            for (word, a, _), p in self.places.items()
            if word == what and a == axis and p * place > 0 and abs(p) > abs(place) + self.slack
        ]
        near = min(outer, key=abs, default=None)
        if near is None or (from_end and any(abs(corner[axis] - near) <= self.slack for corner in self.outline.bounds)):
            return near
        return near if abs(near) - abs(place) <= NEAR * abs(near) else None

    def _is_in_ring(self, radius: float) -> bool:
        """Whether a radius of a turned cut is that of a wall of a thin ring, behind its outermost: the ring is as thick as it is, however
        large. A tube, in whose walls others end, has diameters."""
        bounds = (Outline((loop,)).bounds for loop in self.outline.loops)
        sides = [(low[X], high[X]) for low, high in bounds]
        return self.cuts and any(high - low <= NEAR * high and low - self.slack <= radius < high - self.slack for low, high in sides)

    def row_of_line(self, inner: bool, axis: int, place: float) -> Row:
        """The variables whose sum the place of a line across an axis is; none for what lies on the origin, or has no place."""
        return self.find_place(side_of(inner), axis, place)

    def find_place(self, what: str, axis: int, place: float) -> Row:
        return self.known.get((what, axis, self.joints.cell(place)), {})

    def name_radius(self, word: str, radius: float) -> Row:
        key = (word, 0, self.joints.cell(radius))
        if key not in self.known:
            self.known[key] = {self._new(word, radius): 1.0}
        return self.known[key]

    def name_count(self, word: str, count: int) -> Row:
        if (word, 0, count) not in self.known:
            self.known[word, 0, count] = {self._new(word, count): 1.0}
        return self.known[word, 0, count]

    def _new(self, word: str, value: float) -> int:
        return self.system.new(self.leaf, word, value)

    # --- equations ----------------------------------------------------------------------------------------------------

    def _equations(self, joint: Joint) -> Iterator[Row]:
        """That both curves pass the vertex, where one is an arc that may move."""
        a, b = joint.before, joint.after
        line = next((c for c in (a, b) if isinstance(c, DrawnLine) and c.across is not None), None)
        if joint.about and line:
            assert line.across is not None
            side = 1.0 if line.place > joint.about.center[line.across] else -1.0
            place = self.find_place(side_of(line.inner), line.across, line.place)
            yield sum_rows((place, 1.0), (joint.about.at[line.across] or {}, -1.0), (joint.about.size, -side))
        if joint.along is None or not joint.fits or any(isinstance(c, DrawnArc) and c.loose for c in (a, b)):
            return
        for axis in (X, Y):
            (first, knows), (second, also) = (self.find_coordinate(c, joint, axis) for c in (a, b))
            if knows and also:
                yield sum_rows((first, 1.0), (second, -1.0))

    def find_coordinate(self, c: DrawnCurve, joint: Joint, axis: int) -> tuple[Row, bool]:
        """One coordinate of a vertex by one of its curves, and whether that says it."""
        if isinstance(c, DrawnLine):
            return (self.find_place(side_of(c.inner), axis, c.place), True) if c.across == axis else ({}, False)
        center = c.at[axis] or {}
        if axis != joint.along:
            return center, True
        return sum_rows((center, 1.0), (c.size, 1.0 if joint.at[axis] > c.center[axis] else -1.0)), True


def _ends_of(loop: Sequence[Joint]) -> list[DrawnArc]:
    """The arcs of a loop whose ends are where the lines beside them touch them, or lie about their centres."""
    arcs = [joint.about or joint.after for joint in loop]
    return list({id(arc): arc for arc in arcs if isinstance(arc, DrawnArc) and (arc.end or arc.rim)}.values())


def _has(places: Iterable[float], place: float, slack: float) -> bool:
    return any(abs(p - place) <= slack for p in places)


def side_of(inner: bool) -> str:
    """The lines of holes have places of their own."""
    return "inner" if inner else "outer"
