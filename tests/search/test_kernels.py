"""The compiled maximisers against listing everything."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.search.planted_families import planted, random_candidates

from imdim.search.candidate_families import Candidate
from imdim.search.group_sums import Slots
from imdim.search.kernels import (
    axial_best,
    best_box,
    best_interval,
    group_rows,
    merge_rows,
    merge_slabs,
    pick_flags,
    slabs_of,
    sum_where,
)


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
    ends = np.concatenate([[0], np.cumsum(widths)])
    in_cell = [[int(e + b[m == c][0]) for m, b, e in zip(members, bins, ends[:-1], strict=True) if c in m] for c in range(60)]
    starts = np.concatenate([[0], np.cumsum([len(s) for s in in_cell])])
    field[rng.choice(60, 20, replace=False)] = 0.0
    slots = Slots(np.concatenate([np.array(s, np.int32) for s in in_cell]), int(ends[-1]), starts)
    for sign in (1.0, -1.0):
        out = np.empty((3, 3))
        axial_best(sign * slots.sum_values(np.flatnonzero(field), field[np.flatnonzero(field)]), ends, out)
        for row, m, b, w in zip(out, members, bins, widths, strict=True):
            sums = np.array([sign * field[m[b == k]].sum() for k in range(w)])
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


@pytest.mark.parametrize("share", [0.02, 0.2, 0.6])
def test_merged_slabs_keep_the_best_box(share):
    rng = np.random.default_rng(int(100 * share))
    for _ in range(20):
        grid = rng.normal(size=rng.integers(2, 9, 3)) - 1.0
        grid[rng.random(grid.shape) < share] += 3.0
        grid[rng.random(grid.shape) < 0.3] = 0.0  # where there are no cells
        # in the order that the search has them in: for another one the kernels are compiled anew, in three seconds
        places = np.argwhere(grid != 0).astype(np.int32, order="C")
        sums = grid[tuple(places.T)]
        smaller, *first = merge_slabs(sums, places, grid.shape)
        assert smaller.sum() == pytest.approx(grid.sum())
        assert all(f[0] == 0 and f[-1] == n and (np.diff(f) > 0).all() for f, n in zip(first, grid.shape, strict=True))
        best = every_sum(grid)
        if best <= 0:
            continue
        for sign in (1.0, -1.0):
            out = np.empty(7)
            assert best_box(sign * sums, places, grid.shape, sign, 0.0, out) == out[0] == pytest.approx(best)
            box = out[1:].astype(int).reshape(3, 2)
            assert grid[tuple(slice(*s) for s in box)].sum() == pytest.approx(best)
            slack = 1e-9 * best
            assert best_box(sign * sums, places, grid.shape, sign, best + slack, out) >= best - slack
            assert out[0] == -np.inf  # none is above the best


def every_sum(grid):
    """The largest sum of any box of a small grid."""
    spans = [[(i, j) for i in range(n) for j in range(i + 1, n + 1)] for n in grid.shape]
    boxes = [(a, b, c) for a in spans[0] for b in spans[1] for c in spans[2]]
    prefix = np.pad(grid.cumsum(0).cumsum(1).cumsum(2), ((1, 0),) * 3)
    lo, hi = np.array(boxes)[:, :, 0].T, np.array(boxes)[:, :, 1].T
    sums = sum(
        (-1) ** (3 - a - b - c) * prefix[(lo, hi)[a][0], (lo, hi)[b][1], (lo, hi)[c][2]] for a in (0, 1) for b in (0, 1) for c in (0, 1)
    )
    return float(sums.max())


@pytest.mark.parametrize("edges", [2, 3, 50])
@pytest.mark.parametrize("points", [40, 4000])
def test_slabs_are_those_of_a_binary_search(edges, points):
    # few points are halved for, many start from a table; what lies on an edge, or a bit beside it, is where rounding would show
    rng = np.random.default_rng(edges)
    for scale in (1e-6, 1.0, 1e3):
        offsets = np.sort(scale * rng.normal(size=edges))
        offsets[-1] = np.nextafter(offsets[-2], np.inf) if edges == 3 else offsets[-1]
        near = [offsets, np.nextafter(offsets, np.inf), np.nextafter(offsets, -np.inf), 1e9 * offsets]
        at = np.concatenate([rng.uniform(offsets[0] - scale, offsets[-1] + scale, points), *near])
        np.testing.assert_array_equal(slabs_of(offsets, at), np.clip(np.searchsorted(offsets, at) - 1, 0, edges - 2))


@pytest.mark.parametrize("width", [1, 2, 3])
def test_rows_are_grouped_as_by_sorting_them(width):
    rng = np.random.default_rng(width)
    rows = rng.integers(0, 9, (500, width)).astype(np.uint64) << np.uint64(50)  # many hashes fall together
    first, group = group_rows(rows)
    expected = np.unique(rows, axis=0, return_index=True)[1]
    assert np.array_equal(first, np.sort(expected))
    assert np.array_equal(rows[first][group], rows)
    empty = group_rows(rows[:0])
    assert [len(part) for part in empty] == [0, 0]


def test_rows_that_differ_in_their_highest_bytes_alone_are_grouped_as_fast_as_others():
    """Codes are packed so that they sort as their bytes do: the numbers of cells stand in the highest ones."""
    cells = np.random.default_rng(6).integers(0, 40_000, 60_000).astype(np.int32)
    high = cells.view(np.uint32).byteswap().astype(np.uint64) << np.uint64(32)
    taken = []
    for rows in (cells.astype(np.uint64), high):
        group_rows(rows[:2, None])
        start = time.process_time()
        first, group = group_rows(rows[:, None])
        taken.append(time.process_time() - start)
        assert (cells[first][group] == cells).all()
    assert taken[1] < 10 * taken[0]


@pytest.mark.parametrize("sizes", [(0, 5), (40, 0), (60, 90)])
def test_merged_rows_are_in_order_and_groups_of_all(sizes):
    rng = np.random.default_rng(2)
    a, b = (np.unique(rng.integers(0, 9, (size, 2)).astype(np.uint64), axis=0) for size in sizes)
    first, group = merge_rows(a, b)
    both = np.concatenate([a, b])
    distinct, expected_first, expected_group = np.unique(both, axis=0, return_index=True, return_inverse=True)
    assert np.array_equal(both[first], distinct)
    assert np.array_equal(first, expected_first)
    assert np.array_equal(group, expected_group.reshape(-1))


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 127, 128, 129, 136, 1000, 70_001])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_chosen_values_are_added_up_as_numpy_does(count, share):
    rng = np.random.default_rng(count)
    values, flags = rng.random(count) * 10.0 ** rng.uniform(-9, 0, count), rng.random(count) < share
    assert sum_where(values, flags, True) == values[flags].sum()
    assert sum_where(values, flags, False) == values[~flags].sum()


def test_flags_are_picked():
    which, flags, others = np.array(np.meshgrid(*3 * [[False, True]])).reshape(3, -1)
    assert np.array_equal(pick_flags(which, flags, others), np.where(which, flags, others))
