"""The genetic algorithm: a generator of generations over CSG trees, with error and size as its two objectives.

Own short code: well-kept libraries (pymoo, DEAP) select by several objectives, but their variation wants flat vectors or strongly typed
expression trees, and they score one individual at a time; what costs here, scoring and the operators that know geometry, would be ours
in any case. Selection is NSGA-II's (Deb et al. 2002). Children of the best pass through a solver that the caller gives (Lamarckian: the
solved numbers are inherited).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from imdim.deadline import Deadline
from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program, leaves
from imdim.search.evolve.operators import MUTATIONS, crossover
from imdim.search.evolve.proposals import random_programs
from imdim.search.evolve.scene import Scene
from imdim.search.front.front import Archive, Individual, rank_population

Stop = Literal["exact", "stagnation", "budget_spent", "finished"]
Refine = Callable[[Program], Program]
BATCH = 256  # seeds scored at a time, so that a deadline is seen


@dataclass
class EvolutionConfig:
    population: int = 64
    offspring: int = 64
    generations: int = 400
    patience: int = 60  # generations without a fitter best, then "stagnation"
    exact: float = 1e-4  # error at which only a shorter program can be fitter
    exact_patience: int = 20  # generations without one, then "exact"
    progress: float = 1e-4  # relative gain in fitness that counts
    crossover: float = 0.2  # share of the children
    elitism: float = 0.4  # share of the parents that come from the front's fitter half
    solved: int = 1  # children per generation that pass through the solver
    shortened: int = 3  # newcomers to the front per generation of which every shorter one is tried
    max_primitives: int = 120


@dataclass(frozen=True)
class Generation:
    """`front` from crude to exact; `diversity` is the share of the population with a solid of its own; `origins` counts
    who put how many on the archive; `evaluations` are trees folded since the start. `stop` says why the last one is the last.
    """

    number: int
    best: Individual
    front: tuple[Individual, ...]
    evaluations: int
    diversity: float
    origins: Mapping[str, int] = field(default_factory=dict)
    stop: Stop | None = None


def evolve(
    seeds: Mapping[str, Sequence[Program]],
    scene: Scene,
    rng: np.random.Generator,
    deadline: Deadline,
    config: EvolutionConfig | None = None,
    refine: Refine | None = None,
) -> Iterator[Generation]:
    """Yield generations, the seeds being number 0. The same seeds and generator give the same generations, but for the deadline's.

    `seeds` maps a source to its programs; where none is of use, random ones are drawn. At least one generation is yielded.
    """
    state = _Evolution(scene, rng, config or EvolutionConfig(), refine)
    state.start(seeds, deadline)
    idle = 0
    for number in range(state.config.generations + 1):
        before = state.best.score.fitness if number else np.inf
        if number:
            state.step(deadline)
        idle = 0 if state.best.score.fitness < before * (1 - state.config.progress) else idle + 1
        stop = state.ending(number, idle, deadline.has_passed())
        yield state.generation(number, stop)
        if stop:
            return


class _Evolution:
    """A population and its archive."""

    def __init__(self, scene: Scene, rng: np.random.Generator, config: EvolutionConfig, refine: Refine | None) -> None:
        self.scene, self.rng, self.config, self.refine = scene, rng, config, refine
        self.archive = Archive()
        self.population: list[Individual] = []
        self.origins: Counter[str] = Counter()
        self.solved: set[int] = set()
        self.shortened: set[int] = set()
        weights = np.array([w for w, _ in MUTATIONS.values()])
        self._names, self._odds = list(MUTATIONS), weights / weights.sum()

    @property
    def best(self) -> Individual:
        best = self.archive.best()
        assert best is not None
        return best

    def start(self, seeds: Mapping[str, Sequence[Program]], deadline: Deadline) -> None:
        """The seeds that are of use, scored; random ones where there are none."""
        named = [(source, p) for source, programs in seeds.items() for p in programs if self._fits(p)]
        for i in range(0, len(named), BATCH):
            self._join(named[i : i + BATCH])
            if deadline.has_passed():
                break
        if not self.population:
            self._revive()
        self.population = rank_population(self.population)[: self.config.population]

    def step(self, deadline: Deadline) -> None:
        """One generation: children, their solved and shortened kin, and the selection among all."""
        self.origins.clear()
        children = self._children(deadline)
        before = len(self.population)
        self._join(children)
        newcomers = self.population[before:]
        self._join(self._solve_fittest(newcomers))
        self._join(self._shorter())
        if len(self.population) == before and not children:
            self._revive()
        self.population = rank_population(self.population)[: self.config.population]

    def generation(self, number: int, stop: Stop | None) -> Generation:
        filled = self.scene.scorer.fill([i.program for i in self.population])
        diversity = len({row.tobytes() for row in filled}) / len(filled)
        front = tuple(self.archive.front())
        return Generation(number, self.best, front, self.scene.scorer.evaluations, diversity, dict(self.origins), stop)

    def ending(self, number: int, idle: int, late: bool) -> Stop | None:
        config = self.config
        if self.best.score.error <= config.exact and idle >= config.exact_patience:
            return "exact"
        if idle >= config.patience:
            return "stagnation"
        if late:
            return "budget_spent"
        return "finished" if number >= config.generations else None

    def _fits(self, program: Program) -> bool:
        parts = list(leaves(program))
        return len(parts) <= self.config.max_primitives and all(self.scene.holds(p) for p in parts)

    def _join(self, named: Sequence[tuple[str, Program]]) -> None:
        """Score programs with their origins, and let them into the archive and the population."""
        scores = self.scene.scorer.score([p for _, p in named])
        for (origin, program), score in zip(named, scores, strict=True):
            individual = Individual(program, score, origin)
            self.origins[origin] += self.archive.add([individual])
            self.population.append(individual)

    def _revive(self) -> None:
        """A population that died out starts anew from random programs, beside whatever the archive holds."""
        self.population += self.archive.front()
        self._join([("random", p) for p in random_programs(self.scene, self.config.population, self.rng)])

    def _children(self, deadline: Deadline) -> list[tuple[str, Program]]:
        children: list[tuple[str, Program]] = []
        for _ in range(2 * self.config.offspring):
            if len(children) >= self.config.offspring or deadline.has_passed():
                break
            origin, child = self._child()
            if child is not None and self._fits(child):
                children.append((origin, child))
        return children

    def _child(self) -> tuple[str, Program | None]:
        parent = self._parent()
        if self.rng.random() < self.config.crossover:
            return "crossover", crossover(parent.program, self._parent().program, self.scene.scorer, self.rng)
        name = self._names[self.rng.choice(len(self._names), p=self._odds)]
        return name, MUTATIONS[name][1](parent.program, self.scene, self.rng)

    def _parent(self) -> Individual:
        """From the fitter half of the front, or by a tournament of two in the population, which is in order."""
        if self.rng.random() < self.config.elitism:
            front = sorted(self.archive.front(), key=lambda i: i.score.fitness)
            return front[self.rng.integers((len(front) + 1) // 2)]
        return self.population[self.rng.integers(len(self.population), size=2).min()]

    def _solve_fittest(self, newcomers: Sequence[Individual]) -> list[tuple[str, Program]]:
        """The fittest newcomers with the numbers that the solver finds."""
        if self.refine is None:
            return []
        fresh = {self.scene.scorer.key(i.program): i for i in newcomers}
        fresh = {key: i for key, i in fresh.items() if key not in self.solved}
        chosen = sorted(fresh.items(), key=lambda item: item[1].score.fitness)[: self.config.solved]
        self.solved.update(key for key, _ in chosen)
        programs = [self.refine(i.program) for _, i in chosen]
        self.solved.update(self.scene.scorer.key(p) for p in programs)
        return [("solver", p) for p in programs if self._fits(p)]

    def _shorter(self) -> list[tuple[str, Program]]:
        """The fittest members of the front that are new, each without one of its leaves in turn."""
        out: list[tuple[str, Program]] = []
        fresh = [i for i in self.archive.front() if self.scene.scorer.key(i.program) not in self.shortened]
        for individual in sorted(fresh, key=lambda i: i.score.fitness)[: self.config.shortened]:
            self.shortened.add(self.scene.scorer.key(individual.program))
            trials = [without(individual.program, [path]) for path, _ in leaf_paths(individual.program)]
            out += [("shorten", p) for p in trials if p is not None]
        return out
