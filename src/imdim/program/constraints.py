"""Constraints on the numbers of a program: relations among its primitives, as data.

A constraint names features of leaves by number: ``3.r`` a size, ``0.z`` a local axis, ``0.+z`` the face at its end, ``4`` a centre,
``world.z`` an axis of the frame that the program lives in. What holds between them is:

=============  ==========================  =============================================================================
kind           of                          meaning
=============  ==========================  =============================================================================
equal          sizes, 2 or more            one length
value          one size                    has the length `value`
parallel       axes, 2 or more             one direction, either way
perpendicular  two axes                    a right angle
coplanar       two faces                   `value` apart (0: one plane), measured along the outward normal of the first
aligned        two faces or centres        `value` apart, measured along the axis `about`
coaxial        an axis, axes or centres    all centres on the line through the centre of the first, along its axis
concentric     centres, 2 or more          one point
tangent        a radius, and a face or     the round wall touches the face's plane, or both walls each other, from within or without,
               another radius              whichever is nearer
symmetric      two faces or centres, and   the third lies midway between the first two, measured along the axis `about`
               a centre
linear         centres, 3 or more          equal steps in one direction; of holes and shafts, across their axis alone
circular       centres or axes, 2 or more  evenly round the axis `about`, counter-clockwise; axes turn with it. If it is that of a member,
                                           the centre of the circle is free
=============  ==========================  =============================================================================
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from imdim.program.fields import shorten
from imdim.program.tree import OUTLINED, SIZE_NAMES, Primitive

WORLD = -1
AXES = ("x", "y", "z")
# Kinds of leaves with a local axis, and with plane faces across it.
AXES_OF: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("cylinder", "cone", "torus", *OUTLINED), ("z",)),
    **dict.fromkeys(("box", "ellipsoid"), AXES),
    "sphere": (),
}
FACES_OF: Mapping[str, tuple[str, ...]] = {"box": AXES, "cylinder": ("z",), "cone": ("z",), "extrude": ("z",), "drafted": ("z",)}
# Sizes that constraints can speak of: lengths, so that the angle of a turned outline is none.
LENGTHS_OF: Mapping[str, tuple[str, ...]] = {**SIZE_NAMES, "revolve": (), "drafted": ("h",)}
_REF = re.compile(r"(world|\d{1,9})(?:\.([a-z+-][a-z_]*))?")


class ConstraintError(ValueError):
    """A constraint is ill-formed, refers to nothing, or contradicts the others; one line that names it."""


class Ref(NamedTuple):
    """A feature of leaf number `leaf` (WORLD: of the frame): a size, an axis, a signed axis for a face, or "" for the centre."""

    leaf: int
    feature: str = ""

    def __str__(self) -> str:
        return ("world" if self.leaf == WORLD else str(self.leaf)) + (f".{self.feature}" if self.feature else "")

    @property
    def side(self) -> int:
        """+1 or -1 for a face, 0 for anything else."""
        return {"+": 1, "-": -1}.get(self.feature[:1], 0)

    @property
    def axis(self) -> int:
        """The number of the local axis of an axis or a face."""
        return AXES.index(self.feature[-1])


@dataclass(frozen=True, slots=True)
class Constraint:
    """See the module's table. `name` says what it is for ("hole_radius") and may be empty."""

    kind: str
    of: tuple[Ref, ...]
    about: Ref | None = None
    value: float = 0.0
    name: str = ""

    def __str__(self) -> str:
        about = f" about {self.about}" if self.about else ""
        value = f" value {self.value:g}" if self.value or self.kind == "value" else ""
        return f"{self.kind} of {', '.join(map(str, self.of))}{about}{value}"


@dataclass(frozen=True)
class _Rule:
    """How many features, of which type each, and of which type `about`, if any; whether `value` says something."""

    least: int
    most: int
    of: str
    about: str = ""
    has_value: bool = False


