"""Compiled ray crossings of carrier surfaces where points of the cloud bear them out."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numba import njit

from imdim.detection.cloud_kernels import CONE, CYLINDER, ELLIPSOID, PLANE, SPHERE, distance_and_cosine, gradient, in_ball


@njit(cache=True, inline="always")
def _quadratic(a, b, c, out):  # pragma: no cover - compiled
    """Roots of a t^2 + 2 b t + c, written to `out`; their number."""
    if abs(a) < 1e-14:
        if abs(b) < 1e-14:
            return 0
        out[0] = -c / (2 * b)
        return 1
    under = b * b - a * c
    if under <= 0.0:
        return 0
    root = math.sqrt(under)
    out[0], out[1] = (-b - root) / a, (-b + root) / a
    return 2


@njit(cache=True)
def crossings(kind, row, o, d, out):  # pragma: no cover - compiled
    """Parameters t of o + t d on the carrier, written to `out` [>= 4]; their number."""
    qx, qy, qz = o[0] - row[0], o[1] - row[1], o[2] - row[2]
    ax, ay, az = row[3], row[4], row[5]
    da, qa = d[0] * ax + d[1] * ay + d[2] * az, qx * ax + qy * ay + qz * az
    if kind == PLANE:
        if abs(da) < 1e-9:
            return 0
        out[0] = -qa / da
        return 1
    qd, qq = qx * d[0] + qy * d[1] + qz * d[2], qx * qx + qy * qy + qz * qz
    if kind == SPHERE:
        return _quadratic(1.0, qd, qq - row[6] * row[6], out)
    if kind == CYLINDER:
        return _quadratic(1.0 - da * da, qd - qa * da, qq - qa * qa - row[6] * row[6], out)
    if kind == ELLIPSOID:
        u, v, w = in_ball(row, qx, qy, qz)
        du, dv, dw = in_ball(row, d[0], d[1], d[2])
        return _quadratic(du * du + dv * dv + dw * dw, u * du + v * dv + w * dw, u * u + v * v + w * w - 1.0, out)
    if kind == CONE:
        k = math.cos(row[6]) ** 2
        n = _quadratic(k - da * da, k * qd - qa * da, k * qq - qa * qa, out)
        count = 0
        for i in range(n):
            if qa + out[i] * da > 0.0:
                out[count] = out[i]
                count += 1
        return count
    return _torus(row, qd, qq, qa, da, out)


@njit(cache=True)
def _torus(row, qd, qq, qa, da, out):  # pragma: no cover - compiled
    """Sign changes of the distance along the chord of the bounding ball, by bisection."""
    span = np.empty(2)
    if _quadratic(1.0, qd, qq - (row[6] + row[7]) ** 2, span) < 2:
        return 0
    steps, count = 48, 0
    before, t0 = 1.0, span[0]
    for i in range(1, steps + 1):
        t1 = span[0] + (span[1] - span[0]) * i / steps
        value = _torus_value(row, qd, qq, qa, da, t1)
        if (value < 0) != (before < 0) and count < 4:
            a, b = t0, t1
            for _ in range(30):
                m = 0.5 * (a + b)
                if (_torus_value(row, qd, qq, qa, da, m) < 0) == (before < 0):
                    a = m
                else:
                    b = m
            out[count] = 0.5 * (a + b)
            count += 1
        before, t0 = value, t1
    return count


@njit(cache=True, inline="always")
def _torus_value(row, qd, qq, qa, da, t):  # pragma: no cover - compiled
    h = qa + t * da
    rho = math.sqrt(max(qq + 2 * t * qd + t * t - h * h, 0.0))
    return math.hypot(rho - row[6], h) - row[7]


def build_grid(points: np.ndarray, low: np.ndarray, cell: float, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points sorted by cell: starts [cells + 1] and point indices in cell order."""
    cells = np.ravel_multi_index(tuple(_cells_of(points, low, cell, shape).T), tuple(shape))
    starts = np.concatenate([[0], np.cumsum(np.bincount(cells, minlength=int(np.prod(shape))))])
    return starts, np.argsort(cells, kind="stable")


@njit(cache=True)
def sides_of(points, kinds, rows, band):  # pragma: no cover - compiled
    """Side [n, c] of every carrier: -1, 1, or 0 within `band` of it."""
    out = np.zeros((len(points), len(kinds)), np.int8)
    for i in range(len(points)):
        for c in range(len(kinds)):
            d, _ = distance_and_cosine(kinds[c], rows[c], points[i, 0], points[i, 1], points[i, 2], 0.0, 0.0, 0.0)
            out[i, c] = 0 if abs(d) < band else (1 if d > 0 else -1)
    return out


def presence(points: np.ndarray, owner: np.ndarray, low: np.ndarray, cell: float, shape: np.ndarray, count: int, dilate: int) -> np.ndarray:
    """Which of `count` carriers have a point within `dilate` cells: 0 or 1 in [x, y, z, count]."""
    marks = np.zeros((*shape, count), np.uint8)
    *at, owned = np.unique(np.column_stack([_cells_of(points, low, cell, shape), owner]), axis=0).T
    for step in product(range(-dilate, dilate + 1), repeat=3):
        # what would lie outside of the grid marks a cell on the way there
        marks[(*(np.clip(a + s, 0, n - 1) for a, s, n in zip(at, step, shape, strict=True)), owned)] = 1
    return marks


