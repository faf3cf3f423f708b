"""A budget that is handed its clock: shares of it, deadlines that asking does not change, and what a run says that nothing cut."""

import math
import time

import pytest

from imdim.deadline import NEVER, Deadline
from imdim.reconstruction.budget import SHARES, Budget


class Hands:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.at = 0.0

    def __call__(self) -> float:
        return self.at


def test_a_stage_ends_by_its_share_of_the_whole():
    hands = Hands()
    hands.at = 7.0
    budget = Budget(100.0, hands)
    end = budget.end_of("search")
    assert end.left() == 50.0
    assert budget.end.left() == 100.0
    hands.at = 57.0
    assert not end.has_passed()
    hands.at = 57.1
    assert end.has_passed()
    assert end.left() == 0.0
    assert budget.seconds() == pytest.approx(50.1)


@pytest.mark.parametrize(("share", "left"), [(1.0, 20.0), (0.5, 10.0)])
def test_a_body_has_its_share_of_the_time_until_a_moment(share, left):
    hands = Hands()
    budget = Budget(100.0, hands)
    hands.at = 10.0
    part = budget.part_of("detect", share)
    assert part.left() == pytest.approx(left)
    hands.at = 10.1 + left
    assert part.has_passed()
    assert budget.part_of("starts", share).left() == pytest.approx(0.4 * share * (50 - hands.at))
    hands.at = 40.0
    assert budget.part_of("detect", share).has_passed()


def test_asking_changes_nothing():
    hands = Hands()
    budget = Budget(100.0, hands)
    deadlines = [budget.end_of(stage) for stage in SHARES] + [budget.part_of(stage, 0.5) for stage in SHARES]
    hands.at = 99.0
    assert all(d.has_passed() for d in deadlines)
    hands.at = 1.0
    assert not any(d.has_passed() for d in deadlines)
    with pytest.raises(AttributeError):
        budget.start = 1.0


def test_stages_end_one_after_the_other():
    of_mesh = ("detect", "label", "search", "prove", "fit", "relate", "front")
    of_noisy_cloud = ("detect", "label", "noisy_search", "choose", "likely", "measure", "relate", "front")
    for stages in (of_mesh, of_noisy_cloud):
        ends = [SHARES[stage].by for stage in stages]
        assert ends == sorted(ends)
    assert all(0 < share.of <= 1 and 0 < share.by < 1 for share in SHARES.values())


def test_the_clock_is_looked_up_when_it_is_needed(monkeypatch):
    monkeypatch.setattr(time, "perf_counter", lambda: 1e9)
    assert Budget(1.0).start == 1e9
    assert not Deadline(1e9).has_passed()
    assert not NEVER.has_passed()


def test_the_earlier_of_two():
    first, second = Deadline(1.0), Deadline(2.0)
    assert first.earlier(second) is first
    assert second.earlier(first) is first
    assert NEVER.earlier(first) is first
    assert NEVER.left() == math.inf
