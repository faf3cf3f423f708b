"""Round leaves that touch about one axis, such as a plug in its hole, or what is stacked end on end: an edit keeps that."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, permutations, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.outline_joints import Row, sum_rows
from imdim.export.outline_rows import Drawn
from imdim.export.outline_walls import EXACT
from imdim.export.round_seats import walls_about_axis
from imdim.export.seats import ALIGNED, End, ends_of, place_of, world_axis
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import circle_of
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, longest

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

HAIR = 1e-3  # of the largest size, by which people let stacked parts overlap


class _RingTube(NamedTuple):
    """The tube of a ring: the radius and the height of its middle from that of the leaf, about and along its own axis, and what that radius
    is the sum of."""

    radius: float
    height: float
    size: Row


class _AxialWall(NamedTuple):
    """A round wall of a leaf about its own axis, or a rim: its radius, from where to where it runs from the middle of the leaf, and what
    its radius is the sum of."""

    radius: float
    low: float
    high: float
    size: Row


def bind_plugs(parts: Sequence[Primitive], sources: Sequence[int], drawn: Mapping[int, Drawn]) -> Iterator[Row]:
    """Equal radii of cylinders, cones, and what is `drawn` and turned, that have one wall, or of cones a rim, and meet in it, and equal
    places along the world's axes across theirs; copies follow their `sources`."""
    slack = EXACT * longest(parts)
    walls = {i: list(_walls_of(p, sources[i], drawn.get(sources[i], ()))) for i, p in enumerate(parts)}
    for a, along, b, other in _parallel_pairs(parts, sources, walls):
        met = [(one, two) for one in walls[a] for two in walls[b] if _meet((parts[a], one), (parts[b], two), along, other, slack)]
        yield from _bind(a, b, [(one.size, two.size) for one, two in met], along, sources)


