"""Cylinders that touch all round, such as a plug in its hole: they have one axis and one radius, and an edit keeps both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from imdim.export.outline_joints import Row
from imdim.export.outline_walls import EXACT
from imdim.export.seats import world_axis
from imdim.geometry.solid import exact_rotation
from imdim.program.tree import Primitive, longest


def bind_plugs(parts: Sequence[Primitive], sources: Sequence[int]) -> Iterator[Row]:
    """Equal radii and places of cylinders along a world axis that have one wall and meet in it; copies follow their `sources`."""
    slack = EXACT * longest(parts)
    level = [(i, world_axis(exact_rotation(p)[:, 2])) for i, p in enumerate(parts) if p.kind == "cylinder" and sources[i] == i]
    for (a, axis), (b, other) in combinations(level, 2):
        if axis is not None and axis == other and _meet(parts[a], parts[b], axis, slack):
            yield {6 * a: 1.0, 6 * b: -1.0}
            yield from ({6 * a + 3 + i: 1.0, 6 * b + 3 + i: -1.0} for i in range(3) if i != axis)


def _meet(a: Primitive, b: Primitive, axis: int, slack: float) -> bool:
    apart = np.abs(np.subtract(a.center, b.center))
    along, apart[axis] = float(apart[axis]), 0.0
    return bool(abs(a.size[0] - b.size[0]) <= slack and apart.max() <= slack and along <= (a.size[1] + b.size[1]) / 2 + slack)
