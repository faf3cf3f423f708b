"""Axes that lie aslant and were one: places on one are round along no axis of the world, and rounding each by itself parts them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from imdim.program.motions import is_round
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Vec3
from imdim.program.vectors import along, cross, dot, minus

ONE_WAY = 1e-9  # sine of the angle between directions that are one, and of one that is along an axis of the world


def find_parted_axes(before: Sequence[Primitive], after: Sequence[Primitive], slack: float) -> Iterator[tuple[int, Primitive]]:
    """Round leaves about slanting axes that were, within the slack, those of other leaves `before` and no longer are `after`, by their
    numbers: each on the axis of that one which has moved least across it."""
    rounds = [i for i, leaf in enumerate(after) if is_round(leaf) and _slants(axes(leaf)[2])]
    moved = {i: _aside(minus(after[i].center, before[i].center), axes(after[i])[2]) for i in rounds}
    for i in rounds:
        way = axes(after[i])[2]
        others = [
            j for j in rounds if moved[j] < moved[i] and _are_one(before[i], before[j], slack) and _is_parallel(way, axes(after[j])[2])
        ]
        other = min(others, key=lambda j: moved[j], default=None)
        if other is None:
            continue
        apart = minus(after[i].center, after[other].center)
        if _aside(apart, way) > ONE_WAY * max(after[i].size):
            yield i, replace(after[i], center=along(after[other].center, way, dot(apart, way)))


def _slants(way: Vec3) -> bool:
    return max(map(abs, way)) < 1 - ONE_WAY


def _are_one(a: Primitive, b: Primitive, slack: float) -> bool:
    way = axes(a)[2]
    return math.hypot(*cross(way, axes(b)[2])) * max(a.size) <= slack and _aside(minus(a.center, b.center), way) <= slack


def _is_parallel(one: Vec3, other: Vec3) -> bool:
    return math.hypot(*cross(one, other)) <= ONE_WAY


def _aside(step: Vec3, way: Vec3) -> float:
    """How far a step leads across a direction."""
    return math.hypot(*cross(way, step))
