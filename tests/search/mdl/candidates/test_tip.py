"""Tips of cylinders, against the pins and holes that they were sampled from."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Combine, Primitive, leaves
from imdim.search.mdl.candidates.tip import tips
from imdim.search.mdl.primitive_selection import Cloud

SIGMA = 0.3
TURN = (20.0, -35.0, 50.0)
PIN = cylinder(2.5, 15, (0.0, 0.0, 7.5))
POINTED = union(PIN, Primitive("cone", (2.5, 0.0, 4.0), (0.0, 0.0, 17.0)))
ROUNDED = union(PIN, Primitive("sphere", (2.5,), (0.0, 0.0, 15.0)))
TAPERED = union(PIN, Primitive("cone", (2.5, 1.25, 3.0), (0.0, 0.0, 16.5)))
FLARED = union(PIN, Primitive("cone", (2.5, 3.75, 3.0), (0.0, 0.0, 16.5)))


def noisy(program, n=3000, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


def overlap(a, b):
    return volume_iou(to_manifold(a), to_manifold(b))


def best(part, points, truth):
    """The overlap with the truth of the best of the tips, and of the part as it is."""
    cloud = Cloud.of(points, SIGMA)
    return max((overlap(tip, truth) for tip in tips(part, cloud, SIGMA)), default=0.0), overlap(part, truth)


@pytest.mark.parametrize("truth", [POINTED, ROUNDED, TAPERED, FLARED], ids=["cone", "ball", "taper", "flare"])
def test_a_pin_that_was_fitted_to_its_tip_gets_the_tip(truth):
    with_tip, flat = best(cylinder(2.45, 17, (0.0, 0.0, 8.5)), noisy(truth), truth)
    assert with_tip > flat + 0.02
    assert with_tip > 0.93


def test_a_tip_is_found_at_the_lower_end_and_in_any_pose():
    def placed(kind, size, z):
        turn = matrix_from_euler(TURN)
        return Primitive(kind, size, tuple((turn @ (0.0, 0.0, z)).tolist()), TURN)

    truth = union(placed("cylinder", (2.5, 15.0), 7.5), placed("cone", (0.0, 2.5, 4.0), -2.0))
    with_tip, flat = best(placed("cylinder", (2.5, 17.0), 6.5), noisy(truth), truth)
    assert with_tip > max(flat + 0.02, 0.93)


def test_a_drilled_hole_has_the_cone_of_the_drill():
    hole = union(cylinder(4, 20, (0.0, 0.0, 0.0)), Primitive("cone", (0.0, 4.0, 3.0), (0.0, 0.0, -11.5)))
    block = cut(box(40, 40, 30, (0.0, 0.0, -6.0)), hole)
    points = noisy(block, 9000)
    found, flat = best(cylinder(4, 21, (0.0, 0.0, -0.5)), points, hole)
    assert found > flat + 0.01


def test_a_flat_end_has_no_tip_and_neither_has_another_kind():
    cloud = Cloud.of(noisy(PIN), SIGMA)
    assert not list(tips(PIN, cloud, SIGMA))
    assert not list(tips(box(5, 5, 15, (0.0, 0.0, 7.5)), cloud, SIGMA))


def test_a_pin_that_is_all_noise_has_no_tip():
    """There was no place for a tip, and an error where the best of none was looked for."""
    needle = cylinder(0.1, 15)
    assert not list(tips(needle, Cloud.of(noisy(needle, 300), SIGMA), SIGMA))


def test_a_tip_ends_where_the_cylinder_is_and_stands_on_it():
    found = list(tips(cylinder(2.45, 17, (0.0, 0.0, 8.5)), Cloud.of(noisy(POINTED), SIGMA), SIGMA))
    assert found
    for tip in found:
        assert isinstance(tip, Combine)
        body, end = leaves(tip)
        assert body.center[2] - body.size[1] / 2 == pytest.approx(0.0)
        assert to_manifold(tip).decompose()[0].volume() == pytest.approx(to_manifold(tip).volume())
        assert end.size[0] == body.size[0]
