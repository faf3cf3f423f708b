"""Whole ellipses in a plane: the kind of loop that has no vertices.

Points are told by their eccentric angle t, at which a point lies ``(rx cos t, ry sin t)`` from the centre along the semi-axes.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float]
Conic = tuple[float, float, float, float, float, float]

SETTLED = 1e-15  # of the root, below which a step ends the search for a foot
MOST_STEPS = 60
QUARTER_DEG = 90.0


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Semi-axes `rx` and `ry` about the centre (x, y), the first at `angle` degrees counter-clockwise from the x axis."""

    rx: float
    ry: float
    x: float = 0.0
    y: float = 0.0
    angle: float = 0.0

    def __len__(self) -> int:
        """It is one curve."""
        return 1

    @property
    def along(self) -> Point:
        """The direction of the first semi-axis, exact along the axes of the plane."""
        quarters, rest = divmod(self.angle, QUARTER_DEG)
        c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
        return ((c, s), (-s, c), (-c, -s), (s, -c))[int(quarters) % 4]

    @property
    def plain(self) -> Ellipse:
        """The same one with its first semi-axis at more than -45 and at most 45 degrees: along the axes of the plane the angle is 0."""
        turns = math.ceil(self.angle / QUARTER_DEG - 0.5)
        rx, ry = (self.ry, self.rx) if turns % 2 else (self.rx, self.ry)
        return Ellipse(rx, ry, self.x, self.y, self.angle - QUARTER_DEG * turns + 0.0)


def check_ellipse(e: Ellipse) -> None:
    """Raise ValueError for numbers that are not finite and for semi-axes that are not positive."""
    numbers = (e.rx, e.ry, e.x, e.y, e.angle)
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"an ellipse needs finite numbers, got {numbers}")
    if not min(e.rx, e.ry) > 0:
        raise ValueError(f"an ellipse needs positive semi-axes, got {e.rx:g} and {e.ry:g}")


def ellipse_point(e: Ellipse, t: float) -> Point:
    """The point at the eccentric angle t, in radians."""
    (c, s), u, v = e.along, e.rx * math.cos(t), e.ry * math.sin(t)
    return e.x + c * u - s * v, e.y + s * u + c * v


def ellipse_extent(e: Ellipse) -> Point:
    """How far it reaches from its centre along x and along y."""
    c, s = e.along
    return math.hypot(c * e.rx, s * e.ry), math.hypot(s * e.rx, c * e.ry)


def holds_point(e: Ellipse, x: float, y: float) -> bool:
    """Whether a point lies inside."""
    u, v = _local(e, (x, y))
    return math.hypot(u / e.rx, v / e.ry) < 1


def ellipse_distance(e: Ellipse, point: Point) -> float:
    """Distance of a point to the curve."""
    u, v = _local(e, point)
    return math.dist((abs(u), abs(v)), ellipse_foot(e.rx, e.ry, abs(u), abs(v)))


def ellipse_foot(rx: float, ry: float, x: float, y: float) -> Point:
    """The nearest point, to x, y >= 0, of the ellipse of semi-axes rx and ry along the axes.

    Eberly, "Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid" (2013): with r the squared ratio of the semi-axes, p
    = rx x / ry^2 and q = y / ry, cosine and sine of the foot's eccentric angle are p / (w + r - 1) and q / w, w > 0 being the root of the
    sum of their squares less 1. That falls and is convex in w, so that Newton's method from the left never oversteps.
    """
    if rx < ry:
        v, u = ellipse_foot(ry, rx, y, x)
        return u, v
    r = (rx / ry) ** 2
    p, q = rx * x / (ry * ry), y / ry
    w = max(q, p - r + 1)
    if q == 0.0 and w <= 0.0:
        cosine = p / (r - 1) if r > 1 else 0.0
        return rx * cosine, ry * math.sqrt(1 - cosine * cosine)
    for _ in range(MOST_STEPS):
        a, b = p / (w + r - 1), q / w
        step = (a * a + b * b - 1) / (2 * (a * a / (w + r - 1) + b * b / w))
        w += step
        if step <= SETTLED * w:
            break
    a, b = p / (w + r - 1), q / w
    return rx * a / math.hypot(a, b), ry * b / math.hypot(a, b)


def ellipse_conic(e: Ellipse) -> Conic:
    """Factors of x x, x y, y y, x, y and 1 whose sum is 0 on the curve and negative inside."""
    (c, s), p, q = e.along, e.rx**-2, e.ry**-2
    xx, xy, yy = c * c * p + s * s * q, 2 * c * s * (p - q), s * s * p + c * c * q
    return (
        xx,
        xy,
        yy,
        -2 * xx * e.x - xy * e.y,
        -2 * yy * e.y - xy * e.x,
        xx * e.x * e.x + xy * e.x * e.y + yy * e.y * e.y - 1,
    )


def meet_conic(e: Ellipse, conic: Conic) -> list[Point]:
    """Points of the ellipse at which the sum of a conic's factors is 0, or nearest to it where it only comes near.

    On the ellipse that sum is a trigonometric polynomial of second degree of the eccentric angle, so a polynomial of fourth degree of
    ``exp(i t)``.
    """
    xx, xy, yy, x, y, one = conic
    c, s = e.along
    # a point is its centre + u exp(it) + conj(u) exp(-it) along x, and the same along y
    ux, uy = (e.rx * c + 1j * e.ry * s) / 2, (e.rx * s - 1j * e.ry * c) / 2
    second = xx * ux * ux + xy * ux * uy + yy * uy * uy
    first = (2 * xx * e.x + xy * e.y + x) * ux + (2 * yy * e.y + xy * e.x + y) * uy
    mean = 2 * xx * abs(ux) ** 2 + 2 * xy * (ux * uy.conjugate()).real + 2 * yy * abs(uy) ** 2
    level = mean + xx * e.x * e.x + xy * e.x * e.y + yy * e.y * e.y + x * e.x + y * e.y + one
    form = np.array([second, first, level, first.conjugate(), second.conjugate()])
    largest = np.abs(form).max()
    if not largest > 0:
        return [ellipse_point(e, 0.0)]
    small = np.abs(form) < 1e-14 * largest
    return [ellipse_point(e, cmath.phase(root)) for root in np.roots(np.where(small, 0.0, form)) if root]


def are_near_ellipses(a: Ellipse, b: Ellipse, tolerance: float) -> bool:
    """Whether the centres and the ends of the semi-axes of two ellipses are within a tolerance."""
    one, two = a.plain, b.plain
    # of two at about 45 degrees either way one is turned on by a quarter
    turned = Ellipse(two.ry, two.rx, two.x, two.y, two.angle + math.copysign(QUARTER_DEG, one.angle - two.angle))
    return any(_differ(one, other) <= tolerance for other in (two, turned))


def _differ(a: Ellipse, b: Ellipse) -> float:
    turn = abs(math.sin(math.radians(a.angle - b.angle))) * abs(a.rx - a.ry)
    return max(math.dist((a.x, a.y), (b.x, b.y)), abs(a.rx - b.rx), abs(a.ry - b.ry), turn)


def _local(e: Ellipse, point: Point) -> Point:
    """A point along the semi-axes, from the centre."""
    c, s = e.along
    dx, dy = point[0] - e.x, point[1] - e.y
    return c * dx + s * dy, c * dy - s * dx
