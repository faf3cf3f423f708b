import numpy as np
import pytest

from imdim.geometry.metrics import chamfer, diagonal, nearest_distances

GRID = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)


def test_a_shifted_grid():
    shifted = GRID + np.array([0.25, 0.0, 0.0])
    assert chamfer(GRID, shifted) == pytest.approx(0.5)
    assert nearest_distances(GRID, shifted).max() == pytest.approx(0.25)


def test_an_outlier_counts_once_in_the_maximum():
    outlier = np.vstack([GRID, [[3.0, 3.0, 8.0]]])
    assert nearest_distances(GRID, outlier).max() == 0
    assert nearest_distances(outlier, GRID).max() == 5
    assert chamfer(GRID, outlier) == pytest.approx(5 / 65)


def test_empty_sets_have_no_distance():
    for measure in (chamfer, nearest_distances):
        with pytest.raises(ValueError, match="64 and 0 points"):
            measure(GRID, np.empty((0, 3)))


def test_diagonal():
    assert diagonal(GRID + 1e6) == pytest.approx(3 * 3**0.5)
