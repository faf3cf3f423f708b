"""The leaf table of a population, kept between generations: one row per primitive, computed once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np

from imdim.geometry.rotations import matrices_from_euler
from imdim.program.tree import KINDS, Primitive
from imdim.search.evolve.kernels import fill_bits, fill_distances

_CODES = {kind: i for i, kind in enumerate(KINDS)}


class Columns:
    """Rows over fixed `points` [n, 3]: signed distances float32 [n], or occupancy bits uint64 [ceil(n / 64)], low bit first.

    Rows beyond `capacity` take the place of those that were least recently asked for.
    """

    def __init__(self, points: np.ndarray, content: Literal["distances", "bits"], capacity: int = 4096) -> None:
        self.content = content
        self.count = len(points)
        pad = -len(points) % 64 if content == "bits" else 0
        # padding lies too far away for any leaf
        padded = np.concatenate([np.asarray(points, float), np.full((pad, 3), 1e9)])
        self._xyz = np.ascontiguousarray(padded.T, np.float32)
        self._width = len(padded) // 64 if content == "bits" else len(padded)
        self.table = self._empty(capacity)
        self._rows: dict[Primitive, int] = {}  # in the order of use
        self._free = list(range(capacity))[::-1]

    def __len__(self) -> int:
        return len(self._rows)

    def rows(self, primitives: Iterable[Primitive]) -> dict[Primitive, int]:
        """The row of `table` of each of `primitives`; missing ones are computed in one call."""
        wanted = dict.fromkeys(primitives)
        found = {p: row for p in wanted if (row := self._rows.pop(p, None)) is not None}
        missing = [p for p in wanted if p not in found]
        self._make_room(len(missing), len(found))
        fresh = {p: self._free.pop() for p in missing}
        self._fill(fresh)
        self._rows.update(found)
        self._rows.update(fresh)
        return {**found, **fresh}

    def _make_room(self, needed: int, held: int) -> None:
        while len(self._free) < needed and self._rows:
            self._free.append(self._rows.pop(next(iter(self._rows))))
        if len(self._free) < needed:
            size = max(2 * len(self.table), needed + held)
            self._free += range(len(self.table), size)
            self.table = np.concatenate([self.table, self._empty(size - len(self.table))])

    def _empty(self, size: int) -> np.ndarray:
        return np.empty((size, self._width), np.uint64 if self.content == "bits" else np.float32)

    def _fill(self, fresh: dict[Primitive, int]) -> None:
        if not fresh:
            return
        kinds = np.array([_CODES[p.kind] for p in fresh], np.int64)
        numbers = np.array([(*p.size, *(0.0,) * (3 - len(p.size)), *p.center, *p.rotation) for p in fresh])
        axes = matrices_from_euler(numbers[:, 6:9]).transpose(0, 2, 1).reshape(-1, 9)
        leaves = np.concatenate([numbers[:, :6], axes], axis=1).astype(np.float32)
        fill = fill_bits if self.content == "bits" else fill_distances
        fill(kinds, leaves, self._xyz, np.array(list(fresh.values()), np.int64), self.table)

    def unpacked(self, words: np.ndarray) -> np.ndarray:
        """Bits [..., w] as bool [..., n]."""
        return np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=-1, bitorder="little")[..., : self.count].view(bool)


def packed(flags: np.ndarray) -> np.ndarray:
    """Flags [n] as words [ceil(n / 64)], low bit first."""
    padded = np.concatenate([flags, np.zeros(-len(flags) % 64, bool)])
    return np.packbits(padded, bitorder="little").view(np.uint64)
