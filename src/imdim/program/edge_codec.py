"""The nodes of edge features in a program document."""

from __future__ import annotations

from typing import Any, cast

from imdim.program import fields
from imdim.program.edges import EDGE_KINDS, SIZES_OF, EdgeFeature, EdgeKind, Face, check_edges, read_face
from imdim.program.tree import Program, leaves

MAX_EDGE_FEATURES = 1000
MAX_EDGES = 10_000  # of all features: each is looked for on the solid
MAX_NAME = 100  # characters
_SIZES = tuple(name for names in SIZES_OF.values() for name in names)


def edge_node(feature: EdgeFeature) -> dict[str, Any]:
    """The node of an edge feature."""
    sizes = dict(zip(SIZES_OF[feature.kind], map(float, feature.sizes), strict=False))
    named = {"name": feature.name} if feature.name else {}
    return {"kind": feature.kind, **named, **sizes, "edges": [[str(one), str(two)] for one, two in feature.edges]}


def read_edges(entries: object, program: Program) -> tuple[EdgeFeature, ...]:
    """The edge features of a document with `program`; raises a one-line ValueError that names the path and the number or word at fault."""
    if not isinstance(entries, list) or len(entries) > MAX_EDGE_FEATURES:
        raise ValueError(f"$.edges: expected a list of at most {MAX_EDGE_FEATURES}, got {fields.show(entries)}")
    features = tuple(_read_edge_feature(entry, f"$.edges[{i}]") for i, entry in enumerate(entries))
    if (total := sum(len(feature.edges) for feature in features)) > MAX_EDGES:
        raise ValueError(f"$.edges: at most {MAX_EDGES} edges, got {total}")
    try:
        check_edges(features, list(leaves(program)))
    except ValueError as error:
        raise ValueError(f"$.{error}") from None
    return features


def _read_edge_feature(entry: object, path: str) -> EdgeFeature:
    kind = cast(
        EdgeKind, fields.choice(fields.record(entry, path, ("kind", "edges"), ("name", *_SIZES))["kind"], f"{path}.kind", EDGE_KINDS)
    )
    first, *more = SIZES_OF[kind]
    given = fields.record(entry, path, ("kind", first, "edges"), ("name", *more))
    sizes = tuple(fields.number(given[name], f"{path}.{name}") for name in (first, *more) if name in given)
    if not isinstance(given["edges"], list) or not 1 <= len(given["edges"]) <= MAX_EDGES:
        raise ValueError(f"{path}.edges: expected a list of 1 to {MAX_EDGES} edges, got {fields.show(given['edges'])}")
    edges = tuple(_read_edge(edge, f"{path}.edges[{i}]") for i, edge in enumerate(given["edges"]))
    name = given.get("name", "")
    if not isinstance(name, str) or not (name == "" or (name.isascii() and name.isidentifier() and len(name) <= MAX_NAME)):
        raise ValueError(f"{path}.name: expected a name of letters, digits and _, got {fields.show(name)}")
    try:
        return EdgeFeature(kind, sizes, edges, name)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _read_edge(value: object, path: str) -> tuple[Face, Face]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{path}: expected the two faces that meet in it, got {fields.show(value)}")
    try:
        one, two = (read_face(face) for face in value)
    except ValueError as error:
        raise ValueError(f"{path}: {error}, got {fields.show(value)}") from None
    return one, two
