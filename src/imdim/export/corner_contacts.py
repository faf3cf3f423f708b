"""Where corners of drawings lie in one place as seen along what they are extruded by: those of later leaves follow those of earlier ones.

Where two drawings share a wall that leans, no plane face says so: its ends do. What is drawn on a corner that there is already stays on it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from imdim.export.drawn_vertex import BendRadius, DrawnVertex
from imdim.export.outline_joints import Row, sum_rows
from imdim.export.outline_rows import Sum
from imdim.export.seen import HAIR
from imdim.export.seen_walls import find_hidden_walls
from imdim.export.spans import LevelDrawing
from imdim.program.ellipse import Ellipse
from imdim.program.outline import circle_of
from imdim.program.tree import Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem


class _LevelCorner(NamedTuple):
    """A corner of a leaf's drawing, that is extruded `along` an axis from where to where: its places along the other two, in the order of
    these, and the variables whose sums they are; and the radius by which it is rounded, if it is."""

    leaf: int
    along: int
    run: tuple[float, float]
    places: tuple[float, float]
    rows: tuple[Row, Row]
    radius: Sum | None


def find_corner_contacts(system: LinearSystem, program: Program) -> tuple[list[tuple[int, Row]], list[Row]]:
    """Of each corner that lies where one of an earlier leaf does, and touches or overlaps that along their axis, its leaf, and how far it
    is from there along both others; of two that are rounded alike there also the difference of the radii."""
    slack = HAIR * system.length
    places, radii = list[tuple[int, Row]](), list[Row]()
    known: dict[tuple[int, int, int], list[_LevelCorner]] = defaultdict(list)
    for corner in _list_corners(system, program):
        cell = [round(place / (4 * slack)) for place in corner.places]
        near = [c for i in (-1, 0, 1) for j in (-1, 0, 1) for c in known.get((corner.along, cell[0] + i, cell[1] + j), ())]
        met = next((c for c in near if c.leaf < corner.leaf and _meet(c, corner, slack)), None)
        if met is not None:
            places += [(corner.leaf, sum_rows((own, 1.0), (other, -1.0))) for own, other in zip(corner.rows, met.rows, strict=True)]
            if corner.radius and met.radius and abs(corner.radius.value - met.radius.value) <= slack:
                radii.append(sum_rows((corner.radius.row, 1.0), (met.radius.row, -1.0)))
        known[corner.along, cell[0], cell[1]].append(corner)
    return places, radii


def _meet(a: _LevelCorner, b: _LevelCorner, slack: float) -> bool:
    apart = max(abs(p - q) for p, q in zip(a.places, b.places, strict=True))
    return apart <= 2 * slack and min(a.run[1], b.run[1]) >= max(a.run[0], b.run[0]) - slack


def _list_corners(system: LinearSystem, program: Program) -> Iterator[_LevelCorner]:
    """The corners of extrusions along the world's axes at which a wall is seen, those that are sums of variables: not where arcs cross
    lines, or end beside them."""
    hidden = find_hidden_walls(program)
    for leaf, part in enumerate(leaves(program)):
        drawing = LevelDrawing.of(leaf, part) if leaf in system.drawn else None
        if drawing is None or part.outline is None:
            continue
        axes = sorted(drawing.axes)
        along = 3 - sum(axes)
        run = part.center[along] - part.size[0] / 2, part.center[along] + part.size[0] / 2
        for i, (loop, ring) in enumerate(zip(part.outline.loops, system.drawn[leaf], strict=True)):
            if isinstance(loop, Ellipse) or not isinstance(ring, tuple) or circle_of(loop):
                continue
            for k, vertex in enumerate(ring):
                before = (k - 1) % len(ring)
                shown = any((leaf, i, wall) not in hidden for wall in (before, k))
                if shown and vertex.reach is None and not any(_is_loose(v) for v in (ring[before], vertex)):
                    at, rows = drawing.place_corner(vertex)
                    radius = vertex.bulge.radius if isinstance(vertex.bulge, BendRadius) else None
                    yield _LevelCorner(leaf, along, run, (at[axes[0]], at[axes[1]]), (rows[axes[0]], rows[axes[1]]), radius)


def _is_loose(vertex: DrawnVertex[Sum]) -> bool:
    """Whether it may be written as the centre of an arc from or to it."""
    return isinstance(vertex.bulge, BendRadius) and vertex.bulge.way != 0
