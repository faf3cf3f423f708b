"""Signed sequences out of a pool of primitives, judged by a cloud alone: which of them, in what order, with what sign.

The cost of a sequence needs no truth and no normals: the share of the cloud that its surface does not explain, the share of its surface
that the cloud does not support, and a price per primitive. Distances of all primitives to all points are taken once, so that a sequence
costs some ten microseconds, and thousands can be tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines, pack_all
from imdim.geometry.sampling import EIGHTH, leaf_surface, subsample, surface_spacing
from imdim.geometry.surface_map import surface_area
from imdim.program.tree import Primitive
from imdim.search.mdl.local_search import Choice, own_moves, pack_choices, uses

SURFACE_SEED = 0  # of the samples of surfaces: costs of two pools differ by their primitives, not by chance


@dataclass(frozen=True)
class PoolConfig:
    """Lengths are shares of the cloud's diagonal; `price` is the share of cloud and surface that a primitive must set right."""

    explained: float = 0.03  # a point this far from the surface counts in full
    price: float = 0.004
    surface_weight: float = 1.0  # of surface without points, where points without surface have 1
    calm: float = 1.5  # deviations of the noise that a point may be off for nothing
    gap: float = 3e-3  # sheets nearer than this are one
    samples: int = 160  # of each primitive's surface
    rounds: int = 16  # of local search
    longest: int = 16  # primitives of a sequence


@dataclass(frozen=True)
class Cloud:
    """Points [n, 3] with their tree, the box diagonal, the side of the square that one point stands for, and their noise's deviation."""

    points: np.ndarray
    tree: KDTree
    diagonal: float
    spacing: float
    noise: float

    @staticmethod
    def of(points: np.ndarray, noise: float) -> Cloud:
        points = np.ascontiguousarray(points, float)
        tree = KDTree(points)
        eighth = tree.query(subsample(points, 512), k=min(EIGHTH + 1, len(points)))[0][:, -1]
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        return Cloud(points, tree, diagonal, max(surface_spacing(eighth), 1e-9 * diagonal), noise)


@dataclass(frozen=True)
class PrimitivePool:
    """`primitives`, their signed distances `table` [p, n] to the cloud with gradients `normals` [p, n, 3], and the samples of their
    surfaces that no point supports: `weight` [s] (share of the cloud's area), and which primitives hold the places just `behind` and
    `ahead` of them, [p, s]; those of primitive i are `starts[i]` to `starts[i + 1]`."""

    primitives: tuple[Primitive, ...]
    table: np.ndarray
    normals: np.ndarray
    starts: np.ndarray
    weight: np.ndarray
    behind: np.ndarray
    ahead: np.ndarray
    explained: float
    noise: float
    gap: float
    price: float

    @staticmethod
    def of(primitives: Sequence[Primitive], cloud: Cloud, config: PoolConfig, count: int = 768) -> PrimitivePool:
        """The pool over `count` points of the cloud."""
        leaf_arrays, outlines = pack_all(primitives), Outlines.of(primitives)
        seen, step = subsample(cloud.points, count), 1e-5 * cloud.diagonal
        table = kernels.leaf_table(*leaf_arrays, seen, outlines)
        ahead_of = [kernels.leaf_table(*leaf_arrays, seen + step * axis, outlines) for axis in np.eye(3)]
        gradients = (np.stack(ahead_of, -1) - table[..., None]) / step
        points, normals, weight, starts = _unborne(primitives, cloud, config)
        gap = config.gap * cloud.diagonal
        behind, ahead = (kernels.leaf_table(*leaf_arrays, points + side * normals, outlines) < 0 for side in (-gap, gap))
        weight = weight * config.surface_weight
        explained = config.explained * cloud.diagonal
        arrays = table.astype(np.float32), gradients.astype(np.float32), starts, weight, behind, ahead
        return PrimitivePool(tuple(primitives), *arrays, explained, config.calm * cloud.noise, gap, config.price)

    def cost(self, chosen: Choice) -> float:
        """Of one choice."""
        return float(self.costs([chosen])[0])

    def costs(self, choices: Sequence[Choice], limit: float = np.inf) -> np.ndarray:
        """Of each choice; infinite where `limit` is reached."""
        arrays = self.table, self.normals, self.starts, self.weight, self.behind, self.ahead
        return _costs(*pack_choices(choices), *arrays, self.explained, self.noise, self.gap, self.price, limit)


