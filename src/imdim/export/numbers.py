"""Numbers as a person would write them: float noise trimmed relative to the model's size, no exponents where none are needed.

And sums of named parameters, as OpenSCAD, Python and µcad read them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import partial

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Loop, Outline, Point, Ring, Vertex, arc_center, arc_radius, circle_of, ellipse, ring_curves
from imdim.program.tree import ANGLES, SIZE_NAMES, Primitive, Program, leaves, longest, map_leaves

SIGNIFICANT_DIGITS = 9
LARGEST_PART = 12  # a fraction with a larger denominator is none that a person would write
ON_CIRCLE = 1e-8  # by which a cosine may be off: what files keep of places
ROUNDER, HARDLY_OFF = 2, 3.0  # digits, and units of the last one that is kept
PROJECTED = (1, 50)  # times that a place is moved to one circle, and to two in turn, which may all but touch
MAX_SEGMENTS = 4096  # facets of a circle in meshes and texts; a sphere has their square


@dataclass(frozen=True)
class Rounding:
    """Lengths keep `decimals` decimals (negative: tens, hundreds), angles nine."""

    decimals: int

    @staticmethod
    def of(program: Program) -> Rounding:
        """Nine significant digits of the largest size in the program, wherever it lies."""
        return Rounding(SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(longest(leaves(program)))))

    def length(self, value: float) -> str:
        """A coordinate, rounded."""
        return plain(round(value, self.decimals))

    def size(self, value: float) -> str:
        """A size, rounded, but never to zero unless it is zero: that would be no primitive."""
        return plain(round(value, self.decimals) or value)

    @staticmethod
    def angle(degrees: float) -> str:
        """Degrees, rounded."""
        return plain(round(degrees, SIGNIFICANT_DIGITS))

    def size_of(self, name: str, value: float) -> str:
        """A size of a primitive by its name: degrees, or a length."""
        return plain(round(value, SIGNIFICANT_DIGITS) or value) if name in ANGLES else self.size(value)

    def constant_of(self, name: str, value: float) -> str:
        """The constant of a sum that is a size of a primitive."""
        return self.angle(value) if name in ANGLES else self.length(value)

    def outline(self, outline: Outline) -> Outline:
        """The outline with rounded vertices, without the curves that are too short for that; as it is where none would be left.

        Bulges, which are ratios, keep nine decimals.
        """
        loops = [self._loop(loop) for loop in outline.loops]
        kept = tuple(loop for loop in loops if loop is not None)
        return Outline(kept) if kept else outline

    def _loop(self, loop: Loop) -> Loop | None:
        """The loop, or None where no more than a line is left."""
        if isinstance(loop, Ellipse):
            rx, ry = (float(self.size(r)) for r in (loop.rx, loop.ry))
            return ellipse(rx, ry, float(self.length(loop.x)), float(self.length(loop.y)), float(self.angle(loop.angle)))
        rounded = [(float(self.length(x)), float(self.length(y)), round(b, SIGNIFICANT_DIGITS) + 0.0) for x, y, b in loop]
        following = [*rounded[1:], rounded[0]]
        lasting = [vertex[:2] != after[:2] for vertex, after in zip(rounded, following, strict=True)]
        on_circles = self._put_on_circles(loop, rounded) if all(lasting) and circle_of(loop) is None else rounded
        kept = tuple(vertex for vertex, lasts in zip(on_circles, lasting, strict=True) if lasts)
        return kept if len(kept) > 2 or (len(kept) == 2 and kept[0][2] + kept[1][2] != 0) else None

    def _put_on_circles(self, loop: Ring, rounded: list[Vertex]) -> list[Vertex]:
        """The `rounded` vertices of a loop, those of arcs whose circles have round numbers exactly on these: walls on one circle are then
        one wall, whatever draws them, where six decimals of their ends would part them by a hair. Half turns stay half turns."""
        circles = [self._round_circle(curve) if curve[4] else None for curve in ring_curves(loop)]
        ends = [_project((x, y), [c for c in (circles[k - 1], circles[k]) if c]) for k, (x, y, _) in enumerate(rounded)]
        out: list[Vertex] = []
        for circle, (_, _, bulge), start, end in zip(circles, rounded, ends, [*ends[1:], ends[0]], strict=True):
            if circle is not None and abs(bulge) != 1:
                (cx, cy), way = circle[0], math.copysign(1.0, bulge)
                turn = math.atan2(end[1] - cy, end[0] - cx) - math.atan2(start[1] - cy, start[0] - cx)
                bulge = math.tan(way * (way * turn % (2 * math.pi)) / 4)
            out.append((*start, bulge))
        return out

    def _round_circle(self, arc: Curve) -> tuple[Point, float] | None:
        """Centre and radius of an arc, where all are numbers of ROUNDER digits less than are kept, but for what its ends' digits leave."""
        numbers = [*arc_center(arc), arc_radius(arc)]
        x, y, radius = near = [round(n, self.decimals - ROUNDER) for n in numbers]
        off = max(abs(a - b) for a, b in zip(numbers, near, strict=True))
        return ((x, y), radius) if radius > 0 and off <= HARDLY_OFF * 10.0**-self.decimals else None

    def primitive(self, leaf: Primitive) -> Primitive:
        """The primitive that the rounded texts describe."""
        size = tuple(float(self.size_of(name, s)) for name, s in zip(SIZE_NAMES[leaf.kind], leaf.size, strict=True))
        (cx, cy, cz), (rx, ry, rz) = map(self.length, leaf.center), map(self.angle, leaf.rotation)
        outline = leaf.outline and self.outline(leaf.outline)
        if outline and leaf.kind == "revolve" and outline.bounds[0][0] < 0:
            outline = leaf.outline  # an arc that touches the axis would cross it
        place = (float(cx), float(cy), float(cz)), (float(rx), float(ry), float(rz))
        try:
            return Primitive(leaf.kind, size, *place, outline)
        except ValueError:
            if leaf.kind != "drafted":
                raise
            return Primitive(leaf.kind, size, *place, leaf.outline)  # what touched does so no more to these digits


