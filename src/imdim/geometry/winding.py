"""Inside or outside by the generalised winding number, for closed, open and overlapping meshes.

The number is the solid angle that the surface subtends at the query over 4 pi (Jacobson et al. 2013): 1 inside and 0
outside a closed mesh that is oriented outward, in between where the surface has holes. Far groups of triangles are
replaced by their first two moments (Barill et al. 2018, "Fast winding numbers for soups and clouds", section 3), near
ones are summed exactly (Van Oosterom and Strackee 1983), so that a query costs about the logarithm of the face count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numba import njit

from imdim.geometry.crossings import sort_columns
from imdim.geometry.triangles import sort_leaves, sum_up
from imdim.shares import by_shares

LEAF_SIZE = 6
FAR = 3.0  # a group is far at this many radii; at 2, as in the paper, a flat group of large faces is 8 % off
RAYS = ((0.4395064, 0.6175986, 0.6522315), (-0.5237419, 0.7719043, -0.3605217))  # oblique: parallel to no likely face
TRUSTED = 50_000  # queries
QUARTER_TURN = 1 / (4 * math.pi)


@dataclass(frozen=True, eq=False)
class WindingTree:
    """A complete binary tree over triangles in Morton order: node i has children 2 i and 2 i + 1.

    `corners` [n, 9] are the triangles; `moments` [2 l, 16] hold per node centre (3),
    squared far radius (1), summed area vectors (3) and their first moment about the centre (9); leaf j owns rows
    ``starts[j]:starts[j + 1]``.
    """

    corners: np.ndarray
    moments: np.ndarray
    starts: np.ndarray
    center: np.ndarray
    scale: float


def triangle_tree(mesh_or_triangles: trimesh.Trimesh | np.ndarray) -> WindingTree:
    """The tree of a mesh or of triangles [m, 3, 3]; build it once where many batches of queries follow."""
    if isinstance(mesh_or_triangles, trimesh.Trimesh):
        triangles = np.asarray(mesh_or_triangles.vertices, float)[mesh_or_triangles.faces]
    else:
        triangles = np.asarray(mesh_or_triangles, float)
    center, scale = _unit_frame(triangles.reshape(-1, 3))
    unit = (triangles - center) * scale
    vector = np.cross(unit[:, 1] - unit[:, 0], unit[:, 2] - unit[:, 0]) / 2
    middle, low, high = unit.mean(axis=1), unit.min(axis=1), unit.max(axis=1)
    order, starts = sort_leaves(middle, LEAF_SIZE)
    area = np.linalg.norm(vector, axis=1)
    terms = np.hstack([area[:, None], area[:, None] * middle, vector, (middle[:, :, None] * vector[:, None, :]).reshape(-1, 9)])[order]
    sums, low, high = (
        sum_up(terms, starts, np.add),
        sum_up(low[order], starts, np.minimum),
        sum_up(high[order], starts, np.maximum),
    )
    weight = sums[:, :1]
    at = np.where(weight > 0, sums[:, 1:4] / np.where(weight > 0, weight, 1.0), (low + high) / 2)
    radius = np.linalg.norm(np.maximum(high - at, at - low), axis=1)
    first = sums[:, 7:] - (at[:, :, None] * sums[:, 4:7][:, None, :]).reshape(-1, 9)
    moments = np.hstack([at, (FAR * radius[:, None]) ** 2, sums[:, 4:7], first])
    return WindingTree(np.ascontiguousarray(unit.reshape(-1, 9)[order]), np.ascontiguousarray(moments), starts, center, scale)


def winding_number(source: trimesh.Trimesh | np.ndarray | WindingTree, queries: np.ndarray) -> np.ndarray:
    """The winding number [m] of a mesh, of triangles [k, 3, 3] or of a tree at `queries` [m, 3]."""
    tree = source if isinstance(source, WindingTree) else triangle_tree(source)
    unit = (np.asarray(queries, float).reshape(-1, 3) - tree.center) * tree.scale
    return by_shares(lambda share: _winding(tree.corners, tree.moments, tree.starts, share), np.ascontiguousarray(unit))


class Interior:
    """Where a mesh is solid; build it once where many batches of queries follow.

    A closed mesh without self-overlap is asked by the parity of crossings along two oblique rays, along one once TRUSTED queries had the
    same answer from both; where the two disagree, and for every other mesh, the winding number decides.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._mesh = mesh
        triangles = np.asarray(mesh.vertices, float)[mesh.faces]
        self._columns = [sort_columns(triangles, np.asarray(ray)) for ray in RAYS] if mesh.is_watertight else []
        self._agreed = 0.0  # less than none, once they have disagreed

    @cached_property
    def _tree(self) -> WindingTree:
        return triangle_tree(self._mesh)

    def contains(self, queries: np.ndarray) -> np.ndarray:
        """Whether `queries` [m, 3] lie inside, bool [m]; the likelier answer for open meshes."""
        queries = np.asarray(queries, float).reshape(-1, 3)
        if not self._columns:
            return winding_number(self._tree, queries) > 0.5
        low, high = self._mesh.bounds
        near = np.flatnonzero(((queries > low) & (queries < high)).all(axis=1))
        one, two = self._columns
        odd = one.count_above(queries[near]) % 2 == 1
        if self._agreed < TRUSTED:
            unsure = np.flatnonzero(odd != (two.count_above(queries[near]) % 2 == 1))
            self._agreed += -math.inf if len(unsure) else len(near)
            if len(unsure):
                odd[unsure] = winding_number(self._tree, queries[near[unsure]]) > 0.5
        inside = np.zeros(len(queries), bool)
        inside[near] = odd
        return inside


