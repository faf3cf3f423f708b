"""The front of programs from crude to exact: an archive of the best per size, and selection by ranks and crowding.

Ranks and crowding are those of NSGA-II (Deb et al. 2002). A program has a front of its own, by backward elimination.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program
from imdim.search.front.fitness import Score, Scorer

TOGETHER = 30  # a program of more leaves loses one more at a time for each so many


@dataclass(frozen=True)
class Individual:
    """A scored program; `origin` names the operator or the seed that it came from."""

    program: Program
    score: Score
    origin: str = "seed"

    @property
    def objectives(self) -> tuple[float, int]:
        return self.score.error, self.score.primitives


def ranks(objectives: np.ndarray) -> np.ndarray:
    """The non-dominated front [n] to which each row of `objectives` [n, 2] belongs, 0 the best; both are to be small.

    In two dimensions one sweep does it: by the first objective, each row joins the first front whose last second objective it undercuts.
    Equal rows share a front.
    """
    out = np.zeros(len(objectives), np.int64)
    tails: list[tuple[float, float]] = []  # per front its last row; second objectives rise from front to front
    for i in np.lexsort((objectives[:, 1], objectives[:, 0])):
        row = (float(objectives[i, 0]), float(objectives[i, 1]))
        front = next((f for f, tail in enumerate(tails) if row[1] < tail[1] or row == tail), len(tails))
        tails[front : front + 1] = [row]
        out[i] = front
    return out


def crowding(objectives: np.ndarray) -> np.ndarray:
    """The crowding distance [n] of rows [n, 2] of one front: the relative sides of the box between its neighbours, infinite at the ends."""
    out = np.zeros(len(objectives))
    for column in objectives.T:
        order = np.argsort(column, kind="stable")
        span = column[order[-1]] - column[order[0]] or 1.0
        out[order[[0, -1]]] = np.inf
        out[order[1:-1]] += (column[order[2:]] - column[order[:-2]]) / span
    return out


def rank_population(population: Sequence[Individual]) -> list[Individual]:
    """The population from best to worst: by rank, and within a rank the less crowded first. Equal objectives after the first come last."""
    if not population:
        return []
    objectives = np.array([i.objectives for i in population], float)
    _, first = np.unique(objectives, axis=0, return_index=True)
    rank = np.full(len(population), len(population))
    rank[first] = ranks(objectives[first])
    crowd = np.zeros(len(population))
    for front in np.unique(rank[first]):
        members = np.flatnonzero(rank == front)
        # errors span decades: their logarithm keeps the exact end from crowding
        scaled = np.column_stack([np.log(objectives[members, 0] + 1e-6), objectives[members, 1]])
        crowd[members] = crowding(scaled)
    return [population[i] for i in np.lexsort((-crowd, rank))]


class Archive:
    """The best program of each size that was ever seen."""

    def __init__(self) -> None:
        self._best: dict[int, Individual] = {}

    def add(self, individuals: Iterable[Individual]) -> int:
        """How many of `individuals` entered."""
        entered = 0
        for individual in individuals:
            size = individual.score.primitives
            if size not in self._best or individual.score.error < self._best[size].score.error * (1 - 1e-9):
                self._best[size] = individual
                entered += 1
        return entered

    def front(self) -> list[Individual]:
        """Those that no shorter one equals, from crude to exact: sizes rise, errors fall."""
        out: list[Individual] = []
        for size in sorted(self._best):
            if not out or self._best[size].score.error < out[-1].score.error:
                out.append(self._best[size])
        return out

    def best(self) -> Individual | None:
        """The fittest; the shorter one of two equals."""
        return min(self.front(), key=lambda i: i.score.fitness, default=None)


def eliminate_backwards(programs: Iterable[Program], scorer: Scorer) -> list[Individual]:
    """The non-dominated among `programs` and all that thinning the last of them passes through, from crude to exact.

    The leaf whose loss costs least goes first, until one is left: a few batched calls, nearly free.
    """
    archive = Archive()
    every = list(programs)
    archive.add(Individual(p, s) for p, s in zip(every, scorer.score(every), strict=True))
    program = every[-1]
    while len(paths := leaf_paths(program)) > 1:
        trials = {path: p for path, _ in paths if (p := without(program, [path])) is not None}
        scores = dict(zip(trials, scorer.score(list(trials.values())), strict=True))
        archive.add(Individual(trials[path], score, "shorten") for path, score in scores.items())
        cheapest = sorted(trials, key=lambda path: scores[path].fitness)
        program = without(program, cheapest[: 1 + len(paths) // TOGETHER]) or trials[cheapest[0]]
    return archive.front()


def spread(errors: Sequence[float], most: int, keep: int) -> list[int]:
    """Which at most `most` of falling `errors` are even in the logarithm; the first, the last and number `keep` are among them."""
    heights = np.log(np.asarray(errors, float) + 1e-6)
    chosen = {0, len(errors) - 1, keep} if len(errors) else set()
    while len(chosen) < min(most, len(errors)):
        held = heights[sorted(chosen)]
        chosen.add(max((i for i in range(len(errors)) if i not in chosen), key=lambda i: float(np.abs(held - heights[i]).min())))
    return sorted(chosen)
