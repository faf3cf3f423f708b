"""Write the JSON Schema (draft 2020-12) of program documents, made from the tables that the codec reads: ``python scripts/make_schema.py``.

The published file is tested to be its text. What a schema cannot say (the depth cap, r_minor <= r_major, one positive radius of a cone,
which features a constraint may name) the codec checks.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from imdim.program.codec import CONVENTION, FORMAT, MAX_CONSTRAINTS, UNITS, VERSIONS
from imdim.program.constraints import RULES
from imdim.program.edge_codec import MAX_EDGE_FEATURES, MAX_EDGES
from imdim.program.edges import EDGE_KINDS, SIZES_OF
from imdim.program.hole_codec import HOLE_KINDS, MAX_HOLES, MAX_WORDS
from imdim.program.node_codec import MAX_PRIMITIVES, REPEAT_FIELDS
from imdim.program.outline import MOST_CURVES
from imdim.program.repeats import JOINS, REPEATS
from imdim.program.tree import KINDS, OPS, OUTLINED, SIZE_NAMES

PUBLISHED = Path(__file__).parents[1] / "src" / "imdim" / "program" / "program.schema.json"
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}

_NAME = {"type": "string", "pattern": "^([A-Za-z_][A-Za-z0-9_]{0,99})?$"}

_VERTEX = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}
_ELLIPSE = {
    "type": "object",
    "required": ["rx", "ry"],
    "additionalProperties": False,
    "properties": {
        "rx": {"type": "number", "exclusiveMinimum": 0},
        "ry": {"type": "number", "exclusiveMinimum": 0},
        "center": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
        "angle": {"type": "number"},
    },
}
_OUTLINE = {
    "description": "Closed loops: vertices [x, y] or [x, y, bulge], where a curve turns by 4 atan(bulge) up to the next vertex and 0 is a"
    " line; or an ellipse by its semi-axes, its centre and the degrees from x to the first semi-axis.",
    "type": "array",
    "items": {"oneOf": [{"type": "array", "items": _VERTEX, "minItems": 2, "maxItems": MOST_CURVES}, _ELLIPSE]},
    "minItems": 1,
    "maxItems": MOST_CURVES,
}

_COUNT = {"type": "integer", "minimum": 2, "maximum": MAX_PRIMITIVES}
_REPEAT_FIELD: dict[str, dict[str, Any]] = {
    "count": _COUNT,
    "counts": {"type": "array", "items": _COUNT, "minItems": 2, "maxItems": 2},
    "step": _VECTOR,
    "steps": {"type": "array", "items": _VECTOR, "minItems": 2, "maxItems": 2},
    "angle": {"type": "number"},
    "point": _VECTOR,
    "axis": _VECTOR,
    "normal": _VECTOR,
}


def schema() -> dict[str, Any]:
    """The schema as plain dicts and lists."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "IMDIM CSG program",
        "description": "A solid as primitives and boolean operations, in the target's own units and frame.",
        **_record({"format": {"const": FORMAT}, "version": {"enum": list(VERSIONS)}, "program": {"$ref": "#/$defs/node"}}, _metadata()),
        "$defs": {
            "node": {"oneOf": [{"$ref": f"#/$defs/{name}"} for name in ("operation", *map(_repeat_name, REPEATS), *KINDS)]},
            "operation": _operation(),
            **{_repeat_name(kind): _repeat(kind) for kind in REPEATS},
            **{kind: _primitive(kind) for kind in KINDS},
            "constraint": _constraint(),
            **{kind: _edge_feature(kind) for kind in EDGE_KINDS},
            "hole": _hole(),
            "face": {"type": "string", "pattern": r"^\d{1,9}\.([+-][xyz]|side|wall\[\d{1,4}\]\[\d{1,4}\])$"},
            "feature": {"type": "string", "pattern": r"^(world|\d{1,9})(\.[a-z+-][a-z_]*)?$"},
        },
    }


def schema_text() -> str:
    """The text of `program.schema.json`."""
    return json.dumps(schema(), indent=2) + "\n"


