"""A program's own front: the leaf whose loss costs least goes first, until one is left. A few batched calls, nearly free."""

from __future__ import annotations

from collections.abc import Iterable

from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program
from imdim.search.front.fitness import Scorer
from imdim.search.front.front import Archive, Individual

TOGETHER = 30  # a program of more leaves loses one more at a time for each so many


def eliminate_backwards(programs: Iterable[Program], scorer: Scorer) -> list[Individual]:
    """The non-dominated among `programs` and all that thinning the last of them passes through, from crude to exact."""
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
