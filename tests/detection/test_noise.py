"""Spacing and noise against clouds drawn with known ones."""

import numpy as np
import pytest

from imdim.detection.noise import ENOUGH_POINTS, measure_noise


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.006])
def test_spacing_and_noise_of_a_square(noise):
    rng = np.random.default_rng(1)
    points = rng.random((4000, 3)) * (1, 1, 0) + rng.normal(scale=noise, size=(4000, 3)) * (0, 0, 1)
    found, kept = measure_noise(points, rng)
    assert found.spacing == pytest.approx(1 / np.sqrt(4000), rel=0.06)
    assert found.sigma == pytest.approx(noise, rel=0.2, abs=1e-9)
    assert found.diagonal == pytest.approx(np.sqrt(2), rel=0.02)
    assert len(kept) == 4000


@pytest.mark.parametrize("count", [8_000, 40_000, 100_000])
def test_the_noise_of_a_crowded_cloud_is_not_hidden_by_its_density(count):
    """Neighbours nearer than the noise lie in a ball, and some plane through a ball has few points far from it."""
    rng = np.random.default_rng(3)
    points = rng.random((count, 3)) * (1, 1, 0) + rng.normal(scale=0.015, size=(count, 3))
    found, kept = measure_noise(points, rng)
    assert found.sigma == pytest.approx(0.015, rel=0.3)
    assert len(kept) >= min(count, ENOUGH_POINTS)
    assert found.spacing >= found.sigma or len(kept) == min(count, ENOUGH_POINTS)


def tube(rng, wall: float, count: int) -> np.ndarray:
    """Points [n, 3] of the skins of an open tube of radius and height 1."""
    turn, up = rng.uniform(0, 2 * np.pi, count), rng.random(count)
    radius = np.where(rng.random(count) < 0.5, 1.0, 1.0 - wall)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), up])


@pytest.mark.parametrize(("wall", "count"), [(3.5, 8192), (6.0, 8192), (12.0, 8192), (30.0, 1600)])
def test_neither_walls_of_a_few_deviations_nor_curves_count_as_noise(wall, count):
    rng, sigma = np.random.default_rng(5), 0.012
    points = tube(rng, wall * sigma, count) + rng.normal(scale=sigma, size=(count, 3))
    found, kept = measure_noise(points, rng)
    assert found.sigma == pytest.approx(sigma, rel=0.2)
    assert len(kept) == count
