"""What a bare cloud says of itself: point spacing, noise, and unoriented normals that keep sharp edges and thin walls apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

# With this many neighbours and random triples, Gaussian noise of deviation 1 on a plane gives this tenth percentile of the
# least quantile residual; measured by simulation once, and checked by a test.
_NEIGHBOURS, _TRIPLES, _QUANTILE, _CALIBRATION = 24, 120, 8, 0.257
_FLAT = 5.0  # deviations of the noise that the neighbours of a place must reach around it, to show it as a disc
_FEWEST = 1500  # points; fewer would hide the part's own shape


@dataclass(frozen=True)
class CloudScale:
    """`spacing`: side of the square that one point stands for; `sigma`: deviation of the noise along the normal; `diagonal`: of the box."""

    spacing: float
    sigma: float
    diagonal: float


def measure_scale(points: np.ndarray, rng: np.random.Generator) -> CloudScale:
    """Spacing from the eighth neighbours of a Poisson process on a surface; noise by least quantiles of local planes.

    Least quantiles look at a third of the neighbours only, so that the two sides of a thin wall are not taken for noise,
    and the calmest tenth of the places counts, because noise is everywhere but curvature is not.
    """
    spacing, sigma = _measured(points, rng)
    few, apart = points, spacing
    while _FLAT * sigma > apart * math.sqrt(_NEIGHBOURS / math.pi) and len(few) > _FEWEST:
        # so near neighbours lie in a ball of noise, not in a disc
        few = few[rng.permutation(len(few))[: max(len(few) // 2, _FEWEST)]]
        apart, sigma = _measured(few, rng)
    return CloudScale(spacing, sigma, float(np.linalg.norm(np.ptp(points, axis=0))))


def _measured(points: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """Spacing and deviation of the noise, where neighbours are farther apart than it."""
    tree = KDTree(points)
    seeds = rng.choice(len(points), min(600, len(points)), replace=False)
    count = min(_NEIGHBOURS, len(points) - 1)
    distance, near = tree.query(points[seeds], k=count + 1)
    eighth = float(np.median(distance[:, min(8, count)]))
    triples = np.array([rng.choice(count + 1, 3, replace=False) for _ in range(_TRIPLES)])
    least = _least_quantiles(points, near, triples, min(_QUANTILE, count))
    return eighth * math.sqrt(math.pi / 8), float(np.quantile(least, 0.1)) / _CALIBRATION


def estimate_normals(points: np.ndarray, scale: CloudScale, rng: np.random.Generator, k: int = 18) -> tuple[np.ndarray, np.ndarray]:
    """Normals [n, 3] of either sign and trust [n] in 0..1, by consensus of planes through each point and two of its neighbours.

    A consensus, unlike an average, does not blend the faces that meet at an edge or the two sides of a wall.
    """
    k = min(k, len(points) - 1)
    _, near = KDTree(points).query(points, k=k + 1)
    pairs = np.array([rng.choice(np.arange(1, k + 1), 2, replace=False) for _ in range(48)])
    tolerance = 0.1 * scale.spacing + 2 * scale.sigma
    return _consensus(points, near, pairs, tolerance, 2.5 * scale.spacing)


def consensus_normals(points: np.ndarray, near: np.ndarray, scale: CloudScale, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`estimate_normals` over given neighbours [n, k], the nearest of which is the point itself; for noisy clouds."""
    k = near.shape[1] - 1
    # planes through near pairs are mostly noise
    pairs = np.array([rng.choice(np.arange(k // 4, k + 1), 2, replace=False) for _ in range(80)])
    reach = math.sqrt(k / math.pi) * scale.spacing
    return _consensus(points, near, pairs, 0.1 * scale.spacing + 1.5 * scale.sigma, reach)


@njit(cache=True)
def _least_quantiles(points, near, triples, rank):  # pragma: no cover - compiled
    out = np.empty(near.shape[0])
    k = near.shape[1]
    residual = np.empty(k)
    for i in range(near.shape[0]):
        best = np.inf
        for t in range(triples.shape[0]):
            a, b, c = points[near[i, triples[t, 0]]], points[near[i, triples[t, 1]]], points[near[i, triples[t, 2]]]
            n = np.cross(b - a, c - a)
            length = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
            reach = max(((b - a) ** 2).sum(), ((c - a) ** 2).sum())
            if length < 0.2 * reach or length == 0.0:
                continue
            for j in range(k):
                q = points[near[i, j]]
                residual[j] = abs((q[0] - a[0]) * n[0] + (q[1] - a[1]) * n[1] + (q[2] - a[2]) * n[2]) / length
            best = min(best, np.sort(residual)[rank + 2])
        out[i] = best
    return out


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
