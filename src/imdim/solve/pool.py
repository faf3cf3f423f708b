"""Signed sequences out of a pool of primitives, judged by a cloud alone: which of them, in what order, with what sign.

The cost of a sequence needs no truth and no normals: the share of the cloud that its surface does not explain, the share of its surface
that the cloud does not bear out, and a price per primitive. Distances of all primitives to all points are taken once, so that a sequence
costs some ten microseconds, and thousands can be tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import leaf_surface
from imdim.geometry.surface_map import surface_area
from imdim.program.tree import KINDS, Combine, Primitive, Program, leaves

Signed = tuple[tuple[Primitive, bool], ...]  # primitives with their signs; True unites, False cuts


@dataclass(frozen=True)
class PoolConfig:
    """Lengths are shares of the cloud's diagonal; `price` is the share of cloud and surface that a primitive must set right."""

    explained: float = 0.03  # a point this far from the surface counts in full
    price: float = 0.004
    surface_weight: float = 1.0  # of surface without points, where points without surface have 1
    gap: float = 3e-3  # sheets nearer than this are one
    samples: int = 160  # of each primitive's surface
    rounds: int = 12  # of local search


@dataclass(frozen=True)
class Cloud:
    """Points [n, 3] with their tree, the box diagonal, and the side of the square that one point stands for."""

    points: np.ndarray
    tree: KDTree
    diagonal: float
    spacing: float

    @staticmethod
    def of(points: np.ndarray) -> Cloud:
        points = np.ascontiguousarray(points, float)
        tree = KDTree(points)
        eighth = tree.query(points[:: max(1, len(points) // 512)], k=min(9, len(points)))[0][:, -1]
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        return Cloud(points, tree, diagonal, max(float(np.median(eighth)) * np.sqrt(np.pi / 8), 1e-9 * diagonal))

    def thinned(self, count: int) -> np.ndarray:
        return self.points[:: max(1, len(self.points) // count)]


def to_program(signed: Signed) -> Program:
    """The left fold; raises ValueError where the first primitive is not positive."""
    if not signed or not signed[0][1]:
        raise ValueError("a signed sequence begins with a positive primitive")
    program: Program = signed[0][0]
    for primitive, positive in signed[1:]:
        program = Combine("union" if positive else "difference", program, primitive)
    return program


def to_signed(program: Program) -> Signed | None:
    """The sequence of which `program` is the left fold, None where it is none: intersections, operations on the right."""
    steps: list[tuple[Primitive, bool]] = []
    while isinstance(program, Combine):
        if program.op == "intersection" or not isinstance(program.right, Primitive):
            return None
        steps.append((program.right, program.op == "union"))
        program = program.left
    return ((program, True), *reversed(steps))


def with_numbers(signed: Signed, program: Program) -> Signed:
    """The same signs with the leaves of `program`, which has the sequence's structure."""
    return tuple((leaf, positive) for leaf, (_, positive) in zip(leaves(program), signed, strict=True))


@dataclass(frozen=True)
class Pool:
    """`primitives`, their `signed distances` [p, n] to the cloud, and the samples of their surfaces that no point bears out: `weight` [s]
    (share of the cloud's area), and which primitives hold the places just `behind` and `ahead` of them, [p, s]; those of primitive i
    are `starts[i]` to `starts[i + 1]`."""

    primitives: tuple[Primitive, ...]
    table: np.ndarray
    starts: np.ndarray
    weight: np.ndarray
    behind: np.ndarray
    ahead: np.ndarray
    explained: float
    price: float

    @staticmethod
    def of(primitives: Sequence[Primitive], cloud: Cloud, config: PoolConfig, count: int = 768) -> Pool:
        """The pool over `count` points of the cloud."""
        kinds = np.array([KINDS.index(p.kind) for p in primitives])
        params = np.array([(*p.size, *(0.0,) * (3 - len(p.size)), *p.center, *p.rotation) for p in primitives])
        table = kernels.leaf_table(kinds, params, cloud.thinned(count))
        points, normals, weight, starts = _unborne(primitives, cloud, config)
        step = config.gap * cloud.diagonal * normals
        behind, ahead = (kernels.leaf_table(kinds, params, points + side) < 0 for side in (-step, step))
        explained = config.explained * cloud.diagonal
        weight = weight * config.surface_weight
        return Pool(tuple(primitives), table.astype(np.float32), starts, weight, behind, ahead, explained, config.price)

    def cost(self, chosen: Choice) -> float:
        """Of a sequence of (index, sign); 1 for nothing."""
        index, sign = np.array([i for i, _ in chosen], np.int64), np.array([s for _, s in chosen], np.bool_)
        shares = _shares(index, sign, self.table, self.starts, self.weight, self.behind, self.ahead, self.explained)
        return shares + self.price * len(chosen)

    def signed(self, chosen: Choice) -> Signed:
        return tuple((self.primitives[i], s) for i, s in chosen)


Choice = tuple[tuple[int, bool], ...]


def _unborne(primitives: Sequence[Primitive], cloud: Cloud, config: PoolConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Samples of all surfaces that lie off the cloud: points and normals [s, 3], weights [s], and the first of each primitive [p + 1]."""
    rng = np.random.default_rng(0)
    drawn = [leaf_surface(p, config.samples, rng) for p in primitives]
    points, normals = (np.concatenate(c) for c in zip(*drawn, strict=True))
    area = np.repeat([surface_area(p.kind, p.size) / config.samples for p in primitives], config.samples)
    away = cloud.tree.query(points, distance_upper_bound=2.5 * cloud.spacing)[0]
    # of a Poisson process 3 % of the surface lie further than one spacing from every point, and nothing beyond two
    doubt = np.clip(away / cloud.spacing - 1.0, 0.0, 1.0)
    off = doubt > 0
    weight = area * doubt / (len(cloud.points) * cloud.spacing**2)
    starts = np.concatenate([[0], np.cumsum(off.reshape(len(primitives), -1).sum(1))])
    return points[off], normals[off], weight[off], starts


@njit(nogil=True, cache=True)
def _shares(index, sign, table, starts, weight, behind, ahead, explained):  # pragma: no cover - compiled
    k = len(index)
    total = 0.0
    for j in range(table.shape[1]):
        value = explained
        for t in range(k):
            v = table[index[t], j]
            value = min(value, v) if sign[t] else max(value, -v)
        total += min(abs(value), explained)
    cost = total / (explained * table.shape[1])
    for t in range(k):
        for s in range(starts[index[t]], starts[index[t] + 1]):
            within, without = False, False
            for u in range(k):
                if behind[index[u], s]:
                    within = sign[u]
                if ahead[index[u], s]:
                    without = sign[u]
            if within != without:
                cost += weight[s]
    return cost


def best_choice(pool: Pool, start: Choice, config: PoolConfig, widths: tuple[str, ...] = ("own", "pool")) -> tuple[Choice, float]:
    """Local search: of all single changes the best, until none lowers the cost. Changes within the sequence come before those
    that look at the whole pool."""
    best, cost = start, pool.cost(start)
    for _ in range(config.rounds):
        trials = ((c, pool.cost(c)) for width in widths for c in _MOVES[width](pool, best))
        improved = _first_half_best(trials, cost, len(best), pool)
        if improved is None:
            return best, cost
        best, cost = improved
    return best, cost


def _first_half_best(trials: Iterator[tuple[Choice, float]], cost: float, length: int, pool: Pool) -> tuple[Choice, float] | None:
    found = min(trials, key=lambda t: t[1], default=None)
    return found if found is not None and found[1] < cost - 1e-9 else None


def _own_moves(_: Pool, chosen: Choice) -> Iterator[Choice]:
    """Leave one out, turn a sign, move one to another place."""
    for i, (index, sign) in enumerate(chosen):
        rest = chosen[:i] + chosen[i + 1 :]
        if _proper(rest):
            yield rest
        flipped = (*chosen[:i], (index, not sign), *chosen[i + 1 :])
        if _proper(flipped):
            yield flipped
        for j in range(len(chosen)):
            moved = (*rest[:j], (index, sign), *rest[j:])
            if j != i and _proper(moved):
                yield moved


def _pool_moves(pool: Pool, chosen: Choice) -> Iterator[Choice]:
    """Put one in at the end or before the closing run of cuts, or in the place of another."""
    used = {i for i, _ in chosen}
    closing = len(chosen)
    while closing and not chosen[closing - 1][1]:
        closing -= 1
    for index in range(len(pool.primitives)):
        if index in used:
            continue
        for sign in (True, False):
            for at in {closing, len(chosen)}:
                if at or sign:
                    yield (*chosen[:at], (index, sign), *chosen[at:])
        for i, (_, sign) in enumerate(chosen):
            yield (*chosen[:i], (index, sign), *chosen[i + 1 :])


_MOVES = {"own": _own_moves, "pool": _pool_moves}


def _proper(chosen: Choice) -> bool:
    return bool(chosen) and chosen[0][1]


def distinct(primitives: Sequence[Primitive], cloud: Cloud, tolerance: float = 2e-3, count: int = 200) -> list[Primitive]:
    """Without those whose distances to the cloud are, on average, within `tolerance` of the diagonal of an earlier one's."""
    kinds = np.array([KINDS.index(p.kind) for p in primitives])
    params = np.array([(*p.size, *(0.0,) * (3 - len(p.size)), *p.center, *p.rotation) for p in primitives])
    table = kernels.leaf_table(kinds, params, cloud.thinned(count)).astype(np.float32)
    kept: list[int] = []
    for i in range(len(primitives)):
        if not kept or float(np.abs(table[kept] - table[i]).mean(1).min()) > tolerance * cloud.diagonal:
            kept.append(i)
    return [primitives[i] for i in kept]


def axes_of(primitive: Primitive) -> np.ndarray:
    """Local to world [3, 3]."""
    return matrix_from_euler(primitive.rotation)
