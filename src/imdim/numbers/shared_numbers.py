"""Places and radii of several leaves that are one but for a hair: rounding a leaf at a time parts what was drawn as one.

A place is that of a box's side, of the end of a cylinder, cone or extrusion, of an axis or a centre, or of a straight wall of an outline.
Radii are those of leaves, of arcs and of the walls that a turned outline has along its axis, among the other lengths of leaves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import LENGTH, Values, decimal, grids, is_level, plainest_first, round_to_grid
from imdim.numbers.outline_grids import OutlineGrids
from imdim.numbers.outline_values import redraw_leaf
from imdim.program.outline import arc_radius, ring_curves
from imdim.program.tree import ACROSS, Primitive, longest

ONE = 1e-10  # of the largest size, within which numbers are one already: what arcs keep of their radius
SAME_LENGTH = 1.5e-3  # of a length: small ones that differ by more are two, however large the part
BEYOND = 0.2  # of how far numbers are apart: by how much the one in their place may lie outside
FINE = 1e-7  # of a leaf's largest size: about what texts tell apart
KEPT = 1024  # leaves with a number at its target: where not all numbers can be, halves of them are tried

Parts = tuple[Primitive, ...]
Number = tuple[int, float]  # the axis of the world along which a place is, or LENGTH for a length; and its value


@dataclass(frozen=True)
class SharedNumber:
    """The numbers of one class from `low` to `high` are to be the `target`, which lies between them or hardly beyond."""

    kind: int
    low: float
    high: float
    target: float

    def holds(self, number: Number) -> bool:
        """Whether it is one of them and not yet the target."""
        kind, value = number
        return kind == self.kind and self.low <= value <= self.high and value != self.target


def find_split_numbers(parts: Sequence[Primitive], hair: float) -> list[SharedNumber]:
    """Places along one axis, and lengths, that differ by no more than a hair from the next one, of short lengths by less; each is to be
    the roundest number between them."""
    found, one = [], ONE * longest(parts)
    numbers = {number for leaf in parts for number in _numbers(leaf)}
    for kind in range(LENGTH + 1):
        values = np.array(sorted(value for its, value in numbers if its == kind))
        near = np.minimum(hair, SAME_LENGTH * values[1:]) if kind == LENGTH else hair
        groups = np.split(values, np.flatnonzero(np.diff(values) > near) + 1)
        found += [
            SharedNumber(kind, float(group[0]), float(group[-1]), _roundest(float(group[0]), float(group[-1])))
            for group in groups
            if len(group) and np.ptp(group) > one
        ]
    return found


def find_parted_lengths(before: Sequence[Primitive], after: Sequence[Primitive], slack: float) -> list[list[SharedNumber]]:
    """Lengths of several leaves that were equal `before`, within the slack, and are no longer `after`: for each group of them what they may
    be instead, the plainest of what they are now first. Leaves that are read otherwise now are left out."""
    pairs: list[tuple[float, float]] = []
    for old, new in zip(before, after, strict=True):
        were, are = (sorted(value for kind, value in _numbers(leaf) if kind == LENGTH) for leaf in (old, new))
        pairs += zip(were, are, strict=True) if len(were) == len(are) else ()
    pairs.sort()
    values = np.array(pairs).reshape(-1, 2)
    groups = np.split(values[:, 1], np.flatnonzero(np.diff(values[:, 0]) > slack) + 1)
    parted = (group for group in groups if len(group) and np.ptp(group) > ONE * longest(after))
    return [[SharedNumber(LENGTH, group.min(), group.max(), target) for target in plainest_first(group)] for group in parted]


def _roundest(low: float, high: float) -> float:
    """The multiple of the widest decimal grid that has one from `low` to `high`, or hardly beyond."""
    beyond = BEYOND * (high - low)
    near = (round_to_grid((low + high) / 2, width) for width in grids(2 * max(abs(low), abs(high)), (high - low) / 10))
    return next((number for number in near if low - beyond <= number <= high + beyond), low)


def share_number(parts: Parts, shared: SharedNumber) -> Parts:
    """The leaves with the numbers that are `shared` at their target; those that would have no size are left."""
    return tuple(_share(leaf, shared) for leaf in parts)


@lru_cache(KEPT)
def _share(leaf: Primitive, shared: SharedNumber) -> Primitive:
    values = Values.of([leaf])
    index = [i for i, number in enumerate(_read(values)) if shared.holds(number)]
    moved = values.with_numbers((np.array(index, int), shared.target)).primitives_or_none()
    leaf = moved[0] if moved else leaf
    if not any(map(shared.holds, _drawn_numbers(leaf))):
        return leaf
    levels: list[tuple[float, ...]] = [(), ()]
    frame = np.round(matrix_from_euler(leaf.rotation))
    for c, column in _drawn_axes(leaf):
        if shared.kind != LENGTH and frame[shared.kind, column]:
            levels[c] = (float(frame[shared.kind, column]) * shared.target,)
    radii = (shared.target,) if shared.kind == LENGTH else ()
    if leaf.kind == "revolve":
        levels[0] = radii
    # radii and centres that no longer are what they were keep no more digits than tell them
    fine = FINE * 10.0 ** math.floor(math.log10(longest([leaf])))
    slack = fine + max(abs(shared.target - shared.low), abs(shared.high - shared.target))
    return redraw_leaf(leaf, lambda _: OutlineGrids((fine,), (), slack, 0.0, (levels[0], levels[1]), radii), stays=True)


def _numbers(leaf: Primitive) -> Iterator[Number]:
    yield from _read(Values.of([leaf]))
    yield from _drawn_numbers(leaf)


def _read(values: Values) -> Iterator[Number]:
    """Classes and values of a leaf, of which the first three classes are axes of the world."""
    return zip(values.classes.tolist(), map(decimal, values.numbers.tolist()), strict=True)


def _drawn_numbers(leaf: Primitive) -> Iterator[Number]:
    """Where the straight walls of an outline are along the axes of the world, if the leaf lies along these, and the radii of its arcs and,
    of a turned one, of its walls along the axis."""
    if leaf.outline is None:
        return
    curves = [curve for loop in leaf.outline.rings for curve in ring_curves(loop)]
    yield from ((LENGTH, decimal(arc_radius(curve))) for curve in curves if curve[4])
    if leaf.kind == "revolve":
        yield from ((LENGTH, decimal(curve[0])) for curve in curves if not curve[4] and curve[0] == curve[2] > 0)
    if not is_level(leaf):
        return
    frame = np.round(matrix_from_euler(leaf.rotation))
    for c, column in _drawn_axes(leaf):
        axis = int(np.abs(frame[:, column]).argmax())
        at = (leaf.center[axis] + frame[axis, column] * curve[c] for curve in curves if not curve[4] and curve[c] == curve[2 + c])
        yield from ((axis, decimal(place)) for place in at)


def _drawn_axes(leaf: Primitive) -> tuple[tuple[int, int], ...]:
    """The axes of an outline and of its leaf's frame that are one, without that which says how far from its axis a turned one is."""
    return ((0, 0), (1, 1)) if leaf.kind in ACROSS else ((1, 2),)
