"""Bodies that their cuts part are several bodies.

A search for the shortest program says two countersunk plates on two legs by one block as high as the part, and two cones that take its
middle: their walls lie in the air but for the countersinks, and their radii are of nothing that one sees. So a box, cylinder or extrusion
of which its cuts leave pieces one behind the other becomes these pieces, and each of its cuts is what that takes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from manifold3d import Manifold, OpType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.census import find_pieces
from imdim.geometry.finish.cutter_extent import direction_of, ends_of, round_reach, stretch
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import ALIGNED, NOTHING, TOUCH
from imdim.geometry.solid import primitive_to_manifold, to_manifold
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import FLAT_ENDS, PRISMS, Primitive, Program, combine_all

Span = tuple[float, float]

MOST = 4  # pieces


def part_bodies(program: Program, is_plainer: Callable[[Program, Program], bool], deadline: Deadline = NEVER) -> Program:
    """The program with the pieces of bodies that their own cuts part in place of these, wherever `is_plainer` of the new program and the
    old one holds; that has to tell too whether both are one solid. Past the `deadline` (by default never) the others stay."""
    base, cuts = spine(program)
    terms = parts(base, "union")
    # of a body alone all cuts are its own
    bodies = [spine(term) for term in terms] if len(terms) > 1 else [(base, cuts)]
    for i, (body, own) in enumerate(bodies):
        if deadline.has_passed() or not own or not isinstance(body, Primitive) or body.kind not in PRISMS:
            continue
        for pieces in _parted(body, [cut for joined in own for cut in parts(joined, "union")]):
            joined = combine_all("union", [*terms[:i], *pieces, *terms[i + 1 :]])
            trial = combine_all("difference", [joined, *cuts]) if len(terms) > 1 else joined
            if is_plainer(trial, program):
                return part_bodies(trial, is_plainer, deadline)
    return program


def _parted(body: Primitive, cuts: Sequence[Program]) -> Iterator[list[Program]]:
    """A body less its cuts as pieces one behind the other, along each axis along which it is parted."""
    solids = [to_manifold(cut, CHECK_SEGMENTS) for cut in cuts]
    whole = primitive_to_manifold(body, CHECK_SEGMENTS)
    left = find_pieces(whole - Manifold.batch_boolean(solids, OpType.Add), NOTHING * whole.volume())
    if not 1 < len(left) <= MOST:
        return
    for axis in FLAT_ENDS[body.kind]:
        spans = sorted(_span(piece, body, axis) for piece in left)
        if all(a[1] < b[0] for a, b in pairwise(spans)):
            yield [_cut_piece(stretch(body, axis, span), axis, span, cuts) for span in spans]


def _span(piece: Manifold, body: Primitive, axis: int) -> Span:
    """From where to where a piece goes along a body's axis."""
    low, high = ends_of(body, axis)
    first, last = round_reach(piece, body, axis, high - low)
    slack = TOUCH * (high - low)
    return low if abs(first - low) <= slack else first, high if abs(last - high) <= slack else last


def _cut_piece(piece: Primitive, axis: int, span: Span, cuts: Sequence[Program]) -> Program:
    solid = primitive_to_manifold(piece, CHECK_SEGMENTS)
    taken = [cut for cut in cuts if (to_manifold(cut, CHECK_SEGMENTS) ^ solid).volume() > NOTHING * solid.volume()]
    return combine_all("difference", [piece, *(_clipped(cut, direction_of(piece, axis), span) for cut in taken)])


def _clipped(cut: Program, direction: np.ndarray, span: Span) -> Program:
    """What a cut is within a span along a direction."""
    if not isinstance(cut, Primitive):
        return cut
    for axis in FLAT_ENDS.get(cut.kind, ()):
        if abs(direction_of(cut, axis) @ direction) > 1 - ALIGNED:
            low, high = ends_of(cut, axis)
            return stretch(cut, axis, (max(low, span[0]), min(high, span[1])))
    return cut
