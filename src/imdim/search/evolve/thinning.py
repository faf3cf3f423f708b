"""A program's own front: the leaf whose loss costs least goes first, until one is left. A few batched calls, nearly free."""

from __future__ import annotations

from collections.abc import Iterable

from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program
from imdim.search.evolve.fitness import Scorer
from imdim.search.evolve.front import Archive, Individual


def thinned(programs: Iterable[Program], scorer: Scorer) -> list[Individual]:
    """The non-dominated among `programs` and all that thinning the last of them passes through, from crude to exact."""
    archive = Archive()
    every = list(programs)
    archive.add(Individual(p, s) for p, s in zip(every, scorer.score(every), strict=True))
    program = every[-1]
    while len(paths := leaf_paths(program)) > 1:
        trials = [p for path, _ in paths if (p := without(program, [path])) is not None]
        scores = scorer.score(trials)
        archive.add(Individual(p, s, "shorten") for p, s in zip(trials, scores, strict=True))
        program = trials[min(range(len(trials)), key=lambda i: scores[i].fitness)]
    return archive.front()
