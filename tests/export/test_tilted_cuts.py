"""Cuts go through tilted parts however thick these become; comments say which cuts go through."""

import pytest
from tests.export.test_feature_notes import comments
from tests.export.test_hole_names import opened
from tests.planted import box, cut, cylinder

from imdim.export.edit import change_values, solid_of
from imdim.geometry.census import census_of
from imdim.program.motions import move_program, turn

PLATE = cut(box(80, 50, 10), cylinder(5, 12, (10, 5, 0)), box(30, 6, 14, (-15, 3, 0)))


@pytest.mark.parametrize(("axis", "degrees"), [((1.0, 0.0, 0.0), 30.0), ((0.6, 0.0, 0.8), 40.0)])
def test_cuts_go_through_a_thicker_tilted_plate(axis, degrees):
    delivered = opened(move_program(PLATE, turn((3.0, 4.0, 5.0), axis, degrees)))
    thicker = change_values(delivered, {"plate_thickness": 20.0})
    assert census_of(solid_of(thicker)).kind == (1, 2, 0)
    assert comments(thicker, "program.py") == ["plate #0", "hole #1: hole, diameter 10, through", "slot #2, through"]


@pytest.mark.parametrize(
    ("cutter", "says"),
    [
        (box(80, 10, 10, (0, 0, 8)), "pocket #1, through"),
        (box(10, 8, 10, (0, 0, 8)), "pocket #1: 10 x 8, 7 deep"),
        (box(80, 10, 10, (0, 18, 8)), "pocket #1"),
        (box(20, 16, 40), "pocket #1, through"),
    ],
    ids=["channel", "blind", "step", "window"],
)
def test_a_comment_says_which_pockets_go_through(cutter, says):
    assert comments(opened(cut(box(60, 40, 20), cutter)), "program.scad")[-1] == says
