"""The same solid with parts that stood apart in the program side by side (parts commuted): whole cutters last, added parts before them.

Outside a part c, taking ``- c`` or ``| c`` out of a program changes nothing, wherever it stands. Inside it, cutting c last leaves nothing
and adding it last leaves all. So what the finished solid holds nothing of may be cut last, and what it holds all of may be added last,
whatever else the program does there. Exact booleans decide both where points do not (`overlap`). Such a part may then be any that lies
between what it is needed for and what it may not touch (`cutter_extent`), so that equal features become equal parts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.geometry.finish.active_zone import matters
from imdim.geometry.finish.cutter_extent import LastOperand, Rest, ends_of, even_lengths, narrow, reach, stretch
from imdim.geometry.finish.overlap import surely_overlap
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.solid import primitive_to_manifold, to_manifold
from imdim.program.paths import Path, leaf_counts, nodes, polarity
from imdim.program.tree import FLAT_ENDS, OPS, Combine, Op, Primitive, Program, combine_all, fold, leaves

NOTHING = 1e-5  # of the solid's volume
LEAST = 0.05  # of a length, that is left where one end is cut off


@dataclass(frozen=True)
class CommutedProgram:
    """`order[i]` is the number in the given program of leaf i; the first `core` of them stand as they did."""

    program: Program
    order: tuple[int, ...]
    core: int


class _Unit(NamedTuple):
    """A part that is united with or cut from something, and the numbers of its leaves."""

    path: Path
    node: Program
    numbers: range


class Commutation:
    """What of one program may be gathered; each part is looked at once."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._solid = to_manifold(program, CHECK_SEGMENTS)
        self._slack = NOTHING * self._solid.volume()
        self._placed = [PosedPrimitive(leaf) for leaf in leaves(program)]
        self._known: dict[Path, LastOperand | None] = {}

    def commute(self, largest: int = 1, only: Collection[int] | None = None) -> CommutedProgram | None:
        """The program with parts of at most `largest` primitives gathered, all of whose leaves are in `only`; None where there are none."""
        taken: dict[Path, tuple[_Unit, LastOperand]] = {}
        for unit in _units(self._program, largest):
            wanted = only is None or all(n in only for n in unit.numbers)
            if wanted and not any(unit.path[: len(path)] == path for path in taken) and (part := self._part(unit)) is not None:
                taken[unit.path] = unit, part
        lost = {n for unit, _ in taken.values() for n in unit.numbers}
        core = fold(self._program, lambda i, leaf: None if i in lost else leaf, {op: partial(_join, op) for op in OPS})
        if not taken or core is None or self._solid.is_empty():
            return None
        found = even_lengths([part for _, part in taken.values()], Rest(self._solid, to_manifold(core, CHECK_SEGMENTS)))
        last = sorted(zip([unit for unit, _ in taken.values()], found, strict=True), key=lambda pair: (pair[1].cuts, pair[0].numbers[0]))
        out = combine_all("union", [core, *(part.node for _, part in last if not part.cuts)])
        out = combine_all("difference", [out, *(part.node for _, part in last if part.cuts)])
        moved = [n for unit, _ in last for n in unit.numbers]
        stay = [n for n in range(len(self._placed)) if n not in moved]
        return CommutedProgram(out, (*stay, *moved), len(stay))

    def _part(self, unit: _Unit) -> LastOperand | None:
        if unit.path not in self._known:
            self._known[unit.path] = self._whole(unit)
        return self._known[unit.path]

    def _whole(self, unit: _Unit) -> LastOperand | None:
        """The part if the solid holds nothing or all of it; a primitive without an end that makes no difference."""
        if not self._surely_holds_some(unit):
            own = to_manifold(unit.node, CHECK_SEGMENTS)
            common = (own ^ self._solid).volume()
            if common <= self._slack:
                return LastOperand(unit.node, True)
            if own.volume() - common <= self._slack:
                return LastOperand(unit.node, False)
        if not isinstance(unit.node, Primitive):
            return None
        cuts = polarity(self._program, unit.path) < 0
        for slab, rest in _ends(unit.node, self._solid, cuts):
            left = primitive_to_manifold(rest, CHECK_SEGMENTS)
            wrong = (left ^ self._solid if cuts else left - self._solid).volume()
            if wrong <= self._slack and not matters(self._program, self._placed, unit.numbers.start, slab):
                return LastOperand(rest, cuts)
        return None

    def _surely_holds_some(self, unit: _Unit) -> bool:
        """Whether points tell that the solid holds some of a part, and not all."""
        bounds = [self._placed[n].bounds for n in unit.numbers]
        box = np.array([np.min([low for low, _ in bounds], axis=0), np.max([high for _, high in bounds], axis=0)])
        node, program = unit.node, self._program
        return surely_overlap([node, program], box, self._slack) and surely_overlap([node], box, self._slack, outside=[program])


def _join(op: Op, a: Program | None, b: Program | None) -> Program | None:
    """A node of the program with nothing in the place of some leaves; None if that is nothing."""
    if a is not None and b is not None:
        return Combine(op, a, b)
    return {"union": a or b, "difference": a, "intersection": None}[op]


def _units(program: Program, largest: int) -> Iterator[_Unit]:
    """Parts of unions and what differences cut, the larger ones first."""
    every, sizes = nodes(program), leaf_counts(program)
    first = dict(zip(sizes, accumulate((isinstance(node, Primitive) for _, node in every), initial=0), strict=False))
    ops = {path: node.op for path, node in every if isinstance(node, Combine)}
    for path, node in every:
        joined = path and (ops[path[:-1]] == "union" or (ops[path[:-1]] == "difference" and path[-1] == 1))
        if joined and sizes[path] <= largest and ops.get(path) != "union":
            yield _Unit(path, node, range(first[path], first[path] + sizes[path]))


def _ends(leaf: Primitive, solid: Manifold, cuts: bool) -> Iterator[tuple[Primitive, Primitive]]:
    """Ends without which a cutter holds nothing of the solid, an added primitive nothing else; and what is left of the primitive."""
    for axis in FLAT_ENDS.get(leaf.kind, ()):
        low, high = ends_of(leaf, axis)
        core = primitive_to_manifold(narrow(leaf, axis), CHECK_SEGMENTS)
        wrong = reach(core ^ solid if cuts else core - solid, leaf, axis, core.volume())
        for rest in ((wrong[1], high), (low, wrong[0])) if wrong is not None else ():
            if rest[1] - rest[0] > LEAST * (high - low):
                end = (low, rest[0]) if rest[1] == high else (rest[1], high)
                yield stretch(leaf, axis, end), stretch(leaf, axis, rest)
