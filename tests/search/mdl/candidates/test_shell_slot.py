"""Walls and round ends in the place of one primitive, against closed forms."""

import math

import numpy as np
import pytest
from tests.planted import box, cone, cut, cylinder, sphere

from imdim.geometry import kernels
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold
from imdim.program.cost import count
from imdim.search.mdl.candidates.shell_slot import shells, stadiums
from imdim.search.mdl.primitive_selection import Cloud

CLOSED = [box(30, 20, 12, (1.0, 2.0, 3.0), (10.0, 20.0, 30.0)), cylinder(12, 20), sphere(15), cone(14, 9, 18)]


def cloud_of(program, n=6000):
    return Cloud.of(surface_points(program, n, np.random.default_rng(0))[0], 0.0)


@pytest.mark.parametrize("part", CLOSED, ids=lambda p: p.kind)
def test_a_wall_lies_half_to_either_side_of_its_part(part):
    (wall,) = shells(part, 2.0, cloud_of(part), 0.1)
    points, normals = surface_points(part, 3000, np.random.default_rng(1))
    inner = points[kernels.program_sdf(wall, points) < -0.99]  # but for the edges, where the wall is thicker
    assert len(inner) > 2900
    for by, inside in ((0.95, 1.0), (-0.95, 1.0), (1.6, 0.0), (-1.6, 0.0)):
        assert kernels.inside(wall, points + by * normals).mean() == pytest.approx(inside, abs=0.05 if inside else 0.2)


def test_ends_without_points_are_open():
    tube = cut(cone(14, 9, 18), cone(13, 8, 18.1))
    opened, closed = shells(cone(13.5, 8.5, 18), 1.0, cloud_of(tube), 0.1)
    probes = np.array([(0.0, 0.0, -9.0), (0.0, 0.0, 9.0)])
    assert not kernels.inside(opened, probes).any()
    assert kernels.inside(closed, probes).all()
    # a slanted wall of thickness t on the mean circumference
    assert to_manifold(opened).volume() == pytest.approx(1.0 * 2 * math.pi * 11 * math.hypot(18, 5), rel=0.02)


def test_what_a_wall_has_no_room_for_is_none():
    assert not list(shells(sphere(1), 2.5, cloud_of(sphere(1)), 0.1))


def test_round_ends_take_the_corners_of_a_box():
    volumes = {(count(s).primitives, round(to_manifold(s).volume() / 5)) for s in stadiums(box(40, 10, 6), 0.1)}
    corner = 1 - math.pi / 4  # of a square of the radius
    for radius, height in ((5, 6), (3, 40), (3, 10)):
        for ends in (1, 2):
            assert (1 + ends, round((2400 - 2 * ends * corner * radius**2 * height) / 5)) in volumes


def test_ends_too_small_to_be_seen_round_stay():
    assert not list(stadiums(box(40, 6, 6), 1.0))
