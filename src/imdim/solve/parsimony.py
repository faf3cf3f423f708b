"""The shortest of the programs that explain a noisy cloud: what the noise could have done is no feature.

Programs are judged by the length of a message that tells the points: their negative log-density in all, half the logarithm of their number
for each number of the program (Schwarz 1978), and a surcharge for skins that the noise blurs into one surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from imdim.program.paths import leaf_paths, without
from imdim.program.tree import SIZE_NAMES, Program, leaves
from imdim.solve.likelihood import Noise, Shown, shares
from imdim.solve.maximise import Likely, MaximiseConfig, maximise

PLACE = {"box": 6, "ellipsoid": 6, "sphere": 3, "cylinder": 5, "cone": 5, "torus": 5}  # numbers that say where a kind lies
SKIN = 0.1  # nats that a point on a skin thinner than the noise costs
WORTH_A_TRY = 0.02  # nats per point that a removal may cost before its numbers are fitted again
REFIT = MaximiseConfig(rounds=4, through=0.0)
ROUNDS = 24


def length(program: Program, points: np.ndarray, noise: Noise, fitted: float | None = None) -> float:
    """Nats per point of `points` [n, 3]; `fitted` is the negative log-density where it is known already."""
    shown = Shown.of(program, noise.sigma)
    nll = shares(points, shown, noise).nll if fitted is None else fitted
    numbers = sum(PLACE[p.kind] + len(SIZE_NAMES[p.kind]) for p in leaves(program))
    return nll + 0.5 * numbers * math.log(len(points)) / len(points) + SKIN * shown.skin


def shortened(
    likely: Likely, points: np.ndarray, out_of_time: Callable[[], bool], keeps: Callable[[Program], bool] = lambda program: True
) -> Likely:
    """Without the primitives that cost more than they explain, one after another, numbers fitted again after each; `keeps` may forbid."""
    best, cost = likely, length(likely.program, points, likely.noise, likely.nll)
    for _ in range(ROUNDS):
        trials = [t for t in _removals(best.program) if keeps(t)]
        costs = [length(t, points, best.noise) for t in trials]
        found = None
        for i in np.argsort(costs):
            if costs[i] > cost + WORTH_A_TRY or out_of_time():
                break
            trial = maximise(trials[i], points, best.noise, REFIT)
            after = length(trial.program, points, trial.noise, trial.nll)
            if after < cost:
                found, cost = trial, after
                break
        if found is None:
            return best
        best = found
    return best


def _removals(program: Program) -> list[Program]:
    """All programs that lack one leaf."""
    trials = [without(program, [path]) for path, _ in leaf_paths(program)]
    return [t for t in trials if t is not None]