RULES: Mapping[str, _Rule] = {
    "equal": _Rule(2, 10_000, "size"),
    "value": _Rule(1, 1, "size", has_value=True),
    "parallel": _Rule(2, 10_000, "axis"),
    "perpendicular": _Rule(2, 2, "axis"),
    "coplanar": _Rule(2, 2, "face", has_value=True),
    "aligned": _Rule(2, 2, "position", "axis", has_value=True),
    "coaxial": _Rule(2, 10_000, "line"),
    "concentric": _Rule(2, 10_000, "center"),
    "tangent": _Rule(2, 2, "wall"),
    "symmetric": _Rule(3, 3, "position", "axis"),
    "linear": _Rule(3, 10_000, "center"),
    "circular": _Rule(2, 10_000, "line", "leaf axis"),
}


def describe(number: int, constraint: Constraint) -> str:
    """How messages name a constraint."""
    label = f" {constraint.name!r}" if constraint.name else ""
    return f"constraints[{number}]{label} ({shorten(str(constraint))})"


def check_all(constraints: Sequence[Constraint], parts: Sequence[Primitive]) -> None:
    """Raise ConstraintError for the first that is ill-formed, and for two that give one length two values.

    Whether the others agree with each other and with the numbers is a matter of geometry: see `relations.residuals.verify`.
    """
    for number, constraint in enumerate(constraints):
        check(number, constraint, parts)
    same = _equal_groups(constraints)
    given: dict[Ref, int] = {}
    for number, constraint in enumerate(constraints):
        if constraint.kind == "value":
            first = given.setdefault(same.get(constraint.of[0], constraint.of[0]), number)
            if constraints[first].value != constraint.value:
                raise ConstraintError(f"{describe(number, constraint)}: contradicts {describe(first, constraints[first])}")


def _equal_groups(constraints: Sequence[Constraint]) -> dict[Ref, Ref]:
    """Each size that is equal to others, and the one that stands for all of them (Tarjan's union-find, with path halving)."""
    above: dict[Ref, Ref] = {}

    def head(ref: Ref) -> Ref:
        while above.setdefault(ref, ref) != ref:
            above[ref] = ref = above[above[ref]]
        return ref

    for constraint in constraints:
        if constraint.kind == "equal":
            for ref in constraint.of:
                above[head(ref)] = head(constraint.of[0])
    return {ref: head(ref) for ref in list(above)}


def check(number: int, constraint: Constraint, parts: Sequence[Primitive]) -> None:
    """Raise ConstraintError unless constraint `number` is well-formed for the leaves `parts`."""
    where, rule = describe(number, constraint), RULES.get(constraint.kind)
    if rule is None:
        raise ConstraintError(f"constraints[{number}]: unknown kind {constraint.kind!r}; known are {', '.join(RULES)}")
    if not rule.least <= len(constraint.of) <= rule.most:
        wanted = f"{rule.least}" if rule.least == rule.most else f"{rule.least} or more"
        raise ConstraintError(f"{where}: needs {wanted} features, got {len(constraint.of)}")
    if not math.isfinite(constraint.value):
        raise ConstraintError(f"{where}: its value is not finite")
    if constraint.value and not rule.has_value:
        raise ConstraintError(f"{where}: takes no value")
    if (constraint.about is None) == bool(rule.about):
        raise ConstraintError(f"{where}: {'lacks' if rule.about else 'takes no'} about")
    for i, ref in enumerate(constraint.of):
        _check_ref(where, "leaf axis" if rule.of == "line" and constraint.kind == "coaxial" and i == 0 else rule.of, ref, parts)
    if constraint.kind == "tangent" and not _is_radius(parts[constraint.of[0].leaf], constraint.of[0].feature):
        raise ConstraintError(f"{where}: {constraint.of[0]} is no radius, which the first of the two has to be")
    if constraint.about is not None:
        _check_ref(where, rule.about, constraint.about, parts)
    if (
        len(constraint.of) == 2
        and constraint.kind == "circular"
        and constraint.about
        and constraint.about.leaf in {r.leaf for r in constraint.of}
    ):
        raise ConstraintError(f"{where}: two members alone say nothing, about must be the axis of another leaf")
    _check_lengths(where, constraint, parts)


