"""Which relations hold by chance: what the numbers say and no designer meant. An edit is not to be bound by them.

That a ball and a hole measure the same is chance, and so is a face at the level of the middle of something else, or a place in the air
where a cut ends that goes through. Two holes that end in one face are level by that face, not by each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from imdim.export.seats import seats, sticks_out
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.roles import name_constraints, roles_of, signs
from imdim.program.tree import SIZE_NAMES, Program, leaves, longest


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
            groups = dict.fromkeys((roles[ref.leaf], ref.feature) for ref in meant)
            for group in groups:
                out += _of_some(constraint, [ref for ref in meant if (roles[ref.leaf], ref.feature) == group])
        else:
            out.append(constraint)
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def _seen(of: Sequence[Ref], air: Mapping[Ref, Ref | None]) -> list[Ref]:
    """Without ends in the air; where a cut ends in a face that is not among them, that face in its place."""
    seen = (ref if ref not in air or air[ref] in of else air[ref] for ref in of)
    return list(dict.fromkeys(ref for ref in seen if ref is not None))


def _of_some(constraint: Constraint, of: Sequence[Ref]) -> list[Constraint]:
    return [replace(constraint, of=tuple(of))] if len(of) > 1 else []


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
