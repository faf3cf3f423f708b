"""From soft matrices to binary ones: thresholds, then single entries changed while that lowers error + price * length.

The paper thresholds alone. What a threshold leaves - idle primitives, intersections that others hold, a node too many - is removed by exact
counting over the samples, so the result explains them at least as well per primitive as the thresholded one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.program.stump import CsgStump
from imdim.program.tree import Primitive

SWEEPS = 12
STARTS = 4
LEAST_GAIN = 1e-9


@dataclass(frozen=True)
class LabelledPoints:
    """Points [n, 3] and the volume [n] inside and outside the target that each stands for."""

    points: np.ndarray
    w_in: np.ndarray
    w_out: np.ndarray

    @property
    def value(self) -> np.ndarray:
        """What holding each point wins [n], relative to the target's volume."""
        return (self.w_in - self.w_out) / self.w_in.sum()

    def some(self, rows: np.ndarray) -> LabelledPoints:
        """Some points, which stand for as much volume as all."""
        share = len(self.points) / len(rows)
        return LabelledPoints(self.points[rows], self.w_in[rows] * share, self.w_out[rows] * share)


@dataclass
class Matrices:
    """W_C `complement` bool [K], W_I `connection` bool [C, K], W_U `union` bool [C]."""

    complement: np.ndarray
    connection: np.ndarray
    union: np.ndarray

    def contains(self, columns: np.ndarray) -> np.ndarray:
        """Which points the solid holds, bool [n], from those that each primitive holds, bool [K, n]."""
        misses = self.connection.astype(np.float32) @ (columns == self.complement[:, None]).astype(np.float32)
        return (misses[self.union] == 0).any(0)


def improve(matrices: Matrices, columns: np.ndarray, labels: LabelledPoints, price: float) -> Matrices:
    """Fewer or other entries: error + `price` per entry of W_I never rises. W_C stays as it is.

    `columns` bool [K, n] are the points that each primitive holds; one node at least is plain. A solid that is nowhere worth its price
    becomes the best single plain primitive.
    """
    descent = _FlipDescent(matrices, columns, labels.value.astype(np.float32), price)
    for _ in range(SWEEPS):
        if not descent.sweep():
            break
    return descent.result()


class _FlipDescent:
    def __init__(self, matrices: Matrices, columns: np.ndarray, value: np.ndarray, price: float) -> None:
        self.complement, self.value, self.price = matrices.complement, value, price
        self.connection = matrices.connection.copy()
        self.missing = (columns == self.complement[:, None]).astype(np.float32)  # 1 where a node lacks a point
        # an intersection of complements alone is unbounded
        bounded = self.connection[:, ~self.complement].any(1)
        self.connection[~bounded], self.union = False, matrices.union & bounded
        self.misses = self.connection.astype(np.float32) @ self.missing
        self.cover = (self.misses[self.union] == 0).sum(0)

    def sweep(self) -> bool:
        """Look at every intersection once; whether anything changed."""
        return sum(self._revise(c) for c in range(len(self.union))) > 0

    def _revise(self, c: int) -> bool:
        """Better one intersection; one that is not in the union or not worth it begins again from each of the fullest primitives."""
        before = (self.connection[c].copy(), bool(self.union[c]))
        self.cover -= self.union[c] & (self.misses[c] == 0)
        free = self.value * (self.cover == 0)
        gain, row, misses = self._descend(self.connection[c], free) if self.union[c] else (0.0, self.connection[c], self.misses[c])
        if gain <= LEAST_GAIN:
            gain, row, misses = max((self._descend(start, free) for start in self._starts(free)), key=lambda found: found[0])
        self.connection[c], self.misses[c], self.union[c] = row, misses, gain > LEAST_GAIN
        self.cover += self.union[c] & (misses == 0)
        return bool(self.union[c]) != before[1] or (before[1] and bool((row != before[0]).any()))

    def _starts(self, free: np.ndarray) -> np.ndarray:
        """Rows [STARTS, K] of the plain primitives that hold most of what is still to be held."""
        full = np.where(self.complement, -np.inf, -(self.missing @ np.maximum(free, 0)))
        chosen = np.argsort(-full)[: min(STARTS, int((~self.complement).sum()))]
        return np.arange(len(full)) == chosen[:, None]

    def _descend(self, row: np.ndarray, free: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """An intersection after the best flips: what it wins, its row, and how many of its nodes lack each point."""
        row, misses = row.copy(), row.astype(np.float32) @ self.missing
        while (k := self._best_flip(row, misses, free)) is not None:
            misses += -self.missing[k] if row[k] else self.missing[k]
            row[k] = not row[k]
        return float(free @ (misses == 0)) - self.price * float(row.sum()), row, misses

    def _best_flip(self, row: np.ndarray, misses: np.ndarray, free: np.ndarray) -> int | None:
        """The entry whose change wins most, if any wins."""
        adding = -(self.missing @ (free * (misses == 0))) - self.price
        leaving = self.missing @ (free * (misses == 1)) + self.price
        gain = np.where(row, leaving, adding)
        plain = row & ~self.complement
        if plain.sum() == 1:
            gain[plain] = -np.inf
        best = int(np.argmax(gain))
        return best if gain[best] > LEAST_GAIN else None

    def result(self) -> Matrices:
        if not self.union.any():
            worth = np.where(self.complement, -np.inf, (1 - self.missing) @ self.value)
            self.connection[0], self.union[0] = np.arange(len(worth)) == int(np.argmax(worth)), True
        return Matrices(self.complement, self.connection, self.union)


def find_used(matrices: Matrices) -> tuple[np.ndarray, np.ndarray]:
    """Rising indices of the primitives and of the intersections that the solid depends on."""
    terms = np.flatnonzero(matrices.union)
    return np.flatnonzero(matrices.connection[terms].any(0)), terms


def to_stump(primitives: list[Primitive], matrices: Matrices) -> CsgStump:
    """The project's CSG-Stump of what is used."""
    kept, terms = find_used(matrices)
    connection = matrices.connection[np.ix_(terms, kept)].T.astype(int).tolist()
    complement = tuple(int(matrices.complement[k]) for k in kept)
    return CsgStump(tuple(primitives[k] for k in kept), complement, tuple(tuple(row) for row in connection), (1,) * len(terms))
