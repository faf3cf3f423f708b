"""A step that should keep the solid is taken as far as it does: exact booleans judge all that it changes at once.

What each primitive may do while the others stay says nothing of what all may do together: of parts with one end in common each alone may
reach further, since the others hold it.
"""

from __future__ import annotations

from collections.abc import Sequence

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.lowering import postfix
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.numbers.snap import accept_changes
from imdim.program.tree import Program, leaves, map_leaves

SAME = 5e-4  # of the volume, in which solids may differ and still count as one
COARSE, FINE = CHECK_SEGMENTS, 192  # of a circle; fine ones decide where coarse ones say no: what is turned has its corners elsewhere
FAR = 0.05  # of the volume, in which solids differ by more than their facets
TRIES = 24  # solids that are made to find what of a step can be taken


def preserve(
    before: Program,
    after: Program,
    tolerance: float = SAME,
    together: Sequence[Sequence[int]] | None = None,
    deadline: Deadline = NEVER,
) -> Program:
    """`after` if its solid is that of `before` up to `tolerance` of the volume, else as much of it as keeps the solid.

    Of a step that changed numbers alone, primitives are held back by halves; those of one row of `together` move at once or not at all.
    Another structure is taken whole or not, and so is any step past the `deadline` (by default never).
    """
    old, new = list(leaves(before)), list(leaves(after))
    if is_same(before, after, tolerance):
        return after
    if not _alike(before, after):
        return before
    rows = together or [[i] for i in range(len(old))]
    moved = [row for row in rows if any(old[i] != new[i] for i in row)]

    def with_row(program: Program, row: Sequence[int]) -> Program:
        return map_leaves(program, lambda i, leaf: new[i] if i in row else leaf)

    # that all are too many is known
    halves = [moved[: len(moved) // 2], moved[len(moved) // 2 :]]
    out = before
    for half in halves:
        out = accept_changes(out, half, with_row, lambda trial: not deadline.has_passed() and is_same(before, trial, tolerance), TRIES // 2)
    return out


def is_same(before: Program, after: Program, tolerance: float = SAME, segments: Sequence[int] = (COARSE, FINE)) -> bool:
    """Whether two programs are one solid up to a share of its volume, for one of some numbers of `segments` of a circle, few ones first."""
    if list(leaves(before)) == list(leaves(after)) and _alike(before, after):
        return True
    for number in segments:
        differ = volume_difference(before, after, number)
        if differ <= tolerance or differ > FAR:
            return differ <= tolerance
    return False


def _alike(a: Program, b: Program) -> bool:
    """Whether the same operations join as many primitives."""
    return postfix(a).tolist() == postfix(b).tolist()


def volume_difference(before: Program, after: Program, segments: int = COARSE) -> float:
    """Volume in which two programs differ, relative to what either holds; 0 where both are empty."""
    a, b = to_manifold(before, segments), to_manifold(after, segments)
    return 0.0 if a.is_empty() and b.is_empty() else 1 - volume_iou(a, b)
