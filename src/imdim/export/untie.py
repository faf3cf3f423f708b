"""Break ties: numbers of several features that share a name get names of their own, in all texts.

Sizes share a name because a constraint says that they are equal, because features are copies that repeat, or because their ends lie in the
same two planes. The first are taken out of the constraint. Repeats are written out; what else they say, other sizes and equal steps, stays
as constraints. Of the last the planes are given up, those beyond the far ends first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from imdim.export.delivered import Delivered, EditError, Feature, list_tied_sizes
from imdim.export.feature_names import say_features
from imdim.export.reword import reword
from imdim.program.constraints import LENGTHS_OF, Constraint, Ref
from imdim.program.repeats import Folded, Repeat, expand, repeats, size, write_out
from imdim.program.tree import leaves
from imdim.relations.residuals import holding


def untie(delivered: Delivered, name: str, apart: Collection[int] | None = None) -> Delivered:
    """The program in which `name` ties no more: each of its sizes has a name of its own or, if those `apart` are told, these primitives
    have one, and the others another. Raises EditError where nothing is tied, and where it cannot be untied."""
    if name not in delivered.values:
        raise EditError(f"no parameter {name!r} to untie; --list has them")
    tied = list_tied_sizes(delivered)[name]
    group = _groups(delivered, name, tied, apart)
    folded = delivered.folded
    constraints = [c for constraint in delivered.constraints for c in _split(constraint, group)]
    if folded is not None:
        written = {n for n, (first, repeat) in enumerate(repeats(folded)) if len(_within(first, repeat, group)) > 1}
        constraints += [c for n, pair in enumerate(repeats(folded)) if n in written for c in _said_by(*pair, group)]
        folded = write_out(folded, written)
        folded = folded if any(repeats(folded)) else None
    program = delivered.program if folded is None else expand(folded)
    constraints = list(holding(program, constraints))
    while True:
        out = _named(delivered, folded, constraints)
        together = _still_tied(out, group)
        if not together:
            return out
        binding = next(_binding(constraints, together), None)
        if binding is None:
            raise EditError(f"{name}: {say_features(together, delivered.labels)} have one shape, which cannot be untied")
        constraints.remove(binding)


def list_ties(delivered: Delivered) -> dict[str, list[Feature]]:
    """The names that several sizes share, with these."""
    return {name: sizes for name, sizes in list_tied_sizes(delivered).items() if len({leaf for leaf, _ in sizes}) > 1}


def new_names(before: Delivered, after: Delivered) -> dict[str, dict[str, list[int]]]:
    """For each name of the program before whose sizes have other names now, these, with the primitives that they are sizes of."""
    now = {feature: name for name, sizes in list_tied_sizes(after).items() for feature in sizes}
    out: dict[str, dict[str, list[int]]] = {}
    for name, sizes in list_tied_sizes(before).items():
        names: dict[str, list[int]] = {}
        for feature in sizes:
            if feature in now:
                names.setdefault(now[feature], []).append(feature[0])
        if names and list(names) != [name]:
            out[name] = names
    return out


def _groups(delivered: Delivered, name: str, tied: Sequence[Feature], apart: Collection[int] | None) -> dict[Feature, int]:
    """For each size the number of the group that it shares a name with from now on."""
    of = list(dict.fromkeys(leaf for leaf, _ in tied))
    if len(of) < 2:
        what = f"the size of {say_features(of, delivered.labels)} alone" if of else "a number of a drawing, of a place or of an edge"
        raise EditError(f"{name} is {what}: there is nothing to untie")
    if apart is None:
        return {feature: of.index(feature[0]) for feature in tied}
    stranger = next((leaf for leaf in apart if leaf not in of), None)
    if stranger is not None:
        raise EditError(f"{name} is no size of #{stranger}; it is one of {say_features(of, delivered.labels)}")
    if len(set(apart)) == len(of):
        raise EditError(f"{name}: all of {say_features(of, delivered.labels)} together are tied as they were")
    return {feature: int(feature[0] in apart) for feature in tied}


def _split(constraint: Constraint, group: Mapping[Feature, int]) -> Iterator[Constraint]:
    """A constraint of equal sizes as one for each group; others as they are."""
    if constraint.kind != "equal" or not any((ref.leaf, ref.feature) in group for ref in constraint.of):
        yield constraint
        return
    for number in sorted({group.get((ref.leaf, ref.feature), 0) for ref in constraint.of}):
        of = tuple(ref for ref in constraint.of if group.get((ref.leaf, ref.feature), 0) == number)
        if len(of) > 1:
            yield replace(constraint, of=of)


def _within(first: int, repeat: Repeat, group: Mapping[Feature, int]) -> set[int]:
    """The groups that copies of one leaf of a repeat belong to; those of the leaf that belongs to most."""
    own = size(repeat.part)
    copies = range(first, first + own * repeat.number)
    found = [{number for (leaf, _), number in group.items() if leaf in copies[j::own]} for j in range(own)]
    return max(found, key=len)


def describe_repeats(folded: Folded) -> list[Constraint]:
    """What the repeats of a program say of their copies, as constraints on its primitives."""
    return [constraint for first, repeat in repeats(folded) for constraint in _said_by(first, repeat, {})]


def _said_by(first: int, repeat: Repeat, group: Mapping[Feature, int]) -> Iterator[Constraint]:
    """What a repeat says of its copies but for the sizes that are untied, as constraints."""
    own, parts = size(repeat.part), list(leaves(expand(repeat)))
    for j in range(own):
        members = [first + copy * own + j for copy in range(repeat.number)]
        for feature in LENGTHS_OF[parts[j].kind]:
            yield from _split(Constraint("equal", tuple(Ref(leaf, feature) for leaf in members)), group)
        if repeat.kind == "linear" and repeat.number > 2:
            yield Constraint("linear", tuple(map(Ref, members)))
        elif repeat.is_full and repeat.number > 2 and parts[j].kind in ("cylinder", "cone"):
            yield Constraint("circular", tuple(map(Ref, members)), Ref(members[0], "z"))


def _named(delivered: Delivered, folded: Folded | None, constraints: Sequence[Constraint]) -> Delivered:
    """The program with those repeats and constraints, its texts written anew."""
    return reword(delivered, delivered.program if folded is None else expand(folded), folded, constraints, delivered.edges)


def _still_tied(delivered: Delivered, group: Mapping[Feature, int]) -> set[int]:
    """Primitives of several groups whose sizes share a name; none where there are none."""
    for sizes in list_tied_sizes(delivered).values():
        mine = {feature: group[feature] for feature in sizes if feature in group}
        if len(set(mine.values())) > 1:
            return {leaf for leaf, _ in mine}
    return set()


def _binding(constraints: Sequence[Constraint], together: set[int]) -> Iterator[Constraint]:
    """Constraints by which ends of some primitives lie where others do; the far ends of later primitives first."""
    planes = [c for c in constraints if c.kind in ("coplanar", "aligned", "symmetric") and any(ref.leaf in together for ref in c.of)]
    yield from sorted(planes, key=lambda c: (-max(ref.side for ref in c.of), -max(ref.leaf for ref in c.of)))
