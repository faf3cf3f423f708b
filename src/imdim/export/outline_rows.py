"""What the vertices of drawings are the sums of: the variables of each outline, shared by copies, and the arcs that these place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

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
from imdim.export.outline_dimensions import ROUNDS, OutlineDimensions, side_of
from imdim.export.outline_joints import HALF, NEARLY, WIDEST, DrawnArc, DrawnLine, Joint, Row, X, Y, sum_rows
from imdim.export.outline_walls import NO_RADIUS, RoundWall, bind_coaxial, find_flat_walls, list_axes_beside, list_round_walls
from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import is_level
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Point, circle_of
from imdim.program.regular_polygon import RegularPolygon
from imdim.program.repeats import Folded, instances
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

ANGLE_DECIMALS = 6  # of a degree that comes of the digits of vertices
PLAIN_ANGLE = 15.0  # degrees: a regular polygon that is turned by a multiple of that needs no name for it


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
            dimensions = OutlineDimensions(system, leaf, part, sign[leaf] < 0, list(list_axes_beside(leaf, parts)))
            sums = _VertexSums(dimensions)
            drawn[leaf] = sums.vertices()
            circles += [*sums.circles_in_space(), *sums.turned_walls()]
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
    system.round_walls = [*circles, *list_round_walls(parts, sources)]
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


class _VertexSums:
    """What the vertices of an outline are the sums of, by its dimensions."""

    def __init__(self, dimensions: OutlineDimensions) -> None:
        self.of = dimensions

    def vertices(self) -> Drawn:
        """The vertices of all loops."""
        return tuple(map(self._ring, range(len(self.of.outline.loops))))

    def _ring(self, i: int) -> DrawnRing[Sum]:
        regular, joints, loop = self.of.joints.regular[i], self.of.joints.loops[i], self.of.outline.loops[i]
        if regular is not None:
            return self._polygon(regular)
        if isinstance(loop, Ellipse):
            return self._ellipse(loop, self.of.joints.holes[i])
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
            x, y = chamfered.get(k) or self._filling(joint) or self._on_rim(joint) or (self._vertex(joint, X), self._vertex(joint, Y))
            rows.append(DrawnVertex(Sum(x, joint.at[X]), Sum(y, joint.at[Y]), bend))
        return tuple(rows)

    def _bend(self, joint: Joint, bulge: float) -> Bend[Sum]:
        """How the curve after a joint bends."""
        arc, way = joint.after, 1 if bulge > 0 else -1
        if not isinstance(arc, DrawnArc) or not (arc.loose or arc.crossed or arc.rim):
            return bulge
        if not arc.loose:
            return _center(arc, way)
        if arc.end:
            return BendRadius(Sum(arc.size, arc.radius), way)
        if joint.fills:
            return BendRadius(Sum(self._size_of_filling(arc), arc.radius), way)
        if joint.rounds:
            return BendRadius(Sum(self.of.name_radius(ROUNDS[False, arc.inner], arc.radius), arc.radius), 0)
        if joint.touches:
            return Touching(joint.touches, joint.is_cusp)
        if arc.half:
            return bulge
        if abs(joint.turn) <= WIDEST:
            return BendRadius(Sum(self.of.name_radius("arc_radius", arc.radius), arc.radius), way)
        turn = round(abs(joint.turn), ANGLE_DECIMALS)
        return BendAngle(Sum({self.of.system.new_angle(self.of.leaf, "arc_angle", turn): 1.0}, turn), way)

    def _crossing(self, joint: Joint, bend: Bend[Sum]) -> DrawnVertex[Sum]:
        """Where an arc crosses a line along an axis: as far from the centre as the circle reaches there."""
        line, arc = (joint.before, joint.after) if isinstance(joint.before, DrawnLine) else (joint.after, joint.before)
        assert isinstance(line, DrawnLine)
        assert isinstance(arc, DrawnArc)
        assert line.across is not None
        across, axis = line.across, 1 - line.across
        place, center = self.of.find_place(side_of(line.inner), across, line.place), arc.at[across] or {}
        off = Sum(sum_rows((place, 1.0), (center, -1.0)), line.place - arc.center[across])
        sign = 1 if joint.at[axis] > arc.center[axis] else -1
        ends = [Sum(place, line.place), Sum(arc.at[axis] or {}, arc.center[axis])]
        x, y = ends if across == X else reversed(ends)
        return DrawnVertex(x, y, bend, Reach(axis, sign, Sum(arc.size, arc.radius), off))

    def _size_of_filling(self, arc: DrawnArc) -> Row:
        return self.of.name_radius(ROUNDS[False, arc.inner], arc.radius)

    def _filling(self, joint: Joint) -> tuple[Row, Row] | None:
        """The end of an arc that fills a corner: as many radii from that as now, the same way, so that a larger fillet reaches further."""
        if joint.fills is None:
            return None
        arc, corner = joint.after if isinstance(joint.after, DrawnArc) else joint.before, joint.fills
        assert isinstance(arc, DrawnArc)
        size = self._size_of_filling(arc)
        away = [joint.at[axis] - corner.at[axis] for axis in (X, Y)]
        x, y = (
            sum_rows((self._vertex(corner, axis), 1.0), (size, away[axis] / arc.radius if abs(away[axis]) > self.of.slack else 0.0))
            for axis in (X, Y)
        )
        return x, y

    def _on_rim(self, joint: Joint) -> tuple[Row, Row] | None:
        """The end of a rim: as many radii from its centre as now, the same way."""
        arc = next((c for c in (joint.before, joint.after) if isinstance(c, DrawnArc) and c.rim), None)
        if arc is None:
            return None
        x, y = (sum_rows((arc.at[axis] or {}, 1.0), (arc.size, (joint.at[axis] - arc.center[axis]) / arc.radius)) for axis in (X, Y))
        return x, y

    def _vertex(self, joint: Joint, axis: int) -> Row:
        curves = [c for c in (joint.before, joint.after) if isinstance(c, DrawnLine) or not c.loose]
        known = next((row for row, knows in (self.of.find_coordinate(c, joint, axis) for c in curves) if knows), None)
        return self.of.find_place(side_of(joint.after.inner), axis, joint.at[axis]) if known is None else known

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
                corner[c.across or X] = self.of.find_place(side_of(c.inner), c.across or X, c.place)
            first, second = joint.at[b.across] - b.place, following.at[a.across] - a.place
            if abs(abs(first) - abs(second)) > self.of.slack:
                continue
            for number, c, off in ((k, b, first), ((k + 1) % len(joints), a, second)):
                assert c.across is not None
                width = self.of.name_radius("chamfer", abs(off))
                ends = list(corner)
                ends[c.across] = sum_rows((corner[c.across], 1.0), (width, math.copysign(1.0, off)))
                out[number] = (ends[X], ends[Y])
        return out

    def _circle(self, i: int) -> tuple[DrawnVertex[Sum], ...]:
        loop, found = self.of.outline.loops[i], circle_of(self.of.outline.loops[i])
        assert found is not None
        assert not isinstance(loop, Ellipse)
        *center, radius = found
        at = [self.of.find_place("center", axis, center[axis]) for axis in (X, Y)]
        size = self._circle_size(i)
        rows = [[sum_rows((at[axis], 1.0), (size, (v[axis] - center[axis]) / radius)) for axis in (X, Y)] for v in loop]
        return tuple(DrawnVertex(Sum(x, v[0]), Sum(y, v[1]), v[2]) for (x, y), v in zip(rows, loop, strict=True))

    def _polygon(self, regular: RegularPolygon) -> DrawnPolygon[Sum]:
        sides = Sum(self.of.name_count("sides", regular.sides), regular.sides)
        is_across = regular.is_measured_across_flats
        word, value = ("across_flats", regular.across_flats) if is_across else ("polygon_radius", regular.radius)
        size, angle = Sum(self.of.name_radius(word, value), value), self._angle("polygon_angle", regular.angle)
        return DrawnPolygon(sides, size, *self._center_of(regular.center), angle, is_across)

    def _ellipse(self, loop: Ellipse, hole: bool) -> DrawnEllipse[Sum]:
        """An ellipse by its length and width; holes have their own."""
        prefix = "tube_" if self.of.part.kind == "revolve" else "hole_" if hole else ""
        rows = (sum_rows((self.of.name_radius(prefix + word, 2 * r), 0.5)) for word, r in (("length", loop.rx), ("width", loop.ry)))
        rx, ry = (Sum(row, r) for row, r in zip(rows, (loop.rx, loop.ry), strict=True))
        return DrawnEllipse(rx, ry, *self._center_of((loop.x, loop.y)), self._angle("ellipse_angle", loop.angle))

    def _center_of(self, center: tuple[float, float]) -> tuple[Sum, Sum]:
        x, y = (Sum(self.of.find_place("center", axis, center[axis]), center[axis]) for axis in (X, Y))
        return x, y

    def _angle(self, word: str, angle: float) -> Sum:
        """An angle in degrees, with a name where it is none that one would draw."""
        if abs(math.remainder(angle, PLAIN_ANGLE)) <= HALF:
            return Sum({}, round(angle / PLAIN_ANGLE) * PLAIN_ANGLE)
        angle = round(angle, ANGLE_DECIMALS)
        return Sum({self.of.system.new_angle(self.of.leaf, word, angle): 1.0}, angle)

    def _circle_size(self, i: int) -> Row:
        found = circle_of(self.of.outline.loops[i])
        assert found is not None
        if self.of.part.kind == "revolve":
            return self.of.name_radius("tube_radius", found[2])
        return sum_rows((self.of.name_radius("hole_diameter" if self.of.joints.holes[i] else "diameter", 2 * found[2]), 0.5))

    def circles_in_space(self) -> Iterator[RoundWall]:
        """The circles of an extrusion along the world's axes, its arcs that have a centre, and the middles of regular polygons."""
        if self.of.part.kind != "extrude" or not is_level(self.of.part):
            return
        turn = [[round(c) for c in row] for row in matrix_from_euler(self.of.part.rotation).tolist()]
        axis = next(a for a in range(3) if turn[a][2])
        for center, own, radius, size, miss in (*self._circles(), *self._arcs(), *self._polygons()):
            places, rows = [0.0, 0.0, 0.0], list[Row]([{}, {}, {}])
            for a in range(3):
                places[a] = self.of.part.center[a] + turn[a][0] * center[0] + turn[a][1] * center[1]
                rows[a] = sum_rows(({6 * self.of.leaf + 3 + a: 1.0}, 1.0), (own[0], turn[a][0]), (own[1], turn[a][1]))
            yield RoundWall(self.of.leaf, axis, places, rows, radius, size, miss)

    def turned_walls(self) -> Iterator[RoundWall]:
        """The round walls along the axis of what is turned about one of the world's."""
        part, leaf = self.of.part, self.of.leaf
        if part.kind != "revolve" or not is_level(part):
            return
        axis = next(a for a, row in enumerate(matrix_from_euler(part.rotation)) if abs(row[2]) > HALF)
        rows = [{6 * leaf + 3 + a: 1.0} for a in range(3)]
        lines = {line.place: line for line in self.of.joints.lines() if line.across == X and line.place > self.of.slack}
        for line in lines.values():
            yield RoundWall(leaf, axis, part.center, rows, line.place, self.of.row_of_line(line.inner, X, line.place))

    def _circles(self) -> Iterator[tuple[Point, Sequence[Row], float, Row, float]]:
        """Centre and radius of each circle, in numbers and in variables."""
        for i, loop in enumerate(self.of.outline.loops):
            if found := circle_of(loop):
                x, y, radius = found
                yield (x, y), [self.of.find_place("center", k, found[k]) for k in (X, Y)], radius, self._circle_size(i), 0.0

    def _polygons(self) -> Iterator[tuple[Point, Sequence[Row], float, Row, float]]:
        """Of each regular polygon its centre, and no radius: a pocket for a nut lies about its hole, and is as large as the nut."""
        for center in (regular.center for regular in self.of.joints.regular if regular):
            yield center, [self.of.find_place("center", k, center[k]) for k in (X, Y)], NO_RADIUS, {}, 0.0

    def _arcs(self) -> Iterator[tuple[Point, Sequence[Row], float, Row, float]]:
        """Of each arc that has a centre that and its radius, as of circles."""
        arcs = {id(arc): arc for arc in self.of.joints.arcs() if not arc.loose}
        for arc in arcs.values():
            yield arc.center, [row or {} for row in arc.at], arc.radius, arc.size, NEARLY * arc.radius if arc.rim else 0.0


def _center(arc: DrawnArc, way: int) -> Center[Sum]:
    x, y = (Sum(arc.at[axis] or {}, arc.center[axis]) for axis in (X, Y))
    return Center(x, y, way)
