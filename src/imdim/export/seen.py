"""Which ends of leaves are seen on the solid, and which numbers move only ends that are not.

How far a cut goes on in the air, or how deep a boss is buried, is no dimension: nothing is measured there, and no part changes with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from imdim.export.seats import ends_of, place_of, world_axis
from imdim.export.seen_walls import TRACE, rows_of_walls, surface_of
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.tree import FLAT_ENDS, Program, leaves, longest

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

LEVEL = 1e-6  # of the largest size, within which faces are at one level
HAIR = 1e-5  # of the largest size, by which a fit may miss that two faces lie in one plane
FACING = 0.999  # the cosine to an axis of what looks along it
NONE = 1e-9  # coefficients
SHORTEST = 1e-4  # of the largest size: a step between two corners that is shorter is what their numbers are off by


class SeenPlanes:
    """The flat triangles of a solid that look along the world's axes, by axis: a box [n, 3], [n, 3] around each."""

    def __init__(self, program: Program, slack: float = LEVEL) -> None:
        surface, _ = surface_of(program)
        self._slack = slack * longest(leaves(program))
        corners = surface.triangles
        flat = np.abs(surface.face_normals) > FACING
        self._boxes = [(corners[flat[:, a]].min(1), corners[flat[:, a]].max(1)) for a in range(3)]

    def meet(self, axis: int, low: np.ndarray, high: np.ndarray, beside: bool) -> bool:
        """Whether one lies in the rectangle `low` [3] to `high` [3] across an axis, or, if it may, `beside` it."""
        reach = np.full(3, self._slack if beside else -self._slack)
        reach[axis] = self._slack
        lows, highs = self._boxes[axis]
        return bool(((lows <= high + reach) & (highs >= low - reach)).all(1).any())


def find_seen_reach(program: Program) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Of each leaf that has a part in the surface the low and high corner [3] of a box around that part."""
    surface, owners = surface_of(program)
    corners = surface.triangles
    own = {int(leaf): corners[owners == leaf].reshape(-1, 3) for leaf in np.unique(owners[owners >= 0])}
    return {leaf: (at.min(0), at.max(0)) for leaf, at in own.items()}


@lru_cache(maxsize=8)
def find_hidden_ends(program: Program, turned: bool = False) -> frozenset[tuple[int, int, int]]:
    """The plane ends along the world's axes, by leaf, axis and side, that have no part in the surface and lie level with none that has;
    with `turned` also those of outlines that are turned."""
    parts, numbers = list(leaves(program)), lower(program)
    ends = [e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers) if turned or e.column >= 0]
    surface, _ = surface_of(program)
    slack, least = LEVEL * longest(parts), TRACE * surface.area
    levels = [_levels(surface.triangles_center[:, a], surface.face_normals[:, a], surface.area_faces, least, slack) for a in range(3)]
    return frozenset((e.leaf, e.axis, e.side) for e in ends if not _is_near(levels[e.axis], place_of(e, parts), slack))


@lru_cache(maxsize=8)  # asked for again for every way in which faces may be kept apart
def _sizes_aslant(program: Program) -> Mapping[tuple[int, int], bool]:
    """By leaf and column the sizes between plane ends that look along none of the world's axes, but for those of cones, and whether one of
    both has a part in the surface."""
    surface, _ = surface_of(program)
    slack, least = LEVEL * longest(leaves(program)), TRACE * surface.area
    found: dict[tuple[int, int], bool] = {}
    for leaf, part in enumerate(leaves(program)):
        flat = {} if part.kind == "cone" else FLAT_ENDS.get(part.kind, {})
        turn = exact_rotation(part) if flat else np.eye(3)
        for axis in (a for a in flat if world_axis(turn[:, a]) is None):
            off = np.abs((surface.triangles_center - np.array(part.center)) @ turn[:, axis])
            level = (np.abs(surface.face_normals @ turn[:, axis]) > FACING) & (np.abs(off - part.size[flat[axis]] / 2) <= 2 * slack)
            found[leaf, flat[axis]] = bool(surface.area_faces[level].sum() > least)
    return found


def _levels(places: np.ndarray, cosines: np.ndarray, areas: np.ndarray, least: float, slack: float) -> np.ndarray:
    """Where along an axis flat faces lie that look along it, sorted: those of triangles at `places` [n]."""
    flat = np.abs(cosines) > FACING
    order = np.argsort(places[flat])
    sorted_places, sizes = places[flat][order], areas[flat][order]
    if not len(sorted_places):
        return sorted_places
    starts = np.flatnonzero(np.diff(sorted_places, prepend=-np.inf) > slack)
    return sorted_places[starts][np.add.reduceat(sizes, starts) > least]


def _is_near(levels: np.ndarray, place: float, slack: float) -> bool:
    return bool(len(levels) and np.abs(levels - place).min() <= 2 * slack)


def find_unseen(system: LinearSystem, solved: Mapping[int, Mapping[int, object]], program: Program) -> set[int]:
    """The variables that move hidden ends and walls of `program` alone, and steps from corner to corner that are too short to be meant;
    `solved` says what follows which."""
    parts, numbers, hidden = list(leaves(program)), lower(program), find_hidden_ends(program)
    ends = [e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers) if e.column >= 0]
    ending = {v for e in ends if parts[e.leaf].kind != "cone" for v in system.place_of_end(e)}
    shown = [system.place_of_end(e) for e in ends if (e.leaf, e.axis, e.side) not in hidden]
    drawn = list(rows_of_walls(system.drawn, program))
    shown += [row for row, seen in drawn if seen]
    aslant = _sizes_aslant(program)
    ending |= {6 * leaf + column for leaf, column in aslant}
    shown += [{6 * leaf + column: 1.0} for (leaf, column), seen in aslant.items() if seen]
    shown += [{v: 1.0} for v in range(system.extra) if v not in ending]
    hiding = {w for v in ending for w in solved.get(v, (v,))} | {w for row, seen in drawn if not seen for w in _follow(row, solved)}
    short = {v for v in range(system.extra, len(system.start)) if system.is_step(v) and abs(system.start[v]) < SHORTEST * system.length}
    return hiding - {w for row in shown for w in _follow(row, solved)} | short


def _follow(row: Mapping[int, float], solved: Mapping[int, Mapping[int, object]]) -> Iterator[int]:
    """The variables that move what is the sum of a `row`."""
    total: dict[int, float] = {}
    for v, factor in row.items():
        for w, c in solved.get(v, {v: 1.0}).items():
            total[w] = total.get(w, 0.0) + factor * float(c)  # type: ignore[arg-type]
    yield from (w for w, c in total.items() if abs(c) > NONE)
