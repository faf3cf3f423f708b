"""A part in two steps, in the place of one whose sides are their mean: flanges, shoulders and rebates that the noise all but hides.

Nearer than two or three deviations of the noise no point stands out from the side of a part, but along the part the mean distance of many
points from it jumps where a step is. One place of all sides is where this explains most of the squared distances.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import FLAT_ENDS, Combine, Primitive, Program, map_lengths
from imdim.search.mdl.candidates.residual import resize

NEAR = 4.0  # deviations of the noise, within which a point is of a side
CLEAR = 0.5  # deviations of the noise from the ends of a part and the edges of its sides, where other faces have their points
ENDS = 1.0  # the same from the ends of a round part, which its side meets all around
PLACES = 24  # along a part where a step may be
FEWEST = 20  # points of both sides of a step
WORTH = 3.0  # times what the numbers of a step cost: less is not worth a look


class _Side(NamedTuple):
    """Points of one side of a part: where they are `along` it, and how far `off` it outwards, [n]."""

    along: np.ndarray
    off: np.ndarray


def stepped(part: Primitive, points: np.ndarray, sigma: float) -> Iterator[Program]:
    """The box, cylinder or extrusion of one loop as two that meet across one of its axes, each as wide as the `points` [n, 3] beside it
    show; `sigma` is the deviation of their noise. Where one is wider all around, the other goes on through it."""
    drawn = part.kind == "extrude" and part.outline is not None and len(part.outline.loops) == 1
    if not (drawn or part.kind in ("box", "cylinder")) or len(points) < FEWEST:
        return
    rotation = matrix_from_euler(part.rotation)
    local = (points - part.center) @ rotation
    half = _half_sizes(part)
    for k, slot in FLAT_ENDS[part.kind].items():
        sides = _box_sides(local, half, k, sigma) if part.kind == "box" else [_round_side(part, local, half, sigma)]
        place = _find_step(sides, half[k], sigma, len(points))
        if place is None:
            continue
        moves = [[_mean_off(side, below, place) for side in sides] for below in (True, False)]
        ends = [(-half[k], place), (place, half[k])]
        for i in (0, 1):
            if all(a >= b for a, b in zip(moves[i], moves[1 - i], strict=True)):
                ends[1 - i] = (-half[k], half[k])
        first, second = (_widened(part, rotation, (k, slot), span, move) for span, move in zip(ends, moves, strict=True))
        if first is not None and second is not None:
            yield Combine("union", first, second)


def _box_sides(local: np.ndarray, half: np.ndarray, k: int, sigma: float) -> list[_Side]:
    """The four sides along axis k of a box, two for each of the other axes, the lower first."""
    out = []
    for j in (j for j in range(3) if j != k):
        beside = (np.abs(np.delete(local, j, 1)) < np.delete(half, j) - CLEAR * sigma).all(1)
        for sign in (-1, 1):
            off = sign * local[:, j] - half[j]
            own = beside & (np.abs(off) < NEAR * sigma)
            out.append(_Side(local[own, k], off[own]))
    return out


def _half_sizes(part: Primitive) -> np.ndarray:
    if part.outline is not None:
        low, high = part.outline.bounds
        return np.array([(high[0] - low[0]) / 2, (high[1] - low[1]) / 2, part.size[0] / 2])
    return np.array(part.size if part.kind == "box" else (2 * part.size[0], 2 * part.size[0], part.size[1])) / 2


def _round_side(part: Primitive, local: np.ndarray, half: np.ndarray, sigma: float) -> _Side:
    """The side all around a cylinder or an extrusion."""
    if part.outline is not None:
        off = kernels.outline_sdf(Outlines.pack([part.outline]).curves, np.ascontiguousarray(local[:, :2]))
    else:
        off = np.hypot(local[:, 0], local[:, 1]) - half[0]
    own = (np.abs(off) < NEAR * sigma) & (np.abs(local[:, 2]) < half[2] - ENDS * sigma)
    return _Side(local[own, 2], off[own])


def _find_step(sides: list[_Side], half: float, sigma: float, count: int) -> float | None:
    """The place along the part that parts the distances best, None where that is not worth its numbers."""
    places = np.linspace(-half, half, PLACES + 2)[1:-1]
    won, seen = np.zeros(PLACES), np.zeros((2, PLACES), int)
    for along, off in sides:
        order = np.argsort(along, kind="stable")
        below = np.searchsorted(along[order], places)
        sums = np.concatenate([[0.0], np.cumsum(off[order])])
        above, total = len(along) - below, len(along)
        difference = sums[below] / np.maximum(below, 1) - (sums[-1] - sums[below]) / np.maximum(above, 1)
        won += below * above / max(total, 1) * difference**2 / (2 * sigma**2)
        seen += np.array([below, above])
    won[seen.min(0) < FEWEST] = 0.0
    best = int(won.argmax())
    return float(places[best]) if won[best] > WORTH * 0.5 * (len(sides) + 1) * math.log(count) else None


def _mean_off(side: _Side, below: bool, place: float) -> float:
    own = side.off[side.along < place if below else side.along >= place]
    return float(own.mean()) if len(own) else 0.0


def _widened(
    part: Primitive, rotation: np.ndarray, axis: tuple[int, int], ends: tuple[float, float], moves: list[float]
) -> Primitive | None:
    """The part between two `ends` along an `axis`, with its place in the size, its sides moved outwards; None if nothing is left."""
    k, slot = axis
    size, middle = np.array(part.size, float), np.zeros(3)
    size[slot], middle[k] = ends[1] - ends[0], sum(ends) / 2
    if part.outline is not None:
        # about its middle: fits tell the rest
        (low, high), share = part.outline.bounds, 1 + 2 * moves[0] / float(np.ptp(part.outline.bounds, axis=0).mean())
        if share <= 0:
            return None
        moved = map_lengths(part, lambda length: length * share, part.center)
        middle[:2] = (1 - share) * (np.array(low) + np.array(high)) / 2
        part = replace(moved, size=(part.size[0], *part.size[1:]))
    elif part.kind == "cylinder":
        size[0] += moves[0]
    else:
        for j, (low, high) in zip((j for j in range(3) if j != k), (moves[:2], moves[2:]), strict=True):
            size[j] += low + high
            middle[j] = (high - low) / 2
    return resize(part, size, part.center + rotation @ middle) if size.min() > 0 else None