def _cells_of(points: np.ndarray, low: np.ndarray, cell: float, shape: np.ndarray) -> np.ndarray:
    """The cell [n, 3] of each point."""
    return np.clip(((points - low) / cell).astype(np.int64), 0, shape - 1)


@njit(cache=True)
def is_supported(x, carrier, cloud, grid, reach, merge, scratch):  # pragma: no cover - compiled
    """Whether a point of `carrier` lies within `reach` of `x` with no other carrier that is present there between the two.

    The carriers' own intersections thus trim the faces, and the reach may be generous without spilling over edges. Where
    another carrier is tangent (within `merge`), no side tells them apart, and the one with the nearer point has the place.
    """
    kinds, rows, points, owner, side = cloud
    starts, order, low, cell, shape, marks = grid
    mine, nearest, others, signs = scratch
    own = 0
    nearest[:] = np.inf
    i0, i1 = max(int((x[0] - reach - low[0]) / cell), 0), min(int((x[0] + reach - low[0]) / cell), shape[0] - 1)
    j0, j1 = max(int((x[1] - reach - low[1]) / cell), 0), min(int((x[1] + reach - low[1]) / cell), shape[1] - 1)
    k0, k1 = max(int((x[2] - reach - low[2]) / cell), 0), min(int((x[2] + reach - low[2]) / cell), shape[2] - 1)
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            base = (i * shape[1] + j) * shape[2]
            if k1 < k0:
                continue
            for s in range(starts[base + k0], starts[base + k1 + 1]):
                p = order[s]
                far = (points[p, 0] - x[0]) ** 2 + (points[p, 1] - x[1]) ** 2 + (points[p, 2] - x[2]) ** 2
                if far > reach * reach:
                    continue
                nearest[owner[p]] = min(nearest[owner[p]], far)
                if owner[p] == carrier and own < len(mine):
                    mine[own] = p
                    own += 1
    if own == 0:
        return False
    gx, gy, gz = gradient(kinds[carrier], rows[carrier], x[0], x[1], x[2])
    c0 = min(max(int((x[0] - low[0]) / cell), 0), shape[0] - 1)
    c1 = min(max(int((x[1] - low[1]) / cell), 0), shape[1] - 1)
    c2 = min(max(int((x[2] - low[2]) / cell), 0), shape[2] - 1)
    kept = 0
    for c in range(len(kinds)):
        if c == carrier or marks[c0, c1, c2, c] == 0:
            continue
        d, cosine = distance_and_cosine(kinds[c], rows[c], x[0], x[1], x[2], gx, gy, gz)
        if abs(d) < merge and abs(cosine) > 0.9:
            if nearest[c] < nearest[carrier]:
                return False
        elif abs(d) < reach:
            others[kept], signs[kept] = c, 1 if d > 0 else -1
            kept += 1
    for m in range(own):
        apart = False
        for b in range(kept):
            apart = apart or side[mine[m], others[b]] == -signs[b]
        if not apart:
            return True
    return False


@njit(cache=True)
def parity_votes(queries, numbers, directions, lines, enough, boxes, cloud, grid, reach, merge):  # pragma: no cover - compiled
    """Per query the lines whose two halves both cross oddly, those that agree at all, half lines that cross oddly, lines taken: [m, 4].

    Each query takes `lines` of the `directions` in turn, from a place that its number [m] says, or fewer where `enough` say the same.
    A line that crosses a closed surface an odd number of times in all has met a gap or a stray piece, and does not vote.
    """
    kinds, rows = cloud[0], cloud[1]
    low, high = boxes
    out = np.zeros((len(queries), 4))
    roots, x = np.empty(4), np.empty(3)
    scratch = (np.empty(256, np.int64), np.empty(len(kinds)), np.empty(len(kinds), np.int64), np.empty(len(kinds), np.int64))
    for q in range(len(queries)):
        o = queries[q]
        for line in range(lines):
            if out[q, 1] >= enough and (out[q, 0] == 0 or out[q, 0] == out[q, 1]):
                break
            d = directions[(numbers[q] * 7 + line) % len(directions)]
            ahead, behind = 0, 0
            for c in range(len(kinds)):
                n = crossings(kinds[c], rows[c], o, d, roots)
                for r in range(n):
                    inside = True
                    for a in range(3):
                        x[a] = o[a] + roots[r] * d[a]
                        inside = inside and low[c, a] <= x[a] <= high[c, a]
                    if inside and is_supported(x, c, cloud, grid, reach, merge, scratch):
                        if roots[r] > 0:
                            ahead += 1
                        else:
                            behind += 1
            out[q, 2] += ahead % 2 + behind % 2
            out[q, 3] += 1
            if (ahead + behind) % 2 == 0:
                out[q, 1] += 1
                out[q, 0] += ahead % 2
    return out
