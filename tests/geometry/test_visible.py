"""The faces that are seen from above, against rays."""

import numpy as np
import trimesh

from imdim.geometry.visible import faces_seen


def test_rays_meet_the_faces_that_are_seen():
    rng = np.random.default_rng(0)
    mesh = trimesh.creation.torus(14.0, 5.0)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    mesh.apply_translation([30.3, 25.1, 0.0])
    owner = faces_seen(np.asarray(mesh.vertices)[mesh.faces], 60, 50)
    rows, columns = np.mgrid[:50, :60].reshape(2, -1)
    origins = np.column_stack([columns + 0.5, rows + 0.5, np.full(len(rows), 99.0)])
    met = mesh.ray.intersects_first(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)).reshape(50, 60)
    assert 0.1 < (met >= 0).mean() < 0.9
    np.testing.assert_array_equal(owner, met)


def test_no_pixel_falls_between_two_faces():
    # a fan about the middle of a pixel, whose sides go through middles of others
    turn = np.arange(9) * np.pi / 4
    rim = np.column_stack([20.5 + 30 * np.cos(turn), 20.5 + 30 * np.sin(turn), np.zeros(9)])
    fan = np.stack([np.broadcast_to([20.5, 20.5, 0.0], (8, 3)), rim[:-1], rim[1:]], axis=1)
    assert (faces_seen(fan, 41, 41) >= 0).all()
    assert set(np.unique(faces_seen(fan, 41, 41))) == set(range(8))


def test_the_nearest_face_is_seen_and_one_that_stands_upright_is_not():
    low = np.array([[0.0, 0.0, 1.0], [8.0, 0.0, 1.0], [0.0, 8.0, 1.0]])
    high = low[::-1] + np.array([0.0, 0.0, 1.0])  # it turns the other way
    upright = np.array([[0.0, 2.5, 5.0], [8.0, 2.5, 5.0], [4.0, 2.5, 9.0]])
    owner = faces_seen(np.stack([low, upright, high]), 8, 8)
    assert set(np.unique(owner)) == {-1, 2}
    assert (owner[0, :7] == 2).all()
    assert owner[7, 7] == -1
