"""From where to where the curves of drawings reach along the world's axes, and what these places are the sums of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.contacts import list_flat_faces
from imdim.export.drawn_vertex import Center, DrawnVertex
from imdim.export.outline_joints import Row, sum_rows
from imdim.export.outline_rows import Sum
from imdim.export.round_seats import list_round_walls
from imdim.export.seats import ALIGNED, reach_of, world_axis
from imdim.export.seen import HAIR, SeenPlanes, find_seen_reach
from imdim.export.seen_walls import find_hidden_walls
from imdim.geometry.solid import exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Ring, circle_of, curve_bounds, ring_curves
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

ROUND = ("cylinder", "cone")


class Span(NamedTuple):
    """What fills a box `low` [3] to `high` [3], as seen along an `axis`: of its low and its high side the rows that say where it is, and
    where that is which a person would measure to, with its row: of a circle its centre. Of an end of a leaf the `middle` between both is
    another such place. One that is `only` beside those that say the same is looked at with these alone; one that `is_radial` is a distance
    from an axis. A flat face `looks` up, 1, or down, -1, from the material that it bounds."""

    leaf: int
    axis: int
    low: np.ndarray
    high: np.ndarray
    sides: tuple[Row, Row]
    datums: tuple[tuple[float, Row], tuple[float, Row]]
    middle: tuple[float, Row] | None = None
    only: tuple[int, ...] = ()
    is_radial: bool = False
    looks: int = 0

    @property
    def is_round(self) -> bool:
        """Whether it is measured to its axis."""
        return self.datums[0] == self.datums[1] and bool(self.low[self.axis] < self.high[self.axis])


def list_spans(system: LinearSystem, program: Program) -> Iterator[Span]:
    """Of flat faces along the world's axes that are seen, of cylinders, and of extrusions whose drawings lie along the axes of circles and
    of other lines and arcs. They reach no further than something of their leaf is seen: what a foot is sunk into is not beside it."""
    reach = find_seen_reach(program)
    for span in _list_whole(system, program):
        if span.leaf in reach:
            low, high = span.low.copy(), span.high.copy()
            across = [a for a in range(3) if a != span.axis]
            low[across] = np.maximum(low, reach[span.leaf][0])[across]
            high[across] = np.minimum(high, reach[span.leaf][1])[across]
            yield span._replace(low=low, high=high)


def _list_whole(system: LinearSystem, program: Program) -> Iterator[Span]:
    seen, sign, parts = SeenPlanes(program, HAIR), signs(program), list(leaves(program))
    for p in list_flat_faces(system, program):
        if seen.meet(p.axis, p.low, p.high, sign[p.leaf] < 0):
            at = float(p.low[p.axis]), p.row
            middle = None if p.is_wall else (float(parts[p.leaf].center[p.axis]), {6 * p.leaf + 3 + p.axis: 1.0})
            yield Span(p.leaf, p.axis, p.low, p.high, (p.row, p.row), (at, at), middle, looks=p.side * sign[p.leaf])
    yield from _list_round_spans(system, program)
    yield from _list_turned_walls(system, program)
    hidden = find_hidden_walls(program)
    for leaf, part in enumerate(leaves(program)):
        drawing = LevelDrawing.of(leaf, part) if leaf in system.drawn else None
        loops = () if drawing is None or part.outline is None else part.outline.loops
        for i, (loop, ring) in enumerate(zip(loops, system.drawn[leaf] if loops else (), strict=True)):
            if drawing is not None and not isinstance(loop, Ellipse) and isinstance(ring, tuple):
                seen_curves = [(leaf, i, k) not in hidden for k in range(len(loop))]
                yield from drawing.spans_of_loop(i, loop, ring, seen_curves)


def _list_round_spans(system: LinearSystem, program: Program) -> Iterator[Span]:
    """Of cylinders across those axes of the world that theirs is square to; they are measured to their axes."""
    for leaf, part in enumerate(leaves(program)):
        turn = exact_rotation(part)
        if part.kind not in ROUND:
            continue
        low, high = reach_of(part, turn)
        column = max(range(len(part.size) - 1), key=lambda c: part.size[c])
        for axis in (a for a in range(3) if abs(turn[a, 2]) <= ALIGNED):
            centre, rim = {6 * leaf + 3 + axis: 1.0}, {6 * leaf + column: 1.0}
            at = part.center[axis], centre
            yield Span(leaf, axis, low, high, (sum_rows((centre, 1.0), (rim, -1.0)), sum_rows((centre, 1.0), (rim, 1.0))), (at, at))


def _list_turned_walls(system: LinearSystem, program: Program) -> Iterator[Span]:
    """Of the round walls of what is turned about a world axis, across that; they are measured to it."""
    for leaf, part in enumerate(leaves(program)):
        for wall in list_round_walls(system, leaf, part, True) if part.kind == "revolve" else ():
            low, high = (np.array(part.center) + way * wall.radius for way in (-1, 1))
            low[wall.axis], high[wall.axis] = wall.run
            for axis in (a for a in range(3) if a != wall.axis):
                centre = {6 * leaf + 3 + axis: 1.0}
                at = part.center[axis], centre
                sides = sum_rows((centre, 1.0), (wall.size, -1.0)), sum_rows((centre, 1.0), (wall.size, 1.0))
                yield Span(leaf, axis, low, high, sides, (at, at))


class LevelDrawing(NamedTuple):
    """The drawing of an extrusion: its frame, a box around it, and which axis of the world each of its own is."""

    leaf: int
    part: Primitive
    turn: np.ndarray
    box: tuple[np.ndarray, np.ndarray]
    axes: tuple[int, int]

    @staticmethod
    def of(leaf: int, part: Primitive) -> LevelDrawing | None:
        """None where it is no extrusion, or its axes are not the world's."""
        turn = exact_rotation(part)
        axes = world_axis(turn[:, 0]), world_axis(turn[:, 1])
        if part.kind != "extrude" or axes[0] is None or axes[1] is None:
            return None
        return LevelDrawing(leaf, part, turn, reach_of(part, turn), (axes[0], axes[1]))

    def spans_of_loop(self, i: int, loop: Ring, ring: tuple[DrawnVertex[Sum], ...], seen: Sequence[bool]) -> Iterator[Span]:
        """Of a circle, or of those curves that are seen and are no lines along the axes, and of where arcs cross lines; it is loop `i`."""
        curves = ring_curves(loop)
        if circle_of(loop):
            yield from self.spans_of_circle(curves, ring)
            return
        for k, (x, y, u, v, bulge) in enumerate(curves):
            if seen[k] and (bulge or (x != u and y != v)):
                yield from self.spans_of_curve(curves[k], ring[k], ring[(k + 1) % len(ring)])
        for k, vertex in enumerate(ring):
            if vertex.reach is not None:
                yield from self.spans_of_crossing(vertex, (self.leaf, i, k))

    def spans_of_circle(self, curves: list[Curve], ring: tuple[DrawnVertex[Sum], ...]) -> Iterator[Span]:
        """Of a circle, which is measured to its centre."""
        low, high = self._box(curve_bounds(curves))
        rows = [[self._row(k, (v.x, v.y)[k]) for v in ring] for k in (0, 1)]
        centres = [sum_rows(*((row, 1 / len(ring)) for row in of_axis)) for of_axis in rows]
        (x, y, *_), k = curves[0], 0 if abs(curves[0][2] - curves[0][0]) > abs(curves[0][3] - curves[0][1]) else 1
        way = 1.0 if self.turn[self.axes[k], k] * (curves[0][2 + k] - (x, y)[k]) > 0 else -1.0
        rim = sum_rows((rows[k][1], way / 2), (rows[k][0], -way / 2))  # its vertices lie on both sides of its centre
        for axis, centre in zip(self.axes, centres, strict=True):
            at = float(low[axis] + high[axis]) / 2, centre
            yield Span(self.leaf, axis, low, high, (sum_rows((centre, 1.0), (rim, -1.0)), sum_rows((centre, 1.0), (rim, 1.0))), (at, at))

    def spans_of_curve(self, curve: Curve, start: DrawnVertex[Sum], end: DrawnVertex[Sum]) -> Iterator[Span]:
        """Of a line or arc, whose sides are where its ends are; an arc whose centre has a place of its own is measured to that, like a
        circle: what is measured to its side moves it when its radius changes."""
        low, high = self._box(curve_bounds([curve]))
        centre = start.bulge if isinstance(start.bulge, Center) and _has_own_centre(start, end) else None
        for k, axis in enumerate(self.axes):
            numbers = sorted(((v.x, v.y)[k] for v in (start, end)), key=lambda n: n.value * self.turn[axis, k])
            rows = self._row(k, numbers[0]), self._row(k, numbers[1])
            datums = (float(low[axis]), rows[0]), (float(high[axis]), rows[1])
            if centre is not None:
                middle = (centre.x, centre.y)[k]
                at = self._place(k, middle), self._row(k, middle)
                datums = at, at
            yield Span(self.leaf, axis, low, high, rows, datums)

    def spans_of_crossing(self, vertex: DrawnVertex[Sum], only: tuple[int, ...]) -> Iterator[Span]:
        """Of a line that an arc crosses and of the arc's circle where that reaches furthest beyond the line: there is no crossing further
        out."""
        assert vertex.reach is not None
        k, radius, off = 1 - vertex.reach.axis, vertex.reach.radius, vertex.reach.off
        side, line, axis = math.copysign(1.0, off.value), (vertex.x, vertex.y)[k], self.axes[k]
        centre = Sum(sum_rows((line.row, 1.0), (off.row, -1.0)), line.value - off.value)
        furthest = Sum(sum_rows((centre.row, 1.0), (radius.row, side)), centre.value + side * radius.value)
        for number, datum in ((line, line), (furthest, centre)):
            low, high = (corner.copy() for corner in self.box)
            low[axis] = high[axis] = self._place(k, number)
            at, row = (self._place(k, datum), self._row(k, datum)), self._row(k, number)
            yield Span(self.leaf, axis, low, high, (row, row), (at, at), only=only)

    def place_corner(self, vertex: DrawnVertex[Sum]) -> tuple[dict[int, float], dict[int, Row]]:
        """Where a vertex lies along the world's axes that the drawing has, and the rows that say so."""
        both = [(axis, k, number) for (k, axis), number in zip(enumerate(self.axes), (vertex.x, vertex.y), strict=True)]
        return {axis: self._place(k, n) for axis, k, n in both}, {axis: self._row(k, n) for axis, k, n in both}

    def _place(self, k: int, number: Sum) -> float:
        axis = self.axes[k]
        return float(self.part.center[axis]) + float(self.turn[axis, k]) * number.value

    def _row(self, k: int, number: Sum) -> Row:
        axis = self.axes[k]
        return sum_rows(({6 * self.leaf + 3 + axis: 1.0}, 1.0), (number.row, float(round(self.turn[axis, k]))))

    def _box(self, bounds: tuple[tuple[float, float], tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
        low, high = (side.copy() for side in self.box)
        for k, axis in enumerate(self.axes):
            ends = sorted(self.part.center[axis] + self.turn[axis, k] * corner[k] for corner in bounds)
            low[axis], high[axis] = ends
        return low, high


def _has_own_centre(start: DrawnVertex[Sum], end: DrawnVertex[Sum]) -> bool:
    """Whether the centre of an arc stays where it is when the radius changes: a flat arc is where its apex is."""
    assert isinstance(start.bulge, Center)
    radii = {v for vertex in (start, end) if vertex.reach is not None for v in vertex.reach.radius.row}
    return radii.isdisjoint(start.bulge.x.row.keys() | start.bulge.y.row.keys())
