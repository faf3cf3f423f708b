"""Least squares under constraints: the numbers of a program fitted to a cloud while relations hold exactly.

Each step minimises the linearised distances on the plane of the linearised constraints: with M the damped Gauss-Newton matrix, block by
leaf, the step is ``-M^-1 (g + A^T y)`` with multipliers ``(A M^-1 A^T) y = r - A M^-1 g`` (the range space form of the equality
constrained problem: Nocedal and Wright 2006, section 16.2). Dependent rows share one multiplier. Newton steps onto the constraints alone
finish, so that they hold to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.geometry.lowering import Lowered
from imdim.program.constraints import Constraint
from imdim.relations.belief import CUT, Normal, WeightedCloud, apply_step, normal_equations
from imdim.relations.residuals import ResidualRows, rows_of

EXACT = 1e-12  # residuals of constraints, relative to the part
MET = 1e-9  # what counts as met
DEPENDENT = 1e-10  # eigenvalues of the scaled A M^-1 A^T below it
STEPS = 25
PROJECTIONS = 12  # onto the constraints: Newton's steps
FINISHED = 1e-7  # share of the cost that a step gains at least
HELD = 0.05  # points' worth that hold each number beside the cloud, so that what it does not show stays unless a constraint moves it


def fit_under_constraints(numbers: Lowered, constraints: Sequence[Constraint], cloud: WeightedCloud, scale: float) -> tuple[Lowered, float]:
    """The numbers under the constraints, and their cost at the robust scale `scale`; as near as can be where they conflict."""
    numbers = onto(numbers, constraints, cloud.length, normal_equations(numbers, cloud, scale))
    damping, now = 1e-3, normal_equations(numbers, cloud, scale)
    for _ in range(STEPS):
        step = _step(now, rows_of(constraints, numbers), damping)
        trial = onto(apply_step(numbers, step), constraints, cloud.length, now)
        after = normal_equations(trial, cloud, scale)
        if after.cost > now.cost:
            if damping > 1e3 or np.abs(step).max(initial=0.0) < 1e-9 * cloud.length:
                break
            damping *= 10
            continue
        done = now.cost - after.cost <= FINISHED * now.cost
        numbers, now, damping = trial, after, max(damping / 10, 1e-9)
        if done:
            break
    return numbers, now.cost


def onto(numbers: Lowered, constraints: Sequence[Constraint], length: float, metric: Normal) -> Lowered:
    """The numbers moved onto the constraints by the shortest way in `metric`, which moves least what the points show best."""
    inverse = _inverse(metric, 0.0)
    best, least = numbers, np.inf
    for _ in range(PROJECTIONS):
        rows = rows_of(constraints, numbers)
        off = float(np.abs(rows.residual).max(initial=0.0)) / length
        if off < least:
            best, least = numbers, off
        if off <= EXACT:
            break
        spread = _spread(rows.jacobian, inverse)
        numbers = apply_step(numbers, -spread @ _multipliers(rows.jacobian @ spread, rows.residual))
    return best


def _step(now: Normal, rows: ResidualRows, damping: float) -> np.ndarray:
    inverse = _inverse(now, damping)
    free = -np.einsum("kij,kj->ki", inverse, now.gradient).ravel()
    spread = _spread(rows.jacobian, inverse)
    return free - spread @ _multipliers(rows.jacobian @ spread, rows.residual + rows.jacobian @ free)


def _inverse(now: Normal, damping: float) -> np.ndarray:
    """Inverse blocks [k, 9, 9] of the damped Gauss-Newton matrix."""
    diagonal = np.diagonal(now.matrix, axis1=1, axis2=2)
    return np.linalg.inv(now.matrix + (damping * diagonal + HELD)[:, :, None] * np.eye(9))


def _spread(jacobian: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """M^-1 A^T [9 k, m]."""
    m, k = len(jacobian), len(inverse)
    return np.einsum("kij,mkj->kim", inverse, jacobian.reshape(m, k, 9)).reshape(9 * k, m)


def _multipliers(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The smallest solution [m] of ``matrix @ y = right``, both scaled to a unit diagonal."""
    scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * matrix * scale)
    kept = values > DEPENDENT * values.max(initial=0.0)
    return scale * (vectors[:, kept] @ ((vectors[:, kept].T @ (scale * right)) / values[kept]))


def strains(numbers: Lowered, rows: ResidualRows, cloud: WeightedCloud, noise: float, count: int) -> np.ndarray:
    """How much each of `count` constraints adds to the cost [count], in squared deviations: the score test of its multipliers."""
    now = normal_equations(numbers, cloud, CUT * noise)
    inverse = _inverse(now, 0.0)
    spread = _spread(rows.jacobian, inverse)
    gram = rows.jacobian @ spread
    free = np.einsum("kij,kj->ki", inverse, now.gradient).ravel()
    scale = 1 / np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    precision = scale[:, None] * np.linalg.pinv(scale[:, None] * gram * scale, rcond=DEPENDENT, hermitian=True) * scale
    pull = precision @ (rows.jacobian @ free)
    owned = [rows.owner == number for number in range(count)]
    # the multipliers' own covariance is the precision times the squared noise
    known = [np.linalg.pinv(precision[np.ix_(mine, mine)], rcond=1e-9, hermitian=True) for mine in owned]
    return np.array([pull[mine] @ inverse @ pull[mine] / noise**2 for mine, inverse in zip(owned, known, strict=True)])
