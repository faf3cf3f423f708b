"""Surface samples against closed-form area shares and exact surfaces; the point-set backend against its definition."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from tests.known_programs import BOX, DRAWN_LEAVES, DRILLED, EVERY, LEAVES, TORUS

from imdim.geometry import kernels
from imdim.geometry.points import compute_error_embedding, is_inside, resample_to_fixed_size, sample_points, state_to_point_cloud
from imdim.geometry.sampling import even_surface, leaf_surface, surface_points
from imdim.geometry.surface_map import surface_area
from imdim.program.state import ADD_BOX, ADD_SPHERE, ShapeState
from imdim.program.tree import OUTLINED, Primitive


def share_close(measured: np.ndarray, share: float) -> bool:
    return abs(measured.mean() - share) < 4 * math.sqrt(share * (1 - share) / len(measured))


@pytest.mark.parametrize("primitive", [*LEAVES, *DRAWN_LEAVES], ids=lambda p: f"{p.kind}{p.size}")
def test_leaf_samples_lie_on_the_surface_with_its_normals(primitive):
    points, normals = leaf_surface(primitive, 3000, np.random.default_rng(1))
    np.testing.assert_allclose(kernels.program_sdf(primitive, points), 0, atol=1e-12)
    ahead = kernels.program_sdf(primitive, points + 1e-6 * normals)
    np.testing.assert_allclose(ahead, 1e-6, rtol=1e-3)


@pytest.mark.parametrize("primitive", [*LEAVES, *DRAWN_LEAVES], ids=lambda p: f"{p.kind}{p.size}")
def test_leaf_samples_are_even_by_the_divergence_theorem(primitive):
    # of an even sample of a closed surface, mean(n) = 0 and area / 3 * mean((p - c) . n) = volume
    n = 20_000
    points, normals = leaf_surface(primitive, n, np.random.default_rng(4))
    flux = ((points - primitive.center) * normals).sum(1) * surface_area(primitive.kind, primitive.size, primitive.outline) / 3
    volume = next(v for p, v in EVERY.values() if p == primitive)
    assert flux.mean() == pytest.approx(volume, abs=4 * flux.std() / math.sqrt(n) + 1e-12)
    assert np.abs(normals.mean(0)).max() < 4 / math.sqrt(n)


@pytest.mark.parametrize("primitive", [*LEAVES, *DRAWN_LEAVES], ids=lambda p: f"{p.kind}{p.size}")
def test_even_samples_lie_on_the_surface_and_chance_has_no_part_in_their_sums(primitive):
    n = 20_000
    points, normals = even_surface(primitive, n)
    assert len(points) == n or primitive.kind in ("torus", "ellipsoid", *OUTLINED)
    np.testing.assert_allclose(kernels.program_sdf(primitive, points), 0, atol=1e-12)
    flux = ((points - primitive.center) * normals).sum(1) * surface_area(primitive.kind, primitive.size, primitive.outline) / 3
    volume = next(v for p, v in EVERY.values() if p == primitive)
    # a tenth of the standard error of as many random points; rejection leaves some of theirs
    share = 0.1 if len(points) == n else 1.0
    assert flux.mean() == pytest.approx(volume, abs=share * flux.std() / math.sqrt(n) + 1e-5 * volume)


@pytest.mark.parametrize("size", [(1.0, 1.0), (0.05, 6.0), (3.0, 0.1)])
def test_even_samples_keep_their_distance_however_the_face_is_stretched(size):
    cylinder = Primitive("cylinder", size)
    points, _ = even_surface(cylinder, 4000)
    square = surface_area("cylinder", size) / len(points)
    nearest = KDTree(points).query(points, k=2)[0][:, 1]
    # of random points every fiftieth comes nearer than 0.08 sides, of a lattice of squares none than 1
    assert np.quantile(nearest, 0.02) > 0.4 * math.sqrt(square)


def test_a_sphere_as_an_ellipsoid_has_the_area_of_a_sphere():
    assert surface_area("ellipsoid", (0.7, 0.7, 0.7)) == pytest.approx(surface_area("sphere", (0.7,)), rel=1e-12)
    # oblate spheroid, closed form
    a, c = 1.0, 0.2
    e = math.sqrt(1 - c * c)
    assert surface_area("ellipsoid", (a, a, c)) == pytest.approx(2 * math.pi * (1 + c * c / e * math.atanh(e)), rel=1e-6)


@pytest.mark.parametrize("name", [n for n in EVERY if n != "nothing"])
def test_boundary_samples_of_programs_are_closed_and_even(name):
    program, _ = EVERY[name]
    n = 6000
    points, normals = surface_points(program, n, np.random.default_rng(8))
    assert points.shape == normals.shape == (n, 3)
    behind, ahead = (kernels.inside(program, points + step * normals) for step in (-1e-6, 1e-6))
    assert (behind & ~ahead).mean() > 0.999
    # divergence theorem on an even sample: mean(n) = 0, and x n_x, y n_y, z n_z all have the mean volume / area
    flux = (points - points.mean(0)) * normals
    assert np.abs(normals.mean(0)).max() < 4 / math.sqrt(n)
    for a in range(3):
        other = flux[:, a] - flux[:, (a + 1) % 3]
        assert abs(other.mean()) < 4 * other.std() / math.sqrt(n) + 1e-12


def test_boundary_shares_are_those_of_the_areas():
    points, _ = surface_points(DRILLED, 8000, np.random.default_rng(3))
    wall = np.abs(np.hypot(points[:, 0], points[:, 1]) - 0.25) < 1e-6
    on_wall, total = 2 * math.pi * 0.25, 6 - 2 * math.pi / 16 + 2 * math.pi * 0.25
    assert share_close(wall, on_wall / total)


def test_faces_shared_by_leaves_are_sampled_once():
    points, normals = surface_points(EVERY["ring"][0], 8000, np.random.default_rng(3))
    cap = math.pi * (0.25 - 0.09)
    assert share_close(np.abs(normals[:, 2]) > 0.5, 2 * cap / (2 * cap + 2 * math.pi * 0.8 * 0.3))
    points, _ = surface_points(EVERY["touching boxes"][0], 8000, np.random.default_rng(3))
    sheet = (np.abs(points[:, 2]) < 1e-9) & (np.abs(points[:, 0]) < 0.25)
    assert not sheet.any()


def test_a_program_without_boundary_gives_no_points():
    points, normals = surface_points(EVERY["nothing"][0], 100, np.random.default_rng(0))
    assert points.shape == normals.shape == (0, 3)


def state_of(*actions: tuple[int, tuple[float, ...]]) -> ShapeState:
    state = ShapeState()
    for token, params in actions:
        state.apply_action(token, params)
    return state


def test_state_cloud_is_the_sequence_of_unions_and_differences():
    cube = (0, 0, 0, 1, 1, 1, 0, 0, 0, 5.0)
    cut = (0.5, 0, 0, 0.4, 0, 0, 0, 0, 0, -5.0)
    ball = (0.5, 0, 0, 0.1, 0, 0, 0, 0, 0, 5.0)
    generator = torch.Generator().manual_seed(3)
    points = state_to_point_cloud(state_of((ADD_BOX, cube), (ADD_SPHERE, cut), (ADD_SPHERE, ball)), 4000, "cpu", generator)
    assert points.shape == (4000, 3)
    from_cut = torch.linalg.vector_norm(points - torch.tensor([0.5, 0, 0]), dim=1)
    on_ball = (from_cut - 0.1).abs() < 1e-5
    # of equal shares per solid, the box loses the disc of radius 0.4 of its face
    disc = math.pi * 0.16 / 6
    assert share_close(on_ball.numpy(), 1 / (2 - disc))
    assert (from_cut[~on_ball] > 0.4).all()
    assert torch.isclose(points[~on_ball].abs().amax(1), torch.tensor(0.5)).all()


def test_an_empty_state_gives_zeros():
    assert torch.equal(state_to_point_cloud(ShapeState(), 10), torch.zeros(10, 3))
    cut = (0, 0, 0, 0.4, 0, 0, 0, 0, 0, -5.0)
    assert torch.equal(state_to_point_cloud(state_of((ADD_SPHERE, cut)), 10), torch.zeros(10, 3))


def test_same_generator_same_points():
    a, b = (sample_points(TORUS, 50, torch.Generator().manual_seed(9)) for _ in range(2))
    assert torch.equal(a, b)
    assert is_inside(Primitive("torus", (0.5, 0.201), TORUS.center, TORUS.rotation), a).all()


def test_resampling_keeps_all_points_when_there_are_few():
    points = torch.arange(12.0).reshape(4, 3)
    grown = resample_to_fixed_size(points, 10, torch.Generator().manual_seed(0))
    assert grown.shape == (10, 3)
    assert {tuple(p) for p in grown.tolist()} == {tuple(p) for p in points.tolist()}
    assert len({tuple(p) for p in resample_to_fixed_size(points, 3).tolist()}) == 3
    assert sample_points(BOX, 0).shape == (0, 3)


def test_error_embedding_of_a_shifted_and_scaled_cloud():
    corners = torch.tensor([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    both = torch.stack([corners, corners])
    other = torch.stack([corners + torch.tensor([0.1, 0.0, 0.0]), corners * 2])
    got = compute_error_embedding(both, other)
    # a corner with m ones is sqrt(m) from its own double, which is a nearest point both ways
    directed = sum(math.sqrt(m) * count for m, count in ((1, 3), (2, 3), (3, 1))) / 8
    torch.testing.assert_close(got[0], torch.tensor([0.2, 0.1, 0.0]))
    assert got[1, 0].item() == pytest.approx(2 * directed, rel=1e-5)
    assert got[1, 1].item() == pytest.approx(math.sqrt(3) / 2, rel=1e-5)
    assert got[1, 2].item() == pytest.approx(math.log(2), rel=1e-5)
    assert torch.equal(compute_error_embedding(both, torch.empty(2, 0, 3)), torch.zeros(2, 3))
