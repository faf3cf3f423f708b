"""Least squares with one [9, 9] block per leaf: each residual is decided by one leaf, in the face coordinates of `face_coordinates`."""

from __future__ import annotations

import numpy as np
from numba import njit


def mask_determined(matrix: np.ndarray, support: float) -> np.ndarray:
    """Which coordinates [k, 9] of blocks [k, 9, 9] enough residuals show; a wall that is short beside its leaf still shows how it leans."""
    needed = support * np.repeat([1.0, 1e-3], [6, 3])
    return np.diagonal(matrix, axis1=1, axis2=2) >= needed


def solve_blocks(matrix: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float) -> np.ndarray:
    """Steps [k, 9] of Levenberg and Marquardt; coordinates that are not `free` stay."""
    both = free[:, :, None] & free[:, None, :]
    matrix = np.where(both, matrix, 0.0)
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    # the small constant holds what the points do not tell apart, like the turn of a box of which one face shows
    lift = np.where(free, damping * diagonal + 1e-9 * diagonal.max(1, keepdims=True), 1.0)
    matrix = matrix + lift[:, :, None] * np.eye(9)
    return -np.linalg.solve(matrix, np.where(free, gradient, 0.0)[:, :, None])[:, :, 0]


def blocks(
    leaf: np.ndarray, tangent: np.ndarray, residual: np.ndarray, weight: np.ndarray, maps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Newton matrices [k, 9, 9] and gradients [k, 9] in the coordinates that `maps` [k, 9, 9] turn into those of `tangent` [n, 9]."""
    matrix, gradient = _accumulate(leaf, tangent, residual, weight, len(maps))
    back = maps.transpose(0, 2, 1)
    return back @ matrix @ maps, np.einsum("kij,kj->ki", back, gradient)


@njit(nogil=True, cache=True)
def _accumulate(leaf, tangent, residual, weight, k):  # pragma: no cover - compiled
    matrix, gradient = np.zeros((k, 9, 9)), np.zeros((k, 9))
    for j in range(len(leaf)):
        if weight[j] == 0:
            continue
        m, g, row = matrix[leaf[j]], gradient[leaf[j]], tangent[j]
        for a in range(9):
            by = weight[j] * row[a]
            g[a] += by * residual[j]
            for b in range(9):
                m[a, b] += by * row[b]
    return matrix, gradient
