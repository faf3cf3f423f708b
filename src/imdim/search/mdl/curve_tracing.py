"""Closed curves through noisy points of a plane: where points crowd the plane parts into basins, and in and out alternate across crowds.

The density of the points is flooded from the places farthest from any crowd (Vincent & Soille 1991). Of two basins that meet the sides
differ where their common border is crowded, and are the same where it is not, weighed by how much of it is: sides are set along the
clearest borders first, then basin by basin. No normals are needed, and a gap in a curve does no harm.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import ndimage

CELLS = (1.0, 1.4, 2.0, 2.8, 4.0)  # sides of a cell, in deviations of the noise: the first by which points are enough
ENOUGH = 10.0  # points that a smoothed cell of a curve has
MOST_CELLS = 320  # along the longer side
SMOOTH = 1.0  # deviation of the smoothing, in cells
MARGIN = 6  # cells around the points
USUAL = 0.5  # quantile of the density at points: that of a curve
CROWDED = 0.25  # of it: occupied
REAL = 0.4  # of it, on average along a border: a curve
DEEP = 1.6  # cells from the next crowd, where a basin may begin
ROUNDS = 20
LEAST_CROWD = 25  # cells


@dataclass(frozen=True)
class Sides:
    """Which cells of a plane are `inside` [a, b]; the first has its low corner at `origin` [2], all have the side `cell`."""

    inside: np.ndarray
    origin: np.ndarray
    cell: float


@dataclass(frozen=True)
class _Density:
    """The `density` [a, b] of points over cells, that of a curve being 1; the place of the cells as `Sides` has it."""

    density: np.ndarray
    origin: np.ndarray
    cell: float


def find_sides(points: np.ndarray, weight: np.ndarray, sigma: float, turned: bool) -> list[Sides]:
    """The sides of the closed curves through `points` [n, 2] that count by their `weight` [n], the same with all crowds inside, and
    the crowds alone: both skins of a thin wall are one crowd. None of them where nothing is inside or the points are too few.

    If `turned`, x is the distance from an axis, across which the curves go on as their mirror image. What is closed all around is then
    inside: no scan shows a cavity that nothing leads to, while a shell of any thickness about a solid fits its noise or its small features.
    """
    seen = _see_density(points, weight / weight.mean(), sigma, turned)
    if seen is None:
        return []
    basins = _flood(seen.density, turned)
    pairs, weights = _weigh_borders(basins, np.minimum(seen.density, 1.0))
    inside = np.zeros(basins.shape, bool)
    if len(pairs):
        inside = _choose_sides(pairs, weights, int(basins.max()) + 1, int(basins[-1, -1]))[basins]
    crowds = _find_crowds(seen.density)
    found = [_fill_cavities(sides) if turned else sides for sides in (inside, inside | crowds, crowds)]
    return [Sides(sides, seen.origin, seen.cell) for sides in found if sides.any()]


def _fill_cavities(inside: np.ndarray) -> np.ndarray:
    """The mask [a, b] with all that it and the axis, before its first row, enclose."""
    filled = ndimage.binary_fill_holes(np.pad(inside, ((1, 0), (0, 0)), constant_values=True))
    assert isinstance(filled, np.ndarray)
    return filled[1:]


def _see_density(points: np.ndarray, weight: np.ndarray, sigma: float, turned: bool) -> _Density | None:
    """In the smallest cells of which a curve's have enough points; None where there are none."""
    low, high = points.min(0), points.max(0)
    for factor in CELLS:
        cell = max(factor * sigma, float((high - low).max()) / MOST_CELLS)
        origin = low - MARGIN * cell
        origin[0] = 0.0 if turned else origin[0]
        cells = np.ceil((high - origin) / cell).astype(int) + MARGIN
        at = np.minimum(((points - origin) / cell).astype(int), cells - 1)
        count = np.bincount(np.ravel_multi_index((at[:, 0], at[:, 1]), tuple(cells)), weight, int(cells.prod())).reshape(cells)
        density = ndimage.gaussian_filter(count, SMOOTH, mode="reflect" if turned else "constant")
        usual = _weighted_quantile(density[at[:, 0], at[:, 1]], weight, USUAL)
        if usual * 4 * np.pi * SMOOTH**2 > ENOUGH:
            return _Density(density / usual, origin, cell)
    return None


def _weighted_quantile(values: np.ndarray, weight: np.ndarray, share: float) -> float:
    order = np.argsort(values, kind="stable")
    mass = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(mass, share * mass[-1])])


def _find_crowds(density: np.ndarray) -> np.ndarray:
    """Mask [a, b] of the large crowds."""
    label = _label(density > CROWDED)
    large = np.bincount(label.ravel()) >= LEAST_CROWD
    large[0] = False
    return ndimage.binary_opening(large[label])


def _label(mask: np.ndarray, structure: np.ndarray | None = None) -> np.ndarray:
    """The number int [a, b] of the connected piece that each cell is of, 0 outside the mask."""
    out = np.zeros(mask.shape, np.int32)
    ndimage.label(mask, structure, output=out)
    return out