def _project(place: Point, circles: Sequence[tuple[Point, float]]) -> Point:
    """The place on one circle, or on two, next to one that is all but there."""
    x, y = place
    for _ in range(len(circles) and PROJECTED[len(circles) - 1]):
        for (cx, cy), radius in circles:
            stretch = radius / math.hypot(x - cx, y - cy)
            x, y = cx + (x - cx) * stretch, cy + (y - cy) * stretch
    return x, y


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


def angle_on_circle(coefficient: float) -> tuple[int, float] | None:
    """A divisor and the degrees, in halves, whose cosine over that is a coefficient; None where there are none. A diameter is halved, and
    what lies midway between two of them is a quarter of each."""
    for divisor in (2, 4, 1):
        cosine = divisor * coefficient
        if 0 < cosine < 1:
            degrees = round(2 * math.degrees(math.acos(cosine))) / 2
            if abs(math.cos(math.radians(degrees)) - cosine) < ON_CIRCLE:
                return divisor, degrees
    return None


def weighted_sum(*parts: tuple[Expression, Fraction | float]) -> Expression:
    """Expressions times factors, in the order in which their names first stand."""
    total: dict[str, Fraction | float] = {}
    for expression, factor in parts:
        for term in expression.terms:
            total[term.name] = total.get(term.name, Fraction(0)) + factor * term.coefficient
    constant = sum(float(factor) * expression.constant for expression, factor in parts)
    return Expression(tuple(Term(name, c) for name, c in total.items() if abs(c) > 0), constant)


def constants(values: Sequence[float]) -> tuple[Expression, ...]:
    """Numbers that follow no name."""
    return tuple(Expression((), v) for v in values)


def write_expression(expression: Expression, number: Callable[[float], str], unit: str = "", circled: bool = False) -> str:
    """The sum as OpenSCAD, Python and, with a `unit` behind constants, µcad read it; `number` rounds the constant. Where `circled`, places
    on a circle are written with cosines of degrees, as OpenSCAD reads them."""
    constant = number(expression.constant)
    if not expression.terms:
        return constant + unit
    parts = [_term(t, circled) for t in expression.terms] + ([constant + unit] if float(constant) else [])
    return " + ".join(parts).replace("+ -", "- ")


def write_moves(moves: Sequence[tuple[str, Sequence[Expression]]], number: Callable[[float], str], times: str) -> str:
    """Three lengths, each the sum of the steps along it, `times` the loop variable in front of each step."""
    texts = []
    for axis in range(3):
        steps = [(i, write_expression(step[axis], number)) for i, step in moves]
        texts.append(" + ".join(f"({t}){times}{i}" if " " in t else f"{t}{times}{i}" for i, t in steps if t != "0") or "0")
    return ", ".join(texts)


def write_sizes(leaf: Primitive, sizes: Sequence[Expression], rounding: Rounding) -> list[str]:
    """The sizes of a leaf. A bare number is a size, which never vanishes; the constant of a sum may."""
    named = zip(SIZE_NAMES[leaf.kind], sizes, strict=True)
    return [write_expression(s, partial(rounding.constant_of if s.terms else rounding.size_of, name)) for name, s in named]


def _term(term: Term, circled: bool) -> str:
    sign, size = "-" if term.coefficient < 0 else "", abs(term.coefficient)
    found = angle_on_circle(size) if circled and isinstance(size, float) else None
    if found is not None:
        divisor, degrees = found
        return f"{sign}{term.name}{f'/{divisor}' if divisor > 1 else ''}*cos({degrees:g})"
    if isinstance(size, float):
        return f"{sign}{term.name}*{plain(round(size, 12))}"
    text = term.name if size.numerator == 1 else f"{size.numerator}*{term.name}"
    return sign + (text if size.denominator == 1 else f"{text}/{size.denominator}")
