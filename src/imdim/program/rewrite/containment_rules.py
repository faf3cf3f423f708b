"""Certain relations between whole programs, derived from those between their primitives: True is a proof."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import chain

from imdim.program.rewrite import containment
from imdim.program.tree import OPS, Combine, Op, Primitive, Program, fold

# Larger questions are not asked: leaves of one program times leaves of the other, and operations inside each other of both.
MAX_PAIRS = 4096
MAX_NESTING = 40

_Rule = Callable[[Iterable[bool]], bool]  # any or all


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
        of_outer = _by_structure(outer, any, all, lambda part: self.contains(part, inner), lambda cut: self.disjoint(cut, inner))
        return of_outer or _by_structure(inner, all, any, lambda part: self.contains(outer, part), lambda cut: False)

    def _disjoint(self, a: Program, b: Program) -> bool:
        if isinstance(a, Primitive) and isinstance(b, Primitive):
            return containment.disjoint(a, b, self.slack)
        return any(
            _by_structure(one, all, any, lambda part, b=other: self.disjoint(part, b), lambda cut, b=other: self.contains(cut, b))
            for one, other in ((a, b), (b, a))
        )

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


def _by_structure(
    program: Program, united: _Rule, met: _Rule, of_part: Callable[[Program], bool], of_cut: Callable[[Program], bool]
) -> bool:
    """Whether something holds for a program because it holds for what it unites or intersects; what is cut is intersected outside."""
    if isinstance(program, Primitive):
        return False
    if program.op != "difference":
        return (united if program.op == "union" else met)(map(of_part, parts(program, program.op)))
    base, cuts = spine(program)
    return met(chain(map(of_part, (base,)), map(of_cut, cuts)))


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
