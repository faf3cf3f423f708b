"""A deadline of the processor's clock, and its limit on the wall."""

import time

from imdim import deadline
from imdim.deadline import Deadline


def test_waiting_is_no_work(monkeypatch):
    monkeypatch.setattr(deadline, "BUSY", 1000.0)
    until = Deadline.of_process(0.1)
    time.sleep(0.2)
    assert not until.has_passed()
    end = time.process_time() + 0.15
    while time.process_time() < end:
        pass
    assert until.has_passed()


def test_a_busy_machine_ends_it_all_the_same():
    until = Deadline.of_process(0.1)
    time.sleep(0.1 * deadline.BUSY + 0.05)
    assert until.has_passed()


def test_of_two_deadlines():
    soon, late = Deadline(1.0), Deadline(2.0)
    assert soon.later(late) == late.later(soon) == late
    assert soon.earlier(late) == late.earlier(soon) == soon
