"""Primitives that a sequence lacks, guessed from the points that its surface does not explain.

Points inside the solid lie on walls of cuts that are missing, points outside on parts that are missing. Each connected group of them
offers a box, a sphere and a cylinder along each axis of the part; what they are worth is for the caller to find out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from imdim.geometry import kernels
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.program.tree import Primitive, Program
from imdim.solve.pool import Cloud

LEAST = 8  # points of a group
MOST_GROUPS = 6
LINKED = 2.2  # spacings between neighbours of a group
LOOK = 0.03  # of the diagonal: how far an end looks, and how much longer it becomes
TRIALS = 60  # circles and balls through random points


def missing(program: Program, cloud: Cloud, axes: np.ndarray, off: float) -> list[tuple[Primitive, bool]]:
    """Guesses with their signs; `axes` [3, 3] has the part's directions as columns, points further than `off` are unexplained."""
    value = kernels.program_sdf(program, cloud.points)
    out: list[tuple[Primitive, bool]] = []
    for positive, here in ((True, value > off), (False, value < -off)):
        for group in _groups(np.flatnonzero(here), cloud):
            for guess in _guesses(cloud.points[group], axes, off, cloud.spacing):
                out += [(reached, positive) for reached in _reaching(guess, program, positive, cloud.diagonal)]
    return out


def _groups(index: np.ndarray, cloud: Cloud) -> list[np.ndarray]:
    """Connected groups of the points `index` [m], the largest first."""
    if len(index) < LEAST:
        return []
    pairs = cloud.tree.query_pairs(LINKED * cloud.spacing, output_type="ndarray")
    place = np.full(len(cloud.points), -1)
    place[index] = np.arange(len(index))
    a, b = place[pairs].T
    both = (a >= 0) & (b >= 0)
    links = coo_matrix((np.ones(int(both.sum())), (a[both], b[both])), shape=(len(index), len(index)))
    label = connected_components(links, directed=False)[1]
    sizes = np.bincount(label)
    return [index[label == i] for i in np.argsort(-sizes, kind="stable")[:MOST_GROUPS] if sizes[i] >= LEAST]


def _guesses(points: np.ndarray, axes: np.ndarray, off: float, spacing: float) -> list[Primitive]:
    local = points @ axes
    low, high = local.min(0), local.max(0)
    thin = 0.5 * spacing
    found = [_placed("box", tuple(np.maximum(high - low, thin)), (low + high) / 2, axes)]
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        circle = _round(np.ascontiguousarray(local[:, [u, v]]), off)
        if circle is None:
            continue
        center, radius, on = circle
        ends = local[on, k].min(), local[on, k].max()
        middle = np.zeros(3)
        middle[[u, v]], middle[k] = center, sum(ends) / 2
        found.append(_placed("cylinder", (radius, max(ends[1] - ends[0], thin)), middle, axes, frame_from_axis(axes[:, k])))
    ball = _round(local, off)
    if ball is not None:
        found.append(_placed("sphere", (ball[1],), ball[0], axes))
    return found


def _round(points: np.ndarray, off: float) -> tuple[np.ndarray, float, np.ndarray] | None:
    """Centre, radius and points [m] of the circle or ball through most of `points` [n, 2 or 3], None where it is far larger than they."""
    n, d = points.shape
    rng = np.random.default_rng(0)
    picks = rng.integers(n, size=(TRIALS, d + 1))
    chosen = points[picks]
    matrix = 2 * (chosen[:, 1:] - chosen[:, :1])
    square = (chosen**2).sum(-1)
    proper = np.abs(np.linalg.det(matrix)) > 1e-12
    if not proper.any():
        return None
    centers = np.linalg.solve(matrix[proper], (square[:, 1:] - square[:, :1])[proper][..., None])[..., 0]
    radii = np.linalg.norm(chosen[proper, 0] - centers, axis=1)
    small = radii < 1.5 * np.linalg.norm(np.ptp(points, axis=0))
    if not small.any():
        return None
    best = _most_borne(points, centers[small], radii[small], 0.5 * off)
    center, radius = centers[small][best], radii[small][best]
    for _ in range(2):
        on = np.abs(np.linalg.norm(points - center, axis=1) - radius) < 0.5 * off
        if on.sum() <= d + 1:
            return None
        # Kasa (1976): |p|^2 = 2 p.c + (r^2 - |c|^2) is linear
        solution = np.linalg.lstsq(np.column_stack([2 * points[on], np.ones(on.sum())]), (points[on] ** 2).sum(1), rcond=None)[0]
        squared = solution[d] + (solution[:d] ** 2).sum()
        if squared <= 0:
            return None
        center, radius = solution[:d], float(np.sqrt(squared))
    return center, radius, on


@njit(cache=True)
def _most_borne(points, centers, radii, band):  # pragma: no cover - compiled
    best, most = 0, -1
    for i in range(len(centers)):
        count = 0
        for j in range(len(points)):
            square = 0.0
            for c in range(points.shape[1]):
                square += (points[j, c] - centers[i, c]) ** 2
            if abs(np.sqrt(square) - radii[i]) < band:
                count += 1
        if count > most:
            best, most = i, count
    return best


def _reaching(guess: Primitive, program: Program, positive: bool, diagonal: float) -> list[Primitive]:
    """The guess, and the guess made longer where it opens: ends of a cut that look out of the solid, ends of a part that look into it.

    Openings bear no points, so the group of a hole ends before the face that the hole pierces.
    """
    if guess.kind == "sphere":
        return [guess]
    axes, sizes, center = matrix_from_euler(guess.rotation), np.array(guess.size), np.array(guess.center)
    columns = ((0, 0), (1, 1), (2, 2)) if guess.kind == "box" else ((2, 1),)
    ends = [(sign * axes[:, k], slot) for k, slot in columns for sign in (-1.0, 1.0)]
    probes = np.array([center + (sizes[slot] / 2 + LOOK * diagonal) * way for way, slot in ends])
    beyond = kernels.program_sdf(program, probes)
    longer_size, longer_center = sizes.copy(), center.copy()
    for (way, slot), value in zip(ends, beyond, strict=True):
        if (value > 0) != positive:
            longer_size[slot] += 2 * LOOK * diagonal
            longer_center += LOOK * diagonal * way
    x, y, z = longer_center.tolist()
    longer = replace(guess, size=tuple(longer_size.tolist()), center=(x, y, z))
    return [longer] if longer == guess else [longer, guess]


def _placed(kind: str, size: tuple[float, ...], local: np.ndarray, axes: np.ndarray, turn: np.ndarray | None = None) -> Primitive:
    """A primitive centred at `local` in the frame `axes`, whose own axes are the columns of `turn` (default: of `axes`)."""
    x, y, z = (axes @ local).tolist()
    return Primitive(kind, tuple(float(s) for s in size), (x, y, z), euler_from_matrix(axes if turn is None else turn))
