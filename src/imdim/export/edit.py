"""Edit a delivered program by the names at the head of its texts: the same texts with other values, and the program they then describe.

What follows a name is what follows it in ``program.scad``, so that an edit here is OpenSCAD's ``-D name=value``. How often parts repeat are
names of the texts with loops; another count makes another program, of which all texts are written anew.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from manifold3d import Manifold

from imdim.deadline import NEVER
from imdim.export.customizer import slider
from imdim.export.delivered import AGREE, LOOPS, NAMED, SEGMENTS_LINE, Delivered, EditError, is_size, read, read_values, texts_of
from imdim.export.edge_text import with_edge_sizes
from imdim.export.edit_report import picture_of
from imdim.export.feature_names import label_features
from imdim.export.feature_notes import feature_notes, read_labels, renew_notes
from imdim.export.folder import EDIT_PICTURE, FILES, replacing
from imdim.export.hole_names import hole_features
from imdim.export.meshes import NamedFeatures, write_meshes
from imdim.export.numbers import MAX_SEGMENTS, Rounding, plain, round_program, to_fixed_point
from imdim.export.openscad_reader import are_drawn, read_openscad
from imdim.export.parameters import parametrise
from imdim.export.step_worker import exporting, finish_or_skip_step
from imdim.geometry.edge_solids import blend_solids, solid_with_edges
from imdim.geometry.edges import find_edges, has_room
from imdim.geometry.lowering import lower
from imdim.geometry.solid import SEGMENTS, join_touching
from imdim.program.codec import constraints_of, dumps, edges_of, from_json, holes_of, meta_of, read_folded
from imdim.program.constraints import Constraint, ConstraintError
from imdim.program.edges import EdgeFeature, EdgeNumber, describe_size, name_edges, with_sizes
from imdim.program.ellipse import Ellipse
from imdim.program.hole_codec import find_stale
from imdim.program.node_codec import MAX_PRIMITIVES
from imdim.program.outline import Loop, Outline, are_near, check_crossings, reverse_ring
from imdim.program.patterns.edit import recount_constraints, recount_edges, recount_repeats, refit_repeats
from imdim.program.repeats import Folded, expand, repeats, size, with_leaves
from imdim.program.tree import Primitive, Program, leaves, longest
from imdim.relations.residuals import verify

LARGEST_VOLUME = 1e30  # mesh files hold single precision


def open_delivered(document: object, texts: Mapping[str, str]) -> Delivered:
    """A program.json with the texts that lie beside it, by their names in TEXTS; without program.scad names come from the constraints.

    Raises a one-line ValueError for a document or a text at fault, and where they do not describe one program.
    """
    program, constraints, folded = from_json(document), constraints_of(document), read_folded(document)
    folded = folded if any(repeats(folded)) else None
    check_holes(document, program)
    edges = name_edges(edges_of(document))
    if "program.scad" not in texts:
        named = with_edge_sizes(parametrise(program, constraints, program, folded), edges)
        texts = texts_of(program, named, folded, SEGMENTS, edges)
    values = read_values(texts["program.scad"])
    found = SEGMENTS_LINE.search(texts["program.scad"])
    segments = int(found[1]) if found else SEGMENTS
    if not 3 <= segments <= MAX_SEGMENTS:
        raise EditError(f"program.scad: $fn must lie in 3..{MAX_SEGMENTS}, got {found[1][:20] if found else segments}")
    counts = {n: int(c) for file in LOOPS if folded and file in texts for n, c in read_values(texts[file]).items() if n not in values}
    called = read_labels(texts["program.scad"], program, folded) or label_features(program, constraints, folded)
    delivered = Delivered(program, meta_of(document), constraints, texts, values, segments, folded, counts, edges, called)
    _check_same(delivered)
    return delivered


def check_holes(document: object, program: Program) -> None:
    """Raise EditError for holes of a program.json that were changed by hand: they follow from its primitives."""
    written = holes_of(document)
    if written and (stale := find_stale(written, hole_features(program))) is not None:
        raise EditError(
            f"$.holes[{stale}] of program.json is not what its primitives make: change a hole by the names that `imdim edit --list` shows, "
            "or take the list out where primitives were changed by hand, and it is written anew"
        )


def change_values(delivered: Delivered, values: Mapping[str, float]) -> Delivered:
    """The program with some names at other values. Raises EditError for a name or value that cannot be."""
    values = {name: float(value) for name, value in values.items()}
    counts = {name: value for name, value in values.items() if name in delivered.counts}
    if counts:
        recounted = with_counts(delivered, counts)
        rest = {name: value for name, value in values.items() if name not in counts}
        return change_values(recounted, rest) if rest else recounted
    _check_values(delivered, values)
    try:
        return _read_anew(delivered, values)
    except ValueError as error:
        said = ", ".join(f"{name} = {plain(value)}" for name, value in values.items())
        raise EditError(f"{said}: {error}") from None


def restate(delivered: Delivered) -> Delivered:
    """The program with its numbers as its texts have them, which is what an edit begins from.

    They differ from those of program.json by their last digits; where faces all but meet, these decide whether there is a gap.
    Raises EditError where the texts do not say the program.
    """
    try:
        return _read_anew(delivered, {})
    except ValueError as error:
        raise EditError(f"program.scad: {error}") from None


def _read_anew(delivered: Delivered, values: Mapping[str, float]) -> Delivered:
    """What the texts say with some names at other values; raises a one-line ValueError where that is nothing."""
    texts = {file: _rewrite(text, values) for file, text in delivered.texts.items()}
    exact = read_openscad(texts["program.scad"])
    for number, leaf in enumerate(leaves(exact)):
        _check_outline(number, leaf)
    program = round_program(exact)
    verify(program, delivered.constraints, AGREE)
    folded = None if delivered.folded is None else refold(delivered.folded, exact, program)
    program = program if folded is None else expand(folded)
    called = read_labels(delivered.texts["program.scad"], program, folded)  # none in texts of older versions
    notes = feature_notes(delivered.program, called, delivered.folded), feature_notes(program, called, folded)
    texts = {file: renew_notes(text, *notes) for file, text in texts.items()}
    edges = with_sizes(delivered.edges, values)
    return replace(delivered, program=program, texts=texts, values={**delivered.values, **values}, folded=folded, edges=edges)


def _check_outline(number: int, leaf: Primitive) -> None:
    """Raise a one-line ValueError for loops that cross or touch."""
    if leaf.outline is not None:
        try:
            check_crossings(leaf.outline)
        except ValueError as error:
            raise ValueError(f"primitive {number}: {error}") from None


def with_counts(delivered: Delivered, counts: Mapping[str, float]) -> Delivered:
    """The program with other counts of copies; raises EditError for what is no count, or where the names have changed by hand."""
    folded = delivered.folded
    assert folded is not None
    for name, count in counts.items():
        if not (math.isfinite(count) and count == int(count) and count >= 2):
            raise EditError(f"{name} needs a whole number of 2 or more, got {plain(count)}")
    named = parametrise(delivered.program, delivered.constraints, delivered.program, folded)
    if not counts.keys() <= named.counts.keys():
        raise EditError(
            f"the counts are {', '.join(named.counts)} by program.json, and not {', '.join(counts)}: one of them was changed by hand"
        )
    wanted = {**delivered.counts, **{name: int(count) for name, count in counts.items()}}
    found = {i: tuple(wanted[name] for name in loop.counts) for i, loop in enumerate(named.loops) if loop.counts}
    after = recount_repeats(folded, found)
    if size(after) > MAX_PRIMITIVES:
        raise EditError(f"{', '.join(counts)}: {size(after)} primitives, more than {MAX_PRIMITIVES}")
    program = expand(after)
    constraints = tuple(c for c in recount_constraints(delivered.constraints, folded, after) if _holds(c, program))
    edges = recount_edges(delivered.edges, folded, after)
    named = with_edge_sizes(parametrise(program, constraints, program, after, delivered.values), edges)
    written = texts_of(program, named, after, delivered.segments, edges, are_drawn(delivered.texts["program.scad"]))
    texts = {file: text for file, text in written.items() if file in delivered.texts}
    return replace(
        delivered,
        program=program,
        constraints=constraints,
        texts=texts,
        values=read_values(texts["program.scad"]),
        folded=after,
        counts=named.counts,
        edges=edges,
        labels=named.labels or label_features(program, constraints, after),
    )


def _holds(constraint: Constraint, program: Program) -> bool:
    try:
        verify(program, [constraint], AGREE)
    except ConstraintError:
        return False
    return True


def refold(folded: Folded, exact: Program, program: Program) -> Folded:
    """The repeats with the numbers of `program`, which are rounded; their steps and centres come from `exact` ones. Raises EditError where
    copies would no longer be alike."""
    out = with_leaves(refit_repeats(folded, exact, Rounding.of(program).decimals + 1), program)
    if not _agree(expand(out), program):
        raise EditError("copies of one part would no longer be alike")
    return out


def solid_of(delivered: Delivered) -> Manifold:
    """The exact solid; raises EditError where nothing is left of it."""
    solid = solid_with_edges(delivered.program, delivered.edges, delivered.segments, join_touching)
    if not 0 < solid.volume() < LARGEST_VOLUME:
        raise EditError(f"no solid is left, its volume is {solid.volume():g}")
    return solid


def lost_edges(before: Delivered, after: Delivered) -> list[str]:
    """A sentence for each edge feature of which edges that there were are gone after an edit."""
    had, has = ({*blend_solids(d.program, d.edges).missing} for d in (before, after))
    tight = [_without_room(d) for d in (before, after)]
    said = zip(_words(after.edges), map(len, _more(*tight)), strict=True)
    return _tell_gone(after.edges, has - had) + [f"{what}: too large for {n} of {of}" for (what, of), n in said if n]


def missing_edges(program: Program, edges: Sequence[EdgeFeature]) -> list[str]:
    """A sentence for each edge feature of which edges are none of the program's solid, as in a document that was changed by hand."""
    return _tell_gone(edges, blend_solids(program, edges).missing)


