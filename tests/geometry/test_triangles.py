import numpy as np
import pytest
import trimesh

from imdim.geometry.triangles import distances, triangle_tree


def test_distances_to_a_box_are_the_closed_form():
    points = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    beyond = np.abs(points) - 0.5
    exact = np.where((beyond < 0).all(axis=1), -beyond.max(axis=1), np.linalg.norm(np.maximum(beyond, 0), axis=1))
    assert distances(triangle_tree(trimesh.creation.box()), points) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("faces", [1, 3, 5, 17])
def test_any_number_of_faces(faces):
    rng = np.random.default_rng(faces)
    mesh = trimesh.Trimesh(rng.normal(size=(3 * faces, 3)), np.arange(3 * faces).reshape(-1, 3), process=False)
    points = rng.normal(size=(200, 3))
    barycentric = rng.dirichlet((1, 1, 1), 4000)
    dense = (barycentric @ mesh.triangles).reshape(-1, 3)
    found = distances(triangle_tree(mesh), points)
    nearest = np.min(np.linalg.norm(points[:, None] - dense[None], axis=2), axis=1)
    assert (found <= nearest + 1e-12).all()
    assert found == pytest.approx(nearest, abs=0.12)


def test_a_degenerate_triangle_is_its_longest_edge():
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [4, 0, 0]], [[0, 1, 2]], process=False)
    assert distances(triangle_tree(mesh), np.array([[3.0, 2.0, 0.0], [7.0, 0.0, 4.0]])) == pytest.approx([2, 5])


def test_no_faces_is_an_error():
    with pytest.raises(ValueError, match="0 faces"):
        triangle_tree(trimesh.Trimesh())
