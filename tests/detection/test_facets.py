"""Facets of solids whose faces can be counted by hand."""

import math

import numpy as np
import pytest
import trimesh
from tests.planted import PARTS, box, cylinder, mesh_of

from imdim.detection.facets import facets_of, points_of


def test_a_box_is_six_facets_with_twelve_right_angles():
    facets = facets_of(mesh_of(box(2, 3, 4, (5.0, 6.0, 7.0))))
    assert sorted(facets.areas) == pytest.approx([6, 6, 8, 8, 12, 12])
    assert facets.angles == pytest.approx(np.full(12, math.pi / 2))
    assert facets.diagonal == pytest.approx(math.sqrt(29))
    # a box's face centre lies half an edge along the normal from the middle
    half = (facets.centers - (5.0, 6.0, 7.0)) * facets.normals
    assert np.sort(half.sum(1)) == pytest.approx([1, 1, 1.5, 1.5, 2, 2])
    assert np.abs(np.cross(facets.centers - (5.0, 6.0, 7.0), facets.normals)).max() < 1e-12


def test_finer_triangles_are_the_same_facets():
    fine = mesh_of(PARTS["L bracket"]).subdivide().subdivide()
    facets = facets_of(fine)
    assert len(facets.areas) == 8
    assert facets.areas.sum() == pytest.approx(fine.area)
    assert sum(len(facets.triangles(np.array([u]))) for u in range(8)) == len(fine.faces)


def test_a_cylinder_is_its_strips_and_two_ends():
    facets = facets_of(mesh_of(cylinder(2, 5), 64))
    strip = 5 * 4 * math.sin(math.pi / 64)
    end = 32 * 4 * math.sin(2 * math.pi / 64)
    assert np.sort(facets.areas) == pytest.approx([strip] * 64 + [end] * 2)
    assert np.sort(facets.angles) == pytest.approx([2 * math.pi / 64] * 64 + [math.pi / 2] * 128)


def test_a_gentle_fold_is_two_facets():
    lift = math.tan(math.radians(0.5))
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 0, lift], [-1, 1, lift]])
    facets = facets_of(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [4, 0, 3], [4, 3, 5]], process=False))
    assert len(facets.areas) == 2
    assert facets.facet_of[0] == facets.facet_of[1] != facets.facet_of[2] == facets.facet_of[3]
    assert facets.angles == pytest.approx([math.radians(0.5)])


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_size_does_not_matter(scale):
    mesh = mesh_of(PARTS["tube on a flange"])
    plain, scaled = facets_of(mesh), facets_of(trimesh.Trimesh(mesh.vertices * scale, mesh.faces, process=False))
    # three rings of strips and three flat rings; the order of equal areas is left to rounding
    assert len(plain.areas) == len(scaled.areas) == 3 * 96 + 3
    assert np.sort(scaled.areas) == pytest.approx(np.sort(plain.areas) * scale**2)
    assert np.sort(scaled.angles) == pytest.approx(np.sort(plain.angles), abs=1e-6)


def test_triangles_belong_to_their_facets():
    facets = facets_of(mesh_of(PARTS["countersink"]))
    chosen = np.array([0, 3, 5])
    assert set(facets.facet_of[facets.triangles(chosen)]) == {0, 3, 5}
    assert len(facets.triangles(chosen)) == np.isin(facets.facet_of, chosen).sum()


def test_where_only_the_next_facet_was_cut_a_facet_has_no_corner():
    """A square of three triangles, with a corner of what is above it in the middle of its upper edge; and a bend there of half a degree."""
    for rise, corners in ((0.0, 4), (0.005, 5)):
        plate = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0.5, 1 + rise, 0), (0, 1, 0)]
        mesh = trimesh.Trimesh([*plate, (0.5, 2, 1)], [(0, 1, 3), (1, 2, 3), (0, 3, 4), (3, 2, 5), (4, 3, 5)], process=False)
        facets = facets_of(mesh)
        square = int(np.argmax(facets.areas))
        assert facets.triangle_counts[square] == 3
        assert len(points_of(facets, np.array([square]))) == corners


def test_a_disc_of_very_many_sides_keeps_its_corners():
    """Each turns by less than what counts as straight."""
    facets = facets_of(mesh_of(cylinder(10, 1), 1500))
    assert facets.turns.all()
