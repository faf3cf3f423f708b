"""Programs of outlined leaves whose volume is known in closed form, in tilted poses. Import `OUTLINED_PARTS` (name -> program, volume)."""

import math
from collections.abc import Callable

from imdim.program.outline import Outline, circle, ellipse, rectangle
from imdim.program.tree import Combine, Primitive, Program, Vec3

TILT, AWAY = (20.0, -35.0, 50.0), (3.0, -2.0, 1.0)
QUARTER = math.tan(math.pi / 8)  # the bulge of a quarter arc


def rounded(width: float, height: float, radius: float) -> tuple:
    """A rectangle with round corners, as a loop."""
    x, y = width / 2, height / 2
    a, b = x - radius, y - radius
    return ((-a, -y, 0.0), (a, -y, QUARTER), (x, -b, 0.0), (x, b, QUARTER), (a, y, 0.0), (-a, y, QUARTER), (-x, b, 0.0), (-x, -b, QUARTER))


def slot(length: float, radius: float) -> tuple:
    """A slot with round ends, as a loop; `length` is between the middles of its ends."""
    x = length / 2
    return ((-x, -radius, 0.0), (x, -radius, 1.0), (x, radius, 0.0), (-x, radius, 1.0))


def moved(leaf: Primitive, along: Vec3) -> Primitive:
    """A leaf a step along its own axes."""
    from imdim.geometry.rotations import matrix_from_euler

    x, y, z = (c + float(d) for c, d in zip(leaf.center, matrix_from_euler(leaf.rotation) @ along, strict=True))
    return Primitive(leaf.kind, leaf.size, (x, y, z), leaf.rotation, leaf.outline)


PLATE = Primitive("extrude", (4.0,), AWAY, TILT, Outline((rounded(50, 30, 5), circle(3, -15), circle(3, 15))))
SLOT = Primitive("extrude", (20.0,), AWAY, TILT, Outline((slot(6, 1.5),)))
# a spindle with a round shoulder; its outline stands on the axis
KNOB = Primitive(
    "revolve",
    (360.0,),
    (-4.0, 5.0, 40.0),
    (-15.0, 70.0, 10.0),
    Outline((((0.0, -6.0, 0.0), (8.0, -6.0, 0.0), (8.0, 3.0, QUARTER), (5.0, 6.0, 0.0), (0.0, 6.0, 0.0)),)),
)
BEND = Primitive(  # a quarter of a ring whose section is a D with a hole
    "revolve", (90.0,), (0.0, -60.0, 3.0), (40.0, 10.0, -25.0), Outline((((12.0, -4.0, 1.0), (12.0, 4.0, 0.0)), circle(1.5, 14)))
)
OVAL = Primitive(  # an elliptic plate with an elliptic window, a hole beside it and an elliptic island in the window
    "extrude",
    (3.0,),
    AWAY,
    TILT,
    Outline((ellipse(30, 18, 2, 1, 20), ellipse(6, 9, 5, 2), circle(3, -14, -4), ellipse(2, 1, 5, 2, -40))),
)
HANDLE = Primitive("revolve", (90.0,), (0.0, -60.0, 3.0), (40.0, 10.0, -25.0), Outline((ellipse(4, 6, 14, 1, 10),)))
DRAFTED = Primitive(  # walls lean in by 1.5 on the way up, the hole gets wider
    "drafted", (6.0, math.degrees(math.atan(0.25))), AWAY, TILT, Outline((rounded(50, 30, 5), circle(3, -15)))
)
LEANING_POCKET = Primitive(  # an L whose walls lean out on the way up, which is upside down
    "drafted",
    (4.0, math.degrees(math.atan(0.1))),
    AWAY,
    (-160.0, 35.0, -130.0),
    Outline((((-10, -10, 0.0), (10, -10, 0.0), (10, 0, 0.0), (0, 0, 0.0), (0, 10, 0.0), (-10, 10, 0.0)),)),
)
ISLAND = Primitive(  # a hole with an island in it, beside another area
    "extrude", (3.0,), AWAY, TILT, Outline((rectangle(20, 20).loops[0], circle(8), circle(3), circle(2, 20, 4)))
)

_CORNERS = (4 - math.pi) * 25
_PLATE_AREA = 50 * 30 - _CORNERS - 2 * math.pi * 9
_SLOT_AREA = 6 * 3 + math.pi * 1.5**2
# Pappus, by parts: a half or quarter disc has its middle 4 r / (3 pi) from the straight side
_KNOB = math.pi * 64 * 9 + math.pi * 25 * 3 + 2 * math.pi * (9 * math.pi / 4) * (5 + 4 / math.pi)
_BEND = math.pi / 2 * (8 * math.pi * (12 + 16 / (3 * math.pi)) - math.pi * 1.5**2 * 14)


def _prismoid(h: float, inset: float, area: Callable[[float], float]) -> float:
    """The volume between sections of an `area` that is a square polynomial of how far in they are."""
    return h / 6 * (area(0.0) + 4 * area(inset / 2) + area(inset))


_DRAFTED = _prismoid(6.0, 1.5, lambda i: (50 - 2 * i) * (30 - 2 * i) - (4 - math.pi) * (5 - i) ** 2 - math.pi * (3 + i) ** 2)

OUTLINED_PARTS: dict[str, tuple[Program, float]] = {
    "plate": (PLATE, _PLATE_AREA * 4),
    "knob": (KNOB, _KNOB),
    "bend": (BEND, _BEND),
    "oval": (OVAL, 3 * math.pi * (540 - 54 - 9 + 2)),
    "handle": (HANDLE, math.pi / 2 * 14 * math.pi * 24),
    "island": (ISLAND, 3 * (400 - math.pi * 64 + math.pi * 9 + math.pi * 4)),
    "drafted": (DRAFTED, _DRAFTED),
    "leaning pocket": (
        Combine("difference", Primitive("box", (40.0, 40.0, 4.0), AWAY, (-160.0, 35.0, -130.0)), LEANING_POCKET),
        6400 - _prismoid(4.0, 0.4, lambda i: 300 - 80 * i + 4 * i * i),
    ),
    "slotted": (Combine("difference", PLATE, SLOT), (_PLATE_AREA - _SLOT_AREA) * 4),
    "all": (
        Combine("union", Combine("union", Combine("difference", PLATE, SLOT), KNOB), BEND),
        (_PLATE_AREA - _SLOT_AREA) * 4 + _KNOB + _BEND,
    ),
}
