"""Sums over rows are numpy's, bit for bit."""

import numpy as np
import pytest

from imdim.geometry.rows import dot_rows, lengths


@pytest.mark.parametrize("shape", [(500, 3), (40, 7, 2), (1, 3), (0, 3), (3,)])
def test_rows_are_summed_as_numpy_does(shape: tuple[int, ...]) -> None:
    a, b = np.random.default_rng(3).normal(size=(2, *shape))
    assert np.array_equal(dot_rows(a, b), (a * b).sum(-1))
    assert np.array_equal(lengths(a), np.linalg.norm(a, axis=-1)) or len(shape) == 1  # one vector alone numpy sums in another way
    assert np.allclose(lengths(a), np.linalg.norm(a, axis=-1), rtol=1e-15)
