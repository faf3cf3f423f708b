"""Disturbed surfaces of a known part must come back with the part's exact relations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imdim.detection.fit_surface import fit_surface
from imdim.detection.regularise import regularise
from imdim.geometry.surface import Patch, Surface

RNG = np.random.default_rng(5)


def plane(axis: int, height: float, spread: float = 1.0) -> np.ndarray:
    points = RNG.uniform(-spread, spread, (300, 3))
    points[:, axis] = height
    return points


def tube(radius: float, center=(0.0, 0.0), low: float = -0.5, high: float = 0.5) -> np.ndarray:
    t = RNG.uniform(0, 2 * np.pi, 300)
    return np.stack([center[0] + radius * np.cos(t), center[1] + radius * np.sin(t), RNG.uniform(low, high, 300)], 1)


def fitted(kind: str, points: np.ndarray, outward: int = 0) -> Patch:
    return Patch(fit_surface(kind, points)[0], points, 1.0, outward)


def disturbed(points: np.ndarray, size: float = 0.003) -> np.ndarray:
    return points + RNG.normal(scale=size, size=points.shape)


def test_a_noisy_part_gets_its_exact_frame():
    clouds = [plane(2, 0.5), plane(2, -0.5), plane(0, 1.0), plane(1, -1.0, 0.2), tube(0.3), tube(0.6), tube(0.3, (1.0, 0.0))]
    kinds = ["plane"] * 4 + ["cylinder"] * 3
    patches = [fitted(k, disturbed(c)) for k, c in zip(kinds, clouds, strict=True)]
    out = regularise(patches, 0.003)
    for p, true in zip(out, (2, 2, 0, 1, 2, 2, 2), strict=True):
        assert np.abs(p.surface.axis[true]) == 1.0
    assert out[4].surface.point[:2] == pytest.approx(out[5].surface.point[:2], abs=1e-12)
    assert out[4].surface.sizes == out[6].surface.sizes
    assert out[4].surface.sizes[0] == pytest.approx(0.3, abs=1e-3)
    assert out[5].surface.sizes[0] == pytest.approx(0.6, abs=1e-3)


def test_a_turned_part_keeps_its_own_frame():
    turn = Rotation.from_euler("xyz", [20, 30, 40], degrees=True).as_matrix()
    clouds = [plane(2, 0.5), plane(0, 1.0), plane(1, -1.0), tube(0.3)]
    patches = [fitted(k, disturbed(c) @ turn.T) for k, c in zip(["plane"] * 3 + ["cylinder"], clouds, strict=True)]
    axes = np.array([p.surface.axis for p in regularise(patches, 0.003)])
    assert np.abs(axes[:3] @ axes[:3].T) == pytest.approx(np.eye(3), abs=1e-12)
    assert abs(axes[3] @ axes[0]) == pytest.approx(1, abs=1e-12)
    assert abs(axes[0] @ turn[:, 2]) > 0.99999


def test_flush_planes_become_one_and_walls_stay_apart():
    patches = [fitted("plane", plane(2, 0.0)), fitted("plane", plane(2, 0.001, 0.3)), fitted("plane", plane(2, 0.02))]
    a, b, c = (p.surface for p in regularise(patches, 0.002))
    assert a == b
    assert abs(c.point[2] - a.point[2]) == pytest.approx(0.02, abs=2e-4)


def test_a_real_slope_is_no_error():
    slope = np.radians(1.0)
    turn = Rotation.from_euler("x", slope).as_matrix()
    out = regularise([fitted("plane", plane(2, 0.0)), fitted("plane", plane(2, 0.5) @ turn.T)], 0.001)
    cosine = abs(np.dot(out[0].surface.axis, out[1].surface.axis))
    assert np.arccos(cosine) == pytest.approx(slope, rel=1e-6)


def test_outward_follows_a_flipped_plane():
    points = plane(2, 0.0)
    up = Patch(Surface("plane", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), points, 1.0, 1)
    down = Patch(Surface("plane", (0.0, 0.0, 0.0005), (0.0, 0.0, -1.0)), points[:50], 0.1, 1)
    a, b = regularise([up, down], 0.001)
    assert a.surface == b.surface
    assert a.outward == -b.outward


def test_a_torus_that_points_would_pull_through_its_own_axis_stays_a_solid():
    # the outer side of a torus that crosses itself, found as one that just does not, two degrees off its axis
    around, across = RNG.uniform(0, 2 * np.pi, 400), RNG.uniform(-1.2, 1.2, 400)
    rho = 0.21 + 0.27 * np.cos(across)
    points = np.stack([rho * np.cos(around), rho * np.sin(around), 0.27 * np.sin(across)], 1)
    tilt = np.radians(2.0)
    found = Surface("torus", (0.0, 0.0, 0.0), (float(np.sin(tilt)), 0.0, float(np.cos(tilt))), (0.24, 0.24))
    out = regularise([Patch(found, points, 1.0)], 0.02)[0].surface
    assert out.sizes[1] <= out.sizes[0]
