"""Flattened readings of a program: chains of one binary operation seen as a single n-ary operation.

``a + b + c`` is one union of three, ``(a - b) - (c + d)`` one difference of a by b, c and d. Exporters and exact booleans read programs so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

from imdim.program.tree import OPS, Op, Primitive, Program, fold

T = TypeVar("T")

# Which operation on the right merges into this one: what is cut away is itself a union.
_RIGHT_MERGES: Mapping[Op, Op] = {"union": "union", "intersection": "intersection", "difference": "union"}


class _Pending(NamedTuple):
    op: Op | None
    parts: list


def fold_nary(program: Program, leaf: Callable[[int, Primitive], T], combine: Mapping[Op, Callable[[list[T]], T]]) -> T:
    """Evaluate bottom-up: `leaf(i, primitive)` per leaf in order, then `combine[op](values)` per flattened operation of two or more.

    The first value of a difference is kept, the others are cut from it. Does not recurse, so depth is no limit.
    """

    def close(value: _Pending) -> T:
        return value.parts[0] if value.op is None else combine[value.op](value.parts)

    def join(op: Op) -> Callable[[_Pending, _Pending], _Pending]:
        def run(left: _Pending, right: _Pending) -> _Pending:
            kept = left.parts if left.op == op else [close(left)]
            return _Pending(op, kept + (right.parts if right.op == _RIGHT_MERGES[op] else [close(right)]))

        return run

    return close(fold(program, lambda i, primitive: _Pending(None, [leaf(i, primitive)]), {op: join(op) for op in OPS}))
