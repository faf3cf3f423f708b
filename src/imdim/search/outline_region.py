"""The best region of a plane arrangement: faces with the largest sum of gains, less a price for every curve of their boundary.

With a price for each segment the best region is a minimum cut (Greig, Porteous & Seheult 1989). A curve costs once however many segments
it has, which makes it a cooperative cut (Jegelka & Bilmes 2011): it is minimised by repeated cuts, in which each segment bears the share
of its curve's price that it has under the region before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.search.outline_kernels import count_runs, find_region, mend_region
from imdim.search.outline_plane import OutlinePlane


@dataclass(frozen=True)
class Region:
    """Faces [f] that are `inside`, the sum of their gains, and the number of curves that bound them."""

    inside: np.ndarray
    gain: float
    curves: int


def best_region(plane: OutlinePlane, gains: np.ndarray, price: float, flips: bool = True) -> Region | None:
    """The region that wins most, by gains [f] and a `price` for a curve; None where none wins anything.

    A region that touches itself in a point is mended by its cheapest face. Without `flips` of single faces and moves of whole curves it
    takes a tenth of the time, and is worse.
    """
    gains = np.ascontiguousarray(gains)
    inside, won = find_region(plane.graph, gains, price, flips)
    if won <= 0 or not mend_region(plane.graph, gains, inside):
        return None
    return Region(inside[:-1], float(gains[inside[:-1]].sum()), int(count_runs(plane.graph, inside)))


def count_curves(plane: OutlinePlane, inside: np.ndarray) -> int:
    """The number of lines and arcs that bound a region [f], a full circle counted as one."""
    return int(count_runs(plane.graph, np.append(inside, False)))
