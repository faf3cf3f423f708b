"""The CSG-Stump of a tree, its disjunctive normal form over the leaves, and what the paper's matrices mean (Ren et al. 2021)."""

from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from itertools import product
from operator import and_, or_
from typing import Any

from imdim.program.stump import CsgStump
from imdim.program.tree import Combine, Primitive, Program, leaves

MAX_TERMS = 1024


def evaluate(stump: CsgStump, columns: Sequence[Any]) -> Any:
    """Occupancy of the solid from the occupancy columns O_k of its K primitives, in any type with ``&``, ``|`` and ``~``.

    An empty intersection is the whole space, an empty union is nothing, as in the paper.
    """
    if len(columns) != len(stump.primitives):
        raise ValueError(f"{len(stump.primitives)} primitives need as many columns, got {len(columns)}")
    nodes = [~o if flip else o for o, flip in zip(columns, stump.complement, strict=True)]
    nothing = columns[0] & ~columns[0]
    terms = (reduce(and_, (nodes[k] for k in term), ~nothing) for term in _selected(stump))
    return reduce(or_, terms, nothing)


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


def _selected(stump: CsgStump) -> list[list[int]]:
    """The nodes of each selected intersection."""
    rows = range(len(stump.primitives))
    return [[k for k in rows if stump.intersection[k][c]] for c, used in enumerate(stump.union) if used]


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
