"""The rows of the parameter table, and what a person does in it: set a value, hold it, break a tie.

Each makes a new theory of an old one, as ``imdim edit`` makes a new folder of an old one, or raises a one-line EditError or LabEditError.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from PIL import Image

from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.naming import NamedProgram
from imdim.app.lab.relation_words import join_words
from imdim.app.lab.solving import Lock
from imdim.export.delivered import Delivered, Feature
from imdim.export.edit import change_values, lost_edges, restate, solid_of
from imdim.export.edit_report import EditReport, picture_of
from imdim.export.feature_names import name_leaves
from imdim.export.parameters import is_count
from imdim.export.untie import untie
from imdim.program.edges import describe_edges
from imdim.program.tree import SIZE_NAMES, leaves
from imdim.relations.residuals import rebase_constraints

SEEN = 32  # facets of a circle, with which it is seen whether anything is left of a solid
MOST_NAMED = 4  # features that one row names
_SIZES = frozenset(name for names in SIZE_NAMES.values() for name in names)


@dataclass(frozen=True)
class ParameterRow:
    """A named number: `drives` says in words what follows it, `shown` are the primitives and edge features that are highlighted for it, by
    their numbers in the lab. `locks` are what the solver holds where the row is `locked`; there are none where it never moves the number.
    `tied` says whether several features share it, and may be untied."""

    name: str
    value: float
    unit: Literal["length", "degrees", "count"]
    drives: str
    shown: tuple[int, ...]
    locks: frozenset[Lock]
    locked: bool
    tied: bool


def list_parameters(theory: ConstrainedProgram) -> list[ParameterRow]:
    """One row for each name of the program, in the order of its texts; none where it has no names yet."""
    named = theory.names
    return [] if named is None else [_row(theory, named, name) for name in (*named.delivered.values, *named.delivered.counts)]


def set_value(theory: ConstrainedProgram, name: str, value: float, strict: bool = False) -> ConstrainedProgram:
    """A name at another value, all that follows it with it. Where `strict`, what opens, closes or parts something is refused."""
    named = _names_of(theory)
    if named.delivered.values.get(name, named.delivered.counts.get(name)) == value:
        return theory
    after = change_values(named.delivered, {name: value})
    seen = solid_of(replace(after, segments=min(SEEN, after.segments)))
    if strict:
        start = restate(named.delivered)
        before = solid_of(replace(start, segments=min(SEEN, start.segments)))
        kind = EditReport.of(before, seen, lost_edges(start, after)).changes_in_kind
        if kind:
            raise LabEditError(f"{name} = {value:g}: {kind}")
    if name in named.delivered.counts:
        again = NamedProgram.of(after, is_final=named.is_final)
        return _restated(theory, again, _locks_within(theory, after))
    constraints = rebase_constraints(after.program, theory.constraints)
    return _restated(theory, named.with_values(after, constraints), theory.locks)


def untie_name(theory: ConstrainedProgram, name: str) -> ConstrainedProgram:
    """Each feature that shares a name has one of its own."""
    after = untie(_names_of(theory).delivered, name)
    # what the texts no longer say would tie the sizes again
    return _restated(theory, NamedProgram.of(after, is_final=True), theory.locks)


def hold_value(theory: ConstrainedProgram, row: ParameterRow) -> ConstrainedProgram:
    """What follows a name as its value is kept by the solver, or let go where it is."""
    return replace(theory, locks=theory.locks - row.locks if row.locked else theory.locks | row.locks)


def read_number(text: str) -> float:
    """A number as a person types it, with a comma or a point; raises LabEditError."""
    try:
        value = float(text.strip().replace(",", "."))
    except ValueError:
        raise LabEditError(f"{text.strip()[:20]!r} is no number") from None
    if not math.isfinite(value):
        raise LabEditError(f"{text.strip()[:20]!r} is no finite number")
    return value


def report_edit(before: Delivered, after: Delivered, lost: int = 0) -> tuple[bool, str]:
    """Whether an edit changed the solid in kind, and what it did to it, in one line; `lost` relations no longer hold."""
    start = restate(before)
    report = EditReport.of(solid_of(start), solid_of(after), lost_edges(start, after))
    dropped = [f"{lost} relation{'s' * (lost != 1)} no longer hold{'s' * (lost == 1)}"] if lost else []
    return bool(report.changes_in_kind), "; ".join([*(" ".join(line.split()) for line in report.lines()), *dropped])


def picture_edit(before: Delivered, after: Delivered, pixels: int) -> Image.Image:
    """The solids before and after an edit, each `pixels` square."""
    return picture_of(solid_of(restate(before)), solid_of(after), pixels)


def name_features(numbers: Iterable[int], theory: ConstrainedProgram) -> str:
    """Primitives by what they are called, not all where these are many."""
    return join_words(name_leaves(numbers, theory.labels, MOST_NAMED))


def _row(theory: ConstrainedProgram, named: NamedProgram, name: str) -> ParameterRow:
    own = named.delivered
    if name in own.counts:
        return ParameterRow(name, float(own.counts[name]), "count", "how many copies there are", (), frozenset(), False, False)
    found, first = named.followers[name], len(theory.labels)
    blends = [i for i, feature in enumerate(own.edges) if name in feature.size_names]
    meant = [f"{word} of {name_features(of, theory)}" for word, of in found.meant().items()]
    meant += [f"size of {describe_edges(own.edges[i])}" for i in blends]
    of = [leaf for leaf, _ in (*found.across, *found.equal)]
    drawn = [leaf for leaf, feature in found.moved if feature == "outline"]
    moved = [leaf for leaf, feature in found.moved if feature != "outline" and leaf not in of]
    follow = [f"{verb} {name_features(what, theory)}" for verb, what in (("shapes", drawn), ("moves", moved)) if what]
    shown = tuple(dict.fromkeys([*(of or drawn or moved), *(first + i for i in blends)]))
    locks = frozenset(Lock(*feature) for feature in (*found.across, *found.equal) if feature[1] != "outline")
    sizes = {leaf for leaf, feature in (*found.across, *found.equal) if feature in _SIZES}
    unit = "degrees" if _is_angle(found.equal) else "count" if is_count(name) else "length"
    drives = "; ".join(meant + follow) or "nothing"
    return ParameterRow(name, own.values[name], unit, drives, shown, locks, bool(locks) and locks <= theory.locks, len(sizes) > 1)


def _is_angle(features: Sequence[Feature]) -> bool:
    return any(feature == "angle" for _, feature in features)


def _names_of(theory: ConstrainedProgram) -> NamedProgram:
    if theory.names is None:
        raise LabEditError("the program is getting its names: try again in a moment")
    return theory.names


def _restated(theory: ConstrainedProgram, named: NamedProgram, locks: frozenset[Lock]) -> ConstrainedProgram:
    own = named.delivered
    return ConstrainedProgram(own.program, named.constraints, locks, own.edges, theory.knows_edges, named)


def _locks_within(theory: ConstrainedProgram, after: Delivered) -> frozenset[Lock]:
    """None where copies came or went, and numbers mean other primitives."""
    same = sum(1 for _ in leaves(theory.program)) == sum(1 for _ in leaves(after.program))
    return theory.locks if same else frozenset()
