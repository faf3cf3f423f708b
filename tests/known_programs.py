"""Programs whose exact volume is known in closed form: the truth that every backend is held against.

Import `KNOWN` (name -> program, volume), `DRAWN` with those that have outlines, or `EVERY` with both.
Rotations and centres are deliberately odd: a closed form does not depend on them.
"""

import math
from collections.abc import Callable

from imdim.program.outline import Loop, Outline, circle, ellipse, rectangle
from imdim.program.tree import Combine, Primitive, Program, combine_all

TILT = (20.0, -35.0, 50.0)
AWAY = (0.3, -0.2, 0.1)

BOX = Primitive("box", (1.0, 0.7, 0.4), AWAY, TILT)
SPHERE = Primitive("sphere", (0.5,), AWAY)
CYLINDER = Primitive("cylinder", (0.4, 0.9), AWAY, TILT)
FRUSTUM = Primitive("cone", (0.5, 0.2, 0.8), AWAY, TILT)
POINTED = Primitive("cone", (0.5, 0.0, 0.8), AWAY, (0.0, 90.0, 0.0))
TORUS = Primitive("torus", (0.5, 0.2), AWAY, TILT)
ELLIPSOID = Primitive("ellipsoid", (0.6, 0.4, 0.3), AWAY, TILT)
LEAVES = [BOX, SPHERE, CYLINDER, FRUSTUM, POINTED, TORUS, ELLIPSOID]


def along_z(kind: str, size: tuple[float, ...], z: float = 0.0, x: float = 0.0) -> Primitive:
    return Primitive(kind, size, (x, 0.0, z))


def _cap(r: float, h: float) -> float:
    """Volume of the cap of height h of a ball of radius r."""
    return math.pi * h * h * (3 * r - h) / 3


BLOCK = along_z("box", (1.0, 1.0, 1.0))
BORE = along_z("cylinder", (0.25, 1.2))
DRILLED = Combine("difference", BLOCK, BORE)
CROSS_BORES = Combine(
    "union", Primitive("cylinder", (0.25, 2.0), rotation=(0.0, 90.0, 0.0)), Primitive("cylinder", (0.25, 2.0), rotation=(90.0, 0.0, 0.0))
)
BICYLINDER = Combine("intersection", CROSS_BORES.left, CROSS_BORES.right)
PLATE_HOLES = [along_z("cylinder", (0.1, 0.4), x=x) for x in (-0.6, 0.6)]
PLATE = Combine("union", along_z("box", (2.0, 1.0, 0.2)), along_z("cylinder", (0.2, 0.5), 0.35))

_LENS = 2 * _cap(0.5, 0.2)
_STEINMETZ = 16 * 0.25**3 / 3

