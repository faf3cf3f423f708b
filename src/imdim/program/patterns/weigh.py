"""The price of a program in which what repeats is paid for once, as a person reads it: sixty holes of a grid are no more than one."""

from __future__ import annotations

from imdim.program.cost import CURVE, weigh
from imdim.program.patterns.detect import extent, fold_repeats
from imdim.program.repeats import expand, first_copies, repeats
from imdim.program.tree import Program

NEAR = 2e-4  # of the program's size, by which copies may differ whose numbers are not fitted yet
WAY = 1 / 3  # of a feature's price: about what a count and a step take in the corpus of designs (`scripts/corpus/count_prices.py`)


def weigh_once(program: Program, curve: float = CURVE) -> float:
    """As `weigh`, with the copies of a row, grid, circle or mirror image weighed once, and each way in which they go on."""
    first, ways = take_first_copies(program)
    return weigh(first, curve) + WAY * ways


def take_first_copies(program: Program) -> tuple[Program, int]:
    """A program with the first of all copies alone, and in how many ways copies go on; itself and 0 where nothing repeats."""
    folding = fold_repeats(program, NEAR * extent(program))
    if folding is None:
        return program, 0
    return expand(first_copies(folding.folded)), sum(len(repeat.counts) for _, repeat in repeats(folding.folded))
