"""The local search on integers, whose best is known, and the changes of sequences that it is fed with."""

import itertools
from math import inf

import pytest

from imdim.deadline import NEVER, Deadline
from imdim.program.sequence import Step
from imdim.search.mdl.local_search import FittingStage, improvements, merge, own_moves, pack_choices, search_locally, uses

A, B, C = Step("union", 7), Step("difference", 8), Step("difference", 9)


def found(start, stages, worth=0.0, rounds=100, times=inf, best=100):
    """From `start` by steps of one and ten towards `best`, the nearer ones first; time ends after so many questions."""
    questions = itertools.count(1)
    return search_locally(
        (start, abs(best - start)),
        lambda n: [n - 1, n + 1, n + 10],
        stages,
        lambda tried: [abs(best - n) for n in tried],
        lambda *_: worth,
        rounds,
        Deadline(times, lambda: next(questions)),
    )


def as_it_is(n):
    return [n]


def test_the_best_of_the_fitted_is_taken_until_nothing_is_better():
    assert found(73, [FittingStage(as_it_is, 3)]) == (100, 0)
    assert found(73, [FittingStage(as_it_is, 3)], rounds=2) == (93, 7)


def test_only_the_foremost_are_fitted_and_each_stage_ranks_anew():
    assert found(73, [FittingStage(as_it_is, 1)]) == (73, 27)
    assert found(73, [FittingStage(as_it_is, 3), FittingStage(as_it_is, 1)], rounds=1) == (83, 17)
    assert found(73, [FittingStage(as_it_is, 1), FittingStage(lambda n: [n, n + 5], 1)], rounds=1) == (77, 23)


def test_what_is_not_worth_it_changes_nothing():
    assert found(85, [FittingStage(as_it_is, 3)], worth=5.0) == (95, 5)
    assert found(95, [FittingStage(as_it_is, 3)], worth=5.0) == (95, 5)


@pytest.mark.parametrize(("times", "reached"), [(0, 73), (1, 73), (2, 73), (3, 74), (4, 83), (7, 84), (8, 93)])
def test_of_a_round_that_time_cuts_short_what_is_fitted_may_be_taken(times, reached):
    assert found(73, [FittingStage(as_it_is, 3)], times=times)[0] == reached


@pytest.mark.parametrize(("times", "reached"), [(3, 73), (4, 73), (5, 83)])
def test_a_round_that_time_cuts_before_its_last_stage_changes_nothing(times, reached):
    assert found(73, [FittingStage(as_it_is, 3), FittingStage(as_it_is, 2)], times=times)[0] == reached


def test_of_states_that_are_alike_the_next_stage_fits_the_best():
    fitted = []
    stages = [FittingStage(as_it_is, 4), FittingStage(lambda n: fitted.append(n) or [n], 2)]
    steps = improvements(
        (0, 9.0),
        lambda n: [4, 5, 1, 2],
        stages,
        lambda ns: [9.0 - n for n in ns],
        lambda *_: 0.0,
        1,
        NEVER,
        alike=lambda a, b: abs(a - b) < 2,
    )
    assert next(steps) == (5, 4.0)
    assert fitted == [5, 2]


def test_nothing_proposed_leaves_the_start():
    given = search_locally((1, 1.0), lambda _: [], [FittingStage(as_it_is, 1)], lambda _: [], lambda *_: 0.0, 9, NEVER)
    assert given == (1, 1.0)


def test_what_else_won_is_tried_on_top_of_the_best():
    """Sets of numbers, of which those up to 3 are worth having: each alone wins, and one round takes them all."""

    def propose(chosen):
        return [chosen | {n} for n in range(8)]

    def worth_of(tried):
        return [-sum(4 - n for n in chosen) for chosen in tried]

    start = (frozenset(), 0.0)
    given = (start, propose, [FittingStage(as_it_is, 8)], worth_of, lambda *_: 0.0, 9, NEVER)
    assert next(improvements(*given))[0] == {0}
    rounds = list(improvements(*given, frozenset.union))
    assert rounds == [({0, 1, 2, 3}, -10)]
    assert list(improvements(*given, lambda *_: None))[-1] == rounds[-1]


def test_changes_of_one_sequence_are_merged():
    more, other, turned = Step("union", 1), Step("difference", 2), Step("union", 8)
    before = (A, B, C)
    assert merge((A, B, C, more), (A, other, B, C), before) == (A, other, B, C, more)
    assert merge((A, C), (A, turned, C), before) is None  # what is gone is not turned
    assert merge((A, more, C), (A, turned, C, other), before) == (A, more, C, other)  # nor is what was exchanged
    assert merge((A, B, C, more), (A, turned, C), before) == (A, turned, C, more)
    assert merge((A, B, C, more), (A, C), before) == (A, C, more)
    assert merge((A, B, C, more), (A, B, more, C), before) is None  # a term stands there once
    assert merge((A, C, B), (B, C), (A, B, C)) is None  # a cut comes first


def test_single_changes_begin_with_a_union():
    moves = set(own_moves((A, B, C)))
    assert moves == {
        (A, C),
        (A, Step("union", 8), C),
        (A, C, B),
        (A, B),
        (A, B, Step("union", 9)),
    }
    assert set(own_moves((A,))) == set()


def test_a_new_term_goes_to_the_ends_or_in_the_place_of_another():
    new = Step("union", 1), Step("difference", 1)
    ends = {(A, n, B) for n in new} | {(A, B, n) for n in new}
    assert set(uses(1, (A, B))) == ends | {(new[0], B), (A, new[1])}
    assert list(uses(8, (A, B))) == []


def test_choices_are_padded_behind_their_ends():
    lengths, index, united = pack_choices([(A, B), (A,), ()])
    assert lengths.tolist() == [2, 1, 0]
    assert index.tolist() == [[7, 8], [7, -1], [-1, -1]]
    assert united.tolist() == [[True, False], [True, False], [False, False]]
    assert pack_choices([])[1].shape == (0, 0)


def test_a_new_term_takes_the_place_of_those_that_it_may_stand_instead_of():
    steps = (Step("union", 0), Step("difference", 1))
    assert [*uses(7, steps, {1})] == [c for c in uses(7, steps) if c != (Step("union", 7), steps[1])]
