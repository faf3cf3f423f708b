"""Fits are compared with surfaces that the test samples by its own parametrisations."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imdim.detection.fit_surface import fit_surface
from imdim.geometry.surface import Surface, signed_distance


def sampled(kind: str, sizes: tuple[float, ...], rng: np.random.Generator, n: int = 400, arc: float = 2 * math.pi):
    """Points and normals [n, 3] in a local frame, axis z, over an arc of the turn."""
    t, h = rng.uniform(0, arc, n), rng.uniform(-1, 1, n)
    ring = np.stack([np.cos(t), np.sin(t), 0 * t], 1)
    z = np.array([0.0, 0.0, 1.0])
    if kind == "plane":
        return np.stack([h, rng.uniform(-1, 1, n), 0 * h], 1), np.tile(z, (n, 1))
    if kind == "sphere":
        normal = ring * np.sqrt(1 - h**2)[:, None] + h[:, None] * z
        return sizes[0] * normal, normal
    if kind == "cylinder":
        return sizes[0] * ring + h[:, None] * z, ring
    if kind == "cone":
        height = 1.5 + h  # from 0.5 to 2.5 above the apex
        return height[:, None] * (math.tan(sizes[0]) * ring + z), math.cos(sizes[0]) * ring - math.sin(sizes[0]) * z
    s = rng.uniform(0, 2 * math.pi, n)
    normal = np.cos(s)[:, None] * ring + np.sin(s)[:, None] * z
    return sizes[0] * ring + sizes[1] * normal, normal


CASES = [("plane", ()), ("sphere", (0.7,)), ("cylinder", (0.4,)), ("cone", (0.5,)), ("cone", (0.02,)), ("torus", (1.0, 0.3))]


def placed(kind, sizes, rng, arc=2 * math.pi):
    points, normals = sampled(kind, sizes, rng, arc=arc)
    rotation = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    shift = rng.normal(size=3) * 3
    truth = Surface(kind, tuple(shift), tuple(rotation[:, 2]), sizes)
    return points @ rotation.T + shift, normals @ rotation.T, truth


def gap(found: Surface, truth: Surface, points: np.ndarray) -> float:
    """Largest distance of the found surface from points of the true one."""
    return float(np.abs(np.abs(signed_distance(found, points)) - np.abs(signed_distance(truth, points))).max())


@pytest.mark.parametrize(("kind", "sizes"), CASES)
@pytest.mark.parametrize("with_normals", [True, False])
@pytest.mark.parametrize("arc", [2 * math.pi, 1.2])
def test_exact_points_give_the_exact_surface(kind, sizes, with_normals, arc):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        points, normals, truth = placed(kind, sizes, rng, arc)
        signs = rng.choice([-1.0, 1.0], (len(normals), 1))
        found, rms = fit_surface(kind, points, normals * signs if with_normals else None)
        assert found.kind == kind
        assert rms < 1e-7
        assert found.sizes == pytest.approx(sizes, rel=1e-5)
        assert abs(np.dot(found.axis, truth.axis)) > 1 - 1e-9 or kind == "sphere"
        assert gap(found, truth, points) < 1e-6


@pytest.mark.parametrize(("kind", "sizes"), CASES)
def test_robust_fit_ignores_a_fifth_of_outliers(kind, sizes):
    rng = np.random.default_rng(3)
    points, normals, truth = placed(kind, sizes, rng)
    noisy = points + rng.normal(scale=0.005, size=points.shape)
    near = Surface(kind, tuple(np.asarray(truth.point) + 0.02), truth.axis, tuple(1.02 * s for s in sizes))
    far = points[:80] + rng.uniform(0.1, 1.0, (80, 1)) * normals[:80]
    found, rms = fit_surface(kind, np.vstack([noisy, far]), start=near, scale=0.02)
    assert rms == pytest.approx(0.005, rel=0.2)
    assert gap(found, truth, points) < 0.005


def test_noise_gives_its_rms():
    rng = np.random.default_rng(0)
    points, normals, _ = placed("cylinder", (0.4,), rng)
    radial = rng.normal(scale=0.01, size=(len(points), 1))
    _, rms = fit_surface("cylinder", points + radial * normals, normals)
    assert rms == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("kind", ["plane", "cylinder", "cone", "torus"])
def test_a_held_axis_stays_while_the_rest_is_fitted(kind):
    sizes = dict(CASES)[kind]
    points, _ = sampled(kind, sizes, np.random.default_rng(1))
    start = Surface(kind, (0.03, -0.02, 0.01), (0.0, 0.0, 1.0), tuple(1.1 * s for s in sizes))
    found, rms = fit_surface(kind, points, start=start, hold="axis")
    assert found.axis == pytest.approx((0, 0, 1))
    assert rms < 1e-7
    if kind != "plane":
        line, rms = fit_surface(kind, points, start=start, hold="line")
        assert line.point[:2] == pytest.approx((0.03, -0.02))
        assert 1e-3 < rms < 0.1


def test_bad_input_names_the_number():
    with pytest.raises(ValueError, match="unknown surface kind 'egg'"):
        fit_surface("egg", np.zeros((9, 3)))
    with pytest.raises(ValueError, match=r"n >= 5, 3\], got \[4, 3\]"):
        fit_surface("cylinder", np.zeros((4, 3)))
    with pytest.raises(ValueError, match="1 are not"):
        fit_surface("sphere", np.array([[0, 0, np.nan], [1, 0, 0], [0, 1, 0], [0, 0, 1]]))
