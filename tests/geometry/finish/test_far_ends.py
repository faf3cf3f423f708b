"""Ends in the air: as far out as the solid lets them, both alike where that can be."""

import pytest

from imdim.geometry.finish.far_ends import reach_far
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Combine, Primitive, leaves

BALL = Primitive("sphere", (20.0,))  # of which a fifth is 13.9, the round number below that 10


def _span(leaf, axis=2, size=-1):
    return leaf.center[axis] - leaf.size[size] / 2, leaf.center[axis] + leaf.size[size] / 2


def _far(cutter, body=BALL, op="difference", **more):
    program = Combine(op, body, cutter)
    after = reach_far(program, **more)
    assert to_manifold(after).volume() == pytest.approx(to_manifold(program).volume())
    return list(leaves(after))[1]


def test_a_hole_through_a_ball_ends_far_beyond_it():
    assert _span(_far(Primitive("cylinder", (5.0, 42.0)))) == (-31.0, 31.0)


def test_a_floor_stays():
    assert _span(_far(Primitive("cylinder", (5.0, 20.0), (0.0, 0.0, 11.0)))) == (1.0, 31.0)


def test_what_ends_far_out_already_stays():
    assert _span(_far(Primitive("cylinder", (5.0, 70.0)))) == (-35.0, 35.0)


def test_an_end_that_is_kept_stays():
    assert _span(_far(Primitive("cylinder", (5.0, 20.0), (0.0, 0.0, 11.0)), kept={(1, (2, 1))})) == (1.0, 21.0)


def test_it_reaches_no_further_than_other_material_lets_it():
    body = Combine("union", BALL, Primitive("box", (60.0, 60.0, 4.0), (0.0, 0.0, 26.0)))
    program = Combine("difference", body, Primitive("cylinder", (5.0, 20.0), (0.0, 0.0, 11.0)))
    *_, hole = leaves(reach_far(program))
    assert _span(hole) == (1.0, 23.0)


def test_what_bounds_a_part_from_outside_goes_out_only_if_it_is_asked_for():
    box = Primitive("box", (16.0, 16.0, 41.0))
    assert _far(box, op="intersection") == box
    bounded = _far(box, op="intersection", masks=True)
    assert _span(bounded) == (-30.5, 30.5)
    assert bounded.size[:2] == box.size[:2]  # its walls are seen


def test_of_a_slanted_bar_both_ends_or_none():
    """Its length is about its middle: one end further out, and the other one moves more with each edit of that."""
    through = _far(Primitive("box", (60.0, 3.0, 3.0), rotation=(0.0, 30.0, 0.0)))
    assert through.size == (60.0, 3.0, 3.0)
    short = _far(Primitive("box", (42.0, 3.0, 3.0), rotation=(0.0, 30.0, 0.0)))
    assert short.size == pytest.approx((62.0, 3.0, 3.0))
    blind = Primitive("box", (30.0, 3.0, 3.0), (10.0, 0.0, 0.0), (0.0, 30.0, 0.0))
    assert _far(blind) == blind