def _tell_gone(edges: Sequence[EdgeFeature], gone: Collection[EdgeNumber]) -> list[str]:
    counts = [sum(1 for feature, _ in gone if feature == i) for i in range(len(edges))]
    return [f"{what}: {n} of {of} no more" for (what, of), n in zip(_words(edges), counts, strict=True) if n]


def _words(edges: Sequence[EdgeFeature]) -> list[tuple[str, str]]:
    """What each feature is, and how many edges it has."""
    return [(describe_size(f.kind, f.sizes), f"{len(f.edges)} edges") for f in edges]


def _without_room(delivered: Delivered) -> list[set[int]]:
    """For each edge feature its edges along faces that are too narrow for it."""
    numbers = lower(delivered.program)
    edges = find_edges(delivered.program, delivered.edges).edges
    return [{e.edge for e in edges if e.feature == i and not has_room(numbers, e)} for i in range(len(delivered.edges))]


def _more(before: list[set[int]], after: list[set[int]]) -> list[set[int]]:
    return [new - old for old, new in zip(before, after, strict=True)]


def write(delivered: Delivered, folder: Path, step_limit_s: float = 0.0, solids: tuple[Manifold, Manifold] | None = None) -> dict[str, str]:
    """Write program.json, the texts and the meshes into `folder`, whole or not at all; what became of each file.

    With the `solids` before and after an edit, if they are known, also edit.png, a picture of both. With `step_limit_s` also program.step,
    which is skipped, with the reason, where OpenCASCADE is missing, fails or takes longer.
    Raises OutputError when the folder cannot be written or holds foreign files, EditError where the solid is empty.
    """
    solid = solid_of(delivered) if solids is None else solids[1]
    with replacing(folder) as partial:
        holes = hole_features(delivered.program)
        document = dumps(delivered.program, delivered.meta, delivered.constraints, delivered.folded, delivered.edges, holes)
        texts = {"program.json": document, **delivered.texts}
        for file, text in texts.items():
            (partial / file).write_text(text, encoding="utf-8")
        name = folder.resolve().name
        named = NamedFeatures.of(name, delivered.program, delivered.edges, delivered.labels)
        write_meshes(solid, partial, named, delivered.meta.units)
        if solids is not None:
            picture_of(*solids).save(partial / EDIT_PICTURE)
        skipped: dict[str, str] = {}
        if step_limit_s:
            with exporting(partial, name, named.names.features) as job:
                skipped = finish_or_skip_step(job, NEVER.ahead(step_limit_s), {}, delivered.edges)
        files = {file: "written" for file in FILES if (partial / file).exists()}
    return {**files, **skipped}


