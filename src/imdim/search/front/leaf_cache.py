"""The leaf table of a population, kept between generations: one row per primitive, computed once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines, pack_all
from imdim.geometry.rotations import matrices_from_euler
from imdim.program.tree import SIMPLE, Primitive
from imdim.search.bits import pack_words
from imdim.search.front.kernels import fill_bits, fill_distances


class Registry:
    """Numbers for primitives, equal ones sharing theirs, in the order in which they were first seen."""

    def __init__(self) -> None:
        self.ids: dict[Primitive, int] = {}
        self.primitives: list[Primitive] = []
        self._kinds, self._leaves = np.zeros(0, np.int64), np.zeros((0, 15), np.float32)

    def id(self, primitive: Primitive) -> int:
        # one look-up: hashing a primitive costs as much as folding it at a thousand points
        new = len(self.primitives)
        found = self.ids.setdefault(primitive, new)
        if found == new:
            self.primitives.append(primitive)
        return found

    def lower_rows(self, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Kinds [k] and rows [k, 15] of the kernels for some primitives; computed once for all tables."""
        fresh = self.primitives[len(self._kinds) :]
        if fresh:
            kinds, params = pack_all(fresh)
            axes = matrices_from_euler(params[:, 6:]).transpose(0, 2, 1).reshape(-1, 9)
            self._kinds = np.append(self._kinds, kinds)
            self._leaves = np.concatenate([self._leaves, np.concatenate([params[:, :6], axes], axis=1).astype(np.float32)])
        return self._kinds[ids], self._leaves[ids]


class LeafCache:
    """Rows over fixed `points` [n, 3]: signed distances float32 [n], or occupancy bits uint64 [ceil(n / 64)] (see `bits`).

    Rows beyond `capacity` take the place of those that were least recently asked for.
    """

    def __init__(self, points: np.ndarray, content: Literal["distances", "bits"], registry: Registry, capacity: int = 4096) -> None:
        self.content, self.registry = content, registry
        self.count = len(points)
        pad = -len(points) % 64 if content == "bits" else 0
        # padding lies too far away for any leaf
        padded = np.concatenate([np.asarray(points, float), np.full((pad, 3), 1e9)])
        self._xyz = np.ascontiguousarray(padded.T, np.float32)
        self._width = len(padded) // 64 if content == "bits" else len(padded)
        self.table = self._empty(capacity)
        self._row = np.zeros(0, np.int64)  # of each id, -1 where it has none
        self._id = np.full(capacity, -1)  # of each row, -1 where it is free
        self._used = np.zeros(capacity, np.int64)  # when each row was last asked for
        self._time = 0

    def __len__(self) -> int:
        return int((self._id >= 0).sum())

    def rows(self, ids: np.ndarray) -> np.ndarray:
        """The rows [k] of `table` of the primitives with these ids [k]; missing ones are computed in one call."""
        self._time += 1
        self._row = np.concatenate([self._row, np.full(max(len(self.registry.primitives) - len(self._row), 0), -1)])
        rows = self._row[ids]
        self._used[rows[rows >= 0]] = self._time
        missing = np.unique(ids[rows < 0])
        if len(missing):
            self._fill(missing, self._room(len(missing)))
            rows = self._row[ids]
        return rows

    def of(self, primitives: Iterable[Primitive]) -> np.ndarray:
        """The rows' content [k, ...] for some primitives."""
        # the table may be replaced by a longer one when rows are asked for
        rows = self.rows(np.array([self.registry.id(p) for p in primitives], np.int64))
        return self.table[rows]

    def _room(self, needed: int) -> np.ndarray:
        """Rows [needed] to write into: free ones, then the least recently used; more of them where all were asked for just now."""
        idle = np.flatnonzero((self._id < 0) | (self._used < self._time))
        if len(idle) < needed:
            more = max(len(self.table), needed)
            self.table = np.concatenate([self.table, self._empty(more)])
            self._id, self._used = np.append(self._id, np.full(more, -1)), np.append(self._used, np.zeros(more, np.int64))
            idle = np.flatnonzero((self._id < 0) | (self._used < self._time))
        age = np.where(self._id[idle] < 0, -1, self._used[idle])
        return idle[np.argsort(age, kind="stable")[:needed]]

    def _empty(self, size: int) -> np.ndarray:
        return np.empty((size, self._width), np.uint64 if self.content == "bits" else np.float32)

    def _fill(self, ids: np.ndarray, rows: np.ndarray) -> None:
        displaced = self._id[rows]
        self._row[displaced[displaced >= 0]] = -1
        self._row[ids], self._id[rows], self._used[rows] = rows, ids, self._time
        kinds, leaves = self.registry.lower_rows(ids)
        fill = fill_bits if self.content == "bits" else fill_distances
        simple = kinds < len(SIMPLE)
        fill(kinds[simple], leaves[simple], self._xyz, rows[simple], self.table)
        if not simple.all():
            self._fill_outlined(ids[~simple], rows[~simple])

    def _fill_outlined(self, ids: np.ndarray, rows: np.ndarray) -> None:
        """Outlines have no loop in single precision: theirs is that of `geometry`, which knows what they hold long before distances."""
        parts, points = [self.registry.primitives[i] for i in ids], self._xyz.T.astype(float)
        if self.content == "bits":
            self.table[rows] = pack_words(kernels.inside_each(parts, points))
        else:
            self.table[rows] = kernels.leaf_table(*pack_all(parts), points, Outlines.of(parts))
