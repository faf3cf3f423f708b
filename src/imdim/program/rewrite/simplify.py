"""Shorter programs for the same solid.

`reduce_program` applies rules that hold for every point: operations flattened, no-ops and duplicates removed, what another
part holds absorbed, pairs that are one primitive fused. `simplify` goes on where a referee is given: it drops parts and
merges near-equal primitives, and keeps each step only if the referee finds the solid unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

from imdim.deadline import NEVER, Deadline
from imdim.program.cost import cost
from imdim.program.nary import fold_nary
from imdim.program.paths import Path, leaf_counts, without
from imdim.program.rewrite import containment
from imdim.program.rewrite.containment_rules import ContainmentProver, parts, spine
from imdim.program.rewrite.fusion import fuse
from imdim.program.tree import Op, Primitive, Program, combine_all, leaves, map_leaves

SameSolid = Callable[[Program, Program], bool]
NEAR = 1e-2  # of the smaller primitive: what may be made equal


def simplify(program: Program, same_solid: SameSolid | None = None, max_checks: int = 1000) -> Program:
    """A program of at most the same cost and the same solid.

    Without `same_solid` only what is proven changes, lengths being equal within SLACK of the smaller primitive.
    With it, parts are also dropped, and primitives equal within NEAR made equal, wherever ``same_solid(program, candidate)``
    is true. It always compares with the given program, so errors do not add up, and is asked at most `max_checks` times.
    """
    best = reduce_program(program)
    if same_solid is None:
        return best
    referee = _Referee(program, same_solid, max_checks)
    best = _merge_near(best, referee)
    return reduce_program(_drop_parts(best, referee))


def reduce_program(program: Program, deadline: Deadline = NEVER) -> Program:
    """The proven rules until none shortens the program further, or time is out (by default never).

    Of equally long forms the last is taken, in which cuts stand outside: (A - X) & B is (A & B) - X, so that equal parts meet in one
    operation and can be written as repeats. A solid found empty has no shorter program: it is returned as given.
    """
    best = program
    while not deadline.has_passed():
        shorter = _rewrite(best, ContainmentProver())
        if shorter is None:
            return program
        if cost(shorter) >= cost(best):
            return shorter if cost(shorter) == cost(best) else best
        best = shorter
    return best


# --- proven rules ----------------------------------------------------------------------------------------------------


def _rewrite(program: Program, prover: ContainmentProver) -> Program | None:
    """One pass from the leaves up; None stands for the empty solid."""

    def union(terms: list[Program | None]) -> Program | None:
        return _union([t for term in terms if term for t in parts(term, "union")], prover)

    def intersection(factors: list[Program | None]) -> Program | None:
        filled = [f for f in factors if f]
        return _product(filled, [], prover) if len(filled) == len(factors) else None

    def difference(terms: list[Program | None]) -> Program | None:
        base, *cuts = terms
        return _product([base], [c for cut in cuts if cut for c in parts(cut, "union")], prover) if base else None

    rules = {"union": union, "intersection": intersection, "difference": difference}
    return fold_nary(program, lambda _, p: p, rules)  # type: ignore[arg-type]


def _union(terms: list[Program], prover: ContainmentProver) -> Program | None:
    terms = _uncovered(terms, prover.contains)
    terms = [_without_filled_cuts(t, [*terms[:i], *terms[i + 1 :]], prover) for i, t in enumerate(terms)]
    terms = _fuse_all("union", _without_floors(terms, prover))
    return combine_all("union", terms) if terms else None


def _without_filled_cuts(term: Program, others: list[Program], prover: ContainmentProver) -> Program:
    """(X - C) | Y is X | Y where Y holds C, or what C takes from X."""
    base, cuts = spine(term)
    taken = [[c, _fuse_pair("intersection", c, base)] for c in cuts]
    filled = [any(t and prover.contains(other, t) for t in both for other in others) for both in taken]
    return combine_all("difference", [base, *(c for c, gone in zip(cuts, filled, strict=True) if not gone)])


def _without_floors(terms: list[Program], prover: ContainmentProver) -> list[Program]:
    """(X - C) | F is X - D where X holds F, and D is what F leaves of C: a floor in holes that go through makes pockets of them."""
    floors: set[int] = set()
    out = list(terms)
    for i in range(len(out)):
        for j in range(len(out)):
            pockets = None if j == i or j in floors or i in floors else _pockets(out[i], out[j], prover)
            if pockets is not None:
                out[i] = pockets
                floors.add(j)
    return [term for i, term in enumerate(out) if i not in floors]


def _pockets(term: Program, floor: Program, prover: ContainmentProver) -> Program | None:
    base, cuts = spine(term)
    cuts = [c for cut in cuts for c in parts(cut, "union")]
    if not cuts or not prover.contains(base, floor):
        return None
    left = [cut if prover.disjoint(cut, floor) else _fuse_pair("difference", cut, floor) for cut in cuts]
    return None if any(cut is None for cut in left) else combine_all("difference", [base, *(cut for cut in left if cut is not None)])


def _product(factors: list[Program], cuts: list[Program], prover: ContainmentProver) -> Program | None:
    """The intersection of `factors` minus the union of `cuts`."""
    bases: list[Program] = []
    for factor in (f for given in factors for f in parts(given, "intersection")):
        base, inner = spine(factor)
        bases += parts(base, "intersection")
        cuts = [c for cut in inner for c in parts(cut, "union")] + cuts
    bases, cuts = _ease_cuts(bases, cuts, prover)
    # a factor that holds another one says nothing
    bases = _uncovered([_without_dead_parts(b, bases, cuts, prover) for b in bases], lambda a, b: prover.contains(b, a))
    bases = _fuse_all("intersection", bases)
    if any(prover.disjoint(a, b) for a, b in combinations(bases, 2)) or any(prover.contains(c, b) for c in cuts for b in bases):
        return None
    cuts = _uncovered([c for c in cuts if not any(prover.disjoint(c, b) for b in bases)], prover.contains)
    return _trim(bases, _fuse_all("union", cuts))


def _ease_cuts(bases: list[Program], cuts: list[Program], prover: ContainmentProver) -> tuple[list[Program], list[Program]]:
    """Cuts lose what does not bear on the bases: X - (C1 & C2) is X - C2 where C1 holds X; X - (C - D) is X & D where C holds X."""
    kept: list[Program] = []
    for cut in cuts:
        base, spared = spine(cut)
        factors = [f for f in parts(base, "intersection") if not any(prover.contains(f, b) for b in bases)]
        spared = [d for d in spared if not any(prover.disjoint(d, b) for b in bases)]
        if factors:
            kept.append(combine_all("difference", [combine_all("intersection", factors), *spared]))
        elif spared:
            bases = [*bases, combine_all("union", spared)]
        else:
            kept.append(cut)
    return bases, kept


def _without_dead_parts(base: Program, bases: list[Program], cuts: list[Program], prover: ContainmentProver) -> Program:
    """A united part goes where a cut holds it or another factor is apart from it."""
    terms = parts(base, "union")
    alive = [
        t for t in terms if not any(prover.contains(c, t) for c in cuts) and not any(prover.disjoint(b, t) for b in bases if b is not base)
    ]
    return combine_all("union", alive) if 0 < len(alive) < len(terms) else base


def _trim(bases: list[Program], cuts: list[Program]) -> Program:
    """A cut that shortens a single primitive is done in its numbers."""
    base = combine_all("intersection", bases)
    left = []
    for cut in cuts:
        both = isinstance(base, Primitive) and isinstance(cut, Primitive)
        shorter = fuse("difference", base, cut) if both else None  # type: ignore[arg-type]
        if shorter is None:
            left.append(cut)
        else:
            base = shorter
    return combine_all("difference", [base, *left])


def _uncovered(terms: list[Program], covers: Callable[[Program, Program], bool]) -> list[Program]:
    """Without the terms that another one covers; of equal ones the first stays."""
    kept: list[Program] = []
    for term in terms:
        if not any(covers(other, term) for other in kept):
            kept = [other for other in kept if not covers(term, other)] + [term]
    return kept


def _fuse_all(op: Op, terms: list[Program]) -> list[Program]:
    """Pairs of primitives that are one, fused until none is left."""
    terms = list(terms)
    i = 0
    while i < len(terms):
        merged = next(((j, f) for j in range(len(terms)) if j != i and (f := _fuse_pair(op, terms[i], terms[j]))), None)
        if merged is None:
            i += 1
        else:
            j, terms[i] = merged
            del terms[j]
            i = 0
    return terms


def _fuse_pair(op: Op, a: Program, b: Program) -> Primitive | None:
    return fuse(op, a, b) if isinstance(a, Primitive) and isinstance(b, Primitive) else None


# --- refereed steps --------------------------------------------------------------------------------------------------


class _Referee:
    """Asks whether a candidate is still the given solid, a bounded number of times."""

    def __init__(self, program: Program, same_solid: SameSolid, max_checks: int) -> None:
        self._program, self._same_solid, self._left = program, same_solid, max_checks

    def accepts(self, candidate: Program) -> bool:
        if self._left <= 0:
            return False
        self._left -= 1
        return self._same_solid(self._program, candidate)


def _merge_near(program: Program, referee: _Referee) -> Program:
    """Make near-equal primitives equal where the rules then shorten the program."""
    for a, b in combinations(dict.fromkeys(leaves(program)), 2):
        if a.kind == b.kind and containment.same(a, b, NEAR):
            merged = reduce_program(map_leaves(program, lambda _, p, a=a, b=b: a if p == b else p))
            if cost(merged) < cost(program) and referee.accepts(merged):
                program = merged
    return program


def _drop_parts(program: Program, referee: _Referee) -> Program:
    """Remove subtrees, the largest first and later ones before earlier ones, until none can go."""
    while True:
        sizes = leaf_counts(program)
        gone: set[Path] = set()
        best = program
        for path in sorted([*sizes][:0:-1], key=lambda path: -sizes[path]):
            candidate = without(program, gone | {path})
            if candidate is not None and cost(candidate) < cost(best) and referee.accepts(candidate):
                gone.add(path)
                best = candidate
        if not gone:
            return program
        program = best
