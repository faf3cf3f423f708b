"""Winding numbers against closed forms of solid angles and against analytic insides."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from imdim.geometry.winding import Interior, triangle_tree, winding_number


def queries(seed: int, count: int, reach: float) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


def square(half: float, cells: int) -> np.ndarray:
    """Triangles [2 cells^2, 3, 3] of a square in the plane z = 0 that faces +z."""
    grid = np.linspace(-half, half, cells + 1)
    x, y = (a.ravel() for a in np.meshgrid(grid[:-1], grid[:-1]))
    step = 2 * half / cells
    corner = [np.stack([x + i * step, y + j * step, 0 * x], axis=1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return np.concatenate([np.stack([corner[0], corner[1], corner[2]], 1), np.stack([corner[0], corner[2], corner[3]], 1)])


@pytest.mark.parametrize("height", [0.01, 0.3, 1.0, 5.0, 40.0])
@pytest.mark.parametrize("cells", [1, 60])
def test_a_square_seen_from_its_axis(height, cells):
    # solid angle of a square pyramid of half angle t = half / height: 4 asin(t^2 / (1 + t^2))
    tangent = 1.5 / height
    expected = 4 * math.asin(tangent**2 / (1 + tangent**2)) / (4 * math.pi)
    below = winding_number(square(1.5, cells), np.array([[0.0, 0.0, -height], [0.0, 0.0, height]]))
    assert below == pytest.approx([expected, -expected], abs=8e-3)


def test_a_torus_inside_and_outside():
    mesh = trimesh.creation.torus(2.0, 0.7, major_sections=192, minor_sections=96)
    points = queries(1, 20_000, 3.0)
    gap = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 2.0, points[:, 2]) - 0.7
    clear = np.abs(gap) > 0.005  # beyond the facets' sagitta
    number = winding_number(mesh, points[clear])
    assert np.abs(number - (gap[clear] < 0)).max() < 0.1
    assert (Interior(mesh).contains(points[clear]) == (gap[clear] < 0)).all()


def test_rays_agree_with_the_closed_form_of_a_box_to_the_last_query():
    points = queries(2, 50_000, 1.0)
    mesh = trimesh.creation.box((1.0, 1.2, 0.8))
    assert (Interior(mesh).contains(points) == (np.abs(points) < [0.5, 0.6, 0.4]).all(axis=1)).all()


@pytest.mark.parametrize(("scale", "place"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e4)])
def test_any_unit_and_place(scale, place):
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.apply_scale(scale).apply_translation([place * scale] * 3)
    points = queries(3, 2_000, 1.5)
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 1) > 0.02
    inside = Interior(mesh).contains((points[clear] + place) * scale)
    assert (inside == (radius[clear] < 1)).all()


def test_an_open_mesh_is_told_by_the_winding_number():
    mesh = trimesh.creation.icosphere(subdivisions=4)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.9)
    assert not mesh.is_watertight
    points = queries(4, 2_000, 1.5)
    radius = np.linalg.norm(points, axis=1)
    clear = (np.abs(radius - 1) > 0.02) & (points[:, 2] < 0.6)
    assert (Interior(mesh).contains(points[clear]) == (radius[clear] < 1)).all()


def test_two_solids_in_one_place_count_twice():
    box = trimesh.creation.box()
    both = trimesh.util.concatenate([box, trimesh.creation.box((3.0, 3.0, 3.0))])
    assert winding_number(triangle_tree(both), np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]])) == pytest.approx([2, 1, 0], abs=1e-9)


def test_no_queries_give_no_answers():
    assert Interior(trimesh.creation.box()).contains(np.zeros((0, 3))).shape == (0,)
