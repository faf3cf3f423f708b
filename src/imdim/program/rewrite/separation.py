"""Drawings taken apart: loops that are features of their own become features.

An outline of a plate may hold its four bolt holes and fifteen windows, and one of islands a row of ribs. To whom it is a part, a plate is a
plate, and its holes are cut into it: each has its own numbers, is moved by itself, and a row of them is one loop of a script.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, flatten_loop, is_in_loop, regions, ring_curves, start_of
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import OPS, Combine, Primitive, Program, combine_all, fold, leaves, replace_leaves

SEGMENTS = 96  # of a circle, whose extent is that of its corners
DIGITS = 6  # of a direction, which right angles leave as it is


def separate_loops(program: Program) -> Program:
    """The same solid, with each area of an outline as a feature, and each hole of it cut that is one of the six kinds or an ellipse.

    What is neither stays in its outline. A cutter is as deep as what it cuts; whoever delivers it lets it stand out.
    """
    return fold(program, lambda _, leaf: _separate(leaf), {op: partial(Combine, op) for op in OPS})


def separate_holes(program: Program) -> Program:
    """As `separate_loops`, but areas stay together that are drawn together, unless one is in another."""
    return fold(program, lambda _, leaf: _separate_all_holes(leaf), {op: partial(Combine, op) for op in OPS})


def hoist_cuts(program: Program, is_free: Callable[[Program], bool]) -> Program:
    """(A - C) | B as (A | B) - C, body first and then what is cut into it, for each cut that `is_free`: none of it is in the solid, so it
    takes nothing from B."""
    base, cuts = spine(program)
    bases: list[Program] = []
    for term in parts(base, "union"):
        inner, own = spine(term)
        each = [cut for joined in own for cut in parts(joined, "union")]
        free = [is_free(cut) for cut in each]
        bases.append(combine_all("difference", [inner, *(cut for cut, out in zip(each, free, strict=True) if not out)]))
        cuts = [*(cut for cut, out in zip(each, free, strict=True) if out), *cuts]
    return combine_all("difference", [combine_all("union", bases), *cuts])


def straighten(
    program: Program,
    may_hide: Callable[[Primitive, Primitive], bool],
    change: Callable[[Program, int, Primitive], float],
    tolerance: float,
) -> Program:
    """Boxes in place of drawings whose other walls are hidden, such as a rib's end in the round boss that it leans on, where the volume in
    which they `change` the solid of a program, of whose leaves they replace one, is no more than `tolerance`. It is asked only where a
    leaf's box, by what it has more than the leaf, `may_hide` in the solid or beside it."""
    for i, leaf in enumerate(leaves(program)):
        for box in _boxes_around(leaf):
            if may_hide(leaf, box) and change(program, i, box) <= tolerance:
                program = replace_leaves(program, {i: box})
                break
    return program


def _boxes_around(leaf: Primitive) -> Iterator[Primitive]:
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


def _separate(leaf: Primitive) -> Program:
    if leaf.outline is None:
        return leaf
    return combine_all("union", [_separate_holes(leaf, [outer], holes) for outer, *holes in regions(leaf.outline)])


def _separate_all_holes(leaf: Primitive) -> Program:
    if leaf.outline is None:
        return leaf
    outers, holes = zip(*((outer, holes) for outer, *holes in regions(leaf.outline)), strict=True)
    if any(is_in_loop(a, *start_of(b)) for a in outers for b in outers if a is not b):
        return leaf
    return _separate_holes(leaf, outers, [hole for own in holes for hole in own])


def _separate_holes(leaf: Primitive, outers: Sequence[Loop], holes: Sequence[Loop]) -> Program:
    cutters = {hole: _cutter(replace(leaf, outline=Outline((hole,))), hole) for hole in holes}
    kept = [hole for hole, cutter in cutters.items() if cutter is None]
    body = replace(leaf, outline=Outline((*outers, *kept)))
    return combine_all("difference", [to_simple(body) or body, *(cutter for cutter in cutters.values() if cutter is not None)])


def _cutter(alone: Primitive, hole: Loop) -> Primitive | None:
    """What cuts a hole that is drawn `alone`; an ellipse is one curve of five numbers, as plain to read as a circle."""
    return alone if isinstance(hole, Ellipse) and alone.kind == "extrude" else to_simple(alone)
