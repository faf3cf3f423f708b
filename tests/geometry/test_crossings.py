"""Crossings of rays against closed forms, against Embree, and where rays graze."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder

from imdim.geometry.crossings import ENTRIES, sort_columns
from imdim.geometry.solid import to_manifold, to_trimesh

OBLIQUE = np.array([0.48, 0.60, 0.64])
UP = np.array([0.0, 0.0, 1.0])


def columns(mesh, direction):
    return sort_columns(np.asarray(mesh.vertices)[mesh.faces], direction)


def test_a_ball_is_left_once_from_within_and_met_twice_from_below():
    mesh = trimesh.creation.icosphere(subdivisions=4)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (20_000, 3))
    radius, across = np.linalg.norm(points, axis=1), np.hypot(points[:, 0], points[:, 1])
    clear = (np.abs(radius - 1) > 0.02) & (np.abs(across - 1) > 0.02)
    expected = np.where(radius < 1, 1, np.where((across < 1) & (points[:, 2] < 0), 2, 0))
    assert (columns(mesh, UP).count_above(points)[clear] == expected[clear]).all()


@pytest.mark.parametrize("direction", [UP, OBLIQUE, -OBLIQUE])
def test_rays_through_corners_and_edges_of_a_closed_mesh_cross_it_an_even_number_of_times(direction):
    """From far below: each ray that enters leaves, be it through a vertex, along an edge or a wall."""
    mesh = to_trimesh(to_manifold(cut(box(8, 5, 3), cylinder(1, 8), cylinder(0.5, 8, (2, 1, 0)))))
    edges = np.asarray(mesh.vertices)[mesh.edges_unique].mean(axis=1)
    starts = np.concatenate([mesh.vertices, edges, mesh.triangles_center]) - 40 * direction
    counts = columns(mesh, direction).count_above(starts)
    assert (counts % 2 == 0).all()
    assert (counts[-len(mesh.faces) :] >= 2).mean() > 0.5


def test_embree_counts_the_same():
    embree = pytest.importorskip("trimesh.ray.ray_pyembree")
    mesh = trimesh.creation.torus(2.0, 0.7, major_sections=64, minor_sections=24)
    points = np.random.default_rng(1).uniform(-3, 3, (20_000, 3))
    rays = np.broadcast_to(OBLIQUE, points.shape)
    met = embree.RayMeshIntersector(mesh).intersects_id(points, rays, multiple_hits=True)[1]
    same = columns(mesh, OBLIQUE).count_above(points) == np.bincount(met, minlength=len(points))
    assert same.mean() > 0.999  # of single precision


def test_long_triangles_do_not_fill_every_column():
    mesh = trimesh.creation.cylinder(1.0, 200.0, sections=4000)
    sorted_columns = columns(mesh, OBLIQUE)
    assert len(sorted_columns.members) <= ENTRIES * len(mesh.faces)
    assert sorted_columns.count_above(np.zeros((1, 3))) == 1


def test_what_is_beside_the_mesh_or_not_a_number_is_not_under_it():
    mesh = trimesh.creation.box()
    points = np.array([[9.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, -9.0]])
    assert columns(mesh, UP).count_above(points).tolist() == [0, 0, 2]
