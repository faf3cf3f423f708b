"""Changes of a delivered program's structure: features added and removed, sizes tied, lengths converted, numbers fitted anew.

Numbers by name are changed by `export.edit`, ties are broken by `export.untie`; solving is the lab's. Repeats stay where they still say
what the program is; the others are written out, and what they say of their copies becomes constraints.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from imdim.app.lab import edits, solving
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.solving import TURN, Lock
from imdim.delivery.finish import finish
from imdim.export.delivered import Delivered, EditError, list_tied_sizes
from imdim.export.edit import change_values
from imdim.export.numbers import Rounding
from imdim.export.reword import reword
from imdim.export.untie import describe_repeats
from imdim.geometry.holes import find_holes
from imdim.geometry.lowering import lower
from imdim.geometry.pose import extent_of
from imdim.geometry.solid import exact_rotation
from imdim.program.constraints import AXES, Constraint, Ref, check_all, renumber_constraints, scale_constraints
from imdim.program.edges import EdgeFeature, renumber_edges, scale_edges
from imdim.program.node_codec import MAX_PRIMITIVES, read_node
from imdim.program.patterns.edit import refit_repeats
from imdim.program.repeats import Folded, Group, Repeat, expand, rebuilt, repeats, size, with_leaves, write_out
from imdim.program.tree import SIZE_NAMES, Op, Primitive, Program, leaves, longest, map_leaves, map_lengths
from imdim.reconstruction.fitting import relations_of
from imdim.relations.residuals import holding
from imdim.target.target import Target

LIKE = 1e-6  # of the largest length, within which copies are where their repeat has them
SOLVED, SOLVED_DEG = 2e-5, 1e-3  # of the part's extent, and degrees: how well a mesh's facets tell a number
MEANS_A_DIAMETER = ("r", "r_bottom", "r_top")


def restructure(
    delivered: Delivered, program: Program, constraints: Sequence[Constraint], edges: Sequence[EdgeFeature], folded: Folded | None = None
) -> Delivered:
    """`program` with the names that its constraints give it; those that no longer hold are left out. `folded` are its repeats."""
    return reword(delivered, program, folded, holding(program, constraints), edges)


def renumber_values(delivered: Delivered, program: Program, constraints: Sequence[Constraint] | None = None) -> Delivered:
    """The same structure with the numbers of `program`; repeats whose copies are no longer alike are written out."""
    given = delivered.constraints if constraints is None else constraints
    folded = delivered.folded
    if folded is None:
        return restructure(delivered, program, given, delivered.edges)
    kept = with_leaves(refit_repeats(folded, program, Rounding.of(program).decimals + 1), program)
    if _are_alike(expand(kept), program):
        return restructure(delivered, expand(kept), given, delivered.edges, kept)
    return restructure(delivered, program, [*given, *describe_repeats(folded)], delivered.edges)


def _are_alike(one: Program, other: Program) -> bool:
    slack = LIKE * longest(leaves(one))
    return all(
        max(abs(u - v) for u, v in zip((*p.size, *p.center), (*q.size, *q.center), strict=True)) <= slack
        for p, q in zip(leaves(one), leaves(other), strict=True)
    )


def add_feature(delivered: Delivered, op: Op, feature: object, before_cuts: bool = False) -> tuple[Delivered, int]:
    """One more feature, a node of the file format, a repeat too; and the number of its first primitive.

    It is joined to all that is there, or to what is there `before_cuts` are made, which go through it too. Raises a one-line ValueError.
    """
    part = read_node(feature, "feature")
    folded = _fold(delivered)
    if size(folded) + size(part) > MAX_PRIMITIVES:
        raise EditError(f"{size(folded) + size(part)} primitives, more than {MAX_PRIMITIVES}")
    after, first = _join(folded, op, part, before_cuts)
    more = size(part)
    place = {i: i if i < first else i + more for i in range(size(folded))}
    constraints = renumber_constraints(delivered.constraints, place)
    repeated = after if any(repeats(after)) else None
    return restructure(delivered, expand(after), constraints, renumber_edges(delivered.edges, place), repeated), first


def _join(folded: Folded, op: Op, part: Folded, before_cuts: bool) -> tuple[Folded, int]:
    """What is there with one more part, and the number of its first leaf."""
    if before_cuts and isinstance(folded, Group) and folded.op == "difference":
        kept, first = _join(folded.parts[0], op, part, before_cuts)
        return Group("difference", (kept, *folded.parts[1:])), first
    same = isinstance(folded, Group) and folded.op == op
    return Group(op, (*folded.parts, part) if same and isinstance(folded, Group) else (folded, part)), size(folded)


def _fold(delivered: Delivered) -> Folded:
    """The program as groups and repeats; without repeats as its operations stand."""
    return _groups(delivered.program) if delivered.folded is None else delivered.folded


def _groups(program: Program) -> Folded:
    if isinstance(program, Primitive):
        return program
    right = program.right
    parts, left = [_groups(right)], program.left
    while not isinstance(left, Primitive) and left.op == program.op:
        parts.append(_groups(left.right))
        left = left.left
    return Group(program.op, (_groups(left), *reversed(parts)))


def remove_features(delivered: Delivered, numbers: Collection[int]) -> Delivered:
    """Without some features, by their ids; what was cut out of one of them alone goes with it. Raises LabEditError for the last one."""
    folded = delivered.folded
    constraints = list(delivered.constraints)
    if folded is not None:
        # a copy that goes takes its repeat with it, the others stay
        hit = {n for n, (first, r) in enumerate(repeats(folded)) if any(first <= i < first + size(r) for i in numbers)}
        constraints += describe_repeats(folded)
        folded = write_out(folded, hit)
        folded = folded if any(repeats(folded)) else None
    theory = ConstrainedProgram(delivered.program, tuple(constraints), edges=delivered.edges)
    for number in sorted(set(numbers), reverse=True):
        theory = edits.without(theory, number)
    kept = None if folded is None else _without(folded, {i for i in numbers if i < size(folded)})
    if kept is not None and (not any(repeats(kept)) or not _same_leaves(expand(kept), theory.program)):
        kept = None
    return restructure(delivered, theory.program if kept is None else expand(kept), theory.constraints, theory.edges, kept)


def _same_leaves(one: Program, other: Program) -> bool:
    a, b = list(leaves(one)), list(leaves(other))
    return len(a) == len(b) and all(p.kind == q.kind for p, q in zip(a, b, strict=True)) and _are_alike(one, other)


def _without(folded: Folded, gone: set[int], first: int = 0) -> Folded | None:
    """What is left without some leaves, None where nothing is; `folded` has leaves from number `first` on."""
    if isinstance(folded, Primitive):
        return None if first in gone else folded
    if isinstance(folded, Repeat):
        return folded
    left: list[Folded] = []
    for number, part in enumerate(folded.parts):
        kept = _without(part, gone, first)
        first += size(part)
        if kept is not None:
            left.append(kept)
        elif number == 0 and folded.op == "difference":
            return None
    return None if not left else left[0] if len(left) == 1 else Group(folded.op, tuple(left))


def tie_sizes(delivered: Delivered, names: Sequence[str]) -> Delivered:
    """The sizes of several names as one, with the value of the first name. Raises EditError for names that are none of sizes alike."""
    if len(set(names)) < 2:
        raise EditError("tying needs two names or more")
    tied = list_tied_sizes(delivered)
    for name in names:
        if name not in delivered.values:
            raise EditError(f"no parameter {name!r} to tie; the parameters have it under another name")
        if not tied[name]:
            raise EditError(f"{name} is a number of a drawing, of a place or of an edge, which cannot be tied")
    across = {feature in MEANS_A_DIAMETER for name in names for _, feature in tied[name]}
    if len(across) > 1:
        raise EditError(f"{', '.join(names)}: a diameter and a length cannot be tied")
    value = delivered.values[names[0]]
    equal = change_values(delivered, {name: value for name in names[1:] if delivered.values[name] != value})
    # the texts keep nine digits: what is to be equal is made so
    refs = [Ref(*feature) for name in names for feature in tied[name]]
    parts = list(leaves(equal.program))
    first = parts[refs[0].leaf].size[SIZE_NAMES[parts[refs[0].leaf].kind].index(refs[0].feature)]
    program = map_leaves(equal.program, lambda i, p: _with_sizes(p, {ref.feature: first for ref in refs if ref.leaf == i}))
    # what a repeat says already needs no other tie
    row = Constraint("equal", tuple(dict.fromkeys(refs)))
    return renumber_values(equal, program, [*equal.constraints, row])


def _with_sizes(part: Primitive, sizes: dict[str, float]) -> Primitive:
    if not sizes:
        return part
    return replace(part, size=tuple(sizes.get(n, v) for n, v in zip(SIZE_NAMES[part.kind], part.size, strict=True)))


def hold_relation(delivered: Delivered, relation: Constraint, locks: Collection[Lock]) -> Delivered:
    """One more relation, for which numbers move as little as it needs. Raises ConstraintError where it cannot hold with the others."""
    constraints = (*delivered.constraints, relation)
    check_all(constraints, list(leaves(delivered.program)))
    said = () if delivered.folded is None else describe_repeats(delivered.folded)
    program = solving.follow_constraints(delivered.program, [*constraints, *said], sorted(locks))
    return renumber_values(delivered, program, constraints)


def drop_relation(delivered: Delivered, number: int) -> Delivered:
    """Without a relation, by its place in the list."""
    if not 0 <= number < len(delivered.constraints):
        raise EditError(f"no relation {number}; there are {len(delivered.constraints)}, counted from 0")
    left = delivered.constraints[:number] + delivered.constraints[number + 1 :]
    return restructure(delivered, delivered.program, left, delivered.edges, delivered.folded)


def set_number(delivered: Delivered, leaf: int, name: str, value: float, locks: Collection[Lock]) -> Delivered:
    """One number of a primitive, by the name that a lock has (or "turn_x", "turn_y", "turn_z"); what relations tie to it follows."""
    parts = list(leaves(delivered.program))
    if not 0 <= leaf < len(parts):
        raise EditError(f"no primitive {leaf}; there are {len(parts)}, counted from 0")
    known = [number.name for number in edits.numbers(parts[leaf])]
    if name not in known:
        raise EditError(f"primitive {leaf} has no number {name!r}; it has {', '.join(known)}")
    said = () if delivered.folded is None else tuple(describe_repeats(delivered.folded))
    theory = ConstrainedProgram(delivered.program, (*delivered.constraints, *said), frozenset(locks), delivered.edges)
    after = edits.with_number(theory, leaf, name, value, follow=True)
    return renumber_values(delivered, after.program, after.constraints[: len(delivered.constraints)])


def scale(delivered: Delivered, factor: float) -> Delivered:
    """The same program with all lengths times `factor`."""

    def longer(length: float) -> float:
        return length * factor

    def leaf(_: int, part: Primitive) -> Primitive:
        x, y, z = map(longer, part.center)
        return map_lengths(part, longer, (x, y, z))

    def repeat(_: int, one: Repeat) -> Repeat:
        steps = tuple((a * factor, b * factor, c * factor) for a, b, c in one.steps)
        x, y, z = map(longer, one.point)
        return replace(one, steps=steps, point=(x, y, z))

    folded = None if delivered.folded is None else rebuilt(delivered.folded, leaf, repeat)
    program = map_leaves(delivered.program, leaf) if folded is None else expand(folded)
    return restructure(delivered, program, scale_constraints(delivered.constraints, factor), scale_edges(delivered.edges, factor), folded)


def refit(
    delivered: Delivered, target: Target, locks: Collection[Lock], only: Collection[int] | None = None, turn: bool = False
) -> Delivered:
    """Sizes and places of primitives fitted to the part while relations and locks hold; where `only` is given the others stay.

    Orientations move only if they may `turn`; drawings and the hidden ends of through-holes, of which the part shows nothing, stay.
    Raises ConstraintError where relations and locks conflict.
    """
    parts = list(leaves(delivered.program))
    held = {*locks, *_hidden_ends(delivered.program)}
    held |= set() if turn else {Lock(i, TURN) for i in range(len(parts))}
    if only is not None:
        held |= {lock for i, p in enumerate(parts) if i not in only for lock in locks_of(i, p)}
    said = [] if delivered.folded is None else describe_repeats(delivered.folded)
    rows = [*delivered.constraints, *said]
    *_, program = solving.finish(delivered.program, rows, sorted(held), target)
    rounder = program if target.mesh is None else _settle(delivered.program, program)
    return renumber_values(delivered, rounder if len(holding(rounder, rows)) == len(holding(program, rows)) else program)


def _hidden_ends(program: Program) -> Iterator[Lock]:
    """Length and place along the axis of what makes through-holes and nothing else."""
    parts = list(leaves(program))
    for i in {i for hole in find_holes(program) if hole.through for section in hole.sections for i in section.leaves}:
        if "h" in SIZE_NAMES[parts[i].kind] and parts[i].outline is None:
            along = np.abs(exact_rotation(parts[i])[:, 2])
            yield Lock(i, "h")
            if along.max() == 1:
                yield Lock(i, AXES[int(along.argmax())])


def _settle(before: Program, solved: Program) -> Program:
    """Numbers that the solver hardly moved as they were, and the others as round as its error lets them be."""
    old, slack = list(leaves(before)), SOLVED * extent_of(lower(solved))

    def settle(was: Sequence[float], now: Sequence[float], slack: float) -> tuple[float, ...]:
        return tuple(a if abs(a - b) <= slack else _round_within(b, slack) for a, b in zip(was, now, strict=True))

    def leaf(i: int, part: Primitive) -> Primitive:
        (x, y, z), (rx, ry, rz) = settle(old[i].center, part.center, slack), settle(old[i].rotation, part.rotation, SOLVED_DEG)
        return replace(part, size=settle(old[i].size, part.size, slack), center=(x, y, z), rotation=(rx, ry, rz))

    return map_leaves(solved, leaf)


def _round_within(value: float, slack: float) -> float:
    """The number with the fewest decimals within `slack`, 12 at most."""
    return next((near for d in range(-3, 12) if abs((near := round(value, d)) - value) <= slack), value) + 0.0


def locks_of(number: int, part: Primitive) -> list[Lock]:
    """Locks for all numbers of a primitive."""
    return [Lock(number, name) for name in (*SIZE_NAMES[part.kind], *AXES, TURN)]


def relate(delivered: Delivered) -> Delivered:
    """The program with the relations and repeats that its numbers support, and rounder numbers where these are as good; its primitives may
    stand in another order."""
    found = finish(*relations_of(delivered.program), edges=delivered.edges)
    return reword(delivered, found.program, found.folded, found.constraints, found.edges)
