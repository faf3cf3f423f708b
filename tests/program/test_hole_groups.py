"""What is said of holes: the screws that their numbers bear out, and how equal ones stand."""

import math

import pytest

from imdim.program.hole_groups import group_holes
from imdim.program.holes import Hole, HoleSection
from imdim.program.metric import CLEARANCE, NUT, SUNK_HEAD, TAP_DRILL, screw_of

DOWN = (0.0, 0.0, -1.0)


def hole(*sections: tuple[float, ...], through=True, at=(0.0, 0.0, 0.0), direction=DOWN) -> Hole:
    """Of sections (end, diameter, narrow, corners), one below the other."""
    built, start = [], 0.0
    for end, diameter, *more in sections:
        narrow, corners = (*more, *(diameter, 0)[len(more) :])
        built.append(HoleSection(start, end, diameter, narrow, int(corners), (1,)))
        start = end
    return Hole(at, direction, tuple(built), through)


SCREWS = {
    "M3 clearance": hole((10, 3.4)),
    "M6 clearance": hole((10, 6.6)),
    "M5 clearance": hole((5, 10.0), (10, 5.5)),
    "M8 clearance": hole((9, 15.0), (20, 9.0)),
    "M4 clearance": hole((2.23, 8.96, 4.5), (10, 4.5)),
    "M10 clearance": hole((8, 16.0, 16.0, 6), (20, 11.0)),
    "M4 tap drill": hole((10, 3.3), through=False),
    "M6 tap drill": hole((10, 5.0), (11.5, 5.0, 0.0), through=False),
}


@pytest.mark.parametrize("says", SCREWS)
def test_a_screw_is_named_where_the_numbers_bear_it_out(says):
    assert " ".join(screw_of(SCREWS[says])) == says


@pytest.mark.parametrize(
    "odd",
    [
        hole((10, 9.0)),  # a round number, which is M8's too
        hole((10, 3.45)),
        hole((10, 5.0), through=False),
        hole((10, 6.6), through=False),  # no screw passes
        hole((5, 20.0), (10, 9.0)),  # no head is so wide
        hole((10, 8.0, 8.0, 6)),
    ],
)
def test_nothing_is_named_where_they_do_not(odd):
    assert screw_of(odd) is None


def test_the_tables_agree_with_each_other():
    """A thread is wider than its drill and passes its holes, which its nut covers."""
    for size, (fine, medium, coarse) in CLEARANCE.items():
        thread = float(size[1:])
        assert TAP_DRILL[size] < thread < fine < medium < coarse < NUT[size]
        assert 1.9 < SUNK_HEAD.get(size, 2 * thread) / thread < 2.3


def places(*at: tuple[float, float], **more) -> list[Hole]:
    return [hole((10, 3.4), at=(x, y, 5.0), **more) for x, y in at]


RING = [(19.0, 0.0), (-9.5, 16.454482671904334), (-9.5, -16.454482671904334)]
GROUPS = {
    "4 x M3 clearance hole, diameter 3.4, through, on a 31 x 31 grid": [(x, y) for x in (-15.5, 15.5) for y in (-15.5, 15.5)],
    "3 x M3 clearance hole, diameter 3.4, through, on a circle of diameter 38": RING,
    "3 x M3 clearance hole, diameter 3.4, through, in a row, 12 apart": [(0.0, 0.0), (12.0, 0.0), (24.0, 0.0)],
    "6 x M3 clearance hole, diameter 3.4, through, in a grid of 3 x 2, 12 x 20 apart": [
        (12.0 * i, 20.0 * k) for i in range(3) for k in range(2)
    ],
    "2 x M3 clearance hole, diameter 3.4, through, 25 apart": [(0.0, 0.0), (15.0, 20.0)],
    "3 x M3 clearance hole, diameter 3.4, through": [(0.0, 0.0), (12.0, 1.0), (31.0, 7.0)],
}


@pytest.mark.parametrize("says", GROUPS)
def test_equal_holes_are_one_group_that_says_how_they_stand(says):
    assert [str(group) for group in group_holes(places(*GROUPS[says]))] == [says]


def test_what_is_left_of_a_pattern_is_a_group_of_its_own():
    found = group_holes(places(*GROUPS["4 x M3 clearance hole, diameter 3.4, through, on a 31 x 31 grid"], (3.0, 0.0)))
    assert [len(group.holes) for group in found] == [4, 1]


def test_other_sizes_and_directions_are_other_groups():
    mixed = [*places((0.0, 0.0), (10.0, 0.0)), hole((10, 3.2)), *places((0.0, 0.0), direction=(0.0, 1.0, 0.0))]
    assert [len(group.holes) for group in group_holes(mixed)] == [2, 1, 1]


def test_what_goes_on_beyond_a_chamfered_gap_is_one_bore():
    eared = hole((0.5, 4.3, 3.3), (3, 3.3), (3.5, 3.3, 4.3), (8, 4.3, 3.3), (12, 3.3))
    assert (eared.kind, eared.diameters) == ("through", (3.3,))


def test_a_pattern_goes_round_once_at_most():
    """Ten of twelve places on a circle are an arc of 30 degrees' steps, if any, and none of 150."""
    turns = [math.radians(30 * k) for k in range(12) if k not in (3, 8)]
    found = group_holes(places(*((20 * math.cos(t), 20 * math.sin(t)) for t in turns)))
    assert all(group.arrangement != "arc" or group.spacing[1] == pytest.approx(30.0) for group in found)


SAID = {
    "hole, diameter 6.6, 8 deep": hole((8, 6.6), through=False),
    "M6 tap drill hole, diameter 5, 10 deep, 118 degree point": hole((10, 5.0), (11.502151547, 5.0, 0.0), through=False),
    "M5 clearance hole, diameter 5.5, through, counterbore diameter 10, 5 deep": SCREWS["M5 clearance"],
    "M4 clearance hole, diameter 4.5, through, countersink diameter 8.96, 90 degrees": SCREWS["M4 clearance"],
    "M10 clearance hole, diameter 11, through, hexagonal pocket 16 across flats, 8 deep": SCREWS["M10 clearance"],
    "stepped hole, diameter 8 / 4 / 8, through": hole((2, 8.0), (8, 4.0), (10, 8.0)),
    "tapered hole, diameter 8 to 6, through": hole((10, 8.0, 6.0)),
    "hexagonal pocket, 8 across flats, 4 deep": hole((4, 8.0, 8.0, 6), through=False),
}


@pytest.mark.parametrize("says", SAID)
def test_a_hole_is_said_as_a_drawing_would(says):
    assert str(group_holes([SAID[says]])[0]) == says
