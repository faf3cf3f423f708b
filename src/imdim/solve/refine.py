"""Refine the numbers of a program whose structure is known, against points of the target's surface.

The residual of a surface point is the program's signed distance there; of a sample that is known to lie inside or outside, its
distance to the wrong side. Residuals pass through the Geman-McClure function, so what the program does not explain does not pull.
Adam covers the distance, Levenberg-Marquardt finishes: each point is decided by one leaf, so the normal equations are one [9, 9] block
per leaf. Unknowns are the face coordinates of `faces.py`; a face that too few points show stays where it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.program.tree import Program
from imdim.solve.faces import lifted, moved, step_maps
from imdim.solve.normal_equations import blocks, held_open, solve_blocks

# A step that lowers the cost by a smaller share ends the work at its robust scale. Half as much follows: leaves that are still far off
# would be taken for noise if the scale fell at once to that of the leaves that fit already.
SETTLED = 1e-2
# At the final scale, the share of the cost below which a step ends the work.
FINISHED = 1e-7
MAX_REJECTED = 8

Stop = Literal["converged", "stalled", "budget_spent", "no_support"]


@dataclass
class RefineConfig:
    """Lengths are shares of the diagonal of the target points' box."""

    adam_steps: int = 30
    adam_rate: float = 2e-3  # length of a step of each coordinate, at the start
    newton_steps: int = 60
    start_scale: float = 0.02  # residuals well beyond this do not pull
    noise_factor: float = 4.0  # the scale follows this many robust standard deviations of the explained points
    end_scale: float = 1e-6  # it does not fall below this
    side_weight: float = 0.2  # of a sample on the wrong side, where a surface point has 1
    min_support: float = 6.0  # a coordinate is held unless at least as many points show it
    min_step: float = 1e-8  # converged when no coordinate moves more


@dataclass(frozen=True)
class Fit:
    """`rms` distance in units of the points over the `explained` share of them: those within the final robust scale."""

    program: Program
    rms: float
    explained: float
    iterations: int
    stop: Stop


def refine(
    program: Program,
    points: np.ndarray,
    *,
    normals: np.ndarray | None = None,
    inside: np.ndarray | None = None,
    outside: np.ndarray | None = None,
    config: RefineConfig | None = None,
    deadline: Deadline = NEVER,
) -> Fit:
    """The program with its numbers moved to fit `points` [n, 3] of the target's surface.

    `normals` [n, 3] (unit, outward) keep a point from pulling a face that looks another way. Samples `inside` and `outside`
    [m, 3] pull where the program has them on the wrong side. Past the `deadline` (by default never) the numbers stay as they are by then.
    Raises ValueError without points.
    """
    if len(points) == 0:
        raise ValueError("refine needs surface points, got none")
    config = config or RefineConfig()
    target = _Target.of(points, normals, inside, outside)
    start = lower(program)
    state = _State(start, np.inf, config.start_scale * target.diagonal, 0)
    state = _adam(state, target, config, deadline)
    state, stop = _newton(state, target, config, deadline)
    distance = np.abs(kernels.program_sdf(state.numbers, target.points))
    explained = distance < state.scale
    rms = float(np.sqrt(np.mean(distance[explained] ** 2))) if explained.any() else float("inf")
    return Fit(lifted(program, start, state.numbers), rms, float(explained.mean()), state.iterations, stop)


@dataclass(frozen=True)
class _Target:
    """Surface points and labelled samples in one array: `side` is 0 on the surface, +1 for inside, -1 for outside samples."""

    points: np.ndarray
    samples: np.ndarray
    side: np.ndarray
    normals: np.ndarray | None
    diagonal: float

    @staticmethod
    def of(points: np.ndarray, normals: np.ndarray | None, inside: np.ndarray | None, outside: np.ndarray | None) -> _Target:
        empty = np.empty((0, 3))
        groups = [
            np.asarray(g, float).reshape(-1, 3)
            for g in (points, empty if inside is None else inside, empty if outside is None else outside)
        ]
        side = np.repeat([0.0, 1.0, -1.0], [len(g) for g in groups])
        diagonal = float(np.linalg.norm(np.ptp(groups[0], axis=0))) or 1.0
        return _Target(groups[0], np.ascontiguousarray(np.concatenate(groups)), side, normals, diagonal)


@dataclass(frozen=True)
class _State:
    numbers: Lowered
    cost: float
    scale: float
    iterations: int


@dataclass(frozen=True)
class _Linear:
    """Cost and, per leaf, its Gauss-Newton matrix [k, 9, 9] and gradient [k, 9] in face coordinates."""

    cost: float
    matrix: np.ndarray
    gradient: np.ndarray
    maps: np.ndarray
    residual: np.ndarray
    trust: np.ndarray


