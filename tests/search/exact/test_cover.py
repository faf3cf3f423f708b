"""Covers against all subsets of a few columns."""

from itertools import combinations

import numpy as np
import pytest
from tests.deadlines import PASSED

from imdim.search.exact.cover import CoverLimits, cover


def least_price(separates: np.ndarray, left: np.ndarray, right: np.ndarray, weight: np.ndarray, most: int) -> float:
    """By brute force: each subset of columns, each subset of cells given up."""
    best = np.inf
    n = len(separates)
    cells = np.unique(np.concatenate([left, right]))
    for size in range(most + 1):
        for some in combinations(range(n), size):
            missing = np.flatnonzero(~separates[list(some)].any(0))
            for choice in range(1 << len(cells)):
                given = cells[[bool(choice >> i & 1) for i in range(len(cells))]]
                if (np.isin(left[missing], given) | np.isin(right[missing], given)).all():
                    best = min(best, size + float(weight[given].sum()))
    return best


@pytest.mark.parametrize("seed", range(25))
def test_an_answer_is_found_where_there_is_one(seed):
    rng = np.random.default_rng(seed)
    separates = rng.random((6, 7)) < 0.35
    left, right = rng.integers(0, 3, 7), rng.integers(3, 6, 7)
    weight = rng.uniform(0.2, 3.0, 6)
    most = int(rng.integers(1, 5))
    least = least_price(separates, left, right, weight, most)
    for price in (least - 1e-2, least + 1e-2) if np.isfinite(least) else (10.0,):
        found = cover(separates, left, right, weight, CoverLimits(most, price, 10.0))
        if price < least:
            assert found.chosen is None
            assert found.known
        else:
            assert found.chosen is not None
            assert len(found.chosen) <= most
            missing = ~separates[found.chosen].any(0)
            assert len(found.chosen) + least_price(separates[:0, missing], left[missing], right[missing], weight, 0) <= price


def test_a_barred_set_is_not_chosen_as_a_whole():
    separates = np.array([[1, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 0]], bool)
    left, right, weight = np.array([0, 1, 2]), np.array([3, 4, 5]), np.full(6, 9.0)
    for barred in ([], [[0, 1]], [[0, 1], [2, 3]], [[0, 1], [2, 3], [0, 2]]):
        found = cover(separates, left, right, weight, CoverLimits(2, 2.0, 10.0, barred))
        if len(barred) == 3:
            assert found.chosen is None
        else:
            assert found.chosen is not None
            assert separates[found.chosen].any(0).all()
            assert found.chosen not in barred


def test_a_solver_without_time_knows_nothing():
    separates = np.array([[1, 1, 0], [0, 0, 1]], bool)
    left, right, weight = np.array([0, 1, 2]), np.array([3, 4, 5]), np.full(6, 9.0)
    found = cover(separates, left, right, weight, CoverLimits(2, 2.0, 10.0, deadline=PASSED))
    assert found.chosen is None
    assert not found.known


def test_a_problem_too_large_for_the_time_left_is_not_begun(monkeypatch):
    separates = np.array([[1, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 0]], bool)
    left, right, weight = np.array([0, 1, 2]), np.array([3, 4, 5]), np.full(6, 9.0)
    unsolvable = CoverLimits(2, 2.0, 10.0, [[0, 1], [2, 3], [0, 2]])
    assert cover(separates, left, right, weight, unsolvable).known
    monkeypatch.setattr("imdim.search.exact.cover.COLUMNS_PER_S", 4 / 11.0)
    assert not cover(separates, left, right, weight, unsolvable).known
