"""Cuts that enter what is round from its side, and what stands on it: their ends follow its round walls, or its axis if they end there.

A set screw's hole begins somewhere in the bore and ends somewhere in the air. Read as numbers, it would no longer reach a narrower bore;
read as so much beyond both walls, it does.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.drawn_vertex import DrawnVertex
from imdim.export.outline_joints import Row, sum_rows
from imdim.export.outline_rows import Sum
from imdim.export.seats import End, ends_of, place_of, reach_of, world_axis
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Ring, loop_area, nesting, ring_curves
from imdim.program.roles import cuts_of_each, signs
from imdim.program.tree import Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

MOST = 0.7  # of a radius, by which the middle of what enters may lie beside the axis: further out a wall is not met by its radius
SLACK = 1e-7  # of the largest size


class EnteredWall(NamedTuple):
    """A round wall along a world `axis`, which is that far from it, by the row `size`, and runs from where to where, and whether the solid
    is within it."""

    leaf: int
    axis: int
    run: tuple[float, float]
    radius: float
    size: Row
    adds: bool


def seats_at_rounds(system: LinearSystem, program: Program, hidden: Collection[tuple[int, int, int]]) -> Iterator[tuple[End, Row, bool]]:
    """Of ends how far they lie beyond a round wall: of cuts that of what they are taken from, or of the bore that they begin in; of what is
    added, where they are `hidden`, by leaf, axis and side, that of another leaf which it comes out of; or that they touch one. What is
    added and has an end that is seen there moves as a whole."""
    parts, numbers, sign, cuts = list(leaves(program)), lower(program), signs(program), cuts_of_each(program)
    walls = [wall for i, p in enumerate(parts) for wall in list_round_walls(system, i, p, sign[i] > 0)]
    for leaf, part in enumerate(parts) if walls else ():
        met = [w for w in walls if (w.adds if sign[leaf] > 0 else not w.adds or leaf in cuts[w.leaf])]
        ends = {(e.axis, e.side): e for e in ends_of(leaf, part, numbers) if e.column >= 0 or leaf in system.heights}
        found: dict[tuple[int, int], Row] = {}
        box = reach_of(part, numbers.rotations[leaf])
        for at, end in ends.items():
            near = [w for w in met if w.leaf != leaf and _is_entered(w, parts, end)]
            deep = [w for w in near if (leaf, *at) in hidden or _is_within(w, parts, end, box)] if sign[leaf] > 0 else near
            entered = _find_wall(near, deep, parts, end, ends[end.axis, -end.side], sign[leaf] > 0, SLACK * system.length)
            if entered is not None:
                wall, way = entered
                found[at] = sum_rows(({6 * wall.leaf + 3 + end.axis: 1.0}, 1.0), (wall.size, float(way)))
        if part.kind == "cone":  # it moves as a whole: where it ends says how steep it is
            found = dict(list(found.items())[:1])
        for at, row in found.items():
            seen = sign[leaf] > 0 and (leaf, *at) not in hidden
            yield ends[at], sum_rows((system.place_of_end(ends[at]), 1.0), (row, -1.0)), seen
        # what is hidden at its other end, too, goes on ending there
        others = (ends[axis, -side] for axis, side in found if (axis, -side) not in found and (leaf, axis, -side) in hidden)
        others = others if part.kind != "cone" else ()
        yield from ((end, system.place_of_end(end), False) for end in others)


def list_round_walls(system: LinearSystem, leaf: int, part: Primitive, adds: bool) -> Iterator[EnteredWall]:
    """Those of a cylinder, or of what is turned, about a world axis; `adds` says of its leaf whether it does."""
    along = world_axis(exact_rotation(part)[:, 2]) if part.kind in ("cylinder", "revolve") else None
    if along is None:
        return
    at = part.center[along]
    if part.kind == "cylinder":
        yield EnteredWall(leaf, along, (at - part.size[1] / 2, at + part.size[1] / 2), part.size[0], {6 * leaf: 1.0}, adds)
        return
    assert part.outline is not None
    way = round(exact_rotation(part)[along, 2])
    for loop, ring, nested in zip(part.outline.loops, system.drawn[leaf], nesting(part.outline.loops), strict=True):
        if isinstance(loop, Ellipse) or not isinstance(ring, tuple):
            continue
        outwards = nested if loop_area(loop) > 0 else -nested
        for vertex, x, y, v in walls_about_axis(ring, loop):
            low, high = sorted((at + way * y, at + way * v))
            yield EnteredWall(leaf, along, (low, high), x, dict(vertex.x.row), ((v - y) * outwards > 0) == adds)


def walls_about_axis(ring: Sequence[DrawnVertex[Sum]], loop: Ring) -> Iterator[tuple[DrawnVertex[Sum], float, float, float]]:
    """The walls of a turned loop that are as far from its axis everywhere: the vertex that each begins at, its radius, and the levels where
    it begins and ends."""
    for vertex, (x, y, u, v, bulge) in zip(ring, ring_curves(loop), strict=True):
        if x == u and x > 0 and not bulge:
            yield vertex, x, y, v


def _is_entered(wall: EnteredWall, parts: Sequence[Primitive], end: End) -> bool:
    """Whether the leaf of an end goes through a round wall about square to that."""
    if wall.axis == end.axis:
        return False
    middle, beside = parts[end.leaf].center, 3 - wall.axis - end.axis
    aside = abs(middle[beside] - parts[wall.leaf].center[beside])
    return wall.run[0] < middle[wall.axis] < wall.run[1] and aside <= MOST * wall.radius


def _is_within(wall: EnteredWall, parts: Sequence[Primitive], end: End, box: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether a leaf with a box around it is no wider, and no longer along the axis, than a round wall that an end of it is sunk into."""
    beside, middle = 3 - wall.axis - end.axis, parts[wall.leaf].center
    wide = max(box[1][beside] - middle[beside], middle[beside] - box[0][beside])
    return wide < wall.radius and wall.run[0] <= box[0][wall.axis] and box[1][wall.axis] <= wall.run[1]


def _find_wall(
    walls: Sequence[EnteredWall],
    deep: Sequence[EnteredWall],
    parts: Sequence[Primitive],
    end: End,
    other: End,
    adds: bool,
    slack: float,
) -> tuple[EnteredWall, int] | None:
    """Of the walls between an end and the other one of its leaf that nearest to it, and on which side of its axis it is. The end of what
    `adds` touches what is round there or, of a `deep` wall, is sunk into it; that of a cut lies in a bore, or has come out. What is sunk to
    an axis follows that: its side is 0."""
    at, start = end.side * place_of(end, parts), end.side * place_of(other, parts)
    found: list[tuple[float, EnteredWall, int]] = []
    for wall in walls:
        middle = end.side * parts[wall.leaf].center[end.axis]
        inside = abs(at - middle) < wall.radius - slack
        way = -1 if inside else 1
        place = middle + way * wall.radius
        level = abs(abs(at - middle) - wall.radius) <= slack and (not adds or at < middle)
        if level:
            way, place = (1 if at > middle else -1), at
        if level or (wall in deep and inside == (adds or not wall.adds) and start - slack < place < at - slack):
            found.append((place, wall, 0 if abs(at - middle) <= slack else end.side * way))
    return max(found, key=lambda f: f[0])[1:] if found else None
