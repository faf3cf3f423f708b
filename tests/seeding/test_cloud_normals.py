"""Spacing, noise and normals against clouds drawn with known ones."""

import numpy as np
import pytest
from scipy.spatial import KDTree
from tests.seeding.cloud_parts import thin_tube

from imdim.seeding.cloud_normals import estimate_normals, measure_scale


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.006])
def test_spacing_and_noise_of_a_square(noise):
    rng = np.random.default_rng(1)
    points = rng.random((4000, 3)) * (1, 1, 0) + rng.normal(scale=noise, size=(4000, 3)) * (0, 0, 1)
    scale = measure_scale(points, rng)
    assert scale.spacing == pytest.approx(1 / np.sqrt(4000), rel=0.06)
    assert scale.sigma == pytest.approx(noise, rel=0.2, abs=1e-9)
    assert scale.diagonal == pytest.approx(np.sqrt(2), rel=0.02)


@pytest.mark.parametrize("count", [8_000, 40_000, 100_000])
def test_the_noise_of_a_crowded_cloud_is_not_hidden_by_its_density(count):
    """Neighbours nearer than the noise lie in a ball, and some plane through a ball has few points far from it."""
    rng = np.random.default_rng(3)
    points = rng.random((count, 3)) * (1, 1, 0) + rng.normal(scale=0.015, size=(count, 3))
    assert measure_scale(points, rng).sigma == pytest.approx(0.015, rel=0.3)


def principal(points):
    """The least principal direction of the 12 nearest points."""
    around = points[KDTree(points).query(points, k=12)[1]]
    around = around - around.mean(1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]


def test_a_thin_wall_is_not_noise_and_keeps_its_normals():
    rng = np.random.default_rng(2)
    points, truth = thin_tube().sample(rng, 8192)
    scale = measure_scale(points, rng)
    assert scale.sigma < 0.001 * scale.diagonal
    found, trust = estimate_normals(points, scale, rng)
    good = np.abs((found * truth).sum(1)) > np.cos(np.radians(15))
    # principal directions blend the two sides of a wall that is thinner than the spacing
    blended = np.abs((principal(points) * truth).sum(1)) > np.cos(np.radians(15))
    assert good.mean() > 0.9
    assert blended.mean() < 0.6
    assert trust[good].mean() > trust[~good].mean()
