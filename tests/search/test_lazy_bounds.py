"""Lazy insertions must be those that asking everywhere finds, whatever was asked before."""

import numpy as np
import pytest
from tests.search.planted_families import planted, random_candidates
from tests.search.test_sequence import WEIGHTS, random_sequence

from imdim.program.sequence import Step
from imdim.search import lazy_bounds
from imdim.search.lazy_bounds import GainBounds, apart, best_insertions, insert_all
from imdim.search.sequence import Covered, Price, Sequence, error, insert, insertions, run


def price_of(families, weights=(1.0, 1.0), boxes=True) -> Price:
    return Price(1e-4 * families.cells.volume, weights, boxes)


def edited(sequence: Sequence, families, rng) -> Sequence:
    """With one step removed, one exchanged or one put in, as local search does."""
    at, (candidate,) = int(rng.integers(len(sequence))), random_candidates(families, 1, rng)
    step = Step("union" if rng.random() < 0.5 else "difference", Covered.of(candidate, families))
    kind = int(rng.integers(3))
    return (*sequence[:at], *((step,) if kind else ()), *sequence[at + (kind < 2) :])


@pytest.mark.parametrize(("name", "boxes"), [("countersink", False), ("countersink", True), ("L bracket", True), ("bored ball", True)])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_what_was_known_before_does_not_change_the_best(name, weights, boxes):
    families, rng, known = planted(name), np.random.default_rng(3), GainBounds()
    price = price_of(families, weights, boxes)
    sequence = random_sequence(families, 6, rng)
    some = 0
    for _ in range(25):
        found = best_insertions(sequence, families, price, known)
        truth = insertions(sequence, families, int(boxes), price.step, weights)
        assert bool(found) == bool(truth)
        if found:
            some += 1
            assert found[0].gain == pytest.approx(truth[0].gain, rel=1e-9)
        sequence = edited(sequence, families, rng) if len(sequence) > 2 else random_sequence(families, 6, rng)
    assert some > 5


def test_bounds_spare_questions():
    families = planted("tube on a flange")
    price, counts = price_of(families), []
    for bounds in (GainBounds(), None):
        before = families.work
        sequence: Sequence = ()
        while found := best_insertions(sequence, families, price, bounds or GainBounds()):
            sequence = insert(sequence, found[0], families)
        assert len(sequence) > 3
        counts.append(families.work - before)
    assert counts[0] < counts[1]


def test_a_branch_keeps_its_bounds_until_adopted():
    families, known = planted("countersink"), GainBounds()
    price, sequence = price_of(families), random_sequence(families, 3, np.random.default_rng(0))
    branch = known.branch()
    best_insertions(sequence, families, price, branch)
    key = (id(None), "union")
    assert branch.get(key) is not None
    assert known.get(key) is None
    known.adopt(branch)
    assert known.get(key) is not None


def test_a_sequence_that_comes_back_is_not_asked_about_again():
    families, known = planted("countersink"), GainBounds()
    price, sequence = price_of(families), random_sequence(families, 3, np.random.default_rng(0))
    found = best_insertions(sequence, families, price, known.branch())
    again, work = tuple(Step(step.op, Covered.of(step.term.shape, families)) for step in sequence), families.work
    assert best_insertions(again, families, price, known.branch()) == found
    assert families.work == work > 0


def test_too_much_is_forgotten(monkeypatch):
    monkeypatch.setattr(lazy_bounds, "MOST_BYTES", 1)
    families, known = planted("countersink"), GainBounds()
    best_insertions(random_sequence(families, 3, np.random.default_rng(0)), families, price_of(families), known)
    known.branch()
    assert known.get((id(None), "union")) is not None  # settled with nothing before it
    known.branch()
    assert known.get((id(None), "union")) is None


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_insertions_apart_win_together_what_each_wins(share):
    several = 0
    for name in ("countersink", "L bracket", "tube on a flange", "open box"):
        families = planted(name)
        rng = np.random.default_rng(2)
        price = price_of(families)
        for length in (0, 1, 3, 5):
            sequence = random_sequence(families, length, rng)
            before = error(sequence, families)
            found = best_insertions(sequence, families, price, GainBounds(), share)
            assert all(i.gain >= max(price.step, share * found[0].gain) for i in found)
            chosen = apart(found, families)
            after = error(insert_all(sequence, chosen), families)
            assert sum(i.gain for i, _ in chosen) == pytest.approx(before - after, abs=1e-9 * families.cells.volume)
            several += len(chosen) > 1
    assert several


def test_inserted_is_one_after_the_other():
    families = planted("L bracket")
    sequence = random_sequence(families, 4, np.random.default_rng(4))
    chosen = apart(best_insertions(sequence, families, price_of(families), GainBounds(), 0.1), families)
    assert chosen
    one_by_one = sequence
    for insertion, _ in sorted(chosen, key=lambda c: -c[0].position):
        one_by_one = insert(one_by_one, insertion, families)
    n = len(families.cells.points)
    assert np.array_equal(run(insert_all(sequence, chosen), n), run(one_by_one, n))


def test_pairs_are_asked_again_when_enough_has_changed():
    known, gain = GainBounds(), np.array([1.0, -2.0, 0.5])
    state = np.array([True, False, False])
    assert not known.no_pair(state, gain, 1.0)
    known.put_no_pair(state)
    assert known.no_pair(state, gain, 1.0)
    assert known.no_pair(np.array([True, False, True]), gain, 1.0)
    assert not known.no_pair(np.array([True, True, False]), gain, 1.0)
