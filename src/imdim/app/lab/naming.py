"""The names of a program's numbers, as its files have them: what a row of the parameter table stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from imdim.delivery.finish import FinishedProgram
from imdim.export.delivered import Delivered, Feature, Followers, find_followers, read_values, texts_of
from imdim.export.edge_text import with_edge_sizes
from imdim.export.edit import open_delivered
from imdim.export.elimination import without_loose
from imdim.export.feature_names import label_features
from imdim.export.parameters import parametrise
from imdim.geometry.solid import SEGMENTS
from imdim.program import codec
from imdim.program.codec import Meta
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature, name_edges
from imdim.program.patterns.detect import fold_repeats
from imdim.program.tree import Program
from imdim.relations.residuals import holding


@dataclass(frozen=True, eq=False)
class NamedProgram:
    """A program with its texts, and what follows each of its names.

    `labels` are what its primitives are called. `constraints` are those that the lab had when it got its names, of which the texts may say
    fewer. Where it `is_final` its texts are those that are downloaded; else the program is finished once more for that. `origin` is what a
    run found, of which this is the finished form, None where it is what was found.
    """

    delivered: Delivered
    constraints: tuple[Constraint, ...]
    labels: tuple[str, ...]
    followers: Mapping[str, Followers]
    is_final: bool = False
    origin: Program | None = None

    @staticmethod
    def of(
        delivered: Delivered, constraints: Sequence[Constraint] | None = None, is_final: bool = False, origin: Program | None = None
    ) -> NamedProgram:
        """`constraints` are by default those that the texts say."""
        kept = delivered.constraints if constraints is None else tuple(constraints)
        return NamedProgram(delivered, kept, delivered.labels, find_followers(delivered), is_final, origin)

    def is_of(self, program: Program, constraints: Sequence[Constraint], edges: Sequence[EdgeFeature]) -> bool:
        """Whether these are the names of that program, and of nothing that it was before."""
        own = self.delivered
        return own.program == program and own.edges == tuple(edges) and self.constraints == tuple(constraints)

    def with_values(self, delivered: Delivered, constraints: Sequence[Constraint]) -> NamedProgram:
        """The same names at other values."""
        return replace(self, delivered=delivered, constraints=tuple(constraints), origin=None)


def name_finished(found: FinishedProgram, meta: Meta, constraints: Sequence[Constraint], origin: Program) -> NamedProgram:
    """The names of a program as it is delivered."""
    texts = texts_of(found.program, found.parameters, found.folded, SEGMENTS, found.edges)
    values = read_values(texts["program.scad"])
    counts = found.parameters.counts
    delivered = Delivered(found.program, meta, found.constraints, texts, values, SEGMENTS, found.folded, counts, found.edges, found.labels)
    return NamedProgram.of(delivered, constraints, True, origin)


def name_as_it_is(program: Program, constraints: Sequence[Constraint], edges: Sequence[EdgeFeature], meta: Meta) -> NamedProgram:
    """The names of a program that a person has changed: its primitives keep their order and their numbers, and those relations that do not
    hold say nothing."""
    folding = fold_repeats(program)
    folded = folding.folded if folding is not None and folding.order == tuple(sorted(folding.order)) else None
    kept = without_loose(program, holding(program, constraints), program, folded)
    named = parametrise(program, kept, program, folded)
    folded = folded if named.loops else None  # copies that are a hair off have no names in common
    edges = name_edges(edges, named.values)
    named = with_edge_sizes(named, edges)
    called = named.labels or label_features(program, kept, folded)
    texts = texts_of(program, named, folded, SEGMENTS, edges)
    values = read_values(texts["program.scad"])
    return NamedProgram.of(Delivered(program, meta, kept, texts, values, SEGMENTS, folded, named.counts, edges, called), constraints)


def to_values(named: NamedProgram) -> dict[str, Any]:
    """A named program as plain values, for a message."""
    own = named.delivered
    return {
        "document": codec.to_json(own.program, own.meta, own.constraints, own.folded, own.edges),
        "texts": dict(own.texts),
        "labels": list(named.labels),
        "followers": {name: [list(map(list, found)) for found in f] for name, f in named.followers.items()},
        "origin": None if named.origin is None else codec.to_json(named.origin),
    }


def from_values(values: Mapping[str, Any], constraints: Sequence[Constraint]) -> NamedProgram:
    """The final one of `to_values`; raises a one-line ValueError where its texts and its document disagree."""
    delivered = open_delivered(values["document"], values["texts"])
    found = {name: Followers(*map(_features, lists)) for name, lists in values["followers"].items()}
    origin = None if values["origin"] is None else codec.from_json(values["origin"])
    return NamedProgram(delivered, tuple(constraints), tuple(values["labels"]), found, True, origin)


def _features(pairs: Sequence[Sequence[Any]]) -> list[Feature]:
    return [(int(leaf), str(feature)) for leaf, feature in pairs]
