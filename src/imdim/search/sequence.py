"""Signed sequences over the cells: what a program is during the search, and what inserting one more term anywhere would win.

A cell's state is decided by the last step that changes it, so a term inserted after step k changes just the cells that all later steps
leave as they are. That makes the exact gain of every candidate at every position a sum of one field, which `Families.best`
maximises over all candidates.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import accumulate, islice

import numpy as np

from imdim.program import sequence as signed
from imdim.program.patterns.weigh import WAY
from imdim.program.sequence import SignedSequence, Step, map_terms
from imdim.program.tree import Combine, Op, Program
from imdim.search.bits import pack_words
from imdim.search.candidate_families import Candidate, Families
from imdim.search.cells import TRUE, Weights
from imdim.search.kernels import pick_flags, sum_where

NEARLY = 1 - 1e-9  # of a gain, for which rounding makes no difference


@dataclass(frozen=True)
class Pair:
    """Two candidates combined before they enter the sequence: `op` is intersection or difference."""

    op: Op
    left: Candidate
    right: Candidate


@dataclass(frozen=True)
class Pattern:
    """Copies of one candidate, united, which go on along a row or circle (one of the `ways`), or a grid (two)."""

    copies: tuple[Candidate, ...]
    ways: int


Shape = Candidate | Pair | Pattern
OCCUPANCY: Mapping[Op, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "union": np.logical_or,
    "intersection": np.logical_and,
    "difference": lambda keep, cut: keep & ~cut,
}


@dataclass(frozen=True)
class Covered:
    """A shape with the cells [m] that it covers."""

    shape: Shape
    mask: np.ndarray = dataclasses.field(compare=False)

    @staticmethod
    def of(shape: Shape, families: Families) -> Covered:
        return Covered(shape, mask_of(shape, families))

    @cached_property
    def bits(self) -> np.ndarray:
        """The cells as bits [w]."""
        return pack_words(self.mask)

    @property
    def halves(self) -> tuple[Candidate, ...]:
        """The candidates that it is made of."""
        if isinstance(self.shape, Pattern):
            return self.shape.copies
        return (self.shape,) if isinstance(self.shape, Candidate) else (self.shape.left, self.shape.right)

    @property
    def features(self) -> float:
        """How many features are paid for: copies once, and their ways."""
        return 1 + WAY * self.shape.ways if isinstance(self.shape, Pattern) else len(self.halves)


Sequence = SignedSequence[Covered]
Shaped = tuple[Op, Shape]


@dataclass(frozen=True)
class Price:
    """The objective of a phase: the price of a primitive in volume, the weights of excess and lacking volume, whether boxes may be used."""

    step: float
    weights: Weights = TRUE
    boxes: bool = True


@dataclass(frozen=True)
class Insertion:
    """`gain` in volume from putting `op shape` at `position` (the number of steps before it)."""

    gain: float
    position: int
    op: Op
    shape: Shape


def apply(state: np.ndarray, step: Step[Covered]) -> np.ndarray:
    """The cells [m] filled after one step."""
    return OCCUPANCY[step.op](state, step.term.mask)


def run(sequence: Sequence, m: int) -> np.ndarray:
    """The cells [m] that a sequence fills."""
    return reduce(apply, sequence, np.zeros(m, bool))


def error(sequence: Sequence, families: Families, weights: Weights = TRUE) -> float:
    """Volume in which the sequence and the target differ; `weights` count (what it has too much, what it lacks)."""
    return error_of(run(sequence, len(families.cells.points)), families, weights)


def error_of(state: np.ndarray, families: Families, weights: Weights = TRUE) -> float:
    """As `error`, for the filled cells [m]."""
    cells = families.cells
    return weights[0] * sum_where(cells.w_out, state, True) + weights[1] * sum_where(cells.w_in, state, False)


def without_one(sequence: Sequence, m: int) -> Iterator[tuple[int, np.ndarray]]:
    """Each step, the last first, with the cells [m] that are filled without it.

    What the steps behind it make of an empty and of a filled cell is carried along, so that all removals take the time of a few runs.
    """
    states = list(accumulate(sequence[:-1], apply, initial=np.zeros(m, bool)))
    of_empty, of_filled = np.zeros(m, bool), np.ones(m, bool)
    for i in range(len(sequence) - 1, -1, -1):
        yield i, pick_flags(states[i], of_filled, of_empty)
        step = sequence[i]
        if step.op == "union":
            of_empty = pick_flags(step.term.mask, of_filled, of_empty)
        else:
            emptied = step.term.mask if step.op == "difference" else ~step.term.mask
            of_filled = pick_flags(emptied, of_empty, of_filled)


def shapes_of(sequence: Sequence) -> tuple[Shaped, ...]:
    """What tells sequences over the same cells apart, without the cells."""
    return tuple((step.op, step.term.shape) for step in sequence)


def cost(sequence: Sequence) -> float:
    """Number of primitives, the copies of a pattern counted once."""
    return sum(step.term.features for step in sequence)


def expense(sequence: Sequence, families: Families, price: Price) -> float:
    """What the primitives and the curves of outlines cost, in volume."""
    charged = (c for step in sequence for c in step.term.halves[: 1 if isinstance(step.term.shape, Pattern) else None])
    curves = sum(families.curve_cost(candidate) for candidate in charged)
    return price.step * cost(sequence) + curves


def to_program(sequence: Sequence, families: Families) -> Program:
    """The program tree of the shapes; ValueError for an empty sequence."""
    return signed.to_program(map_terms(spell_out(sequence, families), lambda covered: _drawn(covered.shape, families)))


def spell_out(sequence: Sequence, families: Families) -> Sequence:
    """The sequence with a step for each copy of a pattern."""
    return tuple(part for step in sequence for part in _copies(step, families))


def _copies(step: Step[Covered], families: Families) -> Iterator[Step[Covered]]:
    if isinstance(step.term.shape, Pattern):
        yield from (Step(step.op, Covered.of(copy, families)) for copy in step.term.shape.copies)
    else:
        yield step


def _drawn(shape: Shape, families: Families) -> Program:
    if isinstance(shape, Candidate):
        return families.primitive(shape)
    assert isinstance(shape, Pair)  # patterns are spelled out
    return Combine(shape.op, families.primitive(shape.left), families.primitive(shape.right))


def mask_of(shape: Shape, families: Families) -> np.ndarray:
    """The cells [m] of a shape."""
    if isinstance(shape, Candidate):
        return families.mask(shape)
    if isinstance(shape, Pattern):
        return reduce(np.logical_or, map(families.mask, shape.copies))
    return OCCUPANCY[shape.op](families.mask(shape.left), families.mask(shape.right))


def insert(sequence: Sequence, insertion: Insertion, families: Families) -> Sequence:
    """The longer sequence."""
    step = Step(insertion.op, Covered.of(insertion.shape, families))
    return (*sequence[: insertion.position], step, *sequence[insertion.position :])


def leave_unchanged(step: Step[Covered]) -> np.ndarray:
    """The cells [m] that a step leaves as they are, whatever they are."""
    return step.term.mask if step.op == "intersection" else ~step.term.mask


def gaps(sequence: Sequence, m: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """All places where a step can go, the end first: the cells [m] filled before it, and those that every later step leaves as they are."""
    states = list(accumulate(sequence, apply, initial=np.zeros(m, bool)))
    free = np.ones(m, bool)
    for position in range(len(sequence), -1, -1):
        yield position, states[position], free
        if position:
            free = free & leave_unchanged(sequence[position - 1])


def insertions(sequence: Sequence, families: Families, per_frame: int, least: float, weights: Weights = TRUE) -> list[Insertion]:
    """Insertions of single candidates that win more than `least`, best first; `weights` as in `error`."""
    gain = families.cells.gain_under(weights)
    out: list[Insertion] = []
    best = least
    enough = 0.5 if per_frame > 1 else 1.0  # a place whose whole potential is below this share of the best is skipped
    before: dict[Op, np.ndarray] = {}
    for position, state, free in gaps(sequence, len(gain)):
        for op, field, total, potential in _fields(position, state, free, gain):
            # a step that has nothing to do with what is left leaves the field as it is: nothing new is found before it
            if potential <= best * enough or (op in before and np.array_equal(before[op], field)):
                continue
            before[op] = field
            found = [(total + v, c) for v, c in families.best(field, per_frame, max(best * enough - total, 0.0), per_frame > 0)]
            out += [Insertion(v, position, op, c) for v, c in found if v > least]
            best = max([best, *(v for v, _ in found)])
    return sorted(out, key=lambda i: -i.gain)


def _fields(position: int, state: np.ndarray, free: np.ndarray, gain: np.ndarray) -> Iterator[tuple[Op, np.ndarray, float, float]]:
    """(op, field to maximise, constant, upper bound of the sum) for the three operations at one of the `gaps`."""
    for op in ("union", "difference", "intersection") if position else ("union",):
        field, constant = field_of(op, free, state, gain)
        yield op, field, constant, float(np.maximum(field if op != "intersection" else -field, 0).sum())


def field_of(op: Op, deciding: np.ndarray, filled: np.ndarray, gain: np.ndarray) -> tuple[np.ndarray, float]:
    """What a term wins over the cells that it decides, `deciding` [m]: the sum of a field [m] over its cells, and a constant.

    `gain` [m] is that of filling a cell, some of which are `filled` [m].
    """
    if op == "union":
        return np.where(deciding & ~filled, gain, 0.0), 0.0
    empty = np.where(deciding & filled, -gain, 0.0)
    # keeping only a term wins what emptying all filled cells would win, less what emptying those in the term would
    return (empty, 0.0) if op == "difference" else (-empty, float(empty.sum()))


def pair_insertions(sequence: Sequence, families: Families, least: float, limit: int, share: float = 0.0) -> list[Insertion]:
    """Insertions of two candidates combined (round end of a bar, bored boss) at the end of the sequence that win more than `least` and at
    least a `share` of the best, best first.

    `limit` bounds how many candidates are tried as one half; the other half is the best of all for it.
    """
    gain = families.cells.gain
    position, state, free = next(gaps(sequence, len(gain)))
    out: list[Insertion] = []

    def floor() -> float:
        return max(least, NEARLY * share * max((i.gain for i in out), default=0.0))

    for op, field, _, _ in islice(_fields(position, state, free, gain), 2):
        for half in _promising(field, families, limit):
            out += [Insertion(v, position, op, pair) for v, pair in _best_pairs(half, field, families, least, floor())]
        # what holds the most of what must not be covered: something larger less one of them may pay
        for half in _promising(-field, families, limit):
            rest = np.where(families.mask(half), 0.0, field)
            out += [Insertion(v, position, op, Pair("difference", c, half)) for v, c in families.best(rest, 1, floor())]
    out.sort(key=lambda i: -i.gain)
    return [i for i in out if i.gain >= share * out[0].gain]


def _best_pairs(half: Candidate, field: np.ndarray, families: Families, least: float, floor: float) -> list[tuple[float, Pair]]:
    """The best intersections with, and subtractions from, one half that may win more than `least`, where they win more than `floor`."""
    kept = np.where(families.mask(half), field, 0.0)
    if kept[kept > 0].sum() <= least:
        return []
    whole = float(kept.sum())
    both = [(v, Pair("intersection", half, c)) for v, c in families.best(kept, 1, floor)]
    cuts = families.best(-kept, 1, max(floor - whole, 0.0))
    return both + [(whole + v, Pair("difference", half, c)) for v, c in cuts if whole + v > floor]


def _promising(field: np.ndarray, families: Families, limit: int) -> list[Candidate]:
    """Candidates with the largest positive content, whatever else they cover."""
    found = families.best(np.where(field > 0, field, 0.02 * field), 2)
    return [c for v, c in sorted(found, key=lambda f: -f[0])[:limit] if v > 0]
