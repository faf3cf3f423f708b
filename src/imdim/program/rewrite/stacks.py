"""Turned bodies as a person stacks them: cylinders and cones one upon the other, less those that are bored.

A search for the shortest program says a double cone on a shaft by what two long cones and a cylinder have in common, which reach far
beyond the part, and a shaft with two collars by rings cut out of a cutter. Such parts of one axis are a profile: a radius at each height.
Here that profile is read off the program, and each of its walls becomes one cylinder or cone that ends where the wall does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.rewrite.turned_walls import Axis, TurnedWall, decimals_for, join_walls, wall_leaf
from imdim.program.tree import OPS, Combine, Op, Primitive, Program, combine_all, fold, leaves, longest
from imdim.program.vectors import dot

ALIGNED = 1e-9  # by which the cosine between two axes may lack of 1
TOUCH = 1e-6  # of the largest size: two places, or two radii, are one


class _Turned(NamedTuple):
    """A program, and the axis that all of it is turned about, if it is."""

    program: Program
    axis: Axis | None


class _Slab(NamedTuple):
    """Material from z = `low` to `high`, between two walls, or from the axis on."""

    low: float
    high: float
    inner: TurnedWall | None
    outer: TurnedWall


def stack_turned_parts(program: Program) -> Program:
    """The same solid, in which parts of one axis that are not merely joined and cut, each by one cylinder or cone, become so, where that
    takes no more of these. Ends that are computed so have nine digits."""

    def leaf(_: int, p: Primitive) -> _Turned:
        if p.kind not in ("cylinder", "cone"):
            return _Turned(p, None)
        return _Turned(p, Axis(p.center, axes(p)[2], p.rotation))

    slack = TOUCH * longest(leaves(program))

    def join(op: Op, a: _Turned, b: _Turned) -> _Turned:
        if a.axis is not None and b.axis is not None and _is_one(a.axis, b.axis, slack):
            return _Turned(Combine(op, a.program, b.program), a.axis)
        return _Turned(Combine(op, _stacked(a, slack), _stacked(b, slack, cuts=op == "difference")), None)

    return _stacked(fold(program, leaf, {op: (lambda a, b, op=op: join(op, a, b)) for op in OPS}), slack)


def _is_one(a: Axis, b: Axis, slack: float) -> bool:
    x, y, z = (q - p for p, q in zip(a.point, b.point, strict=True))
    along = dot((x, y, z), a.direction)
    return abs(dot(a.direction, b.direction)) > 1 - ALIGNED and math.dist((x, y, z), [along * d for d in a.direction]) <= slack


def _stacked(turned: _Turned, slack: float, cuts: bool = False) -> Program:
    """The program of a maximal part that is turned about one axis, and `cuts` or not."""
    program, axis = turned
    if axis is None or _is_plain(program, cuts):
        return program
    slabs = _profile(program, axis, slack)
    if not slabs:
        return program
    outer = join_walls([replace(s.outer, low=s.low, high=s.high) for s in slabs], slack)
    inner = join_walls([replace(s.inner, low=s.low, high=s.high) for s in slabs if s.inner], slack)
    if len(outer) + len(inner) > len(list(leaves(program))):
        return program
    digits = decimals_for(longest(leaves(program)))
    body = combine_all("union", [wall_leaf(wall, axis, digits) for wall in outer])
    return combine_all("difference", [body, *(wall_leaf(wall, axis, digits) for wall in inner)])


def _is_plain(program: Program, cuts: bool) -> bool:
    """Whether leaves are joined and leaves are cut, and none is cut out of what `cuts` itself."""
    base, own = spine(program)
    return not (cuts and own) and all(isinstance(part, Primitive) for node in (base, *own) for part in parts(node, "union"))


def _profile(program: Program, axis: Axis, slack: float) -> list[_Slab] | None:
    """What there is at each height; None where that is more than one ring."""
    walls = [_wall(leaf, axis) for leaf in leaves(program)]
    places = sorted([*(z for wall in walls for z in (wall.low, wall.high)), *_crossings(walls)])
    slabs: list[_Slab] = []
    for low, high in pairwise(places):
        if high - low <= slack:
            continue
        z = (low + high) / 2
        here = sorted((wall for wall in walls if wall.low < z < wall.high), key=lambda wall: wall.radius(z))
        tests = np.array([0.0, *(wall.radius(z) for wall in here)])
        tests = np.append((tests[1:] + tests[:-1]) / 2, tests[-1] + slack)
        held = [np.array([wall.low < z < wall.high]) & (tests < wall.radius(z)) for wall in walls]
        filled = _evaluate(program, held)
        borders = [k for k in range(len(here)) if filled[k] != filled[k + 1] and (k == 0 or tests[k] > here[k - 1].radius(z))]
        if filled[0] and len(borders) == 1:
            slabs.append(_Slab(low, high, None, here[borders[0]]))
        elif not filled[0] and len(borders) == 2:
            slabs.append(_Slab(low, high, here[borders[0]], here[borders[1]]))
        elif filled.any():
            return None
    return slabs


def _evaluate(program: Program, held: Sequence[np.ndarray]) -> np.ndarray:
    """Whether test points lie in the program, from whether they lie in each leaf."""
    return fold(program, lambda i, _: held[i], {"union": np.logical_or, "intersection": np.logical_and, "difference": lambda a, b: a & ~b})


def _wall(leaf: Primitive, axis: Axis) -> TurnedWall:
    x, y, z = (c - p for c, p in zip(leaf.center, axis.point, strict=True))
    middle, height = dot((x, y, z), axis.direction), leaf.size[-1]
    bottom, top = leaf.size[0], leaf.size[-2]
    if dot(axes(leaf)[2], axis.direction) < 0:
        bottom, top = top, bottom
    slope = (top - bottom) / height
    return TurnedWall(middle - height / 2, middle + height / 2, (bottom + top) / 2 - slope * middle, slope)


def _crossings(walls: Sequence[TurnedWall]) -> Iterator[float]:
    for a, b in combinations(walls, 2):
        if a.slope != b.slope:
            z = (b.start - a.start) / (a.slope - b.slope)
            if max(a.low, b.low) < z < min(a.high, b.high):
                yield z
