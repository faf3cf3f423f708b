"""Numbers as a person would write them: float noise trimmed relative to the model's size, no exponents where none are needed.

And sums of named parameters, as OpenSCAD, Python and µcad read them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

from imdim.program.tree import Primitive, Program, leaves, map_leaves

SIGNIFICANT_DIGITS = 9
LARGEST_PART = 12  # a fraction with a larger denominator is none that a person would write
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


@dataclass(frozen=True)
class Term:
    """``coefficient * name``: a simple fraction, or any number for a place on a circle."""

    name: str
    coefficient: Fraction | float


@dataclass(frozen=True)
class Expression:
    """A sum of terms and a constant."""

    terms: tuple[Term, ...]
    constant: float


def simple_fraction(value: float) -> Fraction | float:
    """The fraction that a person would write for a coefficient, or the number itself."""
    fraction = Fraction(value).limit_denominator(LARGEST_PART)
    return fraction if abs(float(fraction) - value) < 1e-9 else value


def constants(values: Sequence[float]) -> tuple[Expression, ...]:
    """Numbers that follow no name."""
    return tuple(Expression((), v) for v in values)


def write_expression(expression: Expression, number: Callable[[float], str], unit: str = "") -> str:
    """The sum as OpenSCAD, Python and, with a `unit` behind constants, µcad read it; `number` rounds the constant."""
    constant = number(expression.constant)
    if not expression.terms:
        return constant + unit
    parts = [_term(t) for t in expression.terms] + ([constant + unit] if float(constant) else [])
    return " + ".join(parts).replace("+ -", "- ")


def write_moves(moves: Sequence[tuple[str, Sequence[Expression]]], number: Callable[[float], str], times: str) -> str:
    """Three lengths, each the sum of the steps along it, `times` the loop variable in front of each step."""
    texts = []
    for axis in range(3):
        steps = [(i, write_expression(step[axis], number)) for i, step in moves]
        texts.append(" + ".join(f"({t}){times}{i}" if " " in t else f"{t}{times}{i}" for i, t in steps if t != "0") or "0")
    return ", ".join(texts)


def _term(term: Term) -> str:
    sign, size = "-" if term.coefficient < 0 else "", abs(term.coefficient)
    if isinstance(size, float):
        return f"{sign}{term.name}*{plain(round(size, 12))}"
    text = term.name if size.numerator == 1 else f"{size.numerator}*{term.name}"
    return sign + (text if size.denominator == 1 else f"{text}/{size.denominator}")
