"""Balls and lying cylinders that a thin plate has the upper part of, against what they were sampled from."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, sphere, union

from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.search.mdl.candidates.half_round import half_rounds

SIGMA = 0.15
PLATE = box(30, 20, 1.2, (0.0, 0.0, -0.6))
BELOW = box(60, 60, 20, (0.0, 0.0, -10.6))
ALONG_X = (0.0, 90.0, 0.0)


def own(part, truth, n=8000):
    """Noisy points of the truth beside the part's surface and above the plate."""
    points = surface_points(truth, n, np.random.default_rng(0))[0]
    points = points[points[:, 2] > 0.05] + np.random.default_rng(1).normal(0, SIGMA, (np.count_nonzero(points[:, 2] > 0.05), 3))
    return points


@pytest.mark.parametrize(
    "part", [sphere(3), sphere(3, (0.0, 0.0, -1.0)), cylinder(3, 12, (0.0, 0.0, 0.0), ALONG_X)], ids=["half ball", "dome", "bar"]
)
def test_what_stands_on_a_thin_plate_does_not_come_out_below(part):
    truth = union(PLATE, cut(part, BELOW))
    found = [union(PLATE, half) for half in half_rounds(part, own(part, truth), np.eye(3), SIGMA)]
    solid = to_manifold(truth)
    assert max(volume_iou(to_manifold(program), solid) for program in found) > 0.99
    assert volume_iou(to_manifold(union(PLATE, part)), solid) < 0.98


def test_a_whole_ball_and_an_upright_cylinder_stay_whole():
    rng = np.random.default_rng(0)
    for part in (sphere(3), cylinder(3, 12)):
        assert not list(half_rounds(part, surface_points(part, 800, rng)[0], np.eye(3), SIGMA))


def test_other_kinds_and_too_few_points_give_none():
    points = own(sphere(3), union(PLATE, cut(sphere(3), BELOW)))
    assert not list(half_rounds(box(6, 6, 6), points, np.eye(3), SIGMA))
    assert not list(half_rounds(sphere(3), points[:3], np.eye(3), SIGMA))
