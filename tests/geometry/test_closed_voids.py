"""Voids between features: one face moves past each, where the target is solid."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, union

from imdim.geometry.census import census_of
from imdim.geometry.finish.closed_voids import close_voids
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves

BLOCK = box(40, 40, 20)
WHOLE = to_manifold(BLOCK)


def kind(program):
    return census_of(to_manifold(program)).kind


def plugged(plug, depth=12.0):
    """A block with a pocket from above, and in that a plug."""
    return union(cut(BLOCK, box(20, 20, depth + 1, (0, 0, 10.5 - depth / 2))), plug)


@pytest.mark.parametrize("gap", [0.01, 0.3])
def test_a_void_below_a_plug_is_closed(gap):
    program = plugged(box(20, 20, 12 - gap, (0, 0, 4 + gap / 2)))
    assert kind(program) == (1, 0, 1)
    closed = close_voids(program, WHOLE)
    assert kind(closed) == (1, 0, 0)
    assert volume_iou(to_manifold(closed), WHOLE) > 1 - 1e-6
    assert sum(a != b for a, b in zip(leaves(closed), leaves(program), strict=True)) == 1


def test_a_drawn_wall_closes_what_no_level_can():
    """A plug that is drawn leans away from a pocket that is drawn too, over a floor, and a lid is above both."""

    def drawn(*corners):
        return Primitive("extrude", (12.0,), (0, 0, 2.0), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))

    pocket = drawn((-10, -10), (10, -10), (10, 10), (-10, 10))
    plug = drawn((-10, -10), (10, -10), (9.7, 10), (-10, 10))
    program = union(union(cut(BLOCK, pocket), plug), box(30, 30, 2, (0, 0, 8.9)))
    assert kind(program) == (1, 0, 1)
    closed = close_voids(program, WHOLE)
    assert kind(closed) == (1, 0, 0)
    assert volume_iou(to_manifold(closed), WHOLE) > 1 - 1e-6


def test_what_the_target_has_stays_and_time_is_kept():
    program = plugged(box(20, 20, 11, (0, 0, 4.5)))
    assert close_voids(program, to_manifold(program)) is program
    assert close_voids(program, WHOLE, PASSED) is program
    assert close_voids(BLOCK, WHOLE) is BLOCK


def test_a_wide_void_stays():
    """What is missing there is a feature that was not found, which no face that moves a little stands for."""
    program = plugged(box(20, 20, 6, (0, 0, 7)))
    assert kind(program) == (1, 0, 1)
    assert close_voids(program, WHOLE) is program
