"""Read back the flat OpenSCAD that `openscad.py` writes, so that the delivered file itself can be measured.

Parameters, ``name = sum;``, then one statement per primitive: ``translate([..]) rotate([..]) SHAPE``, any of the two optional, inside
nested union, difference and intersection blocks, and blocks that turn what is in them. Numbers may be sums and products of parameters. The
definition of outlines is skipped where it is ours.
Anything else raises ValueError: this is a check of our own files, not an OpenSCAD interpreter.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Container, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from imdim.export.bends import SIDES, Arc, polygon_across_flats, regular_polygon, to_loop
from imdim.export.openscad import DRAFTED, ELLIPSE, OUTLINE, SWITCH, TURN, WHERE_DRAWN
from imdim.geometry.rotations import matrix_from_euler
from imdim.program import fields
from imdim.program.motions import Motion, move_program
from imdim.program.outline import MOST_CURVES, Loop, Outline, circle, ellipse
from imdim.program.tree import OPS, Op, Primitive, Program, Vec3, combine_all
from imdim.target.target import as_matrix

_ASSIGNMENT = re.compile(r"([A-Za-z_]\w*) = (.+);")
_CALLS = re.compile(r"(?:(translate)(\(\[[^\]]*\]\)) )?(?:(rotate)(\(\[[^\]]*\]\)) )?(.+);")
_TORUS = re.compile(r"rotate_extrude\(\) translate(\(\[[^\]]*\]\)) circle(\(.*\))")
_ELLIPSOID = re.compile(r"scale(\(\[[^\]]*\]\)) sphere(\(.*\))")
_DRAFTED = re.compile(r"drafted\(.*\)")
_SWEPT = re.compile(r"(linear_extrude|rotate_extrude)(\([^()]*\)) outline\((\[.*\])\)")

_OPERATORS: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}

_POLYGONS = {"ngon": regular_polygon, "across_flats": polygon_across_flats}
_NAME = re.compile(r"[A-Za-z_]\w*")
_TURNED = re.compile(rf"{TURN}(\(\[[^\]]*\]\)) \{{")
_SECTION = re.compile(r"^/\* \[[^\]]*\] \*/$")  # of OpenSCAD's Customizer
_SWITCHES = tuple(SWITCH[drawn].partition("//")[0].strip() for drawn in (True, False))

Values = dict[str, float]


def read_openscad(text: str, given: Mapping[str, float] | None = None, blended: bool = False) -> Program:
    """The program in a text that `to_openscad` wrote, with parameters `given` in place of the text's, as OpenSCAD's -D has it.

    It is that of the sharp part; if `blended`, with the text's chamfers and fillets, as primitives.
    Raises ValueError with the line's number for anything else, and for a parameter that the text does not have.
    """
    given = given or {}
    open_blocks: list[tuple[Op | Vec3 | None, list[Program]]] = [("union", [])]
    values: Values = {}
    for number, line, assigned, begun, turned in _read_lines(text):
        if line == "}" and len(open_blocks) > 1 and open_blocks[-1][1]:
            kind, parts = open_blocks.pop()
            open_blocks[-1][1].extend(_close(kind, parts) if kind is not None else parts if blended else [])
        elif line == f"{WHERE_DRAWN} {{":
            open_blocks.append((None, []))
        elif begun is not None:
            open_blocks.append((begun, []))
        elif turned is not None:
            open_blocks.append((_vector(turned[1], values, number), []))
        elif assigned is not None:
            values[assigned[1]] = given.get(assigned[1], _value(_parse(assigned[2], number), values, number))
        else:
            # of many readings of one text with a name moved, most statements know nothing of it
            named = tuple((name, values[name]) for name in _names_in(line) if name in values)
            open_blocks[-1][1].append(_primitive(line, named, number))
    if len(open_blocks) != 1 or not open_blocks[0][1]:
        raise ValueError(f"OpenSCAD text ends with {len(open_blocks) - 1} open blocks and {len(open_blocks[0][1])} solids")
    unknown = sorted(set(given) - set(values))
    if unknown:
        raise ValueError(f"the text has no parameter {unknown[0]!r}; it has {', '.join(values) or 'none'}")
    return combine_all("union", open_blocks[0][1])


def _close(kind: Op | Vec3, parts: list[Program]) -> list[Program]:
    """What a block of parts says: one operation, or all turned by Euler degrees."""
    if isinstance(kind, str):
        return [combine_all(kind, parts)]
    turn = Motion(as_matrix(matrix_from_euler(kind)), (0.0, 0.0, 0.0))
    return [move_program(part, turn) for part in parts]


def are_drawn(text: str) -> bool:
    """Whether a text draws its blends unless told otherwise; one that has none would."""
    return _SWITCHES[1] not in text


class _Statement(NamedTuple):
    """A statement, or the begin or end of a block: the number of its first line, and what of the language it may be."""

    number: int
    text: str
    assigned: re.Match[str] | None
    begun: Op | None
    turned: re.Match[str] | None


@lru_cache(4)  # one text is read again and again, each time with another name moved
def _read_lines(text: str) -> tuple[_Statement, ...]:
    # as many lines as before, so that messages count them as the file does
    for ours in (OUTLINE, ELLIPSE, DRAFTED):
        text = text.replace(ours, "\n" * ours.count("\n"), 1)
    lines = [(number, line) for number, line in _statements(text) if line and not line.startswith("$fn = ") and line not in _SWITCHES]
    return tuple(
        _Statement(n, line, _ASSIGNMENT.fullmatch(line), next((op for op in OPS if line == f"{op}() {{"), None), _TURNED.fullmatch(line))
        for n, line in lines
    )


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """The lines without comments, those of one list in one, each with the number of its first."""
    begun, first = "", 1
    for number, raw in enumerate(text.splitlines(), start=1):
        line = _SECTION.sub("", raw).partition("//")[0].strip()
        first, begun = (number, line) if not begun else (first, f"{begun} {line}")
        if begun.count("[") <= begun.count("]"):
            yield first, begun
            begun = ""
    if begun:
        yield first, begun


@lru_cache(4096)
def _names_in(line: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_NAME.findall(line)))


@lru_cache(4096)
def _primitive(line: str, named: tuple[tuple[str, float], ...], number: int) -> Primitive:
    """What a statement says where its names have the values `named`."""
    values = dict(named)
    placed = _CALLS.fullmatch(line)
    if placed is None:
        raise ValueError(f"line {number} is not flat OpenSCAD of ours: {line!r}")
    center, rotation = (_vector(placed[2], values, number), _vector(placed[4], values, number))
    kind, size = _shape(placed[5], values, number)
    loops = _loops(placed[5], values, number)
    try:
        return Primitive(kind, size, center, rotation, Outline(loops) if loops else None)
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


def _shape(text: str, values: Values, number: int) -> tuple[str, tuple[float, ...]]:
    """Kind and size of the last part of a statement."""
    torus, ellipsoid, swept = _TORUS.fullmatch(text), _ELLIPSOID.fullmatch(text), _SWEPT.fullmatch(text)
    if _DRAFTED.fullmatch(text):
        height, draft, _ = _drafted_arguments(text, number)
        return "drafted", (_value(height, values, number), _value(draft, values, number))
    if swept is not None:
        kind, names = _SWEEPS[swept[1]]
        return kind, _arguments(swept[1] + swept[2], names, values, number)[:1]
    if torus is not None:
        return "torus", (_vector(torus[1], values, number)[0], *_arguments(f"f{torus[2]}", ("r",), values, number))
    if ellipsoid is not None and _arguments(f"f{ellipsoid[2]}", ("r",), values, number) == (1.0,):
        return "ellipsoid", _vector(ellipsoid[1], values, number)
    for kind, start, names, order in _PLAIN:
        if text.startswith(start):
            found = _arguments(text, names, values, number, optional=True)
            if found is not None:
                return kind, tuple(found[i] for i in order)
    raise ValueError(f"line {number} is no primitive of ours: {text!r}")


# kind, what its text begins with, names of its arguments ("" for a vector in front), and where its sizes stand among them
_PLAIN: tuple[tuple[str, str, tuple[str, ...], tuple[int, ...]], ...] = (
    ("box", "cube(", ("", "center"), (0, 1, 2)),
    ("sphere", "sphere(", ("r",), (0,)),
    ("cylinder", "cylinder(", ("h", "r", "center"), (1, 0)),
    ("cone", "cylinder(", ("h", "r1", "r2", "center"), (1, 2, 0)),
)


_SWEEPS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "linear_extrude": ("extrude", ("height", "center")),
    "rotate_extrude": ("revolve", ("angle",)),
}


def _drafted_arguments(text: str, number: int) -> list[ast.expr]:
    """Height, draft and areas of an extrusion whose walls lean."""
    call = _parse(text, number)
    if not isinstance(call, ast.Call) or len(call.args) != 3 or call.keywords:
        raise ValueError(f"line {number} is no primitive of ours: {fields.shorten(text)!r}")
    return call.args


def _loops(text: str, values: Values, number: int) -> tuple[Loop, ...]:
    """What the last part of a statement is drawn from, nothing for a simple kind."""
    if _DRAFTED.fullmatch(text):
        areas = _elements(_drafted_arguments(text, number)[2], number, range(1, MOST_CURVES + 1))
        return tuple(_loop(loop, values, number) for area in areas for loop in _elements(area, number, range(1, MOST_CURVES + 1)))
    swept = _SWEPT.fullmatch(text)
    if swept is None:
        return ()
    loops = _elements(_parse(swept[3], number), number, range(1, MOST_CURVES + 1))
    return tuple(_loop(loop, values, number) for loop in loops)


def _loop(node: ast.expr, values: Values, number: int) -> Loop:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        numbers = [_value(entry, values, number) for entry in node.args]
        if node.func.id == "ring" and len(numbers) in (1, 3):
            return circle(*numbers)
        if node.func.id == "ellipse" and 2 <= len(numbers) <= 5:
            return ellipse(*numbers)
        if node.func.id in _POLYGONS and 2 <= len(numbers) <= 5:
            draw = _POLYGONS[node.func.id]
            return _drawn(lambda: draw(*numbers), number)
    vertices = [_vertex(v, values, number) for v in _elements(node, number)]
    return _drawn(lambda: to_loop(vertices), number)


def _drawn(draw: Callable[[], Loop], number: int) -> Loop:
    try:
        return draw()
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


def _vertex(node: ast.AST, values: Values, number: int) -> tuple[float, float, Arc]:
    """A vertex with what it says of the arc from it."""
    x, y, *arc = _elements(node, number, (2, 3))
    return _value(x, values, number), _value(y, values, number), _arc(arc[0], values, number) if arc else 0.0


def _arc(node: ast.expr, values: Values, number: int) -> Arc:
    if isinstance(node, ast.List) and len(node.elts) in (1, 2, 3):
        return tuple(_value(entry, values, number) for entry in node.elts)
    if isinstance(node, ast.Constant) and node.value in SIDES:
        return str(node.value)
    return _value(node, values, number)


def _elements(node: ast.AST, number: int, counts: Container[int] = range(2, MOST_CURVES + 1)) -> list[ast.expr]:
    if not isinstance(node, ast.List) or len(node.elts) not in counts:
        raise ValueError(f"line {number}: {fields.shorten(ast.unparse(node))!r} is no loop or vertex of ours")
    return node.elts


def _arguments(text: str, names: tuple[str, ...], values: Values, number: int, optional: bool = False) -> Any:
    """The numbers of a call with exactly these arguments; `center` has to be true. None if it has others and `optional` is set."""
    call = _parse(text, number)
    if not isinstance(call, ast.Call):
        raise ValueError(f"line {number} is no primitive of ours: {text!r}")
    keywords = {k.arg: k.value for k in call.keywords}
    fits = tuple(keywords) == tuple(n for n in names if n) and len(call.args) == names.count("")
    centre = keywords.pop("center", None)
    if not fits or ("center" in names and not (isinstance(centre, ast.Name) and centre.id == "true")):
        if optional:
            return None
        raise ValueError(f"line {number} is no primitive of ours: {text!r}")
    first = _entries(call.args[0], values, number) if call.args else ()
    return (*first, *(_value(node, values, number) for node in keywords.values()))


def _vector(text: str | None, values: Values, number: int) -> Vec3:
    if text is None:
        return (0.0, 0.0, 0.0)
    x, y, z = _entries(_parse(text, number), values, number)
    return (x, y, z)


def _entries(node: ast.AST, values: Values, number: int) -> tuple[float, ...]:
    if not isinstance(node, ast.List) or len(node.elts) != 3:
        raise ValueError(f"line {number}: expected a list of 3 numbers, got {ast.unparse(node)!r}")
    return tuple(_value(entry, values, number) for entry in node.elts)


def _parse(text: str, number: int) -> ast.expr:
    try:
        return _tree_of(text.strip())
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"line {number} is not flat OpenSCAD of ours: {text!r}") from None


@lru_cache(4096)  # one text is read for many values of its names
def _tree_of(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _value(node: ast.AST, values: Values, number: int) -> float:
    """The number that a sum or product stands for."""
    try:
        return _evaluate(node, values, number)
    except RecursionError:
        raise ValueError(f"line {number} nests too deep") from None


def _evaluate(node: ast.AST, values: Values, number: int) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return _float(node.value, number)
    if isinstance(node, ast.Name) and node.id in values:
        return values[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_evaluate(node.operand, values, number)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        try:
            return _OPERATORS[type(node.op)](_evaluate(node.left, values, number), _evaluate(node.right, values, number))
        except ZeroDivisionError:
            raise ValueError(f"line {number} divides by zero: {ast.unparse(node)!r}") from None
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and (node.func.id, len(node.args)) in _FUNCTIONS:
        return _FUNCTIONS[node.func.id, len(node.args)](*(_evaluate(entry, values, number) for entry in node.args), number)
    raise ValueError(f"line {number}: {ast.unparse(node)!r} is no number of ours")


def _reach(radius: float, off: float, number: int) -> float:
    if abs(off) > radius:
        raise ValueError(f"line {number}: a circle of radius {radius:g} does not meet a line {abs(off):g} from its centre")
    return math.sqrt(radius * radius - off * off)


def _bend(degrees: float, number: int) -> float:
    if not 0 < degrees < 360:
        raise ValueError(f"line {number}: an arc turns by more than 0 and less than 360 degrees, not {degrees:g}")
    return math.tan(math.radians(degrees) / 4)


def _cosine(degrees: float, _number: int) -> float:
    return math.cos(math.radians(degrees))


_FUNCTIONS: Mapping[tuple[str, int], Callable[..., float]] = {("reach", 2): _reach, ("bend", 1): _bend, ("cos", 1): _cosine}


def _float(value: float, number: int) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"line {number}: an integer of {int(value).bit_length()} bits is too large") from None
