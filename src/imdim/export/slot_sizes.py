"""A slot with round ends as a person measures it: a width, and a length over both ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from imdim.export.outline_joints import DrawnArc, X, Y
from imdim.program.outline import Outline

ENDS = 2
HALF_TURN = 1e-6  # by which the bulge of a round end may be off


def has_round_ends(outline: Outline) -> bool:
    """Whether an outline is two lines and two half turns, one after the other."""
    loop = outline.loops[0]
    bulges = [abs(vertex[2]) for vertex in loop] if isinstance(loop, tuple) and len(outline.loops) == 1 else []
    starts = (bulges, bulges[1:] + bulges[:1])
    return len(bulges) == 2 * ENDS and any(run[::2] == [0.0, 0.0] and max(abs(b - 1) for b in run[1::2]) <= HALF_TURN for run in starts)


def size_slot(arcs: Sequence[DrawnArc], new: Callable[[str, float], int], slack: float) -> bool:
    """Give the two round ends of a slot, which lie alike about the middle of its drawing, their centres and radii by its width and its
    length, variables that `new` makes of a word and a value; whether these arcs are that."""
    if len(arcs) != ENDS or not all(arc.half for arc in arcs) or abs(arcs[0].radius - arcs[1].radius) > slack:
        return False
    (a, b), (c, d) = (arc.center for arc in arcs)
    if max(abs(a + c), abs(b + d)) > slack or min(abs(a), abs(b)) > slack or max(abs(a), abs(b)) <= slack:
        return False
    along = X if abs(a) > abs(b) else Y
    width = 2 * arcs[0].radius
    across, over = new("width", width), new("length", width + 2 * max(abs(a), abs(b)))
    for arc in arcs:
        side = 0.5 if arc.center[along] > 0 else -0.5
        arc.size = {across: 0.5}
        arc.at[along], arc.at[1 - along] = {over: side, across: -side}, {}
    return True
