"""Which features share a placement: one direction and something that carries them, or a pattern that they are members of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from imdim.export.seats import TOUCH, place_of, seats
from imdim.program.constraints import Constraint
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Program, leaves, longest
from imdim.program.vectors import dot

PATTERNS = ("linear", "circular", "symmetric", "coaxial", "concentric")
WITH_AXIS = ("cylinder", "cone", "torus")
PARALLEL = 1e-6


@dataclass(frozen=True)
class Placements:
    """For each of `parts` what `carries` it, as leaves and as planes, nothing where that is not known; and the leaves of each pattern."""

    parts: Sequence[Primitive]
    carries: Sequence[frozenset[tuple[str, int, int]]]
    patterns: Sequence[frozenset[int]]

    @staticmethod
    def of(program: Program, constraints: Sequence[Constraint]) -> Placements:
        parts = list(leaves(program))
        found: list[set[tuple[str, int, int]]] = [set() for _ in parts]
        slack = TOUCH * longest(parts)
        for seat in seats(program):
            plane = ("plane", seat.face.axis, round(place_of(seat.face, parts) / slack / 2))
            found[seat.own.leaf] |= {plane, ("leaf", seat.face.leaf, 0)}
        patterns = [frozenset(ref.leaf for ref in c.of) for c in constraints if c.kind in PATTERNS]
        return Placements(parts, [frozenset(each) for each in found], patterns)

    def are_near(self, a: int, b: int) -> bool:
        """Whether two leaves are placed alike: round ones along one direction, and on one carrier or in one plane if that is known."""
        if any(a in pattern and b in pattern for pattern in self.patterns):
            return True
        if self.parts[a].kind in WITH_AXIS and self.parts[b].kind in WITH_AXIS:
            along, other = (axes(self.parts[i])[2] for i in (a, b))
            if abs(dot(along, other)) < 1 - PARALLEL:
                return False
        return not self.carries[a] or not self.carries[b] or bool(self.carries[a] & self.carries[b])
