"""Where flat walls of drawings lie in one plane with faces of other leaves and touch them: those of later leaves follow these.

What a person draws on an edge of what there is already stays on that edge. Plane ends of leaves have relations of their own; here at least
one of both faces is a wall, which no relation speaks of.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.outline_joints import Row, sum_rows
from imdim.export.seats import ends_of, place_of, reach_of
from imdim.export.seen import HAIR, SeenPlanes
from imdim.geometry.lowering import lower
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

# words of numbers that no place says
ROUND = frozenset(("radius", "diameter", "angle", "chamfer", "sides", "gap", "distance", "offset", "tip"))


class FlatFace(NamedTuple):
    """A rectangle `low` [3] to `high` [3] around a flat face that looks along an `axis` to a `side`, and the variables whose sum its place
    is."""

    leaf: int
    axis: int
    side: int
    is_wall: bool
    low: np.ndarray
    high: np.ndarray
    row: Row


def find_contacts(system: LinearSystem, program: Program, seen: SeenPlanes) -> Iterator[tuple[int, Row]]:
    """Each wall or face that lies in one plane with a face of an earlier leaf and touches it: its leaf, and how far it is from there.

    Both are `seen`, or of cuts that end beside what is, or join two added leaves that look at each other there: what else is hidden says
    nothing.
    """
    sign, slack = signs(program), HAIR * system.length
    known: Mapping[tuple[int, int], list[tuple[FlatFace, bool]]] = defaultdict(list)
    for patch in sorted(list_flat_faces(system, program), key=lambda p: p.leaf):
        shown = seen.meet(patch.axis, patch.low, patch.high, sign[patch.leaf] < 0)
        level = round(float(patch.low[patch.axis]) / (4 * slack))
        near = [found for step in (-1, 0, 1) for found in known[patch.axis, level + step]]
        near = [(p, also) for p, also in near if p.leaf < patch.leaf and _touch(p, patch, slack)]
        met = [p for p, also in near if shown and also and (p.is_wall or patch.is_wall)]
        met += [p for p, _ in near if p.side == -patch.side and min(sign[p.leaf], sign[patch.leaf]) > 0 and _share_area(p, patch, slack)]
        if met:
            yield patch.leaf, sum_rows((patch.row, 1.0), (min(met, key=lambda p: p.leaf).row, -1.0))
        known[patch.axis, level].append((patch, shown))


def find_own_numbers(system: LinearSystem, leaf: int) -> list[int]:
    """The variables by which a face of a leaf may follow another one: its place, its size, and of its drawing the lines, those that say
    least else first."""
    extras = range(system.extra, len(system.start))
    own = (v for v in extras if system.leaf_of(v) == leaf)
    lines = [v for v in own if ROUND.isdisjoint(system.extras[v - system.extra][1].split("_"))]
    return [*(6 * leaf + c for c in (5, 4, 3, 2, 1, 0)), *reversed(lines)]


def list_flat_faces(system: LinearSystem, program: Program) -> Iterator[FlatFace]:
    """The plane ends of leaves along the world's axes, and the flat walls of drawings."""
    parts, numbers = list(leaves(program)), lower(program)
    boxes = [reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    for leaf, part in enumerate(parts):
        for end in (e for e in ends_of(leaf, part, numbers) if e.column >= 0):
            yield FlatFace(leaf, end.axis, end.side, False, *_flat(boxes[leaf], end.axis, place_of(end, parts)), system.place_of_end(end))
    for wall in (w for w in system.walls if w.span is not None):
        assert wall.span is not None
        low, high = _flat(boxes[wall.leaf], wall.axis, wall.place)
        low[wall.span[0]], high[wall.span[0]] = wall.span[1:]
        yield FlatFace(wall.leaf, wall.axis, wall.side, True, low, high, dict(wall.row))


def _flat(box: tuple[np.ndarray, np.ndarray], axis: int, place: float) -> tuple[np.ndarray, np.ndarray]:
    low, high = box[0].copy(), box[1].copy()
    low[axis] = high[axis] = place
    return low, high


def _touch(a: FlatFace, b: FlatFace, slack: float) -> bool:
    return bool((np.minimum(a.high, b.high) >= np.maximum(a.low, b.low) - 2 * slack).all())


def _share_area(a: FlatFace, b: FlatFace, slack: float) -> bool:
    """Whether two rectangles that touch do so in more than an edge."""
    wide = np.minimum(a.high, b.high) - np.maximum(a.low, b.low) > 2 * slack
    return bool(wide.sum() == 2)
