"""Outlines as their polyhedra have them, and a little narrower, for regions that keep clear of the walls of an extrusion."""

from __future__ import annotations

import math
from dataclasses import replace

from manifold3d import JoinType

from imdim.geometry.solid import draw_section
from imdim.program.outline import MOST_CURVES, Outline, flatten_loop
from imdim.program.tree import Primitive

CHECK_SEGMENTS = 64


def extent(outline: Outline) -> float:
    """The diagonal of its bounding box."""
    return math.dist(*outline.bounds)


def inset(leaf: Primitive, by: float) -> Primitive:
    """An extrusion whose walls lie further inside; half as far, and so on, where that leaves too little, and at last as they are."""
    outline = leaf.outline
    assert outline is not None
    section = draw_section(outline, CHECK_SEGMENTS)
    for part in (by, by / 2, by / 4):
        loops = [tuple((float(x), float(y), 0.0) for x, y in loop) for loop in section.offset(-part, JoinType.Miter).to_polygons()]
        if loops and sum(map(len, loops)) <= MOST_CURVES and 2 * (area := Outline(tuple(loops))).area >= outline.area:
            return replace(leaf, outline=area)
    return leaf


def flatten(outline: Outline, across: float = 1.0) -> Outline:
    """With the corners of its polyhedron in place of arcs, its x coordinates times `across`; as it is where these are too many."""
    loops = tuple(tuple((across * x, y, 0.0) for x, y in flatten_loop(loop, CHECK_SEGMENTS)) for loop in outline.loops)
    return Outline(loops) if sum(map(len, loops)) <= MOST_CURVES and all(len(loop) > 2 for loop in loops) else outline
