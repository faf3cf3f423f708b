"""Some of many points: exactly as many as asked for, evenly spread, whatever the order of a scan."""

import numpy as np
import pytest

from imdim.geometry.sampling import EIGHTH, subsample, surface_spacing


@pytest.mark.parametrize("n", [1, 99, 100, 101, 150, 199, 200, 1234])
def test_at_most_as_many_as_asked_for_and_the_ends_among_them(n):
    """Steps of n // 100 would pass all of 199."""
    some = subsample(np.arange(n), 100)
    assert len(some) == min(n, 100)
    assert (some[0], some[-1]) == (0, n - 1)
    assert np.diff(some).max(initial=0) - np.diff(some).min(initial=n) <= 1
    assert len(np.unique(some)) == len(some)


def test_the_rows_of_a_scan_do_not_beat_with_the_steps():
    """A scan of 100 rows of 100 points: every hundredth point would be the first of each row, on one side of the part."""
    rows, columns = np.divmod(np.arange(10_000), 100)
    some = subsample(np.column_stack([rows, columns]), 100)
    assert len(np.unique(some[:, 0])) > 90
    assert len(np.unique(some[:, 1])) > 90


def test_a_point_of_a_random_cloud_stands_for_its_share_of_the_area():
    rng = np.random.default_rng(0)
    points = rng.random((4000, 2))
    eighth = np.sort(np.linalg.norm(points[:300, None] - points, axis=-1), axis=1)[:, EIGHTH]
    assert surface_spacing(eighth) == pytest.approx(1 / np.sqrt(4000), rel=0.06)
