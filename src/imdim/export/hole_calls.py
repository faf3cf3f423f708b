"""Holes as build123d's own operations: a bore with its counterbore or countersink is one call, placed where a screw would enter.

`Hole`, `CounterBoreHole` and `CounterSinkHole` cut downwards from their origin and as far above it, so that they leave another solid where
something stands over the opening. Whether they do is asked of the exact solid; what would change keeps its primitives.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.export.numbers import Expression, Rounding, simple_fraction, weighted_sum, write_expression
from imdim.export.parameters import Parameters
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.holes import find_holes
from imdim.geometry.solid import exact_rotation, to_manifold, volume_iou
from imdim.geometry.surface import vec
from imdim.program.holes import Hole
from imdim.program.motions import move_leaf
from imdim.program.repeats import Folded, Group, Repeat, instances, starts
from imdim.program.roles import signs
from imdim.program.tree import OPS, Combine, Primitive, Program, Vec3, combine_all, fold, leaves

SAME = 1e-7  # of the volume, by which the solid may differ
MOST = 200  # holes of a part that are looked at
STRAIGHT = 1e-9  # by which a direction along one of the world's axes may be off
DIGITS_LOST = 2  # of a length, where an opening was found by halving
_UPWARDS: Mapping[tuple[int, int], Vec3] = {  # world axis and sense that z is turned to
    (0, 1): (0.0, 90.0, 0.0),
    (0, -1): (0.0, -90.0, 0.0),
    (1, 1): (-90.0, 0.0, 0.0),
    (1, -1): (90.0, 0.0, 0.0),
    (2, 1): (0.0, 0.0, 0.0),
    (2, -1): (180.0, 0.0, 0.0),
}
_CALLS = {"through": "Hole", "blind": "Hole", "counterbore": "CounterBoreHole", "countersink": "CounterSinkHole"}


@dataclass(frozen=True)
class HoleCall:
    """A call that makes a hole at the middle `at` of its opening, with z turned out of the part by `turn`."""

    at: tuple[Expression, ...]
    turn: Vec3
    text: str


@dataclass(frozen=True)
class HoleCalls:
    """Calls by the number of the primitive in whose place they stand, and the other primitives of the same holes, which are not written."""

    calls: Mapping[int, HoleCall] = field(default_factory=dict)
    dropped: frozenset[int] = frozenset()

    @staticmethod
    def of(program: Program, folded: Folded, named: Parameters, rounding: Rounding, deadline: Deadline = NEVER) -> HoleCalls:
        """Those holes of a program, the expansion of `folded`, that one call each can make without another solid; all or none of them
        past the `deadline` (by default never)."""
        copies = instances(folded)
        found = [h for h in _candidates(program, folded, named, rounding) if all(copies[leaf][0] == leaf for leaf in h.leaves)]
        if found and not _keeps(program, found, copies):
            found = [h for h in found if not deadline.has_passed() and _keeps(program, [h], copies)]
            found = found if found and _keeps(program, found, copies) else []
        dropped = frozenset(leaf for h in found for leaf in h.leaves[1:])
        return HoleCalls({h.leaves[0]: h.call for h in found}, dropped)


@dataclass(frozen=True)
class _Candidate:
    """A hole that one call may make in place of its `leaves`, the bore first, and what that cuts."""

    leaves: tuple[int, ...]
    call: HoleCall
    cuts: tuple[Primitive, ...]


def _candidates(program: Program, folded: Folded, named: Parameters, rounding: Rounding) -> Iterator[_Candidate]:
    holes = find_holes(program)
    if len(holes) > MOST:
        return
    parts, sign = list(leaves(program)), signs(program)
    uses = Counter(leaf for hole in holes for leaf in hole.leaves)
    together = {leaf: number for number, group in enumerate(_unions(folded)) for leaf in group}
    for hole in holes:
        own = sorted(hole.leaves, key=lambda leaf: leaf not in hole.bore.leaves)
        are_cut = all(sign[leaf] < 0 and uses[leaf] == 1 for leaf in own)
        kinds = [parts[leaf].kind for leaf in own]
        fits = kinds == ["cylinder", *{"counterbore": ["cylinder"], "countersink": ["cone"]}.get(hole.kind, [])]
        if hole.kind in _CALLS and are_cut and fits and (len(own) == 1 or len({together.get(leaf, -leaf - 1) for leaf in own}) == 1):
            found = _candidate(hole, own, parts, named, rounding)
            if found is not None:
                yield found


def _unions(folded: Folded, first: int = 0) -> Iterator[list[int]]:
    """The primitives that are united, or cut from one body, with each other."""
    if isinstance(folded, Repeat):
        yield from _unions(folded.part, first)
    elif isinstance(folded, Group):
        parts = list(starts(folded, first))
        if folded.op != "intersection":
            yield [at for n, (part, at) in enumerate(parts) if isinstance(part, Primitive) and (n or folded.op == "union")]
        for part, at in parts:
            yield from _unions(part, at)


def _candidate(hole: Hole, own: Sequence[int], parts: Sequence[Primitive], named: Parameters, rounding: Rounding) -> _Candidate | None:
    """The call, in the expressions of the primitives; None where the hole runs along none of the world's axes."""
    up, point = -np.array(hole.direction), np.array(hole.point)
    axis = int(np.abs(up).argmax())
    bore, head = own[0], own[-1]
    deep = float((point - parts[bore].center) @ up) + parts[bore].size[-1] / 2
    if abs(abs(up[axis]) - 1) > STRAIGHT or deep <= 0:
        return None
    sense, half = 1 if up[axis] > 0 else -1, Fraction(1, 2)
    # by how much the cutter overshoots the opening
    over = round(float((np.array(parts[head].center) - point) @ up) + parts[head].size[-1] / 2, rounding.decimals - DIGITS_LOST)
    at = list(named.centers[head])
    at[axis] = weighted_sum((at[axis], Fraction(1)), (named.sizes[head][-1], sense * half), (Expression((), over), Fraction(-sense)))
    depth = weighted_sum((at[axis], Fraction(sense)), (named.centers[bore][axis], Fraction(-sense)), (named.sizes[bore][-1], half))
    opening = _Opening(point, up, deep, over)
    radius, *numbers = [_write(e, rounding) for e in (named.sizes[bore][0], depth)]
    cuts = [opening.between(parts[bore], parts[bore].size[:1], -deep, deep if head == bore else 0.0)]
    if hole.kind == "counterbore":
        wide, low = _counterbore(parts[head], named.sizes[head], opening)
        numbers, cuts = [_write(e, rounding) for e in wide] + numbers, [*cuts, low]
    elif hole.kind == "countersink":
        (wide, run, rise, angle), low = _countersink(parts[head], named.sizes[head], opening)
        numbers, cuts = [_write(wide, rounding), *numbers, _angle(run, rise, angle, rounding)], [*cuts, *low]
    text = f"{_CALLS[hole.kind]}({', '.join([radius, *numbers])})"
    return _Candidate(tuple(own), HoleCall(tuple(at), _UPWARDS[axis, sense], text), tuple(cuts))


