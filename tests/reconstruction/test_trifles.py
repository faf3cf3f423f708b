"""What moves the surface of a scanned thing less than real things deviate."""

import pytest
from tests.planted import box, cut, cylinder, union

from imdim.program.cost import count
from imdim.reconstruction.trifles import without_trifles


@pytest.mark.parametrize(("depth", "kept"), [(0.29, False), (0.31, True), (3.0, True)])
def test_what_moves_the_surface_less_than_real_things_do_is_a_trifle(depth, kept):
    block = box(60, 40, 30)
    dished = cut(block, cylinder(12, 2 * depth, (0, 0, 15)))
    assert without_trifles(dished, 0.3) == (dished if kept else block)
    raised = union(block, cylinder(12, 2 * depth, (0, 0, 15)))
    assert without_trifles(raised, 0.3) == (raised if kept else block)


def test_a_shallow_dish_that_runs_across_a_lip_is_a_trifle():
    can = cut(cylinder(50, 138), cylinder(48, 4, (0, 0, -69)))
    assert without_trifles(cut(can, cylinder(45, 5.2, (5, 0, -69))), 0.8) == can
    assert without_trifles(union(can, cylinder(51, 6, (0, 0, 66))), 0.8) == union(can, cylinder(51, 6, (0, 0, 66)))


def test_what_fills_a_trifle_goes_with_it():
    """A dish of 0.25, told as a cut of 6 that a block inside fills again: alone the block moves 6."""
    block = box(60, 40, 30)
    filled = union(cut(block, cylinder(12, 12, (0, 0, 15))), box(56, 38, 28.5, (0, 0, 0.5)))
    assert without_trifles(filled, 0.3) == block


def test_trifles_go_until_what_is_left_matters():
    """Each of two rings in a stack may go, both may not."""
    stack = union(cylinder(20, 10), cylinder(20.2, 12), cylinder(20.4, 14))
    left = without_trifles(stack, 1.5)
    assert count(left).primitives == 1
    assert without_trifles(stack, 0.0) == stack