def _flood(density: np.ndarray, turned: bool) -> np.ndarray:
    """The basin int [a, b] of each cell."""
    free = density < CROWDED
    padded = np.pad(free, 1, constant_values=True)
    if turned:
        padded[0] = padded[1]
    away = ndimage.distance_transform_edt(np.concatenate([padded[::-1], padded]) if turned else padded)
    assert isinstance(away, np.ndarray)
    away = (away[len(padded) :] if turned else away)[1:-1, 1:-1]
    away = ndimage.gaussian_filter(away, 1.0, mode="nearest")
    peak = (away >= ndimage.maximum_filter(away, 5, mode="nearest")) & (away > DEEP)
    peak[-1, :] = peak[:, -1] = peak[:, 0] = True  # beyond the points is outside
    if not turned:
        peak[0, :] = True
    markers = _label(peak, np.ones((3, 3)))
    # far from crowds the density is chance
    return _fill(np.where(density > CROWDED, density, -away), markers) - 1


def _weigh_borders(basins: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of basins [m, 2] and how much more of their border is crowded than not [m]."""
    pairs, crowd = [], []
    for a, b in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
        differ = basins[a] != basins[b]
        pairs.append(np.stack([np.minimum(basins[a], basins[b])[differ], np.maximum(basins[a], basins[b])[differ]], 1))
        crowd.append(np.maximum(density[a], density[b])[differ])
    unique, index = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    return unique, np.bincount(index.ravel(), np.concatenate(crowd) - REAL, len(unique))


def _choose_sides(pairs: np.ndarray, weight: np.ndarray, count: int, outside: int) -> np.ndarray:
    """Whether each basin [count] is inside: basins `pairs` [m, 2] want to differ by `weight` [m], or to be alike where it is negative."""
    order = np.argsort(-np.abs(weight), kind="stable")
    side = _span(pairs[order], weight[order] > 0, count)
    side ^= side[outside]
    for _ in range(ROUNDS):
        alike = side[pairs[:, 0]] == side[pairs[:, 1]]
        # what a basin wins by changing sides
        won = np.where(alike, weight, -weight)
        gain = np.bincount(pairs.ravel(), np.repeat(won, 2), count)
        gain[outside] = -np.inf
        if gain.max() <= 1e-9:
            break
        side[gain.argmax()] ^= True
    return side


@njit(cache=True)
def _fill(height, markers):  # pragma: no cover - compiled
    """The marker that each cell's lowest way leads from; the lowest cell beside what is filled is filled next."""
    rows, columns = height.shape
    out = markers.copy()
    heap = [(height[i, j], i, j) for i in range(rows) for j in range(columns) if markers[i, j] > 0]
    heapq.heapify(heap)
    while len(heap):
        level, i, j = heapq.heappop(heap)
        for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
            if 0 <= a < rows and 0 <= b < columns and out[a, b] == 0:
                out[a, b] = out[i, j]
                heapq.heappush(heap, (max(level, height[a, b]), a, b))
    return out


@njit(cache=True)
def _span(pairs, differ, count):  # pragma: no cover - compiled
    """Sides that follow from the first pairs that join everything."""
    parent, odd = np.arange(count), np.zeros(count, np.bool_)
    for k in range(len(pairs)):
        a, b, pa, pb = pairs[k, 0], pairs[k, 1], False, False
        while parent[a] != a:
            pa, a = pa != odd[a], parent[a]
        while parent[b] != b:
            pb, b = pb != odd[b], parent[b]
        if a != b:
            parent[a] = b
            odd[a] = (pa != pb) != differ[k]
    out = np.zeros(count, np.bool_)
    for i in range(count):
        a, p = i, False
        while parent[a] != a:
            p, a = p != odd[a], parent[a]
        out[i] = p
    return out


def trace_borders(sides: Sides) -> list[np.ndarray]:
    """The closed borders [m, 2] of what is inside, that to the left, corner after corner of the cells."""
    grid = np.pad(sides.inside, 1)
    steps: dict[tuple[int, int], list[tuple[int, int]]] = {}
    up, down = np.argwhere(grid[:-1] & ~grid[1:]), np.argwhere(~grid[:-1] & grid[1:])
    right, left = np.argwhere(~grid[:, :-1] & grid[:, 1:]), np.argwhere(grid[:, :-1] & ~grid[:, 1:])
    for cells, start, end in ((up, (1, 0), (1, 1)), (down, (1, 1), (1, 0)), (right, (0, 1), (1, 1)), (left, (1, 1), (0, 1))):
        for a, b in (cells - 1).tolist():
            steps.setdefault((a + start[0], b + start[1]), []).append((a + end[0], b + end[1]))
    out = []
    while steps:
        out.append(np.array(_take_ring(steps)) * sides.cell + sides.origin)
    return out


def _take_ring(steps: dict[tuple[int, int], list[tuple[int, int]]]) -> list[tuple[int, int]]:
    """One closed row of steps, taken out of them."""
    first = next(iter(steps))
    ring, at, before = [first], first, (0, 0)
    while True:
        ways = steps[at]
        # where two corners touch, a turn to the left keeps them apart
        after = ways.pop(max(range(len(ways)), key=lambda w: _turn(before, at, ways[w])))
        if not ways:
            del steps[at]
        before, at = (after[0] - at[0], after[1] - at[1]), after
        if at == first:
            return ring
        ring.append(at)


def _turn(before: tuple[int, int], at: tuple[int, int], after: tuple[int, int]) -> int:
    return before[0] * (after[1] - at[1]) - before[1] * (after[0] - at[0])