@dataclass(frozen=True)
class _Opening:
    """Where a hole is entered, the unit vector `up` out of it, how `deep` it is, and by how much its head's cutter is `over` it."""

    point: np.ndarray
    up: np.ndarray
    deep: float
    over: float

    def between(self, leaf: Primitive, radii: Sequence[float], low: float, high: float) -> Primitive:
        """A cylinder or a cone that is turned as a leaf is, from `low` to `high` above the opening."""
        kind = "cylinder" if len(radii) == 1 else "cone"
        return Primitive(kind, (*radii, high - low), vec(self.point + self.up * (low + high) / 2), leaf.rotation)


def _counterbore(head: Primitive, sizes: Sequence[Expression], opening: _Opening) -> tuple[tuple[Expression, Expression], Primitive]:
    """Radius and depth of a counterbore, and what it cuts."""
    depth = weighted_sum((sizes[-1], Fraction(1)), (Expression((), opening.over), Fraction(-1)))
    return (sizes[0], depth), opening.between(head, head.size[:1], opening.over - head.size[-1], opening.deep)


def _countersink(
    head: Primitive, sizes: Sequence[Expression], opening: _Opening
) -> tuple[tuple[Expression, Expression, Expression, float], tuple[Primitive, Primitive]]:
    """A countersink's radius at the opening, by how much that is more than at its end, its depth, and its whole angle in degrees; and what
    it cuts: a cone down to its tip, and a cylinder above the opening."""
    is_up = float(exact_rotation(head)[:, 2] @ opening.up) > 0
    narrow, wide = (0, 1) if is_up else (1, 0)
    slope, over = (head.size[wide] - head.size[narrow]) / head.size[-1], opening.over
    radius = weighted_sum((sizes[wide], Fraction(1)), (Expression((), over * slope), Fraction(-1)))
    run = weighted_sum((radius, Fraction(1)), (sizes[narrow], Fraction(-1)))
    rise = weighted_sum((sizes[-1], Fraction(1)), (Expression((), over), Fraction(-1)))
    largest = head.size[wide] - over * slope
    cone = opening.between(head, (0.0, largest) if is_up else (largest, 0.0), -largest / slope, 0.0)
    above = opening.between(replace(head, kind="cylinder", size=(largest, 1.0)), (largest,), 0.0, opening.deep)
    return (radius, run, rise, math.degrees(2 * math.atan(slope))), (cone, above)


def _write(e: Expression, rounding: Rounding) -> str:
    e = Expression(tuple(type(t)(t.name, simple_fraction(float(t.coefficient))) for t in e.terms), e.constant)
    return write_expression(e, rounding.length)


def _angle(run: Expression, rise: Expression, degrees: float, rounding: Rounding) -> str:
    """The whole angle of a cone, by its radii and its height where these have names."""
    if not run.terms and not rise.terms:
        return rounding.angle(degrees)
    over, under = (f"({text})" if " " in text else text for text in (_write(run, rounding), _write(rise, rounding)))
    return f"2 * degrees(atan({over} / {under}))"


def _keeps(program: Program, found: Sequence[_Candidate], copies: Sequence[tuple[int, object]]) -> bool:
    """Whether the calls, in place of their primitives and of all copies of these, leave the solid as it is."""
    cuts = {leaf: h.cuts for h in found for leaf in h.leaves}

    def change(number: int, leaf: Primitive) -> Program:
        source, motion = copies[number]
        own = cuts.get(source)
        return leaf if own is None else combine_all("union", [move_leaf(cut, motion) for cut in own])  # type: ignore[arg-type]

    join = {op: (lambda a, b, op=op: Combine(op, a, b)) for op in OPS}  # type: ignore[arg-type]
    after = fold(program, change, join)  # type: ignore[arg-type]
    return 1 - volume_iou(to_manifold(program, CHECK_SEGMENTS), to_manifold(after, CHECK_SEGMENTS)) <= SAME
