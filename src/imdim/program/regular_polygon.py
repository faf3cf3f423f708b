"""Loops that are regular polygons: told by a count of sides, a centre, a radius and an angle, as the sockets of nuts are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Point, Ring

DECIMALS = 6  # of lengths in the texts
WHOLE = 1e-6  # degrees, or of a sine, by which an angle may miss a round one


@dataclass(frozen=True)
class RegularPolygon:
    """`angle` says in degrees where its first corner is seen from the centre, at most a step from the x axis; `radius` is that of the
    circle through its corners."""

    sides: int
    radius: float
    center: Point
    angle: float

    @property
    def across_flats(self) -> float:
        """Twice the radius of the circle that its sides touch."""
        return 2 * self.radius * math.cos(math.pi / self.sides)

    @property
    def is_measured_across_flats(self) -> bool:
        """Whether that is what a person gave: sides that face each other, apart by a number with fewer decimals than the radius has."""
        return self.sides % 2 == 0 and _count_decimals(self.across_flats) < _count_decimals(self.radius)

    def ring(self) -> Ring:
        """Its corners, counter-clockwise."""
        turns = (math.radians(self.angle + 360 * k / self.sides) for k in range(self.sides))
        return tuple((self.center[0] + self.radius * math.cos(t), self.center[1] + self.radius * math.sin(t), 0.0) for t in turns)


def _count_decimals(length: float) -> int:
    """The decimals that a length is written with."""
    return len(f"{length:.{DECIMALS}f}".rstrip("0").partition(".")[2])


def regular_of(loop: Loop, slack: float) -> RegularPolygon | None:
    """The regular polygon that a loop of lines is, within `slack`; rectangles along the axes are none."""
    n = len(loop)
    if isinstance(loop, Ellipse) or n < 3 or any(bulge for _, _, bulge in loop):
        return None
    x, y = (sum(v[axis] for v in loop) / n for axis in (0, 1))
    radius = sum(math.hypot(u - x, v - y) for u, v, _ in loop) / n
    (ax, ay), (bx, by) = ((u - x, v - y) for u, v, _ in loop[:2])
    way = 1 if ax * by - ay * bx > 0 else -1
    step, first = 2 * math.pi / n, math.atan2(loop[0][1] - y, loop[0][0] - x)
    corners = [(x + radius * math.cos(first + way * k * step), y + radius * math.sin(first + way * k * step)) for k in range(n)]
    is_level = n == 4 and abs(math.sin(2 * first)) > 1 - WHOLE
    if is_level or any(math.dist(corner, v[:2]) > slack for corner, v in zip(corners, loop, strict=True)):
        return None
    angle = math.degrees(first) % (360 / n)
    return RegularPolygon(n, radius, (x, y), angle if 360 / n - angle > WHOLE else 0.0)
