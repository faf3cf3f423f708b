"""A noisy cloud made calm enough to detect in: strays left out, normals voted by neighbourhoods, points moved along them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.detection.cloud_normals import consensus_normals
from imdim.detection.noise import NoiseModel

NEIGHBOURS = 48
STRAY_NEIGHBOUR, STRAY = 8, 2.6  # times the usual distance to that neighbour
TURN_DEG = 22.0  # deviation of the weight between normals
NORMAL_ROUNDS, POINT_ROUNDS = 5, 6


def inliers(points: np.ndarray) -> np.ndarray:
    """Mask [n] of the points whose neighbours are about as near as the cloud's usually are."""
    k = min(STRAY_NEIGHBOUR, len(points) - 1)
    distance = KDTree(points).query(points, k=k + 1)[0][:, -1]
    return distance < STRAY * np.median(distance)


def denoise(points: np.ndarray, normals: np.ndarray | None, noise: NoiseModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] moved along their normals to where their neighbours say the surface is, and those normals [n, 3].

    Normals are voted in two steps: every point first adopts the best supported plane among its neighbours' that it lies on, which
    comes from beside an edge and not from across it (the idea of Kuwahara filters), then bilateral averages calm them. Points
    follow the mean of their own and the neighbour's tangent plane, which circles leave unmoved (after Oztireli et al. 2009).
    Signs of given normals are heard, so the two sides of a thin wall stay apart.
    """
    k = min(NEIGHBOURS, len(points) - 1)
    near = np.asarray(KDTree(points).query(points, k=k + 1)[1])
    signed = normals is not None
    if normals is None:
        found, trust = consensus_normals(points, near, noise, rng)
        directed = _adopt(points, found, trust, near, noise)
    else:
        directed = np.array(normals, dtype=float)
    reach = 0.5 * math.sqrt(k / math.pi) * noise.spacing
    calm = np.array(points, dtype=float)
    turn = math.radians(TURN_DEG)
    for _ in range(0 if signed else NORMAL_ROUNDS):
        directed = _bilateral(calm, directed, near, reach, 2.0 * noise.sigma, turn)
    band = 2.0 * noise.sigma
    for _ in range(POINT_ROUNDS):
        calm = _follow(calm, directed, near, reach, band, turn, signed)
        band = max(0.7 * band, 0.7 * noise.sigma)
        if not signed:
            directed = _bilateral(calm, directed, near, reach, band, turn)
    return calm, directed


def _adopt(points: np.ndarray, normals: np.ndarray, trust: np.ndarray, near: np.ndarray, noise: NoiseModel) -> np.ndarray:
    """Per point the normal of the neighbour whose plane is best supported among those that pass through the point."""
    away, facing = points[:, None] - points[near], normals[near]
    off = sum(facing[..., i] * away[..., i] for i in range(3))
    score = trust[near] * np.exp(-0.5 * (off / (1.5 * noise.sigma)) ** 2 - (away**2).sum(-1) / (8.0 * noise.spacing * noise.spacing))
    return facing[np.arange(len(points)), score.argmax(1)]


@njit(cache=True, inline="always")
def _weigh(points, normals, i, j, reach, band, turn):  # pragma: no cover - compiled
    """Of neighbour j of point i: whether its normal points the same way, the distance to it along both normals, and its weight by nearness,
    by the angle between the normals and by that distance."""
    qx, qy, qz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    nx, ny, nz = normals[i]
    c = nx * normals[j, 0] + ny * normals[j, 1] + nz * normals[j, 2]
    sign = 1.0 if c >= 0 else -1.0
    mx, my, mz = sign * normals[j, 0], sign * normals[j, 1], sign * normals[j, 2]
    d = 0.5 * (qx * (nx + mx) + qy * (ny + my) + qz * (nz + mz))
    angle = math.acos(min(abs(c), 1.0))
    w = math.exp(-(qx * qx + qy * qy + qz * qz) / (2 * reach * reach) - 0.5 * (angle / turn) ** 2 - 0.5 * (d / band) ** 2)
    return sign, d, w


@njit(cache=True)
def _bilateral(points, normals, near, reach, band, turn):  # pragma: no cover - compiled
    """Weighted means of the neighbours' normals."""
    out = np.empty_like(normals)
    for i in range(len(points)):
        sx, sy, sz = 0.0, 0.0, 0.0
        for j in near[i]:
            sign, _, w = _weigh(points, normals, i, j, reach, band, turn)
            w *= sign
            sx, sy, sz = sx + w * normals[j, 0], sy + w * normals[j, 1], sz + w * normals[j, 2]
        length = max(math.sqrt(sx * sx + sy * sy + sz * sz), 1e-300)
        out[i] = (sx / length, sy / length, sz / length)
    return out


@njit(cache=True)
def _follow(points, normals, near, reach, band, turn, signed):  # pragma: no cover - compiled
    """Points moved along their normals to the weighted mean of the neighbours' surfaces."""
    out = np.empty_like(points)
    for i in range(len(points)):
        total, shift = 0.0, 0.0
        for j in near[i]:
            sign, d, w = _weigh(points, normals, i, j, reach, band, turn)
            if signed and sign < 0.0:
                continue
            total += w
            shift += w * d
        step = shift / max(total, 1e-300)
        out[i] = points[i] + step * normals[i]
    return out
