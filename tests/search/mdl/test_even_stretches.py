"""Stretches over which a cloud is evenly dense."""

import numpy as np
import pytest

from imdim.search.mdl.even_stretches import find_even_stretches


def test_walls_lie_between_faces_that_noise_blurs_into_one():
    """Floors 2, 4 and 6 mm above a base: no level among them stands out."""
    rng, sigma = np.random.default_rng(3), 0.65
    faces = np.repeat([0.0, 2.0, 4.0, 6.0, 20.0], [1500, 900, 500, 500, 700])
    heights = np.concatenate([faces, rng.uniform(0, 20, 3500)]) + rng.normal(0, sigma, 7600)
    found = find_even_stretches(heights, sigma, 6.0)
    assert found[-1] == (pytest.approx(7.3, abs=1.0), pytest.approx(18.7, abs=1.0))


def test_a_wall_that_ends_parts_two_stretches():
    rng = np.random.default_rng(4)
    heights = np.concatenate([rng.uniform(0, 10, 1000), rng.uniform(10, 40, 1000)])
    assert [end for pair in find_even_stretches(heights, 0.5, 6.0) for end in pair] == pytest.approx([0, 10, 10, 40], abs=0.6)
    assert find_even_stretches(heights, 0.5, 50.0) == [(pytest.approx(10, abs=0.6), pytest.approx(40, abs=0.6))]
    assert find_even_stretches(heights, 20.0, 6.0) == []
