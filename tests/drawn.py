"""Outlines as people draw them, with the numbers that they typed: a filleted bracket, a plate with slots, a gear, a hexagon."""

import math
from collections.abc import Sequence

import numpy as np

from imdim.program.outline import Loop, Outline, circle
from imdim.program.tree import Combine, Primitive

QUARTER = math.tan(math.pi / 8)
BRACKET = Outline(
    (
        ((0, 12, QUARTER), (12, 0, 0), (60, 0, 0), (60, 10, 0), (16, 10, -QUARTER), (10, 16, 0), (10, 40, 0), (0, 40, 0)),
        circle(2.75, 50, 5),
        circle(2.75, 5, 33),
    )
)
NOZZLE = Outline((((0, -20, 0), (18, -20, 0), (18, -5, 0), (7, 5, 0), (7, 20, 0), (0, 20, 0)),))  # to be turned
# as points of other parts bend it
BENT_NOZZLE = Outline(
    (
        (
            (0, -20, 0),
            (18, -20.3, 0),
            (18.2, -15, 0),
            (19.5, -13, 0.3),
            (18.1, -11, 0),
            (17.8, -5.5, 0),
            (7.4, 5, 0),
            (7, 20, 0),
            (0, 20.2, 0),
        ),
    )
)


def slot(x: float, y: float, length: float, radius: float, upright: bool = False) -> Loop:
    """A hole with half round ends, whose middles are `length` apart."""
    a = length / 2
    corners = [(-a, -radius, 0.0), (a, -radius, 1.0), (a, radius, 0.0), (-a, radius, 1.0)]
    return tuple((x - v, y + u, b) if upright else (x + u, y + v, b) for u, v, b in corners)


SLOTTED = Outline((((0, 0, 0), (100, 0, 0), (100, 60, 0), (0, 60, 0)), slot(25, 20, 20, 2.75), slot(70, 35, 14, 4, True)))


def gear(teeth: int = 12, tip: float = 40.0, root: float = 34.0, x: float = 10.0, y: float = -20.0) -> Outline:
    """Arcs of two circles in turn, with radial sides, and a round bore."""
    ring, half = [], math.pi / teeth
    for k in range(2 * teeth):
        radius = tip if k % 2 else root
        for angle, bulge in ((k * half, math.tan(half / 4)), ((k + 1) * half, 0.0)):
            ring.append((x + radius * math.cos(angle), y + radius * math.sin(angle), bulge))
    return Outline((tuple(ring), circle(8, x, y)))


def hexagon(across_flats: float = 19.0, x: float = 7.5, y: float = 3.0) -> Outline:
    radius = across_flats / 2 / math.cos(math.pi / 6)
    angles = [math.radians(60 * k + 30) for k in range(6)]
    return Outline((tuple((x + radius * math.cos(a), y + radius * math.sin(a), 0.0) for a in angles), circle(5, x, y)))


def rounded_off(corners: Sequence[tuple[float, float]], radius: float) -> Loop:
    """A polygon, counter-clockwise and convex, whose corners are rounded off."""
    loop = []
    for k, (x, y) in enumerate(corners):
        (a, b), (c, d) = corners[k - 1], corners[(k + 1) % len(corners)]
        ways = [((u - x) / math.dist((u, v), (x, y)), (v - y) / math.dist((u, v), (x, y))) for u, v in ((a, b), (c, d))]
        inside = math.acos(sum(p * q for p, q in zip(*ways, strict=True)))
        off = radius / math.tan(inside / 2)
        ends = [(x + off * u, y + off * v) for u, v in ways]
        loop += [(*ends[0], math.tan((math.pi - inside) / 4)), (*ends[1], 0.0)]
    return tuple(loop)


CROOKED = Outline((rounded_off(((-40, -30), (35, -36), (50, 0), (38, 34), (-20, 40), (-45, 10)), 4), ((-8, -9, 0), (9, -4, 0), (2, 11, 0))))
DRAWN = {"crooked": CROOKED, "bracket": BRACKET, "slots": SLOTTED, "gear": gear(), "hexagon": hexagon()}


def noisy(outline: Outline, share: float, rng: np.random.Generator) -> Outline:
    """All coordinates off by up to a share of the extent, bulges by that share of themselves."""
    (left, low), (right, high) = outline.bounds
    extent = max(right - left, high - low)

    def off() -> float:
        return float(rng.uniform(-share, share))

    return Outline(tuple(tuple((x + extent * off(), y + extent * off(), b * (1 + off())) for x, y, b in loop) for loop in outline.loops))


def centred(outline: Outline, height: float, z: float = 0.0) -> Primitive:
    """The outline extruded where it is drawn, its middle being the leaf's centre."""
    (left, low), (right, high) = outline.bounds
    x, y = (left + right) / 2, (low + high) / 2
    return Primitive("extrude", (height,), (x, y, z), (0.0, 0.0, 0.0), outline.shift(-x, -y))


PULLEY = Primitive(
    "revolve", (360.0,), (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), Outline((((4, -5, 0), (20, -5, 0), (15, 0, 0), (20, 5, 0), (4, 5, 0)),))
)
BORED = Combine("difference", centred(BRACKET, 8.0, 4.0), Primitive("cylinder", (3.0, 20.0), (30.0, 5.0, 4.0)))
