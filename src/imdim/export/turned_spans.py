"""How far the walls of turned drawings, and of cylinders, are from their axes, and from where to where they run along these.

As seen in the half plane beside an axis a wall is a line, whatever is turned: one drawing's walls may run into each other, and a bore into
the wall around it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from imdim.export.drawn_vertex import DrawnVertex
from imdim.export.outline_joints import Row
from imdim.export.outline_rows import Sum
from imdim.export.seats import world_axis
from imdim.export.seen import find_seen_reach
from imdim.export.seen_walls import find_hidden_walls
from imdim.export.spans import Span
from imdim.geometry.solid import exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import curve_bounds, ring_curves
from imdim.program.tree import Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

SAME = 1e-6  # of the largest size, within which axes are one
R, Z = 0, 2  # coordinates of the boxes here: from the axis, and along it


def list_turned_spans(system: LinearSystem, program: Program) -> Iterator[Span]:
    """Of what is seen of drawings that are turned, along both their axes, and of cylinders across theirs.

    Those along the radius are looked at with others about the same axis of the world, those along the axis with the same drawing's.
    Where there are cylinders alone about an axis all their diameters are known, and none follows.
    """
    reach, hidden = find_seen_reach(program), find_hidden_walls(program)
    parts = list(leaves(program))
    if not any(p.kind == "revolve" for p in parts):
        return
    for leaf, part in enumerate(parts):
        if leaf not in reach:
            continue
        along = world_axis(exact_rotation(part)[:, 2])
        about = _axis_of(part, along, SAME * system.length) if along is not None else (-4 - leaf,)
        if part.kind == "revolve" and leaf in system.drawn:
            yield from _spans_of_drawing(system, leaf, part, about, hidden)
        elif part.kind == "cylinder" and along is not None:
            ends = sorted(float(part.center[along]) + side * part.size[1] / 2 for side in (-1, 1))
            low, high = max(ends[0], float(reach[leaf][0][along])), min(ends[1], float(reach[leaf][1][along]))
            yield _radial_span(leaf, part.size[0], {6 * leaf: 1.0}, (low, high), about, system.length)


def _axis_of(part: Primitive, along: int, slack: float) -> tuple[int, ...]:
    """What is equal of leaves that are turned about one axis of the world."""
    return (-1 - along, *(round(part.center[a] / slack / 2) for a in range(3) if a != along))


def _radial_span(leaf: int, radius: float, row: Row, run: tuple[float, float], about: tuple[int, ...], length: float) -> Span:
    low, high = np.array([radius, 0.0, run[0]]), np.array([radius, length, run[1]])
    return Span(leaf, R, low, high, (row, row), ((radius, row), (radius, row)), only=about, is_radial=True)


def _spans_of_drawing(
    system: LinearSystem, leaf: int, part: Primitive, about: tuple[int, ...], hidden: frozenset[tuple[int, int, int]]
) -> Iterator[Span]:
    turn = exact_rotation(part)
    along = world_axis(turn[:, 2])
    way, middle = (1, 0.0) if along is None else (round(turn[along, 2]), float(part.center[along]))
    assert part.outline is not None
    for i, (loop, ring) in enumerate(zip(part.outline.loops, system.drawn[leaf], strict=True)):
        if isinstance(loop, Ellipse) or not isinstance(ring, tuple):
            continue
        for k, curve in enumerate(ring_curves(loop)):
            (left, bottom), (right, top) = curve_bounds([curve])
            if (leaf, i, k) in hidden or right <= 0:
                continue
            start, end = ring[k], ring[(k + 1) % len(ring)]
            run = sorted((middle + way * bottom, middle + way * top))
            low, high = np.array([left, 0.0, run[0]]), np.array([right, system.length, run[1]])
            yield _span(leaf, R, low, high, (start, end), 1, about)
            yield _span(leaf, Z, low, high, (start, end), way, (-1000 - leaf,))


def _span(
    leaf: int,
    axis: int,
    low: np.ndarray,
    high: np.ndarray,
    ends: tuple[DrawnVertex[Sum], DrawnVertex[Sum]],
    way: int,
    only: tuple[int, ...],
) -> Span:
    """Of a line or arc from one end to the other, as seen along an axis, which the drawing's own runs along one way or the other."""
    numbers = sorted((v.x if axis == R else v.y for v in ends), key=lambda n: way * n.value)
    rows = tuple({v: way * c for v, c in n.row.items()} for n in numbers)
    datums = tuple((way * n.value, row) for n, row in zip(numbers, rows, strict=True))
    return Span(leaf, axis, low, high, (rows[0], rows[1]), (datums[0], datums[1]), only=only, is_radial=axis == R)
