"""Outliers of a pattern take the numbers of the others, as a box among pins becomes a pin.

Where three equal primitives are corners of a rectangle, or stand in a row, and at the next place of that pattern, or a free one between,
stands another primitive of nearly the same extent, that one becomes a copy of them if the target says that this is better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.solid import corners_of, primitive_to_manifold, to_manifold
from imdim.program.outline import are_near
from imdim.program.patterns.congruence import group_by_fit, node_of, same_shape
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, Vec3, envelope, leaves, replace_leaves
from imdim.program.vectors import dot, minus, plus, times

NEAR = 0.15  # of a primitive's own extent, by which its substitute may differ from it
SEGMENTS = 32
MOST = 40  # equal primitives


def regularise_outliers(program: Program, tolerance: float, score: Callable[[Program], float], deadline: Deadline = NEVER) -> Program:
    """The program with odd ones like their fellows, which agree within `tolerance`, where that has a higher `score`."""
    solid = corners_of(to_manifold(program, SEGMENTS))
    parts, sign, out = list(leaves(program)), signs(program), program
    if not len(solid):
        return program
    for group in _groups(parts, sign, tolerance):
        for place in _next_places([parts[i].center for i in group], tolerance):
            like = replace(parts[group[0]], center=place)
            odd = [i for i, p in enumerate(parts) if i not in group and sign[i] == sign[group[0]] and _is_nearly(p, like, solid)]
            if len(odd) != 1 or deadline.has_passed():
                continue
            trial = replace_leaves(out, {odd[0]: like})
            if score(trial) > score(out):
                out = trial
    return out


def _groups(parts: list[Primitive], sign: list[int], tolerance: float) -> list[list[int]]:
    """Numbers of primitives that are equal but for their place, three or more."""
    groups = group_by_fit(range(len(parts)), lambda g, i: sign[g[0]] == sign[i] and _are_equal(parts[g[0]], parts[i], tolerance))
    return [g for g in groups if 3 <= len(g) <= MOST]


def _are_equal(a: Primitive, b: Primitive, tolerance: float) -> bool:
    there = replace(b, center=a.center)
    alike = same_shape(node_of(a), node_of(b), tolerance) and are_near(a.outline, b.outline, tolerance)
    return alike and bool(np.abs(PosedPrimitive(a).corners - PosedPrimitive(there).corners).max() <= 2 * tolerance)


def _next_places(at: list[Vec3], tolerance: float) -> Iterator[Vec3]:
    """Fourth corners of rectangles, and what comes next in rows or between, where there is none of `at`."""
    done: list[Vec3] = []
    for a, b, c in permutations(at, 3):
        u, v = minus(b, a), minus(c, a)
        if abs(dot(u, v)) <= tolerance * math.hypot(*v):
            place = plus(b, v)
        elif math.dist(v, times(u, 2.0)) <= 2 * tolerance:
            place = plus(c, u)
        elif math.dist(v, times(u, 3.0)) <= 3 * tolerance:
            place = plus(b, u)
        else:
            continue
        if all(math.dist(place, p) > 4 * tolerance for p in (*at, *done)):
            done.append(place)
            yield place


def _is_nearly(p: Primitive, like: Primitive, solid: np.ndarray) -> bool:
    """Whether two primitives fill nearly the same box along the axes of the first, as far as the solid's corners [n, 3] reach there."""
    turn, far = PosedPrimitive(p).rotation, max(envelope(p).size) + max(envelope(like).size)
    if math.dist(p.center, like.center) > far:
        return False
    room = _reach(solid @ turn)
    mine, its = (np.clip(_reach(corners_of(primitive_to_manifold(q, SEGMENTS)) @ turn), *room) for q in (p, like))
    return bool((np.abs(mine - its) <= NEAR * np.ptp(its, axis=0)).all())


def _reach(points: np.ndarray) -> np.ndarray:
    """Low and high corner [2, 3]."""
    return np.stack([points.min(axis=0), points.max(axis=0)])
