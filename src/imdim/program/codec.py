"""Versioned JSON for programs: readable, exact (numbers round-trip bit for bit), the same bytes for the same program.

In memory a tree is binary; on paper operations are n-ary. Writing flattens nested unions, nested intersections and the
left spine of differences (``(a - b) - c`` is ``[a, b, c]``); reading folds the parts from the left. Re-reading gives the
same solid with the same order of primitives, and writing that again the same bytes. Constraints (`constraints.py`) count the
primitives in that order. A document has the lowest version that can say it. `schema.py` publishes the JSON Schema.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, cast

from imdim.program.constraints import RULES, Constraint, ConstraintError, Ref, check_all, read_ref
from imdim.program.tree import KINDS, OPS, SIZE_NAMES, Op, Primitive, Program, Vec3, combine_all, fold, leaves

FORMAT = "imdim-csg"
VERSION, CONSTRAINED = 1, 2  # without and with constraints
MAX_DEPTH = 200  # operations inside each other
MAX_PRIMITIVES = 10_000
MAX_CONSTRAINTS = 10_000
MAX_CHARACTERS = 8 * 1024 * 1024
UNITS = ("unspecified", "micron", "millimeter", "centimeter", "meter", "inch", "foot")
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


def to_json(program: Program, meta: Meta | None = None, constraints: Sequence[Constraint] = ()) -> dict[str, Any]:
    """The document as plain dicts, lists, strings and numbers. Raises ValueError beyond MAX_DEPTH or MAX_PRIMITIVES.

    Raises ConstraintError, which names it, for a constraint that is ill-formed or contradicts another.
    """
    meta = meta or Meta()
    count, depth, node = fold(program, lambda _, p: (1, 0, _leaf(p)), {op: _joiner(op) for op in OPS})
    if count > MAX_PRIMITIVES or depth > MAX_DEPTH:
        raise ValueError(f"a document holds {MAX_PRIMITIVES} primitives and {MAX_DEPTH} nested operations at most, got {count} and {depth}")
    frame = {**CONVENTION, "center": [float(v) for v in meta.center], "scale": float(meta.scale)}
    document = {"format": FORMAT, "version": VERSION, "units": meta.units, "frame": frame, "program": node}
    if not constraints:
        return document
    check_all(constraints, list(leaves(program)))
    return {**document, "version": CONSTRAINED, "constraints": [_constraint(c) for c in constraints]}


def from_json(document: object) -> Program:
    """The program of a document. Raises a one-line ValueError that names the JSON path and the number or word at fault."""
    return _read_document(document)[0]


def meta_of(document: object) -> Meta:
    """Units and frame of a document; raises like `from_json`."""
    return _read_document(document)[1]


def constraints_of(document: object) -> tuple[Constraint, ...]:
    """The constraints of a document, none where it has none; raises like `from_json`, ConstraintError for those at fault."""
    return _read_document(document)[2]


def dumps(program: Program, meta: Meta | None = None, constraints: Sequence[Constraint] = ()) -> str:
    """The document as text, one primitive and one constraint per line; deterministic. Raises like `to_json`."""
    document = to_json(program, meta, constraints)
    entries = [f"  {_text(key)}: {_text(document[key])}" for key in ("format", "version", "units", "frame")]
    entries.append('  "program": ' + "\n".join(_lines(document["program"], "  ")))
    if constraints:
        entries.append('  "constraints": [\n' + ",\n".join(f"    {_text(c)}" for c in document["constraints"]) + "\n  ]")
    return "{\n" + ",\n".join(entries) + "\n}\n"


def loads(text: str | bytes) -> Program:
    """The program of a text (UTF-8 if bytes); raises like `from_json`."""
    return from_json(parse(text))


def parse(text: str | bytes) -> object:
    """Strict JSON: no NaN, no infinity, no repeated keys, at most MAX_CHARACTERS; a one-line ValueError otherwise."""
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"$: {len(text)} characters; at most {MAX_CHARACTERS}")
    try:
        return json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError(f"$: nested too deep; at most {MAX_DEPTH} operations inside each other") from None
    except ValueError as error:
        message = str(error)
        raise ValueError(message if message.startswith("$") else f"$: not JSON: {message}") from None


# --- writing ---------------------------------------------------------------------------------------------------------

_Counted = tuple[int, int, dict[str, Any]]  # primitives, depth in operations, node


def _leaf(p: Primitive) -> dict[str, Any]:
    size = {name: float(value) for name, value in zip(SIZE_NAMES[p.kind], p.size, strict=True)}
    return {"kind": p.kind, "size": size, "center": [float(v) for v in p.center], "rotation": [float(v) for v in p.rotation]}


def _joiner(op: Op) -> Any:
    def join(left: _Counted, right: _Counted) -> _Counted:
        depth = max(left[1] + (left[2].get("op") != op), right[1] + (right[2].get("op") != op or op == "difference"))
        node = left[2] if left[2].get("op") == op else {"op": op, "parts": [left[2]]}
        same = op != "difference" and right[2].get("op") == op
        node["parts"] += right[2]["parts"] if same else [right[2]]
        return left[0] + right[0], depth, node

    return join


def _constraint(c: Constraint) -> dict[str, Any]:
    out: dict[str, Any] = {"kind": c.kind, "of": [str(ref) for ref in c.of]}
    if c.about is not None:
        out["about"] = str(c.about)
    if RULES[c.kind].has_value:
        out["value"] = float(c.value)
    return out | ({"name": c.name} if c.name else {})


def _text(value: object) -> str:
    return json.dumps(value, allow_nan=False)


def _lines(node: dict[str, Any], indent: str) -> Iterator[str]:
    """A primitive on one line; an operation as its head, its parts indented, and its end."""
    if "kind" in node:
        yield _text(node)
        return
    yield f'{{"op": {_text(node["op"])}, "parts": ['
    last = len(node["parts"]) - 1
    for i, part in enumerate(node["parts"]):
        lines = list(_lines(part, indent + "  "))
        lines[0] = indent + "  " + lines[0]
        lines[-1] += "," if i < last else ""
        yield from lines
    yield indent + "]}"


# --- reading ---------------------------------------------------------------------------------------------------------


def _read_document(document: object) -> tuple[Program, Meta, tuple[Constraint, ...]]:
    top = _object(document, "$", ("format", "version", "program"), ("units", "frame", "constraints"))
    if top["format"] != FORMAT:
        raise ValueError(f"$.format: expected {FORMAT!r}, got {_show(top['format'])}")
    if type(top["version"]) is not int or top["version"] not in (VERSION, CONSTRAINED):
        raise ValueError(f"$.version: this reader knows versions {VERSION} and {CONSTRAINED}, got {_show(top['version'])}")
    if top["version"] == VERSION and "constraints" in top:
        raise ValueError(f"$.constraints: version {VERSION} has none, they came with version {CONSTRAINED}")
    program = _read_node(top["program"], "$.program", 0, [0])
    return program, _read_meta(top), _read_constraints(top.get("constraints", []), program)


def _read_constraints(entries: object, program: Program) -> tuple[Constraint, ...]:
    if not isinstance(entries, list) or len(entries) > MAX_CONSTRAINTS:
        raise ConstraintError(f"$.constraints: expected a list of at most {MAX_CONSTRAINTS}, got {_show(entries)}")
    constraints = tuple(_read_constraint(entry, f"$.constraints[{i}]") for i, entry in enumerate(entries))
    try:
        check_all(constraints, list(leaves(program)))
    except ConstraintError as error:
        raise ConstraintError(f"$.{error}") from None
    return constraints


def _read_constraint(entry: object, path: str) -> Constraint:
    fields = _object(entry, path, ("kind", "of"), ("about", "value", "name"))
    kind = _choice(fields["kind"], f"{path}.kind", tuple(RULES))
    if not isinstance(fields["of"], list):
        raise ConstraintError(f"{path}.of: expected a list of features, got {_show(fields['of'])}")
    of = tuple(_read_feature(ref, f"{path}.of[{i}]") for i, ref in enumerate(fields["of"]))
    about = _read_feature(fields["about"], f"{path}.about") if "about" in fields else None
    name = fields.get("name", "")
    if not isinstance(name, str) or not (name == "" or (name.isascii() and name.isidentifier() and len(name) <= 100)):
        raise ConstraintError(f"{path}.name: expected a name of letters, digits and _, got {_show(name)}")
    return Constraint(kind, of, about, _number(fields.get("value", 0), f"{path}.value"), name)


def _read_feature(text: object, path: str) -> Ref:
    try:
        return read_ref(text)
    except ValueError as error:
        raise ConstraintError(f"{path}: {error}, got {_show(text)}") from None


def _read_meta(top: dict[str, Any]) -> Meta:
    frame = _object(top.get("frame", {}), "$.frame", (), (*CONVENTION, "center", "scale"))
    for key, value in CONVENTION.items():
        _choice(frame.get(key, value), f"$.frame.{key}", (value,))
    units = _choice(top.get("units", "unspecified"), "$.units", UNITS)
    center = _vector(frame.get("center", [0, 0, 0]), "$.frame.center")
    scale = _number(frame.get("scale", 1), "$.frame.scale")
    if scale <= 0:
        raise ValueError(f"$.frame.scale: needs a positive number, got {scale}")
    return Meta(units, center, scale)


def _read_node(node: object, path: str, depth: int, count: list[int]) -> Program:
    if isinstance(node, dict) and "op" in node:
        return _read_operation(node, path, depth + 1, count)
    count[0] += 1
    if count[0] > MAX_PRIMITIVES:
        raise ValueError(f"{path}: more than {MAX_PRIMITIVES} primitives")
    return _read_primitive(node, path)


def _read_operation(node: object, path: str, depth: int, count: list[int]) -> Program:
    if depth > MAX_DEPTH:
        # the path itself would be the longest part of the line
        raise ValueError(f"{_shorten(path)}: more than {MAX_DEPTH} operations inside each other")
    fields = _object(node, path, ("op", "parts"))
    op = cast(Op, _choice(fields["op"], f"{path}.op", OPS))
    parts = fields["parts"]
    if not isinstance(parts, list) or len(parts) < 2:
        got = f"{len(parts)} of them" if isinstance(parts, list) else _show(parts)
        raise ValueError(f"{_shorten(path)}.parts: a {op} needs a list of 2 or more parts, got {got}")
    return combine_all(op, [_read_node(part, f"{path}.parts[{i}]", depth, count) for i, part in enumerate(parts)])


def _read_primitive(node: object, path: str) -> Primitive:
    path = _shorten(path)
    fields = _object(node, path, ("kind", "size"), ("center", "rotation"))
    kind = _choice(fields["kind"], f"{path}.kind", KINDS)
    names = SIZE_NAMES[kind]
    sizes = _object(fields["size"], f"{path}.size", names)
    size = tuple(_number(sizes[name], f"{path}.size.{name}") for name in names)
    center, rotation = (_vector(fields.get(key, [0, 0, 0]), f"{path}.{key}") for key in ("center", "rotation"))
    try:
        return Primitive(kind, size, center, rotation)
    except ValueError as error:
        raise ValueError(f"{path}.size: {error}") from None


def _object(value: object, path: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{_shorten(path)}: expected an object, got {_show(value)}")
    for key in needed:
        if key not in value:
            raise ValueError(f"{_shorten(path)}: {key!r} is missing")
    for key in value:
        if key not in needed and key not in optional:
            near = difflib.get_close_matches(str(key)[:40], [*needed, *optional], 1)
            raise ValueError(f"{_shorten(path)}: unknown key {_show(key)}" + (f"; did you mean {near[0]!r}?" if near else ""))
    return value


def _choice(value: object, path: str, known: tuple[str, ...]) -> str:
    if not isinstance(value, str) or value not in known:
        raise ValueError(f"{_shorten(path)}: expected {' or '.join(known)}, got {_show(value)}")
    return value


def _vector(value: object, path: str) -> Vec3:
    if not isinstance(value, list) or len(value) != 3:
        got = f"{len(value)} entries" if isinstance(value, list) else _show(value)
        raise ValueError(f"{path}: expected a list of 3 numbers, got {got}")
    x, y, z = (_number(v, f"{path}[{i}]") for i, v in enumerate(value))
    return x, y, z


def _number(value: object, path: str) -> float:
    # bool is an int to Python, not to JSON
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{path}: expected a number, got {_show(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{path}: expected a finite number, got {_show(value)}")
    return number


def _show(value: object) -> str:
    """A short one-line picture of hostile input."""
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) > 10**20:
        return f"an integer of {value.bit_length()} bits"
    text = repr(value[:40] if isinstance(value, str) else value)
    return text if len(text) <= 60 else text[:60] + "..."


def _shorten(path: str) -> str:
    return path if len(path) <= 200 else f"{path[:100]}...{path[-60:]}"


def _unique_keys(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"$: the key {_show(key)} occurs twice in one object")
        out[key] = value
    return out


def _refuse_constant(name: str) -> float:
    raise ValueError(f"$: {name} is not a number of JSON")
