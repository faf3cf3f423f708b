"""Wider leaves in place of drawings whose other walls nobody sees.

A rib that leans on a round boss is a box, and the groove in a knob's rim, drawn as the arc that shows and a line beyond the rim, is the
whole circle that somebody drew, as are the grooves beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, arc_center, arc_radius, circle, circle_of, flatten_loop, nesting, ring_curves
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import Primitive, Program, leaves, replace_leaves

SEGMENTS = 96  # of a circle, whose extent is that of its corners
DIGITS = 6  # of a direction, which right angles leave as it is
SLACK = 1e-4  # of a radius, within which arcs are of one circle, and corners in it
LEAST = math.radians(60.0)  # of a circle that is drawn: less of one may as well be a rounded corner


def widen(
    program: Program,
    propose: Callable[[Primitive], Iterator[Primitive]],
    may_hide: Callable[[Primitive, Primitive], bool],
    change: Callable[[Program, int, Primitive], float],
    tolerance: float,
) -> Program:
    """The program with wider leaves in place of those for which one is proposed that changes the solid by no more than `tolerance`: by the
    volume in which it does `change` the solid of a program, of whose leaves it replaces one. That is asked only where a wider one,
    by what it has more, `may_hide` in the solid or beside it."""
    for number, leaf in enumerate(leaves(program)):
        for wider in propose(leaf):
            if may_hide(leaf, wider) and change(program, number, wider) <= tolerance:
                program = replace_leaves(program, {number: to_simple(wider) or wider})
                break
    return program


def list_boxes_around(leaf: Primitive) -> Iterator[Primitive]:
    """The boxes around an extruded ring along its longest lines, one each way."""
    if leaf.kind != "extrude" or leaf.outline is None:
        return
    loop, *holes = leaf.outline.loops
    if holes or isinstance(loop, Ellipse):
        return
    lines = sorted((c for c in ring_curves(loop) if not c[4]), key=lambda c: -math.dist(c[:2], c[2:4]))
    seen: set[tuple[float, float]] = set()
    for x, y, u, v, _ in lines:
        turn = math.atan2(v - y, u - x) % (math.pi / 2)
        if (way := (round(math.cos(4 * turn), DIGITS), round(math.sin(4 * turn), DIGITS))) in seen:
            continue
        seen.add(way)
        c, s = math.cos(turn), math.sin(turn)
        along, across = zip(*((c * px + s * py, c * py - s * px) for px, py in flatten_loop(loop, SEGMENTS)), strict=True)
        corners = [
            (a, b) for a, b in ((min(along), min(across)), (max(along), min(across)), (max(along), max(across)), (min(along), max(across)))
        ]
        box = to_simple(replace(leaf, outline=Outline((tuple((c * a - s * b, s * a + c * b, 0.0) for a, b in corners),))))
        if box is not None:
            yield box


def list_with_circles(leaf: Primitive) -> Iterator[Primitive]:
    """An extrusion with whole circles in place of all segments of circles that it is drawn of, or of one."""
    if leaf.kind != "extrude" or leaf.outline is None:
        return
    loops = leaf.outline.loops
    sides = nesting(loops)
    whole = {k: found for k, loop in enumerate(loops) if sides[k] > 0 and (found := _complete(loop)) is not None}
    for chosen in ({*whole}, *({k} for k in whole if len(whole) > 1)):
        if chosen:
            yield replace(leaf, outline=Outline(tuple(whole[k] if k in chosen else loop for k, loop in enumerate(loops))))


def _complete(loop: Loop) -> Loop | None:
    """The circle whose segment a loop is: arcs of it, and lines within it."""
    if isinstance(loop, Ellipse) or circle_of(loop) is not None:
        return None
    arcs = [curve for curve in ring_curves(loop) if curve[4]]
    if not arcs or len(arcs) == len(loop) or sum(4 * math.atan(abs(arc[4])) for arc in arcs) < LEAST:
        return None
    center, radius = arc_center(arcs[0]), arc_radius(arcs[0])
    slack = SLACK * radius
    if any(math.dist(arc_center(arc), center) > slack or abs(arc_radius(arc) - radius) > slack for arc in arcs):
        return None
    return circle(radius, *center) if all(math.dist(place[:2], center) <= radius + slack for place in loop) else None
