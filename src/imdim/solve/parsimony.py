"""The shortest of the programs that explain a noisy cloud: what the noise could have done is no feature.

Programs are judged by the length of a message that tells the points: their negative log-density in all, half the logarithm of their number
for each number of the program (Schwarz 1978), and a surcharge for skins that the noise blurs into one surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from imdim.program.paths import leaf_paths, replaced, without
from imdim.program.tree import SIZE_NAMES, Primitive, Program, leaves
from imdim.solve.likelihood import Noise, Shown, shares
from imdim.solve.maximise import Likely, MaximiseConfig, maximise

PLACE = {"box": 6, "ellipsoid": 6, "sphere": 3, "cylinder": 5, "cone": 5, "torus": 5}  # numbers that say where a kind lies
SKIN = 0.1  # nats that a point on a skin thinner than the noise costs
WORTH_A_TRY = 0.02  # nats per point that a removal may cost before its numbers are fitted again
REFIT = MaximiseConfig(rounds=4, through=0.0)
ROUNDS = 24
TAPER = 0.05  # of a radius
SURE = 5e-3  # nats per point, more than the surface's samples may leave in doubt


def length(program: Program, points: np.ndarray, noise: Noise, fitted: float | None = None) -> float:
    """Nats per point of `points` [n, 3]; `fitted` is the negative log-density where it is known already."""
    shown = Shown.of(program, noise.sigma)
    nll = shares(points, shown, noise).nll if fitted is None else fitted
    numbers = sum(PLACE[p.kind] + len(SIZE_NAMES[p.kind]) for p in leaves(program))
    return nll + 0.5 * numbers * math.log(len(points)) / len(points) + SKIN * shown.skin


def shortened(likely: Likely, points: np.ndarray, out_of_time: Callable[[], bool]) -> Likely:
    """Without the primitives that cost more than they explain, and with cones for cylinders that taper, numbers fitted again after each."""
    best, cost = likely, length(likely.program, points, likely.noise, likely.nll)
    for moves, slack, gain in ((_removals, WORTH_A_TRY, 0.0), (_tapered, math.inf, SURE)):
        for _ in range(ROUNDS):
            found = _first_shorter(best, moves(best.program), cost - gain, slack, points, out_of_time)
            if found is None:
                break
            best, cost = found
    return best


def _first_shorter(
    best: Likely, trials: list[Program], cost: float, slack: float, points: np.ndarray, out_of_time: Callable[[], bool]
) -> tuple[Likely, float] | None:
    """The first of `trials`, likeliest first, that is shorter than `cost` once its numbers are fitted; none where time is out."""
    costs = [math.inf if out_of_time() else length(t, points, best.noise) for t in trials]
    for i in np.argsort(costs, kind="stable"):
        if costs[i] > cost + slack or out_of_time():
            return None
        trial = maximise(trials[i], points, best.noise, REFIT)
        after = length(trial.program, points, trial.noise, trial.nll)
        if after < cost:
            return trial, after
    return None


def _removals(program: Program) -> list[Program]:
    """All programs that lack one leaf."""
    trials = [without(program, [path]) for path, _ in leaf_paths(program)]
    return [t for t in trials if t is not None]


def _tapered(program: Program) -> list[Program]:
    """All programs with a cone in the place of one cylinder, a little wider at either end."""
    found = []
    for path, leaf in leaf_paths(program):
        if leaf.kind == "cylinder":
            radius, height = leaf.size
            for by in (TAPER, -TAPER):
                cone = Primitive("cone", (radius * (1 - by), radius * (1 + by), height), leaf.center, leaf.rotation)
                found.append(replaced(program, path, cone))
    return found
