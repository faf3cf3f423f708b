"""Names that say what primitives and their sizes are for: plate_thickness, hole_radius, boss_height.

A role follows from the kind of a primitive, whether it adds or cuts, and whether it comes first; what only the solid around it tells is
for `export.feature_roles`. Primitives of one role whose leading sizes are constrained to be equal share a label, and so do the copies that
a repeat makes; the next group of that role is hole2, boss2 and so on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.repeats import Folded, instances
from imdim.program.tree import ANGLES, SIZE_NAMES, Primitive, Program, envelope, fold, leaves

_Taken = list[tuple[int, list[int]]]  # leaves with what is taken from them
_Clipped = list[tuple[int, int, list[int]]]  # leaves with their signs, and with what they are clipped by

FLAT = 0.35  # a first box thinner than this share of its next edge is a plate

_ADDS: Mapping[str, str] = {
    "box": "block",
    "cylinder": "boss",
    "cone": "cone",
    "sphere": "ball",
    "torus": "ring",
    "ellipsoid": "dome",
    "extrude": "profile",
    "revolve": "turned_part",
    "drafted": "boss",
}
_CUTS: Mapping[str, str] = {
    "box": "pocket",
    "cylinder": "hole",
    "cone": "countersink",
    "sphere": "dimple",
    "torus": "groove",
    "ellipsoid": "hollow",
    "extrude": "cutout",
    "revolve": "recess",
    "drafted": "pocket",
}
_SIZES: Mapping[str, tuple[str, ...]] = {
    "box": ("length", "width", "height"),
    "sphere": ("radius",),
    "cylinder": ("radius", "height"),
    "cone": ("bottom_radius", "top_radius", "height"),
    "torus": ("ring_radius", "tube_radius"),
    "ellipsoid": ("x_radius", "y_radius", "z_radius"),
    "extrude": ("height",),
    "revolve": ("angle",),
    "drafted": ("height", "draft_angle"),
}


def signs(program: Program) -> list[int]:
    """+1 for each leaf that adds, -1 for each that cuts, in order."""
    keep = list.__add__
    return fold(program, lambda _, __: [1], {"union": keep, "intersection": keep, "difference": lambda a, b: a + [-sign for sign in b]})


def cuts_of_each(program: Program) -> list[list[int]]:
    """For each leaf the leaves that are taken from it, in order of leaves."""

    def cut(a: _Taken, b: _Taken) -> _Taken:
        taken = [leaf for leaf, _ in b]
        return [(leaf, cuts + taken) for leaf, cuts in a] + b

    def both(a: _Taken, b: _Taken) -> _Taken:
        return a + b

    return [cuts for _, cuts in fold(program, lambda i, _: [(i, [])], {"union": both, "intersection": both, "difference": cut})]


def clips_of_each(program: Program) -> list[list[int]]:
    """For each leaf the leaves of what it is intersected with that add to that, in order of leaves."""

    def apart(a: _Clipped, b: _Clipped) -> _Clipped:
        return a + b

    def cut(a: _Clipped, b: _Clipped) -> _Clipped:
        return a + [(leaf, -sign, clips) for leaf, sign, clips in b]

    def clip(a: _Clipped, b: _Clipped) -> _Clipped:
        mine, its = ([leaf for leaf, sign, _ in side if sign > 0] for side in (a, b))
        return [(leaf, sign, clips + its) for leaf, sign, clips in a] + [(leaf, sign, clips + mine) for leaf, sign, clips in b]

    found = fold(program, lambda i, _: [(i, 1, [])], {"union": apart, "intersection": clip, "difference": cut})
    return [clips for _, _, clips in found]


def labels(
    program: Program, constraints: Iterable[Constraint] = (), folded: Folded | None = None, roles: Sequence[str] | None = None
) -> list[str]:
    """One label per leaf, in order; `folded`, which `program` is the expansion of, says which are copies. `roles` are by default those of
    `roles_of`."""
    parts = list(leaves(program))
    roles = roles_of(program) if roles is None else roles
    leading = {Ref(i, SIZE_NAMES[p.kind][0]): i for i, p in enumerate(parts)}
    group = list(range(len(parts))) if folded is None else [source for source, _ in instances(folded)]
    for constraint in constraints:
        if constraint.kind == "equal":
            same = [leading[ref] for ref in constraint.of if ref in leading]
            joined = {group[i] for i in same}
            group = [min(joined) if g in joined else g for g in group]
    heads: dict[str, list[int]] = {}
    for role, head in zip(roles, group, strict=True):
        if head not in heads.setdefault(role, []):
            heads[role].append(head)
    numbers = [heads[role].index(head) + 1 for role, head in zip(roles, group, strict=True)]
    return [role + (str(n) if n > 1 else "") for role, n in zip(roles, numbers, strict=True)]


def roles_of(program: Program) -> list[str]:
    """What each leaf is, without numbers that tell those of one role apart."""
    return [_role(i, p, sign) for i, (p, sign) in enumerate(zip(leaves(program), signs(program), strict=True))]


def _role(number: int, p: Primitive, sign: int) -> str:
    if number == 0 and p.kind in ("box", "extrude", "drafted"):
        thinnest, across, _ = sorted(envelope(p).size)
        return "plate" if thinnest < FLAT * across and (p.kind == "box" or p.size[0] == thinnest) else "body"
    if number == 0 and p.kind == "cylinder":
        return "disc" if p.size[1] < p.size[0] else "shaft"
    return (_ADDS if sign > 0 else _CUTS)[p.kind]


def size_word(p: Primitive, column: int, sign: int, label: str) -> str:
    """What size number `column` of a leaf is called."""
    lengths = [size for name, size in zip(SIZE_NAMES[p.kind], p.size, strict=True) if name not in ANGLES]
    if label.startswith("plate") and column == lengths.index(min(lengths)):
        return "thickness"
    word = _SIZES[p.kind][column]
    return "depth" if word == "height" and sign < 0 and p.kind != "box" else word


def name_constraints(
    constraints: Sequence[Constraint], program: Program, label: Sequence[str] | None = None, sizes: Mapping[Ref, str] | None = None
) -> tuple[Constraint, ...]:
    """The constraints with a name each, no two alike, by the `label` of each leaf, by default that of `labels`. Of `sizes` the names are
    known already."""
    parts, sign, known = list(leaves(program)), signs(program), sizes or {}
    label = labels(program, constraints) if label is None else label
    taken: set[str] = set()
    out: list[Constraint] = []
    for constraint in constraints:
        own = known.get(constraint.of[0]) if constraint.kind in _OF_SIZES else None
        name = unique(own or _name(constraint, parts, label, sign), taken)
        out.append(replace(constraint, name=name))
    return tuple(out)


def join_words(label: str, word: str) -> str:
    """The name of a number of what has a label: the radius of a ring's circle is ring_radius, and not ring_ring_radius."""
    return f"{label}_{word.removeprefix(label.rstrip('0123456789') + '_')}"


def unique(name: str, taken: set[str]) -> str:
    """`name`, or `name` with the first free number from 2; it is taken from now on."""
    number = 1
    while (candidate := name if number == 1 else f"{name}_{number}") in taken:
        number += 1
    taken.add(candidate)
    return candidate


def _name(c: Constraint, parts: Sequence[Primitive], label: Sequence[str], sign: Sequence[int]) -> str:
    who = "_".join(dict.fromkeys("frame" if ref.leaf == WORLD else label[ref.leaf] for ref in c.of[:3]))
    if c.kind in _OF_SIZES:
        leaf = c.of[0].leaf
        column = SIZE_NAMES[parts[leaf].kind].index(c.of[0].feature)
        return join_words(label[leaf], size_word(parts[leaf], column, sign[leaf], label[leaf]))
    return f"{who}_{_WORDS[c.kind]}"


_OF_SIZES = ("equal", "value")  # of which the first feature says what all are
_WORDS: Mapping[str, str] = {
    "parallel": "parallel",
    "perpendicular": "square",
    "coplanar": "flush",
    "aligned": "level",
    "coaxial": "coaxial",
    "concentric": "concentric",
    "tangent": "tangent",
    "symmetric": "pair",
    "linear": "row",
    "circular": "circle",
}
