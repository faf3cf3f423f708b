"""Walls of outlines in space: the flat ones, and round ones that have one axis with other leaves, and what keeps them there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from imdim.export.outline_joints import DrawnLine, OutlineJoints, Row, X, Y, sum_rows
from imdim.export.seats import world_axis
from imdim.export.wall_seats import FlatWall
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import exact_rotation
from imdim.numbers.design_values import is_level
from imdim.program.outline import Point, circle_of, loop_area
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

NO_RADIUS = -1.0  # of what has an axis alone
ROUND = ("cylinder", "cone", "revolve")
EXACT = 1e-7  # of the largest size, within which written numbers touch


@dataclass
class RoundWall:
    """A round wall along a world axis: the places of its axis, what they are the sum of, and its radius, if it has one. That of an arc may
    `miss` the axis that it runs about by so much."""

    leaf: int
    axis: int
    places: Sequence[float]
    rows: Sequence[Row]
    radius: float
    size: Row
    miss: float = 0.0


def bind_coaxial(system: LinearSystem, circles: Sequence[RoundWall], parts: Sequence[Primitive], sources: Sequence[int]) -> Iterator[Row]:
    """Circles of outlines on the axis of another round wall stay there; radii that are equal on one axis stay equal."""
    slack = EXACT * system.length
    others = list_round_walls(parts, sources)
    for i, circle in enumerate(circles):
        for other in (*circles[:i], *others):
            across = [a for a in range(3) if a != circle.axis]
            if other.axis != circle.axis or any(abs(circle.places[a] - other.places[a]) > slack + circle.miss + other.miss for a in across):
                continue
            if other.leaf != circle.leaf:
                yield from (sum_rows((circle.rows[a], 1.0), (other.rows[a], -1.0)) for a in across)
                if circle.radius != NO_RADIUS and abs(circle.radius - other.radius) <= slack:
                    yield sum_rows((circle.size, 1.0), (other.size, -1.0))


def list_axes_beside(leaf: int, parts: Sequence[Primitive]) -> Iterator[Point]:
    """Where the axes of round walls of other leaves, along which an extrusion goes, are in its drawing."""
    part = parts[leaf]
    turn = exact_rotation(part)
    for other in (p for i, p in enumerate(parts) if i != leaf):
        own = exact_rotation(other)
        if part.kind != "extrude" or world_axis(own.T @ turn[:, 2]) != 2:
            continue
        circles = filter(None, map(circle_of, other.outline.loops if other.kind == "extrude" and other.outline else ()))
        middles = [(0.0, 0.0)] if other.kind in ROUND else [(x, y) for x, y, _ in circles]
        for x, y in middles:
            at = turn.T @ (own @ np.array([x, y, 0.0]) + np.array(other.center) - np.array(part.center))
            yield float(at[0]), float(at[1])


def list_round_walls(parts: Sequence[Primitive], sources: Sequence[int]) -> list[RoundWall]:
    """The round walls of all leaves without a drawing that are no copies, and the axes of what is turned."""
    return [wall for i, p in enumerate(parts) if sources[i] == i for wall in _round_walls(i, p)]


def _round_walls(leaf: int, p: Primitive) -> Iterator[RoundWall]:
    """The round walls of a cylinder or cone along a world axis; of what is turned about one the axis alone."""
    if p.kind not in ROUND:
        return
    direction = matrix_from_euler(p.rotation)[:, 2]
    axis = next((a for a in range(3) if abs(direction[a]) > 1 - 1e-12), None)
    rows: list[Row] = [{6 * leaf + 3 + a: 1.0} for a in range(3)]
    if p.kind == "revolve" and axis is not None:
        yield RoundWall(leaf, axis, p.center, rows, NO_RADIUS, {})
        return
    for column in range(len(p.size) - 1 if axis is not None else 0):
        yield RoundWall(leaf, axis or 0, p.center, rows, p.size[column], {6 * leaf + column: 1.0})


def find_flat_walls(
    leaf: int, part: Primitive, joints: OutlineJoints, row_of_line: Callable[[bool, int, float], Row]
) -> Iterator[FlatWall]:
    """The lines of an upright extrusion along its own axes that lie across one of the world's, and where both its axes are the world's of
    these the outermost whatever they run along; the flat faces of what is turned about a world axis.

    `row_of_line` says what the place of a line is the sum of, by whether it bounds a hole and by the axis that it lies across.
    """
    turn = exact_rotation(part)
    if part.kind == "drafted":
        return
    if part.kind == "revolve":
        axis = world_axis(turn[:, 2])
        for line, side, run in _lines(joints) if axis is not None else ():
            if line.across == Y:
                yield _turned_wall(leaf, part, turn, side, line.place, row_of_line(line.inner, Y, line.place), max(map(abs, run)))
        return
    for k, side in ((k, side) for k in (X, Y) for side in (-1, 1) if is_level(part)):
        place = joints.outline.bounds[side > 0][k]
        row = row_of_line(False, k, place)
        if row:
            yield _flat_wall(leaf, part, turn, k, side, place, row)
    for line, side, run in _lines(joints):
        k = line.across or X
        row = row_of_line(line.inner, k, line.place)
        if world_axis(turn[:, k]) is not None and (row or abs(line.place) <= joints.slack):
            yield _flat_wall(leaf, part, turn, k, side, line.place, row, run)


def _lines(joints: OutlineJoints) -> Iterator[tuple[DrawnLine, int, tuple[float, float]]]:
    """The lines along the axes of an outline, the side to which they look, and from where to where they run."""
    for loop, hole, found in zip(joints.outline.loops, joints.holes, joints.loops, strict=True):
        left = (-1 if hole else 1) * (1 if loop_area(loop) > 0 else -1)  # 1 where what the outline holds is on the left
        for joint, following in zip(found or (), [*found[1:], found[0]] if found else (), strict=True):
            line = joint.after
            if isinstance(line, DrawnLine) and line.across is not None:
                run = joint.at[1 - line.across], following.at[1 - line.across]
                yield line, int(math.copysign(1, (run[1] - run[0]) * left * (1 if line.across == X else -1))), run


def _turned_wall(leaf: int, part: Primitive, turn: np.ndarray, side: int, place: float, row: Row, reach: float) -> FlatWall:
    """A flat face of what is turned, as far as it reaches from the axis."""
    axis = int(np.abs(turn[:, 2]).argmax())
    across, way = (axis + 1) % 3, round(turn[axis, 2])
    at = sum_rows(({6 * leaf + 3 + axis: 1.0}, 1.0), (row, way))
    span = across, part.center[across] - reach, part.center[across] + reach
    return FlatWall(leaf, axis, side * way, part.center[axis] + way * place, at, span)


def _flat_wall(
    leaf: int,
    part: Primitive,
    turn: np.ndarray,
    k: int,
    side: int,
    place: float,
    row: Row,
    run: tuple[float, float] | None = None,
) -> FlatWall:
    """A line across axis `k` of an outline as a wall in the world; it runs from and to the places `run` along the other axis."""
    axis, along = (int(np.abs(turn[:, j]).argmax()) for j in (k, 1 - k))
    way = round(turn[axis, k])
    at = sum_rows(({6 * leaf + 3 + axis: 1.0}, 1.0), (row, way))
    span = None
    if run is not None:
        low, high = sorted(float(part.center[along] + turn[along, 1 - k] * v) for v in run)
        aside = abs(float(turn[along, 2])) * part.size[0] / 2  # of what lies aslant
        span = along, low - aside, high + aside
    return FlatWall(leaf, axis, side * way, part.center[axis] + way * place, at, span)
