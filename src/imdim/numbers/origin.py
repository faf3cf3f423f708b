"""Where a part's origin was: a part that was moved by a hair has all its places off the grid by the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import COARSE, Values, coarsest_widths, decimal, grids, is_level, round_to_grid, span
from imdim.program.ellipse import Ellipse
from imdim.program.outline import arc_center, loop_curves
from imdim.program.tree import ACROSS, Primitive, Vec3

NEAR = 3e-6  # of the part, within which a place is on a grid: what single precision leaves
MOST = 0.8  # of the places along an axis are on the grid then,
ENOUGH, TIMES = 0.4, 2.0  # or so many where that is so many times as many as from the origin that the part has
SURE_BITS = 20.0  # by which all places along an axis are shorter to write from the other origin, which has to be written too
MOST_ASKED = 24  # places that may tell of the origin
FLAT = 1e-9  # of a line's length, that its ends may differ by along an axis that it is square to


def find_offset(leaves: Sequence[Primitive], most: float) -> Vec3:
    """By how much the places of a part are off the grid along x, y and z, 0 where they tell of none; no more than `most`."""
    size = span(list(leaves))
    x, y, z = (_offset(places, size, most) for places in _places(leaves))
    return x, y, z


def share_round_centers(leaves: Sequence[Primitive], offset: Vec3 = (0.0, 0.0, 0.0)) -> float:
    """The share of the coordinates of centres that are on a grid from an origin at `offset`."""
    centers, size = np.unique(np.round([leaf.center for leaf in leaves], 9), axis=0) - offset, span(list(leaves))
    return float((widths_on_grid(centers.ravel(), size) > 0).mean())


def widths_on_grid(places: np.ndarray, size: float) -> np.ndarray:
    """Of the grid that each of the places [n] of a part as long as `size` is on, 0 where it is on none."""
    slack = NEAR * size
    return coarsest_widths(places, grids(max(size, float(np.abs(places).max(initial=0.0)), COARSE * slack), COARSE * slack), slack)


def _offset(places: np.ndarray, size: float, most: float) -> float:
    """Of the places [n] along one axis."""
    if not len(places):
        return 0.0
    slack = NEAR * size
    widths = grids(max(size, float(np.abs(places).max(initial=0.0)), COARSE * slack), COARSE * slack)
    # most places tell of the offset, if there is one, and so do most of a few
    told_by = places[:: -(-len(places) // MOST_ASKED)].tolist()
    offsets = {decimal(place - round_to_grid(place, width)) for place in told_by for width in widths}
    bits, own = _bits(places, widths, slack)
    if own >= MOST:
        return 0.0  # from another origin they would be shorter, but not rounder
    least, found = bits - SURE_BITS, 0.0
    for offset in sorted(offset for offset in offsets if 0 < abs(offset) <= most):
        bits, share = _bits(places - offset, widths, slack)
        # corners that lean and middles of rounded ones are odd from anywhere
        if bits < least and share >= min(MOST, max(ENOUGH, TIMES * own)):
            least, found = bits, offset
    return found


def _bits(places: np.ndarray, widths: Sequence[float], slack: float) -> tuple[float, float]:
    """What the places cost but for a constant, and the share of them that is on a grid, or a third of one: what is spread evenly over a
    round length is."""
    thirds = coarsest_widths(3 * places, [width for width in widths if width >= 3 * widths[-1]], 3 * slack) / 3
    on = np.maximum(coarsest_widths(places, widths, slack), thirds)
    return -float(np.log2(np.where(on > 0, on, 2 * slack)).sum()), float((on > 0).mean())


def _places(leaves: Sequence[Primitive]) -> Iterator[np.ndarray]:
    """The different places of faces and axes along x, y and z."""
    values = Values.of(list(leaves))
    drawn = [pair for leaf in leaves if leaf.outline is not None and is_level(leaf) for pair in _drawn_places(leaf)]
    for axis in range(3):
        yield np.unique(np.round([*values.numbers[values.classes == axis], *(at for along, at in drawn if along == axis)], 9))


def _drawn_places(leaf: Primitive) -> Iterator[tuple[int, float]]:
    """The axis and the place of each line of an outline that is square to an axis, and of each centre of an arc."""
    frame = np.round(matrix_from_euler(leaf.rotation))
    assert leaf.outline is not None
    for curve in (curve for loop in leaf.outline.loops for curve in loop_curves(loop)):
        # of a turned drawing only heights are places
        for column, value in _curve_places(curve) if leaf.kind in ACROSS else ((2, v) for c, v in _curve_places(curve) if c == 1):
            axis = int(np.abs(frame[:, column]).argmax())
            yield axis, float(leaf.center[axis] + frame[axis, column] * value)


def _curve_places(curve: tuple[float, float, float, float, float] | Ellipse) -> Iterator[tuple[int, float]]:
    if isinstance(curve, Ellipse):
        yield from enumerate((curve.x, curve.y))
    elif curve[4]:
        yield from enumerate(arc_center(curve))
    else:
        (x0, y0, x1, y1, _), flat = curve, FLAT * max(abs(v) for v in curve[:4])
        yield from ((column, a) for column, a, b in ((0, x0, x1), (1, y0, y1)) if abs(a - b) <= flat)
