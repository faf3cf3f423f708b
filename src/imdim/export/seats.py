"""Where features begin and end: at which faces cuts enter, what they pass through, and what bosses and ribs stand on.

A hole through a plate ends anywhere above and below it. Read as numbers, it would not go through a thicker plate; read as so much beyond
the plate's faces, it does. A blind one is so deep below the face that it enters, a boss so high above the face that it stands on.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.program.roles import clips_of_each, cuts_of_each, signs
from imdim.program.tree import PLANE_ENDS, Primitive, Program, envelope, leaves, longest

ALIGNED = 1e-7  # how far a direction may be off the world's axes
TOUCH = 1e-9  # of the largest size
MOST = 0.5  # of a foot's area, that has to lie over what it sinks into to stand on that
INSIDE = 1e-6  # of a region: its corners are looked at so far inside


class End(NamedTuple):
    """The plane face of a leaf that looks along a world axis to `side`; `column` is the size across it, `local` its own axis.

    What is turned has the ends of its outline, and no size across them: -1.
    """

    leaf: int
    axis: int
    side: int
    column: int
    local: str


class _Remains:
    """What other cuts, and intersections, leave of added leaves."""

    def __init__(self, program: Program, parts: Sequence[Primitive], numbers: Lowered, boxes: Sequence[tuple[np.ndarray, np.ndarray]]):
        self._parts, self._numbers = parts, numbers
        self._boxes = np.array(boxes)  # [n, 2, 3]
        self._cuts, self._clips = cuts_of_each(program), clips_of_each(program)

    def clip_span(self, leaf: int, axis: int, span: tuple[float, float]) -> tuple[float, float]:
        """From where to where a leaf reaches along an axis, as far as what it is intersected with does."""
        clips = self._boxes[self._clips[leaf]]  # [m, 2, 3]
        if not len(clips):
            return span
        return max(span[0], float(clips[:, 0, axis].min())), min(span[1], float(clips[:, 1, axis].max()))

    def are_gone_at(self, leaf: int, cut: int) -> bool:
        """Whether nothing of a leaf is left where a `cut` meets it, for what other cuts take there; a part added later is not cut by it."""
        if cut not in self._cuts[leaf]:
            return True
        low = np.maximum(self._boxes[leaf, 0], self._boxes[cut, 0])
        high = np.minimum(self._boxes[leaf, 1], self._boxes[cut, 1])
        others = [c for c in self._cuts[leaf] if c != cut]
        slack = INSIDE * (high - low)
        boxes = self._boxes[others].reshape(-1, 2, 3)
        around = (boxes[:, 0] <= low + slack).all(1) & (boxes[:, 1] >= high - slack).all(1)
        corners = np.array(list(product(*zip(low + slack, high - slack, strict=True))))
        return any(self._holds(others[i], corners) for i in np.flatnonzero(around))

    def _holds(self, leaf: int, points: np.ndarray) -> bool:
        """Whether a convex leaf holds all of points [n, 3]."""
        part = self._parts[leaf]
        return part.outline is None and part.kind != "torus" and bool(kernels.inside(lower(part), points).all())


class Seat(NamedTuple):
    """An end of a leaf stays as far from a face of another one as it is; with a `word` that distance is a dimension, and is called so."""

    own: End
    face: End
    word: str


def seats(program: Program, hidden: Collection[tuple[int, int, int]] = ()) -> Iterator[Seat]:
    """Of cuts and of what stands on something the faces that their ends follow. No cut is measured from a face that is `hidden`, by leaf,
    axis and side."""
    parts, numbers, sign = list(leaves(program)), lower(program), signs(program)
    ends = [e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers)]
    boxes = [reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    remains = _Remains(program, parts, numbers, boxes)
    yield from _seats_of_ends(parts, sign, ends, boxes, TOUCH * longest(parts), remains, hidden)


def sticks_out(seat: Seat, parts: Sequence[Primitive], largest: float) -> bool:
    """Whether an end lies beyond the face that it follows, and not in it; `largest` is the largest size of all parts."""
    return abs(place_of(seat.own, parts) - place_of(seat.face, parts)) > TOUCH * largest


class _FacingEnds:
    """Faces of leaves that add, which look one way along one axis, as arrays: a program of hundreds has tens of thousands of pairs."""

    def __init__(self, faces: list[End], pairs: _Ends, parts: list[Primitive], boxes: list[tuple[np.ndarray, np.ndarray]]) -> None:
        self.faces = faces
        self._leaves = np.array([e.leaf for e in faces])
        self._spans = np.array([_span(pairs, e, parts) for e in faces])
        self._boxes = np.array([boxes[e.leaf] for e in faces])

    def near(self, end: End, span: tuple[float, float], box: tuple[np.ndarray, np.ndarray], slack: float) -> list[End]:
        """Those of other leaves that share area with the `box` of an end's leaf as seen along the axis, and a length along it with its
        `span`, or touch there where `slack` is negative."""
        across = [i for i in range(3) if i != end.axis]
        (low, high), (starts, stops) = box, self._spans.T
        seen = (np.minimum(self._boxes[:, 1], high) > np.maximum(self._boxes[:, 0], low))[:, across].all(axis=1)
        beside = np.minimum(stops, span[1]) > np.maximum(starts, span[0]) + slack
        return [self.faces[k] for k in np.flatnonzero(seen & beside & (self._leaves != end.leaf))]


def _seats_of_ends(
    parts: list[Primitive],
    sign: list[int],
    ends: list[End],
    boxes: list[tuple[np.ndarray, np.ndarray]],
    slack: float,
    remains: _Remains,
    hidden: Collection[tuple[int, int, int]],
) -> Iterator[Seat]:
    pairs = {(e.leaf, e.axis, e.side): e for e in ends}
    adding: dict[tuple[int, int], list[End]] = {}
    for e in ends:
        if sign[e.leaf] > 0:
            adding.setdefault((e.axis, e.side), []).append(e)
    facing = {way: _FacingEnds(faces, pairs, parts, boxes) for way, faces in adding.items()}
    for end in ends:
        other = pairs[end.leaf, end.axis, -end.side]
        least = slack if sign[end.leaf] < 0 else -2 * slack
        faces = facing.get((end.axis, end.side))
        near = [] if faces is None else faces.near(end, _span(pairs, end, parts), boxes[end.leaf], least)
        if sign[end.leaf] < 0:
            near = [e for e in near if not remains.are_gone_at(e.leaf, end.leaf)]
            face = _passed([e for e in near if (e.leaf, e.axis, e.side) not in hidden], end, parts, slack)
            if face is not None and not _is_inside(pairs, near, end, parts, slack, remains):
                yield Seat(end, face, "")
                if end.column >= 0 and _is_inside(pairs, near, other, parts, slack, remains):
                    yield Seat(other, face, "depth")
        elif end.leaf > 0:
            near = [e for e in near if e.column >= 0]  # a turned part is far from filling its box: what lies in that is seen
            spanned = next((e for e in near if e.leaf < end.leaf and _is_spanned(pairs, e, end, parts, slack)), None)
            if spanned is not None:  # what goes from face to face goes on doing so
                yield Seat(end, spanned, "")
                continue
            bases = [e for e in near if e.leaf < end.leaf and _holds(pairs, e, other, parts, slack)]
            bases = [e for e in bases if _carries(boxes[e.leaf], boxes[end.leaf], end.axis) or _touches(pairs, e, other, parts, slack)]
            face = _passed(bases, end, parts, -slack)
            if face is not None and not any(_holds(pairs, e, end, parts, slack) for e in near):
                # what begins at the carrier's far face begins there however thick the carrier is
                far = pairs[face.leaf, face.axis, -face.side]
                through = abs(place_of(far, parts) - place_of(other, parts)) <= slack
                yield Seat(other, far if through else face, "")
                if end.column >= 0:
                    yield Seat(end, face, "height")


def _passed(faces: list[End], end: End, parts: list[Primitive], slack: float) -> End | None:
    """The face next behind an end that it passes or, with `slack`, meets."""
    place = end.side * place_of(end, parts)
    passed = [e for e in faces if e.side * place_of(e, parts) <= place + slack]
    return max(passed, key=lambda e: e.side * place_of(e, parts), default=None)


def _is_inside(pairs: _Ends, near: list[End], end: End, parts: list[Primitive], slack: float, remains: _Remains) -> bool:
    """Whether an end lies within some leaf, and within what that is intersected with."""
    spans = (remains.clip_span(e.leaf, e.axis, _span(pairs, e, parts)) for e in near)
    return any(low + slack < place_of(end, parts) < high - slack for low, high in spans)


def _holds(pairs: _Ends, e: End, end: End, parts: list[Primitive], slack: float) -> bool:
    """Whether an end lies within a leaf, or at its face."""
    low, high = _span(pairs, e, parts)
    return low - slack <= place_of(end, parts) <= high + slack


def _touches(pairs: _Ends, e: End, end: End, parts: list[Primitive], slack: float) -> bool:
    """Whether an end lies at a face of a leaf."""
    return min(abs(place_of(end, parts) - place) for place in _span(pairs, e, parts)) <= slack


def _carries(carrier: tuple[np.ndarray, np.ndarray], box: tuple[np.ndarray, np.ndarray], axis: int) -> bool:
    """Whether most of a box lies over its carrier, as seen along an axis: a bar that crosses the end of another one stands on nothing."""
    across = [i for i in range(3) if i != axis]
    shared = np.minimum(box[1], carrier[1]) - np.maximum(box[0], carrier[0])
    return bool(np.prod(shared[across]) >= MOST * np.prod((box[1] - box[0])[across]))


def _is_spanned(pairs: _Ends, e: End, end: End, parts: list[Primitive], slack: float) -> bool:
    """Whether two leaves begin and end in the same planes."""
    own, other = _span(pairs, e, parts), _span(pairs, end, parts)
    return abs(own[0] - other[0]) <= slack and abs(own[1] - other[1]) <= slack


def _span(pairs: _Ends, e: End, parts: list[Primitive]) -> tuple[float, float]:
    """Where a leaf begins and ends along the axis of one of its faces."""
    return place_of(pairs[e.leaf, e.axis, -1], parts), place_of(pairs[e.leaf, e.axis, 1], parts)


def ends_of(leaf: int, p: Primitive, numbers: Lowered) -> Iterator[End]:
    """The plane faces of a leaf that look along the world's axes."""
    for axis in (2,) if p.kind == "revolve" else PLANE_ENDS.get(p.kind, ()):
        direction = numbers.rotations[leaf][:, axis]
        along = world_axis(direction)
        if along is not None:
            for side in (-1, 1):
                own = side if direction[along] > 0 else -side
                column = -1 if p.kind == "revolve" else PLANE_ENDS[p.kind][axis]
                yield End(leaf, along, side, column, ("+" if own > 0 else "-") + "xyz"[axis])


def world_axis(direction: np.ndarray) -> int | None:
    """The world's axis that a unit vector lies along, either way."""
    axis = int(np.abs(direction).argmax())
    return axis if abs(direction[axis]) > 1 - ALIGNED**2 else None


_Ends = Mapping[tuple[int, int, int], End]  # by leaf, axis and side


def place_of(end: End, parts: Sequence[Primitive]) -> float:
    """Where an end lies along its axis."""
    p = parts[end.leaf]
    if end.column >= 0:
        return p.center[end.axis] + end.side * p.size[end.column] / 2
    assert p.outline is not None
    own = 1 if end.local[0] == "+" else -1
    return p.center[end.axis] + end.side * own * p.outline.bounds[own > 0][1]


def reach_of(p: Primitive, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner [3] of a box around a leaf."""
    p = envelope(p)
    radius = sum(p.size) if p.kind == "torus" else max(p.size)
    half = [radius] * 3
    if p.kind == "box":
        half = [s / 2 for s in p.size]
    elif p.kind in ("cylinder", "cone"):
        half = [max(p.size[:-1])] * 2 + [p.size[-1] / 2]
    reach = np.abs(rotation) @ np.array(half)
    return p.center - reach, p.center + reach
