"""Flat OpenSCAD text: parameters, then one line per primitive, n-ary operations, numbers as a person would write them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from imdim.export.expressions import Expression, write_expression
from imdim.export.numbers import Rounding
from imdim.export.parameters import Parameters
from imdim.geometry.solid import SEGMENTS
from imdim.program.nary import fold_nary
from imdim.program.tree import OPS, Op, Primitive, Program

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"cube([{x}, {y}, {z}], center = true)",
    "sphere": lambda r: f"sphere(r = {r})",
    "cylinder": lambda r, h: f"cylinder(h = {h}, r = {r}, center = true)",
    "cone": lambda bottom, top, h: f"cylinder(h = {h}, r1 = {bottom}, r2 = {top}, center = true)",
    "torus": lambda major, minor: f"rotate_extrude() translate([{major}, 0, 0]) circle(r = {minor})",
    "ellipsoid": lambda x, y, z: f"scale([{x}, {y}, {z}]) sphere(r = 1)",
}


def to_openscad(program: Program, segments: int = SEGMENTS, parameters: Parameters | None = None) -> str:
    """OpenSCAD text of `program` in its own units, with `$fn` at `segments`, and numbers that follow `parameters` if given.

    Lengths keep about nine significant digits of the model's size, angles nine decimals. Cutters are written as they are: see `overshoot`.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program)

    def line(number: int, leaf: Primitive) -> list[str]:
        return [primitive_text(leaf, rounding, named.sizes[number], named.centers[number]) + ";"]

    lines = fold_nary(program, line, {op: _block(op) for op in OPS})
    head = [*named.lines(rounding.size, ";"), ""] if named.values else []
    return "\n".join([f"$fn = {segments};", "", *head, *lines, ""])


def primitive_text(leaf: Primitive, rounding: Rounding, sizes: Sequence[Expression], center: Sequence[Expression]) -> str:
    """``translate(..) rotate(..) shape(..)`` without the semicolon; the identity parts are left out."""
    place = _step("translate", [write_expression(c, rounding.length) for c in center])
    place += _step("rotate", [rounding.angle(a) for a in leaf.rotation])
    # a bare number is a size, which never vanishes; the constant of a sum may
    texts = [write_expression(s, rounding.length if s.terms else rounding.size) for s in sizes]
    return place + _SHAPE[leaf.kind](*texts)


def _step(name: str, numbers: list[str]) -> str:
    return "" if all(number == "0" for number in numbers) else f"{name}([{', '.join(numbers)}]) "


def _block(op: Op) -> Callable[[list[list[str]]], list[str]]:
    def lines(parts: list[list[str]]) -> list[str]:
        return [f"{op}() {{", *("  " + line for part in parts for line in part), "}"]

    return lines
