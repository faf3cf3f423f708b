"""Exact distances from points to triangle surfaces, through a bounding-box tree over Morton-ordered triangles.

The tree is a complete binary heap: node i has the children 2i+1 and 2i+2, and the leaves hold LEAF triangles each, so building it is
one sort and a few reductions (Karras 2012 shows why Morton order clusters well).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numba import njit

from imdim.geometry.morton import morton

LEAF = 4


@dataclass(frozen=True)
class TriangleTree:
    """`corners` [t, 3, 3] padded to LEAF * 2^depth by repetition of the last, boxes `low` and `high` [2^(depth+1) - 1, 3]."""

    corners: np.ndarray
    low: np.ndarray
    high: np.ndarray


def triangle_tree(mesh: trimesh.Trimesh) -> TriangleTree:
    """The tree of a mesh with one or more faces; raises ValueError for a mesh without faces."""
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    if not len(corners):
        raise ValueError("no distance to a mesh of 0 faces")
    ordered = corners[np.argsort(morton(_unit(corners.mean(axis=1))), kind="stable")]
    depth = max(int(np.ceil(np.log2(len(ordered) / LEAF))), 0)
    padding = LEAF * 2**depth - len(ordered)
    ordered = np.concatenate([ordered, np.repeat(ordered[-1:], padding, axis=0)])
    return TriangleTree(ordered, _boxes(ordered.min(axis=1), depth, np.minimum), _boxes(ordered.max(axis=1), depth, np.maximum))


def distances(tree: TriangleTree, points: np.ndarray) -> np.ndarray:
    """Unsigned distance [n] of each of `points` [n, 3] to the nearest triangle."""
    return _distances(tree.corners, tree.low, tree.high, np.ascontiguousarray(points, np.float64))


def _unit(points: np.ndarray) -> np.ndarray:
    return (points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300) - 0.5


def _boxes(bounds: np.ndarray, depth: int, reduce: np.ufunc) -> np.ndarray:
    level = reduce.reduce(bounds.reshape(-1, LEAF, 3), axis=1)
    levels = [level]
    for _ in range(depth):
        level = reduce.reduce(level.reshape(-1, 2, 3), axis=1)
        levels.append(level)
    return np.concatenate(levels[::-1])


@njit(cache=True, nogil=True)
def _distances(corners, low, high, points):  # pragma: no cover - compiled
    first_leaf = (low.shape[0] - 1) // 2
    out = np.empty(points.shape[0])
    stack = np.empty(128, np.int64)
    for i in range(points.shape[0]):
        p = points[i]
        best = np.inf
        stack[0] = 0
        top = 1
        while top:
            top -= 1
            node = stack[top]
            if _box2(p, low[node], high[node]) >= best:
                continue
            if node >= first_leaf:
                start = (node - first_leaf) * LEAF
                for t in range(start, start + LEAF):
                    best = min(best, _triangle2(p, corners[t, 0], corners[t, 1], corners[t, 2]))
                continue
            left = 2 * node + 1
            # the nearer child goes on top of the stack
            near_left = _box2(p, low[left], high[left]) <= _box2(p, low[left + 1], high[left + 1])
            stack[top] = left + 1 if near_left else left
            stack[top + 1] = left if near_left else left + 1
            top += 2
        out[i] = np.sqrt(best)
    return out


@njit(cache=True, nogil=True)
def _box2(p, low, high):  # pragma: no cover - compiled
    total = 0.0
    for axis in range(3):
        outside = max(low[axis] - p[axis], p[axis] - high[axis], 0.0)
        total += outside * outside
    return total


@njit(cache=True, nogil=True)
def _dot(ax, ay, az, bx, by, bz):  # pragma: no cover - compiled
    return ax * bx + ay * by + az * bz


@njit(cache=True, nogil=True)
def _segment2(px, py, pz, ex, ey, ez):  # pragma: no cover - compiled
    """Squared distance of p to the segment from the origin to e."""
    length2 = _dot(ex, ey, ez, ex, ey, ez)
    t = 0.0 if length2 == 0.0 else min(max(_dot(px, py, pz, ex, ey, ez) / length2, 0.0), 1.0)
    dx, dy, dz = px - t * ex, py - t * ey, pz - t * ez
    return _dot(dx, dy, dz, dx, dy, dz)


@njit(cache=True, nogil=True)
def _triangle2(p, a, b, c):  # pragma: no cover - compiled
    """Squared distance to a triangle: the foot of the perpendicular if it lies inside, else the nearest edge."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    uu, uv, vv = _dot(ux, uy, uz, ux, uy, uz), _dot(ux, uy, uz, vx, vy, vz), _dot(vx, vy, vz, vx, vy, vz)
    wu, wv = _dot(wx, wy, wz, ux, uy, uz), _dot(wx, wy, wz, vx, vy, vz)
    det = uu * vv - uv * uv
    s, t = wu * vv - wv * uv, wv * uu - wu * uv
    if det > 1e-14 * uu * vv and s >= 0.0 and t >= 0.0 and s + t <= det:
        s, t = s / det, t / det
        dx, dy, dz = wx - s * ux - t * vx, wy - s * uy - t * vy, wz - s * uz - t * vz
        return _dot(dx, dy, dz, dx, dy, dz)
    best = min(_segment2(wx, wy, wz, ux, uy, uz), _segment2(wx, wy, wz, vx, vy, vz))
    return min(best, _segment2(wx - ux, wy - uy, wz - uz, vx - ux, vy - uy, vz - uz))