KNOWN: dict[str, tuple[Program, float]] = {
    "box": (BOX, 0.28),
    "sphere": (SPHERE, math.pi / 6),
    "cylinder": (CYLINDER, math.pi * 0.16 * 0.9),
    "frustum": (FRUSTUM, math.pi * 0.8 * (0.25 + 0.1 + 0.04) / 3),
    "pointed cone": (POINTED, math.pi * 0.25 * 0.8 / 3),
    "torus": (TORUS, 2 * math.pi**2 * 0.5 * 0.04),
    "horn torus": (Primitive("torus", (0.3, 0.3), AWAY, TILT), 2 * math.pi**2 * 0.3**3),
    "ellipsoid": (ELLIPSOID, 4 / 3 * math.pi * 0.6 * 0.4 * 0.3),
    "drilled block": (DRILLED, 1 - math.pi / 16),
    "lens": (Combine("intersection", along_z("sphere", (0.5,), 0.3), along_z("sphere", (0.5,), -0.3)), _LENS),
    "two balls": (Combine("union", along_z("sphere", (0.5,), 0.3), along_z("sphere", (0.5,), -0.3)), math.pi / 3 - _LENS),
    "crescent": (Combine("difference", along_z("sphere", (0.5,), 0.3), along_z("sphere", (0.5,), -0.3)), math.pi / 6 - _LENS),
    "steinmetz": (BICYLINDER, _STEINMETZ),
    "cross drilled": (Combine("difference", BLOCK, CROSS_BORES), 1 - (2 * math.pi / 16 - _STEINMETZ)),
    "core left standing": (
        Combine("difference", BLOCK, Combine("difference", BORE, along_z("cylinder", (0.1, 2.0)))),
        1 - math.pi * 0.0525,
    ),
    "dome": (Combine("intersection", along_z("sphere", (0.5,)), along_z("box", (2.0, 2.0, 1.0), 0.5)), math.pi / 12),
    "countersink": (
        Combine("difference", DRILLED, along_z("cone", (0.25, 0.45, 0.2), 0.4)),
        1 - math.pi / 16 * 0.8 - math.pi * 0.2 * (0.0625 + 0.1125 + 0.2025) / 3,
    ),
    "plate with boss and holes": (
        combine_all("difference", [PLATE, *PLATE_HOLES]),
        0.4 + math.pi * 0.04 * 0.5 - 2 * math.pi * 0.01 * 0.2,
    ),
    "touching boxes": (Combine("union", along_z("box", (1.0, 1.0, 0.5), 0.25), along_z("box", (0.5, 1.0, 0.5), -0.25)), 0.75),
    "ring": (Combine("difference", along_z("cylinder", (0.5, 0.3)), along_z("cylinder", (0.3, 0.3))), math.pi * 0.16 * 0.3),
    "half torus": (
        Combine("intersection", along_z("torus", (0.5, 0.2)), Primitive("box", (2.0, 1.0, 2.0), (0.0, 0.5, 0.0))),
        math.pi**2 * 0.02,
    ),
    "nothing": (Combine("difference", along_z("sphere", (0.3,)), along_z("box", (1.0, 1.0, 1.0))), 0.0),
}


def extrude(h: float, *loops: Loop) -> Primitive:
    return Primitive("extrude", (h,), AWAY, TILT, Outline(loops))


def draft(h: float, inset: float, *loops: Loop) -> Primitive:
    """Whose walls are so much farther in at the top."""
    return Primitive("drafted", (h, math.degrees(math.atan(inset / h))), AWAY, TILT, Outline(loops))


def turn(degrees: float, *loops: Loop) -> Primitive:
    return Primitive("revolve", (degrees,), AWAY, TILT, Outline(loops))


(SQUARE,), (OBLONG,) = rectangle(1.0, 1.0).loops, rectangle(1.0, 0.6).loops
STADIUM: Loop = ((-0.3, -0.2, 0.0), (0.3, -0.2, 1.0), (0.3, 0.2, 0.0), (-0.3, 0.2, 1.0))
NICHE: Loop = (*SQUARE[:2], (0.5, 0.5, -0.5), SQUARE[3])  # its upper side is an arc that bends inward
HALF_DISC: Loop = ((0.0, -0.5, 1.0), (0.0, 0.5, 0.0))
(RIM,) = rectangle(0.2, 0.3).shift(0.5, 0.0).loops
ROUNDED: Loop = (
    (-0.35, -0.3, 0.0),
    (0.35, -0.3, math.tan(math.pi / 8)),
    (0.5, -0.15, 0.0),
    (0.5, 0.15, math.tan(math.pi / 8)),
    (0.35, 0.3, 0.0),
    (-0.35, 0.3, math.tan(math.pi / 8)),
    (-0.5, 0.15, 0.0),
    (-0.5, -0.15, math.tan(math.pi / 8)),
)
ANGLE: Loop = ((-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.5, 0.0), (-0.5, 0.5, 0.0))
_NICHE = 0.625**2 * (4 * math.atan(0.5) - math.sin(4 * math.atan(0.5))) / 2
# of a quarter of a disc of radius 0.6 what lies in a quarter of the square
_QUARTER_DISC = 0.5 * math.sqrt(0.11) + 0.18 * (math.asin(0.5 / 0.6) - math.asin(math.sqrt(0.11) / 0.6))
_RIM = 0.5 * 0.06  # area times the middle's distance from the axis


def _drafted(h: float, inset: float, area: Callable[[float], float]) -> float:
    """The volume of a solid whose sections are of an `area` that is a square polynomial of how far in they are (Simpson's rule)."""
    return h / 6 * (area(0.0) + 4 * area(inset / 2) + area(inset))


