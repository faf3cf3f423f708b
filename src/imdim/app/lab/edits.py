"""What a person may do to a program: each edit makes a new theory of an old one, or raises a one-line EditError or ConstraintError."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from imdim.app.lab.naming import NamedProgram
from imdim.app.lab.relation_words import ROUND_SIZES, say_relation
from imdim.app.lab.solving import TURN, Lock, follow_constraints, violations
from imdim.geometry.edges import find_edges, has_room
from imdim.geometry.lowering import lower
from imdim.program.constraints import AXES, LENGTHS_OF, RULES, WORLD, Constraint, ConstraintError, Ref, check_all, read_ref
from imdim.program.edges import EdgeFeature, describe_edges, renumber_edges
from imdim.program.paths import at, leaf_paths, replace_at
from imdim.program.paths import without as prune
from imdim.program.roles import labels
from imdim.program.tree import SIZE_NAMES, Combine, Op, Primitive, Program, leaves, map_leaves, replace_leaves
from imdim.relations.hold import MET

TURNS = ("turn_x", "turn_y", "turn_z")  # apart from the sizes of an ellipsoid, rx, ry and rz


class LabEditError(ValueError):
    """What was asked for cannot be; the message is one line."""


@dataclass(frozen=True)
class ConstrainedProgram:
    """A program, the constraints on its numbers, the numbers that are locked, and the blends of its edges, and whether they are known.

    `named` has names for its numbers, or for those that it had before it was changed."""

    program: Program
    constraints: tuple[Constraint, ...] = ()
    locks: frozenset[Lock] = frozenset()
    edges: tuple[EdgeFeature, ...] = ()
    knows_edges: bool = True
    named: NamedProgram | None = field(default=None, compare=False)

    @property
    def names(self) -> NamedProgram | None:
        """The names of its numbers, None where it has none yet."""
        return self.named if self.named is not None and self.named.is_of(self.program, self.constraints, self.edges) else None

    @property
    def labels(self) -> list[str]:
        """What each primitive is called."""
        return labels(self.program, self.constraints) if self.names is None else list(self.names.labels)

    @property
    def found(self) -> Program:
        """What a run found, where this is its finished form; else the program."""
        origin = None if self.names is None else self.names.origin
        return self.program if origin is None else origin

    @property
    def size(self) -> int:
        """How many things a person may select: primitives, and after them the features of edges."""
        return sum(1 for _ in leaves(self.program)) + len(self.edges)

    def edge_feature(self, number: int | None) -> int | None:
        """Which feature of edges the thing with that number is, None for a primitive and for nothing."""
        first = self.size - len(self.edges)
        return None if number is None or not first <= number < self.size else number - first


@dataclass(frozen=True)
class Number:
    """One number of a primitive: `name` as in a lock (or one of TURNS), its `value`, a length or an angle in degrees.

    The angle of a turned outline is a size, in degrees."""

    name: str
    value: float
    unit: Literal["length", "degrees"]

    @property
    def lock(self) -> str:
        return TURN if self.name in TURNS else self.name


def numbers(part: Primitive) -> list[Number]:
    """All numbers of a primitive: sizes, place, orientation."""
    sizes = [Number(n, v, "degrees" if n == "angle" else "length") for n, v in zip(SIZE_NAMES[part.kind], part.size, strict=True)]
    place = [Number(n, v, "length") for n, v in zip(AXES, part.center, strict=True)]
    return sizes + place + [Number(n, v, "degrees") for n, v in zip(TURNS, part.rotation, strict=True)]


def with_number(theory: ConstrainedProgram, leaf: int, name: str, value: float, follow: bool = False) -> ConstrainedProgram:
    """One number changed. With `follow`, all that the constraints relate to it moves along, locked numbers stay."""
    parts = list(leaves(theory.program))
    try:
        changed = _change_number(parts[leaf], name, float(value))
    except ValueError as error:
        raise LabEditError(str(error)) from error
    program = replace_leaves(theory.program, {leaf: changed})
    if follow:
        held = Lock(leaf, TURN if name in TURNS else name)
        # a size that a constraint gives a value has the new one from now on
        of = (Ref(leaf, name),)
        constraints = tuple(replace(c, value=float(value)) if c.kind == "value" and c.of == of else c for c in theory.constraints)
        program = follow_constraints(program, constraints, sorted(theory.locks | {held}))
        return replace(theory, program=program, constraints=constraints)
    return replace(theory, program=program)


def _change_number(part: Primitive, name: str, value: float) -> Primitive:
    if name in AXES:
        x, y, z = (value if axis == name else v for axis, v in zip(AXES, part.center, strict=True))
        return replace(part, center=(x, y, z))
    if name in TURNS:
        rx, ry, rz = (value if turn == name else v for turn, v in zip(TURNS, part.rotation, strict=True))
        return replace(part, rotation=(rx, ry, rz))
    return replace(part, size=tuple(value if n == name else v for n, v in zip(SIZE_NAMES[part.kind], part.size, strict=True)))


def operation(program: Program, leaf: int) -> Op | None:
    """How a primitive joins what comes before it, None for one that others join."""
    path, _ = leaf_paths(program)[leaf]
    parent = at(program, path[:-1])
    return parent.op if path and path[-1] == 1 and isinstance(parent, Combine) else None


def with_operation(theory: ConstrainedProgram, leaf: int, op: Op) -> ConstrainedProgram:
    """The operation by which a primitive joins what comes before it."""
    path, _ = leaf_paths(theory.program)[leaf]
    parent = at(theory.program, path[:-1])
    if not path or path[-1] == 0 or not isinstance(parent, Combine):
        raise LabEditError(f"primitive {leaf} is what others are joined to, it has no operation of its own")
    return replace(theory, program=replace_at(theory.program, path[:-1], replace(parent, op=op)))


def with_added(theory: ConstrainedProgram | None, op: Op, part: Primitive) -> ConstrainedProgram:
    """One more primitive, joined to all that is there; its number is the last."""
    if theory is None:
        return ConstrainedProgram(part)
    return replace(theory, program=Combine(op, theory.program, part))


def with_edge_size(theory: ConstrainedProgram, feature: int, which: int, value: float) -> ConstrainedProgram:
    """One size of a feature of edges changed: a fillet's radius, or a distance of a chamfer. Raises LabEditError where an edge of it has no
    room for that."""
    before = theory.edges[feature]
    try:
        changed = replace(before, sizes=tuple(float(value) if k == which else size for k, size in enumerate(before.sizes)))
    except ValueError as error:
        raise LabEditError(str(error)) from error
    tight = _tight(theory.program, changed) - _tight(theory.program, before)
    if tight:
        raise LabEditError(f"{describe_edges(changed)}: {len(tight)} of them have no room for it")
    return replace(theory, edges=(*theory.edges[:feature], changed, *theory.edges[feature + 1 :]))


def _tight(program: Program, feature: EdgeFeature) -> set[int]:
    """The edges of a feature that are none of the program, or too narrow for it."""
    found, solid = find_edges(program, [feature]), lower(program)
    return {k for _, k in found.missing} | {edge.edge for edge in found.edges if not has_room(solid, edge)}


def without(theory: ConstrainedProgram, number: int) -> ConstrainedProgram:
    """The theory without one of the things that can be selected."""
    feature = theory.edge_feature(number)
    if feature is None:
        return without_leaf(theory, number)
    return replace(theory, edges=theory.edges[:feature] + theory.edges[feature + 1 :])


def without_leaf(theory: ConstrainedProgram, leaf: int) -> ConstrainedProgram:
    """The theory without a primitive, and without what was said of it. What was cut out of it alone goes with it."""
    order = list(leaves(theory.program))
    marked = map_leaves(theory.program, lambda i, p: replace(p, center=(float(i), 0.0, 0.0)))
    left = prune(marked, [leaf_paths(theory.program)[leaf][0]])
    if left is None:
        raise LabEditError("the last primitive cannot be removed")
    kept = [round(p.center[0]) for p in leaves(left)]
    number = {old: new for new, old in enumerate(kept)} | {WORLD: WORLD}
    program = map_leaves(left, lambda i, _: order[kept[i]])
    constraints = tuple(c for c in (_renumber(c, number) for c in theory.constraints) if c is not None)
    locks = frozenset(Lock(number[lock.leaf], lock.name) for lock in theory.locks if lock.leaf in number)
    return ConstrainedProgram(program, constraints, locks, _edges_left(theory.edges, number), theory.knows_edges)


def _edges_left(features: Sequence[EdgeFeature], number: Mapping[int, int]) -> tuple[EdgeFeature, ...]:
    """The features of edges whose primitives are numbered anew, those edges that lose one left out."""
    kept = [(f, tuple(edge for edge in f.edges if all(face.leaf in number for face in edge))) for f in features]
    return renumber_edges([replace(f, edges=edges) for f, edges in kept if edges], number)


def _renumber(constraint: Constraint, number: dict[int, int]) -> Constraint | None:
    """What is left of a constraint when primitives are renumbered, None if it then says nothing."""
    if constraint.about is not None and constraint.about.leaf not in number:
        return None
    of = tuple(ref._replace(leaf=number[ref.leaf]) for ref in constraint.of if ref.leaf in number)
    rule = RULES[constraint.kind]
    if len(of) < rule.least or (len(of) < len(constraint.of) and constraint.kind == "circular"):
        return None
    about = None if constraint.about is None else constraint.about._replace(leaf=number[constraint.about.leaf])
    return replace(constraint, of=of, about=about)


def read_constraint(kind: str, of: str, about: str = "", value: float = 0.0) -> Constraint:
    """A constraint as a person writes it: features like ``2.r, 3.r`` in `of`, one like ``world.z`` in `about`."""
    if kind not in RULES:
        raise LabEditError(f"unknown kind {kind!r}; known are {', '.join(RULES)}")
    try:
        refs = tuple(read_ref(text) for text in of.replace(",", " ").split())
        named = read_ref(about.strip()) if about.strip() else None
    except ValueError as error:
        raise LabEditError(str(error)) from error
    return Constraint(kind, refs, named if RULES[kind].about else None, float(value) if RULES[kind].has_value else 0.0)


def with_constraint(theory: ConstrainedProgram, constraint: Constraint) -> ConstrainedProgram:
    """One more constraint, and the program moved by as little as it takes to hold, locked numbers held.

    Raises ConstraintError where it is not well-formed, LabEditError where it cannot hold beside the others and the locks.
    """
    return _moved(replace(theory, constraints=(*theory.constraints, constraint)), constraint)


def _moved(theory: ConstrainedProgram, asked: Constraint) -> ConstrainedProgram:
    """The theory with its program moved to where its constraints hold, of which one was `asked` for."""
    parts = list(leaves(theory.program))
    check_all(theory.constraints, parts)
    if max(violations(theory.program, theory.constraints)) <= MET:
        return theory
    for held in (*_held_first(parts, asked), frozenset[Lock]()):
        with contextlib.suppress(ConstraintError):
            return replace(theory, program=follow_constraints(theory.program, theory.constraints, sorted(theory.locks | held)))
    words = say_relation(asked, theory.labels, parts, "")
    raise LabEditError(f"{words}: cannot hold beside the other relations and what is locked")


def _held_first(parts: Sequence[Primitive], asked: Constraint) -> Iterator[frozenset[Lock]]:
    """What a person expects to stay when something is `asked` for, the most first: the first of its features and all sizes that it does not
    name, so that the others come to it as they are; then the first feature alone."""
    first, named = asked.of[0].leaf, {(ref.leaf, ref.feature) for ref in asked.of}
    stays = frozenset(Lock(first, name) for name in (*LENGTHS_OF[parts[first].kind], *AXES, TURN) if len(asked.of) > 1)
    sizes = frozenset(Lock(i, name) for i, part in enumerate(parts) for name in LENGTHS_OF[part.kind] if (i, name) not in named)
    yield stays | sizes
    yield stays


def amount_of(constraint: Constraint) -> float | None:
    """The distance, or the diameter or length, that a person knows a constraint by; None where it says none."""
    if not RULES[constraint.kind].has_value:
        return None
    return abs(constraint.value) * _times(constraint)


def with_amount(theory: ConstrainedProgram, number: int, amount: float) -> ConstrainedProgram:
    """A constraint at another distance or size, on the same side, and the program moved by as little as it takes.

    Raises LabEditError where that cannot hold beside the others and the locks.
    """
    if not 0 <= number < len(theory.constraints) or amount_of(theory.constraints[number]) is None:
        raise LabEditError("no relation with a distance or a size is chosen: click one in the list")
    before = theory.constraints[number]
    after = replace(before, value=math.copysign(amount / _times(before), before.value))
    constraints = (*theory.constraints[:number], after, *theory.constraints[number + 1 :])
    return _moved(replace(theory, constraints=constraints), after)


def _times(constraint: Constraint) -> float:
    """Of round things the diameter is said where the program has the radius."""
    return 2.0 if constraint.kind == "value" and constraint.of[0].feature in ROUND_SIZES else 1.0


def without_constraint(theory: ConstrainedProgram, number: int) -> ConstrainedProgram:
    if not 0 <= number < len(theory.constraints):
        raise LabEditError("no constraint is chosen: click one in the list")
    return replace(theory, constraints=theory.constraints[:number] + theory.constraints[number + 1 :])


def with_lock(theory: ConstrainedProgram, lock: Lock, locked: bool) -> ConstrainedProgram:
    """A number held, or let go."""
    return replace(theory, locks=theory.locks | {lock} if locked else theory.locks - {lock})
