"""What a designer would write has the shorter description: each sentence of it against the same part said otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planted import ALONG_X, box, cone, cut, cylinder, union

from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, Program, leaves
from imdim.reconstruction import methods
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.config import Settings
from imdim.reconstruction.description import describe_bits
from imdim.reconstruction.design_events import GROUPS, PartBox, read_events
from imdim.reconstruction.methods import MethodStep, Run

PART = PartBox(np.array([-40.0, -25.0, 0.0]), np.array([40.0, 25.0, 10.0]))
PLATE = box(80, 50, 10, (0.0, 0.0, 5.0))
HOLE = cylinder(4, 12, (10.0, 0.0, 5.0))


def bits(program: Program) -> float:
    return describe_bits(program, PART)


def events(program: Program, group: str) -> dict[str, int]:
    return {event: n for (of, event), n in read_events(program, PART).events.items() if of == group and n}


@pytest.mark.parametrize(
    ("designed", "odd"),
    [
        (cut(PLATE, HOLE), cut(PLATE, box(8, 8, 12, (10.0, 0.0, 5.0)))),  # a round hole is common
        (cut(PLATE, HOLE), cut(PLATE, cylinder(4.0123, 12, (10.0, 0.0, 5.0)))),  # numbers are round
        (cut(PLATE, cylinder(4, 12, (10.0, 0.0, 5.0))), cut(PLATE, cylinder(4, 12, (10.37, 0.0, 5.0)))),
        # a hole is the side of a cylinder, and not the tip of a cone that lies mostly in the air
        (cut(PLATE, cone(3, 7, 6, (0.0, 0.0, 8.0))), cut(PLATE, cone(3, 83, 120, (0.0, 0.0, 65.0)))),
        # a boss stands on the plate; one that begins inside has an end that nobody sees at a number of its own
        (union(PLATE, cylinder(6, 8, (0.0, 0.0, 14.0))), union(PLATE, cylinder(6, 11.3, (0.0, 0.0, 12.35)))),
        (union(PLATE, box(10, 10, 5, (0.0, 0.0, 12.5))), union(PLATE, box(10, 10, 5, (0.0, 0.0, 12.5), (0.0, 0.0, 31.0)))),
    ],
)
def test_what_is_designed_is_shorter(designed, odd):
    assert bits(designed) < bits(odd)


def test_copies_are_read_once():
    holes = [cylinder(3, 12, (12.0 * i - 30.0, 0.0, 5.0)) for i in range(6)]
    assert bits(cut(PLATE, *holes)) < bits(cut(PLATE, *holes[:1])) + bits(cut(PLATE, holes[0])) - bits(PLATE)
    assert events(cut(PLATE, *holes), "copies") == {"once": 2, "more": 1}


def test_ends_of_a_through_hole_are_outside_and_in_the_air():
    assert events(cut(PLATE, HOLE), "level cut") == {"outside": 2}
    assert events(cut(PLATE, HOLE), "cut flat") == {"air": 2}
    assert events(cut(PLATE, HOLE), "cut side") == {"seen": 1}


def test_what_is_covered_is_not_seen():
    assert events(union(PLATE, cylinder(20, 6, (0.0, 0.0, 13.0))), "add flat") == {"seen": 6, "partly": 1, "inside": 1}


def test_units_tell_what_is_round():
    inches = PartBox(PART.low / 25.4, PART.high / 25.4, 25.4)
    plate = box(80 / 25.4, 50 / 25.4, 10 / 25.4, (0.0, 0.0, 5 / 25.4))
    assert describe_bits(plate, inches) == pytest.approx(bits(PLATE))
    assert describe_bits(plate, PartBox(inches.low, inches.high)) > bits(PLATE)


def test_drawings_and_turns_are_read():
    corner = Primitive(
        "extrude", (10.0,), (0.0, 0.0, 5.0), outline=Outline((((-40, -25, 0), (40, -25, 0), (40, 20, 0.4), (35, 25, 0), (-40, 25, 0)),))
    )
    assert events(corner, "curve") == {"line": 4, "arc": 1, "end": 1}
    assert events(union(PLATE, box(9, 9, 9, (0.0, 0.0, 10.0), (0.0, 0.0, 20.0))), "direction") == {"known": 4, "turned": 2}
    assert events(cut(PLATE, cylinder(2, 90, (0.0, 0.0, 5.0), ALONG_X)), "direction") == {"known": 4}


def test_every_event_has_a_place_in_its_group():
    for program in (cut(PLATE, HOLE), union(PLATE, cone(9, 3, 7, (0.0, 0.0, 13.5)))):
        assert all(event in GROUPS[group] for group, event in read_events(program, PART).events)


class _Seen:
    """Programs that all fit alike."""

    class families:
        class arrangement:
            part = np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, 30.0]])

    def iou(self, program: Program) -> float:
        return 1.0


TABLE = union(box(40, 40, 4, (0.0, 0.0, 28.0)), *(box(6, 6, 26, (x, y, 13.0)) for x in (-17.0, 17.0) for y in (-17.0, 17.0)))
CROSSED = cut(box(40, 40, 30, (0.0, 0.0, 15.0)), box(28, 42, 27, (0.0, 0.0, 12.5)), box(42, 28, 27, (0.0, 0.0, 12.5)))


def test_of_programs_that_fit_alike_the_shortest_description_is_taken():
    run = Run(_Seen(), Settings(), None, Budget(60.0), None)  # type: ignore[arg-type]
    odd = cut(CROSSED, box(7.123, 3.456, 9.87, (1.234, 0.0, 35.0)))
    step = methods._choose_described(run, MethodStep("search", odd, others=(TABLE, CROSSED)))
    assert step is not None
    assert step.program in (TABLE, CROSSED)
    assert odd in step.others
    # what is no shorter beyond doubt changes nothing
    assert methods._choose_described(run, MethodStep("search", step.program, others=(odd, step.program))) is None
    # nor does one that has the same features
    assert isinstance(TABLE, Combine)
    moved = union(*leaves(TABLE.left), box(7.3, 6.7, 26.1, (17.0, 17.0, 13.0)))
    assert methods._choose_described(run, MethodStep("search", moved, others=(TABLE,))) is None
    # nor is anything taken that counts by primitives
    counting = replace(run, settings=Settings(language="csg"))
    assert methods._choose_described(counting, MethodStep("search", odd, others=(TABLE, CROSSED))) is None
