"""µcad 0.5 text: parameters first, then one expression with one line per primitive; lengths in mm.

Written with these parts of the language alone (µcad language book; standard library, `geo3d` and `ops`): values at the top of a source
file, sums and multiples of lengths, `Cube`, `Sphere`, `Cylinder` and `Torus`, all centred with their axis along z, `scale`, `rotate` about
one axis at a time, since the order of its three-angle form is not documented, `translate`, and `|`, `-`, `&` between models.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from imdim.export.expressions import Expression, write_expression
from imdim.export.numbers import Rounding, to_fixed_point
from imdim.export.parameters import Parameters
from imdim.export.script_loops import chain
from imdim.export.ucad_loops import SIGN, UcadLoops
from imdim.program.nary import fold_nary
from imdim.program.repeats import Folded
from imdim.program.tree import Primitive, Program

_HEAD = """// µcad 0.5
// A CSG program; `microcad export program.ucad` writes a mesh of it.

use std::geo3d::*;
use std::ops::*;

"""


def to_ucad(program: Program, parameters: Parameters | None = None, folded: Folded | None = None) -> str:
    """µcad text of `program`, whose units are taken for mm; numbers follow `parameters` if given.

    `folded`, which `program` is the expansion of, gives it repeats.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)

    def line(number: int, leaf: Primitive) -> list[str]:
        return [_primitive(leaf, rounding, named.sizes[number], named.centers[number])]

    writer = UcadLoops(rounding, named, line)
    lines = fold_nary(program, line, {op: chain(sign) for op, sign in SIGN.items()}) if folded is None else writer.lines(folded, 0)
    names = [*named.lines(lambda value: to_fixed_point(rounding.size(value)), "mm;"), *named.count_lines(";")]
    return _HEAD + "\n".join([*names, *([""] if names else []), *writer.parts, *lines]) + ";\n"


def _primitive(leaf: Primitive, rounding: Rounding, sizes: Sequence[Expression], center: Sequence[Expression]) -> str:
    def length(value: float) -> str:
        return to_fixed_point(rounding.length(value))

    def size(value: float) -> str:
        return to_fixed_point(rounding.size(value))

    text = _SHAPE[leaf.kind](leaf, *(write_expression(s, length if s.terms else size, "mm") for s in sizes))
    for axis, degrees in zip("xyz", leaf.rotation, strict=True):
        angle = to_fixed_point(rounding.angle(degrees))
        text += f".rotate({axis} = {angle}°)" if angle != "0" else ""
    place = {axis: write_expression(c, length, "mm") for axis, c in zip("xyz", center, strict=True)}
    moves = ", ".join(f"{axis} = {c}" for axis, c in place.items() if c != "0mm")
    return text + (f".translate({moves})" if moves else "")


def _cone(leaf: Primitive, bottom: str, top: str, h: str) -> str:
    # the library divides by the radius at the bottom
    turned = leaf.size[0] == 0
    wide, narrow = (top, bottom) if turned else (bottom, top)
    text = f"Cylinder(radius_bottom = {wide}, radius_top = {narrow}, height = {h}, offset = -0.5 * ({h}))"
    return text + (".rotate(x = 180°)" if turned else "")


def _ellipsoid(leaf: Primitive, x: str, y: str, z: str) -> str:
    return f"Sphere(radius = {x}).scale(x = 1.0, y = ({y}) / ({x}), z = ({z}) / ({x}))"


_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda _, x, y, z: f"Cube(size_x = {x}, size_y = {y}, size_z = {z})",
    "sphere": lambda _, r: f"Sphere(radius = {r})",
    "cylinder": lambda _, r, h: f"Cylinder(radius = {r}, height = {h})",
    "cone": _cone,
    "torus": lambda _, major, minor: f"Torus(major_radius = {major}, minor_radius = {minor})",
    "ellipsoid": _ellipsoid,
}
