"""Bodies, through-holes and voids of solids that say how many they have."""

import pytest
from manifold3d import Manifold

from imdim.geometry.census import census_of

CUBE, BALL, PIN = Manifold.cube([10, 10, 10], True), Manifold.sphere(3, 32), Manifold.cylinder(20, 2, 2, 32, True)


@pytest.mark.parametrize(
    ("solid", "kind"),
    [
        (CUBE, (1, 0, 0)),
        (CUBE - PIN, (1, 1, 0)),
        (CUBE - PIN - PIN.rotate([90, 0, 0]), (1, 3, 0)),
        (CUBE - BALL, (1, 0, 1)),
        ((CUBE - BALL) + Manifold.sphere(1, 32), (2, 0, 1)),
        (CUBE + (CUBE - PIN).translate([20, 0, 0]), (2, 1, 0)),
        (CUBE + Manifold.cube([1e-3, 1e-3, 1e-3]).translate([20, 0, 0]), (1, 0, 0)),
    ],
)
def test_kinds(solid, kind):
    assert census_of(solid).kind == kind


def test_sizes():
    census = census_of(CUBE + CUBE.translate([20, 0, 0]))
    assert census.size == pytest.approx((30, 10, 10))
    assert census.volume == pytest.approx(2000)
