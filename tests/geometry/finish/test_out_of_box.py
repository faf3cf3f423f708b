"""What reaches beyond the target, unseen, is cut off by the cutters that end it within."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, union

from imdim.geometry.finish.overshoot import without_strays
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Primitive, Program


def plate_with_a_rib(reach: float) -> Program:
    """A slanted rib over a plate, whose ends are cut off by two blocks that reach so far beyond the plate."""
    rib = Primitive("box", (180, 6, 6), (0, 0, 7), (0, 0, 20))
    ends = [Primitive("box", (reach, 200, 40), (side * (50 + reach / 2), 0, 0)) for side in (-1, 1)]
    return cut(union(box(100, 60, 8), rib), *ends)


def test_a_stray_end_is_cut_off():
    whole, short = to_manifold(plate_with_a_rib(100)), plate_with_a_rib(5)
    assert volume_iou(to_manifold(short), whole) < 0.99
    assert volume_iou(to_manifold(without_strays(short, whole)), whole) == pytest.approx(1)


def test_a_program_without_stray_ends_stays_as_it_is():
    program = plate_with_a_rib(100)
    assert without_strays(program, to_manifold(program)) is program


def test_an_end_that_nothing_cuts_stays():
    program = union(box(100, 60, 8), Primitive("box", (180, 6, 6), (0, 0, 7), (0, 0, 20)))
    assert without_strays(program, to_manifold(plate_with_a_rib(100))) is program


def test_without_time_stray_ends_stay():
    short = plate_with_a_rib(5)
    assert without_strays(short, to_manifold(plate_with_a_rib(100)), PASSED) is short
