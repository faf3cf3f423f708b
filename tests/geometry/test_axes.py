"""Main directions of parts whose pose is planted."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from tests.planted import PARTS, cone, cut, mesh_of

from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import SynthesisConfig, draw_programs
from imdim.geometry.axes import clearest_axes, find_shared_axes, local_normals, main_axes
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.target.target import sample_surface

BOXY = ["plate with four holes", "L bracket", "open box", "rounded plate"]
ROUND = ["tube on a flange", "stepped shaft"]


def posed(name, seed, noise):
    mesh, rng = mesh_of(PARTS[name]), np.random.default_rng(seed)
    points, _ = sample_surface(mesh.vertices, mesh.faces, 2048, rng)
    turn = Rotation.random(random_state=seed).as_matrix()
    return (points + noise * np.linalg.norm(np.ptp(points, axis=0)) * rng.normal(size=points.shape)) @ turn.T + 3.0, turn


def off_deg(frame, turn):
    """How far each true axis is from the nearest axis found."""
    return np.degrees(np.arccos(np.clip(np.abs(turn.T @ frame).max(1), 0, 1)))


@pytest.mark.parametrize(("noise", "limit"), [(0.0, 0.3), (0.01, 2.0)])
@pytest.mark.parametrize("name", BOXY)
def test_boxes_in_any_pose(name, noise, limit):
    points, turn = posed(name, 3, noise)
    frame = main_axes(points)
    assert np.allclose(frame.T @ frame, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1)
    assert off_deg(frame, turn).max() < limit


@pytest.mark.parametrize(("noise", "limit"), [(0.0, 0.3), (0.01, 2.0)])
@pytest.mark.parametrize("name", ROUND)
def test_turned_parts_have_one_axis(name, noise, limit):
    points, turn = posed(name, 4, noise)
    assert off_deg(main_axes(points), turn)[2] < limit


def test_a_part_along_the_axes_stays_and_a_ball_is_left_alone():
    mesh = mesh_of(PARTS["L bracket"])
    points, _ = sample_surface(mesh.vertices, mesh.faces, 2048, np.random.default_rng(0))
    assert np.array_equal(main_axes(points), np.eye(3))
    ball = np.random.default_rng(0).normal(size=(2048, 3))
    frame = main_axes(ball / np.linalg.norm(ball, axis=1, keepdims=True))
    assert np.allclose(frame.T @ frame, np.eye(3))


def test_synthetic_programs_in_free_poses():
    """The true normals, of every face, lie along or across the axes found about as often as along or across those of any primitive."""
    generator = torch.Generator().manual_seed(0)
    solids, clouds = draw_programs(30, SynthesisConfig(n_max=6, free_rotation=1.0), generator)
    normals = surface_clouds(solids, 1000, generator)[1].double().numpy()

    def worth(frame, row):
        along = np.abs(normals[row] @ frame)
        one = np.radians(1.0)
        return float(((along < np.sin(one)) | (along > np.cos(one))).mean(0).sum())

    found = [worth(main_axes(c.double().numpy()), i) for i, c in enumerate(clouds)]
    best = [max(worth(r, i) for r in rows) for i, rows in enumerate(solids.rotations.double().numpy())]
    assert np.mean([f >= b - 0.03 for f, b in zip(found, best, strict=True)]) >= 0.8


def test_axes_shared_by_most_of_the_weight():
    turn = matrix_from_euler((20.0, -35.0, 50.0))
    directions = [*turn.T, -turn[:, 0], (0.6, 0.64, 0.48)]
    found = find_shared_axes(directions, [3, 2, 1, 2, 4])
    assert np.abs(found.T @ turn).max(0) == pytest.approx(1.0)
    assert np.linalg.det(found) == pytest.approx(1.0)
    assert (find_shared_axes([(0, 0, 1), (1, 0, 0), *turn.T], [3, 2, 1, 1, 1]) == np.eye(3)).all()
    assert np.abs(find_shared_axes([turn[:, 2]], [1.0]).T @ turn[:, 2]).max() == pytest.approx(1.0)
    assert (find_shared_axes([], []) == np.eye(3)).all()


def test_the_axis_of_a_turned_part_is_the_clearest_of_directions():
    ring = cut(cone(30.0, 20.0, 12.0), cone(29.0, 19.0, 13.0))
    points = surface_points(ring, 6000, np.random.default_rng(1))[0] + np.random.default_rng(2).normal(0, 0.5, (6000, 3))
    slanted = matrix_from_euler((40.0, 20.0, 10.0))
    assert clearest_axes(points, [slanted, np.eye(3)], 1.0) is not slanted
    turned = points @ slanted.T
    assert clearest_axes(turned, [slanted, np.eye(3)], 1.0) is slanted
    first = slanted @ matrix_from_euler((0.0, 0.0, 25.0))
    assert clearest_axes(turned, [first, slanted], 1.0) is first  # as clear as the others: the first is kept
    assert (clearest_axes(points, [matrix_from_euler((0.0, 0.0, 25.0))], 1.0) == np.eye(3)).all()  # ... but for the given ones


@pytest.mark.parametrize("line", [np.zeros((200, 3)), np.linspace(0, 1, 200)[:, None] * (1.0, 2.0, 3.0)])
def test_points_that_show_no_plane_keep_the_given_axes(line):
    normals, trust = local_normals(line)
    assert np.isfinite(normals).all()
    assert (trust == 0).all()
    assert (main_axes(line) == np.eye(3)).all()


def test_repeated_points_are_trusted_no_more_than_once_can_be():
    points = np.repeat(np.random.default_rng(0).normal(size=(40, 3)), 30, axis=0)
    trust = local_normals(points)[1]
    assert ((trust >= 0) & (trust <= 1)).all()
    assert np.isfinite(main_axes(points)).all()
