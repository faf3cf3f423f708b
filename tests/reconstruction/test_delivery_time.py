"""Time that is left for what comes after a search."""

import math

import pytest
from tests.planted import box, union

from imdim.deadline import NEVER, Deadline
from imdim.reconstruction import delivery_time
from imdim.reconstruction.delivery_time import leave_time_for_files, leave_time_to_deliver, leave_time_to_fit, time_to_write


def test_the_search_ends_earlier_by_what_a_slow_solid_takes_to_deliver(monkeypatch):
    now = Deadline(20.0, lambda: 5.0)
    for solid_s, left in (
        (0.01, 15.0),
        (0.3, 15.0 - (delivery_time.SOLIDS * 0.3 + delivery_time.LEAF_S - delivery_time.ALLOWED_S)),
        (3.0, 0.0),
    ):
        monkeypatch.setattr(delivery_time, "time_solid", lambda _, clock, took=solid_s: took)
        assert leave_time_to_deliver(box(1, 1, 1), now).left() == pytest.approx(left)
    assert leave_time_to_deliver(box(1, 1, 1), NEVER).left() == math.inf


def test_a_long_program_of_a_mesh_leaves_time_for_its_files(monkeypatch):
    """As much as it takes beyond what there is until the end in any case, but for the files."""
    fit_by, end = Deadline(40.0, lambda: 5.0), Deadline(50.0, lambda: 5.0)
    for solid_s, left in ((0.01, 35.0), (0.5, 35.0 - (delivery_time.SOLIDS * 0.5 + delivery_time.LEAF_S - (10.0 - delivery_time.FILES_S)))):
        monkeypatch.setattr(delivery_time, "time_solid", lambda _, clock, took=solid_s: took)
        assert leave_time_for_files(box(1, 1, 1), fit_by, end).left() == pytest.approx(left)
    assert leave_time_for_files(box(1, 1, 1), NEVER, NEVER).left() == math.inf


def test_a_long_program_leaves_time_for_booleans_that_are_done_again(monkeypatch):
    monkeypatch.setattr(delivery_time, "time_solid", lambda *_: 0.5)
    fit_by, end, many = Deadline(35.0, lambda: 5.0), Deadline(65.0, lambda: 5.0), union(*(box(1, 1, 1, (2.0 * i, 0, 0)) for i in range(36)))
    free_s = 30.0 - delivery_time.FILES_S - delivery_time.AGAIN_S - 16 * delivery_time.EACH_S
    beyond = delivery_time.SOLIDS * 0.5 + 36 * delivery_time.LEAF_S - free_s
    assert leave_time_for_files(many, fit_by, end).left() == pytest.approx(30.0 - beyond)
    monkeypatch.setattr(delivery_time, "time_solid", lambda *_: 0.1)
    grid = union(*(box(1, 1, 1, (2.0 * i, 0, 0)) for i in range(100)))
    left = 30.0 - (delivery_time.SOLIDS * 0.1 + 100 * delivery_time.LEAF_S)
    assert leave_time_for_files(grid, fit_by, end).left() == pytest.approx(left), "of a hundred copies no more is asked"


def test_a_search_leaves_time_to_fit_what_is_slow_to_make_but_keeps_half_of_its_own(monkeypatch):
    search_by, fit_by, end = (Deadline(at, lambda: 5.0) for at in (30.0, 47.0, 60.0))
    for solid_s, left in ((0.01, 25.0), (0.3, 42.0 - delivery_time.FITTED * 0.3 - 3.15), (3.0, 12.5)):
        monkeypatch.setattr(delivery_time, "time_solid", lambda _, clock, took=solid_s: took)
        assert leave_time_to_fit(box(1, 1, 1), search_by, fit_by, end).left() == pytest.approx(min(left, 25.0))


def test_the_files_of_a_long_program_take_longer():
    few, many = (union(*(box(1, 1, 1, (2.0 * i, 0, 0)) for i in range(count))) for count in (12, 36))
    assert time_to_write(few) == delivery_time.FILES_S
    assert time_to_write(many) == pytest.approx(delivery_time.FILES_S + delivery_time.AGAIN_S + 16 * delivery_time.EACH_S)
