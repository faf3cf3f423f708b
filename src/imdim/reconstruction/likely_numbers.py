"""The numbers of a noisy cloud's program that make its points most likely, and the relations among them that the points support."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from imdim.deadline import Deadline
from imdim.geometry.lowering import lower
from imdim.geometry.sampling import subsample
from imdim.numbers.em import EMConfig, FittedProgram, maximise_likelihood
from imdim.numbers.likelihood import Noise, negative_log_density
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.constraints import Constraint
from imdim.program.tree import Program, map_leaves
from imdim.relations.discover import discover
from imdim.relations.residuals import rows_of

MOST_POINTS = 8192
NUMBERS_SHARE = 0.85  # of the time in which numbers are fitted: the relations among them need the rest
HELD_S = 0.5  # that there are for relations in any case
TOLD = 4  # rounds that tell whether ends are better let through
SAME = 2e-3  # nats per point, what the samples of the surface leave in doubt
QUICK = EMConfig()
# walls that blur thin or thicken slowly, as the noise grows or falls
CAREFUL = EMConfig(rounds=60, still=0.004, calmer=0.003, samples=40_000, whole=True)


@dataclass(frozen=True)
class NoisyFit:
    """The program that tells a noisy cloud, with the relations that the points support; whether time has `cut` the search for it, or the
    fit of its numbers."""

    program: Program
    constraints: tuple[Constraint, ...]
    cut: bool


def settle_together(program: Program, points: np.ndarray, sigma: float, deadline: Deadline) -> NoisyFit:
    """A program with the numbers that make `points` [n, 3] most likely, whose noise has the deviation `sigma`, and with the relations that
    they support: those between bodies that were found apart, too."""
    some = subsample(points, MOST_POINTS)
    numbers_by = deadline.ahead(NUMBERS_SHARE * deadline.left())
    program, constraints = hold_relations(fit_numbers(program, some, Noise(sigma), numbers_by, CAREFUL), some, deadline)
    return NoisyFit(program, constraints, numbers_by.has_passed())


def fit_numbers(program: Program, points: np.ndarray, noise: Noise, deadline: Deadline, config: EMConfig = QUICK) -> FittedProgram:
    """The numbers that make the points most likely, with ends let through what they only just meet, unless a few rounds tell that this
    hides what they show."""
    begun, drawn = replace(config, rounds=min(TOLD, config.rounds)), replace(config, through=0.0)
    through, as_drawn = (maximise_likelihood(program, points, noise, c, deadline) for c in (begun, replace(begun, through=0.0)))
    likely = through if through.nll < as_drawn.nll + SAME else as_drawn
    if deadline.has_passed() or config.rounds <= TOLD:
        return likely
    further = maximise_likelihood(likely.program, points, likely.noise, drawn, deadline)
    return further if further.nll < likely.nll else likely


def hold_relations(likely: FittedProgram, points: np.ndarray, deadline: Deadline) -> tuple[Program, tuple[Constraint, ...]]:
    """With the relations that the points support made exact, unless that makes the points less likely than as many numbers are worth. It is
    quick, and worth more than the search's last round, which may have ended late: for HELD_S it goes on past the deadline."""
    plain = map_leaves(likely.program, lambda _, leaf: canonical(leaf))
    found = discover(plain, points, deadline.later(deadline.ahead(HELD_S)), likely.noise.sigma)
    # the best round of a fit is the best of its samples too: both are told by new ones
    together, apart = (negative_log_density(p, points, likely.noise, CAREFUL.samples) for p in (found.program, plain))
    held = np.linalg.matrix_rank(rows_of(found.constraints, lower(plain)).jacobian) if found.constraints else 0
    worth = 0.5 * int(held) * math.log(len(points)) / len(points)
    return (found.program, found.constraints) if together < apart + worth else (likely.program, ())
