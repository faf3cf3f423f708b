"""Cuts that enter an extrusion from its side, and what stands on one: their ends follow its flat walls."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from imdim.export.seats import MOST, TOUCH, End, ends_of, place_of, reach_of
from imdim.geometry.lowering import lower
from imdim.program.roles import clips_of_each, cuts_of_each, signs
from imdim.program.tree import Primitive, Program, leaves, longest


class FlatWall(NamedTuple):
    """A flat wall of an extrusion, or face of what is turned, that looks along a world axis to `side`: its `place`, and the variables whose
    sum that is.

    `span` says along which other axis it runs, from where to where; of the outermost one that way, all of the leaf counts.
    """

    leaf: int
    axis: int
    side: int
    place: float
    row: Mapping[int, float]
    span: tuple[int, float, float] | None = None


class _Placed(NamedTuple):
    """The leaves of a program, a box [3], [3] around each, what is taken from each and what it is intersected with, and within what places
    are one."""

    parts: Sequence[Primitive]
    boxes: Sequence[tuple[np.ndarray, np.ndarray]]
    cuts: Sequence[Sequence[int]]
    clips: Sequence[Sequence[int]]
    slack: float

    def at(self, end: End, side: int) -> float:
        """Where an end lies, as seen to a `side`."""
        return side * place_of(end, self.parts)


def seats_at_walls(
    program: Program, walls: Sequence[FlatWall], hidden: Collection[tuple[int, int, int]]
) -> Iterator[tuple[End, FlatWall, str]]:
    """Of cuts that enter an extrusion from its side the walls that their ends follow, and the end that lies inside it, as so deep; of what
    stands on such a wall the end that is `hidden` in there, by leaf, axis and side, and how high it is. The end of a cut that is hidden in
    a wider one stays as far before the wall of that."""
    parts, numbers, sign = list(leaves(program)), lower(program), signs(program)
    pairs = {(e.leaf, e.axis, e.side): e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers)}
    boxes = [reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    placed = _Placed(parts, boxes, cuts_of_each(program), clips_of_each(program), TOUCH * longest(parts))
    whole = [w for w in walls if sign[w.leaf] > 0 and w.span is None]
    pieces = [w for w in walls if sign[w.leaf] > 0 and w.span is not None]
    around = [w for w in walls if sign[w.leaf] < 0 and w.span is None]
    for end in (e for e in pairs.values() if e.column >= 0):
        other, cuts = pairs[end.leaf, end.axis, -end.side], sign[end.leaf] < 0
        entered = _keep_cut(placed, _between(placed, whole, other, end), end) if cuts else []
        entered = [w for w in entered if w.side * w.place >= placed.at(end, w.side) - placed.slack][:1] or entered
        if len(entered) == 1:  # what lies one behind another, and none level with the end, says no more which of them is meant
            yield end, entered[0], ""
            far = next((w for w in whole if (w.leaf, w.axis, w.side) == (entered[0].leaf, end.axis, -end.side)), None)
            if far is not None and placed.at(other, -end.side) < -end.side * far.place - placed.slack:
                yield other, entered[0], "depth"
        elif (end.leaf, end.axis, end.side) in hidden:
            wall = _find_exit(placed, pieces, other, end) if cuts else _find_base(placed, pieces, end, other)
            if wall is not None:
                if wall.leaf not in placed.clips[end.leaf]:  # else it goes on to where that is cut off
                    yield end, wall, ""
                if (other.leaf, other.axis, other.side) not in hidden:
                    yield other, wall, "depth" if cuts else "height"
            elif cuts and (void := _find_void(placed, around, end)) is not None:
                yield end, void, ""


def _between(placed: _Placed, walls: Sequence[FlatWall], low: End, high: End) -> list[FlatWall]:
    """The walls that look the way of the end `high` of a leaf and lie between its other end and that, or at that."""
    met = [w for w in walls if (w.axis, w.side) == (high.axis, high.side)]
    met = [w for w in met if placed.at(low, w.side) < w.side * w.place - placed.slack]
    met = [w for w in met if w.side * w.place <= placed.at(high, w.side) + placed.slack]
    return [w for w in met if share_area(placed.boxes[w.leaf], placed.boxes[high.leaf], high.axis)]


def _keep_cut(placed: _Placed, walls: Sequence[FlatWall], end: End) -> list[FlatWall]:
    """Those of what the leaf of an `end` is taken from: what was added later is no matter of that."""
    return [w for w in walls if end.leaf in placed.cuts[w.leaf]]


def _find_exit(placed: _Placed, walls: Sequence[FlatWall], start: End, end: End) -> FlatWall | None:
    """The wall through which a cut goes out by an `end`: the outermost behind which it does not enter the same leaf again."""
    covering = [w for w in walls if _covers(w, placed.boxes[end.leaf])]
    left = _keep_cut(placed, _between(placed, covering, start, end), end)
    entered = _keep_cut(placed, _between(placed, [w._replace(side=-w.side) for w in covering], start, end), end)
    found = [w for w in left if not any(v.leaf == w.leaf and v.side * v.place > w.side * w.place for v in entered)]
    return max(found, key=lambda w: w.side * w.place, default=None)


def _find_void(placed: _Placed, walls: Sequence[FlatWall], end: End) -> FlatWall | None:
    """The wall of another cut in which a cut ends, and which is as wide there: the nearest."""
    low, high = placed.boxes[end.leaf]
    across = [axis for axis in range(3) if axis != end.axis]

    def holds(leaf: int) -> bool:
        return all(placed.boxes[leaf][0][a] <= low[a] + placed.slack and high[a] <= placed.boxes[leaf][1][a] + placed.slack for a in across)

    beyond = [w for w in walls if w.leaf != end.leaf and (w.axis, w.side) == (end.axis, end.side)]
    beyond = [w for w in beyond if w.side * w.place > placed.at(end, w.side) + placed.slack and holds(w.leaf)]
    return min(beyond, key=lambda w: w.side * w.place, default=None)


def _find_base(placed: _Placed, walls: Sequence[FlatWall], foot: End, top: End) -> FlatWall | None:
    """The wall of an earlier leaf that something comes out of, whose foot lies in there: the nearest to that. What ends level with a wall
    does not come out of it."""
    found = [w for w in _between(placed, walls, foot, top) if w.leaf < top.leaf and _covers(w, placed.boxes[top.leaf])]
    found = [w for w in found if w.side * w.place < placed.at(top, w.side) - placed.slack]
    return min(found, key=lambda w: w.side * w.place, default=None)


def _covers(wall: FlatWall, box: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether a wall runs along most of a box."""
    assert wall.span is not None
    axis, low, high = wall.span
    return min(high, box[1][axis]) - max(low, box[0][axis]) >= MOST * (box[1] - box[0])[axis]


def share_area(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray], axis: int) -> bool:
    """Whether two boxes share area as seen along an axis."""
    across = [i for i in range(3) if i != axis]
    return bool((np.minimum(a[1], b[1]) > np.maximum(a[0], b[0]))[across].all())
