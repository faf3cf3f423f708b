"""Sums of the gain over the slots of every group of families, carried over from looks at nearly the same cells.

The search asks the groups at place after place, where few cells differ from a place that it asked before: the cells that a step covers
alone, those of an edit. Sums of gains are exact in any order (`Cells.gain_under`), so the cells that differ are all that need be added.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from imdim.search.kernels import add_to_slots, add_to_some_slots, count_apart, list_changes

MOST_BYTES = 24 * 2**20  # of the sums that are kept
MOST_LOOKS = 64  # that are kept: each new one is compared with all
COPY = 0.1  # of a slot: what it takes to copy one, in cells added


class Slots(NamedTuple):
    """Where one group sums the cells: the slot [m] of each, or with `starts` [m + 1] a list of slots for each; `size` slots in all."""

    slots: np.ndarray
    size: int
    starts: np.ndarray | None = None

    def sum_changes(self, before: np.ndarray, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The sums `before` [size] with `values` [k] added where `cells` [k] are."""
        if self.starts is None:
            return add_to_slots(before, self.slots, cells, values)
        return add_to_some_slots(before, self.starts, self.slots, cells, values)

    def sum_values(self, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The sums [size] of `values` [k] where `cells` [k] are."""
        return self.sum_changes(np.zeros(self.size), cells, values)


@dataclass(frozen=True, eq=False)
class _Look:
    """Sums [size] of the gain over some cells, by group as far as they were asked; `row` is that of the flags of the cells among those of
    all looks that are kept."""

    changeable: np.ndarray
    row: int
    sums: dict[int, np.ndarray] = field(default_factory=dict)


class GroupSums:
    """The sums of one `gain` [m] over the slots of groups; what was summed last is kept."""

    def __init__(self, gain: np.ndarray) -> None:
        self.gain = gain
        self._kept: list[_Look] = []
        self._bits = np.zeros((MOST_LOOKS + 1, -(-len(gain) // 64)), np.uint64)
        self._rows = np.zeros(MOST_LOOKS + 1, np.int64)  # of the flags of each kept look
        self._free = list(range(MOST_LOOKS + 1))  # rows
        self._bytes = 0

    def look(self, changeable: np.ndarray) -> FieldSums:
        """The sums over the cells that are `changeable` [m]."""
        row, packed = self._free[-1], np.packbits(changeable)
        self._bits[row].view(np.uint8)[: len(packed)] = packed
        kept = list(self._kept)
        apart = count_apart(self._bits, self._rows[: len(kept)], row)
        nearest = int(apart.argmin()) if kept else 0
        if kept and apart[nearest] == 0:
            self._append(self._drop(nearest))
            return FieldSums(self, kept[nearest], kept, apart)
        look = _Look(changeable, self._free.pop())
        self._append(look)
        self.keep(changeable)
        return FieldSums(self, look, kept, apart)

    def _append(self, look: _Look) -> None:
        self._rows[len(self._kept)] = look.row
        self._kept.append(look)

    def _drop(self, i: int) -> _Look:
        self._rows[i:-1] = self._rows[i + 1 :]
        return self._kept.pop(i)

    def keep(self, more: np.ndarray) -> None:
        """Count what is kept, and forget the looks that were not asked for longest where that is too much."""
        self._bytes += more.nbytes
        while len(self._kept) > 1 and (self._bytes > MOST_BYTES or len(self._kept) > MOST_LOOKS):
            oldest = self._drop(0)
            self._bytes -= sum(known.nbytes for known in (oldest.changeable, *oldest.sums.values()))
            self._free.append(oldest.row)


class FieldSums:
    """The sums of one look, found where they are asked for: from the nearest of the `others` that knows them, of which each is so many
    cells `apart` [k] from it, or from all cells."""

    def __init__(self, owner: GroupSums, look: _Look, others: list[_Look], apart: np.ndarray) -> None:
        self._owner, self._look, self._others, self._apart = owner, look, others, apart
        self._changes: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._all: tuple[np.ndarray, np.ndarray] | None = None  # the cells, and what each adds

    def of(self, group: int, slots: Slots) -> np.ndarray:
        """The sums [size] of one group; not to be changed."""
        known = self._look.sums.get(group)
        if known is None:
            known = self._look.sums[group] = self._sum(group, slots)
            self._owner.keep(known)
        return known

    def _sum(self, group: int, slots: Slots) -> np.ndarray:
        if self._all is None:
            cells = np.flatnonzero(self._look.changeable)
            self._all = cells, self._owner.gain[cells]
        near = next((look for look in self._nearest_first if group in look.sums), None)
        if near is not None:
            cells, values = self._changes_from(near)
            if len(cells) + COPY * slots.size < len(self._all[0]):
                return slots.sum_changes(near.sums[group], cells, values)
        return slots.sum_values(*self._all)

    @cached_property
    def _nearest_first(self) -> list[_Look]:
        return [self._others[i] for i in np.argsort(self._apart, kind="stable").tolist()]

    def _changes_from(self, look: _Look) -> tuple[np.ndarray, np.ndarray]:
        """The cells that differ from another look, and what each adds."""
        found = self._changes.get(id(look))
        if found is None:
            found = self._changes[id(look)] = list_changes(look.changeable, self._look.changeable, self._owner.gain)
        return found
