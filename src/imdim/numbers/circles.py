"""Circles of equal primitives, rounded as circles: places on one are round numbers at a few angles only, and rounding each parts them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from imdim.numbers.design_values import grids, round_to_grid
from imdim.program.motions import move_leaf, turn
from imdim.program.patterns.detect import extent, fold_repeats
from imdim.program.repeats import Repeat, repeats
from imdim.program.rewrite.containment import axes, dot
from imdim.program.tree import Primitive, Program, Vec3, leaves, map_leaves
from imdim.program.vectors import minus, plus, times, unit

SAME = 1e-9  # of the part's size
MOST, FINEST = 1e-3, 1e-5  # of it: by how much a radius is rounded at most, and to what at least
ON_AXIS = 1e-6  # of it, within which an axis is that of another leaf


def round_circles(before: Program, after: Program, bears: Callable[[Program], bool]) -> Program:
    """`after`, which is `before` with rounder numbers, with the circles that this parted: the copies of one leaf have its sizes again and
    stand about one centre at one distance, the roundest that `bears`. A circle that bears none stays parted."""
    folding = fold_repeats(before)
    size = extent(before)
    for number, repeat in () if folding is None else repeats(folding.folded):
        if repeat.kind != "circular" or not isinstance(repeat.part, Primitive):
            continue
        assert folding is not None
        members = folding.order[number : number + repeat.number]
        new = list(leaves(after))
        for trial in _circles(repeat, list(leaves(before)), new, members, size):
            if all(_is_as(trial[i], new[i], SAME * size) for i in members):
                break
            whole = map_leaves(after, lambda i, leaf, trial=trial: trial.get(i, leaf))
            if bears(whole):
                after = whole
                break
    return after


def _circles(
    repeat: Repeat, old: list[Primitive], new: list[Primitive], members: tuple[int, ...], size: float
) -> Iterator[dict[int, Primitive]]:
    """The members by their numbers, the roundest radius first."""
    hub = _hub(repeat, old, new, members, size)
    # what is turned least is as round as it was
    first = min(range(len(members)), key=lambda k: sorted(map(abs, minus(old[members[k]].center, repeat.point))))
    leaf = replace(old[members[first]], size=new[members[first]].size)
    lift = times(repeat.axis, dot(minus(new[members[first]].center, hub), repeat.axis))
    arm = minus(old[members[first]].center, repeat.point)
    arm = minus(arm, times(repeat.axis, dot(arm, repeat.axis)))
    radius = math.hypot(*arm)
    for grid in (*grids(size, FINEST * size), 0.0):
        rounded = round_to_grid(radius, grid) if grid else radius
        if abs(rounded - radius) <= MOST * size:
            placed = replace(leaf, center=plus(plus(hub, lift), times(unit(arm), rounded)))
            yield {i: move_leaf(placed, turn(hub, repeat.axis, repeat.angle * (k - first))) for k, i in enumerate(members)}


def _hub(repeat: Repeat, old: list[Primitive], new: list[Primitive], members: tuple[int, ...], size: float) -> Vec3:
    """Where the axis of a circle is after rounding: where that of a leaf that had the same one is."""
    for i, leaf in enumerate(old):
        off = minus(leaf.center, repeat.point)
        aside = minus(off, times(repeat.axis, dot(off, repeat.axis)))
        if i not in members and math.hypot(*aside) <= ON_AXIS * size and abs(dot(axes(leaf)[2], repeat.axis)) > 1 - SAME:
            return new[i].center
    return repeat.point


def _is_as(a: Primitive, b: Primitive, slack: float) -> bool:
    sizes = max(abs(s - t) for s, t in zip(a.size, b.size, strict=True))
    return a.rotation == b.rotation and max(math.dist(a.center, b.center), sizes) <= slack
