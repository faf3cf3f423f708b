"""Which relations hold by chance: what the numbers say and no designer meant. An edit is not to be bound by them.

That a ball and a hole measure the same is chance, and so is a face at the level of the middle of something else, or a place in the air
where a cut ends that goes through. Two holes that end in one face are level by that face, not by each other. Where a cone narrows to the
shaft or hole that it meets, both have one radius.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from imdim.export.seats import seats, sticks_out
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.patterns.congruence import group_by_fit
from imdim.program.rewrite.containment import along, axes, dot
from imdim.program.roles import name_constraints, roles_of, signs
from imdim.program.tree import SIZE_NAMES, Primitive, Program, Vec3, leaves, longest
from imdim.program.vectors import minus

ALIGNED = 1e-9  # by which the cosine between two axes may lack of 1
TOUCH = 1e-3  # of the larger part's size, by which an end may be off that meets another one: it may overlap a little


def without_chance(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints that a designer may have meant, named anew where some went."""
    roles, air = roles_of(program), _in_the_air(program)
    out: list[Constraint] = []
    for constraint in constraints:
        meant = _seen(constraint.of, air)
        if constraint.kind in ("aligned", "coplanar"):
            mixed = constraint.kind == "aligned" and len({bool(ref.feature) for ref in constraint.of}) > 1
            out += [] if mixed else _of_some(constraint, meant)
        elif constraint.kind == "equal" and all(ref.leaf != WORLD for ref in constraint.of):
            groups = group_by_fit(meant, lambda group, ref: (roles[group[0].leaf], group[0].feature) == (roles[ref.leaf], ref.feature))
            for group in _joined_ends(groups, list(leaves(program)), signs(program)):
                out += _of_some(constraint, group)
        else:
            out.append(constraint)
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def _seen(of: Sequence[Ref], air: Mapping[Ref, Ref | None]) -> list[Ref]:
    """Without ends in the air; where a cut ends in a face that is not among them, that face in its place."""
    seen = (ref if ref not in air or air[ref] in of else air[ref] for ref in of)
    return list(dict.fromkeys(ref for ref in seen if ref is not None))


def _of_some(constraint: Constraint, of: Sequence[Ref]) -> list[Constraint]:
    return [replace(constraint, of=tuple(of))] if len(of) > 1 else []


def _joined_ends(groups: Sequence[list[Ref]], parts: Sequence[Primitive], sign: Sequence[int]) -> list[list[Ref]]:
    """The groups, those as one of which a cone's end meets a round part of the same axis."""
    out: list[list[Ref]] = []
    for group in groups:
        met = [other for other in out if any(_meet(a, b, parts) and sign[a.leaf] == sign[b.leaf] for a in group for b in other)]
        out = [other for other in out if other not in met] + [[ref for joined in (*met, group) for ref in joined]]
    return out


def _meet(a: Ref, b: Ref, parts: Sequence[Primitive]) -> bool:
    """Whether the radii of two parts are of places on one axis that meet: both ends of cones, or one and somewhere along a cylinder."""
    p, q = (parts[ref.leaf] for ref in (a, b))
    mine, other = _places(p, a.feature), _places(q, b.feature)
    if mine is None or other is None or "cone" not in (p.kind, q.kind):
        return False
    axis, slack = axes(p)[2], TOUCH * max(*p.size, *q.size)
    off = minus(q.center, p.center)
    if abs(dot(axes(q)[2], axis)) < 1 - ALIGNED or math.dist(off, [dot(off, axis) * d for d in axis]) > slack:
        return False
    (low, high), (first, last) = (sorted(dot(place, axis) for place in places) for places in (mine, other))
    return max(low, first) <= min(high, last) + slack


def _places(part: Primitive, feature: str) -> tuple[Vec3, Vec3] | None:
    """From where to where on its axis a part has a radius; None for other sizes."""
    ends = {("cylinder", "r"): (-1, 1), ("cone", "r_bottom"): (-1, -1), ("cone", "r_top"): (1, 1)}.get((part.kind, feature))
    if ends is None:
        return None
    low, high = (along(part.center, axes(part)[2], side * part.size[-1] / 2) for side in ends)
    return low, high


def _in_the_air(program: Program) -> dict[Ref, Ref | None]:
    """The ends of cuts where they leave what they cut, each with the face that it lies in, None beyond it; and the sizes across them."""
    parts, sign = list(leaves(program)), signs(program)
    largest = longest(parts)
    found: dict[Ref, Ref | None] = {}
    for seat in seats(program):
        end, face = seat.own, seat.face
        if sign[end.leaf] < 0 and not seat.word and end.column >= 0:
            found[Ref(end.leaf, end.local)] = None if sticks_out(seat, parts, largest) else Ref(face.leaf, face.local)
            found[Ref(end.leaf, SIZE_NAMES[parts[end.leaf].kind][end.column])] = None
    return found
