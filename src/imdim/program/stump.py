"""CSG-Stump: a union of intersections of primitives and complements, as three binary matrices (Ren et al. 2021).

Every tree has such a form: its disjunctive normal form over the leaves. A node of the complement layer stands for one
primitive, as it is or complemented; a primitive that a tree needs both ways therefore appears twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product
from operator import and_, or_
from typing import Protocol, Self, TypeVar

from imdim.program.tree import Combine, Primitive, Program, combine_all, leaves

MAX_TERMS = 1024


class Bits(Protocol):
    """A column of truth values: a numpy bool array, a torch bool tensor, or an int as a bit set."""

    def __and__(self, other: Self, /) -> Self: ...
    def __or__(self, other: Self, /) -> Self: ...
    def __invert__(self) -> Self: ...


B = TypeVar("B", bound=Bits)


@dataclass(frozen=True)
class CsgStump:
    """K primitives and the paper's matrices with entries 0 and 1.

    `complement` W_C [K]: 1 takes the complement of primitive k. `intersection` W_I [K][C]: 1 puts node k into
    intersection c. `union` W_U [C]: 1 puts intersection c into the solid. Raises ValueError where shapes or entries do not fit.
    """

    primitives: tuple[Primitive, ...]
    complement: tuple[int, ...]
    intersection: tuple[tuple[int, ...], ...]
    union: tuple[int, ...]

    def __post_init__(self) -> None:
        k, c = len(self.primitives), len(self.union)
        if k == 0 or len(self.complement) != k or len(self.intersection) != k:
            raise ValueError(f"{k} primitives need W_C and W_I of {k} rows, got {len(self.complement)} and {len(self.intersection)}")
        for row in self.intersection:
            if len(row) != c:
                raise ValueError(f"W_U has {c} entries, a row of W_I has {len(row)}")
        for entry in (*self.complement, *self.union, *(e for row in self.intersection for e in row)):
            if entry not in (0, 1):
                raise ValueError(f"entries are 0 or 1, got {entry}")


def evaluate(stump: CsgStump, columns: Sequence[B]) -> B:
    """Occupancy of the solid from the occupancy columns O_k of its K primitives, in any type with ``&``, ``|`` and ``~``.

    An empty intersection is the whole space, an empty union is nothing, as in the paper.
    """
    if len(columns) != len(stump.primitives):
        raise ValueError(f"{len(stump.primitives)} primitives need as many columns, got {len(columns)}")
    nodes = [~o if flip else o for o, flip in zip(columns, stump.complement, strict=True)]
    nothing = columns[0] & ~columns[0]
    terms = (reduce(and_, (nodes[k] for k in term), ~nothing) for term in _terms(stump))
    return reduce(or_, terms, nothing)


def to_program(stump: CsgStump) -> Program:
    """The tree: of each selected intersection, the plain primitives intersected minus the complemented ones; then the union.

    Raises ValueError where the solid is empty (nothing selected) or unbounded (an intersection without a plain primitive).
    """
    terms = [_term_program(stump, term) for term in _terms(stump)]
    if not terms:
        raise ValueError(f"W_U selects none of {len(stump.union)} intersections: the solid is empty")
    return combine_all("union", terms)


def to_stump(program: Program, max_terms: int = MAX_TERMS) -> CsgStump:
    """The stump of a tree, equal primitives being one variable.

    Impossible and absorbed terms are left out; the rest is in order of appearance. A solid that is empty by logic alone (A - A) gets no
    intersection. Raises ValueError where more than `max_terms` intersections would be needed: the normal form can grow exponentially.
    """
    index = {p: i for i, p in enumerate(dict.fromkeys(leaves(program)))}
    terms = _normal_form(program, index, max_terms)
    literals = sorted({literal for term in terms for literal in term}) or [(0, 0)]
    primitives = list(index)
    return CsgStump(
        tuple(primitives[i] for i, _ in literals),
        tuple(flip for _, flip in literals),
        tuple(tuple(int(literal in term) for term in terms) for literal in literals),
        (1,) * len(terms),
    )


def _terms(stump: CsgStump) -> list[list[int]]:
    """The nodes of each selected intersection."""
    rows = range(len(stump.primitives))
    return [[k for k in rows if stump.intersection[k][c]] for c, used in enumerate(stump.union) if used]


def _term_program(stump: CsgStump, term: list[int]) -> Program:
    plain: list[Program] = [stump.primitives[k] for k in term if not stump.complement[k]]
    if not plain:
        raise ValueError(f"an intersection of {len(term)} nodes has no plain primitive: the solid is unbounded")
    cuts = (stump.primitives[k] for k in term if stump.complement[k])
    return reduce(lambda keep, cut: Combine("difference", keep, cut), cuts, combine_all("intersection", plain))


# A literal is (primitive, 1 if complemented), a term an intersection of literals, a normal form a union of terms.
_Term = frozenset[tuple[int, int]]
_Form = list[_Term]


def _normal_form(program: Program, index: dict[Primitive, int], max_terms: int) -> _Form:
    """Disjunctive normal form by pushing complements to the leaves, without recursion (trees may be deep)."""
    todo: list[tuple[Program | Callable[[_Form, _Form, int], _Form], int]] = [(program, 0)]
    forms: list[_Form] = []
    while todo:
        item, flip = todo.pop()
        if isinstance(item, Primitive):
            forms.append([frozenset({(index[item], flip)})])
        elif isinstance(item, Combine):
            # De Morgan: the complement of a difference is ~left | right
            joined = _either if (item.op == "union") != bool(flip) else _both
            todo += ((joined, 0), (item.right, flip ^ (item.op == "difference")), (item.left, flip))
        else:
            right = forms.pop()
            forms.append(item(forms.pop(), right, max_terms))
    return forms[0]


def _either(a: _Form, b: _Form, max_terms: int) -> _Form:
    return _absorb(a, b, max_terms)


def _both(a: _Form, b: _Form, max_terms: int) -> _Form:
    if len(a) * len(b) > 16 * max_terms:
        # bounds the work, which absorption may not reduce
        raise ValueError(f"the normal form needs {len(a)} x {len(b)} intersections before absorption; at most {16 * max_terms}")
    return _absorb([], (s | t for s, t in product(a, b)), max_terms)


def _absorb(kept: _Form, terms: Iterable[_Term], max_terms: int) -> _Form:
    """Add terms but for impossible ones (A and not A) and those that a shorter one contains."""
    for term in terms:
        if any((i, 1 - flip) in term for i, flip in term) or any(other <= term for other in kept):
            continue
        kept = [other for other in kept if not term <= other] + [term]
        if len(kept) > max_terms:
            raise ValueError(f"the normal form needs more than {max_terms} intersections")
    return kept
