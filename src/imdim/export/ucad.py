"""µcad 0.5 text: parameters first, then one expression with one line per primitive; lengths in mm.

Written with these parts of the language alone (µcad language book; standard library, `geo3d` and `ops`): values at the top of a source
file, sums and multiples of lengths, `Cube`, `Sphere`, `Cylinder` and `Torus`, all centred with their axis along z, `scale`, `rotate` about
one axis at a time, since the order of its three-angle form is not documented, `translate`, and `|`, `-`, `&` between models.

Copies are written by argument multiplicity: an argument that is an array makes a copy for each value (language book, "Multiplicity",
"Range Arrays", both ends of which belong to the range, and "Array Operators"); several arrays make every combination, and together make
their union. Mirror images, steps or turns that are not along one axis each, and copies that are intersected have no such form and are
written copy by copy. Outlines cannot be said: of areas the library has circles, rectangles, regular polygons and sectors alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import ClassVar

from imdim.export.chains import Chains
from imdim.export.loops import Loop
from imdim.export.numbers import Expression, Rounding, to_fixed_point, write_expression
from imdim.export.parameters import Parameters
from imdim.program.repeats import Folded, Repeat, expand, repeats
from imdim.program.tree import Op, Primitive, Program, leaves

_HEAD = """// µcad 0.5
// A CSG program; `microcad export program.ucad` writes a mesh of it.

use std::geo3d::*;
use std::ops::*;

"""


def to_ucad(program: Program, parameters: Parameters | None = None, folded: Folded | None = None) -> str:
    """µcad text of `program`, whose units are taken for mm; numbers follow `parameters` if given.

    `folded`, which `program` is the expansion of, gives it repeats. Raises ValueError for a program with outlines.
    """
    if any(leaf.outline for leaf in leaves(program)):
        raise ValueError("µcad has no polygons, so that outlines cannot be written")
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)
    writer = _Ucad(rounding, named)
    lines = writer.flat(program) if folded is None else writer.lines(folded)
    head = named.head(lambda value: to_fixed_point(rounding.size(value)), "mm", ";")
    return _HEAD + "\n".join([*head, *writer.parts, *lines]) + ";\n"


class _Ucad(Chains):
    """Calls behind a model place it."""

    signs: ClassVar[Mapping[Op, str]] = {"union": "|", "difference": "-", "intersection": "&"}
    end = ";"
    mark = "//"

    def _primitive(self, leaf: Primitive, number: int) -> str:
        sizes = (write_expression(s, self._length if s.terms else self._size, "mm") for s in self._named.sizes[number])
        text = _SHAPE[leaf.kind](leaf, *sizes)
        for axis, degrees in zip("xyz", leaf.rotation, strict=True):
            angle = to_fixed_point(self._rounding.angle(degrees))
            text += f".rotate({axis} = {angle}°)" if angle != "0" else ""
        return text + _moved([write_expression(c, self._length, "mm") for c in self._named.centers[number]])

    def _length(self, value: float) -> str:
        return to_fixed_point(self._rounding.length(value))

    def _size(self, value: float) -> str:
        return to_fixed_point(self._rounding.size(value))

    def _repeat(self, repeat: Repeat, first: int) -> list[str]:
        loop = next(self._loops)
        moves = self._moves(repeat, loop)
        if not moves:
            list(islice(self._loops, sum(1 for _ in repeats(repeat.part))))
            return self.flat(expand(repeat), first)
        self._assign(repeat, first, loop.part)
        return [loop.part + moves]

    def _moves(self, repeat: Repeat, loop: Loop) -> str:
        """The calls that make the copies; empty where there are none such."""
        if repeat.join == "intersection":
            return ""
        if repeat.kind in ("linear", "grid"):
            along = [[a for a in range(3) if step[a]] for step in repeat.steps]
            if any(len(a) > 1 for a in along) or len({a[0] for a in along}) < len(along):
                return ""
            moves = {a[0]: _array(n, self._sum(step[a[0]])) for a, n, step in zip(along, loop.counts, loop.steps, strict=True)}
            arguments = ", ".join("xyz"[a] + " = " + move for a, move in sorted(moves.items()))
            return f".translate({arguments})"
        if repeat.kind == "mirror" or max(map(abs, repeat.axis)) < 1:
            return ""
        sign = "" if sum(repeat.axis) * repeat.angle > 0 else "-"
        angle = _array(loop.counts[0], f"{sign}{to_fixed_point(self._rounding.angle(abs(repeat.angle)))}°")
        if repeat.is_full:
            angle = f"[1..{loop.counts[0]}] * {sign}360° / {loop.counts[0]}"
        axis = next(a for a in range(3) if repeat.axis[a])
        there, back = (_moved([sign + self._sum(e) for e in loop.center]) for sign in ("-", ""))
        return there + f".rotate({'xyz'[axis]} = {angle})" + back

    def _sum(self, e: Expression) -> str:
        text = write_expression(e, self._length, "mm")
        return f"({text})" if " " in text else text


def _moved(place: Sequence[str]) -> str:
    """The call that moves by three lengths, "" where all are zero."""
    moves = ", ".join(f"{axis} = {length}" for axis, length in zip("xyz", place, strict=True) if length not in ("0mm", "-0mm"))
    return f".translate({moves})" if moves else ""


def _array(count: str, step: str) -> str:
    """0, 1, .. count - 1 steps; a range needs whole numbers as its ends, which a difference may not be."""
    return f"[1..{count}] * {step} - {step}"


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
