"""Cuts that enter what is round from its side, and what stands on it: their ends follow its round walls, or its axis if they end there.

A set screw's hole begins somewhere in the bore and ends somewhere in the air. Read as numbers, it would no longer reach a narrower bore;
read as so much beyond both walls, it does.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from imdim.export.outline_joints import Row, sum_rows
from imdim.export.seats import End, ends_of, place_of, world_axis
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.roles import cuts_of_each, signs
from imdim.program.tree import Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

MOST = 0.7  # of a radius, by which the middle of what enters may lie beside the axis: further out a wall is not met by its radius
SLACK = 1e-7  # of the largest size


class _EnteredWall(NamedTuple):
    """The wall of a cylinder along a world `axis`, which is that far from it and runs from where to where, and whether it adds."""

    leaf: int
    axis: int
    run: tuple[float, float]
    radius: float
    adds: bool


def seats_at_rounds(system: LinearSystem, program: Program, hidden: Collection[tuple[int, int, int]]) -> Iterator[tuple[End, Row]]:
    """Of ends how far they lie beyond a round wall: of cuts that of what they are taken from, or of the bore that they begin in; of what is
    added, where they are `hidden`, by leaf, axis and side, that of another leaf which it comes out of."""
    parts, numbers, sign, cuts = list(leaves(program)), lower(program), signs(program), cuts_of_each(program)
    walls = [wall for i, p in enumerate(parts) for wall in _round_walls(i, p, sign[i] > 0)]
    for leaf, part in enumerate(parts) if walls else ():
        met = [w for w in walls if (w.adds if sign[leaf] > 0 else not w.adds or leaf in cuts[w.leaf])]
        ends = {(e.axis, e.side): e for e in ends_of(leaf, part, numbers) if e.column >= 0 or leaf in system.heights}
        loose = [e for e in ends.values() if sign[leaf] < 0 or (leaf, e.axis, e.side) in hidden]
        found: dict[tuple[int, int], Row] = {}
        for end in loose:
            near = [w for w in met if w.leaf != leaf and _is_entered(w, parts, end)]
            wall = _find_wall(near, parts, end, ends[end.axis, -end.side], sign[leaf] > 0, SLACK * system.length)
            if wall is not None:
                number, way = wall
                found[end.axis, end.side] = {6 * number + 3 + end.axis: 1.0} | ({6 * number: float(way)} if way else {})
        if part.kind == "cone":  # it moves as a whole: where it ends says how steep it is
            found = dict(list(found.items())[:1])
        yield from ((ends[at], sum_rows((system.place_of_end(ends[at]), 1.0), (row, -1.0))) for at, row in found.items())
        # what is hidden at its other end, too, goes on ending there
        others = (ends[axis, -side] for axis, side in found if (axis, -side) not in found and (leaf, axis, -side) in hidden)
        others = others if part.kind != "cone" else ()
        yield from ((end, system.place_of_end(end)) for end in others)


def _round_walls(leaf: int, part: Primitive, adds: bool) -> Iterator[_EnteredWall]:
    along = world_axis(exact_rotation(part)[:, 2]) if part.kind == "cylinder" else None
    if along is not None:
        half = part.size[1] / 2
        yield _EnteredWall(leaf, along, (part.center[along] - half, part.center[along] + half), part.size[0], adds)


def _is_entered(wall: _EnteredWall, parts: Sequence[Primitive], end: End) -> bool:
    """Whether the leaf of an end goes through a round wall about square to that."""
    if wall.axis == end.axis:
        return False
    middle, beside = parts[end.leaf].center, 3 - wall.axis - end.axis
    aside = abs(middle[beside] - parts[wall.leaf].center[beside])
    return wall.run[0] < middle[wall.axis] < wall.run[1] and aside <= MOST * wall.radius


def _find_wall(
    walls: Sequence[_EnteredWall], parts: Sequence[Primitive], end: End, other: End, sunk: bool, slack: float
) -> tuple[int, int] | None:
    """Of the walls between an end and the other one of its leaf that nearest to it, by its leaf and on which side of its axis it is: the
    end is `sunk` into what is round there, or lies in a bore, or has come out. What is sunk to an axis follows that: its side is 0."""
    at, start = end.side * place_of(end, parts), end.side * place_of(other, parts)
    found: list[tuple[float, int, int]] = []
    for wall in walls:
        middle = end.side * parts[wall.leaf].center[end.axis]
        inside = abs(at - middle) < wall.radius - slack
        way = -1 if inside else 1
        place = middle + way * wall.radius
        level = not sunk and abs(abs(at - middle) - wall.radius) <= slack
        if level:
            way, place = (1 if at > middle else -1), at
        if level or (inside == (sunk or not wall.adds) and start - slack < place < at - slack):
            found.append((place, wall.leaf, 0 if abs(at - middle) <= slack else end.side * way))
    return max(found)[1:] if found else None
