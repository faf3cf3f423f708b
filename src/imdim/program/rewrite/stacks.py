"""Turned bodies as a person stacks them: cylinders and cones one upon the other, less those that are bored.

A search for the shortest program says a double cone on a shaft by what two long cones and a cylinder have in common, which reach far
beyond the part, and a shaft with two collars by rings cut out of a cutter. Such parts of one axis are a profile: a radius at each height.
Here that profile is read off the program, and each of its walls becomes one cylinder or cone that ends where the wall does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from imdim.program.rewrite.containment import axes, dot
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import OPS, Combine, Op, Primitive, Program, Vec3, combine_all, fold, leaves, longest

ALIGNED = 1e-9  # by which the cosine between two axes may lack of 1
TOUCH = 1e-6  # of the largest size: two places, or two radii, are one
DIGITS = 9  # of the largest size, that computed ends are rounded to


class _Axis(NamedTuple):
    """A line through `point` along the unit `direction`, which is the local z of `rotation`."""

    point: Vec3
    direction: Vec3
    rotation: Vec3


class _Turned(NamedTuple):
    """A program, and the axis that all of it is turned about, if it is."""

    program: Program
    axis: _Axis | None


@dataclass(frozen=True)
class _RoundWall:
    """A round wall of radius `start` + `slope` z from z = `low` to `high` along an axis."""

    low: float
    high: float
    start: float
    slope: float

    def radius(self, z: float) -> float:
        return self.start + self.slope * z

    def is_like(self, other: _RoundWall, slack: float) -> bool:
        """Whether both are of one cylinder or cone, as far as either goes."""
        ends = (min(self.low, other.low), max(self.high, other.high))
        return all(abs(self.radius(z) - other.radius(z)) <= slack for z in ends)


class _Slab(NamedTuple):
    """Material from z = `low` to `high`, between two walls, or from the axis on."""

    low: float
    high: float
    inner: _RoundWall | None
    outer: _RoundWall


def stack_turned_parts(program: Program) -> Program:
    """The same solid, in which parts of one axis that are not merely joined and cut, each by one cylinder or cone, become so, where that
    takes no more of these. Ends that are computed so have nine digits."""

    def leaf(_: int, p: Primitive) -> _Turned:
        if p.kind not in ("cylinder", "cone"):
            return _Turned(p, None)
        return _Turned(p, _Axis(p.center, axes(p)[2], p.rotation))

    slack = TOUCH * longest(leaves(program))

    def join(op: Op, a: _Turned, b: _Turned) -> _Turned:
        if a.axis is not None and b.axis is not None and _is_one(a.axis, b.axis, slack):
            return _Turned(Combine(op, a.program, b.program), a.axis)
        return _Turned(Combine(op, _stacked(a, slack), _stacked(b, slack, cuts=op == "difference")), None)

    return _stacked(fold(program, leaf, {op: (lambda a, b, op=op: join(op, a, b)) for op in OPS}), slack)


def _is_one(a: _Axis, b: _Axis, slack: float) -> bool:
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
    outer = _pieces([replace(s.outer, low=s.low, high=s.high) for s in slabs], slack)
    inner = _pieces([replace(s.inner, low=s.low, high=s.high) for s in slabs if s.inner], slack)
    if len(outer) + len(inner) > len(list(leaves(program))):
        return program
    digits = DIGITS - 1 - math.floor(math.log10(longest(leaves(program))))
    body = combine_all("union", [_leaf(wall, axis, digits) for wall in outer])
    return combine_all("difference", [body, *(_leaf(wall, axis, digits) for wall in inner)])


def _is_plain(program: Program, cuts: bool) -> bool:
    """Whether leaves are joined and leaves are cut, and none is cut out of what `cuts` itself."""
    base, own = spine(program)
    return not (cuts and own) and all(isinstance(part, Primitive) for node in (base, *own) for part in parts(node, "union"))


def _profile(program: Program, axis: _Axis, slack: float) -> list[_Slab] | None:
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


def _wall(leaf: Primitive, axis: _Axis) -> _RoundWall:
    x, y, z = (c - p for c, p in zip(leaf.center, axis.point, strict=True))
    middle, height = dot((x, y, z), axis.direction), leaf.size[-1]
    bottom, top = leaf.size[0], leaf.size[-2]
    if dot(axes(leaf)[2], axis.direction) < 0:
        bottom, top = top, bottom
    slope = (top - bottom) / height
    return _RoundWall(middle - height / 2, middle + height / 2, (bottom + top) / 2 - slope * middle, slope)


def _crossings(walls: Sequence[_RoundWall]) -> Iterator[float]:
    for a, b in combinations(walls, 2):
        if a.slope != b.slope:
            z = (b.start - a.start) / (a.slope - b.slope)
            if max(a.low, b.low) < z < min(a.high, b.high):
                yield z


def _pieces(walls: Sequence[_RoundWall], slack: float) -> list[_RoundWall]:
    """One cylinder or cone for each wall, from bottom to top. A cylinder goes on through what is wider above and below it, and is one with
    those that it meets there."""
    joined: list[_RoundWall] = []
    for wall in walls:
        if joined and abs(joined[-1].high - wall.low) <= slack and joined[-1].is_like(wall, slack):
            joined[-1] = replace(joined[-1], high=wall.high)
        else:
            joined.append(wall)
    out: list[_RoundWall] = []
    for i, wall in enumerate(joined):
        if wall.slope == 0:
            below, above = joined[:i][::-1], joined[i + 1 :]
            for other in below:
                if abs(other.high - wall.low) > slack or not _is_wider(other, wall, slack):
                    break
                wall = replace(wall, low=other.low)
            for other in above:
                if abs(other.low - wall.high) > slack or not _is_wider(other, wall, slack):
                    break
                wall = replace(wall, high=other.high)
        if not any(wall.slope == 0 == other.slope and other.is_like(wall, slack) and _holds(other, wall, slack) for other in out):
            out.append(wall)
    return out


def _is_wider(wall: _RoundWall, cylinder: _RoundWall, slack: float) -> bool:
    return min(wall.radius(wall.low), wall.radius(wall.high)) >= cylinder.start - slack


def _holds(long: _RoundWall, short: _RoundWall, slack: float) -> bool:
    return long.low <= short.low + slack and long.high >= short.high - slack


def _leaf(wall: _RoundWall, axis: _Axis, digits: int) -> Primitive:
    low, high = (round(z, digits) for z in (wall.low, wall.high))
    x, y, z = (p + d * (low + high) / 2 for p, d in zip(axis.point, axis.direction, strict=True))
    bottom, top = (max(round(wall.radius(end), digits), 0.0) for end in (wall.low, wall.high))
    if bottom == top:
        return Primitive("cylinder", (bottom, high - low), (x, y, z), axis.rotation)
    return Primitive("cone", (bottom, top, high - low), (x, y, z), axis.rotation)