def _check_same(delivered: Delivered) -> None:
    """Refuse texts that say something else than the document: an edit would undo what was changed in one of them."""
    if not _agree(delivered.program, read(delivered, {})):
        raise ValueError("program.scad beside it describes another program: one of them was changed by hand")
    both = {**delivered.values, **delivered.counts}
    expected = {file: both if file in LOOPS else delivered.values for file in delivered.texts}
    other = next((file for file, text in delivered.texts.items() if read_values(text) != expected[file]), None)
    if other is not None:
        raise ValueError(f"{other} beside it begins with other names or values than program.scad: one of them was changed by hand")


def _agree(a: Program, b: Program) -> bool:
    """Whether both have the same primitives at the same places, to what texts keep of numbers."""
    ours, theirs = list(leaves(a)), list(leaves(b))
    slack = AGREE * longest(ours)
    return len(ours) == len(theirs) and all(
        p.kind == q.kind
        and max(abs(u - v) for u, v in zip((*p.size, *p.center), (*q.size, *q.center), strict=True)) <= slack
        and _agree_drawn(p.outline, q.outline, slack)
        for p, q in zip(ours, theirs, strict=True)
    )


def _agree_drawn(a: Outline | None, b: Outline | None, slack: float) -> bool:
    """Whether two outlines have the same loops in the same order, wherever these begin and whichever way they run."""
    if a is None or b is None:
        return a is b
    return len(a.loops) == len(b.loops) and all(_agree_loops(u, v, slack) for u, v in zip(a.loops, b.loops, strict=True))


