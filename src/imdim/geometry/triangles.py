"""Exact distances from points to triangle surfaces, through a bounding-box tree over Morton-ordered triangles.

The tree is complete: node i has the children 2i and 2i+1, and the leaves hold LEAF triangles each or fewer, so building it is one sort and
a few reductions (Karras 2012 shows why Morton order clusters well). `winding` builds its own in the same way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from numba import njit

from imdim.shares import by_shares

LEAF = 4
AT_MOST = 1 + 1e-9  # of a bound, so that rounding excludes nothing


@dataclass(frozen=True)
class TriangleTree:
    """`corners` [t, 3, 3], of which leaf j of l owns ``starts[j]:starts[j + 1]``, and the boxes `low` and `high` [2 l, 3] of the nodes."""

    corners: np.ndarray
    starts: np.ndarray
    low: np.ndarray
    high: np.ndarray


def triangle_tree(mesh: trimesh.Trimesh) -> TriangleTree:
    """The tree of a mesh with one or more faces; raises ValueError for a mesh without faces."""
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    if not len(corners):
        raise ValueError("no distance to a mesh of 0 faces")
    order, starts = sort_leaves(_unit(corners.mean(axis=1)), LEAF)
    ordered = corners[order]
    low, high = sum_up(ordered.min(axis=1), starts, np.minimum), sum_up(ordered.max(axis=1), starts, np.maximum)
    return TriangleTree(ordered, starts, low, high)


def distances(tree: TriangleTree, points: np.ndarray) -> np.ndarray:
    """Unsigned distance [n] of each of `points` [n, 3] to the nearest triangle."""
    points = np.ascontiguousarray(points, np.float64)
    # what is near one point is near the next one in this order, and bounds the search for its nearest triangle
    order = np.argsort(morton(_unit(points))) if len(points) else np.arange(0)
    out = np.empty(len(points))
    out[order] = by_shares(lambda share: _distances(tree.corners, tree.starts, tree.low, tree.high, share), points[order])
    return out


def _unit(points: np.ndarray) -> np.ndarray:
    return (points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300) - 0.5


def morton(unit: np.ndarray) -> np.ndarray:
    """The codes uint64 [n] of points [n, 3] in -0.5..0.5: the bits of their coordinates by turns, 21 each."""
    cell = np.clip((unit + 0.5) * (1 << 21), 0, (1 << 21) - 1).astype(np.uint64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
    return cell[:, 0] | (cell[:, 1] << np.uint64(1)) | (cell[:, 2] << np.uint64(2))


def sort_leaves(unit: np.ndarray, leaf_size: int) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] in -0.5..0.5 shared out in Morton order among the leaves of a complete tree: the order, and where each leaf starts."""
    leaves = 1 << max(0, math.ceil(math.log2(len(unit) / leaf_size)))
    return np.argsort(morton(unit), kind="stable"), np.arange(leaves + 1) * len(unit) // leaves


def sum_up(values: np.ndarray, starts: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Per node of that tree [2 l, ..] what `combine` makes of the sorted `values` [n, ..] below it; row 0 stands for nothing."""
    levels = [combine.reduceat(values, starts[:-1])]
    while len(levels[-1]) > 1:
        levels.append(combine(levels[-1][0::2], levels[-1][1::2]))
    return np.concatenate([levels[-1], *levels[::-1]])


@njit(cache=True, nogil=True)
def _distances(corners, starts, low, high, points):  # pragma: no cover - compiled
    leaves = len(starts) - 1
    out = np.empty(points.shape[0])
    stack, far = np.empty(128, np.int64), np.empty(128)  # nodes, and their squared distances
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best = np.inf
        if i:
            step = math.sqrt((x - points[i - 1, 0]) ** 2 + (y - points[i - 1, 1]) ** 2 + (z - points[i - 1, 2]) ** 2)
            best = ((out[i - 1] + step) * AT_MOST) ** 2
        stack[0], far[0] = 1, _box2(x, y, z, low, high, 1)
        top = 1
        while top:
            top -= 1
            node = stack[top]
            if far[top] >= best:
                continue
            if node >= leaves:
                for t in range(starts[node - leaves], starts[node - leaves + 1]):
                    best = min(best, _triangle2(x, y, z, corners, t))
                continue
            left = 2 * node
            one, two = _box2(x, y, z, low, high, left), _box2(x, y, z, low, high, left + 1)
            # the nearer child goes on top of the stack
            near_left = one <= two
            stack[top], far[top] = (left + 1, two) if near_left else (left, one)
            stack[top + 1], far[top + 1] = (left, one) if near_left else (left + 1, two)
            top += 2
        out[i] = np.sqrt(best)
    return out


@njit(cache=True, nogil=True)
def _box2(x, y, z, low, high, node):  # pragma: no cover - compiled
    dx = max(low[node, 0] - x, x - high[node, 0], 0.0)
    dy = max(low[node, 1] - y, y - high[node, 1], 0.0)
    dz = max(low[node, 2] - z, z - high[node, 2], 0.0)
    return dx * dx + dy * dy + dz * dz


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
def _triangle2(x, y, z, corners, face):  # pragma: no cover - compiled
    """Squared distance to a triangle: the foot of the perpendicular if it lies inside, else the nearest edge."""
    ax, ay, az = corners[face, 0, 0], corners[face, 0, 1], corners[face, 0, 2]
    ux, uy, uz = corners[face, 1, 0] - ax, corners[face, 1, 1] - ay, corners[face, 1, 2] - az
    vx, vy, vz = corners[face, 2, 0] - ax, corners[face, 2, 1] - ay, corners[face, 2, 2] - az
    wx, wy, wz = x - ax, y - ay, z - az
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
