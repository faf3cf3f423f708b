"""Round walls about an axis, and the cylinders and cones that a stack of them is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from imdim.program.tree import Primitive, Vec3

DIGITS = 9  # of the largest size, that computed ends are rounded to


class Axis(NamedTuple):
    """A line through `point` along the unit `direction`, which is the local z of `rotation`."""

    point: Vec3
    direction: Vec3
    rotation: Vec3


@dataclass(frozen=True)
class TurnedWall:
    """A round wall of radius `start` + `slope` z from z = `low` to `high` along an axis."""

    low: float
    high: float
    start: float
    slope: float

    def radius(self, z: float) -> float:
        return self.start + self.slope * z

    def is_like(self, other: TurnedWall, slack: float) -> bool:
        """Whether both are of one cylinder or cone, as far as either goes."""
        ends = (min(self.low, other.low), max(self.high, other.high))
        return all(abs(self.radius(z) - other.radius(z)) <= slack for z in ends)


def decimals_for(size: float) -> int:
    """Decimals of the ends that are computed in a program whose largest size is `size`."""
    return DIGITS - 1 - math.floor(math.log10(size))


def join_walls(walls: Sequence[TurnedWall], slack: float) -> list[TurnedWall]:
    """One cylinder or cone for each wall, from bottom to top. A cylinder goes on through what is wider above and below it, and is one with
    those that it meets there."""
    joined: list[TurnedWall] = []
    for wall in walls:
        if joined and abs(joined[-1].high - wall.low) <= slack and joined[-1].is_like(wall, slack):
            joined[-1] = replace(joined[-1], high=wall.high)
        else:
            joined.append(wall)
    out: list[TurnedWall] = []
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


def _is_wider(wall: TurnedWall, cylinder: TurnedWall, slack: float) -> bool:
    return min(wall.radius(wall.low), wall.radius(wall.high)) >= cylinder.start - slack


def _holds(long: TurnedWall, short: TurnedWall, slack: float) -> bool:
    return long.low <= short.low + slack and long.high >= short.high - slack


def wall_leaf(wall: TurnedWall, axis: Axis, digits: int) -> Primitive:
    """The cylinder or cone that has a wall, its numbers rounded to `digits` decimals."""
    low, high = (round(z, digits) for z in (wall.low, wall.high))
    x, y, z = (p + d * (low + high) / 2 for p, d in zip(axis.point, axis.direction, strict=True))
    bottom, top = (max(round(wall.radius(end), digits), 0.0) for end in (wall.low, wall.high))
    if bottom == top:
        return Primitive("cylinder", (bottom, high - low), (x, y, z), axis.rotation)
    return Primitive("cone", (bottom, top, high - low), (x, y, z), axis.rotation)
