"""The nodes of a program document: primitives, n-ary operations, and repeats, which stand for all their copies.

A plain program is written from its tree, one with repeats from its folded view; both are read as folded ones.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, cast

from imdim.program import fields
from imdim.program.ellipse import Ellipse
from imdim.program.outline import MOST_CURVES, Loop, Outline, Vertex, check_crossings, ellipse
from imdim.program.repeats import JOINS, REPEATS, Folded, Group, Repeat, size
from imdim.program.tree import KINDS, OPS, OUTLINED, SIZE_NAMES, Op, Primitive, Program, Vec3, fold

MAX_DEPTH = 200  # operations and repeats inside each other
MAX_PRIMITIVES = 10_000  # all copies counted

Counted = tuple[int, int, dict[str, Any]]  # primitives, depth in operations and repeats, node

# --- writing ---------------------------------------------------------------------------------------------------------


def program_node(program: Program) -> Counted:
    """The node of a plain program."""
    return fold(program, lambda _, p: (1, 0, _leaf(p)), {op: _joiner(op) for op in OPS})


def encode_folded(folded: Folded) -> Counted:
    """The node of a program with repeats."""
    if isinstance(folded, Primitive):
        return 1, 0, _leaf(folded)
    if isinstance(folded, Repeat):
        _, depth, node = encode_folded(folded.part)
        join = {} if folded.join == "union" else {"join": folded.join}
        return size(folded), depth + 1, {"repeat": folded.kind, **_WRITE[folded.kind](folded), **join, "part": node}
    parts = [encode_folded(part) for part in folded.parts]
    return sum(p[0] for p in parts), 1 + max(p[1] for p in parts), {"op": folded.op, "parts": [p[2] for p in parts]}


def text_lines(node: dict[str, Any], indent: str) -> Iterator[str]:
    """A primitive on one line; an operation as its head, its parts indented, and its end; a repeat before its part."""
    if "kind" in node:
        yield json.dumps(node, allow_nan=False)
        return
    inner = "parts" if "op" in node else "part"
    head = ", ".join(f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in node.items() if key != inner)
    if "repeat" in node:
        lines = list(text_lines(node["part"], indent))
        lines[0] = f'{{{head}, "part": {lines[0]}'
        lines[-1] += "}"
        yield from lines
        return
    yield f'{{{head}, "parts": ['
    last = len(node["parts"]) - 1
    for i, part in enumerate(node["parts"]):
        lines = list(text_lines(part, indent + "  "))
        lines[0] = indent + "  " + lines[0]
        lines[-1] += "," if i < last else ""
        yield from lines
    yield indent + "]}"


def _leaf(p: Primitive) -> dict[str, Any]:
    sizes = {name: float(value) for name, value in zip(SIZE_NAMES[p.kind], p.size, strict=True)}
    drawn = {} if p.outline is None else {"outline": [_loop(loop) for loop in p.outline.loops]}
    return {"kind": p.kind, "size": sizes, **drawn, "center": [float(v) for v in p.center], "rotation": [float(v) for v in p.rotation]}


def _loop(loop: Loop) -> list[list[float]] | dict[str, Any]:
    if isinstance(loop, Ellipse):
        return {"rx": float(loop.rx), "ry": float(loop.ry), "center": [float(loop.x), float(loop.y)], "angle": float(loop.angle)}
    return [_vertex(vertex) for vertex in loop]


def _vertex(vertex: Vertex) -> list[float]:
    """A vertex; one from which a line runs needs no bulge."""
    return [float(v) for v in (vertex if vertex[2] else vertex[:2])]


def _joiner(op: Op) -> Any:
    def join(left: Counted, right: Counted) -> Counted:
        depth = max(left[1] + (left[2].get("op") != op), right[1] + (right[2].get("op") != op or op == "difference"))
        node = left[2] if left[2].get("op") == op else {"op": op, "parts": [left[2]]}
        same = op != "difference" and right[2].get("op") == op
        node["parts"] += right[2]["parts"] if same else [right[2]]
        return left[0] + right[0], depth, node

    return join


def _floats(v: Vec3) -> list[float]:
    return [float(c) for c in v]


_WRITE: Mapping[str, Callable[[Repeat], dict[str, Any]]] = {
    "linear": lambda r: {"count": r.counts[0], "step": _floats(r.steps[0])},
    "grid": lambda r: {"counts": list(r.counts), "steps": [_floats(s) for s in r.steps]},
    "circular": lambda r: {"count": r.counts[0], "angle": float(r.angle), "point": _floats(r.point), "axis": _floats(r.axis)},
    "mirror": lambda r: {"point": _floats(r.point), "normal": _floats(r.axis)},
}

# --- reading ---------------------------------------------------------------------------------------------------------


def read_node(node: object, path: str) -> Folded:
    """The folded program of a node; raises a one-line ValueError that names the path and the number or word at fault."""
    return _read(node, path, 0, [0], 1)


def _read(node: object, path: str, depth: int, count: list[int], times: int) -> Folded:
    """`count` holds the primitives so far; what is read here occurs `times`."""
    if isinstance(node, dict) and ("op" in node or "repeat" in node):
        if depth >= MAX_DEPTH:
            # the path itself would be the longest part of the line
            raise ValueError(f"{fields.shorten(path)}: more than {MAX_DEPTH} operations inside each other")
        read = _read_operation if "op" in node else _read_repeat
        return read(node, path, depth + 1, count, times)
    count[0] += times
    if count[0] > MAX_PRIMITIVES:
        raise ValueError(f"{fields.shorten(path)}: more than {MAX_PRIMITIVES} primitives")
    return _read_primitive(node, path)


def _read_operation(node: object, path: str, depth: int, count: list[int], times: int) -> Folded:
    given = fields.record(node, path, ("op", "parts"))
    op = cast(Op, fields.choice(given["op"], f"{path}.op", OPS))
    parts = given["parts"]
    if not isinstance(parts, list) or len(parts) < 2:
        got = f"{len(parts)} of them" if isinstance(parts, list) else fields.show(parts)
        raise ValueError(f"{fields.shorten(path)}.parts: a {op} needs a list of 2 or more parts, got {got}")
    return Group(op, tuple(_read(part, f"{path}.parts[{i}]", depth, count, times) for i, part in enumerate(parts)))


def _read_repeat(node: object, path: str, depth: int, count: list[int], times: int) -> Folded:
    assert isinstance(node, dict)
    kind = fields.choice(node["repeat"], f"{path}.repeat", tuple(REPEATS))
    given = fields.record(node, path, ("repeat", *REPEAT_FIELDS[kind], "part"), ("join",))
    join = cast(Op, fields.choice(given.get("join", "union"), f"{path}.join", JOINS))
    read = {key: _READ[key](given[key], f"{fields.shorten(path)}.{key}") for key in REPEAT_FIELDS[kind]}
    counts = read.get("counts") or (read.get("count", 2),)
    steps = read.get("steps") or ((read["step"],) if "step" in read else ())
    axis = read.get("axis") or read.get("normal") or (0.0, 0.0, 1.0)
    point = read.get("point") or (0.0, 0.0, 0.0)
    for n in counts:
        times *= max(n, 1)
    if times > MAX_PRIMITIVES:
        raise ValueError(f"{fields.shorten(path)}: more than {MAX_PRIMITIVES} primitives")
    part = _read(given["part"], f"{path}.part", depth, count, times)
    try:
        return Repeat(kind, part, counts, steps, point, axis, read.get("angle", 0.0), join)
    except ValueError as error:
        raise ValueError(f"{fields.shorten(path)}: {error}") from None


def _read_count(value: object, path: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 2 <= value <= MAX_PRIMITIVES:
        raise ValueError(f"{path}: expected a whole number from 2 to {MAX_PRIMITIVES}, got {fields.show(value)}")
    return value


def _read_pair(read: Callable[[object, str], Any]) -> Callable[[object, str], tuple[Any, ...]]:
    def pair(value: object, path: str) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{path}: expected a list of 2, got {fields.show(value)}")
        return tuple(read(entry, f"{path}[{i}]") for i, entry in enumerate(value))

    return pair


REPEAT_FIELDS: Mapping[str, tuple[str, ...]] = {
    "linear": ("count", "step"),
    "grid": ("counts", "steps"),
    "circular": ("count", "angle", "point", "axis"),
    "mirror": ("point", "normal"),
}
_READ: Mapping[str, Callable[[object, str], Any]] = {
    "count": _read_count,
    "counts": _read_pair(_read_count),
    "step": fields.vector,
    "steps": _read_pair(fields.vector),
    "angle": fields.number,
    "point": fields.vector,
    "axis": fields.vector,
    "normal": fields.vector,
}


def _read_primitive(node: object, path: str) -> Primitive:
    path = fields.shorten(path)
    placed = ("center", "rotation")
    kind = fields.choice(fields.record(node, path, ("kind", "size"), (*placed, "outline"))["kind"], f"{path}.kind", KINDS)
    drawn = ("outline",) if kind in OUTLINED else ()
    given = fields.record(node, path, ("kind", "size", *drawn), placed)
    names = SIZE_NAMES[kind]
    sizes = fields.record(given["size"], f"{path}.size", names)
    numbers = tuple(fields.number(sizes[name], f"{path}.size.{name}") for name in names)
    center, rotation = (fields.vector(given.get(key, [0, 0, 0]), f"{path}.{key}") for key in ("center", "rotation"))
    outline = _read_outline(given["outline"], f"{path}.outline") if drawn else None
    try:
        return Primitive(kind, numbers, center, rotation, outline)
    except ValueError as error:
        raise ValueError(f"{path}.size: {error}") from None


def _read_outline(value: object, path: str) -> Outline:
    """Loops of vertices [x, y] or [x, y, bulge], and ellipses; those that touch or cross themselves or each other are refused."""
    loops = _read_list(value, path, "loops")
    if (total := sum(len(loop) if isinstance(loop, list) else 1 for loop in loops)) > MOST_CURVES:
        raise ValueError(f"{path}: at most {MOST_CURVES} curves, got {total}")
    read = tuple(_read_loop(loop, f"{path}[{i}]") for i, loop in enumerate(loops))
    try:
        outline = Outline(read)
        _check_once(outline)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return outline


# delivery reads one document eight times, and half of each of a long outline is this
_check_once = lru_cache(256)(check_crossings)


def _read_loop(value: object, path: str) -> Loop:
    if not isinstance(value, dict):
        return tuple(_read_vertex(v, f"{path}[{k}]") for k, v in enumerate(_read_list(value, path, "vertices")))
    given = fields.record(value, path, ("rx", "ry"), ("center", "angle"))
    rx, ry, angle = (fields.number(given.get(key, 0.0), f"{path}.{key}") for key in ("rx", "ry", "angle"))
    x, y = _read_pair(fields.number)(given.get("center", [0.0, 0.0]), f"{path}.center")
    return ellipse(rx, ry, x, y, angle)


def _read_list(value: object, path: str, what: str) -> list[object]:
    if not isinstance(value, list):
        raise ValueError(f"{path}: expected a list of {what}, got {fields.show(value)}")
    return value


def _read_vertex(value: object, path: str) -> Vertex:
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise ValueError(f"{path}: expected [x, y] or [x, y, bulge], got {fields.show(value)}")
    x, y, *bulge = (fields.number(v, f"{path}[{i}]") for i, v in enumerate(value))
    return x, y, bulge[0] if bulge else 0.0
