"""Rounded rectangles and slots as one drawing each: not four cylinders and two crossing boxes, nor two cylinders and a box.

Whoever counts primitives alone says a plate with rounded corners so; who edits it has a length, a width and a corner radius. A bar with
round ends is left: a box and two cylinders are as often what a designer has, and each end is a place for more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.solid import exact_rotation
from imdim.geometry.surface import vec
from imdim.program.outline import Outline
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import Primitive, Program, combine_all, leaves, longest

NEAR = 1e-4  # of the largest size, within which walls meet: numbers are not rounded yet
ALIGNED = 1e-6  # of a cosine
QUARTER = math.tan(math.pi / 8)  # the bulge of a quarter circle; that of a half is 1


class _RoundedPrism(NamedTuple):
    """A prism, and which of the parts (by number) it stands for."""

    prism: Primitive
    members: frozenset[int]


def draw_rounded(program: Program) -> Program:
    """The program with a drawing for each rounded rectangle that cylinders and boxes are joined or cut as, and each slot that they are cut
    as. The solid is the same where these are as long as each other, which is for the caller to see."""
    return _draw_in(program, NEAR * longest(leaves(program)), False)


def _draw_in(program: Program, slack: float, cuts_out: bool) -> Program:
    if isinstance(program, Primitive):
        return program
    base, cuts = spine(program)
    if cuts:
        own = [part for cut in cuts for part in parts(cut, "union")]
        new, body = _draw([_draw_in(part, slack, not cuts_out) for part in own], slack, not cuts_out), _draw_in(base, slack, cuts_out)
        return program if new == own and body == base else combine_all("difference", [body, *new])
    own = parts(program, program.op)
    new = [_draw_in(part, slack, cuts_out) for part in own]
    new = _draw(new, slack, cuts_out) if program.op == "union" else new
    return program if new == own else combine_all(program.op, new)


def _draw(items: Sequence[Program], slack: float, cuts_out: bool) -> list[Program]:
    """The same with drawings in place of what they stand for, each where its first part was. Of a cut that two slots share, with a bridge
    across it, each has its own half."""
    halved = [half for item in items for half in _halve(item, slack)]
    apart = _draw_all(halved, slack, cuts_out) if len(halved) > len(items) else list(items)
    return apart if _count_leaves(apart) < _count_leaves(items) else _draw_all(items, slack, cuts_out)


def _count_leaves(items: Sequence[Program]) -> int:
    return sum(1 for item in items for _ in leaves(item))


def _draw_all(items: Sequence[Program], slack: float, cuts_out: bool) -> list[Program]:
    boxes = [(i, p) for i, p in enumerate(items) if isinstance(p, Primitive) and p.kind == "box"]
    tubes = [(i, p) for i, p in enumerate(items) if isinstance(p, Primitive) and p.kind == "cylinder"]
    out: list[Program | None] = list(items)
    for drawing in (*_rectangles(boxes, tubes, slack), *(_slots(boxes, tubes, slack) if cuts_out else ())):
        if all(out[i] is items[i] for i in drawing.members):
            for i in drawing.members:
                out[i] = None
            out[min(drawing.members)] = drawing.prism
    return [p for p in out if p is not None]


def _halve(item: Program, slack: float) -> list[Program]:
    """The two boxes that a box right across another one leaves of it, and what is cut out of that box; anything else as it is."""
    whole, cuts = spine(item)
    bridge, ends = spine(cuts[0]) if len(cuts) == 1 else (item, [])
    if not (isinstance(whole, Primitive) and isinstance(bridge, Primitive) and whole.kind == bridge.kind == "box"):
        return [item]
    turn, sizes = exact_rotation(whole), _sizes_in(bridge, whole)
    if sizes is None:
        return [item]
    middle, half, own = turn.T @ np.subtract(bridge.center, whole.center), np.divide(sizes, 2), np.divide(whole.size, 2)
    # how much of it is left on either side, each way
    left = np.array([own - half + middle, own - half - middle])
    ways = np.flatnonzero((left > slack).all(axis=0))
    if len(ways) != 1 or (np.delete(left, ways, axis=1) > slack).any():
        return [item]
    axis = int(ways[0])
    return [
        *(_end(whole, axis, side, float(left[max(side, 0), axis])) for side in (-1, 1)),
        *(part for end in ends for part in parts(end, "union")),
    ]


def _end(box: Primitive, axis: int, side: int, length: float) -> Primitive:
    """So much of a box, from its end on one side of an axis."""
    size = tuple(length if k == axis else v for k, v in enumerate(box.size))
    moved = box.center + exact_rotation(box)[:, axis] * side * (box.size[axis] - length) / 2
    return replace(box, size=size, center=vec(moved))


Numbered = Sequence[tuple[int, Primitive]]


def _rectangles(boxes: Numbered, tubes: Numbered, slack: float) -> Iterator[_RoundedPrism]:
    for ((i, one), (j, two)), along in product(combinations(boxes, 2), range(3)):
        if math.dist(one.center, two.center) > slack:
            continue
        sizes = _sizes_in(two, one)
        if sizes is None:
            continue
        frame = _Frame.of(one, along)
        (x, y), (u, v) = (frame.across(size) for size in (one.size, sizes))
        if x < u:
            x, y, u, v = u, v, x, y
        radius = (x - u) / 2
        if radius <= slack or abs((v - y) / 2 - radius) > slack:
            continue
        a, b, c, d = x / 2, v / 2, u / 2, y / 2
        found = [frame.tube_at(tubes, side * c, way * d, radius, slack) for side, way in product((-1, 1), repeat=2)]
        if None not in found:
            lower = ((-c, -b, 0.0), (c, -b, QUARTER), (a, -d, 0.0), (a, d, QUARTER))
            loop = (*lower, (c, b, 0.0), (-c, b, QUARTER), (-a, d, 0.0), (-a, -d, QUARTER))
            yield _RoundedPrism(frame.extrude(loop), frozenset({i, j, *(k for k in found if k is not None)}))


def _slots(boxes: Numbered, tubes: Numbered, slack: float) -> Iterator[_RoundedPrism]:
    for (i, box), along, upright in product(boxes, range(3), (False, True)):
        frame = _Frame.of(box, along)
        a, r = (size / 2 for size in frame.across(box.size)[:: -1 if upright else 1])
        ends = [(0.0, side * a) if upright else (side * a, 0.0) for side in (-1, 1)]
        found = [frame.tube_at(tubes, *end, r, slack) for end in ends]
        if None not in found:
            level = ((-a, -r, 0.0), (a, -r, 1.0), (a, r, 0.0), (-a, r, 1.0))
            loop = ((r, -a, 0.0), (r, a, 1.0), (-r, a, 0.0), (-r, -a, 1.0)) if upright else level
            yield _RoundedPrism(frame.extrude(loop), frozenset({i, *(k for k in found if k is not None)}))


@dataclass(frozen=True)
class _Frame:
    """A box seen along one of its axes, as a drawing on it lies: x as near to the world's x as may be, and the axis looks up it."""

    box: Primitive
    order: tuple[int, int, int]
    columns: np.ndarray

    @staticmethod
    def of(box: Primitive, along: int) -> _Frame:
        turn = exact_rotation(box)
        up = turn[:, along] * math.copysign(1.0, turn[np.argmax(np.abs(turn[:, along])), along])
        others = [k for k in range(3) if k != along]
        # of two that are as near, the one nearer to the world's y
        first = max(others, key=lambda k: (round(abs(float(turn[0, k])), 9), round(abs(float(turn[1, k])), 9)))
        x = turn[:, first] * math.copysign(1.0, turn[np.argmax(np.abs(turn[:, first])), first])
        return _Frame(box, (first, sum(others) - first, along), np.column_stack([x, np.cross(up, x), up]))

    def across(self, size: Sequence[float]) -> tuple[float, float]:
        return size[self.order[0]], size[self.order[1]]

    def tube_at(self, tubes: Numbered, x: float, y: float, radius: float, slack: float) -> int | None:
        """The number of the cylinder of a radius about the drawing's normal at a place, if there is one."""
        place = self.box.center + self.columns @ (x, y, 0.0)
        for i, tube in tubes:
            axis = exact_rotation(tube)[:, 2]
            away = place - tube.center
            height = float(away @ axis)
            is_there = np.linalg.norm(away - height * axis) <= slack and abs(height) < tube.size[1] / 2
            if is_there and abs(tube.size[0] - radius) <= slack and abs(float(axis @ self.columns[:, 2])) > 1 - ALIGNED:
                return i
        return None

    def extrude(self, loop: tuple[tuple[float, float, float], ...]) -> Primitive:
        return Primitive("extrude", (self.box.size[self.order[2]],), self.box.center, euler_from_matrix(self.columns), Outline((loop,)))


def _sizes_in(box: Primitive, frame: Primitive) -> tuple[float, ...] | None:
    """The sizes of a box along the axes of another one; None where it is turned against it."""
    out = []
    for direction in exact_rotation(frame).T:
        own = np.flatnonzero(np.abs(exact_rotation(box).T @ direction) > 1 - ALIGNED)
        if not len(own):
            return None
        out.append(box.size[own[0]])
    return tuple(out)
