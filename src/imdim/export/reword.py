"""A delivered program of another structure: its names found anew, and all its texts written with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imdim.export.delivered import LOOPS, Delivered, read_values, texts_of
from imdim.export.edge_text import with_edge_sizes
from imdim.export.elimination import without_loose
from imdim.export.feature_names import label_features
from imdim.export.openscad_reader import are_drawn
from imdim.export.parameters import parametrise
from imdim.export.relation_names import name_relations
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature, name_edges
from imdim.program.repeats import Folded
from imdim.program.tree import Program


def reword(
    delivered: Delivered, program: Program, folded: Folded | None, constraints: Sequence[Constraint], edges: Sequence[EdgeFeature]
) -> Delivered:
    """`program` with texts of the same files as those of `delivered`, and one with loops where `folded` has its first repeats.

    `constraints` hold for it; those that no names can keep are left out. `edges` are of it, and keep their names where these are free.
    """
    kept = without_loose(program, constraints, program, folded)
    named = parametrise(program, kept, program, folded)
    kept = name_relations(kept, program, named)
    edges = name_edges(edges, named.values)
    named = with_edge_sizes(named, edges)
    written = texts_of(program, named, folded, delivered.segments, edges, are_drawn(delivered.texts["program.scad"]))
    had = {*delivered.texts} | ({LOOPS[0]} if delivered.folded is None else set())
    texts = {file: text for file, text in written.items() if file in had}
    values = read_values(texts["program.scad"])
    return replace(
        delivered,
        program=program,
        constraints=kept,
        texts=texts,
        values=values,
        folded=folded,
        counts=named.counts,
        edges=edges,
        labels=named.labels or label_features(program, kept, folded),
    )