def find_following_rims(system: LinearSystem, rows: Sequence[Row], parts: Sequence[Primitive]) -> set[int]:
    """The diameters of rims of cones that follow walls by rows of `bind_plugs`: a countersink ends in its hole, whose diameter that is."""
    kinds = [{v: parts[v // 6].kind if v < system.extra else "" for v in row} for row in rows]
    rims = {v for of in kinds if {*of.values()} > {"cone"} for v, kind in of.items() if kind == "cone" and v % 6 < 2}
    pairs = (pair for row in system.rows if len(row) == 2 for pair in permutations(row))
    return {w for v, w in pairs if v in rims and w >= system.extra and system.extras[w - system.extra][1].endswith("diameter")}


def bind_tubes(parts: Sequence[Primitive], sources: Sequence[int], drawn: Mapping[int, Drawn]) -> Iterator[Row]:
    """Equal radii of rings, of tori and of circles that are `drawn` and turned, whose tubes lie in each other, and equal places along the
    world's axes across theirs; copies follow their `sources`."""
    slack = EXACT * longest(parts)
    tubes = {i: list(_tubes_of(p, sources[i], drawn.get(sources[i], ()))) for i, p in enumerate(parts)}
    for a, along, b, other in _parallel_pairs(parts, sources, tubes):
        apart = np.subtract(parts[b].center, parts[a].center)
        sizes = [
            (one.size, two.size)
            for one, two in product(tubes[a], tubes[b])
            if abs(one.radius - two.radius) <= slack and np.abs(apart + two.height * other - one.height * along).max() <= slack
        ]
        yield from _bind(a, b, sizes, along, sources)


def _parallel_pairs(
    parts: Sequence[Primitive], sources: Sequence[int], found: Mapping[int, Sequence[object]]
) -> Iterator[tuple[int, np.ndarray, int, np.ndarray]]:
    """Leaves of which something was `found`, with their axes [3], two by two where these are parallel; not copies among each other."""
    rounds = [(i, exact_rotation(parts[i])[:, 2]) for i, own in found.items() if own]
    for (a, along), (b, other) in combinations(rounds, 2):
        are_copies = sources[a] != a, sources[b] != b
        if sources[a] != sources[b] and not all(are_copies) and abs(along @ other) > 1 - ALIGNED**2:
            yield a, along, b, other


def _bind(a: int, b: int, sizes: Sequence[tuple[Row, Row]], along: np.ndarray, sources: Sequence[int]) -> Iterator[Row]:
    """Equal `sizes` of two leaves that meet, and where none is a copy equal places along the world's axes across theirs."""
    yield from (sum_rows((one, 1.0), (two, -1.0)) for one, two in sizes)
    if sizes and sources[a] == a and sources[b] == b:
        yield from ({6 * a + 3 + i: 1.0, 6 * b + 3 + i: -1.0} for i in range(3) if abs(along[i]) <= ALIGNED)


def bind_tangents(parts: Sequence[Primitive], sources: Sequence[int], drawn: Mapping[int, Drawn]) -> Iterator[Row]:
    """Of round leaves along the world's axes that go on from the tube of a ring, as the straight ends of an elbow do, that they lie as far
    from its axis as that."""
    slack = EXACT * longest(parts)
    straight = [(i, p, world_axis(exact_rotation(p)[:, 2])) for i, p in enumerate(parts) if p.kind == "cylinder" and sources[i] == i]
    for ring, part in enumerate(parts):
        across = world_axis(exact_rotation(part)[:, 2])
        if across is None or sources[ring] != ring:
            continue
        tubes = [tube for tube in _tubes_of(part, ring, drawn.get(ring, ())) if abs(tube.height) <= slack]
        for tube, (leaf, other, along) in product(tubes, straight):
            if along is None or along == across:
                continue
            apart, radial = np.subtract(other.center, part.center), 3 - along - across
            goes_on = abs(apart[across]) <= slack and abs(apart[along]) <= other.size[1] / 2 + slack
            if goes_on and abs(abs(apart[radial]) - tube.radius) <= slack:
                yield {6 * leaf + 3 + across: 1.0, 6 * ring + 3 + across: -1.0}
                place = {6 * leaf + 3 + radial: 1.0, 6 * ring + 3 + radial: -1.0}
                yield sum_rows((place, 1.0), (tube.size, -math.copysign(1.0, apart[radial])))


def _tubes_of(part: Primitive, source: int, drawn: Drawn) -> Iterator[_RingTube]:
    """That of a torus, or those of what is turned, a copy of the leaf `source`."""
    if part.kind == "torus":
        yield _RingTube(part.size[0], 0.0, {6 * source: 1.0})
    elif part.kind == "revolve" and part.outline is not None:
        for loop, ring in zip(part.outline.loops, drawn, strict=False):
            if (found := circle_of(loop)) and isinstance(ring, tuple):
                yield _RingTube(found[0], found[1], sum_rows(*((vertex.x.row, 0.5) for vertex in ring)))


def _walls_of(part: Primitive, source: int, drawn: Drawn) -> Iterator[_AxialWall]:
    """That of a cylinder, both rims of a cone, or those of what is turned, a copy of the leaf `source`."""
    if part.kind == "cylinder":
        yield _AxialWall(part.size[0], -part.size[1] / 2, part.size[1] / 2, {6 * source: 1.0})
    elif part.kind == "cone":
        for end in (end for end in (0, 1) if part.size[end] > 0):
            level = (end - 0.5) * part.size[2]
            yield _AxialWall(part.size[end], level, level, {6 * source + end: 1.0})
    elif part.kind == "revolve" and part.outline is not None:
        for loop, ring in zip(part.outline.loops, drawn, strict=False):
            if not isinstance(loop, Ellipse) and isinstance(ring, tuple):
                yield from (_AxialWall(x, min(y, v), max(y, v), dict(vertex.x.row)) for vertex, x, y, v in walls_about_axis(ring, loop))


def _meet(one: tuple[Primitive, _AxialWall], two: tuple[Primitive, _AxialWall], along: np.ndarray, other: np.ndarray, slack: float) -> bool:
    """Whether two round walls share a wall; the axes of their leaves are unit vectors [3] that are parallel."""
    (a, wall), (b, its) = one, two
    apart = np.subtract(b.center, a.center)
    off = float(apart @ along)
    aside = np.abs(apart - off * along).max()
    low, high = (its.low, its.high) if along @ other > 0 else (-its.high, -its.low)
    touch = wall.low - slack <= off + high and off + low <= wall.high + slack
    return bool(abs(wall.radius - its.radius) <= slack and aside <= slack and touch)


def find_stacked(program: Program, sources: Sequence[int]) -> Iterator[tuple[End, End]]:
    """The ends of round leaves of one sign about one axis that meet, or overlap by a hair, and look at each other, that of the later leaf
    first."""
    parts, sign = list(leaves(program)), signs(program)
    slack, hair = EXACT * longest(parts), HAIR * longest(parts)
    numbers = lower(program)
    ends = {i: list(ends_of(i, p, numbers)) for i, p in enumerate(parts) if p.kind in ("cylinder", "cone") and sources[i] == i}
    for a, b in combinations((i for i in ends if ends[i]), 2):
        if sign[a] == sign[b] and ends[a][0].axis == ends[b][0].axis and _apart_across(parts[a], parts[b], ends[a][0].axis) <= slack:
            pairs = ((e, f) for e in ends[a] for f in ends[b] if e.side != f.side)
            yield from ((f, e) for e, f in pairs if -hair <= e.side * (place_of(f, parts) - place_of(e, parts)) <= slack)


def _apart_across(a: Primitive, b: Primitive, axis: int) -> float:
    """How far the middles of two leaves are apart across an axis."""
    apart = np.abs(np.subtract(a.center, b.center))
    apart[axis] = 0.0
    return float(apart.max())