def _agree_loops(a: Loop, b: Loop, slack: float) -> bool:
    if isinstance(a, Ellipse) or isinstance(b, Ellipse):
        return are_near(Outline((a,)), Outline((b,)), slack)
    if len(a) != len(b):
        return False
    for run in (b, reverse_ring(b)):
        nearest = min(range(len(run)), key=lambda k: math.dist(a[0][:2], run[k][:2]))
        for k in (0, nearest):
            turned = Outline((run[k:] + run[:k],))
            if are_near(Outline((a,)), turned, slack):
                return True
    return False


def _check_values(delivered: Delivered, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        if name not in delivered.values:
            names = [*delivered.values, *delivered.counts]
            near = difflib.get_close_matches(name, names, 3, 0.4)
            known = f"nearest are {', '.join(near)}" if near else f"it has {', '.join(names) or 'none'}"
            raise EditError(f"no parameter {name!r}; {known}")
        if not math.isfinite(value):
            raise EditError(f"{name} needs a finite number, got {value}")
        if value <= 0 and is_size(delivered, name):
            raise EditError(f"{name} needs a positive number, got {plain(value)}")


def _rewrite(text: str, values: Mapping[str, float]) -> str:
    def line(found: re.Match[str]) -> str:
        name, _, unit, end, range_ = found.groups(default="")
        if name not in values:
            return found[0]
        number = to_fixed_point(plain(values[name]))
        return f"{name} = {number}{unit}{end}{slider(name, number) if range_ else ''}"

    return NAMED.sub(line, text)
