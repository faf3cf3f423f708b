"""Parts with edge features whose volume is known in closed form, and their faces by type, as STEP names them. Import `CASES`."""

import math

from scipy.integrate import quad

from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, Program

BOX = Primitive("box", (10.0, 20.0, 30.0))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
UPRIGHT = tuple((Face(0, x), Face(0, y)) for x in ("+x", "-x") for y in ("+y", "-y"))
BEND = math.tan(math.pi / 8)  # a quarter of a turn
CORNERS = ((-8, -10, 0), (8, -10, BEND), (10, -8, 0), (10, 8, BEND), (8, 10, 0), (-8, 10, BEND), (-10, 8, 0), (-10, -8, BEND))
PLATE = Primitive("extrude", (5.0,), outline=Outline((tuple((float(x), float(y), float(b)) for x, y, b in CORNERS),)))
DISC = Primitive("extrude", (4.0,), outline=Outline((circle(5.0),)))
BOSSED = Combine("union", Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (8.0, 12.0), (0.0, 0.0, 8.0)))
DRILLED = Combine("difference", Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (5.0, 7.0)))
MOUTH = ((Face(0, "+z"), Face(1, "side")),)


def rim(curves: int) -> tuple[tuple[Face, Face], ...]:
    return tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(curves))


def fillet(radius: float, edges: tuple[tuple[Face, Face], ...]) -> EdgeFeature:
    return EdgeFeature("fillet", (radius,), edges)


def chamfer(sizes: tuple[float, ...], edges: tuple[tuple[Face, Face], ...]) -> EdgeFeature:
    return EdgeFeature("chamfer", sizes, edges)


def inset(t: float, radius: float) -> float:
    """By how much a rounded rim stands back, `t` below its face."""
    return radius - math.sqrt(radius**2 - (radius - t) ** 2)


def box_area(d: float) -> float:
    return (10 - 2 * d) * (20 - 2 * d)


def plate_area(d: float) -> float:
    return (20 - 2 * d) ** 2 - (4 - math.pi) * (2 - d) ** 2


def upright_area(d: float) -> float:
    return box_area(d) - (4 - math.pi) * (2 - d) ** 2


CASES: dict[str, tuple[Program, list[EdgeFeature], float, dict[str, int]]] = {
    "filleted edge": (BOX, [fillet(2.0, RIM[:1])], 6000 - 20 * (4 - math.pi), {"PLANE": 6, "CYLINDRICAL_SURFACE": 1}),
    "filleted rim": (
        BOX,
        [fillet(2.0, RIM)],
        28 * 200 + quad(lambda t: box_area(inset(t, 2.0)), 0, 2)[0],
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 4},
    ),
    "chamfers of two distances": (
        BOX,
        [chamfer((1.0, 3.0), RIM)],
        27 * 200 + quad(lambda t: box_area(1 - t / 3), 0, 3)[0],
        {"PLANE": 10},
    ),
    "chamfered plate of round corners": (
        PLATE,
        [chamfer((1.0,), rim(8))],
        4 * plate_area(0) + quad(lambda t: plate_area(1 - t), 0, 1)[0],
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4, "CONICAL_SURFACE": 4},
    ),
    "filleted plate of round corners": (
        PLATE,
        [fillet(1.0, rim(8))],
        4 * plate_area(0) + quad(lambda t: plate_area(inset(t, 1.0)), 0, 1)[0],
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 8, "TOROIDAL_SURFACE": 4},
    ),
    "two halves of a rim": (
        DISC,
        [chamfer((1.0,), rim(2))],
        math.pi * (75 + (25 + 16 + 20) / 3),
        {"PLANE": 2, "CYLINDRICAL_SURFACE": 1, "CONICAL_SURFACE": 1},
    ),
    "foot of a boss": (
        BOSSED,
        [fillet(2.0, MOUTH)],
        8000 + 64 * math.pi * 11.5 + 2 * math.pi * quad(lambda x: (8 + x) * inset(x, 2.0), 0, 2)[0],
        {"PLANE": 7, "CYLINDRICAL_SURFACE": 1, "TOROIDAL_SURFACE": 1},
    ),
    "mouth of a hole, deeper than wide": (
        DRILLED,
        [chamfer((1.0, 2.0), MOUTH)],
        8000 - 75 * math.pi - math.pi * 2 / 3 * (25 + 36 + 30),
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 1, "CONICAL_SURFACE": 1},
    ),
    # which goes on round the corners, as a modeller's would
    "a rim over filleted corners": (
        BOX,
        [fillet(2.0, UPRIGHT), chamfer((0.5,), RIM)],
        29.5 * upright_area(0) + quad(lambda t: upright_area(0.5 - t), 0, 0.5)[0],
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4, "CONICAL_SURFACE": 4},
    ),
    # here they leave room for no arc
    "corners below a wide rim": (
        BOX,
        [fillet(1.0, UPRIGHT), chamfer((2.0,), RIM)],
        math.nan,
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4},
    ),
}
