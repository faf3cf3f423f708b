"""Searches that share the time."""

import math
from types import SimpleNamespace

import pytest
from tests.deadlines import PASSED

from imdim.deadline import Deadline
from imdim.search.mdl.lineages import Lineage, choose_heirs, count_with_time, run_in_turn


def test_the_next_round_is_that_of_the_search_which_promises_most_and_what_falls_behind_is_given_up():
    told_of = []

    def lineage(name, *lengths):
        def rounds():
            for length in lengths[1:]:
                told_of.append(name)
                yield name, length

        return Lineage(name, lengths[0], rounds())

    # what has had no round promises as much as any has won: b -8, c -12.99; in the end b is at -5.3, and another round of c promises -5.005
    lineages = [lineage("a", -1.0, -5.0, -5.2), lineage("b", 0.0, -4.0, -5.1, -5.3), lineage("c", -4.99, -4.995, -9.0)]
    assert [found.best for found in run_in_turn(lineages)] == ["b", "a", "c"]
    assert told_of == ["a", "a", "c", "b", "b", "b"]
    # what wins little in a round is left where it is
    slow = [lineage("d", -1.0, -5.0, -5.004, -9.0)]
    assert run_in_turn(slow, slow=0.01)[0].length == -5.004
    cut = [lineage("a", -1.0, -5.0, -5.2), lineage("b", 0.0, -4.0, -5.1)]
    assert run_in_turn(cut, PASSED)[0].best == "a"
    assert cut[0].length == -1.0


def test_the_shortest_search_goes_on_and_the_next_where_it_is_hardly_longer_and_what_promises_most_where_time_has_cut_them():
    best, near, far = (Lineage(name, length, iter(())) for name, length in (("a", -5.0), ("b", -4.97), ("c", -4.0)))
    best.promised, near.promised, far.promised = -5.0, -5.0, -9.0
    assert choose_heirs([best, near, far], cut=False) == [best, near]
    assert choose_heirs([best, near, far], cut=True) == [best, near, far]
    assert choose_heirs([best, far], cut=False) == [best]
    best.promised = -10.0
    assert choose_heirs([best, far], cut=True) == [best]


@pytest.mark.parametrize(("round_s", "most"), [(1.0, 10), (3.0, 3), (30.0, 2)])
def test_as_many_searches_begin_as_have_time_for_rounds_like_the_second(round_s, most):
    """The first works out what all share."""
    now = [0.0]

    def rounds():
        for spent, length in ((9.0, -1.0), (round_s, -2.0), (100.0, -3.0)):
            now[0] += spent
            yield "found", length

    lineage = Lineage("start", 0.0, rounds())
    assert lineage.time_round(Deadline(20.0, lambda: now[0])) == round_s
    assert lineage.length == -2.0
    assert count_with_time(20.0, round_s) == most
    assert count_with_time(math.inf, round_s) > 7


def test_searches_end_earlier_where_what_they_come_to_takes_longer_to_deliver():
    now = [0.0]

    def rounds():
        for length, program in ((-1.0, "short"), (-2.0, "long"), (-3.0, "longer")):
            now[0] += 1.0
            yield SimpleNamespace(program=program), length

    asked = []
    lineage = Lineage(SimpleNamespace(program="start"), 0.0, rounds())
    ends = {"short": 9.0, "long": 1.5}
    (found,) = run_in_turn([lineage], Deadline(9.0, lambda: now[0]), 0.0, lambda p: asked.append(p) or Deadline(ends[p], lambda: now[0]))
    assert (found.best.program, asked) == ("long", ["short", "long"])