def _residuals(value: np.ndarray, side: np.ndarray) -> np.ndarray:
    # an inside sample (+1) is wrong by a positive value, an outside sample (-1) by a negative one
    return np.where(side == 0, value, side * np.maximum(side * value, 0.0))


def _scales(target: _Target, scale: float, config: RefineConfig) -> np.ndarray:
    # the scale of noise is no reason to let go of a sample on the wrong side
    return np.where(target.side == 0, scale, config.start_scale * target.diagonal)


def _cost(residual: np.ndarray, scale: np.ndarray, trust: np.ndarray) -> float:
    square = residual * residual
    return float((trust * square / (1 + square / (scale * scale))).sum())


def _linearise(numbers: Lowered, target: _Target, scale: float, config: RefineConfig) -> _Linear:
    leaf, value, tangent, normal = kernels.program_tangent(numbers, target.samples)
    residual, scales = _residuals(value, target.side), _scales(target, scale, config)
    trust = np.where(target.side == 0, 1.0, config.side_weight)
    if target.normals is not None:
        n = len(target.points)
        trust[:n] = np.maximum((normal[:n] * target.normals).sum(1), 0.0) ** 2
    pulls = (target.side == 0) | (residual != 0)
    weight = trust * pulls / (1 + (residual / scales) ** 2) ** 2
    maps = step_maps(numbers)
    matrix, gradient = blocks(leaf, tangent, residual, weight, maps)
    return _Linear(_cost(residual, scales, trust), matrix, gradient, maps, residual, trust)


def _adam(state: _State, target: _Target, config: RefineConfig, deadline: Deadline) -> _State:
    """Adam (Kingma and Ba 2015) with a cosine-shaped rate; a fixed floor under the root keeps weakly shown faces slow."""
    mean, square = np.zeros((len(state.numbers.kinds), 9)), np.zeros((len(state.numbers.kinds), 9))
    numbers = state.numbers
    for t in range(1, config.adam_steps + 1):
        if deadline.passed():
            break
        linear = _linearise(numbers, target, state.scale, config)
        gradient = np.where(held_open(linear.matrix, config.min_support), linear.gradient, 0.0) / len(target.points)
        mean, square = 0.8 * mean + 0.2 * gradient, 0.95 * square + 0.05 * gradient**2
        rate = config.adam_rate * target.diagonal * 0.5 * (1 + np.cos(np.pi * t / (config.adam_steps + 1)))
        floor = 1e-3 * state.scale
        step = -rate * mean / (1 - 0.8**t) / (np.sqrt(square / (1 - 0.95**t)) + floor)
        numbers = moved(numbers, linear.maps, step)
    return _State(numbers, state.cost, state.scale, config.adam_steps)


def _newton(state: _State, target: _Target, config: RefineConfig, deadline: Deadline) -> tuple[_State, Stop]:
    """Levenberg-Marquardt; the robust scale falls with the residuals of what is explained."""
    damping, iterations, rejected = 1e-3, state.iterations, 0
    numbers, scale = state.numbers, state.scale
    linear = _linearise(numbers, target, scale, config)
    for _ in range(config.newton_steps):
        if deadline.passed():
            break
        iterations += 1
        free = held_open(linear.matrix, config.min_support)
        if not free.any():
            return _State(numbers, linear.cost, scale, iterations), "no_support"
        step = solve_blocks(linear.matrix, linear.gradient, free, damping)
        trial = moved(numbers, linear.maps, step)
        after = _linearise(trial, target, scale, config)
        still = np.abs(step).max() < config.min_step * target.diagonal
        # under the trust of before: a point that now sees its own face is no worse fit
        cost = _cost(after.residual, _scales(target, scale, config), linear.trust)
        if cost > linear.cost:
            damping, rejected = damping * 6, rejected + 1
            if still or rejected > MAX_REJECTED:
                return _State(numbers, linear.cost, scale, iterations), "converged" if still else "stalled"
            continue
        gain = linear.cost - cost
        settled, finished = still or gain <= SETTLED * linear.cost, still or gain <= FINISHED * linear.cost
        numbers, linear, damping, rejected = trial, after, max(damping / 5, 1e-9), 0
        smaller = max(0.5 * scale, _noise_scale(linear.residual[: len(target.points)], scale, target, config))
        if settled and smaller < scale:
            scale = smaller
            linear = _linearise(numbers, target, scale, config)
        elif finished:
            return _State(numbers, linear.cost, scale, iterations), "converged"
    return _State(numbers, linear.cost, scale, iterations), "budget_spent"


def _noise_scale(residual: np.ndarray, scale: float, target: _Target, config: RefineConfig) -> float:
    """The scale that the explained points' robust standard deviation asks for, at most `scale`."""
    close = np.abs(residual)[np.abs(residual) < scale]
    if len(close) == 0:
        return scale
    spread = config.noise_factor * 1.4826 * float(np.median(close))
    return min(scale, max(spread, config.end_scale * target.diagonal))
