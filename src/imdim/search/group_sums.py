"""Where groups of families sum the gain of cells: in slots, those of a group one after the other.

The search asks the groups at place after place, where few cells differ from a place that it asked before: the cells that a step covers
alone, those of an edit. So what was summed last is kept (`look_kernels`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from imdim.search.kernels import add_to_slots, add_to_some_slots
from imdim.search.look_kernels import SumTables

MOST_BYTES = 24 * 2**20  # of the sums that are kept
MOST_LOOKS = 64  # that are kept: each new one is compared with all
LEAST_LOOKS = 2  # of which one group's sums are kept: one is carried over to the other


class Slots(NamedTuple):
    """Where one group sums the cells: the slot [m] of each, or with `starts` [m + 1] a list of slots for each; `size` slots in all."""

    slots: np.ndarray
    size: int
    starts: np.ndarray | None = None

    def sum_values(self, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The sums [size] of `values` [k] where `cells` [k] are."""
        sums = np.zeros(self.size)
        if self.starts is None:
            add_to_slots(sums, self.slots, cells, values)
        else:
            add_to_some_slots(sums, self.starts, self.slots, cells, values)
        return sums


def make_tables(sizes: list[int], cells: int) -> SumTables:
    """Tables that know no sums yet, of groups with so many slots and over so many cells."""
    groups, total = len(sizes), max(sum(sizes), 1)
    height = int(np.clip(MOST_BYTES // (8 * total), LEAST_LOOKS, MOST_LOOKS))
    return SumTables(
        np.zeros((MOST_LOOKS, -(-cells // 64)), np.uint64),
        np.zeros(MOST_LOOKS, np.int64),
        np.full((MOST_LOOKS, groups), -1, np.int32),
        np.full((groups, height), -1, np.int32),
        np.empty(height * total),
        np.zeros(MOST_LOOKS, np.int64),
    )
