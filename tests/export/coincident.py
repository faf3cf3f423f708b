"""Programs whose faces only just meet, with the volume and the number of through holes that are meant."""

import math

from imdim.program.tree import Combine, Primitive, Program, combine_all

PLATE = Primitive("box", (100.0, 60.0, 10.0))
BOSS = Primitive("cylinder", (6.0, 20.0), (0.0, 20.0, 15.0))
BORE = Primitive("cylinder", (3.0, 30.0), (0.0, 20.0, 10.0))
HOLE = Primitive("cylinder", (5.0, 10.0), (20.0, 0.0, 0.0))
SINK = Primitive("cone", (5.0, 8.0, 3.0), (20.0, 0.0, 3.5))
NOTCH = Primitive("box", (10.0, 10.0, 10.0), (45.0, 25.0, 0.0))
POCKET = Primitive("box", (20.0, 20.0, 5.0), (-20.0, 0.0, 2.5))
TILT = (30.0, 20.0, 10.0)

_BRACKET_VOLUME = 60000 + math.pi * 36 * 20 - math.pi * 9 * 30 - math.pi * 25 * 7 - math.pi * 3 * (25 + 40 + 64) / 3 - 1000 - 2000


def cut(*parts: Program) -> Program:
    return combine_all("difference", list(parts))


# name -> program, volume of the curved solid, through holes
MEANT: dict[str, tuple[Program, float, int]] = {
    "through hole": (cut(PLATE, HOLE), 60000 - math.pi * 250, 1),
    "bracket": (cut(Combine("union", PLATE, BOSS), BORE, HOLE, SINK, NOTCH, POCKET), _BRACKET_VOLUME, 2),
    "slot from side to side": (cut(PLATE, Primitive("box", (100.0, 20.0, 5.0), (0.0, 0.0, 2.5))), 50000, 0),
    "tilted": (
        cut(Primitive("box", (10.0, 10.0, 10.0), rotation=TILT), Primitive("cylinder", (2.0, 10.0), rotation=TILT)),
        1000 - 40 * math.pi,
        1,
    ),
    "two bores that meet": (
        cut(
            Primitive("box", (10.0, 10.0, 20.0)),
            Primitive("cylinder", (2.0, 10.0), (0.0, 0.0, 5.0)),
            Primitive("cylinder", (3.0, 10.0), (0.0, 0.0, -5.0)),
        ),
        2000 - math.pi * 130,
        1,
    ),
    "core": (cut(PLATE, cut(Primitive("cylinder", (9.0, 10.0)), Primitive("cylinder", (4.0, 10.0)))), 60000 - math.pi * 650, 1),
    "common": (Combine("intersection", Primitive("box", (10.0, 10.0, 4.0)), Primitive("cylinder", (4.0, 4.0))), math.pi * 64, 0),
}
