"""The sides of regular polygons that a search leaves out.

A nut's pocket holds so little of a plate that a search which pays for each curve may draw it with five sides, two of which go on until they
meet. Yet lines that touch one circle, at multiples of a sixth of a turn, are those of a hexagon, whose other side is known, and exact
volumes say whether it is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, loop_area, reverse_ring
from imdim.program.regular_polygon import RegularPolygon
from imdim.program.tree import Primitive, Program, leaves, map_leaves

FEWEST, MOST = 3, 12  # sides that are there, and of the polygon
MISSING = 3  # sides at most
OFF = 2e-3  # of a side's step in direction, and of its distance from the centre, by which it may miss its place
BETTER = 1e-6  # of the IoU, that a polygon has to add


def complete_polygons(program: Program, iou: Callable[[Program], float | None]) -> Program:
    """The program with the missing sides of regular polygons in its extruded drawings, where `iou` with the target is better with them."""
    trials = [(i, k, polygon) for i, leaf in enumerate(leaves(program)) for k, polygon in _find_polygons(leaf)]
    out, best = program, iou(program) if trials else None
    if best is None:
        return program
    for i, k, polygon in trials:
        trial = map_leaves(out, lambda number, leaf, i=i, k=k, p=polygon: _redrawn(leaf, k, p) if number == i else leaf)
        fits = iou(trial)
        if fits is not None and fits > best + BETTER:
            out, best = trial, fits
    return out


def _find_polygons(leaf: Primitive) -> Iterator[tuple[int, RegularPolygon]]:
    """Regular polygons that loops of an extrusion have all sides of but for some, by the number of the loop, those with fewest first."""
    for k, loop in enumerate(leaf.outline.loops if leaf.kind == "extrude" and leaf.outline is not None else ()):
        yield from ((k, polygon) for polygon in _with_more_sides(loop))


def _with_more_sides(loop: Loop) -> Iterator[RegularPolygon]:
    if isinstance(loop, Ellipse) or not FEWEST <= len(loop) < MOST or any(bulge for _, _, bulge in loop):
        return
    corners = np.array([v[:2] for v in (loop if loop_area(loop) > 0 else reverse_ring(loop))])
    way = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([way[:, 1], -way[:, 0]]) / np.linalg.norm(way, axis=1)[:, None]
    # each line lies as far from the centre as the others: that and the centre are the least squares of its equation
    equations = np.column_stack([normals, np.ones(len(loop))])
    away = (normals * corners).sum(1)
    x, y, radius = np.linalg.lstsq(equations, away, rcond=None)[0].tolist()
    if radius <= 0 or np.abs(equations @ (x, y, radius) - away).max() > OFF * radius:
        return
    turns = np.degrees(np.arctan2(normals[:, 1], normals[:, 0]))
    for sides in range(len(loop) + 1, min(len(loop) + MISSING, MOST) + 1):
        steps = (turns - turns[0]) * sides / 360
        if np.abs(steps - np.round(steps)).max() <= OFF and len({round(s) % sides for s in steps.tolist()}) == len(loop):
            yield RegularPolygon(sides, radius / math.cos(math.pi / sides), (x, y), float(turns[0]) + 180 / sides)


def _redrawn(leaf: Primitive, number: int, polygon: RegularPolygon) -> Primitive:
    """The leaf with a regular polygon in place of a loop."""
    assert leaf.outline is not None
    rings = list(leaf.outline.loops)
    rings[number] = polygon.ring() if loop_area(rings[number]) > 0 else reverse_ring(polygon.ring())
    return replace(leaf, outline=Outline(tuple(rings)))
