"""The compiled maximisers against listing everything."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.search.planted_families import planted, random_candidates

from imdim.search.families import Candidate
from imdim.search.kernels import axial_best, best_interval


def slow_interval(sums: np.ndarray) -> float:
    return max(float(sums[i:j].sum()) for i in range(len(sums)) for j in range(i + 1, len(sums) + 1))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.integers(-9, 9), min_size=1, max_size=12))
def test_the_best_interval(values):
    sums = np.array(values, float)
    best, lo, hi = best_interval(sums)
    assert best == slow_interval(sums) == sums[lo:hi].sum()


def test_the_best_interval_of_each_axial_family():
    rng = np.random.default_rng(1)
    field = rng.normal(size=60)
    widths = np.array([1, 5, 9], np.int64)
    members = [rng.choice(60, n, replace=False) for n in (7, 20, 40)]
    bins = [rng.integers(0, w, len(m)) for w, m in zip(widths, members, strict=True)]
    starts = np.concatenate([[0], np.cumsum([len(m) for m in members])])
    out = np.empty((3, 3))
    axial_best(field, starts, np.concatenate(members), np.concatenate(bins), widths, out)
    for row, m, b, w in zip(out, members, bins, widths, strict=True):
        sums = np.array([field[m[b == k]].sum() for k in range(w)])
        assert row[0] == pytest.approx(slow_interval(sums))
        assert sums[int(row[1]) : int(row[2])].sum() == pytest.approx(row[0])


def every_box(families, field, frame) -> float:
    """The best sum over all boxes of a frame, by prefix sums over its grid."""
    axes = families.arrangement.frames[frame]
    shape = [len(families.arrangement.directions[a].offsets) - 1 for a in axes]
    prefix = np.zeros([n + 1 for n in shape])
    grid = np.zeros(shape)
    np.add.at(grid, tuple(families.cells.slabs[:, a] for a in axes), field)
    prefix[1:, 1:, 1:] = grid.cumsum(0).cumsum(1).cumsum(2)
    best = -np.inf
    for i in range(shape[0]):
        for j in range(i + 1, shape[0] + 1):
            for k in range(shape[1]):
                for m in range(k + 1, shape[1] + 1):
                    line = np.diff(prefix[j, m] - prefix[i, m] - prefix[j, k] + prefix[i, k])
                    run = np.concatenate([[0.0], line.cumsum()])
                    best = max(best, float((run[1:] - np.minimum.accumulate(run)[:-1]).max()))
    return best


@pytest.mark.parametrize("name", ["L bracket", "countersink"])
@pytest.mark.parametrize("seed", range(4))
def test_the_best_candidate_of_all(name, seed):
    families, rng = planted(name), np.random.default_rng(seed)
    field = families.cells.gain * rng.choice([-1.0, 1.0, 0.0], len(families.cells.gain), p=[0.3, 0.5, 0.2])
    boxes = [every_box(families, field, f) for f in range(len(families.arrangement.frames))]
    for per_frame in (1, 4):
        found = families.best(field, per_frame)
        for value, candidate in found:
            assert value == pytest.approx(field[families.mask(candidate)].sum(), abs=1e-9 * families.cells.volume)
        best_box = max(v for v, c in found if c.source[0] == "box")
        if per_frame == 4:
            assert best_box == pytest.approx(max(boxes))
        assert max(v for v, _ in found) >= max(boxes) * (1 - 1e-12)
    for candidate in random_candidates(families, 200, rng):
        assert field[families.mask(candidate)].sum() <= max(v for v, _ in found) * (1 + 1e-9)


def test_a_single_cell_is_found():
    families = planted("L bracket")
    field = np.full(len(families.cells.points), -1.0)
    field[17] = 1.0
    (value, candidate), *_ = sorted(families.best(field, 1), key=lambda f: -f[0])
    assert value == 1.0
    assert np.flatnonzero(families.mask(candidate)).tolist() == [17]
    assert isinstance(candidate, Candidate)
