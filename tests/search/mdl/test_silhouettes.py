"""Circles, lines and flat faces by contrast, on parts whose numbers are known."""

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import box, cone, cut, cylinder, union

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, ellipse
from imdim.program.tree import Primitive
from imdim.search.mdl.curve_fitting import _cost
from imdim.search.mdl.curve_ransac import best_curve, circles, crowding, find_filled_stretch, fit_circle, fit_line
from imdim.search.mdl.silhouettes import outlines

SIGMA = 0.3


def cloud(program, n=8000, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


def nearest(found, truth):
    """The largest difference of a number, of the found primitive of the true one's kind that is nearest to it."""
    alike = [p for p in found if p.kind == truth.kind]
    off = [max(*np.abs(np.subtract(p.size, truth.size)), *np.abs(np.subtract(p.center, truth.center))) for p in alike]
    return min(off, default=np.inf)


def test_holes_bosses_and_cones_of_a_plate_are_seen():
    boss, hole = cylinder(6, 14, (10.0, 4.0, 10.0)), cylinder(3, 6, (-12.0, 0.0, 0.0))
    spout = cone(6.0, 2.0, 10.0, (10.0, 4.0, 22.0))
    part = cut(union(box(44, 32, 6), boss, spout), cylinder(3, 9, (-12.0, 0.0, 0.0)))
    found = outlines(cloud(part), np.eye(3), SIGMA, seed=1).primitives  # the spout is seen with 5 of 8 seeds
    assert nearest(found, box(44, 32, 6)) < 0.8
    assert nearest(found, hole) < 1.0
    assert min(abs(p.size[0] - 6) for p in found if p.kind == "cylinder") < 0.2
    assert nearest(found, spout) < 1.2


def test_they_turn_with_the_part():
    turn = matrix_from_euler((20.0, -35.0, 50.0))
    found = outlines(cloud(cut(cylinder(20, 30), cylinder(12, 40))) @ turn.T, turn, SIGMA).primitives
    radii = [p.size[0] for p in found if p.kind == "cylinder" and abs(matrix_from_euler(p.rotation)[:, 2] @ turn[:, 2]) > 0.999]
    assert min(abs(r - 20) for r in radii) < 0.2
    assert min(abs(r - 12) for r in radii) < 0.2


def test_evenly_strewn_points_show_nothing():
    assert outlines(np.random.default_rng(0).uniform(-20, 20, (6000, 3)), np.eye(3), SIGMA) == ([], False)


def test_the_same_seed_sees_the_same():
    points = cloud(cut(box(40, 30, 8), cylinder(5, 20)), 4000)
    assert outlines(points, np.eye(3), SIGMA) == outlines(points, np.eye(3), SIGMA)


def test_a_circle_in_a_crowd_is_found_and_fitted():
    rng = np.random.default_rng(1)
    angle = rng.uniform(0, 2 * np.pi, 400)
    ring = np.column_stack([3 + 5 * np.cos(angle), -2 + 5 * np.sin(angle)]) + rng.normal(0, 0.1, (400, 2))
    points = np.concatenate([ring, rng.uniform(-12, 12, (2000, 2))])
    assert np.median(crowding(points, 0.1)[:400]) > 0 == np.median(crowding(points, 0.1)[400:])
    wall = np.flatnonzero(crowding(points, 0.1) > 0)
    x, y, r, contrast = best_curve(circles, points, rng.choice(wall, (4000, 3)), points, 0.15, 15.0)
    center, radius = fit_circle(points, (x, y), r, 0.1)
    assert contrast > 8
    assert (*center, radius) == pytest.approx((3, -2, 5), abs=0.05)


def test_a_line_is_fitted_and_ends_where_it_is_no_longer_filled():
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-4, 4, 500), rng.normal(1.0, 0.1, 500)])
    origin, normal = fit_line(points, np.array([[-3.0, 0.9], [3.0, 1.2]]), 0.1)
    assert abs(normal[1]) == pytest.approx(1.0, abs=1e-3)
    assert origin[1] == pytest.approx(1.0, abs=0.02)
    low, high = find_filled_stretch(np.concatenate([rng.uniform(2, 5, 300), rng.uniform(0, 9, 60)]), rng.uniform(0, 9, 60), 0.1)
    assert (low, high) == pytest.approx((2, 5), abs=0.5)
    assert find_filled_stretch(np.arange(5.0), np.arange(5.0), 0.1) is None


def test_without_time_nothing_is_looked_for():
    assert outlines(cloud(box(44, 32, 6), 500), np.eye(3), SIGMA, deadline=PASSED) == ([], True)


def test_a_thin_elliptic_tube_is_drawn_from_end_to_end():
    """Its ends have too few points to be seen as faces, and its section is two ellipses."""
    ring = Outline((ellipse(16.0, 12.0), ellipse(14.5, 10.5)))
    tube = Primitive("extrude", (80.0,), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), ring)
    found = [p for p in outlines(cloud(tube), np.eye(3), SIGMA, drawn=True).primitives if p.outline and len(p.outline.loops) == 2]
    assert found
    nearest = max(found, key=lambda p: volume_iou(to_manifold(p), to_manifold(tube)))
    assert volume_iou(to_manifold(nearest), to_manifold(tube)) > 0.8
    assert nearest.outline
    assert all(isinstance(loop, Ellipse) for loop in nearest.outline.loops)


def test_a_loop_that_bounds_nothing_is_dearer_than_any_ellipse():
    """Its corners may have met where carriers cross."""
    turns = np.linspace(0.0, 2 * np.pi, 200, endpoint=False)
    points = np.column_stack([16 * np.cos(turns), 12 * np.sin(turns)])
    collapsed = ((1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 0.0))
    assert _cost(collapsed, points, SIGMA, 5.0) == np.inf
    assert _cost(Ellipse(16.0, 12.0), points, SIGMA, 5.0) == pytest.approx(25.0, abs=0.1)
