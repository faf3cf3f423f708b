"""Which relations hold by chance: what the numbers say and no designer meant. An edit is not to be bound by them.

That a ball and a hole measure the same is chance, and so is a face at the level of the middle of something else, or a place in the air
where a cut ends that goes through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imdim.export.seats import seats, sticks_out
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.roles import name_constraints, roles_of, signs
from imdim.program.tree import SIZE_NAMES, Program, leaves


def without_chance(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints that a designer may have meant, named anew where some went."""
    roles, air = roles_of(program), _in_the_air(program)
    out: list[Constraint] = []
    for constraint in constraints:
        if constraint.kind in ("aligned", "coplanar"):
            mixed = constraint.kind == "aligned" and len({bool(ref.feature) for ref in constraint.of}) > 1
            out += [] if mixed else _of_some(constraint, [ref for ref in constraint.of if ref not in air])
        elif constraint.kind == "equal" and all(ref.leaf != WORLD for ref in constraint.of):
            meant = [ref for ref in constraint.of if ref not in air]
            groups = dict.fromkeys((roles[ref.leaf], ref.feature) for ref in meant)
            for group in groups:
                out += _of_some(constraint, [ref for ref in meant if (roles[ref.leaf], ref.feature) == group])
        else:
            out.append(constraint)
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def _of_some(constraint: Constraint, of: Sequence[Ref]) -> list[Constraint]:
    return [replace(constraint, of=tuple(of))] if len(of) > 1 else []


def _in_the_air(program: Program) -> set[Ref]:
    """The ends of cuts beyond what they cut, and the sizes across them."""
    parts, sign = list(leaves(program)), signs(program)
    ends = [s.own for s in seats(program) if sign[s.own.leaf] < 0 and not s.word and s.own.column >= 0 and sticks_out(s, parts)]
    faces = {Ref(end.leaf, end.local) for end in ends}
    return faces | {Ref(end.leaf, SIZE_NAMES[parts[end.leaf].kind][end.column]) for end in ends}
