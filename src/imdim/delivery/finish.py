"""What a program becomes when it is delivered: repeated parts written once, cutters that overshoot, rounded numbers, and names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from imdim.deadline import NEVER, Deadline
from imdim.export.chance import without_chance, without_hidden
from imdim.export.edge_text import with_edge_sizes
from imdim.export.elimination import without_loose
from imdim.export.feature_names import label_features
from imdim.export.feature_roles import MOST_NAMED
from imdim.export.followed_ends import find_followed_ends
from imdim.export.kept_relations import keep_by_names
from imdim.export.numbers import round_program
from imdim.export.parameters import Parameters, parametrise
from imdim.export.relation_names import name_relations
from imdim.export.residues import settle_residues
from imdim.geometry.census import census_of
from imdim.geometry.finish.commute import Commutation, CommutedProgram
from imdim.geometry.finish.extend import Face, plane_face
from imdim.geometry.finish.far_ends import reach_far
from imdim.geometry.finish.far_walls import reach_walls_far
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.finish.turned_ends import centre_turned
from imdim.geometry.solid import time_solid, to_manifold
from imdim.program.constraints import WORLD, Constraint, renumber_constraints
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature, name_edges, renumber_edges
from imdim.program.patterns.detect import Folding, extent, fold_repeats, worth
from imdim.program.repeats import Folded, copies_of, expand, instances, repeats, size, with_leaves
from imdim.program.tree import Program
from imdim.reconstruction.preserve import SAME, is_same, preserve
from imdim.relations.residuals import holding, rebase_constraints

NEAR = 2e-4  # of the part's size, by which what nearly repeats may move
GATHERED = (1, 6)  # primitives of a part that may move to where it repeats, at most
MOST_GATHERED = 150  # primitives of a program
NAMED_S = 0.04  # that the names of a long program take for each of its primitives: 1.9 s for 37, 3 for 82
SOLIDS_FOR_NAMES = 8  # that are made at least until a program has names
FEW = 20  # primitives, whose solid is made in a moment


@dataclass(frozen=True)
class FinishedProgram:
    """`folded`, which `program` is the expansion of, has the repeats, None if there are none. `constraints` hold for `program`, and `edges`
    are of its faces. `order` has for each leaf its number in the program that was finished. `hurried`: no time was left for names."""

    program: Program
    constraints: tuple[Constraint, ...]
    parameters: Parameters
    folded: Folded | None
    edges: tuple[EdgeFeature, ...] = ()
    order: tuple[int, ...] = ()
    hurried: bool = False

    @property
    def labels(self) -> tuple[str, ...]:
        """What the leaves are called in all files."""
        return self.parameters.labels or label_features(self.program, self.constraints, self.folded)

    def with_edges(self, edges: Sequence[EdgeFeature]) -> FinishedProgram:
        """The program with edge features of it, whose sizes have names too."""
        named = name_edges(edges, self.parameters.values)
        return replace(self, edges=named, parameters=with_edge_sizes(self.parameters, named))


def finish(
    program: Program,
    constraints: Sequence[Constraint] = (),
    deadline: Deadline = NEVER,
    edges: Sequence[EdgeFeature] = (),
    name_by: Deadline = NEVER,
) -> FinishedProgram:
    """The program as it is delivered; `constraints` and `edges` are of the one given, and relations by chance, or that no names can keep,
    are left out.

    Repeats change the order of primitives. What nearly repeats, or would if it stood together, is made to if that hardly changes the solid.
    Past the `deadline` (by default never) no parts are gathered, and the other cutters end where they end. A program of more than
    MOST_NAMED primitives, copies counted, is delivered as it was found: a kilobyte of repeats may unfold to thousands. So is one whose
    names would take longer than until `name_by` (by default never), its repeats too.
    """
    if not _has_time_to_name(program, name_by):
        return replace(_leave_as_found(program, None, edges), hurried=True)
    if count(program).primitives > MOST_NAMED:
        return _leave_as_found(program, fold_repeats(program), edges)
    program = centre_turned(program)
    constraints = without_chance(program, holding(program, constraints))
    folding = next((f for f in _foldings(program, deadline) if is_same(program, f.program)), None)
    if folding is None:
        program = _hide_ends(program, None, deadline, edges)
        constraints = without_hidden(program, holding(program, constraints))
        delivered = finish_flat(program, deadline=deadline, edges=edges)
        constraints = without_loose(program, constraints, delivered)
        delivered, named, _ = _settle(delivered, parametrise(program, constraints, delivered, deadline=deadline), None)
        order = tuple(range(count(program).primitives))
        return FinishedProgram(delivered, _rename(delivered, constraints, named), named, None, order=order).with_edges(edges)
    place = {old: new for new, old in enumerate(folding.order)}
    edges = renumber_edges(edges, place)
    folded = with_leaves(folding.folded, _hide_ends(folding.program, folding.folded, deadline, edges))
    given, carried = expand(folded), renumber_constraints(constraints, place)
    constraints = without_hidden(given, _without_rows(holding(given, carried), folded))
    folded = with_leaves(folded, finish_flat(given, folded, deadline, edges))
    delivered = expand(folded)
    constraints = without_loose(given, constraints, delivered, folded)
    delivered, named, folded = _settle(delivered, parametrise(given, constraints, delivered, folded, deadline=deadline), folded)
    return FinishedProgram(delivered, _rename(delivered, constraints, named), named, folded, order=folding.order).with_edges(edges)


def _has_time_to_name(program: Program, name_by: Deadline) -> bool:
    """Whether the names of a program are likely to be found in time: a long one takes long, and so does one whose solid does."""
    primitives = count(program).primitives
    if NAMED_S * primitives > name_by.left():
        return False
    if name_by.left() == math.inf or not FEW < primitives <= MOST_NAMED:
        return True
    return SOLIDS_FOR_NAMES * time_solid(program, name_by.now) <= name_by.left()


def _leave_as_found(program: Program, folding: Folding | None, edges: Sequence[EdgeFeature]) -> FinishedProgram:
    """A program with its exact repeats written once and its numbers rounded, with names for counts alone."""
    if folding is None or not is_same(program, folding.program):
        rounded, order = round_program(program), tuple(range(count(program).primitives))
        return FinishedProgram(rounded, (), Parameters.none(rounded), None, order=order).with_edges(edges)
    folded = with_leaves(folding.folded, round_program(folding.program))
    delivered, place = expand(folded), {old: new for new, old in enumerate(folding.order)}
    named = Parameters.none(delivered, folded)
    return FinishedProgram(delivered, (), named, folded, order=folding.order).with_edges(renumber_edges(edges, place))


def _settle(program: Program, named: Parameters, folded: Folded | None) -> tuple[Program, Parameters, Folded | None]:
    """A program and its names without residues of rounding, as far as the solid is the same: what all but meets may not part by a hair."""
    settled = settle_residues(program, named, folded)
    if settled[0] == program:
        return program, settled[1], folded
    before, after = to_manifold(program), to_manifold(settled[0])
    same = abs(after.volume() - before.volume()) <= SAME * before.volume() and census_of(before).kind == census_of(after).kind
    return settled if same else (program, named, folded)


def _rename(delivered: Program, constraints: Sequence[Constraint], named: Parameters) -> tuple[Constraint, ...]:
    return name_relations(rebase_constraints(delivered, keep_by_names(delivered, constraints, named)), delivered, named)


def finish_flat(program: Program, folded: Folded | None = None, deadline: Deadline = NEVER, edges: Sequence[EdgeFeature] = ()) -> Program:
    """A program as it is delivered: cutters overshoot, as far as the solid stays, and numbers are rounded. Copies stay alike where
    `program` is the expansion of `folded`. Past the `deadline` (by default never) the other cutters stay as they are, and faces that meet
    in `edges` always do: where they end is where the blend is."""
    kept = _faces_at_edges(edges)
    further = overshoot(program, folded, deadline=deadline, kept=kept)
    return preserve(round_program(program), round_program(further), together=_rows_of_copies(folded), deadline=deadline)


def _hide_ends(program: Program, folded: Folded | None, deadline: Deadline, edges: Sequence[EdgeFeature]) -> Program:
    """A program with ends that nothing is seen of far out in the air, unless an edit takes them along with a face that is seen, and walls
    of drawings as far out where nothing is seen of them; as it is past the `deadline`."""
    if deadline.has_passed():
        return program
    before, blended = program, _faces_at_edges(edges)
    for masks in (True, False):  # what ends beyond a mask's end follows that
        kept = blended | {(end.leaf, plane_face(end.local)) for end in find_followed_ends(program)}
        program = _unparted(program, reach_far(program, folded, kept, deadline, masks))
    program = _unparted(program, reach_walls_far(program, folded, deadline))
    return preserve(before, program, together=_rows_of_copies(folded), deadline=deadline)


def _unparted(before: Program, after: Program) -> Program:
    """What comes after, unless it has other bodies or holes: what holds parts together may be too thin for its volume to tell."""
    kinds = (census_of(to_manifold(program)).kind for program in (before, after))
    return before if after != before and len(set(kinds)) > 1 else after


def _faces_at_edges(edges: Sequence[EdgeFeature]) -> set[tuple[int, Face | None]]:
    """The plane faces of leaves that meet in edges which have a feature."""
    return {(face.leaf, plane_face(face.name)) for feature in edges for edge in feature.edges for face in edge}


def _rows_of_copies(folded: Folded | None) -> list[list[int]] | None:
    return None if folded is None else [[i for i, _ in copies] for copies in copies_of(folded).values()]


def _foldings(program: Program, deadline: Deadline) -> list[Folding]:
    """Ways to write the repeats of a program, what repeats exactly, nearly, or once its parts are gathered; those that save most first."""
    exact = fold_repeats(program)
    more = [f for f in _others(program, deadline) if exact is None or worth(f.folded) > worth(exact.folded)]
    return more if exact is None else [*more, exact]


def _others(program: Program, deadline: Deadline) -> list[Folding]:
    """The repeats of what nearly repeats, and of what does once its parts are gathered; those that save most first.

    All number the leaves of the program given.
    """
    tolerance = NEAR * extent(program)
    near = fold_repeats(program, tolerance)
    found, known = [near], _leaves_of_repeats(near)
    if count(program).primitives > MOST_GATHERED or deadline.has_passed():
        return [] if near is None else [near]
    gathering = Commutation(program)
    for largest in GATHERED:
        if deadline.has_passed():
            break
        loose = _folding_of(gathering.commute(largest), tolerance)
        if _leaves_of_repeats(loose) <= known:
            continue
        # what does not repeat then stays where it is
        found += [loose, _folding_of(gathering.commute(largest, {i for numbers in _leaves_of_repeats(loose) for i in numbers}), tolerance)]
    return sorted(filter(None, found), key=lambda f: worth(f.folded), reverse=True)


def _folding_of(gathered: CommutedProgram | None, tolerance: float) -> Folding | None:
    """The repeats of a program whose parts were gathered, with the leaves numbered as before that."""
    folding = None if gathered is None else fold_repeats(gathered.program, tolerance)
    if gathered is None or folding is None:
        return None
    return Folding(folding.folded, tuple(gathered.order[i] for i in folding.order))


def _leaves_of_repeats(folding: Folding | None) -> set[frozenset[int]]:
    """The leaves of each repeat, by their numbers before folding."""
    return set() if folding is None else {frozenset(folding.order[n : n + size(r)]) for n, r in repeats(folding.folded)}


def _without_rows(constraints: Sequence[Constraint], folded: Folded) -> tuple[Constraint, ...]:
    """Without rows and circles of copies of one leaf, and copies that are level, which the repeat says; of circles the middle stays, by an
    opposite pair. Where rounding has left copies less than level, their circle could have no other diameter."""
    sources = {i: source for i, (source, _) in enumerate(instances(folded))}
    out: list[Constraint] = []
    for c in constraints:
        members, half = [ref.leaf for ref in c.of], len(c.of) // 2
        is_of_copies = WORLD not in members and len({sources[leaf] for leaf in members}) == 1
        if is_of_copies and c.kind == "aligned" and not any(ref.feature for ref in c.of):
            continue
        if not is_of_copies or c.kind not in ("linear", "circular") or len(members) < 3:
            out.append(c)
        elif c.about is not None and c.about.leaf not in members and len(members) % 2 == 0:
            out.append(replace(c, of=(c.of[0], c.of[half])))
    return tuple(out)
