"""Parts that a program is better without: rounding and what was added after them may leave them less than they cost."""

from __future__ import annotations

from collections.abc import Callable

from imdim.deadline import NEVER, Deadline
from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program


def drop_spare(
    program: Program,
    estimate: Callable[[Program], float],
    price: Callable[[Program], float],
    slack: float,
    deadline: Deadline = NEVER,
) -> Program:
    """The program without the primitives without which its `price` is lower, the last ones first.

    The price is asked only where an `estimate` of it, which may be off by `slack`, does not tell. Past the `deadline` (by default never)
    the others stay.
    """
    for i in reversed(range(len(leaf_paths(program)))):
        if deadline.has_passed():
            break
        fewer = without(program, [leaf_paths(program)[i][0]])
        if fewer is not None and estimate(fewer) < estimate(program) + slack and price(fewer) < price(program):
            program = fewer
    return program
