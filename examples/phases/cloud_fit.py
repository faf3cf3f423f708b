"""A skeleton under its theory, fitted to a cloud: squared distances + alpha * squared violations (design, section 3.2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from imdim.sketch.descent import DescentConfig, polish
from imdim.sketch.solver import relax
from imdim.sketch.system import TheorySystem, check_points, length_of
from imdim.sketch.theory import Theory

Distances = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Control points [n, 3] to residuals [m] in model units and their slopes [m, n, 3]."""

ALPHAS = (1.0, 1e2, 1e4, 1e6)  # weight of the violations, per point of the cloud


def fit(theory: Theory, start: np.ndarray, distances: Distances, steps: int = 30) -> tuple[np.ndarray, float, float]:
    """Points [n, 3], the root mean square of `distances` there, in model units, and the largest violation.

    Constraints begin soft, harden by the schedule ALPHAS, and are polished at last, so that they hold exactly. Raises TheoryError for a
    start of a wrong shape or that is not finite.
    """
    points = check_points(theory, start)
    scale, axes = length_of(theory, points), theory.dimension
    system = TheorySystem.of([theory], np.array([scale]))

    def spatial(flat: np.ndarray) -> np.ndarray:
        out = np.zeros((theory.n_points, 3))
        out[:, :axes] = flat.reshape(-1, axes)
        return out

    for alpha in ALPHAS:

        def evaluate(flat: np.ndarray, weight: float = float(np.sqrt(alpha))) -> tuple[np.ndarray, np.ndarray]:
            x = spatial(flat[0])
            apart, slopes = distances(x * scale)
            strain, jacobian = system.evaluate(x[None])
            share = 1 / np.sqrt(max(len(apart), 1))
            slopes = slopes[..., :axes].reshape(len(apart), -1) * share
            return np.concatenate([apart[None] * share / scale, weight * strain], 1), np.concatenate([slopes[None], weight * jacobian], 1)

        flat = (points / scale)[None, :, :axes].reshape(1, -1)
        points = spatial(polish(evaluate, flat, DescentConfig(polish_steps=steps))[0]) * scale
    exact, worst = relax([theory], points[None], np.array([scale]), DescentConfig(adam_steps=0))
    apart, _ = distances(exact[0])
    return exact[0], float(np.sqrt(np.mean(apart**2))), float(worst[0])
