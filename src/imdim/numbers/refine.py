"""Refine the numbers of a program whose structure is known, against points of the target's surface.

The residual of a surface point is the program's signed distance there. Residuals pass through the Geman-McClure function, so what the
program does not explain does not pull. Levenberg-Marquardt: each point is decided by one leaf, so the normal equations are one [9, 9]
block per leaf. Unknowns are the `face_coordinates`; a face that too few points show stays where it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.numbers.face_coordinates import lift_numbers, move_limited, step_maps
from imdim.numbers.normal_equations import blocks, mask_determined, solve_blocks
from imdim.program.tree import Program

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

    newton_steps: int = 60
    start_scale: float = 0.02  # residuals well beyond this do not pull
    noise_factor: float = 4.0  # the scale follows this many robust standard deviations of the explained points
    end_scale: float = 1e-6  # it does not fall below this
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


def refine(program: Program, points: np.ndarray, *, config: RefineConfig | None = None, deadline: Deadline = NEVER) -> Fit:
    """The program with its numbers moved to fit `points` [n, 3] of the target's surface.

    Past the `deadline` (by default never) the numbers stay as they are by then. Raises ValueError without points.
    """
    if len(points) == 0:
        raise ValueError("refine needs surface points, got none")
    config = config or RefineConfig()
    points = np.ascontiguousarray(points, float)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    start = lower(program)
    numbers, scale, iterations, stop = _newton(start, points, diagonal, config, deadline)
    distance = np.abs(kernels.program_sdf(numbers, points))
    explained = distance < scale
    rms = float(np.sqrt(np.mean(distance[explained] ** 2))) if explained.any() else float("inf")
    return Fit(lift_numbers(program, start, numbers), rms, float(explained.mean()), iterations, stop)


@dataclass(frozen=True)
class _Linear:
    """Cost and, per leaf, its Gauss-Newton matrix [k, 9, 9] and gradient [k, 9] in face coordinates."""

    cost: float
    matrix: np.ndarray
    gradient: np.ndarray
    maps: np.ndarray
    residual: np.ndarray


def _linearise(numbers: Lowered, points: np.ndarray, scale: float) -> _Linear:
    leaf, residual, tangent, _ = kernels.program_tangent(numbers, points)
    maps = step_maps(numbers)
    matrix, gradient = blocks(leaf, tangent, residual, 1 / (1 + (residual / scale) ** 2) ** 2, maps)
    square = residual * residual
    return _Linear(float((square / (1 + square / (scale * scale))).sum()), matrix, gradient, maps, residual)


def _newton(
    numbers: Lowered, points: np.ndarray, diagonal: float, config: RefineConfig, deadline: Deadline
) -> tuple[Lowered, float, int, Stop]:
    """Levenberg-Marquardt: the numbers, their robust scale, which falls with the residuals of what is explained, and the iterations."""
    damping, iterations, rejected, scale = 1e-3, 0, 0, config.start_scale * diagonal
    linear = _linearise(numbers, points, scale)
    for _ in range(config.newton_steps):
        if deadline.has_passed():
            break
        iterations += 1
        free = mask_determined(linear.matrix, config.min_support)
        if not free.any():
            return numbers, scale, iterations, "no_support"
        step = solve_blocks(linear.matrix, linear.gradient, free, damping)
        trial = move_limited(numbers, linear.maps, step)
        after = _linearise(trial, points, scale)
        still = np.abs(step).max() < config.min_step * diagonal
        if after.cost > linear.cost:
            damping, rejected = damping * 6, rejected + 1
            if still or rejected > MAX_REJECTED:
                return numbers, scale, iterations, "converged" if still else "stalled"
            continue
        gain = linear.cost - after.cost
        settled, finished = still or gain <= SETTLED * linear.cost, still or gain <= FINISHED * linear.cost
        numbers, linear, damping, rejected = trial, after, max(damping / 5, 1e-9), 0
        smaller = max(0.5 * scale, _noise_scale(linear.residual, scale, diagonal, config))
        if settled and smaller < scale:
            scale = smaller
            linear = _linearise(numbers, points, scale)
        elif finished:
            return numbers, scale, iterations, "converged"
    return numbers, scale, iterations, "budget_spent"


def _noise_scale(residual: np.ndarray, scale: float, diagonal: float, config: RefineConfig) -> float:
    """The scale that the explained points' robust standard deviation asks for, at most `scale`."""
    close = np.abs(residual)[np.abs(residual) < scale]
    if len(close) == 0:
        return scale
    spread = config.noise_factor * 1.4826 * float(np.median(close))
    return min(scale, max(spread, config.end_scale * diagonal))
