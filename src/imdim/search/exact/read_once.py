"""From candidates that tell all cells apart to a tree of them, each used once, with ranges as a person would have drawn them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from imdim.program.tree import Program
from imdim.search.candidate_families import Candidate, Families
from imdim.search.exact.formula import MOST_SETS, Formula, Literal, holds, read_once, to_program
from imdim.search.exact.separation_pairs import CellLabels, groups
from imdim.search.minimal_ranges import shorten_range


def join_candidates(chosen: list[Candidate], labels: CellLabels, families: Families, slack: float) -> tuple[Program, np.ndarray] | None:
    """A tree of candidates and the cells [m] that it fills, where one is wrong on no more than `slack` beyond what it cannot help."""
    masks = [families.mask(c) for c in chosen]
    if not chosen or len(chosen) > MOST_SETS:
        return None
    group = groups(np.stack(masks), len(labels.weight))
    gain = np.bincount(group, np.where(labels.filled, 1, -1) * labels.weight)
    order = np.argsort(np.abs(gain), kind="stable")
    matters = np.zeros(len(gain), bool)
    matters[order[np.cumsum(np.abs(gain)[order]) > slack]] = True
    required, forbidden = matters & (gain > 0), matters & (gain < 0)
    if not required.any() or not forbidden.any():
        return None
    first = np.unique(group, return_index=True)[1]
    formula = read_once([bits(mask[first]) for mask in masks], bits(required), bits(forbidden))
    if formula is None or to_program(formula, [families.primitive(c) for c in chosen]) is None:
        return None
    chosen, filled = _tidy(formula, list(chosen), families)
    program = to_program(formula, [families.primitive(c) for c in chosen])
    return None if program is None else (program, filled)


def bits(flags: np.ndarray) -> int:
    """Bool [n] as an int, flag i being bit i."""
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")


def _tidy(formula: Formula, chosen: list[Candidate], families: Families) -> tuple[list[Candidate], np.ndarray]:
    """The same filled cells with shorter ranges; what is cut or intersected ends just beyond the part."""
    masks = [bits(families.mask(c)) for c in chosen]
    m = len(families.cells.points)
    everything = (1 << m) - 1
    goal = holds(formula, masks, everything)
    for index, added in _literals(formula):
        for axis in range(len(chosen[index].ranges)):
            for end in (0, 1):
                while (shorter := shorten_range(chosen[index], axis, end, families, added)) is not None:
                    trial = [bits(families.mask(shorter)) if i == index else mask for i, mask in enumerate(masks)]
                    if holds(formula, trial, everything) != goal:
                        break
                    chosen[index], masks = shorter, trial
    return chosen, np.unpackbits(np.frombuffer(goal.to_bytes(-(-m // 8), "little"), np.uint8), count=m, bitorder="little").astype(bool)


def _literals(formula: Formula, united: bool = True) -> Iterator[tuple[int, bool]]:
    """Each candidate's index, and whether it adds material of its own."""
    if isinstance(formula, Literal):
        yield formula.index, united and not formula.negated
    else:
        for part in (formula.left, formula.right):
            # of what is kept and cut, the first adds; of what is intersected, none is drawn by what is left of it
            alone = formula.op == "and" and any(isinstance(p, Literal) and p.negated for p in (formula.left, formula.right))
            yield from _literals(part, united and (formula.op == "or" or alone))
