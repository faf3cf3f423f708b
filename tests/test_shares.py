"""Work of a kind for each point, in two threads where there is a second core."""

import threading

import numpy as np
import pytest

from imdim import shares, side_process
from imdim.shares import ENOUGH, by_shares


@pytest.fixture
def seen(monkeypatch):
    """The threads that computed, where there are two cores."""
    monkeypatch.setattr(side_process, "count_cores", lambda: 2)
    monkeypatch.delenv(side_process.CORES, raising=False)
    return set()


def squares(seen):
    def compute(points):
        seen.add(threading.get_ident())
        return (points**2).sum(axis=1)

    return compute


@pytest.mark.parametrize("count", [0, 1, ENOUGH - 1, ENOUGH, 3 * ENOUGH + 1])
def test_each_point_has_its_row_in_order(seen, count):
    points = np.random.default_rng(0).standard_normal((count, 3))
    np.testing.assert_array_equal(by_shares(squares(seen), points), (points**2).sum(axis=1))
    assert (threading.get_ident() in seen) == (count < ENOUGH), "few points are not worth a thread"


@pytest.mark.parametrize(
    "alone",
    [lambda patch: patch.setattr(side_process, "count_cores", lambda: 1), lambda patch: patch.setenv(side_process.CORES, "1")],
    ids=["one core", "one core wanted"],
)
def test_on_one_core_nothing_is_shared(monkeypatch, seen, alone):
    alone(monkeypatch)
    by_shares(squares(seen), np.zeros((2 * ENOUGH, 3)))
    assert seen == {threading.get_ident()}


def test_a_process_that_may_have_no_thread_computes_alone(monkeypatch, seen):
    class NoThreads:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def map(self, *_):
            raise RuntimeError("can't start new thread")

    monkeypatch.setattr(shares, "ThreadPoolExecutor", NoThreads)
    assert by_shares(squares(seen), np.ones((2 * ENOUGH, 3))).tolist() == [3.0] * 2 * ENOUGH
    assert seen == {threading.get_ident()}


def test_what_goes_wrong_in_a_thread_is_told(seen):
    def fail(points):
        raise ValueError("no such point")

    with pytest.raises(ValueError, match="no such point"):
        by_shares(fail, np.zeros((ENOUGH, 3)))
