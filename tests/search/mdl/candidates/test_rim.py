"""Rims about a face, against the parts that they were sampled from."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, sphere

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.search.mdl.candidates.rim import rims

SIGMA = 0.2
TURN = (20.0, -35.0, 50.0)
TRAY = cut(box(60, 40, 12), box(50, 34, 9, (0.0, 0.0, 2.5)))  # a floor of 4, a wall of 8
OPEN = cut(box(60, 40, 12), box(70, 34, 9, (0.0, 0.0, 2.5)))  # at two sides
CUP = cut(cylinder(20, 30), cylinder(16, 30, (0.0, 0.0, 10.0)))


def noisy(program, n=6000):
    rng = np.random.default_rng(0)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


def best(part, program):
    """The overlap of the best rim with the part it was seen in."""
    solid = to_manifold(program)
    return max((volume_iou(to_manifold(rim), solid) for rim in rims(part, noisy(program), SIGMA)), default=0.0)


@pytest.mark.parametrize(
    ("floor", "part"),
    [(box(60, 40, 4, (0.0, 0.0, -4.0)), TRAY), (box(60, 40, 4, (0.0, 0.0, -4.0)), OPEN), (cylinder(20, 10, (0.0, 0.0, -10.0)), CUP)],
    ids=["tray", "open at two sides", "cup"],
)
def test_the_wall_about_a_floor_is_found(floor, part):
    assert best(floor, part) > 0.9


def test_a_turned_part_has_its_rim_too():
    def at(z):
        return tuple(matrix_from_euler(TURN) @ (0.0, 0.0, z))

    tray = cut(box(60, 40, 12, at(0.0), TURN), box(50, 34, 9, at(2.5), TURN))
    assert best(box(60, 40, 4, at(-4.0), TURN), tray) > 0.9


def test_a_face_on_which_nothing_stands_has_none():
    assert not list(rims(box(60, 40, 4), noisy(box(60, 40, 4)), SIGMA))


def test_what_has_no_flat_end_has_none():
    assert not list(rims(sphere(5), noisy(sphere(5)), SIGMA))


def test_outliers_that_are_few_are_no_rim():
    plate = box(60, 40, 4)
    strewn = np.random.default_rng(1).uniform((-30, -20, 4), (30, 20, 20), (5, 3))
    assert not list(rims(plate, np.concatenate([noisy(plate), strewn]), SIGMA))
