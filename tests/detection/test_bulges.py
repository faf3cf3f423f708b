"""Waves and bulges of planted height, against flat and curved surfaces that have none."""

import numpy as np
import pytest

from imdim.detection.bulges import measure_bulges
from imdim.detection.noise import measure_noise

RNG = np.random.default_rng(2)
PLACES = RNG.uniform(-1, 1, (9000, 2))


def sheet(heights):
    return np.column_stack([PLACES, heights])


def test_exact_shapes_have_none():
    x, y = PLACES.T
    assert measure_bulges(sheet(0.3 * x - 0.2 * y)) < 1e-9
    assert measure_bulges(sheet(np.sqrt(9.0 - x**2 - y**2))) < 1e-3  # a ball of radius 3


def test_waves_are_told_by_their_height_where_neighbours_tell_none():
    """Waves as long as a sixth of the diagonal, with a deviation of 0.02, of which a quadric follows some."""
    x, y = PLACES.T
    points = sheet(0.02 * np.sqrt(2) * np.sin(2 * np.pi * x / 0.47) + 0.2 * y)
    assert 0.01 < measure_bulges(points) < 0.04
    assert measure_noise(points, np.random.default_rng(0))[0].sigma < 0.1 * measure_bulges(points)


def test_noise_without_waves_counts_twice():
    assert measure_bulges(sheet(0.01 * RNG.normal(size=len(PLACES)))) == pytest.approx(0.02, rel=0.1)


def test_few_points_have_none():
    assert measure_bulges(RNG.normal(size=(60, 3))) == 0.0
