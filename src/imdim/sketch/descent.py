"""Many systems at once from soft to hard: Adam on the penalties (design, section 3.2), then a Levenberg-Marquardt polish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Variables [B, d] to residuals [B, m] and Jacobians [B, m, d]."""


@dataclass
class DescentConfig:
    """Lengths are shares of the theory's length."""

    adam_steps: int = 80
    adam_rate: float = 0.1  # of the first step; the last is a tenth
    polish_steps: int = 120
    tolerance: float = 1e-9  # of the largest residual: the constraints hold
    floor: float = 1e-13  # the polish stops below it, or where it gains no more


def adam(evaluate: Evaluate, x: np.ndarray, config: DescentConfig) -> np.ndarray:
    """Kingma and Ba 2015, on half the sum of squared residuals, from x [B, d]."""
    mean, square = np.zeros_like(x), np.zeros_like(x)
    for step in range(1, config.adam_steps + 1):
        residual, jacobian = evaluate(x)
        gradient = _pull(jacobian, residual)
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.99 * square + 0.01 * gradient**2
        rate = config.adam_rate * 0.1 ** (step / config.adam_steps)
        x = x - rate * mean / (1 - 0.9**step) / (np.sqrt(square / (1 - 0.99**step)) + 1e-8)
    return x


def polish(evaluate: Evaluate, x: np.ndarray, config: DescentConfig) -> np.ndarray:
    """Levenberg-Marquardt from x [B, d].

    Damping is proportional to the squared residual, so the last steps are Newton's and converge quadratically even where the solutions
    form a manifold (Yamashita and Fukushima 2001).
    """
    residual, jacobian = evaluate(x)
    cost = (residual**2).sum(axis=1)
    damping, growth, idle = np.full(len(x), 0.1), np.full(len(x), 2.0), np.zeros(len(x), int)
    eye = np.eye(x.shape[1])
    for _ in range(config.polish_steps):
        busy = (np.abs(residual).max(axis=1, initial=0) > config.floor) & (idle < 3) & (damping < 1e12)
        if not busy.any():
            break
        now = np.flatnonzero(busy)
        normal = jacobian[now].mT @ jacobian[now]
        slope = _pull(jacobian[now], residual[now])
        mu = damping[now] * np.minimum(cost[now], 1.0) + 1e-13 * (1 + np.trace(normal, axis1=1, axis2=2))
        step = -np.linalg.solve(normal + mu[:, None, None] * eye, slope[..., None])[..., 0]
        trial = x.copy()
        trial[now] += step
        new_residual, new_jacobian = evaluate(trial)
        new_cost = (new_residual[now] ** 2).sum(axis=1)
        expected = (step * (mu[:, None] * step - slope)).sum(axis=1)
        gain = (cost[now] - new_cost) / np.maximum(expected, 1e-300)
        better = new_cost < cost[now]
        slow = better & (cost[now] - new_cost < 1e-10 * cost[now])
        idle[now] = np.where(slow, idle[now] + 1, np.where(better, 0, idle[now] + (damping[now] * cost[now] < 1e-20)))
        damping[now] *= np.where(better, np.maximum(0.1, 1 - (2 * np.minimum(gain, 1) - 1) ** 3), growth[now])
        growth[now] = np.where(better, 2.0, growth[now] * 2)
        won = now[better]
        x, residual, jacobian, cost = x.copy(), residual.copy(), jacobian.copy(), cost.copy()
        x[won], residual[won], jacobian[won], cost[won] = trial[won], new_residual[won], new_jacobian[won], new_cost[better]
    return x


def _pull(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Jacobians, transposed, times residuals: [B, d]."""
    return (residual[:, None, :] @ jacobian)[:, 0]
