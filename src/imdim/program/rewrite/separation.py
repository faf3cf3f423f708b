"""Drawings taken apart: loops that are features of their own become features.

An outline of a plate may hold its four bolt holes and fifteen windows, and one of islands a row of ribs. To whom it is a part, a plate is a
plate, and its holes are cut into it: each has its own numbers, is moved by itself, and a row of them is one loop of a script.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, is_in_loop, regions, start_of
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import OPS, Combine, Primitive, Program, combine_all, fold
from imdim.program.vectors import along


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


def _separate(leaf: Primitive) -> Program:
    if leaf.outline is None:
        return leaf
    if leaf.kind == "drafted":  # a hole in what leans inward gets wider, one of its own narrower
        return combine_all("union", [_redraw(leaf, region) for region in regions(leaf.outline)])
    return combine_all("union", [_separate_holes(leaf, [outer], holes) for outer, *holes in regions(leaf.outline)])


def _redraw(leaf: Primitive, region: tuple[Loop, ...]) -> Primitive:
    """One area of what is drafted, about its own middle."""
    outline = Outline(region)
    (left, low), (right, high) = outline.bounds
    x, y, (u, v, _) = (left + right) / 2, (low + high) / 2, axes(leaf)
    return replace(leaf, center=along(along(leaf.center, u, x), v, y), outline=outline.shift(-x, -y))


def _separate_all_holes(leaf: Primitive) -> Program:
    if leaf.outline is None or leaf.kind == "drafted":
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
