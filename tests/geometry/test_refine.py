import numpy as np
import pytest
import trimesh
from tests.export.coincident import MEANT

from imdim.geometry.refine import split_edges
from imdim.geometry.solid import to_manifold, to_trimesh

PART = to_trimesh(to_manifold(MEANT["bracket"][0]))


def refined(longest: float, most: int) -> tuple[trimesh.Trimesh, np.ndarray]:
    vertices, faces, parents = split_edges(np.asarray(PART.vertices), np.asarray(PART.faces), longest, most)
    return trimesh.Trimesh(vertices, faces, process=False), parents


def test_refining_keeps_the_solid_closed():
    fine, _ = refined(4.0, 100_000)
    assert fine.is_watertight
    assert fine.volume == pytest.approx(PART.volume, rel=1e-12)
    assert fine.area == pytest.approx(PART.area, rel=1e-12)
    assert fine.edges_unique_length.max() <= 4.0
    bounded, _ = refined(0.001, 20_000)
    assert 18_000 < len(bounded.faces) <= 20_000
    assert bounded.edges_unique_length.max() < 0.2 * PART.edges_unique_length.max()


def test_each_part_knows_the_face_that_it_is_of():
    fine, parents = refined(4.0, 100_000)
    assert np.bincount(parents, fine.area_faces) == pytest.approx(PART.area_faces, rel=1e-9)
    np.testing.assert_allclose(fine.face_normals, PART.face_normals[parents], atol=1e-6)
