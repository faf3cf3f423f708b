"""Versioned JSON for programs: readable, exact (numbers round-trip bit for bit), the same bytes for the same program.

In memory a tree is binary; on paper operations are n-ary. Writing flattens nested unions, nested intersections and the
left spine of differences (``(a - b) - c`` is ``[a, b, c]``); reading folds the parts from the left. Re-reading gives the
same solid with the same order of primitives, and writing that again the same bytes. `schema.py` publishes the JSON Schema.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, cast

from imdim.program.tree import KINDS, OPS, SIZE_NAMES, Op, Primitive, Program, Vec3, combine_all, fold

FORMAT = "imdim-csg"
VERSION = 1
MAX_DEPTH = 200  # operations inside each other
MAX_PRIMITIVES = 10_000
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


def to_json(program: Program, meta: Meta | None = None) -> dict[str, Any]:
    """The document as plain dicts, lists, strings and numbers. Raises ValueError beyond MAX_DEPTH or MAX_PRIMITIVES."""
    meta = meta or Meta()
    count, depth, node = fold(program, lambda _, p: (1, 0, _leaf(p)), {op: _joiner(op) for op in OPS})
    if count > MAX_PRIMITIVES or depth > MAX_DEPTH:
        raise ValueError(f"a document holds {MAX_PRIMITIVES} primitives and {MAX_DEPTH} nested operations at most, got {count} and {depth}")
    frame = {**CONVENTION, "center": [float(v) for v in meta.center], "scale": float(meta.scale)}
    return {"format": FORMAT, "version": VERSION, "units": meta.units, "frame": frame, "program": node}


def from_json(document: object) -> Program:
    """The program of a document. Raises a one-line ValueError that names the JSON path and the number or word at fault."""
    return _read_document(document)[0]


def meta_of(document: object) -> Meta:
    """Units and frame of a document; raises like `from_json`."""
    return _read_document(document)[1]


def dumps(program: Program, meta: Meta | None = None) -> str:
    """The document as text, one primitive per line; deterministic. Raises like `to_json`."""
    document = to_json(program, meta)
    head = [f"  {_text(key)}: {_text(document[key])}" for key in ("format", "version", "units", "frame")]
    return "{\n" + ",\n".join([*head, '  "program": ' + "\n".join(_lines(document["program"], "  "))]) + "\n}\n"


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


def _read_document(document: object) -> tuple[Program, Meta]:
    top = _object(document, "$", ("format", "version", "program"), ("units", "frame"))
    if top["format"] != FORMAT:
        raise ValueError(f"$.format: expected {FORMAT!r}, got {_show(top['format'])}")
    if type(top["version"]) is not int or top["version"] != VERSION:
        raise ValueError(f"$.version: this reader knows version {VERSION}, got {_show(top['version'])}")
    return _read_node(top["program"], "$.program", 0, [0]), _read_meta(top)


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