DRAWN: dict[str, tuple[Program, float]] = {
    "plate with a hole": (extrude(0.4, OBLONG, circle(0.2, 0.1, 0.05)), 0.4 * (0.6 - math.pi * 0.04)),
    "stadium": (extrude(0.7, STADIUM), 0.7 * (0.24 + math.pi * 0.04)),
    "niche": (extrude(0.3, NICHE), 0.3 * (1 - _NICHE)),
    "island": (extrude(0.5, circle(0.5), circle(0.35), circle(0.15)), 0.5 * math.pi * (0.25 - 0.1225 + 0.0225)),
    "drafted plate with a hole": (
        draft(0.4, 0.1, ROUNDED, circle(0.06, 0.1, 0.01)),
        _drafted(0.4, 0.1, lambda i: (1 - 2 * i) * (0.6 - 2 * i) - (4 - math.pi) * (0.15 - i) ** 2 - math.pi * (0.06 + i) ** 2),
    ),
    "drafted angle": (draft(0.8, 0.15, ANGLE), _drafted(0.8, 0.15, lambda i: 0.75 - 4 * i + 4 * i * i)),
    "block with a drafted pocket": (
        Combine("difference", Primitive("box", (1.4, 1.0, 0.4), AWAY, TILT), draft(0.4, 0.1, OBLONG)),
        0.56 - _drafted(0.4, 0.1, lambda i: (1 - 2 * i) * (0.6 - 2 * i)),
    ),
    "turned rim": (turn(360.0, RIM), 2 * math.pi * _RIM),
    "quarter of a rim": (turn(90.0, RIM), math.pi / 2 * _RIM),
    "sliver of a rim": (turn(20.0, RIM), math.pi / 9 * _RIM),
    "most of a rim": (turn(330.0, RIM), 11 / 6 * math.pi * _RIM),
    "turned ball": (turn(360.0, HALF_DISC), math.pi / 6),
    "three quarters of a ball": (turn(270.0, HALF_DISC), math.pi / 8),
    "half a ball": (turn(180.0, HALF_DISC), math.pi / 12),
    "part of a torus with a core": (
        turn(200.0, circle(0.2, 0.5), circle(0.1, 0.5)),
        math.radians(200) * 0.5 * math.pi * (0.04 - 0.01),
    ),
    "elliptic tube": (
        extrude(0.5, ellipse(0.5, 0.3, 0.05, -0.02, 25.0), ellipse(0.22, 0.4, 0.05, -0.02, 115.0)),
        0.5 * math.pi * (0.15 - 0.088),
    ),
    "plate with an elliptic window": (
        extrude(0.4, OBLONG, ellipse(0.15, 0.25, 0.1, 0.02), ellipse(0.1, 0.05, 0.12, 0.05, -30.0)),
        0.4 * (0.6 - math.pi * 0.0375 + math.pi * 0.005),
    ),
    "turned ellipse": (turn(360.0, ellipse(0.2, 0.12, 0.5, 0.05, 30.0)), 2 * math.pi * 0.5 * math.pi * 0.024),
    "part of a turned ellipse with a bore": (
        turn(200.0, ellipse(0.12, 0.2, 0.5, 0.05), circle(0.1, 0.5, 0.06)),
        math.radians(200) * 0.5 * math.pi * (0.024 - 0.01),
    ),
    "drilled extrusion": (
        Combine("difference", Primitive("extrude", (0.4,), outline=Outline((SQUARE,))), BORE),
        0.4 * (1 - math.pi / 16),
    ),
    "extrusion with a groove": (
        Combine(
            "difference", Primitive("extrude", (0.4,), outline=Outline((SQUARE,))), Primitive("revolve", (90.0,), outline=Outline((RIM,)))
        ),
        0.4 - 0.3 * (_QUARTER_DISC - math.pi / 4 * 0.4**2),
    ),
}
DRAWN_LEAVES = [program for program, _ in DRAWN.values() if isinstance(program, Primitive)]
EVERY = KNOWN | DRAWN
