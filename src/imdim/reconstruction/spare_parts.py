"""Parts that a program is better without: rounding and what was added after them may leave them less than they cost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from imdim.deadline import NEVER, Deadline
from imdim.program.outline import Outline
from imdim.program.paths import leaf_paths, without
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import Program, leaves, replace_leaves


def drop_spare(
    program: Program,
    estimate: Callable[[Program], float],
    price: Callable[[Program], float],
    slack: float,
    deadline: Deadline = NEVER,
    mend: Callable[[Program], Program | None] = lambda fewer: fewer,
) -> Program:
    """The program without the primitives, and the loops of drawings, without which its `price` is lower, the last ones first.

    The price is asked only where an `estimate` of it, which may be off by `slack`, does not tell. What goes may leave crumbs of what it
    cut, which `mend` takes away too; where it finds no way, and says None, or that costs more than the part, the part stays, as do the
    others past the `deadline` (by default never).
    """

    def is_better(fewer: Program) -> bool:
        return estimate(fewer) < whole + slack and price(fewer) < price(program)

    i, whole = len(leaf_paths(program)) - 1, estimate(program)
    while i >= 0 and not deadline.has_passed():
        mended = filter(None, map(mend, filter(is_better, _leave_out(program, i))))
        fewer = next(filter(is_better, mended), None)
        i -= fewer is None or len(leaf_paths(fewer)) < len(leaf_paths(program))
        if fewer is not None:
            program, whole = fewer, estimate(fewer)
    return program


def _leave_out(program: Program, i: int) -> Iterator[Program]:
    """The program without its leaf `i`, and without each loop of that, where something is left."""
    if (fewer := without(program, [leaf_paths(program)[i][0]])) is not None:
        yield fewer
    leaf = list(leaves(program))[i]
    loops = leaf.outline.loops if leaf.outline else ()
    for k in range(len(loops) if len(loops) > 1 else 0):
        try:
            drawn = replace(leaf, outline=Outline((*loops[:k], *loops[k + 1 :])))
        except ValueError:  # what lay within an outer loop alone bounds nothing
            continue
        yield replace_leaves(program, {i: to_simple(drawn) or drawn})
