"""OpenSCAD text with repeated parts as modules in ``for`` loops: how often and how far apart are named parameters.

`openscad.py` writes the same solid flat, one line per primitive.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from imdim.export.expressions import Expression, write_expression
from imdim.export.loops import Loop, less
from imdim.export.numbers import Rounding, plain
from imdim.export.openscad import primitive_text
from imdim.export.parameters import Parameters
from imdim.geometry.solid import SEGMENTS
from imdim.program.repeats import Folded, Group, Repeat, expand, size
from imdim.program.tree import Primitive


def to_openscad_loops(folded: Folded, segments: int = SEGMENTS, parameters: Parameters | None = None) -> str:
    """OpenSCAD text of a program with repeats in its own units, with `$fn` at `segments`, and numbers that follow `parameters`."""
    program = expand(folded)
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)
    writer = _Writer(rounding, named)
    body = writer.lines(folded, 0)
    head = [*named.lines(rounding.size, ";"), *named.count_lines(";")]
    return "\n".join([f"$fn = {segments};", "", *head, *([""] if head else []), *writer.modules, *body, ""])


class _Writer:
    """Writes nodes; `modules` are the definitions of what repeats."""

    def __init__(self, rounding: Rounding, named: Parameters) -> None:
        self._rounding, self._named = rounding, named
        self._loops: Iterator[Loop] = iter(named.loops)
        self.modules: list[str] = []

    def lines(self, node: Folded, first: int, origin: Sequence[Expression] | None = None) -> list[str]:
        """The statements of a node whose first leaf is number `first`; a primitive relative to `origin`."""
        if isinstance(node, Primitive):
            center = self._named.centers[first]
            center = center if origin is None else less(center, origin)
            return [primitive_text(node, self._rounding, self._named.sizes[first], center) + ";"]
        if isinstance(node, Repeat):
            return [self._repeat(node, first)]
        return [f"{node.op}() {{", *("  " + line for line in self._parts(node, first)), "}"]

    def _parts(self, node: Group, first: int) -> Iterator[str]:
        for part in node.parts:
            yield from self.lines(part, first)
            first += size(part)

    def _repeat(self, repeat: Repeat, first: int) -> str:
        loop = next(self._loops)
        centered = repeat.kind == "circular" and self._vector(loop.center) != "[0, 0, 0]"
        relative = centered and isinstance(repeat.part, Primitive)
        is_union = isinstance(repeat.part, Group) and repeat.part.op == "union"
        origin = loop.center if relative else None
        body = list(self._parts(repeat.part, first)) if is_union else self.lines(repeat.part, first, origin)  # type: ignore[arg-type]
        self.modules += [f"module {loop.part}() {{", *("  " + line for line in body), "}", ""]
        place = self._place(repeat, loop)
        if centered:
            back = "" if relative else f" translate(-{self._vector(loop.center)})"
            place = f"translate({self._vector(loop.center)}) {place}{back}"
        loops = "for" if repeat.join == "union" else "intersection_for"
        return f"{loops} ({self._ranges(repeat, loop)}) {place} {loop.part}();"

    def _ranges(self, repeat: Repeat, loop: Loop) -> str:
        if repeat.kind == "mirror":
            return "i = [0, 1]"
        return ", ".join(f"{i} = [0 : {name} - 1]" for i, name in zip("ij", loop.counts, strict=False))

    def _place(self, repeat: Repeat, loop: Loop) -> str:
        if repeat.kind in ("linear", "grid"):
            return f"translate({self._sums(list(zip('ij', loop.steps, strict=False)))})"
        if repeat.kind == "mirror":
            normal = ", ".join(f"{plain(round(n, 12))}*i" if n not in (0, 1) else "i" if n else "0" for n in repeat.axis)
            shift = self._sums([("i", loop.shift)])
            return (f"translate({shift}) " if shift != "[0, 0, 0]" else "") + f"mirror([{normal}])"
        angle = f"360/{loop.counts[0]}*i" if repeat.is_full else f"{self._rounding.angle(repeat.angle)}*i"
        if max(map(abs, repeat.axis)) < 1:
            return f"rotate(a = {angle}, v = [{', '.join(plain(round(c, 12)) for c in repeat.axis)}])"
        forward = sum(repeat.axis) * (1 if repeat.angle > 0 or not repeat.is_full else -1) > 0
        return f"rotate([{', '.join((angle if forward else '-' + angle) if c else '0' for c in repeat.axis)}])"

    def _sums(self, moves: list[tuple[str, tuple[Expression, ...]]]) -> str:
        """A vector of what is moved for each loop variable."""
        texts = []
        for axis in range(3):
            terms = [(i, write_expression(step[axis], self._rounding.length)) for i, step in moves]
            products = [f"({t})*{i}" if " " in t else f"{t}*{i}" for i, t in terms if t != "0"]
            texts.append(" + ".join(products) or "0")
        return f"[{', '.join(texts)}]"

    def _vector(self, v: Sequence[Expression]) -> str:
        return f"[{', '.join(write_expression(e, self._rounding.length) for e in v)}]"