def _metadata() -> dict[str, Any]:
    frame = {key: {"const": value} for key, value in CONVENTION.items()}
    frame |= {"center": _VECTOR, "scale": {"type": "number", "exclusiveMinimum": 0}}
    about = "normalised = (original - center) * scale; the program's numbers are original ones"
    constraints = {"type": "array", "items": {"$ref": "#/$defs/constraint"}, "maxItems": MAX_CONSTRAINTS}
    edges = {"type": "array", "items": {"oneOf": [{"$ref": f"#/$defs/{kind}"} for kind in EDGE_KINDS]}, "maxItems": MAX_EDGE_FEATURES}
    framed = {"description": about, **_record({}, frame)}
    holes = {"type": "array", "items": {"$ref": "#/$defs/hole"}, "maxItems": MAX_HOLES}
    return {"units": {"enum": list(UNITS)}, "frame": framed, "edges": edges, "holes": holes, "constraints": constraints}


def _edge_feature(kind: str) -> dict[str, Any]:
    edge = {"type": "array", "items": {"$ref": "#/$defs/face"}, "minItems": 2, "maxItems": 2}
    edges = {"type": "array", "items": edge, "minItems": 1, "maxItems": MAX_EDGES}
    size = {"type": "number", "exclusiveMinimum": 0}
    first, *more = SIZES_OF[kind]
    about = "Of edges of the sharp program, each named by the two faces that meet in it: '0.+z', '1.side', '2.wall[0][3]'."
    return {
        "description": about,
        **_record({"kind": {"const": kind}, first: size, "edges": edges}, {"name": _NAME, **dict.fromkeys(more, size)}),
    }


def _hole() -> dict[str, Any]:
    size, words = {"type": "number", "exclusiveMinimum": 0}, {"type": "string", "maxLength": MAX_WORDS}
    of = {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1}
    needed = {"kind": {"enum": list(HOLE_KINDS)}, "diameter": size, "depth": {"oneOf": [size, {"const": "through"}]}}
    needed |= {"count": {"type": "integer", "minimum": 1}, "of": of}
    about = "Equal holes that the primitives of some numbers make together; they follow from these."
    more = {"head_diameter": size, "head_depth": size, "screw": words, "pattern": words}
    both = {"head_diameter": ["head_depth"], "head_depth": ["head_diameter"]}
    return {"description": about, **_record(needed, more), "dependentRequired": both}


def _constraint() -> dict[str, Any]:
    feature = {"$ref": "#/$defs/feature"}
    of = {"type": "array", "items": feature, "minItems": 1, "maxItems": MAX_PRIMITIVES}
    about = "A relation among features of primitives, counted from 0 in the order of the document: '3.r', '0.z', '0.+z', '4', 'world.z'."
    return {
        "description": about,
        **_record({"kind": {"enum": list(RULES)}, "of": of}, {"about": feature, "value": {"type": "number"}, "name": _NAME}),
    }


def _operation() -> dict[str, Any]:
    parts = {"type": "array", "items": {"$ref": "#/$defs/node"}, "minItems": 2, "maxItems": MAX_PRIMITIVES}
    about = "Folded from the left; a difference keeps the first part and cuts the others. A repeat stands for its copies."
    return {"description": about, **_record({"op": {"enum": list(OPS)}, "parts": parts})}


def _repeat_name(kind: str) -> str:
    return f"{kind}_repeat"


def _repeat(kind: str) -> dict[str, Any]:
    needed = {"repeat": {"const": kind}, **{key: _REPEAT_FIELD[key] for key in REPEAT_FIELDS[kind]}, "part": {"$ref": "#/$defs/node"}}
    return {
        "description": f"The union of {REPEATS[kind]}; or what they have in common.",
        **_record(needed, {"join": {"enum": list(JOINS)}}),
    }


def _primitive(kind: str) -> dict[str, Any]:
    about = "Centred in its local frame with its axis along z; world = R @ local + center."
    size = _record({name: _size(kind, name) for name in SIZE_NAMES[kind]})
    needed = {"kind": {"const": kind}, "size": size, **({"outline": _OUTLINE} if kind in OUTLINED else {})}
    return {"description": about, **_record(needed, {"center": _VECTOR, "rotation": _VECTOR})}


def _size(kind: str, name: str) -> dict[str, Any]:
    bound = "minimum" if kind == "cone" and name != "h" else "exclusiveMinimum"
    return {"type": "number", bound: 0}


def _record(needed: dict[str, Any], optional: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"type": "object", "properties": {**needed, **(optional or {})}, "required": list(needed), "additionalProperties": False}


if __name__ == "__main__":
    PUBLISHED.write_text(schema_text(), encoding="utf-8")
