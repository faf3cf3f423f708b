"""Meshes in single precision, and in files that were written with few digits."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of

from imdim.numbers.precision import precision_of
from imdim.numbers.snap import SnapConfig, snap
from imdim.program.tree import leaves

DRILLED = cut(box(60.3, 40.15, 8), cylinder(3.3, 20), cylinder(7.7, 4, (12, 5, 4)))


@pytest.mark.parametrize("far", [0.0, 900.0])
def test_single_precision_is_that_of_the_largest_coordinate(far):
    vertices = np.float32(mesh_of(DRILLED, 64).vertices + np.array([far, 0, 0])).astype(float)
    assert 2**-24 * (far + 30) <= precision_of(vertices) <= 2e-7 * (far + 61)


@pytest.mark.parametrize("digits", [3, 4])
def test_a_file_with_few_digits_says_no_more_than_these(digits):
    assert precision_of(np.round(mesh_of(DRILLED, 64).vertices, digits)) == pytest.approx(0.5 * 10.0**-digits)


def test_corners_that_people_typed_are_no_sign_of_few_digits():
    """All are thousandths, and most are tenths."""
    walls = np.array([0.0, 12.3, 14.6, 20.1, 33.125, 40.0])
    corners = np.stack(np.meshgrid(walls, walls, [0.0, 5.0]), -1).reshape(-1, 3)
    assert precision_of(corners) < 1e-5


def test_digits_of_a_file_are_not_taken_for_typed():
    """Walls that are anywhere lie on thousandths in a file with three digits, and are rounded on."""
    slab = box(20.318, 9.122, 5.0)
    few, many = (leaves(snap(slab, lambda _: 0.0, config=SnapConfig(precision=off, max_move=1e-3))) for off in (5e-4, 2e-6))
    assert next(few).size[:2] == pytest.approx((20.3, 9.1), abs=1e-9)
    assert next(many).size[:2] == pytest.approx((20.318, 9.122), abs=1e-9)


def test_six_digits_from_the_first_are_no_more_than_that():
    """OpenSCAD writes 8.3 as 8.29999."""
    corners = mesh_of(DRILLED, 64).vertices
    steps = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(corners), 1e-12))) - 5)
    assert precision_of(np.where(corners == 0, 0.0, np.trunc(corners / steps) * steps)) == pytest.approx(5e-5)
    assert precision_of(np.float32(corners).astype(float)) < 1e-5
