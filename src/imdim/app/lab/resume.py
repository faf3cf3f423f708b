"""Go on from a program that a person has edited: evolution starts from it alone, with the rates that they chose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from imdim.deadline import Deadline
from imdim.program.front import Choice
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.tree import Program
from imdim.reconstruction.choices import choices_beside, few
from imdim.reconstruction.config import Settings
from imdim.reconstruction.evolution import evolve_observation
from imdim.reconstruction.fitting import find_relations, fit_numbers, snap_numbers
from imdim.reconstruction.observation import Observation, UnitBody, observe
from imdim.reconstruction.pipeline import Snapshot
from imdim.search.evolve.population import EvolutionConfig, Generation
from imdim.target.target import Frame, Target, in_unit_frame

SEARCH_SHARE = 0.8  # of the budget; the numbers need the rest


@dataclass(frozen=True)
class Rates:
    """`mutation` is the share of children that are mutated, the others are crossed; `elitism` the share of parents from the fitter half."""

    mutation: float = 0.8
    elitism: float = 0.4
    population: int = 64
    tolerance: float = 1e-4  # error at which only a shorter program can be fitter


def resume_evolution(target: Target, program: Program, settings: Settings, rates: Rates, now: Callable[[], float]) -> Iterator[Snapshot]:
    """Snapshots of an evolution that starts from `program`; the last one has rounded numbers, constraints and the front."""
    start, rng = now(), np.random.default_rng(settings.seed)
    unit, frame = in_unit_frame(target)
    seen = observe(UnitBody.of(unit, rng), settings.size_weight, rng)
    config = EvolutionConfig(rates.population, rates.population, exact=rates.tolerance, crossover=1 - rates.mutation, elitism=rates.elitism)
    deadline = Deadline(start + SEARCH_SHARE * settings.budget_s, now)
    generation: Generation | None = None
    for generation in evolve_observation(seen.evidence, {"edited": [frame.apply(program)]}, rng, deadline, config):
        best = frame.undo(generation.best.program)
        front = [Choice(frame.undo(i.program), i.score.volume) for i in generation.front]
        yield Snapshot("evolve", best, generation.best.score.volume, now() - start, front=tuple(few(front, best)))
    assert generation is not None  # at least one is yielded
    yield _finish(generation, seen, frame, target, lambda: now() - start)


def _finish(generation: Generation, seen: Observation, frame: Frame, target: Target, seconds: Callable[[], float]) -> Snapshot:
    """What a person gets: reduced, fitted, rounded, with its relations and the front from crude to exact."""
    fitted = fit_numbers(reduce_program(generation.best.program), seen)
    final, constraints = find_relations(snap_numbers(frame.undo(fitted), seen, frame), target)
    unit = frame.apply(final)
    front = few(choices_beside(final, unit, [i.program for i in generation.front], seen.evidence, frame), final)
    return Snapshot("finished", final, seen.error(unit), seconds(), generation.stop or "finished", tuple(front), constraints)