def _check_ref(where: str, wanted: str, ref: Ref, parts: Sequence[Primitive]) -> None:
    if ref.leaf == WORLD:
        if wanted != "axis" or ref.feature not in AXES:
            raise ConstraintError(f"{where}: {ref} is no {wanted}")
        return
    if not 0 <= ref.leaf < len(parts):
        raise ConstraintError(f"{where}: {ref} is out of range, the program has {len(parts)} primitives")
    if not _FITS[wanted](parts[ref.leaf], ref.feature):
        raise ConstraintError(f"{where}: {ref} is no {wanted} of a {parts[ref.leaf].kind}")


def _is_face(p: Primitive, feature: str) -> bool:
    return feature[:1] in ("+", "-") and feature[1:] in FACES_OF.get(p.kind, ())


def _is_axis(p: Primitive, feature: str) -> bool:
    return feature in AXES_OF[p.kind]


def _is_radius(p: Primitive, feature: str) -> bool:
    return feature == "r" and p.kind in ("cylinder", "sphere")


_FITS: Mapping[str, Callable[[Primitive, str], bool]] = {
    "size": lambda p, f: f in LENGTHS_OF[p.kind],
    "axis": _is_axis,
    "leaf axis": _is_axis,
    "face": _is_face,
    "center": lambda p, f: f == "",
    "position": lambda p, f: f == "" or _is_face(p, f),
    "line": lambda p, f: f == "" or _is_axis(p, f),
    "wall": lambda p, f: _is_radius(p, f) or _is_face(p, f),
}


def scale_constraints(constraints: Iterable[Constraint], factor: float) -> tuple[Constraint, ...]:
    """The constraints of a program whose lengths are `factor` times as long."""
    return tuple(replace(c, value=c.value * factor) for c in constraints)


def renumber_constraints(constraints: Iterable[Constraint], place: Mapping[int, int]) -> tuple[Constraint, ...]:
    """The constraints of a program whose leaf number i is number `place[i]` of another one."""

    def moved(ref: Ref) -> Ref:
        return ref if ref.leaf == WORLD else ref._replace(leaf=place[ref.leaf])

    return tuple(replace(c, of=tuple(map(moved, c.of)), about=None if c.about is None else moved(c.about)) for c in constraints)


def size_of(ref: Ref, parts: Sequence[Primitive]) -> float:
    """The length of a size."""
    p = parts[ref.leaf]
    return p.size[SIZE_NAMES[p.kind].index(ref.feature)]


def _check_lengths(where: str, constraint: Constraint, parts: Sequence[Primitive]) -> None:
    """Refuse what divides by nothing: sizes of no length, one feature twice, one centre as a circle or a step."""
    if len(set(constraint.of)) < len(constraint.of):
        raise ConstraintError(f"{where}: one feature twice, a reference of no length")
    if constraint.kind in ("equal", "value"):
        empty = next((ref for ref in constraint.of if size_of(ref, parts) == 0), None)
        if empty is not None or (constraint.kind == "value" and constraint.value <= 0):
            raise ConstraintError(f"{where}: a reference of no length{'' if empty is None else f', {empty} is 0'}")
    if constraint.kind in ("linear", "circular"):
        centers = [parts[ref.leaf].center for ref in constraint.of]
        same = next((i for i, (a, b) in enumerate(pairwise(centers)) if a == b), None)
        if same is not None:
            raise ConstraintError(f"{where}: a reference of no length, {constraint.of[same]} and {constraint.of[same + 1]} coincide")


def read_ref(text: object) -> Ref:
    """The feature that a text like ``3.r`` names; raises ValueError for anything else."""
    found = _REF.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        raise ValueError("expected a feature like '3.r', '0.z', '0.+z', '4' or 'world.z'")
    return Ref(WORLD if found[1] == "world" else int(found[1]), found[2] or "")
