"""Unoriented normals of a bare cloud that keep sharp edges and thin walls apart."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.detection.noise import NoiseModel

NEIGHBOURS = 18  # of a point, through pairs of which its planes go


def estimate_normals(points: np.ndarray, noise: NoiseModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Normals [n, 3] of either sign and trust [n] in 0..1, by consensus of planes through each point and two of its neighbours.

    A consensus, unlike an average, does not blend the faces that meet at an edge or the two sides of a wall.
    """
    k = min(NEIGHBOURS, len(points) - 1)
    _, near = KDTree(points).query(points, k=k + 1)
    pairs = np.array([rng.choice(np.arange(1, k + 1), 2, replace=False) for _ in range(48)])
    tolerance = 0.1 * noise.spacing + 2 * noise.sigma
    return _consensus(points, near, pairs, tolerance, 2.5 * noise.spacing)


def consensus_normals(points: np.ndarray, near: np.ndarray, noise: NoiseModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`estimate_normals` over given neighbours [n, k], the nearest of which is the point itself; for noisy clouds."""
    k = near.shape[1] - 1
    # planes through near pairs are mostly noise
    pairs = np.array([rng.choice(np.arange(k // 4, k + 1), 2, replace=False) for _ in range(80)])
    reach = math.sqrt(k / math.pi) * noise.spacing
    return _consensus(points, near, pairs, 0.1 * noise.spacing + 1.5 * noise.sigma, reach)


@njit(cache=True)
def _consensus(points, near, pairs, tolerance, reach):  # pragma: no cover - compiled
    n, k = near.shape
    normals = np.zeros((n, 3))
    trust = np.zeros(n)
    local = np.empty((k, 3))
    weight = np.empty(k)
    for i in range(n):
        total = 0.0
        for j in range(k):
            squared = 0.0
            for c in range(3):
                local[j, c] = points[near[i, j], c] - points[i, c]
                squared += local[j, c] ** 2
            weight[j] = math.exp(-squared / (reach * reach))
            total += weight[j]
        best, bx, by, bz = -1.0, 0.0, 0.0, 1.0
        for t in range(pairs.shape[0]):
            a, b = local[pairs[t, 0]], local[pairs[t, 1]]
            nx, ny, nz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            if length < 0.15 * math.sqrt((a * a).sum() * (b * b).sum()) or length == 0.0:
                continue
            nx, ny, nz = nx / length, ny / length, nz / length
            score = 0.0
            for j in range(k):
                r = (local[j, 0] * nx + local[j, 1] * ny + local[j, 2] * nz) / tolerance
                if -1.0 < r < 1.0:
                    score += weight[j] * (1.0 - r * r)
            if score > best:
                best, bx, by, bz = score, nx, ny, nz
        for _ in range(2):
            # least squares over the consensus, through its own centre
            inside, center = 0.0, np.zeros(3)
            moment = np.zeros((3, 3))
            for j in range(k):
                r = (local[j, 0] * bx + local[j, 1] * by + local[j, 2] * bz) / (2.0 * tolerance)
                if -1.0 < r < 1.0:
                    w = weight[j] * (1.0 - r * r)
                    inside += w
                    center += w * local[j]
                    for c in range(3):
                        for d in range(3):
                            moment[c, d] += w * local[j, c] * local[j, d]
            if inside <= 0.0:
                break
            for c in range(3):
                for d in range(3):
                    moment[c, d] -= center[c] * center[d] / inside
            v = np.linalg.eigh(moment)[1][:, 0]
            bx, by, bz = v[0], v[1], v[2]
        normals[i] = (bx, by, bz)
        # three points always agree: without others there is nothing to trust
        trust[i] = max(best - 2.0, 0.0) / max(total - 2.0, 3.0)
    return normals, trust
