"""Bores and pins on one slanting axis stay on one when their places are rounded."""

import math

import pytest

from imdim.numbers.slanting_axes import find_parted_axes
from imdim.program.tree import Primitive

C, S = math.cos(math.radians(60)), math.sin(math.radians(60))
TURN = (0.0, 90.0, 60.0)


def cylinder(reach, radius, rotation=TURN, aside=0.0):
    return Primitive("cylinder", (radius, 10.0), (reach * C - aside * S, reach * S + aside * C, 3.0), rotation)


def test_a_bore_that_was_rounded_for_itself_is_on_the_axis_of_its_counterbore_again():
    """Of a chuck the bores at 60 degrees were rounded to 0.012 beside what they are of."""
    before = [cylinder(66.75, 21.0), cylinder(91.05, 18.0), cylinder(91.05, 5.0, aside=2.0)]
    after = [Primitive("cylinder", (21.0, 10.0), (33.5, 58.0, 3.0), TURN), *before[1:]]
    ((number, leaf),) = find_parted_axes(before, after, 1e-4)
    assert number == 0
    x, y, z = leaf.center
    assert y * C - x * S == pytest.approx(0.0, abs=1e-9)
    assert (x * C + y * S, z) == pytest.approx((33.5 * C + 58.0 * S, 3.0))
    assert (leaf.size, leaf.rotation) == (after[0].size, TURN)
    assert list(find_parted_axes(before, [leaf, *before[1:]], 1e-4)) == []


def test_what_was_on_no_axis_of_another_or_lies_along_the_world_stays():
    beside = [cylinder(66.75, 21.0, aside=0.1), cylinder(91.05, 18.0)]
    moved = Primitive("cylinder", (21.0, 10.0), (33.5, 58.0, 3.0), TURN)
    assert list(find_parted_axes(beside, [moved, beside[1]], 1e-4)) == []
    level = [Primitive("cylinder", (r, 10.0), (x, 1.0002, 3.0), (0.0, 90.0, 0.0)) for r, x in ((2.0, 5.0), (4.0, 20.0))]
    rounded = [Primitive("cylinder", (2.0, 10.0), (5.0, 1.0, 3.0), (0.0, 90.0, 0.0)), level[1]]
    assert list(find_parted_axes(level, rounded, 1e-4)) == []
    turned = [cylinder(66.75, 21.0), cylinder(91.05, 18.0)]
    assert list(find_parted_axes(turned, [moved, cylinder(91.05, 18.0, (0.0, 90.0, 59.0))], 1e-4)) == []
