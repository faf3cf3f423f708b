"""Whether a part was made in inches: in millimetres its numbers are then multiples of 25.4/2, 25.4/4 and so on, down to 64ths.

Such a multiple is no reason by itself, for 12.7 is a round metric number too, and each number lies near a 64th now and then. What decides
is the length of the description of all numbers of the part: each costs the bits of its place on the coarsest grid that it lies on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from imdim.numbers.design_values import APART, LENGTH, ON_GRID, Values, coarsest_widths, grids, inch_grids, is_level
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, arc_radius, loop_curves
from imdim.program.tree import Primitive

NEAR = 3e-5  # of the largest number, within which one lies on a grid: what meshes of single precision and rough files leave of it
SURE_BITS = 10.0  # by which the description in inches must be shorter
LEAST = 3  # different numbers, that can tell


def are_inches(leaves: Sequence[Primitive]) -> bool:
    """Whether the sizes of a part and the distances between its faces and axes, in millimetres, tell of inches."""
    values = Values.of(list(leaves))
    lengths = [values.numbers[values.classes == LENGTH]]
    for axis in range(3):
        places = values.numbers[values.classes == axis]
        # where the origin lies says nothing of the unit
        lengths += [places - places.min()] if len(places) else []
    lengths += [np.array(list(_drawn_lengths(leaf.outline))) for leaf in leaves if leaf.outline is not None and is_level(leaf)]
    return tell_inches(np.concatenate(lengths))


def tell_inches(numbers: np.ndarray, near: float = NEAR) -> bool:
    """Whether these lengths [n], each known to within `near` of the largest, are shorter to write in inches."""
    largest = float(np.abs(numbers).max(initial=0.0))
    slack = near * largest
    different = _different(np.abs(numbers), slack)
    if len(different) < LEAST:
        return False
    finest = APART * slack
    metric = _bits(different, grids(largest, finest), largest, slack)
    imperial = _bits(different, list(inch_grids(largest, finest)), largest, slack)
    # most numbers of a part in inches are, and some are not
    return float(np.log2(ON_GRID * 2.0 ** (metric - imperial) + 1 - ON_GRID).sum()) > SURE_BITS


def _different(numbers: np.ndarray, slack: float) -> np.ndarray:
    """Those that are neither 0 nor equal, to within the slack."""
    out: list[float] = []
    for number in sorted(numbers[numbers > APART * slack].tolist()):
        if not out or number > out[-1] + 2 * slack:
            out.append(number)
    return np.array(out)


def _bits(numbers: np.ndarray, widths: Sequence[float], largest: float, slack: float) -> np.ndarray:
    """For each number [n] which grid is meant, and its place on the coarsest that it lies on; on none, any place to within the slack."""
    on = coarsest_widths(numbers, widths, slack)
    return np.log2(1 + len(widths)) + np.log2(largest / np.where(on > 0, on, 2 * slack))


def _drawn_lengths(outline: Outline) -> Iterator[float]:
    """Radii, and of lines along the axes how far they are from the lowest."""
    curves = [curve for loop in outline.loops for curve in loop_curves(loop)]
    yield from (arc_radius(curve) for curve in curves if not isinstance(curve, Ellipse) and curve[4])
    low = outline.bounds[0]
    for x0, y0, x1, y1, bulge in (curve for curve in curves if not isinstance(curve, Ellipse)):
        flat = NEAR * math.hypot(x1 - x0, y1 - y0)
        for start, end, least in ((x0, x1, low[0]), (y0, y1, low[1])):
            if not bulge and abs(end - start) <= flat:
                yield (start + end) / 2 - least
