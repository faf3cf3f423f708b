"""Ellipsoids fitted to points that the test places by its own parametrisation."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.detection.cloud_parts import detected

from imdim.detection.cloud_kernels import ELLIPSOID, distance_and_cosine, pack, unpack
from imdim.detection.cloud_rays import crossings
from imdim.detection.fit_ellipsoid import make_ellipsoid, quadric_ellipsoid, shows_ellipsoid
from imdim.detection.fit_surface import fit_surface
from imdim.geometry.surface import normals, signed_distance

SIZES = (0.9, 0.6, 0.35)
FRAME = Rotation.from_euler("xyz", [20, 35, -50], degrees=True).as_matrix()
CENTER = np.array([3.0, -1.0, 2.0])
TRUTH = make_ellipsoid(CENTER, FRAME, np.array(SIZES))


def sampled(rng: np.random.Generator, n: int, least_height: float = -1.0) -> np.ndarray:
    """Points [n, 3] on the ellipsoid, above a height of the ball along its third semi-axis."""
    h, t = rng.uniform(least_height, 1, n), rng.uniform(0, 2 * math.pi, n)
    ring = np.sqrt(1 - h * h)
    return np.stack([ring * np.cos(t), ring * np.sin(t), h], 1) * SIZES @ FRAME.T + CENTER


@pytest.mark.parametrize("least_height", [-1.0, 0.0, 0.7])
def test_exact_points_give_the_exact_ellipsoid(least_height):
    points = sampled(np.random.default_rng(0), 200, least_height)
    for found in (quadric_ellipsoid(points), fit_surface("ellipsoid", points)[0]):
        assert found is not None
        assert sorted(found.sizes) == pytest.approx(sorted(SIZES), rel=1e-6)
        assert found.point == pytest.approx(CENTER, abs=1e-6)
        assert np.abs(signed_distance(found, sampled(np.random.default_rng(1), 99))).max() < 1e-6


def test_a_robust_fit_ignores_a_fifth_of_outliers():
    rng = np.random.default_rng(2)
    points = sampled(rng, 500)
    noisy = points + rng.normal(scale=0.003, size=points.shape)
    near = make_ellipsoid(CENTER + 0.02, FRAME @ Rotation.from_euler("x", 3, degrees=True).as_matrix(), 1.03 * np.array(SIZES))
    far = points[:100] + rng.uniform(0.1, 0.6, (100, 1)) * normals(TRUTH, points[:100])
    found, rms = fit_surface("ellipsoid", np.vstack([noisy, far]), start=near, scale=0.01)
    assert rms == pytest.approx(0.003, rel=0.2)
    assert sorted(found.sizes) == pytest.approx(sorted(SIZES), abs=0.003)


def test_a_held_frame_stays():
    start = make_ellipsoid(CENTER + 0.02, FRAME, 1.05 * np.array(SIZES))
    found, rms = fit_surface("ellipsoid", sampled(np.random.default_rng(3), 200), start=start, hold="axis")
    assert np.allclose(found.frame, FRAME, atol=1e-12)
    assert found.sizes == pytest.approx(SIZES, rel=1e-6)
    assert rms < 1e-7


@pytest.mark.parametrize("flat", ["plane", "cylinder", "saddle"])
def test_what_is_no_ellipsoid_is_none_or_is_not_shown(flat):
    u, v = np.random.default_rng(4).uniform(-1, 1, (2, 200))
    z = {"plane": 0 * u, "cylinder": np.sqrt(2 - u * u), "saddle": u * u - v * v}[flat]
    points = np.stack([u, v, z], 1)
    found = quadric_ellipsoid(points)
    assert found is None or max(found.sizes) > 100 or not shows_ellipsoid(found, points, 1e-4)


def test_a_ball_is_no_ellipsoid():
    points = (sampled(np.random.default_rng(5), 200) - CENTER) @ FRAME / SIZES
    assert not shows_ellipsoid(fit_surface("ellipsoid", points)[0], points, 1e-6)
    assert shows_ellipsoid(TRUTH, sampled(np.random.default_rng(5), 200), 1e-6)


def test_distances_and_normals_are_those_of_the_surface_moved_along_them():
    points = sampled(np.random.default_rng(6), 100)
    for step in (-1e-4, 1e-4):
        assert signed_distance(TRUTH, points + step * normals(TRUTH, points)) == pytest.approx(step, rel=1e-2)
    assert signed_distance(TRUTH, CENTER[None])[0] == pytest.approx(-min(SIZES))


def test_the_compiled_twin_agrees():
    rng = np.random.default_rng(7)
    points, row = CENTER + rng.normal(size=(50, 3)), pack(TRUTH)
    assert unpack(ELLIPSOID, row) == TRUTH
    for point, distance, normal in zip(points, signed_distance(TRUTH, points), normals(TRUTH, points), strict=True):
        assert distance_and_cosine(ELLIPSOID, row, *point, *normal) == pytest.approx((distance, 1.0))
        out = np.empty(4)
        count = crossings(ELLIPSOID, row, point, normal, out)
        assert count in (0, 2)
        assert signed_distance(TRUTH, point + out[:count, None] * normal) == pytest.approx(0, abs=1e-9)


def test_a_cloud_of_half_an_ellipsoid_on_its_base_gives_both():
    rng = np.random.default_rng(8)
    dome = sampled(rng, 40_000, 0.0)
    local = (dome - CENTER) @ FRAME / SIZES
    slope = np.linalg.norm(local / SIZES, axis=1)  # of the area that the ball's is stretched to
    dome = dome[rng.random(len(dome)) < slope / slope.max()][:6000]
    radius, turn = np.sqrt(rng.random(2000)), rng.uniform(0, 2 * math.pi, 2000)
    base = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], 1) * SIZES @ FRAME.T + CENTER
    patches = detected(np.concatenate([dome, base]), None, rng)
    assert sorted(p.surface.kind for p in patches) == ["ellipsoid", "plane"]
    (found,) = (p for p in patches if p.surface.kind == "ellipsoid")
    assert sorted(found.surface.sizes) == pytest.approx(sorted(SIZES), abs=1e-4)
    assert len(found.points) == pytest.approx(len(dome), rel=0.02)
    assert found.outward == 1