def _unborne(primitives: Sequence[Primitive], cloud: Cloud, config: PoolConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Samples of all surfaces that lie off the cloud: points and normals [s, 3], weights [s], and the first of each primitive [p + 1]."""
    rng = np.random.default_rng(SURFACE_SEED)
    drawn = [leaf_surface(p, config.samples, rng) for p in primitives]
    points, normals = (np.concatenate(c) for c in zip(*drawn, strict=True))
    area = np.repeat([surface_area(p.kind, p.size, p.outline) / config.samples for p in primitives], config.samples)
    away = cloud.tree.query(points, distance_upper_bound=2.5 * cloud.spacing + config.calm * cloud.noise)[0]
    # of a Poisson process 3 % of the surface lie further than one spacing from every point, and nothing beyond two
    doubt = np.clip((away - config.calm * cloud.noise) / cloud.spacing - 1.0, 0.0, 1.0)
    off = doubt > 0
    weight = area * doubt / (len(cloud.points) * cloud.spacing**2)
    starts = np.concatenate([[0], np.cumsum(off.reshape(len(primitives), -1).sum(1))])
    return points[off], normals[off], weight[off], starts


@njit(nogil=True, cache=True)
def _costs(lengths, index, sign, table, normals, starts, weight, behind, ahead, explained, noise, gap, price, limit):  # pragma: no cover
    out = np.full(len(index), np.inf)
    for i in range(len(index)):
        k = lengths[i]
        cost = price * k + _bare_share(index[i, :k], sign[i, :k], starts, weight, behind, ahead)
        if cost < limit:
            cost += _cost_unexplained(index[i, :k], sign[i, :k], table, normals, explained, noise, gap, limit - cost)
        if cost < limit:
            out[i] = cost
    return out


@njit(nogil=True, cache=True)
def _bare_share(index, sign, starts, weight, behind, ahead):  # pragma: no cover - compiled
    total = 0.0
    for t in range(len(index)):
        for s in range(starts[index[t]], starts[index[t] + 1]):
            within, without = False, False
            for u in range(len(index)):
                if behind[index[u], s]:
                    within = sign[u]
                if ahead[index[u], s]:
                    without = sign[u]
            if within != without:
                total += weight[s]
    return total


@njit(nogil=True, cache=True)
def _cost_unexplained(index, sign, table, normals, explained, noise, gap, limit):  # pragma: no cover - compiled
    """Mean distance to the surface in units of `explained`, 1 beyond; what exceeds `limit` need not be exact."""
    n, total = table.shape[1], 0.0
    for j in range(n):
        value, owner = explained, -1
        for t in range(len(index)):
            v = table[index[t], j] if sign[t] else -table[index[t], j]
            if (v < value) if sign[t] else (v > value):
                value, owner = v, t
        off = min(abs(value), explained)
        if owner >= 0 and off < explained and _is_no_boundary(index, sign, owner, j, table, normals, gap):
            off = explained
        # what noise explains is no fault, or it would be fitted
        total += max(off - noise, 0.0)
        if total > limit * explained * n:
            break
    return total / (explained * n)


@njit(nogil=True, cache=True)
def _is_no_boundary(index, sign, owner, j, table, normals, gap):  # pragma: no cover - compiled
    """Whether both sides of the owner's surface at point j are alike: a part and the cut that takes it away share their surface."""
    own = index[owner]
    within, without = False, False
    for u in range(len(index)):
        i = index[u]
        slope = 0.0
        for c in range(3):
            slope += normals[i, j, c] * normals[own, j, c]
        at = table[i, j] - table[own, j] * slope
        if at - gap * slope < 0:
            within = sign[u]
        if at + gap * slope < 0:
            without = sign[u]
    return within == without


def best_choice(pool: PrimitivePool, start: Choice, config: PoolConfig) -> tuple[Choice, float]:
    """Local search: of all single changes the best, until none lowers the cost.

    The whole pool is looked at once; after that only those of its primitives that any change could use.
    """
    best, cost = start, pool.cost(start)
    useful = set(range(len(pool.primitives)))
    for _ in range(config.rounds):
        moves = [(c, -1) for c in own_moves(best)]
        moves += [(c, i) for i in useful for c in uses(i, best) if len(c) <= config.longest]
        costs = pool.costs([c for c, _ in moves], cost - 1e-9)
        if not np.isfinite(costs).any():
            break
        useful = {moves[j][1] for j in np.flatnonzero(np.isfinite(costs))} - {-1}
        best, cost = moves[int(costs.argmin())][0], float(costs.min())
    return best, cost


def distinct(primitives: Sequence[Primitive], cloud: Cloud, tolerance: float = 5e-4, count: int = 200) -> list[Primitive]:
    """Without those whose distances to the cloud are, on average, within `tolerance` of the diagonal of an earlier one's."""
    some = subsample(cloud.points, count)
    table = kernels.leaf_table(*pack_all(primitives), some, Outlines.of(primitives)).astype(np.float32)
    kept: list[int] = []
    for i in range(len(primitives)):
        if not kept or float(np.abs(table[kept] - table[i]).mean(1).min()) > tolerance * cloud.diagonal:
            kept.append(i)
    return [primitives[i] for i in kept]
