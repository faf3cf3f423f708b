"""The axes that a part was drawn along: found again wherever it lies, and left where they are the world's."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of, sphere, union

from imdim.geometry.own_axes import find_own_axes
from imdim.geometry.rotations import matrix_from_euler, turn_about

BRACKET = union(box(40, 30, 4), box(4, 30, 24, center=(-18, 0, 10)))
FLANGE = union(cylinder(20, 2), cylinder(12, 14, center=(0, 0, 8)))
ODD = turn_about(np.array([1.0, 2.0, 3.0]) / 14**0.5, np.radians(30))


def axes_of(mesh):
    return find_own_axes(np.asarray(mesh.face_normals), np.asarray(mesh.area_faces))


def own_axes_of(mesh) -> np.ndarray:
    found = axes_of(mesh)
    assert found is not None
    return found


def lie(program, rotation):
    mesh = mesh_of(program)
    return trimesh.Trimesh(mesh.vertices @ rotation.T, mesh.faces, process=False)


@pytest.mark.parametrize("rotation", [np.eye(3), matrix_from_euler((90.0, 0.0, 0.0))])
def test_what_faces_an_axis_of_the_world_stays(rotation):
    assert axes_of(lie(BRACKET, rotation)) is None


def test_what_was_turned_about_an_axis_of_the_world_turns_back():
    typed = matrix_from_euler((0.0, 0.0, 27.0))
    assert np.allclose(own_axes_of(lie(BRACKET, typed)), typed, atol=1e-15)
    clip = cut(union(cylinder(20, 20), box(22, 10, 20, (27, 0, 0))), cylinder(16, 22), box(40, 2, 22, (20, 0, 0)))
    assert np.allclose(own_axes_of(lie(clip, typed)), typed, atol=1e-15)


def test_a_part_whose_flats_face_three_ways_across_an_axis_stays():
    program = union(*(box(30, 6, 8, (0, 0, 0), (0.0, 0.0, 27.0 + 60 * k)) for k in range(3)))
    assert axes_of(lie(program, np.eye(3))) is None


def test_a_bracket_that_lies_aslant_turns_back_by_the_shortest_way():
    assert np.allclose(own_axes_of(lie(BRACKET, ODD)), ODD, atol=1e-9)


def test_single_precision_does_not_hide_typed_angles():
    typed = matrix_from_euler((10.0, 20.0, 30.5))
    mesh = lie(BRACKET, typed)
    mesh = trimesh.Trimesh(mesh.vertices.astype(np.float32).astype(float), mesh.faces, process=False)
    assert np.allclose(own_axes_of(mesh), typed, atol=1e-15)


def test_a_turned_part_has_its_axis_and_facets_that_begin_at_another():
    own = lie(FLANGE, ODD).vertices @ own_axes_of(lie(FLANGE, ODD))
    rim = own[np.hypot(own[:, 0], own[:, 1]) > 19.9]
    assert np.allclose(np.hypot(rim[:, 0], rim[:, 1]), 20, atol=1e-9)
    assert np.abs(rim[:, 1]).min() < 1e-9


def test_facets_of_a_ball_do_not_tilt_a_flat():
    typed = matrix_from_euler((10.0, 20.0, 30.0))
    assert np.allclose(own_axes_of(lie(cut(box(60, 40, 20), sphere(12, (0, 0, 10))), typed)), typed, atol=1e-15)


def test_a_ball_has_no_axes():
    assert axes_of(trimesh.creation.icosphere(3)) is None


def test_the_order_of_triangles_is_no_matter():
    mesh = lie(cut(BRACKET, cylinder(5, 9)), ODD)
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    other = find_own_axes(mesh.face_normals[order], mesh.area_faces[order])
    assert other is not None
    assert np.allclose(own_axes_of(mesh), other, atol=1e-12)
