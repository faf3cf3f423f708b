"""Certain relations between whole programs, derived from those between their primitives: True is a proof."""

from __future__ import annotations

from collections.abc import Callable

from imdim.program.rewrite import containment
from imdim.program.tree import OPS, Combine, Op, Primitive, Program, fold

# Larger questions are not asked: leaves of one program times leaves of the other, and operations inside each other of both.
MAX_PAIRS = 4096
MAX_NESTING = 40


class ContainmentProver:
    """Answers containment and disjointness for one simplification, remembering what it has worked out."""

    def __init__(self, slack: float = containment.SLACK) -> None:
        self.slack = slack
        # keyed by identity, for equality of trees is slow and recursive; the value keeps its programs alive
        self._known: dict[tuple[str, int, int], tuple[bool, Program, Program]] = {}
        self._sizes: dict[int, tuple[tuple[int, int], Program]] = {}

    def contains(self, outer: Program, inner: Program) -> bool:
        """Whether `inner` surely lies in `outer`."""
        return self._remember("contains", outer, inner, self._contains)

    def disjoint(self, a: Program, b: Program) -> bool:
        """Whether `a` and `b` surely have no common interior."""
        return self._remember("disjoint", a, b, self._disjoint)

    def _contains(self, outer: Program, inner: Program) -> bool:
        if isinstance(outer, Primitive) and isinstance(inner, Primitive):
            return containment.contains(outer, inner, self.slack)
        return self._holds(outer, inner) or self._is_held(inner, outer)

    def _holds(self, outer: Program, inner: Program) -> bool:
        """By the structure of `outer`."""
        if isinstance(outer, Primitive):
            return False
        if outer.op == "union":
            return any(self.contains(part, inner) for part in parts(outer, "union"))
        if outer.op == "intersection":
            return all(self.contains(part, inner) for part in parts(outer, "intersection"))
        base, cuts = spine(outer)
        return self.contains(base, inner) and all(self.disjoint(cut, inner) for cut in cuts)

    def _is_held(self, inner: Program, outer: Program) -> bool:
        """By the structure of `inner`."""
        if isinstance(inner, Primitive):
            return False
        if inner.op == "union":
            return all(self.contains(outer, part) for part in parts(inner, "union"))
        if inner.op == "intersection":
            return any(self.contains(outer, part) for part in parts(inner, "intersection"))
        return self.contains(outer, spine(inner)[0])

    def _disjoint(self, a: Program, b: Program) -> bool:
        if isinstance(a, Primitive) and isinstance(b, Primitive):
            return containment.disjoint(a, b, self.slack)
        return self._apart(a, b) or self._apart(b, a)

    def _apart(self, a: Program, b: Program) -> bool:
        """By the structure of `a`."""
        if isinstance(a, Primitive):
            return False
        if a.op == "union":
            return all(self.disjoint(part, b) for part in parts(a, "union"))
        if a.op == "intersection":
            return any(self.disjoint(part, b) for part in parts(a, "intersection"))
        base, cuts = spine(a)
        return self.disjoint(base, b) or any(self.contains(cut, b) for cut in cuts)

    def _remember(self, question: str, a: Program, b: Program, ask: Callable[[Program, Program], bool]) -> bool:
        key = (question, id(a), id(b))
        if key not in self._known:
            (size_a, nesting_a), (size_b, nesting_b) = self._measure(a), self._measure(b)
            small = size_a * size_b <= MAX_PAIRS and nesting_a + nesting_b <= MAX_NESTING
            self._known[key] = (small and ask(a, b), a, b)
        return self._known[key][0]

    def _measure(self, program: Program) -> tuple[int, int]:
        if id(program) not in self._sizes:
            self._sizes[id(program)] = (_measure(program), program)
        return self._sizes[id(program)][0]


def parts(program: Program, op: Op) -> list[Program]:
    """The operands of nested `op`, flattened, from left to right; the program itself where it is something else."""
    out: list[Program] = []
    stack: list[Program] = [program]
    while stack:
        node = stack.pop()
        if isinstance(node, Combine) and node.op == op:
            stack += (node.right, node.left)
        else:
            out.append(node)
    return out


def spine(program: Program) -> tuple[Program, list[Program]]:
    """(X - C1) - C2 as X and [C1, C2]."""
    cuts: list[Program] = []
    while isinstance(program, Combine) and program.op == "difference":
        cuts.append(program.right)
        program = program.left
    return program, cuts[::-1]


_Measure = tuple[int, int, Op | None]  # primitives, operations inside each other (as n-ary ones), outermost operation


def _measure(program: Program) -> tuple[int, int]:
    def join(op: Op, a: _Measure, b: _Measure) -> _Measure:
        nesting = max(a[1] + (a[2] != op), b[1] + (b[2] != op or op == "difference"))
        return a[0] + b[0], nesting, op

    def leaf(_: int, __: Primitive) -> _Measure:
        return 1, 0, None

    return fold(program, leaf, {op: (lambda a, b, op=op: join(op, a, b)) for op in OPS})[:2]