def _unit_frame(points: np.ndarray) -> tuple[np.ndarray, float]:
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float(1 / max(np.linalg.norm(high - low), 1e-300))


@njit(nogil=True, cache=True)
def _winding(corners, moments, starts, queries):  # pragma: no cover - compiled
    out = np.empty(len(queries))
    leaves = len(starts) - 1
    stack = np.empty(128, np.int64)
    for i in range(len(queries)):
        x, y, z = queries[i]
        total = 0.0
        stack[0] = 1
        top = 1
        while top:
            top -= 1
            node = stack[top]
            m = moments[node]
            dx, dy, dz = m[0] - x, m[1] - y, m[2] - z
            square = dx * dx + dy * dy + dz * dz
            if square > m[3]:
                total += _far(m, dx, dy, dz, square)
            elif node < leaves:
                stack[top] = 2 * node
                stack[top + 1] = 2 * node + 1
                top += 2
            else:
                for row in range(starts[node - leaves], starts[node - leaves + 1]):
                    total += _near(corners[row], x, y, z)
        out[i] = total * QUARTER_TURN
    return out


@njit(nogil=True, cache=True, inline="always")
def _far(m, dx, dy, dz, square):  # pragma: no cover - compiled
    inverse = 1 / (square * math.sqrt(square))
    first = m[4] * dx + m[5] * dy + m[6] * dz
    trace = m[7] + m[11] + m[15]
    bend = (
        dx * (m[7] * dx + m[8] * dy + m[9] * dz) + dy * (m[10] * dx + m[11] * dy + m[12] * dz) + dz * (m[13] * dx + m[14] * dy + m[15] * dz)
    )
    return inverse * (first + trace - 3 * bend / square)


@njit(nogil=True, cache=True, inline="always")
def _near(c, x, y, z):  # pragma: no cover - compiled
    ax, ay, az = c[0] - x, c[1] - y, c[2] - z
    bx, by, bz = c[3] - x, c[4] - y, c[5] - z
    cx, cy, cz = c[6] - x, c[7] - y, c[8] - z
    a = math.sqrt(ax * ax + ay * ay + az * az)
    b = math.sqrt(bx * bx + by * by + bz * bz)
    d = math.sqrt(cx * cx + cy * cy + cz * cz)
    det = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    span = a * b * d + (ax * bx + ay * by + az * bz) * d + (bx * cx + by * cy + bz * cz) * a + (cx * ax + cy * ay + cz * az) * b
    return 2 * math.atan2(det, span)
