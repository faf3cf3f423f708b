"""Programs as operands with operators between them, as build123d scripts and µcad texts are; what repeats is assigned to a name before."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar

from imdim.export.drawing import write_regions
from imdim.export.feature_notes import write_notes
from imdim.export.loops import Loop
from imdim.export.numbers import Rounding, write_expression, write_sizes
from imdim.export.parameters import Parameters
from imdim.program.nary import fold_nary
from imdim.program.repeats import Folded, Group, Repeat, starts
from imdim.program.tree import Op, Primitive, Program, Vec3


class Chains(ABC):
    """Writes nodes in a language with the operators `signs` and comments behind a `mark`; `parts` assign what repeats, which `end` ends."""

    signs: ClassVar[Mapping[Op, str]]
    end: ClassVar[str] = ""
    mark: ClassVar[str] = "#"

    def __init__(self, rounding: Rounding, named: Parameters) -> None:
        self._rounding, self._named = rounding, named
        self._loops: Iterator[Loop] = iter(named.loops)
        self.parts: list[str] = []

    def flat(self, program: Program, first: int = 0) -> list[str]:
        """The expression of a program whose first leaf is number `first`, each copy written out."""
        return fold_nary(
            program, lambda n, leaf: self.lines(leaf, first + n), {op: _chain(sign, self.mark) for op, sign in self.signs.items()}
        )

    def lines(self, node: Folded, first: int = 0) -> list[str]:
        """The expression of a node whose first leaf is number `first`."""
        if isinstance(node, Primitive):
            return [*write_notes(self._named.notes, first, self.mark), self._primitive(node, first)]
        return (
            self._repeat(node, first) if isinstance(node, Repeat) else _chain(self.signs[node.op], self.mark)(self._operands(node, first))
        )

    @abstractmethod
    def _primitive(self, leaf: Primitive, number: int) -> str: ...

    @abstractmethod
    def _repeat(self, repeat: Repeat, first: int) -> list[str]: ...

    def _operands(self, group: Group, first: int) -> list[list[str]]:
        return [self.lines(part, start) for part, start in starts(group, first)]

    def _center(self, number: int) -> list[str]:
        return [write_expression(c, self._rounding.length) for c in self._named.centers[number]]

    def _arguments(self, leaf: Primitive, number: int) -> list[str]:
        """The sizes, and what an outlined leaf is drawn from."""
        drawn = write_regions(leaf, self._named.outlines[number], self._rounding)
        return [*write_sizes(leaf, self._named.sizes[number], self._rounding), *drawn]

    def _turns(self, rotation: Vec3) -> Iterator[tuple[int, str]]:
        """Axis and degrees of the turns about the fixed axes, first x: those that turn."""
        angles = enumerate(map(self._rounding.angle, rotation))
        return ((axis, angle) for axis, angle in angles if angle != "0")

    def _assign(self, repeat: Repeat, first: int, name: str) -> None:
        notes, body = _split_notes(self.lines(repeat.part, first), self.mark)
        lines = [f"{name} = {body[0]}"] if len(body) == 1 else [f"{name} = (", *("    " + line for line in body), ")"]
        self.parts += [*notes, *lines[:-1], lines[-1] + self.end]


def _chain(sign: str, mark: str) -> Callable[[list[list[str]]], list[str]]:
    """Operands with an operator between them, those of several lines in parentheses; comments that one begins with stand above it."""

    def lines(parts: list[list[str]]) -> list[str]:
        out: list[str] = []
        for i, (notes, part) in enumerate(_split_notes(part, mark) for part in parts):
            block = part if len(part) == 1 else ["(", *("    " + line for line in part), ")"]
            out += [*notes, f"{sign} {block[0]}" if i else block[0], *block[1:]]
        return out

    return lines


def _split_notes(lines: list[str], mark: str) -> tuple[list[str], list[str]]:
    """The comments that some lines begin with, and the others."""
    first = next(i for i, line in enumerate(lines) if not line.startswith(f"{mark} "))
    return lines[:first], lines[first:]
