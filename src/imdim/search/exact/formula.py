"""Read-once formulas: a tree that uses each of a few sets at most once and holds what it must and nothing that it must not.

Sets are ints, bit g for group g of cells. A set that holds nothing forbidden may be united first, one that holds all that is required may
be intersected first, without loss (what a formula says elsewhere with that set, it also says with a constant in its place). Only where
nothing can be peeled off so is the formula split in two, both ways of sharing what either half could hold being tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from imdim.program.tree import Combine, Program

MOST_SETS = 12


@dataclass(frozen=True)
class Literal:
    """A set, or its complement."""

    index: int
    negated: bool


@dataclass(frozen=True)
class Gate:
    """Two formulas joined by `op`, "or" or "and"."""

    op: str
    left: Formula
    right: Formula


Formula = Literal | Gate


def read_once(sets: Sequence[int], required: int, forbidden: int) -> Formula | None:
    """A formula over `sets` that holds all of `required` and none of `forbidden` (neither may be 0), or None where none was found."""
    return _Solver(sets, required | forbidden).solve(frozenset(range(len(sets))), required, forbidden)


def holds(formula: Formula, sets: Sequence[int], everything: int) -> int:
    """The groups that a formula holds, out of `everything`."""
    if isinstance(formula, Literal):
        return everything & ~sets[formula.index] if formula.negated else everything & sets[formula.index]
    a, b = holds(formula.left, sets, everything), holds(formula.right, sets, everything)
    return a | b if formula.op == "or" else a & b


def to_program(formula: Formula, programs: Sequence[Program]) -> Program | None:
    """The tree of a formula over solids, without complements; None where it is unbounded."""
    program, complemented = _lower(formula, programs)
    return None if complemented else program


def _lower(formula: Formula, programs: Sequence[Program]) -> tuple[Program, bool]:
    """A bounded solid, and whether the formula is its complement."""
    if isinstance(formula, Literal):
        return programs[formula.index], formula.negated
    (a, not_a), (b, not_b) = _lower(formula.left, programs), _lower(formula.right, programs)
    union = formula.op == "or"
    if not_a == not_b:
        # by De Morgan, a union of complements is the complement of an intersection
        return Combine("union" if union != not_a else "intersection", a, b), not_a
    keep, cut = (a, b) if not_a == union else (b, a)
    return Combine("difference", keep, cut), union


class _Solver:
    def __init__(self, sets: Sequence[int], everything: int) -> None:
        self.sets, self.everything = sets, everything
        groups = [g for g in range(everything.bit_length()) if everything >> g & 1]
        self.signs = [(1 << g, sum(1 << v for v, s in enumerate(sets) if s >> g & 1)) for g in groups]
        self.known: dict[tuple[frozenset[int], int, int], Formula | None] = {}

    def solve(self, free: frozenset[int], required: int, forbidden: int) -> Formula | None:
        key = (free, required, forbidden)
        if key not in self.known:
            self.known[key] = self._peel(free, required, forbidden)
        return self.known[key]

    def _peel(self, free: frozenset[int], required: int, forbidden: int) -> Formula | None:
        for literal in (Literal(v, negated) for v in sorted(free) for negated in (False, True)):
            held = holds(literal, self.sets, self.everything)
            pure, whole = not held & forbidden, not required & ~held
            if pure and whole:
                return literal
            if (pure and held & required) or (whole and forbidden & ~held):
                rest = free - {literal.index}
                other = self.solve(rest, required & ~held, forbidden) if pure else self.solve(rest, required, forbidden & held)
                return Gate("or" if pure else "and", other, literal) if other else None
        if len(free) < 4:
            return None
        return next((f for half in _halves(free) for f in self._split(half, free - half, required, forbidden)), None)

    def _split(self, a: frozenset[int], b: frozenset[int], required: int, forbidden: int) -> Iterator[Formula]:
        """Formulas whose root joins one over `a` with one over `b`."""
        for op, shared, whole in (("or", required, forbidden), ("and", forbidden, required)):
            by_a, by_b = (self._apart(half, shared, whole) for half in (a, b))
            for goal in () if shared & ~(by_a | by_b) else (shared & ~by_b, by_a):
                left = self.solve(a, *((goal, forbidden) if op == "or" else (required, goal))) if goal else None
                if left is None:
                    continue
                held = holds(left, self.sets, self.everything)
                right = self.solve(b, *((required & ~held, forbidden) if op == "or" else (required, forbidden & held)))
                if right:
                    yield Gate(op, left, right)

    def _apart(self, half: frozenset[int], groups: int, others: int) -> int:
        """The part of `groups` that the sets of `half` tell apart from all of `others`."""
        seen = sum(1 << v for v in half)
        taken = {sign & seen for bit, sign in self.signs if bit & others}
        return sum(bit for bit, sign in self.signs if bit & groups and sign & seen not in taken)


def _halves(free: frozenset[int]) -> Iterator[frozenset[int]]:
    """Each way to part the sets in two of two or more, once."""
    first, *rest = sorted(free)
    for chosen in range(1, 1 << len(rest)):
        half = frozenset([first, *(v for i, v in enumerate(rest) if chosen >> i & 1)])
        if 2 <= len(half) <= len(free) - 2:
            yield half
