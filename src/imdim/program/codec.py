"""Versioned JSON for programs: readable, exact (numbers round-trip bit for bit), the same bytes for the same program.

In memory a tree is binary; on paper operations are n-ary. Writing flattens nested unions, nested intersections and the
left spine of differences (``(a - b) - c`` is ``[a, b, c]``); reading folds the parts from the left. Re-reading gives the
same solid with the same order of primitives, and writing that again the same bytes. Constraints (`constraints.py`) count the
primitives in that order. Repeated parts may be written once (`repeats.py`): such a document reads as the expanded program, copy after
copy. A document has the lowest version that can say it. `program.schema.json` is its JSON Schema.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from imdim.program import fields
from imdim.program.constraints import RULES, Constraint, ConstraintError, Ref, check_all, read_ref
from imdim.program.edge_codec import edge_node, read_edges
from imdim.program.edges import EdgeFeature, check_edges
from imdim.program.hole_codec import HoleFeature, hole_node, read_holes
from imdim.program.node_codec import MAX_DEPTH, MAX_PRIMITIVES, encode_folded, program_node, read_node, text_lines
from imdim.program.repeats import Folded, expand, repeats
from imdim.program.tree import Program, Vec3, leaves
from imdim.program.units import MILLIMETRES, UNSPECIFIED

FORMAT = "imdim-csg"
# plain, with constraints, with repeats, with outlines, with edge features, with holes
VERSIONS = VERSION, CONSTRAINED, REPEATED, OUTLINES, EDGES, HOLES = 1, 2, 3, 4, 5, 6
MAX_CONSTRAINTS = 10_000
MAX_CHARACTERS = 8 * 1024 * 1024
MAX_BRACKETS = 500_000  # seven programs of 10,000 primitives have 350,000
UNITS = (UNSPECIFIED, *MILLIMETRES)
CONVENTION = {"axes": "right-handed", "rotation": "Rz @ Ry @ Rx, degrees"}


@dataclass(frozen=True)
class Meta:
    """What the numbers mean. `units` is one of UNITS (the names of 3MF); the numbers are in the target's own frame.

    `center` and `scale` record the frame in which the program was found: ``normalised = (original - center) * scale``.
    """

    units: str = "unspecified"
    center: Vec3 = (0.0, 0.0, 0.0)
    scale: float = 1.0

    def __post_init__(self) -> None:
        if self.units not in UNITS:
            raise ValueError(f"unknown units {self.units!r}; known are {', '.join(UNITS)}")
        if not all(math.isfinite(v) for v in self.center) or not 0 < self.scale < math.inf:
            raise ValueError(f"a frame needs a finite center and a positive scale, got {self.center} and {self.scale}")


def to_json(
    program: Program,
    meta: Meta | None = None,
    constraints: Sequence[Constraint] = (),
    folded: Folded | None = None,
    edges: Sequence[EdgeFeature] = (),
    holes: Sequence[HoleFeature] = (),
) -> dict[str, Any]:
    """The document as plain dicts, lists, strings and numbers; `folded`, which `program` is the expansion of, gives it repeats.

    Raises ValueError beyond MAX_DEPTH or MAX_PRIMITIVES and for an edge of no face, ConstraintError, which names it, for a constraint that
    is ill-formed or contradicts another.
    """
    meta = meta or Meta()
    count, depth, node = program_node(program) if folded is None else encode_folded(folded)
    if count > MAX_PRIMITIVES or depth > MAX_DEPTH:
        raise ValueError(f"a document holds {MAX_PRIMITIVES} primitives and {MAX_DEPTH} nested operations at most, got {count} and {depth}")
    frame = {**CONVENTION, "center": [float(v) for v in meta.center], "scale": float(meta.scale)}
    version = REPEATED if folded is not None and any(repeats(folded)) else CONSTRAINED if constraints else VERSION
    version = OUTLINES if any(leaf.outline for leaf in leaves(program)) else version
    version = HOLES if holes else EDGES if edges else version
    document: dict[str, Any] = {"format": FORMAT, "version": version, "units": meta.units, "frame": frame, "program": node}
    if edges:
        check_edges(edges, list(leaves(program)))
        document["edges"] = [edge_node(feature) for feature in edges]
    if holes:
        document["holes"] = [hole_node(hole) for hole in holes]
    if constraints:
        check_all(constraints, list(leaves(program)))
        document["constraints"] = [_constraint(c) for c in constraints]
    return document


def from_json(document: object) -> Program:
    """The program of a document. Raises a one-line ValueError that names the JSON path and the number or word at fault."""
    return _read_document(document)[0]


def read_folded(document: object) -> Folded:
    """The program of a document with its repeats; raises like `from_json`."""
    return _read_document(document)[3]


def meta_of(document: object) -> Meta:
    """Units and frame of a document; raises like `from_json`."""
    return _read_document(document)[1]


def constraints_of(document: object) -> tuple[Constraint, ...]:
    """The constraints of a document, none where it has none; raises like `from_json`, ConstraintError for those at fault."""
    return _read_document(document)[2]


def edges_of(document: object) -> tuple[EdgeFeature, ...]:
    """The edge features of a document, none where it has none; raises like `from_json`."""
    return _read_document(document)[4]


def holes_of(document: object) -> tuple[HoleFeature, ...]:
    """The holes of a document, none where it has none; raises like `from_json`."""
    return _read_document(document)[5]


def dumps(
    program: Program,
    meta: Meta | None = None,
    constraints: Sequence[Constraint] = (),
    folded: Folded | None = None,
    edges: Sequence[EdgeFeature] = (),
    holes: Sequence[HoleFeature] = (),
) -> str:
    """The document as text, one primitive, edge feature, hole and constraint per line; deterministic. Raises like `to_json`."""
    document = to_json(program, meta, constraints, folded, edges, holes)
    entries = [f"  {_text(key)}: {_text(document[key])}" for key in ("format", "version", "units", "frame")]
    entries.append('  "program": ' + "\n".join(text_lines(document["program"], "  ")))
    if edges:
        entries.append('  "edges": [\n' + ",\n".join(f"    {_text(e)}" for e in document["edges"]) + "\n  ]")
    if holes:
        entries.append('  "holes": [\n' + ",\n".join(f"    {_text(e)}" for e in document["holes"]) + "\n  ]")
    if constraints:
        entries.append('  "constraints": [\n' + ",\n".join(f"    {_text(c)}" for c in document["constraints"]) + "\n  ]")
    return "{\n" + ",\n".join(entries) + "\n}\n"


def loads(text: str | bytes) -> Program:
    """The program of a text (UTF-8 if bytes); raises like `from_json`."""
    return from_json(parse(text))


def parse(text: str | bytes) -> object:
    """Strict JSON: no NaN, no infinity, no repeated keys, at most MAX_CHARACTERS and MAX_BRACKETS; a one-line ValueError otherwise."""
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"$: {len(text)} characters; at most {MAX_CHARACTERS}")
    lists, objects = (text.count("["), text.count("{")) if isinstance(text, str) else (text.count(b"["), text.count(b"{"))
    if lists + objects > MAX_BRACKETS:
        raise ValueError(f"$: {lists + objects} lists and objects; at most {MAX_BRACKETS}")
    try:
        return json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError(f"$: nested too deep; at most {MAX_DEPTH} operations inside each other") from None
    except ValueError as error:
        message = str(error)
        raise ValueError(message if message.startswith("$") else f"$: not JSON: {message}") from None


# --- writing ---------------------------------------------------------------------------------------------------------


def _constraint(c: Constraint) -> dict[str, Any]:
    out: dict[str, Any] = {"kind": c.kind, "of": [str(ref) for ref in c.of]}
    if c.about is not None:
        out["about"] = str(c.about)
    if RULES[c.kind].has_value:
        out["value"] = float(c.value)
    return out | ({"name": c.name} if c.name else {})


def _text(value: object) -> str:
    return json.dumps(value, allow_nan=False)


# --- reading ---------------------------------------------------------------------------------------------------------


_Read = tuple[Program, Meta, tuple[Constraint, ...], Folded, tuple[EdgeFeature, ...], tuple[HoleFeature, ...]]


def _read_document(document: object) -> _Read:
    top = fields.record(document, "$", ("format", "version", "program"), ("units", "frame", "edges", "holes", "constraints"))
    if top["format"] != FORMAT:
        raise ValueError(f"$.format: expected {FORMAT!r}, got {fields.show(top['format'])}")
    if type(top["version"]) is not int or top["version"] not in VERSIONS:
        raise ValueError(f"$.version: this reader knows versions {', '.join(map(str, VERSIONS))}, got {fields.show(top['version'])}")
    if top["version"] == VERSION and "constraints" in top:
        raise ValueError(f"$.constraints: version {VERSION} has none, they came with version {CONSTRAINED}")
    folded = read_node(top["program"], "$.program")
    if top["version"] < REPEATED and any(repeats(folded)):
        raise ValueError(f"$.program: version {top['version']} has no repeats, they came with version {REPEATED}")
    try:
        program = expand(folded)
    except ValueError as error:
        raise ValueError(f"$.program: {error}") from None
    if top["version"] < OUTLINES and any(leaf.outline for leaf in leaves(program)):
        raise ValueError(f"$.program: version {top['version']} has no outlines, they came with version {OUTLINES}")
    if top["version"] < EDGES and "edges" in top:
        raise ValueError(f"$.edges: version {top['version']} has none, they came with version {EDGES}")
    if top["version"] < HOLES and "holes" in top:
        raise ValueError(f"$.holes: version {top['version']} has none, they came with version {HOLES}")
    edges, holes = read_edges(top.get("edges", []), program), read_holes(top.get("holes", []), program)
    return program, _read_meta(top), _read_constraints(top.get("constraints", []), program), folded, edges, holes


def _read_constraints(entries: object, program: Program) -> tuple[Constraint, ...]:
    if not isinstance(entries, list) or len(entries) > MAX_CONSTRAINTS:
        raise ConstraintError(f"$.constraints: expected a list of at most {MAX_CONSTRAINTS}, got {fields.show(entries)}")
    constraints = tuple(_read_constraint(entry, f"$.constraints[{i}]") for i, entry in enumerate(entries))
    try:
        check_all(constraints, list(leaves(program)))
    except ConstraintError as error:
        raise ConstraintError(f"$.{error}") from None
    return constraints


def _read_constraint(entry: object, path: str) -> Constraint:
    given = fields.record(entry, path, ("kind", "of"), ("about", "value", "name"))
    kind = fields.choice(given["kind"], f"{path}.kind", tuple(RULES))
    if not isinstance(given["of"], list):
        raise ConstraintError(f"{path}.of: expected a list of features, got {fields.show(given['of'])}")
    of = tuple(_read_feature(ref, f"{path}.of[{i}]") for i, ref in enumerate(given["of"]))
    about = _read_feature(given["about"], f"{path}.about") if "about" in given else None
    name = given.get("name", "")
    if not isinstance(name, str) or not (name == "" or (name.isascii() and name.isidentifier() and len(name) <= 100)):
        raise ConstraintError(f"{path}.name: expected a name of letters, digits and _, got {fields.show(name)}")
    return Constraint(kind, of, about, fields.number(given.get("value", 0), f"{path}.value"), name)


def _read_feature(text: object, path: str) -> Ref:
    try:
        return read_ref(text)
    except ValueError as error:
        raise ConstraintError(f"{path}: {error}, got {fields.show(text)}") from None


def _read_meta(top: dict[str, Any]) -> Meta:
    frame = fields.record(top.get("frame", {}), "$.frame", (), (*CONVENTION, "center", "scale"))
    for key, value in CONVENTION.items():
        fields.choice(frame.get(key, value), f"$.frame.{key}", (value,))
    units = fields.choice(top.get("units", "unspecified"), "$.units", UNITS)
    center = fields.vector(frame.get("center", [0, 0, 0]), "$.frame.center")
    scale = fields.number(frame.get("scale", 1), "$.frame.scale")
    if scale <= 0:
        raise ValueError(f"$.frame.scale: needs a positive number, got {scale}")
    return Meta(units, center, scale)


def _unique_keys(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"$: the key {fields.show(key)} occurs twice in one object")
        out[key] = value
    return out


def _refuse_constant(name: str) -> float:
    raise ValueError(f"$: {name} is not a number of JSON")
