"""Which relations hold by chance: what the numbers say and no designer meant. An edit is not to be bound by them.

That a ball and a hole measure the same is chance, and so is a face at the level of the middle of something else, or a place in the air
where a cut ends that goes through. Two holes that end in one face are level by that face, not by each other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from imdim.export.feature_roles import find_roles
from imdim.export.placements import Placements
from imdim.export.seats import Seat, ends_of, seats, sticks_out
from imdim.export.seen import find_hidden_ends
from imdim.geometry.lowering import lower
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.motions import IDENTITY
from imdim.program.patterns.congruence import group_by_fit
from imdim.program.rewrite.containment import axes
from imdim.program.roles import cuts_of_each, name_constraints, roles_of, signs
from imdim.program.tree import SIZE_NAMES, Primitive, Program, leaves, longest
from imdim.program.vectors import dot, minus

SAME = 1e-6  # of a length: two sizes are one


def without_chance(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints that a designer may have meant, named anew where some went."""
    roles, air, parts, cuts = _roles(program), _in_the_air(program), list(leaves(program)), cuts_of_each(program)
    sign = signs(program)
    akin_to = partial(_are_akin, parts, Placements.of(program, constraints))
    out: list[Constraint] = []
    for constraint in constraints:
        meant = _seen(constraint.of, air)
        if constraint.kind == "aligned":
            mixed = len({bool(ref.feature) for ref in constraint.of}) > 1
            akin = [] if mixed else _share_middle(constraint, meant, parts, sign, air)
            out += [tie for group in akin for tie in _of_some(constraint, group)]
        elif constraint.kind == "coplanar":
            out += _of_some(constraint, meant)
        elif constraint.kind == "equal" and all(ref.leaf != WORLD for ref in constraint.of):
            groups = dict.fromkeys((roles[ref.leaf], ref.feature) for ref in meant)
            for group in groups:
                own = [ref for ref in meant if (roles[ref.leaf], ref.feature) == group]
                out += [tie for akin in group_by_fit(own, akin_to) for tie in _of_some(constraint, akin)]
        elif constraint.kind == "concentric":
            out += _by_ends(constraint, parts, cuts)
        else:
            out.append(constraint)
    # ends of several cuts may lie in one face
    out = [*{(c.kind, c.of, c.about): c for c in out}.values()]
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def without_hidden(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints that put no end of which nothing is seen level with another: ends far out in the air are level by chance."""
    numbers, hidden = lower(program), find_hidden_ends(program)
    every = (end for i, p in enumerate(leaves(program)) for end in ends_of(i, p, numbers))
    unseen = {Ref(end.leaf, end.local) for end in every if (end.leaf, end.axis, end.side) in hidden}
    level = ("aligned", "coplanar")
    out = [new for c in constraints for new in (_of_some(c, [r for r in c.of if r not in unseen]) if c.kind in level else [c])]
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def end_together(program: Program, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """The constraints with ends of round parts that are as high in place of their one middle: an end that moves takes the others along."""
    parts, cuts = list(leaves(program)), cuts_of_each(program)
    out = [new for c in constraints for new in (_by_ends(c, parts, cuts) if c.kind == "concentric" else [c])]
    return tuple(constraints) if out == list(constraints) else name_constraints(out, program)


def rest_on_faces(constraints: Sequence[Constraint], found: Iterable[Seat], parts: Sequence[Primitive]) -> list[Constraint]:
    """The constraints with faces in place of the ends that lie in these and follow them anyway, as is `found`: a boss carries its bore, and
    does not end where that does. What lies from face to face of another is where that is: its middle is the other's."""
    largest = longest(parts)
    level = [(seat.own, seat.face) for seat in found if not seat.word and not sticks_out(seat, parts, largest)]
    faces = {Ref(own.leaf, own.local): Ref(face.leaf, face.local) for own, face in level}
    carriers = {(own.leaf, own.axis, own.side): face.leaf for own, face in level}
    out: list[Constraint] = []
    for c in constraints:
        of = list(c.of)
        if c.kind == "coplanar":
            of = list(dict.fromkeys(faces.get(ref, ref) for ref in c.of))
        elif c.kind == "aligned" and c.about is not None and c.about.leaf == WORLD:
            of = list(dict.fromkeys(_find_carrier(ref, "xyz".index(c.about.feature), carriers) for ref in c.of))
        out += [c] if tuple(of) == c.of else _of_some(c, of)
    return out


def _find_carrier(ref: Ref, axis: int, carriers: Mapping[tuple[int, int, int], int]) -> Ref:
    """What carries a leaf at both of its ends along an axis; the leaf itself where nothing does."""
    low, high = (carriers.get((ref.leaf, axis, side)) for side in (-1, 1))
    return ref if ref.feature or low is None or low != high else Ref(low)


def _by_ends(concentric: Constraint, parts: Sequence[Primitive], cuts: Sequence[Sequence[int]]) -> list[Constraint]:
    """Round parts of one height that have one middle begin together: when one grows, it grows from there and not both ways. A bore through
    one of them begins and ends with it."""
    first, *others = (parts[ref.leaf] for ref in concentric.of)
    slack = SAME * longest([first])
    alike = (p.kind == "cylinder" and p.rotation == first.rotation and abs(p.size[1] - first.size[1]) <= slack for p in others)
    if first.kind != "cylinder" or not all(alike):
        return [concentric]
    start, *rest = (ref.leaf for ref in concentric.of)
    ends = [(leaf, end) for leaf in rest for end in (("-z", "+z") if leaf in cuts[start] or start in cuts[leaf] else ("-z",))]
    together = [replace(concentric, kind="coplanar", of=(Ref(start, end), Ref(leaf, end))) for leaf, end in ends]
    return [replace(concentric, kind="coaxial", of=tuple(Ref(ref.leaf, "z") for ref in concentric.of)), *together]


def _are_akin(parts: Sequence[Primitive], placed: Placements, group: Sequence[Ref], ref: Ref) -> bool:
    """Whether a size may be tied to others that are as large, of features that share a placement: heights of round parts are where these
    are as wide too, or begin and end together."""
    if not placed.are_near(group[0].leaf, ref.leaf):
        return False
    if ref.feature != "h":
        return True
    a, b = parts[group[0].leaf], parts[ref.leaf]
    slack = SAME * max(*a.size, *b.size)
    as_wide = all(abs(s - t) <= slack for s, t in zip(sorted(a.size[:-1]), sorted(b.size[:-1]), strict=False))
    return as_wide or a.kind != b.kind or abs(dot(axes(a)[2], minus(b.center, a.center))) <= slack


def _roles(program: Program) -> list[str]:
    """As `roles_of`, with ribs, slots and bores; but the first leaf, which is called after its place, has the role of those that are as
    large: a frame's four bars."""
    roles, parts, sign = roles_of(program), list(leaves(program)), signs(program)
    twins = (i for i in range(1, len(parts)) if sign[i] == sign[0] and _are_equal(parts[0], parts[i]))
    found = find_roles(program)
    return [roles[next(twins, 0)], *(found[i].word if i in found else role for i, role in enumerate(roles[1:], 1))]


def _are_equal(a: Primitive, b: Primitive) -> bool:
    """Whether two primitives without outlines have one size."""
    slack = SAME * longest([a])
    return a.kind == b.kind and a.outline is None and all(abs(s - t) <= slack for s, t in zip(a.size, b.size, strict=True))


def _seen(of: Sequence[Ref], air: Mapping[Ref, Ref | None]) -> list[Ref]:
    """Without ends in the air; where a cut ends in a face that is not among them, that face in its place."""
    seen = (ref if ref not in air or air[ref] in of else air[ref] for ref in of)
    return list(dict.fromkeys(ref for ref in seen if ref is not None))


def _share_middle(
    aligned: Constraint, meant: Sequence[Ref], parts: Sequence[Primitive], sign: Sequence[int], air: Collection[Ref]
) -> list[list[Ref]]:
    """Those of what is aligned whose middles say something of each other. Along the axis of a cut that begins in the air, or that is turned
    and may do so, nobody measures to its middle: it is level with its like alone."""
    about = aligned.about
    if about is None or any(ref.feature for ref in meant):
        return [[*meant]]
    direction = (IDENTITY if about.leaf == WORLD else axes(parts[about.leaf]))["xyz".index(about.feature)]
    groups: dict[object, list[Ref]] = {}
    for ref in meant:
        part = parts[ref.leaf]
        along = next((name for name, axis in zip("xyz", axes(part), strict=True) if abs(dot(axis, direction)) > 1 - SAME), None)
        turned = part.kind == "revolve" and along == "z" and sign[ref.leaf] < 0
        has_middle = along is None or not (turned or any(Ref(ref.leaf, f"{side}{along}") in air for side in "+-"))
        groups.setdefault(None if has_middle else (part.kind, tuple(round(s / SAME) for s in part.size)), []).append(ref)
    return [*groups.values()]


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
