"""Degrees of freedom by the rank of the Jacobian, modulo rigid motions; which constraints say nothing new, which points can move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.sketch.system import TheorySystem, check_points, length_of
from imdim.sketch.theory import Theory

RANK = 1e-7  # directions shorter than this share of the longest are dependent


@dataclass(frozen=True)
class Freedom:
    """First-order motions at a solution.

    `dof` are those that are no rigid motion of the whole (6, fewer where the points lie on a line; 3 in the plane); `rank` that of the
    constraints; `redundant` the numbers of constraints that earlier ones imply; `loose` the points that can move against the largest
    body of points that keep their distances.
    """

    dof: int
    rank: int
    redundant: tuple[int, ...]
    loose: tuple[int, ...]

    @property
    def verdict(self) -> str:
        """well-, under- or over-constrained, or under- and over-constrained."""
        names = (["under"] if self.dof else []) + (["over"] if self.redundant else [])
        return "- and ".join(names or ["well"]) + "-constrained"

    def report(self, theory: Theory) -> str:
        """One line: the verdict, the number of freedoms, the loose points and the redundant constraints by name."""
        parts = [f"{self.verdict}: {self.dof} degrees of freedom"]
        if self.loose:
            parts.append(f"loose control points {', '.join(map(str, self.loose))}")
        if self.redundant:
            parts.append(f"redundant {', '.join(map(theory.name, self.redundant))}")
        return "; ".join(parts)


def freedom(theory: Theory, points: np.ndarray) -> Freedom:
    """The freedom of `theory` at `points` [n, 3], which should meet it (see `solver.solve`); raises TheoryError as `check_points` does."""
    points = check_points(theory, points)
    scale = length_of(theory, points)
    x = points[None] / scale
    system = TheorySystem.of([theory], np.array([scale]))
    jacobian = system.evaluate(x)[1][0]
    rigid = int(np.linalg.matrix_rank(_rigid_motions(x[0], theory.dimension), rtol=RANK))
    rank, redundant = _independent(system, jacobian)
    dof = jacobian.shape[1] - rigid - rank
    return Freedom(dof, rank, redundant, _loose(x[0], jacobian, rank, theory.dimension) if dof else ())


def _rigid_motions(x: np.ndarray, dimension: int) -> np.ndarray:
    """Velocities [3 or 6, n * dimension] of translations and of turns about the centroid."""
    local = x - x.mean(axis=0)
    shifts = [np.broadcast_to(axis, x.shape) for axis in np.eye(3)[:dimension]]
    turns = [np.cross(axis, local) for axis in (np.eye(3) if dimension == 3 else np.eye(3)[2:])]
    return np.stack([v[:, :dimension].ravel() for v in (*shifts, *turns)])


def _independent(system: TheorySystem, jacobian: np.ndarray) -> tuple[int, tuple[int, ...]]:
    """The rank, and the constraints whose rows all lie in the span of those of earlier constraints."""
    size = np.linalg.norm(jacobian, axis=1).max(initial=0.0)
    basis, redundant = np.zeros((0, jacobian.shape[1])), []
    for number, rows in enumerate(system.rows_of()):
        rest = jacobian[rows]
        for _ in range(2):  # once more removes what rounding left
            rest = rest - (rest @ basis.T) @ basis
        _, values, new = np.linalg.svd(rest, full_matrices=False)
        fresh = new[values > RANK * size]
        if not len(fresh):
            redundant.append(number)
        basis = np.vstack([basis, fresh])
    return len(basis), tuple(redundant)


def _loose(x: np.ndarray, jacobian: np.ndarray, rank: int, dimension: int) -> tuple[int, ...]:
    """The points outside of the largest body found by growing one from each point."""
    kernel = np.linalg.svd(jacobian)[2][rank:] if rank else np.eye(jacobian.shape[1])
    motions = kernel.reshape(-1, len(x), dimension)
    apart = x[:, None, :dimension] - x[None, :, :dimension]
    stretch = np.abs(np.einsum("fijd,ijd->fij", motions[:, :, None] - motions[:, None, :], apart)).max(axis=0)
    firm = stretch < 1e-6 * max(1.0, float(np.abs(apart).max()))
    bodies = []
    for seed in range(len(x)):
        body = [seed]
        for other in np.argsort(-firm.sum(axis=1), kind="stable"):
            if other != seed and firm[other, body].all():
                body.append(int(other))
        bodies.append(body)
    return tuple(sorted(set(range(len(x))) - set(max(bodies, key=len))))
