"""Volumetric decision tree: space split by the target's own surfaces until each cell is inside or outside.

A first, rough program for a structure search to start from. The splitting rules are not axis-parallel planes as in a k-d tree but the
detected carriers: the side of a plane, the inside of a sphere, cylinder, cone or torus. `tree_to_csg.py` turns the tree into a program.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.surface import Surface, signed_distance


@dataclass
class DecisionTreeConfig:
    max_depth: int = 24
    max_leaves: int = 128
    min_leaf_weight: float = 2e-4  # of the total weight: smaller cells are not split off
    min_gain: float = 1e-6  # of the total weight, in Gini impurity


@dataclass(frozen=True)
class Leaf:
    """A cell: the label that most of its weight has, and its weights inside and outside the target."""

    inside: bool
    weight_inside: float
    weight_outside: float


@dataclass(frozen=True)
class Split:
    """A cell split by a carrier: `behind` is where its signed distance is negative, `ahead` the rest."""

    surface: Surface
    behind: Tree
    ahead: Tree


Tree = Leaf | Split


def grow(
    points: np.ndarray,
    inside: np.ndarray,
    surfaces: Sequence[Surface],
    weights: np.ndarray | None = None,
    config: DecisionTreeConfig | None = None,
    deadline: Deadline = NEVER,
) -> Tree:
    """The tree of sample `points` [n, 3] with labels `inside` [n] and `weights` [n], the volumes they stand for (equal if None).

    Always the split with the largest gain in weighted Gini impurity comes next, over all cells, so that `max_leaves` keeps
    the best ones; ties go to the earlier cell and surface. Past the `deadline` (by default never) no cell is split any more. Raises
    ValueError where there are no points or the lengths differ.
    """
    weights = np.ones(len(points)) if weights is None else np.asarray(weights, float)
    if not 0 < len(points) == len(inside) == len(weights):
        raise ValueError(f"a decision tree needs as many points as labels and weights, got {len(points)}, {len(inside)}, {len(weights)}")
    growth = _Growth(np.asarray(points, float), np.asarray(inside, bool), weights, list(surfaces), config or DecisionTreeConfig())
    return growth.run(deadline)


@dataclass
class _Cell:
    rows: np.ndarray
    depth: int
    rule: int = -1  # the surface that splits it; -1 for a leaf
    behind: _Cell | None = None
    ahead: _Cell | None = None


class _Growth:
    """Best-first growth: a heap of cells by the gain of their best split."""

    def __init__(self, points: np.ndarray, inside: np.ndarray, weights: np.ndarray, surfaces: list[Surface], config: DecisionTreeConfig):
        self._surfaces, self._config = surfaces, config
        self._mass = np.stack([np.where(inside, weights, 0.0), np.where(inside, 0.0, weights)], axis=1)  # [n, inside and outside]
        self._total = float(weights.sum())
        columns = [signed_distance(s, points) < 0 for s in surfaces]
        self._behind = np.array(columns, bool).reshape(len(surfaces), len(points))
        self._scratch = np.empty(self._behind.size)  # of large parts, fresh memory for each cell takes longer than its sums
        self._heap: list[tuple[float, int, _Cell, int]] = []
        self._number = itertools.count()

    def run(self, deadline: Deadline) -> Tree:
        root = _Cell(np.arange(len(self._mass)), 0)
        self._offer(root)
        cells = 1
        while self._heap and cells < self._config.max_leaves and not deadline.has_passed():
            _, _, cell, rule = heapq.heappop(self._heap)
            side = self._behind[rule, cell.rows]
            cell.rule = rule
            cell.behind, cell.ahead = (_Cell(cell.rows[part], cell.depth + 1) for part in (side, ~side))
            self._offer(cell.behind)
            self._offer(cell.ahead)
            cells += 1
        return self._freeze(root)

    def _offer(self, cell: _Cell) -> None:
        """Queue the best split of a cell, if one is worth it."""
        if cell.depth >= self._config.max_depth or not self._surfaces:
            return
        mass = self._mass[cell.rows]
        all_mass = mass.sum(0)
        chosen = self._scratch[: len(self._surfaces) * len(cell.rows)].reshape(len(self._surfaces), len(cell.rows))
        chosen[:] = self._behind[:, cell.rows]
        behind = chosen @ mass  # [s, 2]
        ahead = all_mass - behind
        gain = _gini(all_mass) - _gini(behind) - _gini(ahead)
        gain[np.minimum(behind.sum(1), ahead.sum(1)) < self._config.min_leaf_weight * self._total] = -np.inf
        best = int(np.argmax(gain))
        if gain[best] > self._config.min_gain * self._total:
            heapq.heappush(self._heap, (-float(gain[best]), next(self._number), cell, best))

    def _freeze(self, cell: _Cell) -> Tree:
        if cell.behind is None or cell.ahead is None:
            w_in, w_out = (float(v) for v in self._mass[cell.rows].sum(0))
            return Leaf(w_in > w_out, w_in, w_out)
        behind, ahead = self._freeze(cell.behind), self._freeze(cell.ahead)
        if isinstance(behind, Leaf) and isinstance(ahead, Leaf) and behind.inside == ahead.inside:
            return Leaf(behind.inside, behind.weight_inside + ahead.weight_inside, behind.weight_outside + ahead.weight_outside)
        return Split(self._surfaces[cell.rule], behind, ahead)


def _gini(mass: np.ndarray) -> np.ndarray:
    """Weight times Gini impurity, 2 w_in w_out / w, of masses [..., 2]."""
    total = mass.sum(-1)
    return 2 * mass[..., 0] * mass[..., 1] / np.maximum(total, 1e-300)
