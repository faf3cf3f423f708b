"""The signed sequence: a program as a flat list of steps, the form in which searches put in, leave out and move one term at a time.

A sequence starts from nothing and applies union, difference or intersection with one term after another, as a left fold. A term is a
primitive, a program that stays whole, the index of a part in a table, or a candidate of a family with the cells that it covers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from imdim.program.tree import Combine, Op, Primitive, Program, fold, leaves

T = TypeVar("T")
U = TypeVar("U")


class Step(NamedTuple, Generic[T]):
    """One operation with what a sequence has so far on its left."""

    op: Op
    term: T

    @property
    def positive(self) -> bool:
        return self.op == "union"


SignedSequence = tuple[Step[T], ...]


def to_program(sequence: SignedSequence[Primitive] | SignedSequence[Program]) -> Program:
    """The left fold; raises ValueError unless the sequence begins with a union."""
    if not sequence:
        raise ValueError("an empty sequence is no program")
    first, *rest = sequence
    if not first.positive:
        raise ValueError(f"a sequence begins with a union, got a {first.op}")
    program: Program = first.term
    for op, term in rest:
        program = Combine(op, program, term)
    return program


def to_sequence(program: Program, apart: bool = False) -> SignedSequence[Program]:
    """The unions and differences of which `program` is the left fold.

    What stands on the right is one term, or as many as it unites if they are to be taken `apart`; what is below an intersection is one.
    """
    steps: list[Step[Program]] = []
    while isinstance(program, Combine) and program.op != "intersection":
        op, terms = program.op, _union_terms(program.right) if apart else [program.right]
        steps += [Step(op, term) for term in reversed(terms)]
        program = program.left
    return (Step("union", program), *reversed(steps))


def _union_terms(program: Program) -> list[Program]:
    sequence = to_sequence(program, apart=True)
    return [term for _, term in sequence] if _positive(sequence) else [program]


def of_primitives(sequence: SignedSequence[Program]) -> SignedSequence[Primitive] | None:
    """The sequence where every term is a primitive, else None."""
    steps = tuple(Step(op, term) for op, term in sequence if isinstance(term, Primitive))
    return steps if len(steps) == len(sequence) else None


def flatten(program: Program) -> SignedSequence[Primitive]:
    """A sequence of all primitives with the same solid.

    A left fold keeps its order. A union may also stand on the right, a cut may be a union, and one of two united parts may contain cuts.
    Raises ValueError for an intersection, a cut that is itself cut, and a union of two cut parts.
    """
    return fold(program, lambda _, p: (Step("union", p),), {"union": _unite, "intersection": _refuse, "difference": _cut})


def _unite(a: SignedSequence[Primitive], b: SignedSequence[Primitive]) -> SignedSequence[Primitive]:
    if _positive(b):
        return a + b
    if _positive(a):
        # a union commutes; the cuts have to come before what they must not touch
        return b + a
    raise ValueError(f"a union of two parts with cuts ({len(a)} and {len(b)} primitives) is no signed sequence")


def _cut(a: SignedSequence[Primitive], b: SignedSequence[Primitive]) -> SignedSequence[Primitive]:
    if not _positive(b):
        raise ValueError(f"a cut that has cuts itself ({len(b)} primitives) is no signed sequence")
    return a + tuple(Step("difference", p) for _, p in b)


def _refuse(a: SignedSequence[Primitive], b: SignedSequence[Primitive]) -> SignedSequence[Primitive]:
    raise ValueError(f"an intersection ({len(a)} and {len(b)} primitives) is no signed sequence")


def _positive(sequence: SignedSequence[T]) -> bool:
    return all(step.positive for step in sequence)


def map_terms(sequence: SignedSequence[T], change: Callable[[T], U]) -> SignedSequence[U]:
    """The same operations with other terms."""
    return tuple(Step(op, change(term)) for op, term in sequence)


def with_leaves(sequence: SignedSequence[Primitive], program: Program) -> SignedSequence[Primitive]:
    """The same operations with the leaves of `program`, which has the sequence's structure."""
    return tuple(Step(op, leaf) for leaf, (op, _) in zip(leaves(program), sequence, strict=True))
