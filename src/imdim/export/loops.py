"""Repeats in terms of named parameters: how often, and how far apart, so that a loop can be written that follows the names.

Copy k is ``Q_k x + T_k`` of the first; Q_k is a matrix of numbers, and T_k follows from the expressions of the centres. It has to be
the same for all leaves of the part, and to be what the steps, the centre or the plane of the repeat say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product

from imdim.export.numbers import Expression, Term, simple_fraction
from imdim.export.repeat_rows import world_axis
from imdim.program.motions import Motion
from imdim.program.repeats import Repeat, size

AGREE = 1e-7  # of the largest size, and of coefficients

Affine = dict[str, float]  # coefficients by name, the constant under ""
Vector = list[Affine]


@dataclass(frozen=True)
class Loop:
    """`counts` are the names of the counts. `steps` belong to rows and grids, `shift` to mirror images: where the origin comes to lie.

    `center` is the point that circles turn about, 0 along their axis where that is one of the world's. `part` is what one copy is called.
    """

    counts: tuple[str, ...]
    steps: tuple[tuple[Expression, ...], ...] = ()
    center: tuple[Expression, ...] = ()
    shift: tuple[Expression, ...] = ()
    part: str = ""


def loop_of(
    repeat: Repeat, first: int, sizes: Sequence[Sequence[Expression]], centers: Sequence[Sequence[Expression]], length: float
) -> Loop | None:
    """The loop of a repeat whose first leaf is number `first`, without names for its counts; None where expressions do not repeat."""
    own, motions = size(repeat.part), list(repeat.motions())
    at = [[_affine(e) for e in row] for row in centers[first : first + own * repeat.number]]
    shifts = [_minus(at[k * own], _turn(m, at[0])) for k, m in enumerate(motions)]
    slack = AGREE * length
    for k, motion in enumerate(motions):
        for j in range(own):
            mine, its = sizes[first + k * own + j], sizes[first + j]
            moved = _sum((_turn(motion, at[j]), shifts[k]))
            if not _same(map(_affine, mine), map(_affine, its), slack) or not _same(moved, at[k * own + j], slack):
                return None
    built, expected = _BUILD[repeat.kind](repeat, shifts)
    return built if all(_same(e, s, slack) for e, s in zip(expected, shifts, strict=True)) else None


def _steps(repeat: Repeat, shifts: list[Vector]) -> tuple[Loop, list[Vector]]:
    strides = [repeat.counts[1], 1] if repeat.kind == "grid" else [1]
    steps = [shifts[stride] for stride in strides]
    expected = [_sum(_scale(s, n) for n, s in zip(numbers, steps, strict=True)) for numbers in product(*map(range, repeat.counts))]
    return Loop((), steps=tuple(tuple(map(_expression, s)) for s in steps)), expected


def _circle(repeat: Repeat, shifts: list[Vector]) -> tuple[Loop, list[Vector]]:
    """The centre solves (1 - Q) c = T, which leaves it free along the axis."""
    axis = world_axis(repeat.axis)
    motions = list(repeat.motions())
    if axis is None:
        center = [{"": c} for c in repeat.point]
    else:
        u, v = (axis + 1) % 3, (axis + 2) % 3
        q = motions[1].linear
        a, b, c, d = 1 - q[u][u], -q[u][v], -q[v][u], 1 - q[v][v]
        determinant = a * d - b * c
        center: Vector = [{}, {}, {}]
        center[u] = _sum([_scale([shifts[1][u]], d / determinant), _scale([shifts[1][v]], -b / determinant)])[0]
        center[v] = _sum([_scale([shifts[1][u]], -c / determinant), _scale([shifts[1][v]], a / determinant)])[0]
    expected = [_minus(center, _turn(m, center)) for m in motions]
    return Loop((), center=tuple(map(_expression, center))), expected


_BUILD: dict[str, Callable[[Repeat, list[Vector]], tuple[Loop, list[Vector]]]] = {
    "linear": _steps,
    "grid": _steps,
    "circular": _circle,
    "mirror": lambda _, shifts: (Loop((), shift=tuple(map(_expression, shifts[1]))), shifts),
}


def less(a: Sequence[Expression], b: Sequence[Expression]) -> tuple[Expression, ...]:
    """a - b."""
    return tuple(map(_expression, _minus(list(map(_affine, a)), list(map(_affine, b)))))


def _affine(e: Expression) -> Affine:
    out: Affine = {"": e.constant}
    for term in e.terms:
        out[term.name] = out.get(term.name, 0.0) + float(term.coefficient)
    return out


def _expression(a: Affine) -> Expression:
    terms = [(name, value) for name, value in a.items() if name and abs(value) > AGREE]
    return Expression(tuple(Term(name, simple_fraction(value)) for name, value in terms), a.get("", 0.0))


def _turn(motion: Motion, v: Vector) -> Vector:
    return [_sum(_scale([a], q) for a, q in zip(v, row, strict=True))[0] for row in motion.linear]


def _scale(v: Vector, factor: float) -> Vector:
    return [{name: factor * value for name, value in a.items()} for a in v]


def _sum(vectors: Iterable[Vector]) -> Vector:
    out: Vector = []
    for v in vectors:
        out = out or [{} for _ in v]
        for total, a in zip(out, v, strict=True):
            for name, value in a.items():
                total[name] = total.get(name, 0.0) + value
    return out


def _minus(a: Vector, b: Vector) -> Vector:
    return _sum((a, _scale(b, -1.0)))


def _same(a: Iterable[Affine], b: Iterable[Affine], slack: float) -> bool:
    return all(abs(x.get(n, 0.0) - y.get(n, 0.0)) <= (AGREE if n else slack) for x, y in zip(a, b, strict=True) for n in {*x, *y})
