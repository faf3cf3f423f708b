"""Holes of programs whose holes are known: how they are made does not matter, what is no hole is not found."""

import math

import numpy as np
import pytest
from tests.planted import ALONG_X, ALONG_Y, box, cone, cut, cylinder, torus, union

from imdim.export.hole_names import hole_features
from imdim.export.parameters import parametrise
from imdim.geometry.holes import find_holes
from imdim.program import codec
from imdim.program.hole_groups import describe_hole
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, Program

PLATE = box(60, 40, 10)
RECTANGLE = ((-30.0, -20.0, 0.0), (30.0, -20.0, 0.0), (30.0, 20.0, 0.0), (-30.0, 20.0, 0.0))


def only(program: Program):
    (hole,) = find_holes(program)
    return hole


def turned(*profile, center=(0.0, 0.0, 0.0)) -> Primitive:
    return Primitive("revolve", (360.0,), center, outline=Outline((tuple((x, z, 0.0) for x, z in profile),)))


THROUGH = {
    "a cutter that sticks out": cut(PLATE, cylinder(3, 30, (10, 5, 0))),
    "a cutter that ends at the faces": cut(PLATE, cylinder(3, 10, (10, 5, 0))),
    "a loop of an outline": Primitive("extrude", (10.0,), outline=Outline((RECTANGLE, circle(3.0, 10.0, 5.0)))),
    "cutters from both sides": cut(PLATE, cylinder(3, 8, (10, 5, 4)), cylinder(3, 8, (10, 5, -4))),
    "a turned cutter": cut(PLATE, turned((0, -20), (3, -20), (3, 20), (0, 20), center=(10.0, 5.0, 0.0))),
    "two plates one on the other": cut(union(box(60, 40, 6, (0, 0, -2)), box(60, 40, 4, (0, 0, 3))), cylinder(3, 30, (10, 5, 0))),
}


@pytest.mark.parametrize("made", THROUGH)
def test_a_through_hole_is_one_however_it_is_made(made):
    hole = only(THROUGH[made])
    assert (hole.kind, hole.through) == ("through", True)
    assert hole.diameters == pytest.approx((6.0,))
    assert hole.depth == pytest.approx(10.0, abs=1e-6)
    assert hole.point == pytest.approx((10.0, 5.0, 5.0), abs=1e-6)
    assert hole.direction == (0.0, 0.0, -1.0)


def test_a_blind_hole_is_entered_where_it_is_open():
    hole = only(cut(PLATE, cylinder(3, 10, (10, 5, -7))))
    assert (hole.kind, hole.through) == ("blind", False)
    assert (hole.depth, *hole.point) == pytest.approx((3.0, 10.0, 5.0, -5.0), abs=1e-6)
    assert hole.direction == (0.0, 0.0, 1.0)


TIP = 3 / math.tan(math.radians(59))


def test_a_drill_leaves_its_point():
    hole = only(cut(PLATE, turned((0, -2 - TIP), (3, -2), (3, 9), (0, 9))))
    assert (hole.kind, hole.through, hole.leaves) == ("drilled", False, (1,))
    assert hole.depth == pytest.approx(7.0, abs=1e-6)
    assert hole.point_section.angle_deg == pytest.approx(118.0)


def test_coaxial_cutters_are_one_hole():
    bored = only(cut(PLATE, cylinder(2.75, 30), cylinder(5, 12, (0, 0, 6))))
    assert (bored.kind, bored.leaves, bored.head.end) == ("counterbore", (1, 2), pytest.approx(5.0, abs=1e-6))
    assert bored.diameters == pytest.approx((5.5, 10.0))
    sunk = only(cut(PLATE, cylinder(2, 30), cone(1, 6, 5, (0, 0, 3.5))))
    assert (sunk.kind, sunk.through) == ("countersink", True)
    assert sunk.diameters == pytest.approx((4.0, 10.0))
    assert sunk.head.angle_deg == pytest.approx(90.0)


def test_the_wide_end_is_entered():
    """A counterbore from below, and one whose hole is blind."""
    assert only(cut(PLATE, cylinder(2.75, 30), cylinder(5, 12, (0, 0, -6)))).direction == (0.0, 0.0, 1.0)
    blind = only(cut(PLATE, cylinder(2.75, 14, (0, 0, 4)), cylinder(5, 12, (0, 0, 8))))
    assert (blind.kind, blind.through, blind.depth) == ("counterbore", False, pytest.approx(8.0, abs=1e-6))


def test_a_nut_lies_in_a_hexagon():
    corners = [(math.radians(60 * k + 10), 4 / math.cos(math.pi / 6)) for k in range(6)]
    hexagon = Outline((tuple((r * math.cos(a), r * math.sin(a), 0.0) for a, r in corners),))
    nut = Primitive("extrude", (10.0,), (0.0, 0.0, 7.0), outline=hexagon)
    hole = only(cut(PLATE, cylinder(2.75, 30), nut))
    assert (hole.kind, hole.through) == ("hex pocket", True)
    assert hole.diameters == pytest.approx((5.5, 8.0), rel=1e-3)


