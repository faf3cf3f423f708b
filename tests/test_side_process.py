"""A copy computes what the process itself would; one that is not wanted any more, or that ends too soon, harms nothing."""

import os
import signal
import sys
import time

import pytest

from imdim import side_process
from imdim.side_process import MOST_SHARED, SideProcess, map_beside, without_copies

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="copies are for Linux")


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(side_process, "count_cores", lambda: 2)
    monkeypatch.delenv(side_process.CORES, raising=False)
    monkeypatch.delitem(sys.modules, "torch", raising=False)  # another test may have loaded it, and no copy here asks for it


def places(apart):
    return ((number, os.getpid(), apart) for number in range(3))


def test_a_copy_yields_in_order(two_cores):
    with SideProcess(places) as beside:
        found = list(beside)
    assert [number for number, *_ in found] == [0, 1, 2]
    assert os.getpid() not in {process for _, process, _ in found}
    assert all(apart for *_, apart in found)


def test_a_block_may_have_none(two_cores):
    with without_copies(), SideProcess(places) as beside:
        assert [process for _, process, _ in beside] == [os.getpid()] * 3
    with SideProcess(places) as beside:
        assert os.getpid() not in {process for _, process, _ in beside}


@pytest.mark.parametrize(
    "forbid",
    [
        lambda patch: patch.setattr(side_process, "count_cores", lambda: 1),
        lambda patch: patch.setenv(side_process.CORES, "1"),
        lambda patch: patch.setitem(sys.modules, "torch", object()),
        lambda patch: patch.setattr(os, "fork", lambda: (_ for _ in ()).throw(BlockingIOError)),
    ],
)
def test_where_there_can_be_no_copy_it_is_computed_here_when_it_is_asked_for(two_cores, monkeypatch, forbid):
    forbid(monkeypatch)
    made = []
    with SideProcess(lambda apart: (made.append(apart) or number for number in range(3))) as beside:
        assert made == []
        assert [next(beside), made] == [0, [False]]
        assert list(beside) == [1, 2]


def test_what_a_copy_that_ends_too_soon_leaves_is_computed_here(two_cores):
    here = os.getpid()

    def dies():
        yield "first"
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        yield "second"

    with SideProcess(lambda _: dies()) as beside:
        assert list(beside) == ["first", "second"]


def test_an_error_is_the_same_here(two_cores):
    def breaks():
        yield 1
        raise ValueError("no third")

    with pytest.raises(ValueError, match="no third"), SideProcess(lambda _: breaks()) as beside:
        list(beside)


def test_a_copy_ends_with_its_context_and_changes_nothing_here(two_cores):
    changed = []

    def goes_on():
        changed.append(1)
        yield os.getpid()
        time.sleep(60)

    started = time.monotonic()
    with SideProcess(lambda _: goes_on()) as beside:
        copy = next(beside)
    with pytest.raises(ProcessLookupError):
        os.kill(copy, 0)
    assert changed == []
    assert time.monotonic() - started < 30


def test_what_both_know_is_not_sent(two_cores):
    class Unsent:
        def __reduce__(self):
            raise TypeError("sent")

    large = Unsent()
    with SideProcess(lambda _: iter([("small", large)]), [None, large]) as beside:
        ((name, received),) = list(beside)
    assert (name, received is large) == ("small", True)


def test_two_processes_take_items_by_turns(two_cores):
    here = os.getpid()

    def compute(number):
        time.sleep(0.05)
        return number, os.getpid()

    found = map_beside(compute, range(12))
    assert [number for number, _ in found] == [*range(12)]
    assert {process == here for _, process in found} == {True, False}
    with without_copies():
        assert {process for _, process in map_beside(compute, range(2))} == {here}


@pytest.mark.parametrize("count", [0, 1, MOST_SHARED + 1])
def test_no_copy_is_made_for_what_two_cannot_share(two_cores, count):
    found = map_beside(lambda _: os.getpid(), range(count))
    assert found == count * [os.getpid()]


def test_copies_make_no_copies(two_cores):
    def compute(_):
        time.sleep(0.05)
        return os.getpid(), {*map_beside(lambda _: time.sleep(0.01) or os.getpid(), range(4))}

    apart = [inner for process, inner in map_beside(compute, range(4)) if process != os.getpid()]
    assert [len(inner) for inner in apart] == len(apart) * [1]


@pytest.mark.parametrize("dies_at", [0, 3])
def test_what_was_taken_by_a_copy_that_ends_too_soon_is_computed_here(two_cores, dies_at):
    here = os.getpid()

    def compute(number):
        if os.getpid() != here and number >= dies_at:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.02)
        return number * number

    assert map_beside(compute, range(8)) == [number * number for number in range(8)]


def test_an_error_in_either_process_is_told_here(two_cores, capfd):
    def compute(number):
        time.sleep(0.02)
        return 1 / (number - 5)

    with pytest.raises(ZeroDivisionError):
        map_beside(compute, range(8))
    assert capfd.readouterr() == ("", "")
