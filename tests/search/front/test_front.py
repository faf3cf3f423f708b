"""Ranks, crowding and the archive against brute force."""

import numpy as np
import pytest

from imdim.program.tree import Primitive
from imdim.reconstruction.choices import thin_front
from imdim.search.front.fitness import Score
from imdim.search.front.front import Archive, Individual, crowding, rank_population, ranks, spread


def dominates(a: np.ndarray, b: np.ndarray) -> bool:
    return bool((a <= b).all() and (a < b).any())


def peeled(objectives: np.ndarray) -> list[int]:
    """Ranks by the definition: the rows that no remaining row dominates leave together."""
    rank, left, front = [-1] * len(objectives), set(range(len(objectives))), 0
    while left:
        free = {i for i in left if not any(dominates(objectives[j], objectives[i]) for j in left)}
        for i in free:
            rank[i] = front
        left -= free
        front += 1
    return rank


@pytest.mark.parametrize("seed", range(20))
def test_ranks_are_those_of_the_definition(seed):
    rng = np.random.default_rng(seed)
    objectives = np.column_stack([rng.integers(0, 12, 60), rng.integers(0, 8, 60)]).astype(float)
    assert ranks(objectives).tolist() == peeled(objectives)


def test_crowding_of_a_line():
    assert crowding(np.array([[0.0, 4], [1, 3], [3, 1], [4, 0]])).tolist() == [np.inf, 1.5, 1.5, np.inf]


def individual(error: float, primitives: int) -> Individual:
    return Individual(Primitive("sphere", (error + primitives,)), Score(error, 0.0, error, primitives, error + 1e-3 * primitives))


def random_individuals(seed: int) -> list[Individual]:
    rng = np.random.default_rng(seed)
    return [individual(float(rng.integers(1, 30)) / 30, int(rng.integers(1, 9))) for _ in range(80)]


@pytest.mark.parametrize("seed", range(5))
def test_the_archive_is_the_non_dominated_set(seed):
    every = random_individuals(seed)
    archive = Archive()
    archive.add(every[:40])
    archive.add(every[40:])
    points = {i.objectives for i in every}
    best = sorted(p for p in points if not any(dominates(np.array(q), np.array(p)) for q in points))
    assert [i.objectives for i in archive.front()] == best[::-1]
    best = archive.best()
    assert best is not None
    assert best.score.fitness == min(i.score.fitness for i in every)


def test_an_empty_archive_has_no_best():
    assert Archive().best() is None
    assert Archive().front() == []


def test_selection_keeps_the_first_front_and_puts_doubles_last():
    every = random_individuals(1)
    order = rank_population(every)
    assert sorted(map(id, order)) == sorted(map(id, every))
    first = {i.objectives for i, r in zip(every, peeled(np.array([i.objectives for i in every], float)), strict=True) if r == 0}
    assert {i.objectives for i in order[: len(first)]} == first
    distinct = len({i.objectives for i in every})
    assert len({i.objectives for i in order[:distinct]}) == distinct
    assert rank_population([]) == []


def test_a_spread_is_even_and_keeps_what_it_must():
    errors = [10.0 ** (-i / 4) for i in range(20)]
    chosen = spread(errors, 5, keep=13)
    assert {0, 13, 19} <= set(chosen)
    assert len(chosen) == 5
    assert np.diff(chosen).max() <= 7
    assert spread(errors[:3], 7, keep=2) == [0, 1, 2]


def test_of_nothing_nothing_is_chosen():
    assert spread([], 5, keep=-1) == []
    assert thin_front((), Primitive("sphere", (1.0,))) == []
