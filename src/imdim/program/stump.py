"""CSG-Stump: a union of intersections of primitives and complements, as three binary matrices (Ren et al. 2021).

Every tree has such a form: its disjunctive normal form over the leaves. A node of the complement layer stands for one
primitive, as it is or complemented; a primitive that a tree needs both ways therefore appears twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from imdim.program.tree import Primitive, Program, combine_all


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


def to_program(stump: CsgStump) -> Program:
    """The tree: of each selected intersection, the plain primitives intersected minus the complemented ones; then the union.

    Raises ValueError where the solid is empty (nothing selected) or unbounded (an intersection without a plain primitive).
    """
    terms = [_term_program(stump, term) for term in _terms(stump)]
    if not terms:
        raise ValueError(f"W_U selects none of {len(stump.union)} intersections: the solid is empty")
    return combine_all("union", terms)


def _terms(stump: CsgStump) -> list[list[int]]:
    """The nodes of each selected intersection."""
    rows = range(len(stump.primitives))
    return [[k for k in rows if stump.intersection[k][c]] for c, used in enumerate(stump.union) if used]


def _term_program(stump: CsgStump, term: list[int]) -> Program:
    plain: list[Program] = [stump.primitives[k] for k in term if not stump.complement[k]]
    if not plain:
        raise ValueError(f"an intersection of {len(term)} nodes has no plain primitive: the solid is unbounded")
    return combine_all("difference", [combine_all("intersection", plain), *(stump.primitives[k] for k in term if stump.complement[k])])
