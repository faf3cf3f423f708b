"""The price of a program, which search and simplification bring down: primitives + operations (Occam's razor)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from imdim.program.tree import KINDS, OPS, Op, Primitive, Program, fold, leaves


@dataclass(frozen=True)
class Counts:
    """How often each kind and each operation occurs; kinds and operations that do not occur count 0. `curves` are those of all outlines.

    An operation is a binary one: a union of n parts counts n - 1, however it is nested or written.
    """

    kinds: Mapping[str, int]
    ops: Mapping[Op, int]
    curves: int = 0

    @property
    def primitives(self) -> int:
        return sum(self.kinds.values())

    @property
    def operations(self) -> int:
        return sum(self.ops.values())

    @property
    def drawn(self) -> dict[str, int]:
        """What a document says beside the primitives where there are outlines: every leaf is a feature. Nothing where there are none."""
        return {"features": self.primitives, "curves": self.curves} if self.curves else {}

    def __str__(self) -> str:
        return describe_size(self.primitives, self.curves)


FREE_CURVES, CURVE = 4, 0.1  # curves that an outline has for nothing, as many as a box; what each further one costs, in primitives
DRAWN = 0.5  # of a curve: what the plainest outline costs more than one of the six kinds
CURVE_PRICES = {"description": CURVE, "primitives": 0.0}  # of a primitive, by what is counted: curves too, or primitives alone


def curves_of(leaf: Primitive) -> int:
    """The number of curves of a leaf's outline, a full circle counted as one; 0 for one of the six kinds."""
    return 0 if leaf.outline is None else leaf.outline.curve_count


def count_charged_curves(curves: int) -> float:
    """How many curves of an outline are paid for."""
    return max(curves - FREE_CURVES, DRAWN)


def weigh(program: Program, curve: float = CURVE) -> float:
    """Primitives, each charged curve of an outline counted as `curve` of one: what the search brings down beside the error."""
    return sum(1 + (curve * count_charged_curves(curves_of(leaf)) if leaf.outline else 0) for leaf in leaves(program))


def count(program: Program) -> Counts:
    """The counts of `program`, in the order of KINDS and OPS."""
    kinds: Counter[str] = Counter()
    ops: Counter[Op] = Counter()
    fold(program, lambda _, p: kinds.update((p.kind,)), {op: (lambda a, b, op=op: ops.update((op,))) for op in OPS})
    return Counts({kind: kinds[kind] for kind in KINDS}, {op: ops[op] for op in OPS}, sum(map(curves_of, leaves(program))))


def describe_size(primitives: int, curves: int | None = None, distinct: int | None = None) -> str:
    """In words: "14 primitives", and "4 features, 45 curves in outlines" where there are any; with "(7 without copies)" where fewer are
    `distinct`."""
    copies = "" if distinct is None or distinct >= primitives else f" ({distinct} without copies)"
    if not curves:
        return f"{_number(primitives, 'primitive')}{copies}"
    return f"{_number(primitives, 'feature')}{copies}, {_number(curves, 'curve')} in outlines"


def _number(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def cost(program: Program) -> int:
    """Primitives + operations: 1 for a single primitive, 2 k - 1 for k of them."""
    counts = count(program)
    return counts.primitives + counts.operations
