"""How often rays of one direction cross a mesh: triangles are sorted into columns along the direction, each query looks into one.

A query lies in a triangle as it is seen along the direction if a half-line from it crosses the sides an odd number of times (even-odd rule
with half-open sides, Shimrat 1962). Both triangles of an edge ask it from the same end, so that of a closed mesh no ray slips through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.shares import by_shares

ENTRIES = 128  # columns a triangle may lie in, on average
COLUMNS = 8.0  # for each triangle, where they are small
MOST_COLUMNS = 2**20


@dataclass(frozen=True, eq=False)
class RayColumns:
    """Triangles of a mesh in a grid across a direction.

    `frame` [3, 3] has two rows across the direction and the direction; `corners` [k, 9] are in it, less `center` and times `scale`.
    Column (i, j) of `side` x `side` over the square from -1/2 to 1/2 owns ``members[starts[i * side + j]:starts[i * side + j + 1]]``. The
    triangles stand by how high they reach, highest first, and so do the members of a column.
    """

    frame: np.ndarray
    center: np.ndarray
    scale: float
    corners: np.ndarray
    side: int
    starts: np.ndarray
    members: np.ndarray

    def count_above(self, queries: np.ndarray) -> np.ndarray:
        """How many triangles rays from `queries` [m, 3] cross along the direction, int [m]."""
        unit = (np.asarray(queries, float).reshape(-1, 3) - self.center) * self.scale
        across = np.ascontiguousarray(unit @ self.frame.T)
        return by_shares(lambda share: _count_above(self.corners, self.side, self.starts, self.members, share), across)


def sort_columns(triangles: np.ndarray, direction: np.ndarray) -> RayColumns:
    """The columns of triangles [k, 3, 3] along a unit `direction` [3]."""
    frame = _frame(np.asarray(direction, float))
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    center, scale = (low + high) / 2, float(1 / max(np.linalg.norm(high - low), 1e-300))
    corners = np.ascontiguousarray(((triangles - center) * scale) @ frame.T)
    # what is below a query ends the look into its column
    corners = corners[np.argsort(-corners[:, :, 2].max(axis=1), kind="stable")]
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    side = _choose_side(low, high)
    first, last = _column(low, side), _column(high, side)
    starts, members = _fill(first, last, side, np.zeros(side * side + 1, np.int64), int((last - first + 1).prod(axis=1).sum()))
    return RayColumns(frame, center, scale, corners.reshape(-1, 9), side, starts, members)


def _frame(direction: np.ndarray) -> np.ndarray:
    across = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(direction, across), direction])


def _choose_side(low: np.ndarray, high: np.ndarray) -> int:
    """Of the grid, such that triangles between `low` and `high` [k, 2] lie in ENTRIES columns each on average."""
    side = max(int(math.sqrt(min(COLUMNS * len(low), MOST_COLUMNS))), 1)
    while side > 1 and (_column(high, side) - _column(low, side) + 1).prod(axis=1).sum() > ENTRIES * len(low):
        side = max(side * 2 // 3, 1)
    return side


def _column(at: np.ndarray, side: int) -> np.ndarray:
    return np.clip(np.floor((at + 0.5) * side), 0, side - 1).astype(np.int64)


@njit(nogil=True, cache=True)
def _fill(
    first: np.ndarray, last: np.ndarray, side: int, starts: np.ndarray, entries: int
) -> tuple[np.ndarray, np.ndarray]:  # pragma: no cover - compiled
    for k in range(len(first)):
        for i in range(first[k, 0], last[k, 0] + 1):
            for j in range(first[k, 1], last[k, 1] + 1):
                starts[i * side + j + 1] += 1
    starts = np.cumsum(starts)
    members, filled = np.empty(entries, np.int64), starts[:-1].copy()
    for k in range(len(first)):
        for i in range(first[k, 0], last[k, 0] + 1):
            for j in range(first[k, 1], last[k, 1] + 1):
                cell = i * side + j
                members[filled[cell]] = k
                filled[cell] += 1
    return starts, members


@njit(nogil=True, cache=True)
def _count_above(corners, side, starts, members, queries):  # pragma: no cover - compiled
    out = np.zeros(len(queries), np.int64)
    for q in range(len(queries)):
        x, y, z = queries[q]
        if not (abs(x) <= 0.5 and abs(y) <= 0.5):
            continue
        cell = min(int((x + 0.5) * side), side - 1) * side + min(int((y + 0.5) * side), side - 1)
        for row in range(starts[cell], starts[cell + 1]):
            c = corners[members[row]]
            if max(c[2], c[5], c[8]) <= z:
                break
            odd = _is_left(c[0], c[1], c[3], c[4], x, y) != _is_left(c[3], c[4], c[6], c[7], x, y)
            if odd != _is_left(c[6], c[7], c[0], c[1], x, y) and _height(c, x, y) > z:
                out[q] += 1
    return out


@njit(nogil=True, cache=True, inline="always")
def _is_left(ax, ay, bx, by, x, y):  # pragma: no cover - compiled
    """Whether a half-line to the right of (x, y) crosses a side, told from its lower end, whichever triangle asks."""
    if (ay > y) == (by > y):
        return False
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return (x - ax) * (by - ay) < (y - ay) * (bx - ax)


@njit(nogil=True, cache=True, inline="always")
def _height(c, x, y):  # pragma: no cover - compiled
    """Of a triangle's plane there, within its own range: a plane along the direction has any."""
    low, high = min(c[2], c[5], c[8]), max(c[2], c[5], c[8])
    ux, uy, vx, vy = c[3] - c[0], c[4] - c[1], c[6] - c[0], c[7] - c[1]
    area = ux * vy - uy * vx
    if area == 0.0:
        return high
    s, t = ((x - c[0]) * vy - (y - c[1]) * vx) / area, (ux * (y - c[1]) - uy * (x - c[0])) / area
    return min(max(c[2] + s * (c[5] - c[2]) + t * (c[8] - c[2]), low), high)
