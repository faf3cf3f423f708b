"""The part of µcad text that writes nodes with repeats, by argument multiplicity: an argument that is an array makes a copy for each value.

µcad language book, "Multiplicity", "Range Arrays" (both ends belong to a range) and "Array Operators"; several arrays make every
combination, and together make their union. Mirror images, steps or turns that are not along one axis each, and copies that are
intersected have no such form and are written copy by copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice

from imdim.export.expressions import Expression, write_expression
from imdim.export.loops import Loop
from imdim.export.numbers import Rounding, to_fixed_point
from imdim.export.parameters import Parameters
from imdim.export.script_loops import chain
from imdim.program.nary import fold_nary
from imdim.program.repeats import Folded, Repeat, expand, repeats, size
from imdim.program.tree import Op, Primitive

SIGN: Mapping[Op, str] = {"union": "|", "difference": "-", "intersection": "&"}


class UcadLoops:
    """Writes nodes; `parts` are the assignments of what repeats, `line` writes a primitive."""

    def __init__(self, rounding: Rounding, named: Parameters, line: Callable[[int, Primitive], list[str]]) -> None:
        self._rounding, self._line = rounding, line
        self._loops: Iterator[Loop] = iter(named.loops)
        self.parts: list[str] = []

    def lines(self, node: Folded, first: int) -> list[str]:
        """The expression of a node whose first leaf is number `first`."""
        if isinstance(node, Primitive):
            return self._line(first, node)
        if isinstance(node, Repeat):
            return self._copies(node, first)
        operands: list[list[str]] = []
        for part in node.parts:
            operands.append(self.lines(part, first))
            first += size(part)
        return chain(SIGN[node.op])(operands)

    def _copies(self, repeat: Repeat, first: int) -> list[str]:
        loop = next(self._loops)
        moves = self._moves(repeat, loop)
        if not moves:
            list(islice(self._loops, sum(1 for _ in repeats(repeat.part))))
            return fold_nary(expand(repeat), lambda n, leaf: self._line(first + n, leaf), {op: chain(s) for op, s in SIGN.items()})
        body = self.lines(repeat.part, first)
        self.parts += [f"{loop.part} = {body[0]};"] if len(body) == 1 else [f"{loop.part} = (", *("    " + line for line in body), ");"]
        return [loop.part + moves]

    def _moves(self, repeat: Repeat, loop: Loop) -> str:
        """The calls that make the copies; empty where there are none such."""
        if repeat.join == "intersection":
            return ""
        if repeat.kind in ("linear", "grid"):
            along = [[a for a in range(3) if step[a]] for step in repeat.steps]
            if any(len(a) > 1 for a in along) or len({a[0] for a in along}) < len(along):
                return ""
            moves = {a[0]: _array(n, self._sum(step[a[0]])) for a, n, step in zip(along, loop.counts, loop.steps, strict=True)}
            arguments = ", ".join("xyz"[a] + " = " + move for a, move in sorted(moves.items()))
            return f".translate({arguments})"
        if repeat.kind == "mirror" or max(map(abs, repeat.axis)) < 1:
            return ""
        sign = "" if sum(repeat.axis) * repeat.angle > 0 else "-"
        angle = _array(loop.counts[0], f"{sign}{to_fixed_point(self._rounding.angle(abs(repeat.angle)))}°")
        if repeat.is_full:
            angle = f"[1..{loop.counts[0]}] * {sign}360° / {loop.counts[0]}"
        axis = next(a for a in range(3) if repeat.axis[a])
        there, back = (self._shift(loop.center, sign) for sign in ("-", ""))
        return there + f".rotate({'xyz'[axis]} = {angle})" + back

    def _shift(self, v: Sequence[Expression], sign: str) -> str:
        texts = {axis: self._sum(e) for axis, e in zip("xyz", v, strict=True)}
        moves = ", ".join(f"{axis} = {sign}{text}" for axis, text in texts.items() if text != "0mm")
        return f".translate({moves})" if moves else ""

    def _sum(self, e: Expression) -> str:
        text = write_expression(e, lambda value: to_fixed_point(self._rounding.length(value)), "mm")
        return f"({text})" if " " in text else text


def _array(count: str, step: str) -> str:
    """0, 1, .. count - 1 steps; a range needs whole numbers as its ends, which a difference may not be."""
    return f"[1..{count}] * {step} - {step}"
