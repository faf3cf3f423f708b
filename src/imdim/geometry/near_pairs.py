"""Which of some points lie near one another: few at a time, for which neither a tree nor a grid is worth building."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from imdim.geometry.rows import lengths


def near_pairs(points: np.ndarray, reach: float) -> Iterator[tuple[int, int]]:
    """The numbers of points [n, 3] no further apart than `reach`, the lower first, in order."""
    order = np.argsort(points[:, 0], kind="stable")
    along = points[order, 0]
    ends = np.searchsorted(along, along + reach, side="right")
    found = []
    for k, end in enumerate(ends.tolist()):
        others = order[k + 1 : end]
        near = others[lengths(points[others] - points[order[k]]) <= reach] if len(others) else others
        found += [(min(int(order[k]), j), max(int(order[k]), j)) for j in near.tolist()]
    yield from sorted(found)
