"""Parts in a circle that go through a round wall about its axis, as teeth do, or end in one, as spokes do: they follow it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.outline_joints import Row, X, Y, sum_rows
from imdim.export.outline_walls import EXACT, NO_RADIUS, RoundWall
from imdim.export.round_seats import EnteredWall, list_round_walls
from imdim.export.seats import reach_of, world_axis
from imdim.geometry.kernels import inside
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.solid import exact_rotation
from imdim.program.motions import turn
from imdim.program.outline import flatten_loop
from imdim.program.repeats import Folded, repeats, size
from imdim.program.roles import signs
from imdim.program.tree import FLAT_ENDS, Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem
    from imdim.export.outline_rows import Drawn

LEAST = 3  # copies that make a circle
SEGMENTS = 64  # of a circle, whose corners stand for the arcs of a drawing
BESIDE = 0.01  # of how far a part goes outwards: so far from a wall it is looked
AT_END = 1e-4  # of it, by which a corner may miss the end of a part
LEVEL = 1e-6  # of a unit vector, by which an axis of a drawing may miss the way outwards


class _Ring(NamedTuple):
    """Equal drawn parts in a circle: the leaves, a `point` of its `axis`, which is one of the world's, how far `away` from that the centre
    of the first leaf is, the unit vector `outwards` in its directions, from where to where it goes along that, and a point in the `gap`
    before the next one."""

    leaves: range
    point: tuple[float, ...]
    axis: int
    away: float
    outwards: np.ndarray
    reach: tuple[float, float]
    gap: np.ndarray

    def look_beside(self, radius: float, numbers: Lowered) -> int:
        """1 if the solid ends at a radius between two of the parts, -1 if it begins there, else 0."""
        arm = np.array(self.gap) - self.point
        arm[self.axis] = 0.0
        step = BESIDE * (self.reach[1] - self.reach[0])
        at = self.gap + np.outer(np.array([radius - step, radius + step]) - np.linalg.norm(arm), arm / np.linalg.norm(arm))
        within, beyond = inside(numbers, at)
        return int(within) - int(beyond)


def stand_on_rims(system: LinearSystem, program: Program, folded: Folded) -> Iterator[Row]:
    """Of each circle of drawn parts that goes through one round wall of `program` how far these begin or end from it: what is added by its
    end within the solid, what is cut by that outside.

    Where it goes through several walls, none is known for what it stands on.
    """
    circles = {leaf: v for v, (leaf, word) in enumerate(system.extras, system.extra) if word == "circle"}
    slack, sign = EXACT * system.length, signs(program)
    parts, numbers = list(leaves(program)), lower(program)
    for ring in _list_rings(parts, folded):
        first = ring.leaves[0]
        crossed = [w for w in system.round_walls if first in circles and _is_crossed(w, ring, parts, slack)]
        shown = [(w, way) for w in crossed if (way := ring.look_beside(w.radius, numbers))]
        if not shown or np.ptp([w.radius for w, _ in shown]) > slack or len({way for _, way in shown}) > 1:
            continue
        wall, way = shown[0]
        end = ring.reach[0] if way * sign[first] > 0 else ring.reach[1]
        system.on_rims |= {circles[first], *(6 * leaf + 3 + a for leaf in ring.leaves for a in range(3))}
        own = _find_end(ring, end, system.drawn[first])
        yield sum_rows(({circles[first]: 0.5}, 1.0), (own, 1.0), (wall.size, -1.0))


class _EndingSpokes(NamedTuple):
    """Equal parts along the spokes of a circle: the leaves, a `point` of its `axis`, which is one of the world's, how far `away` from that
    their centres are, the place of their length in the sizes, and that length."""

    leaves: range
    point: tuple[float, ...]
    axis: int
    away: float
    column: int
    length: float


def end_in_walls(system: LinearSystem, program: Program, folded: Folded) -> Iterator[Row]:
    """Of each circle of parts along its spokes that end in a round wall, or at the axis, that they do: tabs go outwards with the bore that
    they begin in, as long as they are, and spokes between a hub and a rim are as long as these are apart."""
    circles = {leaf: v for v, (leaf, word) in enumerate(system.extras, system.extra) if word == "circle"}
    parts, sign, slack = list(leaves(program)), signs(program), EXACT * system.length
    walls = [wall for i, p in enumerate(parts) for wall in list_round_walls(system, i, p, sign[i] > 0)]
    for spokes in _list_spokes(parts, folded):
        first = spokes.leaves[0]
        about = [w for w in walls if first in circles and _is_about(w, spokes, parts, slack)]
        for way in (-1, 1):
            end = spokes.away + way * spokes.length / 2
            row = {} if abs(end) <= slack else next((wall.size for wall in about if abs(wall.radius - end) <= slack), None)
            if row is None or first not in circles:
                continue
            circle, length = circles[first], 6 * first + spokes.column
            system.followers.add(length if circle in system.followers else circle)
            system.on_rims |= {circle, *(6 * leaf + 3 + a for leaf in spokes.leaves for a in range(3))}
            yield sum_rows(({circle: 0.5, length: 0.5 * way}, 1.0), (row, -1.0))


def _list_spokes(parts: Sequence[Primitive], folded: Folded) -> Iterator[_EndingSpokes]:
    for first, repeat in repeats(folded):
        axis, part = world_axis(np.array(repeat.axis)), parts[first]
        if repeat.kind != "circular" or repeat.counts[0] < LEAST or size(repeat.part) > 1 or axis is None:
            continue
        arm = np.subtract(part.center, repeat.point)
        arm[axis] = 0.0
        away, turn = float(np.linalg.norm(arm)), exact_rotation(part)
        for local, column in FLAT_ENDS.get(part.kind, {}).items():
            if away and abs(arm @ turn[:, local]) > (1 - LEVEL) * away:
                yield _EndingSpokes(range(first, first + repeat.number), repeat.point, axis, away, column, part.size[column])


def _is_about(wall: EnteredWall, spokes: _EndingSpokes, parts: Sequence[Primitive], slack: float) -> bool:
    """Whether a round wall that is none of theirs lies about the axis of spokes, beside them."""
    if wall.axis != spokes.axis or wall.leaf in spokes.leaves:
        return False
    if any(abs(parts[wall.leaf].center[a] - spokes.point[a]) > slack for a in range(3) if a != wall.axis):
        return False
    part = parts[spokes.leaves[0]]
    low, high = reach_of(part, exact_rotation(part))
    return wall.run[0] < high[wall.axis] - slack and wall.run[1] > low[wall.axis] + slack


def _list_rings(parts: Sequence[Primitive], folded: Folded) -> Iterator[_Ring]:
    for first, repeat in repeats(folded):
        part, axis = parts[first], world_axis(np.array(repeat.axis))
        if repeat.kind != "circular" or repeat.counts[0] < LEAST or size(repeat.part) > 1 or part.outline is None or axis is None:
            continue
        arm = np.array(part.center) - repeat.point
        arm[axis] = 0.0
        away = float(np.linalg.norm(arm))
        if part.kind != "extrude" or not away:
            continue
        outwards = arm / away @ exact_rotation(part)
        along = [float(outwards[:2] @ corner) for loop in part.outline.loops for corner in flatten_loop(loop, SEGMENTS)]
        half = abs(float(outwards[2])) * part.size[0] / 2
        reach = away + min(along) - half, away + max(along) + half
        gap = np.array(turn(repeat.point, repeat.axis, repeat.angle / 2).point(part.center))
        yield _Ring(range(first, first + repeat.number), repeat.point, axis, away, outwards, reach, gap)


def _is_crossed(wall: RoundWall, ring: _Ring, parts: Sequence[Primitive], slack: float) -> bool:
    """Whether the parts of a ring go through a round wall about its axis."""
    if wall.axis != ring.axis or wall.radius == NO_RADIUS or wall.leaf in ring.leaves:
        return False
    if any(abs(wall.places[a] - ring.point[a]) > slack for a in range(3) if a != ring.axis):
        return False
    (low, high), (its_low, its_high) = (reach_of(p, exact_rotation(p)) for p in (parts[ring.leaves[0]], parts[wall.leaf]))
    along = ring.axis
    is_beside = low[along] < its_high[along] - slack and high[along] > its_low[along] + slack
    return is_beside and ring.reach[0] + slack < wall.radius < ring.reach[1] - slack


def _find_end(ring: _Ring, end: float, drawn: Drawn) -> Row:
    """The sum by which an end of a part lies outwards from its centre: none where its drawing is turned, or has no corner there."""
    axis = next((k for k in (X, Y) if abs(ring.outwards[k]) > 1 - LEVEL), None)
    if axis is None:
        return {}
    way = round(float(ring.outwards[axis]))
    corners = (vertex for loop in drawn if isinstance(loop, tuple) for vertex in loop if vertex.reach is None)
    numbers = [vertex.x if axis == X else vertex.y for vertex in corners]
    last = min(numbers, key=lambda n: abs(ring.away + way * n.value - end), default=None)
    is_there = last is not None and abs(ring.away + way * last.value - end) <= AT_END * (ring.reach[1] - ring.reach[0])
    return sum_rows((last.row, way)) if last is not None and is_there else {}
