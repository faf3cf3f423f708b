"""Numbers as a person would write them: float noise trimmed relative to the model's size, no exponents where none are needed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

from imdim.program.tree import Primitive, Program, leaves, map_leaves

SIGNIFICANT_DIGITS = 9
MAX_SEGMENTS = 4096  # facets of a circle in meshes and texts; a sphere has their square


@dataclass(frozen=True)
class Rounding:
    """Lengths keep `decimals` decimals (negative: tens, hundreds), angles nine."""

    decimals: int

    @staticmethod
    def of(program: Program) -> Rounding:
        """Nine significant digits of the largest size in the program, wherever it lies."""
        largest = max(max(leaf.size) for leaf in leaves(program))
        return Rounding(SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(largest)))

    def length(self, value: float) -> str:
        """A coordinate, rounded."""
        return plain(round(value, self.decimals))

    def size(self, value: float) -> str:
        """A size, rounded, but never to zero unless it is zero: that would be no primitive."""
        return plain(round(value, self.decimals) or value)

    def angle(self, degrees: float) -> str:
        """Degrees, rounded."""
        return plain(round(degrees, SIGNIFICANT_DIGITS))

    def primitive(self, leaf: Primitive) -> Primitive:
        """The primitive that the rounded texts describe."""
        size = tuple(float(self.size(s)) for s in leaf.size)
        (cx, cy, cz), (rx, ry, rz) = map(self.length, leaf.center), map(self.angle, leaf.rotation)
        return Primitive(leaf.kind, size, (float(cx), float(cy), float(cz)), (float(rx), float(ry), float(rz)))


def round_program(program: Program) -> Program:
    """The program with every number as it is written to files."""
    rounding = Rounding.of(program)
    return map_leaves(program, lambda _, leaf: rounding.primitive(leaf))


def plain(value: float) -> str:
    """The shortest decimal text that reads back as `value`; integers without a point, zero without a sign."""
    if value == 0:
        return "0"
    return repr(float(value)).removesuffix(".0")


def to_fixed_point(text: str) -> str:
    """A decimal text without an exponent."""
    return format(Decimal(text), "f")
