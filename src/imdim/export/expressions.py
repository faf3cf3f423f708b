"""Sums of named parameters, as OpenSCAD, Python and µcad read them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from imdim.export.numbers import plain


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


def _term(term: Term) -> str:
    sign, size = "-" if term.coefficient < 0 else "", abs(term.coefficient)
    if isinstance(size, float):
        return f"{sign}{term.name}*{plain(round(size, 12))}"
    text = term.name if size.numerator == 1 else f"{size.numerator}*{term.name}"
    return sign + (text if size.denominator == 1 else f"{text}/{size.denominator}")
