"""Tests of what tells that noise may hide the skins of thin walls: points are those of a plate as large as 20 deviations of it."""

import numpy as np
import pytest

from imdim.program.tree import Primitive
from imdim.search.mdl.blurred_skins import may_hide_skins

SIGMA = 0.05


def _points_of_plate(thick: float) -> np.ndarray:
    """Noisy points of both large faces of a plate 4 x 4 in the middle of which the plane z = 0 is."""
    rng = np.random.default_rng(7)
    sides = rng.choice([-0.5, 0.5], 4000) * thick
    flat = rng.uniform(-2, 2, (4000, 2))
    return np.column_stack([flat, sides]) + rng.normal(0, SIGMA, (4000, 3))


def test_points_of_a_surface_hide_no_skins():
    plate = Primitive("box", (4.0, 4.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert not may_hide_skins(plate, _points_of_plate(1.0), SIGMA)


@pytest.mark.parametrize("thick", [2.0, 2.5])
def test_points_on_both_sides_of_one_surface_may_be_two_skins(thick: float):
    # a body whose upper face lies in the middle of the thin plate, and the noise that explains the points beside it
    slab = Primitive("box", (40.0, 40.0, 20.0), (0.0, 0.0, -10.0), (0.0, 0.0, 0.0))
    told = SIGMA * float(np.hypot(1.0, thick / 2))
    assert may_hide_skins(slab, _points_of_plate(thick * SIGMA), told)
