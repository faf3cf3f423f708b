"""A noisy cloud made calm enough to detect in: strays left out, normals voted by neighbourhoods, points moved along them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.detection.cloud_normals import consensus_normals
from imdim.detection.noise import NoiseModel


@dataclass
class DenoiseConfig:
    neighbours: int = 48
    stray_neighbour: int = 8
    stray: float = 2.6  # times the usual distance to that neighbour
    turn_deg: float = 22.0  # deviation of the weight between normals
    normal_rounds: int = 5
    point_rounds: int = 6


def inliers(points: np.ndarray, config: DenoiseConfig | None = None) -> np.ndarray:
    """Mask [n] of the points whose neighbours are about as near as the cloud's usually are."""
    config = config or DenoiseConfig()
    k = min(config.stray_neighbour, len(points) - 1)
    distance = KDTree(points).query(points, k=k + 1)[0][:, -1]
    return distance < config.stray * np.median(distance)


def denoise(
    points: np.ndarray, normals: np.ndarray | None, noise: NoiseModel, rng: np.random.Generator, config: DenoiseConfig | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] moved along their normals to where their neighbours say the surface is, and those normals [n, 3].

    Normals are voted in two steps: every point first adopts the best supported plane among its neighbours' that it lies on, which
    comes from beside an edge and not from across it (the idea of Kuwahara filters), then bilateral averages calm them. Points
    follow the mean of their own and the neighbour's tangent plane, which circles leave unmoved (after Oztireli et al. 2009).
    Signs of given normals are heard, so the two sides of a thin wall stay apart.
    """
    config = config or DenoiseConfig()
    k = min(config.neighbours, len(points) - 1)
    near = np.asarray(KDTree(points).query(points, k=k + 1)[1])
    signed = normals is not None
    if normals is None:
        found, trust = consensus_normals(points, near, noise, rng)
        directed = _adopt(points, found, trust, near, noise.sigma, noise.spacing)
    else:
        directed = np.array(normals, dtype=float)
    reach = 0.5 * math.sqrt(k / math.pi) * noise.spacing
    calm = np.array(points, dtype=float)
    turn = math.radians(config.turn_deg)
    for _ in range(0 if signed else config.normal_rounds):
        directed = _bilateral(calm, directed, near, reach, 2.0 * noise.sigma, turn)
    band = 2.0 * noise.sigma
    for _ in range(config.point_rounds):
        calm = _follow(calm, directed, near, reach, band, turn, signed)
        band = max(0.7 * band, 0.7 * noise.sigma)
        if not signed:
            directed = _bilateral(calm, directed, near, reach, band, turn)
    return calm, directed


@njit(cache=True)
def _adopt(points, normals, trust, near, sigma, spacing):  # pragma: no cover - compiled
    """Per point the normal of the neighbour whose plane is best supported among those that pass through the point."""
    out = np.empty_like(normals)
    for i in range(len(points)):
        best, index = -1.0, i
        for j in near[i]:
            d = normals[j, 0] * (points[i, 0] - points[j, 0])
            d += normals[j, 1] * (points[i, 1] - points[j, 1])
            d += normals[j, 2] * (points[i, 2] - points[j, 2])
            far = 0.0
            for c in range(3):
                far += (points[i, c] - points[j, c]) ** 2
            score = trust[j] * math.exp(-0.5 * (d / (1.5 * sigma)) ** 2 - far / (8.0 * spacing * spacing))
            if score > best:
                best, index = score, j
        out[i] = normals[index]
    return out


@njit(cache=True)
def _bilateral(points, normals, near, reach, band, turn):  # pragma: no cover - compiled
    """Means of the neighbours' normals, weighted by nearness, by the angle to the own normal and by the distance to the own plane."""
    out = np.empty_like(normals)
    for i in range(len(points)):
        sx, sy, sz = 0.0, 0.0, 0.0
        nx, ny, nz = normals[i]
        for j in near[i]:
            qx, qy, qz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
            c = nx * normals[j, 0] + ny * normals[j, 1] + nz * normals[j, 2]
            sign = 1.0 if c >= 0 else -1.0
            mx, my, mz = sign * normals[j, 0], sign * normals[j, 1], sign * normals[j, 2]
            d = 0.5 * (qx * (nx + mx) + qy * (ny + my) + qz * (nz + mz))
            angle = math.acos(min(abs(c), 1.0))
            w = math.exp(-(qx * qx + qy * qy + qz * qz) / (2 * reach * reach) - 0.5 * (angle / turn) ** 2 - 0.5 * (d / band) ** 2)
            sx, sy, sz = sx + w * mx, sy + w * my, sz + w * mz
        length = max(math.sqrt(sx * sx + sy * sy + sz * sz), 1e-300)
        out[i] = (sx / length, sy / length, sz / length)
    return out


@njit(cache=True)
def _follow(points, normals, near, reach, band, turn, signed):  # pragma: no cover - compiled
    """Points moved along their normals to the weighted mean of the neighbours' surfaces."""
    out = np.empty_like(points)
    for i in range(len(points)):
        total, shift = 0.0, 0.0
        nx, ny, nz = normals[i]
        for j in near[i]:
            qx, qy, qz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
            c = nx * normals[j, 0] + ny * normals[j, 1] + nz * normals[j, 2]
            if signed and c < 0.0:
                continue
            sign = 1.0 if c >= 0 else -1.0
            mx, my, mz = sign * normals[j, 0], sign * normals[j, 1], sign * normals[j, 2]
            d = 0.5 * (qx * (nx + mx) + qy * (ny + my) + qz * (nz + mz))
            angle = math.acos(min(abs(c), 1.0))
            w = math.exp(-(qx * qx + qy * qy + qz * qz) / (2 * reach * reach) - 0.5 * (angle / turn) ** 2 - 0.5 * (d / band) ** 2)
            total += w
            shift += w * d
        step = shift / max(total, 1e-300)
        out[i] = (points[i, 0] + step * nx, points[i, 1] + step * ny, points[i, 2] + step * nz)
    return out
