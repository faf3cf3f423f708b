"""Chords of drawings where nothing is: the groove in a knob's rim is drawn as the arc that shows and a line beyond the rim.

Without the line it is the whole circle that somebody drew, as are the grooves beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, arc_center, arc_radius, circle, circle_of, nesting, ring_curves
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import Primitive, Program, leaves, replace_leaves

SLACK = 1e-4  # of a radius, within which arcs are of one circle, and corners in it
LEAST = math.radians(60.0)  # of a circle that is drawn: less of one may as well be a rounded corner


def without_hidden_chords(
    program: Program,
    may_hide: Callable[[Primitive, Primitive], bool],
    change: Callable[[Program, int, Primitive], float],
    tolerance: float,
) -> Program:
    """The program with whole circles in place of segments of circles in its extruded outlines, where the volume in which they `change` the
    solid of a program, of whose leaves they replace one, is no more than `tolerance`. It is asked only where a leaf, by what it has more
    with them, `may_hide` in the solid or beside it."""
    for number, leaf in enumerate(leaves(program)):
        for outline in _list_wider(leaf):
            wider = replace(leaf, outline=outline)
            if may_hide(leaf, wider) and change(program, number, wider) <= tolerance:
                program = replace_leaves(program, {number: to_simple(wider) or wider})
                break
    return program


def _list_wider(leaf: Primitive) -> Iterator[Outline]:
    """Outlines with the circles of all segments, or with that of one."""
    if leaf.kind != "extrude" or leaf.outline is None:
        return
    loops = leaf.outline.loops
    sides = nesting(loops)
    whole = {k: found for k, loop in enumerate(loops) if sides[k] > 0 and (found := _complete(loop)) is not None}
    for chosen in ({*whole}, *({k} for k in whole if len(whole) > 1)):
        if chosen:
            yield Outline(tuple(whole[k] if k in chosen else loop for k, loop in enumerate(loops)))


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
