"""Cuts end in the faces of what they cut, wherever they leave it."""

import pytest
from tests.deadlines import PASSED
from tests.planted import ALONG_X, box, cone, cut, cylinder, union

from imdim.geometry.finish.cut_ends import end_cuts_in_faces
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Primitive, Program, leaves


def ended(program: Program) -> list[Primitive]:
    """The leaves with their new ends; the solid stays."""
    after = end_cuts_in_faces(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    return list(leaves(after))


TRAY = cut(box(40.0, 30.0, 24.0, (0.0, 0.0, 12.0)), box(36.0, 26.0, 24.0, (0.0, 0.0, 15.0)))  # its floor reaches up to 3


def test_a_hole_through_a_floor_does_not_end_at_the_level_of_something_else() -> None:
    hole = cylinder(4.0, 17.0, (0.0, 0.0, 6.5))  # from -2 to 15
    *_, after = ended(cut(TRAY, hole))
    assert after == cylinder(4.0, 24.0, (0.0, 0.0, 12.0))


def test_a_slot_stands_out_as_far_on_both_sides() -> None:
    *_, after = ended(cut(TRAY, box(6.0, 33.7, 10.0, (0.0, -1.2, 19.0))))
    assert after == box(6.0, 30.0, 10.0, (0.0, 0.0, 19.0))


def test_a_hole_beside_a_tower_ends_in_its_plate() -> None:
    plate, tower, hole = box(40.0, 30.0, 4.0), box(8.0, 8.0, 40.0, (12.0, 0.0, 20.0)), cylinder(2.0, 9.0, (-12.0, 0.0, 0.5))
    *_, after = ended(cut(union(plate, tower), hole))
    assert after == cylinder(2.0, 4.0, (-12.0, 0.0, 0.0))


def test_a_countersink_ends_as_wide_as_one_sees_it() -> None:
    *_, after = ended(cut(box(40.0, 30.0, 6.0), cone(0.0, 7.0, 7.0, (0.0, 0.0, 0.5))))  # its point at -3, r 6 in the face at 3
    assert after == cone(0.0, 6.0, 6.0)


def test_a_cut_in_one_of_two_joined_parts_ends_with_that_one() -> None:
    frame = cut(box(60.0, 40.0, 6.0), box(50.0, 30.0, 9.0))
    *_, hole, post = ended(union(frame, cylinder(4.0, 20.0, (28.0, 18.0, 0.0))))
    assert (hole, post) == (box(50.0, 30.0, 6.0), cylinder(4.0, 20.0, (28.0, 18.0, 0.0)))


def test_two_holes_that_are_one_then_are_written_once() -> None:
    body = union(box(60.0, 40.0, 5.0, (0.0, 0.0, 2.5)), cylinder(15.0, 14.0, (0.0, 0.0, 7.0)))
    below, above = cylinder(8.0, 5.0, (0.0, 0.0, 2.5)), cylinder(8.0, 9.0, (0.0, 0.0, 9.5))
    assert ended(cut(body, below, above))[2:] == [cylinder(8.0, 14.0, (0.0, 0.0, 7.0))]


@pytest.mark.parametrize(
    "program",
    [
        cut(box(40.0, 30.0, 6.0), cylinder(3.0, 5.0, (0.0, 0.0, 0.5))),  # blind, and level with the face
        cut(cylinder(10.0, 40.0), cylinder(2.0, 30.0, rotation=ALONG_X)),  # across a round wall, where it ends nowhere
        box(40.0, 30.0, 6.0),
    ],
    ids=["blind", "cross", "alone"],
)
def test_other_ends_stay(program: Program) -> None:
    assert end_cuts_in_faces(program) == program


def test_what_is_in_the_way_stops_a_cut() -> None:
    """A hole in one wall of a hollow box ends in the hollow."""
    hole = cylinder(3.0, 12.0, (-20.0, 0.0, 0.0), ALONG_X)
    *_, after = ended(cut(box(40.0, 30.0, 24.0), box(36.0, 26.0, 20.0), hole))
    assert after == cylinder(3.0, 6.0, (-17.0, 0.0, 0.0), ALONG_X)


def test_past_the_deadline_cuts_stay() -> None:
    program = cut(TRAY, cylinder(4.0, 17.0, (0.0, 0.0, 6.5)))
    assert end_cuts_in_faces(program, PASSED) == program