def test_a_hexagon_alone_is_all_there_is():
    corners = [(math.radians(60 * k), 4 / math.cos(math.pi / 6)) for k in range(6)]
    hexagon = Outline((tuple((r * math.cos(a), r * math.sin(a), 0.0) for a, r in corners),))
    program = cut(PLATE, Primitive("extrude", (10.0,), (0.0, 0.0, 7.0), outline=hexagon))
    hole = only(program)
    assert (hole.kind, hole.through, hole.head) == ("hex pocket", False, hole.bore)
    assert hole.diameters == pytest.approx((8.0,), rel=1e-3)
    assert describe_hole(hole) == "hexagonal pocket, 8 across flats, 3 deep"
    assert any("hex_pocket" in name for name in parametrise(program, (), program).values)


def test_small_chamfers_leave_a_hole_what_it_is():
    hole = only(cut(PLATE, cylinder(3, 30), cone(2, 4.5, 2.5, (0, 0, 4.75)), cone(4.5, 2, 2.5, (0, 0, -4.75))))
    assert (hole.kind, len(hole.sections)) == ("through", 3)


def test_a_drill_goes_through_both_ears_of_a_fork():
    fork = cut(box(60, 40, 30), box(70, 50, 10), cylinder(3, 60, (10, 5, 0)))
    assert (only(fork).kind, only(fork).depth) == ("through", pytest.approx(30.0, abs=1e-6))


def test_two_screws_that_face_each_other_have_a_hole_each():
    """One drill through both plates, and a countersink on the inner face of each."""
    plates = union(box(60, 40, 10), box(60, 40, 10, (0, 0, 40)))
    seats = [Primitive("cone", (2.0, 4.0, 2.0), (10, 5, 4)), Primitive("cone", (4.0, 2.0, 2.0), (10, 5, 36))]
    found = find_holes(cut(plates, cylinder(2, 80, (10, 5, 20)), *seats))
    assert [(hole.kind, hole.diameters, hole.through) for hole in found] == [("countersink", (4.0, 8.0), True)] * 2
    assert sorted(hole.point[2] for hole in found) == pytest.approx([5.0, 35.0], abs=1e-6)


def test_a_bore_of_a_turned_part_is_a_hole():
    collar = turned((4, -5), (10, -5), (10, 5), (7, 5), (7, 2), (4, 2))
    assert (only(collar).kind, only(collar).diameters) == ("counterbore", pytest.approx((8.0, 14.0)))


NO_HOLES = {
    "a boss": union(PLATE, cylinder(5, 30)),
    "a slot": cut(PLATE, box(20, 6, 30), cylinder(3, 30, (10, 0, 0)), cylinder(3, 30, (-10, 0, 0))),
    "a notch in the side": cut(PLATE, cylinder(3, 30, (30, 0, 0))),
    "a hollow inside": cut(PLATE, cylinder(3, 4)),
    "a groove around a boss": cut(PLATE, Combine("difference", cylinder(8, 4, (0, 0, 4)), cylinder(5, 4, (0, 0, 4)))),
    "a round groove": cut(PLATE, torus(10, 2, (0, 0, 5))),
    "a filled hole": union(cut(PLATE, cylinder(3, 30)), cylinder(4, 10)),
}


@pytest.mark.parametrize("shape", NO_HOLES)
def test_what_is_no_hole_is_none(shape):
    assert find_holes(NO_HOLES[shape]) == ()


def test_a_wide_recess_and_a_small_hole_in_it_are_two():
    found = find_holes(cut(PLATE, cylinder(15, 8, (0, 0, 5)), cylinder(2, 30)))
    assert [(h.kind, h.diameters) for h in found] == [("blind", pytest.approx((30.0,))), ("through", pytest.approx((4.0,)))]


@pytest.mark.parametrize("rotation", [ALONG_X, ALONG_Y, (30.0, 20.0, 10.0)])
def test_holes_are_found_in_all_directions(rotation):
    body = Primitive("box", (60.0, 40.0, 10.0), (5.0, 6.0, 7.0), rotation)
    hole = only(cut(body, Primitive("cylinder", (3.0, 30.0), (5.0, 6.0, 7.0), rotation)))
    away = np.cross(np.array(hole.point) - (5.0, 6.0, 7.0), hole.direction)
    assert hole.kind == "through"
    assert (hole.depth, *away) == pytest.approx((10.0, 0.0, 0.0, 0.0), abs=1e-6)


def test_a_step_of_next_to_nothing_is_none():
    assert only(cut(PLATE, cylinder(3, 30), cylinder(5, 10, (0, 0, 9.9995)))).kind == "through"


def test_nothing_is_entered_through_the_tip_of_a_cone():
    """Where a slanted wall runs out in a point, a document would have a hole of no diameter, which nobody may read."""
    funnel = turned((17.0, 45.0), (194.0, -152.0), (200.0, -152.0), (25.0, 41.0), (0.0, 152.0))
    program = union(funnel, cylinder(12.75, 30.0, (0.0, 0.0, 121.6)))
    assert [hole.bore.diameter for hole in find_holes(program)] == [pytest.approx(34.0)]
    assert codec.parse(codec.dumps(program, holes=hole_features(program)))["holes"][0]["diameter"] == pytest.approx(34.0)
