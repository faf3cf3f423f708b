"""The dimensions of outlines as variables and equations: where lines lie, how round corners are, where holes are and how large.

Lines along the two axes of an outline have places, chamfers between them a length, arcs a centre and a radius. All directions stay: arcs
that touch such lines, or end square to them, keep their angles, so that the vertices there are sums of these numbers. Where an arc crosses
such a line the vertex is as far from the centre as the arc reaches along it. Corners at which lines lean have places of their own. Arcs
that meet anything else are loose: their ends have places, and they round a corner with a radius, touch a neighbour, or have a radius; those
that turn far an angle. A regular polygon has a count of sides, a centre, a radius, and an angle where that is none that one would draw.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from imdim.export.drawn_vertex import (
    Bend,
    BendAngle,
    BendRadius,
    Center,
    DrawnEllipse,
    DrawnPolygon,
    DrawnRing,
    DrawnVertex,
    Reach,
    Touching,
    turn_round,
)
from imdim.export.outline_joints import HALF, DrawnArc, DrawnCurve, DrawnLine, Joint, OutlineJoints, Row, X, Y, sum_rows
from imdim.export.outline_walls import EXACT, RoundWall, bind_coaxial, find_flat_walls
from imdim.export.slot_sizes import has_round_ends, size_slot
from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import is_level
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Point, circle_of
from imdim.program.regular_polygon import RegularPolygon
from imdim.program.repeats import Folded, instances
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

NEAR = 0.2  # of a place: what lies no further inside another is measured from that
WIDEST = 120.0  # degrees by which an arc turns that is told by its radius: the ends of a wider one soon lie too far apart for that
ANGLE_DECIMALS = 6  # of a degree that comes of the digits of vertices
PLAIN_ANGLE = 15.0  # degrees: a regular polygon that is turned by a multiple of that needs no name for it
_ROUNDS = {  # what the radius of an arc is called: one that turns by half, one that bounds a hole
    (False, False): "corner_radius",
    (True, False): "end_radius",
    (False, True): "window_corner_radius",
    (True, True): "slot_radius",
}


@dataclass(frozen=True)
class Sum:
    """A number that is a sum of variables, but for a constant."""

    row: Row
    value: float


Drawn = tuple[DrawnRing[Sum], ...]


def add_outlines(system: LinearSystem, parts: Sequence[Primitive], folded: Folded | None, sign: Sequence[int]) -> dict[int, Drawn]:
    """Variables and equations for the outlines of all leaves, and of each leaf what its vertices are; `sign` is -1 of those that cut.

    Copies that a repeat makes share the variables of the first, turned round where they are mirror images.
    """
    sources = list(range(len(parts))) if folded is None else [source for source, _ in instances(folded)]
    drawn: dict[int, Drawn] = {}
    circles: list[RoundWall] = []
    for leaf, (part, source) in enumerate(zip(parts, sources, strict=True)):
        if part.outline is None:
            continue
        if source == leaf or source not in drawn:
            dimensions = _Dimensions(system, leaf, part, sign[leaf] < 0)
            drawn[leaf] = dimensions.vertices()
            circles += dimensions.circles_in_space()
            system.walls += find_flat_walls(leaf, part, dimensions.joints, dimensions.row_of_line)
        elif part.outline == parts[source].outline:
            drawn[leaf] = drawn[source]
            if source in system.heights:
                system.heights[leaf] = system.heights[source]
        elif part.outline == parts[source].outline.mirror():  # type: ignore[union-attr]
            drawn[leaf] = tuple(map(_mirrored, drawn[source]))
        else:
            # what follows one of them would leave the other as it is
            drawn[leaf], drawn[source] = _constant(part.outline), _constant(parts[source].outline)
            circles = [c for c in circles if c.leaf != source]
            system.heights.pop(source, None)
    system.rows += bind_coaxial(system, circles, parts, sources)
    return drawn


def _mirrored(loop: DrawnRing[Sum]) -> DrawnRing[Sum]:
    """As `Outline.mirror` has it: the other side of the y axis, run the other way from the same vertex."""

    def other_side(number: Sum) -> Sum:
        return Sum(sum_rows((number.row, -1.0)), -number.value)

    def bend(v: DrawnVertex[Sum]) -> Bend[Sum]:
        # an arc turned round and mirrored runs the same way
        if isinstance(v.bulge, Center):
            return replace(v.bulge, x=other_side(v.bulge.x))
        return turn_round(v.bulge) if isinstance(v.bulge, Touching) else v.bulge

    if isinstance(loop, DrawnEllipse):
        return replace(loop, x=other_side(loop.x), angle=other_side(loop.angle))
    if isinstance(loop, DrawnPolygon):
        return replace(loop, x=other_side(loop.x), angle=Sum(sum_rows((loop.angle.row, -1.0)), 180.0 - loop.angle.value))
    bulges = [bend(v) for v in reversed(loop)]
    corners = [loop[0], *reversed(loop[1:])]
    reaches = [replace(v.reach, sign=-v.reach.sign) if v.reach and v.reach.axis == X else v.reach for v in corners]
    return tuple(DrawnVertex(other_side(v.x), v.y, b, r) for v, b, r in zip(corners, bulges, reaches, strict=True))


def _constant(outline: Outline | None) -> Drawn:
    assert outline is not None

    def constant(loop: Loop) -> DrawnRing[Sum]:
        if isinstance(loop, Ellipse):
            rx, ry, x, y, angle = (Sum({}, v) for v in (loop.rx, loop.ry, loop.x, loop.y, loop.angle))
            return DrawnEllipse(rx, ry, x, y, angle)
        return tuple(DrawnVertex(Sum({}, x), Sum({}, y), b) for x, y, b in loop)

    return tuple(map(constant, outline.loops))


class _Corner(NamedTuple):
    """A coordinate of a corner; at an `edge` a line along an axis meets one that leans."""

    axis: int
    place: float
    inner: bool
    edge: bool


# --- one outline --------------------------------------------------------------------------------------------------------


class _Dimensions:
    """The variables of one outline."""

    def __init__(self, system: LinearSystem, leaf: int, part: Primitive, cuts: bool) -> None:
        assert part.outline is not None
        self.may_be_slot = cuts and part.kind == "extrude" and has_round_ends(part.outline)
        self.system, self.leaf, self.part, self.outline = system, leaf, part, part.outline
        self.slack = EXACT * system.length
        self.joints = OutlineJoints(part.outline, self.slack)
        self.known: dict[tuple[str, int, int], Row] = {}  # by word, axis, place on a grid
        self.places: dict[tuple[str, int, int], float] = {}
        self.following = {} if part.kind == "revolve" else dict(self._find_following())
        self._add_places()

    # --- variables ----------------------------------------------------------------------------------------------------

    def _add_places(self) -> None:
        """One variable for each place of lines, of circles and of arcs; two that lie alike about the middle are an extent."""
        self._add_lines()
        rounds = [*self.joints.centers, *(r.center for r in self.joints.regular if r)]
        centers = [(axis, c[axis]) for c in rounds for axis in (X, Y)]
        self._add("center", centers, ("hole_spacing_x", "hole_spacing_y"), ("hole_x", "hole_y"))
        self._add_arcs(rounds)
        for joint in self.joints.all():
            self.system.rows += [row for row in self._equations(joint) if row]

    def _add_lines(self) -> None:
        turned = self.part.kind == "revolve"
        words = (("diameter", "level"),) * 2 if turned else (("length", "width"), ("edge_x", "edge_y"))
        for inner, prefix in ((False, ""), (True, "window_")):
            lines = [c for c in self.joints.lines() if c.inner == inner and c.across is not None]
            corners = [corner for corner in self._corners() if corner.inner == inner]
            places = [(c.across or X, c.place) for c in lines] + [(c.axis, c.place) for c in corners if c.edge or turned]
            places = [(axis, place) for axis, place in places if (_side(inner), axis, self.joints.cell(place)) not in self.following]
            extents, single = ((prefix + x, prefix + y) for x, y in words)
            if turned:
                self._add_levels(_side(inner), sorted({self.joints.cell(place): place for axis, place in places if axis == Y}.values()))
            self._add(_side(inner), places, extents, single)
            self._add_corners(_side(inner), [loop for loop in self.joints.loops if loop and loop[0].after.inner == inner], prefix)

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
            arc.size = self._radius("arc_radius" if arc.crossed and not arc.end else _ROUNDS[arc.half or arc.end, arc.inner], arc.radius)
            hole = next((center for center in holes if math.dist(center, arc.center) <= self.slack), None)
            if hole:
                arc.at = [self._place("center", axis, hole[axis]) for axis in (X, Y)]
        held = {(id(arc), axis) for arc, axis in self._held()}
        self._place_by_apex([(arc, axis) for arc in arcs for axis in (X, Y) if (id(arc), axis) not in held and arc.at[axis] is None])
        loose = [(axis, arc.center[axis]) for arc in arcs for axis in (X, Y) if (id(arc), axis) not in held and arc.at[axis] is None]
        self._add("arc", loose, ("round_spacing_x", "round_spacing_y"), ("round_x", "round_y"))
        for arc in arcs:
            for axis in (X, Y):
                if arc.at[axis] is None and (id(arc), axis) in held:
                    arc.at[axis] = {self._new("arc_center", arc.center[axis]): 1.0}
                elif arc.at[axis] is None:
                    arc.at[axis] = self._place("arc", axis, arc.center[axis])
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
            arc.at[axis] = sum_rows((self._place("apex", axis, place), 1.0), (arc.size, -side))

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
                    yield (_side(line.inner), *place), (arc, math.copysign(1.0, line.place - arc.center[joint.along]))

    def _corners(self) -> Iterator[_Corner]:
        """The coordinates of corners at which leaning lines or loose arcs meet, those that no line along an axis says."""
        for joint in self.joints.all():
            lines = [c.across for c in (joint.before, joint.after) if isinstance(c, DrawnLine)]
            edge = len(lines) == 2 and lines != [None, None]
            if not joint.carried and not joint.about:
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
        return curve.across == axis and (_side(curve.inner), axis, self.joints.cell(curve.place)) not in self.following

    def _add_corners(self, what: str, loops: Sequence[Sequence[Joint]], prefix: str) -> None:
        """Variables for the other corners: of those that mirror each other how far they are apart, of others how far from the axis, or from
        what is nearer of their loop and has a place, the nearest first. Small things move whole, and run into nothing beside them."""
        drawn = [[joint for joint in loop if not joint.carried and not joint.about] for loop in loops]
        every = {(axis, self.joints.cell(joint.at[axis])) for loop in drawn for joint in loop for axis in (X, Y)}
        for axis, loop in product((X, Y), drawn):
            places = {self.joints.cell(joint.at[axis]): joint.at[axis] for joint in loop if abs(joint.at[axis]) > self.slack}
            placed = [0.0, *(place for cell, place in places.items() if (what, axis, cell) in self.known)]
            left = [p for cell, p in places.items() if (what, axis, cell) not in self.known and (what, axis, cell) not in self.following]
            while left:
                place, base = min(product(left, placed), key=lambda pair: abs(pair[0] - pair[1]))
                left.remove(place)
                placed.append(place)
                cell, mirrored = (self.joints.cell(p) for p in (place, -place))
                if (what, axis, cell) not in self.known:
                    both = (axis, mirrored) in every and (what, axis, mirrored) not in self.known
                    self.known[what, axis, cell] = row = self._corner_row(what, axis, place, base, both, prefix)
                    if both:
                        self.known[what, axis, mirrored] = sum_rows((row, -1.0))

    def _corner_row(self, what: str, axis: int, place: float, base: float, both: bool, prefix: str) -> Row:
        """A coordinate of a corner as a step from a `base`, as its own, or, of `both` that mirror each other, as half a spacing."""
        if base and not (both and abs(place - base) > NEAR * abs(place)):
            step = self._new(f"{prefix}step_{'xy'[axis]}", place - base)
            return sum_rows((self._place(what, axis, base), 1.0), ({step: 1.0}, 1.0))
        word, size = ("corner_spacing", 2 * abs(place)) if both else ("corner", place)
        return {self._new(f"{prefix}{word}_{'xy'[axis]}", size): place / size}

    def _add(self, what: str, places: Iterable[tuple[int, float]], extents: tuple[str, str], single: tuple[str, str]) -> None:
        """Variables for places along an axis, those farthest out first; none for what lies on the axis itself."""
        found = {(axis, self.joints.cell(place)): place for axis, place in places if abs(place) > self.slack}
        for axis, cell in sorted(found, key=lambda k: (k[0], -abs(k[1]), k[1])):
            place = found[axis, cell]
            self.places[what, axis, cell] = place
            if (what, axis, cell) in self.known:
                continue
            if self.part.kind == "revolve" and axis == Y:
                self.known[what, axis, cell] = {self._new("level", place): 1.0}
                continue
            outer = self._next_out(what, axis, place)
            both = (axis, self.joints.cell(-place)) in found and self.part.kind != "revolve"
            if outer is None and (self._add_walls(what, axis, abs(place)) if both else self._add_wall(what, axis, place)):
                continue
            if outer is not None and (not both or (what, axis, self.joints.cell(-outer)) in self.known):
                gap = self._new(f"inset_{'xy'[axis]}", abs(outer) - abs(place))
                for side in (1, -1) if both else (math.copysign(1.0, place),):
                    known = self._place(what, axis, side * abs(outer))
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
        outer = self._next_out(_side(False), axis, place) if what == _side(True) else None
        edge = {} if outer is None else self._place(_side(False), axis, outer)
        if outer is None or not edge:
            return False
        wall = self._new(f"wall_{'xy'[axis]}", abs(outer - place))
        self.known[what, axis, self.joints.cell(place)] = sum_rows((edge, 1.0), ({wall: 1.0}, -math.copysign(1.0, place)))
        return True

    def _add_walls(self, what: str, axis: int, place: float) -> bool:
        """Of a window that reaches from side to side what is left beside it, where that is thin."""
        windows = (loop for loop in self.joints.loops if loop and loop[0].after.inner)
        sides = ({c.place for c in (j.after for j in loop) if isinstance(c, DrawnLine) and c.across == axis} for loop in windows)
        if what != _side(True) or not any(_has(places, place, self.slack) and _has(places, -place, self.slack) for places in sides):
            return False
        outer = self._next_out(_side(False), axis, place)
        if outer is None or (_side(False), axis, self.joints.cell(-outer)) not in self.known:
            return False
        wall = self._new(f"wall_{'xy'[axis]}", outer - place)
        for side in (1, -1):
            edge = self._place(_side(False), axis, side * outer)
            self.known[what, axis, self.joints.cell(side * place)] = sum_rows((edge, 1.0), ({wall: 1.0}, -side))
        return True

    def _next_out(self, what: str, axis: int, place: float) -> float | None:
        """The place next further out that is near enough to be measured from; of an extrusion's lines alone, others are told by radii."""
        if what not in (_side(False), _side(True)) or self.part.kind == "revolve":
            return None
        outer = [
            p
            for (word, a, _), p in self.places.items()
            if word == what and a == axis and p * place > 0 and abs(p) > abs(place) + self.slack
        ]
        near = min(outer, key=abs, default=None)
        return near if near is not None and abs(near) - abs(place) <= NEAR * abs(near) else None

    def row_of_line(self, inner: bool, axis: int, place: float) -> Row:
        """The variables whose sum the place of a line across an axis is; none for what lies on the origin, or has no place."""
        return self._place(_side(inner), axis, place)

    def _place(self, what: str, axis: int, place: float) -> Row:
        return self.known.get((what, axis, self.joints.cell(place)), {})

    def _radius(self, word: str, radius: float) -> Row:
        key = (word, 0, self.joints.cell(radius))
        if key not in self.known:
            self.known[key] = {self._new(word, radius): 1.0}
        return self.known[key]

    def _shared(self, word: str, count: int) -> Row:
        if (word, 0, count) not in self.known:
            self.known[word, 0, count] = {self._new(word, count): 1.0}
        return self.known[word, 0, count]

    def _new(self, word: str, value: float) -> int:
        return self.system.new(self.leaf, word, value)

    # --- equations and vertices ---------------------------------------------------------------------------------------

    def _equations(self, joint: Joint) -> Iterator[Row]:
        """That both curves pass the vertex, where one is an arc that may move."""
        a, b = joint.before, joint.after
        line = next((c for c in (a, b) if isinstance(c, DrawnLine) and c.across is not None), None)
        if joint.about and line:
            assert line.across is not None
            side = 1.0 if line.place > joint.about.center[line.across] else -1.0
            place = self._place(_side(line.inner), line.across, line.place)
            yield sum_rows((place, 1.0), (joint.about.at[line.across] or {}, -1.0), (joint.about.size, -side))
        if joint.along is None or not joint.fits or any(isinstance(c, DrawnArc) and c.loose for c in (a, b)):
            return
        for axis in (X, Y):
            (first, knows), (second, also) = (self._coordinate(c, joint, axis) for c in (a, b))
            if knows and also:
                yield sum_rows((first, 1.0), (second, -1.0))

    def _coordinate(self, c: DrawnCurve, joint: Joint, axis: int) -> tuple[Row, bool]:
        """One coordinate of a vertex by one of its curves, and whether that says it."""
        if isinstance(c, DrawnLine):
            return (self._place(_side(c.inner), axis, c.place), True) if c.across == axis else ({}, False)
        center = c.at[axis] or {}
        if axis != joint.along:
            return center, True
        return sum_rows((center, 1.0), (c.size, 1.0 if joint.at[axis] > c.center[axis] else -1.0)), True

    def vertices(self) -> Drawn:
        """The vertices of all loops."""
        return tuple(map(self._ring, range(len(self.outline.loops))))

    def _ring(self, i: int) -> DrawnRing[Sum]:
        regular, joints, loop = self.joints.regular[i], self.joints.loops[i], self.outline.loops[i]
        if regular is not None:
            return self._polygon(regular)
        if isinstance(loop, Ellipse):
            return self._ellipse(loop, self.joints.holes[i])
        return self._circle(i) if joints is None else self._vertices(joints, loop)

    def _vertices(self, joints: Sequence[Joint], loop: Sequence[tuple[float, float, float]]) -> tuple[DrawnVertex[Sum], ...]:
        chamfered = self._chamfers(joints)
        rows = []
        for k, (joint, vertex) in enumerate(zip(joints, loop, strict=True)):
            bend = self._bend(joint, vertex[2])
            if joint.crosses and joint.carried:
                rows.append(self._crossing(joint, bend))
                continue
            if joint.about:
                center = _center(joint.about, 1)
                rows.append(DrawnVertex(center.x, center.y, bend))
                continue
            x, y = chamfered.get(k) or (self._vertex(joint, X), self._vertex(joint, Y))
            rows.append(DrawnVertex(Sum(x, joint.at[X]), Sum(y, joint.at[Y]), bend))
        return tuple(rows)

    def _bend(self, joint: Joint, bulge: float) -> Bend[Sum]:
        """How the curve after a joint bends."""
        arc, way = joint.after, 1 if bulge > 0 else -1
        if not isinstance(arc, DrawnArc) or (not arc.loose and not arc.crossed):
            return bulge
        if not arc.loose:
            return _center(arc, way)
        if arc.end:
            return BendRadius(Sum(arc.size, arc.radius), way)
        if joint.rounds:
            return BendRadius(Sum(self._radius(_ROUNDS[False, arc.inner], arc.radius), arc.radius), 0)
        if joint.touches:
            return Touching(joint.touches)
        if arc.half:
            return bulge
        if abs(joint.turn) <= WIDEST:
            return BendRadius(Sum(self._radius("arc_radius", arc.radius), arc.radius), way)
        turn = round(abs(joint.turn), ANGLE_DECIMALS)
        return BendAngle(Sum({self.system.new_angle(self.leaf, "arc_angle", turn): 1.0}, turn), way)

    def _crossing(self, joint: Joint, bend: Bend[Sum]) -> DrawnVertex[Sum]:
        """Where an arc crosses a line along an axis: as far from the centre as the circle reaches there."""
        line, arc = (joint.before, joint.after) if isinstance(joint.before, DrawnLine) else (joint.after, joint.before)
        assert isinstance(line, DrawnLine)
        assert isinstance(arc, DrawnArc)
        assert line.across is not None
        across, axis = line.across, 1 - line.across
        place, center = self._place(_side(line.inner), across, line.place), arc.at[across] or {}
        off = Sum(sum_rows((place, 1.0), (center, -1.0)), line.place - arc.center[across])
        sign = 1 if joint.at[axis] > arc.center[axis] else -1
        ends = [Sum(place, line.place), Sum(arc.at[axis] or {}, arc.center[axis])]
        x, y = ends if across == X else reversed(ends)
        return DrawnVertex(x, y, bend, Reach(axis, sign, Sum(arc.size, arc.radius), off))

    def _vertex(self, joint: Joint, axis: int) -> Row:
        curves = [c for c in (joint.before, joint.after) if isinstance(c, DrawnLine) or not c.loose]
        known = next((row for row, knows in (self._coordinate(c, joint, axis) for c in curves) if knows), None)
        return self._place(_side(joint.after.inner), axis, joint.at[axis]) if known is None else known

    def _chamfers(self, joints: Sequence[Joint]) -> dict[int, tuple[Row, Row]]:
        """Of lines at 45 degrees between two along the axes the ends, each as far from where these would meet as the chamfer is wide."""
        out: dict[int, tuple[Row, Row]] = {}
        for k, joint in enumerate(joints):
            following = joints[(k + 1) % len(joints)]
            line, a, b = joint.after, joint.before, following.after
            if not (isinstance(line, DrawnLine) and line.across is None and isinstance(a, DrawnLine) and isinstance(b, DrawnLine)):
                continue
            if a.across is None or b.across is None or a.across == b.across:
                continue
            corner: list[Row] = [{}, {}]
            for c in (a, b):
                corner[c.across or X] = self._place(_side(c.inner), c.across or X, c.place)
            first, second = joint.at[b.across] - b.place, following.at[a.across] - a.place
            if abs(abs(first) - abs(second)) > self.slack:
                continue
            for number, c, off in ((k, b, first), ((k + 1) % len(joints), a, second)):
                assert c.across is not None
                width = self._radius("chamfer", abs(off))
                ends = list(corner)
                ends[c.across] = sum_rows((corner[c.across], 1.0), (width, math.copysign(1.0, off)))
                out[number] = (ends[X], ends[Y])
        return out

    def _circle(self, i: int) -> tuple[DrawnVertex[Sum], ...]:
        loop, found = self.outline.loops[i], circle_of(self.outline.loops[i])
        assert found is not None
        assert not isinstance(loop, Ellipse)
        *center, radius = found
        at = [self._place("center", axis, center[axis]) for axis in (X, Y)]
        size = self._circle_size(i)
        rows = [[sum_rows((at[axis], 1.0), (size, (v[axis] - center[axis]) / radius)) for axis in (X, Y)] for v in loop]
        return tuple(DrawnVertex(Sum(x, v[0]), Sum(y, v[1]), v[2]) for (x, y), v in zip(rows, loop, strict=True))

    def _polygon(self, regular: RegularPolygon) -> DrawnPolygon[Sum]:
        sides = Sum(self._shared("sides", regular.sides), regular.sides)
        is_across = regular.is_measured_across_flats
        word, value = ("across_flats", regular.across_flats) if is_across else ("polygon_radius", regular.radius)
        size, angle = Sum(self._radius(word, value), value), self._angle("polygon_angle", regular.angle)
        return DrawnPolygon(sides, size, *self._center_of(regular.center), angle, is_across)

    def _ellipse(self, loop: Ellipse, hole: bool) -> DrawnEllipse[Sum]:
        """An ellipse by its length and width; holes have their own."""
        prefix = "tube_" if self.part.kind == "revolve" else "hole_" if hole else ""
        rows = (sum_rows((self._radius(prefix + word, 2 * r), 0.5)) for word, r in (("length", loop.rx), ("width", loop.ry)))
        rx, ry = (Sum(row, r) for row, r in zip(rows, (loop.rx, loop.ry), strict=True))
        return DrawnEllipse(rx, ry, *self._center_of((loop.x, loop.y)), self._angle("ellipse_angle", loop.angle))

    def _center_of(self, center: tuple[float, float]) -> tuple[Sum, Sum]:
        x, y = (Sum(self._place("center", axis, center[axis]), center[axis]) for axis in (X, Y))
        return x, y

    def _angle(self, word: str, angle: float) -> Sum:
        """An angle in degrees, with a name where it is none that one would draw."""
        if abs(math.remainder(angle, PLAIN_ANGLE)) <= HALF:
            return Sum({}, round(angle / PLAIN_ANGLE) * PLAIN_ANGLE)
        angle = round(angle, ANGLE_DECIMALS)
        return Sum({self.system.new_angle(self.leaf, word, angle): 1.0}, angle)

    def _circle_size(self, i: int) -> Row:
        found = circle_of(self.outline.loops[i])
        assert found is not None
        if self.part.kind == "revolve":
            return self._radius("tube_radius", found[2])
        return sum_rows((self._radius("hole_diameter" if self.joints.holes[i] else "diameter", 2 * found[2]), 0.5))

    def circles_in_space(self) -> Iterator[RoundWall]:
        """The circles of an extrusion along the world's axes, and its arcs that have a centre."""
        if self.part.kind != "extrude" or not is_level(self.part):
            return
        turn = [[round(c) for c in row] for row in matrix_from_euler(self.part.rotation).tolist()]
        axis = next(a for a in range(3) if turn[a][2])
        for center, own, radius, size in (*self._circles(), *self._arcs()):
            places, rows = [0.0, 0.0, 0.0], list[Row]([{}, {}, {}])
            for a in range(3):
                places[a] = self.part.center[a] + turn[a][0] * center[0] + turn[a][1] * center[1]
                rows[a] = sum_rows(({6 * self.leaf + 3 + a: 1.0}, 1.0), (own[0], turn[a][0]), (own[1], turn[a][1]))
            yield RoundWall(self.leaf, axis, places, rows, radius, size)

    def _circles(self) -> Iterator[tuple[Point, Sequence[Row], float, Row]]:
        """Centre and radius of each circle, in numbers and in variables."""
        for i, loop in enumerate(self.outline.loops):
            if found := circle_of(loop):
                x, y, radius = found
                yield (x, y), [self._place("center", k, found[k]) for k in (X, Y)], radius, self._circle_size(i)

    def _arcs(self) -> Iterator[tuple[Point, Sequence[Row], float, Row]]:
        """Of each arc that has a centre that and its radius, as of circles."""
        arcs = {id(arc): arc for arc in self.joints.arcs() if not arc.loose}
        yield from ((arc.center, [row or {} for row in arc.at], arc.radius, arc.size) for arc in arcs.values())


def _has(places: Iterable[float], place: float, slack: float) -> bool:
    return any(abs(p - place) <= slack for p in places)


def _center(arc: DrawnArc, way: int) -> Center[Sum]:
    x, y = (Sum(arc.at[axis] or {}, arc.center[axis]) for axis in (X, Y))
    return Center(x, y, way)


def _side(inner: bool) -> str:
    """The lines of holes have places of their own."""
    return "inner" if inner else "outer"
