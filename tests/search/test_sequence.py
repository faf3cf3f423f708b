"""What a sequence is said to win must be what it wins, wherever a step is put."""

import numpy as np
import pytest
from tests.planted import PARTS
from tests.search.planted_families import planted, random_candidates

from imdim.geometry import kernels
from imdim.program.sequence import Step
from imdim.search.candidate_families import Candidate, Families
from imdim.search.sequence import (
    Covered,
    Insertion,
    Pair,
    Sequence,
    cost,
    error,
    insert,
    insertions,
    pair_insertions,
    run,
    to_program,
    without_one,
)

OPS = ("union", "difference", "intersection")
WEIGHTS = [(1.0, 1.0), (0.1, 1.0), (1.0, 20.0)]


def random_sequence(families: Families, length: int, rng: np.random.Generator) -> Sequence:
    """The part's hull first, so that later steps have something to cut."""
    steps = []
    hull = max(families.best(families.cells.w_in - 1e-3 * families.cells.w_out, 1), key=lambda f: f[0])[1]
    for i, candidate in enumerate([hull, *random_candidates(families, length, rng)][:length]):
        op = "union" if i == 0 else str(rng.choice(OPS, p=[0.5, 0.3, 0.2]))
        steps.append(Step(op, Covered.of(candidate, families)))  # type: ignore[arg-type]
    return tuple(steps)


@pytest.mark.parametrize("name", ["countersink", "tube on a flange", "bored ball"])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_gains_are_changes_of_error(name, weights):
    families, rng = planted(name), np.random.default_rng(11)
    seen = set()
    for length in (0, 1, 2, 3, 3, 5, 5):
        sequence = random_sequence(families, length, rng)
        before = error(sequence, families, weights)
        for found in insertions(sequence, families, 3, 0.0, weights):
            after = error(insert(sequence, found, families), families, weights)
            assert found.gain == pytest.approx(before - after, abs=1e-9 * families.cells.volume)
            seen.add((found.op, found.position == length))
    assert {op for op, _ in seen} == set(OPS)
    assert {at_end for _, at_end in seen} == {True, False}


@pytest.mark.parametrize("name", ["countersink", "L bracket"])
@pytest.mark.parametrize("per_frame", [1, 3])
def test_nothing_wins_more_than_the_best_insertion(name, per_frame):
    families, rng = planted(name), np.random.default_rng(5)
    for length in (1, 2, 4):
        sequence = random_sequence(families, length, rng)
        before = error(sequence, families)
        best = insertions(sequence, families, per_frame, 0.0)[0].gain
        for candidate in random_candidates(families, 60, rng):
            for op in OPS:
                for position in range(length + 1):
                    longer = insert(sequence, Insertion(0.0, position, op, candidate), families)
                    assert before - error(longer, families) <= best * (1 + 1e-9)


def test_no_insertion_wins_less_than_asked():
    families = planted("open box")
    sequence = random_sequence(families, 2, np.random.default_rng(1))
    every = insertions(sequence, families, 3, 0.0)
    least = every[0].gain * 0.7
    found = insertions(sequence, families, 3, least)
    assert all(i.gain > least for i in found)
    assert found[0].gain == every[0].gain
    assert [i.gain for i in found] == sorted((i.gain for i in found), reverse=True)


@pytest.mark.parametrize("name", ["rounded plate", "tube on a flange"])
def test_gains_of_pairs_are_changes_of_error(name):
    families, rng = planted(name), np.random.default_rng(3)
    kinds = set()
    for length in (0, 2, 4):
        sequence = random_sequence(families, length, rng)
        before = error(sequence, families)
        for found in pair_insertions(sequence, families, 0.0, 8):
            assert isinstance(found.shape, Pair)
            longer = insert(sequence, found, families)
            assert found.gain == pytest.approx(before - error(longer, families), abs=1e-9 * families.cells.volume)
            assert cost(longer) == cost(sequence) + 2
            kinds.add((found.op, found.shape.op))
    assert {op for _, op in kinds} == {"intersection", "difference"}


@pytest.mark.parametrize("name", ["rounded plate", "tube on a flange"])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_pairs_that_win_a_share_of_the_best_are_those_among_all(name, share):
    families, rng = planted(name), np.random.default_rng(3)
    for length in (0, 2, 4):
        sequence = random_sequence(families, length, rng)
        every = pair_insertions(sequence, families, 0.0, 8)
        assert len(every) > 1
        wanted = [pair for pair in every if pair.gain >= share * every[0].gain]
        assert pair_insertions(sequence, families, 0.0, 8, share) == wanted


@pytest.mark.parametrize("name", ["countersink", "bored ball", "rounded plate"])
def test_a_sequence_fills_the_cells_of_its_program(name):
    families, rng = planted(name), np.random.default_rng(9)
    points = families.cells.points
    for length in (1, 3, 6):
        sequence = random_sequence(families, length, rng)
        program = to_program(sequence, families)
        # a point on a face has no side
        clear = np.abs(kernels.leaf_table(*_packed(program), points)).min(0) > 1e-9
        assert np.array_equal(kernels.inside(program, points)[clear], run(sequence, len(points))[clear])
        assert clear.mean() > 0.99


def _packed(program):
    from imdim.geometry.sdf import pack

    return pack(program)


def test_an_empty_sequence_is_no_program():
    families = planted("L bracket")
    assert error((), families) == pytest.approx(families.cells.volume)
    with pytest.raises(ValueError, match="empty"):
        to_program((), families)


def test_the_planted_sequence_has_no_error():
    families = planted("L bracket")
    inside = kernels.inside(PARTS["L bracket"], families.cells.points)
    found = insertions((), families, 1, 0.0)[0]
    longer = insert((), found, families)
    second = insertions(longer, families, 1, 0.0)[0]
    assert np.array_equal(run(insert(longer, second, families), len(inside)), inside)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_filled_without_each_step(seed):
    rng, m = np.random.default_rng(seed), 50
    candidate = Candidate(("curved", 0), ((0, 1),))
    steps = tuple(Step(rng.choice(OPS), Covered(candidate, rng.random(m) < 0.5)) for _ in range(seed % 9))
    found = list(without_one(steps, m))
    assert [i for i, _ in found] == list(range(len(steps)))[::-1]
    for i, filled in found:
        assert np.array_equal(filled, run(steps[:i] + steps[i + 1 :], m))
