"""The part of a build123d script that builds nodes with repeats: one name for what repeats, and a list of its copies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from imdim.export.expressions import Expression, write_expression
from imdim.export.loops import Loop
from imdim.export.numbers import Rounding, plain
from imdim.export.parameters import Parameters
from imdim.program.motions import Motion, move_leaf
from imdim.program.repeats import Folded, Repeat, size
from imdim.program.tree import Op, Primitive

SIGN: Mapping[Op, str] = {"union": "+", "difference": "-", "intersection": "&"}
_FRAME = Primitive("box", (1.0, 1.0, 1.0))  # turned and moved, it shows a placement


def chain(sign: str) -> Callable[[list[list[str]]], list[str]]:
    """Operands with an operator between them, those of several lines in parentheses."""

    def lines(parts: list[list[str]]) -> list[str]:
        blocks = [part if len(part) == 1 else ["(", *("    " + line for line in part), ")"] for part in parts]
        return [*blocks[0], *(line for block in blocks[1:] for line in (f"{sign} {block[0]}", *block[1:]))]

    return lines


class ScriptLoops:
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
            # a list alone is no part
            copies = self._copies(node, first)
            return ["Part()", f"+ {copies}"] if node.join == "union" else [f"reduce(and_, {copies})"]
        operands: list[list[str]] = []
        for number, part in enumerate(node.parts):
            spread = isinstance(part, Repeat) and part.join == "union" and node.op != "intersection" and number > 0
            operands.append([self._copies(part, first)] if spread else self.lines(part, first))  # type: ignore[arg-type]
            first += size(part)
        if isinstance(node.parts[0], Repeat) and node.parts[0].join == node.op == "union":
            operands[:1] = [[line.removeprefix("+ ")] for line in operands[0]]
        return chain(SIGN[node.op])(operands)

    def _copies(self, repeat: Repeat, first: int) -> str:
        loop = next(self._loops)
        body = self.lines(repeat.part, first)
        self.parts += [f"{loop.part} = (", *("    " + line for line in body), ")"] if len(body) > 1 else [f"{loop.part} = {body[0]}"]
        return _COPIES[repeat.kind](self, repeat, loop)

    def _row(self, _: Repeat, loop: Loop) -> str:
        place = self._sum(list(zip("ij", loop.steps, strict=False)))
        ranges = " ".join(f"for {i} in range({name})" for i, name in zip("ij", loop.counts, strict=False))
        return f"[Pos({place}) * {loop.part} {ranges}]"

    def _circle(self, repeat: Repeat, loop: Loop) -> str:
        if max(map(abs, repeat.axis)) < 1:
            places = [self._place(motion) for motion in repeat.motions()]
            return f"[place * {loop.part} for place in ({', '.join(places)})]"
        angle = f"360 / {loop.counts[0]} * i" if repeat.is_full else f"{self._rounding.angle(abs(repeat.angle))} * i"
        sign = "" if sum(repeat.axis) * repeat.angle > 0 else "-"
        turn = f"Rot({', '.join(sign + angle if c else '0' for c in repeat.axis)})"
        center = self._vector(loop.center)
        there, back = (f"Pos({center}) * ", f"Pos({self._vector(loop.center, -1)}) * ") if center != "0, 0, 0" else ("", "")
        return f"[{there}{turn} * {back}{loop.part} for i in range({loop.counts[0]})]"

    def _mirror(self, repeat: Repeat, loop: Loop) -> str:
        origin = ", ".join(write_expression(_half(e), self._rounding.length) for e in loop.shift)
        normal = ", ".join(plain(round(n, 12)) for n in repeat.axis)
        return f"[{loop.part}, mirror({loop.part}, about=Plane(origin=({origin}), z_dir=({normal})))]"

    def _place(self, motion: Motion) -> str:
        leaf = move_leaf(_FRAME, motion)
        turns = [f"Rot({', '.join(self._rounding.angle(leaf.rotation[a]) if b == a else '0' for b in range(3))})" for a in (2, 1, 0)]
        return " * ".join([f"Pos({', '.join(self._rounding.length(c) for c in leaf.center)})", *turns])

    def _sum(self, moves: Sequence[tuple[str, tuple[Expression, ...]]]) -> str:
        texts = []
        for axis in range(3):
            terms = [(i, write_expression(step[axis], self._rounding.length)) for i, step in moves]
            texts.append(" + ".join(f"({t}) * {i}" if " " in t else f"{t} * {i}" for i, t in terms if t != "0") or "0")
        return ", ".join(texts)

    def _vector(self, v: Sequence[Expression], sign: int = 1) -> str:
        return ", ".join(t if sign > 0 or t == "0" else f"-({t})" for t in (write_expression(e, self._rounding.length) for e in v))


_COPIES: Mapping[str, Callable[[ScriptLoops, Repeat, Loop], str]] = {
    "linear": ScriptLoops._row,
    "grid": ScriptLoops._row,
    "circular": ScriptLoops._circle,
    "mirror": ScriptLoops._mirror,
}


def _half(e: Expression) -> Expression:
    return Expression(tuple(type(t)(t.name, t.coefficient / 2) for t in e.terms), e.constant / 2)
