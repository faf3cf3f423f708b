"""Go on from a program that a person has edited: evolution starts from it alone, with the rates that they chose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from imdim.program.tree import Program
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import Snapshot, resume
from imdim.search.evolve.population import EvolutionConfig
from imdim.target.target import Target


@dataclass(frozen=True)
class Rates:
    """`mutation` is the share of children that are mutated, the others are crossed; `elitism` the share of parents from the fitter half."""

    mutation: float = 0.8
    elitism: float = 0.4
    population: int = 64
    tolerance: float = 1e-4  # error at which only a shorter program can be fitter


def resume_evolution(target: Target, program: Program, settings: Settings, rates: Rates, now: Callable[[], float]) -> Iterator[Snapshot]:
    """Snapshots of an evolution that starts from `program`; the last one has rounded numbers, constraints and the front."""
    config = EvolutionConfig(rates.population, rates.population, exact=rates.tolerance, crossover=1 - rates.mutation, elitism=rates.elitism)
    return resume(target, program, settings, config, np.random.default_rng(settings.seed), now)
