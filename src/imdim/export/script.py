"""A build123d script: the program as Python that a modeller can edit, parameters first, then one line per primitive.

build123d's primitives are centred with their axis along z, as ours are. Rotations are written one axis at a time, since its
three-angle `Rot` turns about the moved axes and OpenSCAD's about the fixed ones. Outlines are faces of true lines and arcs.
What repeats has a name, and its copies are a list.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from imdim.export.chains import Chains
from imdim.export.loops import Loop
from imdim.export.numbers import Expression, Rounding, plain, write_expression, write_moves
from imdim.export.parameters import Parameters
from imdim.program.motions import Motion, move_leaf
from imdim.program.repeats import Folded, Group, Repeat, starts
from imdim.program.tree import Op, Primitive, Program, leaves

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"Box({x}, {y}, {z})",
    "sphere": lambda r: f"Sphere({r})",
    "cylinder": lambda r, h: f"Cylinder({r}, {h})",
    "cone": lambda bottom, top, h: f"Cone({bottom}, {top}, {h})" if bottom != top else f"Cylinder({bottom}, {h})",
    "torus": lambda major, minor: f"Torus({major}, {minor})",
    "ellipsoid": lambda x, y, z: f"scale(Sphere(1), by=({x}, {y}, {z}))",
    "extrude": lambda h, *regions: f"extruded({', '.join([h, *regions])})",
    "revolve": lambda angle, *regions: f"turned({', '.join([angle, *regions])})",
}

_HEAD = '''"""CSG program as a build123d script: pip install build123d, then run this file to write part.step."""

{standard}from build123d import {names}

'''

CURVES = '''def ring(r, x=0, y=0):
    """A circle as a loop of two half arcs."""
    return [[x - r, y, 1], [x + r, y, 1]]


def reach(r, d):
    """How far a circle reaches along a line, d from its centre."""
    return sqrt(r * r - d * d)


def bulge_of(arc, x, y, u, v):
    """The bulge, which may be given by [x, y, way]: the centre, and 1 for counter-clockwise or -1."""
    if not isinstance(arc, list):
        return arc
    a, b, way = arc
    return way * tan(way * (atan2(v - b, u - a) - atan2(y - b, x - a)) % (2 * pi) / 4)


def curves(loop):
    """Start, middle and end of each curve of a closed loop; a line, from a vertex [x, y], has no middle.

    From a vertex [x, y, bulge] runs an arc that turns by 4 atan(bulge), counter-clockwise where that is positive.
    """
    for (x, y, *bulge), (u, v, *_) in zip(loop, [*loop[1:], loop[0]]):
        bulges = (bulge_of(arc, x, y, u, v) for arc in bulge)
        middle = [((x + u + b * (v - y)) / 2, (y + v - b * (u - x)) / 2) for b in bulges]
        yield (x, y), *middle, (u, v)


'''

_FACE = (
    CURVES
    + '''def face(outer, *holes):
    """The area in a loop, without its holes."""
    area = make_face([Line(*curve) if len(curve) == 2 else ThreePointArc(*curve) for curve in curves(outer)])
    for hole in holes:
        area -= face(hole)
    return area


'''
)

_EXTRUDED = '''def extruded(height, *areas):
    """Areas, each an outer loop and its holes, from -height / 2 to height / 2 along z."""
    return Part() + [Pos(0, 0, -height / 2) * extrude(face(*area), height, dir=(0, 0, 1)) for area in areas]


'''

_TURNED = '''def turned(angle, *areas):
    """Areas, each an outer loop and its holes, in the plane of x and z, turned about z."""
    return Part() + [revolve(Plane.XZ * face(*area), Axis.Z, angle) for area in areas]


'''

_HELPERS = {"": _FACE, "extrude": _EXTRUDED, "revolve": _TURNED}
_RARE = ("Axis", "Line", "Part", "Plane", "ThreePointArc", "extrude", "make_face", "mirror", "revolve")  # what plain scripts do without
_NAMES = sorted((*_RARE, "Box", "Cone", "Cylinder", "Pos", "Rot", "Sphere", "Torus", "export_step", "scale"))
_FRAME = Primitive("box", (1.0, 1.0, 1.0))  # turned and moved, it shows a placement

_TAIL = """)

if __name__ == "__main__":
    export_step(part, "part.step")
"""


def to_script(program: Program, parameters: Parameters | None = None, folded: Folded | None = None) -> str:
    """Python text that builds `program` as `part` with build123d, in the program's own units (build123d takes them for mm).

    Numbers follow `parameters` if given. `folded`, which `program` is the expansion of, gives it loops.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)
    writer = _Script(rounding, named)
    lines = writer.flat(program) if folded is None else writer.lines(folded)
    body = [*named.head(rounding.size), *helpers(program, _HELPERS), *writer.parts, "part = (", *("    " + text for text in lines)]
    used = [n for n in _NAMES if n not in _RARE or any(f"{n}(" in text or f"{n}." in text for text in body)]
    return _HEAD.format(standard=standard_imports(body), names=", ".join(used)) + "\n".join(body) + "\n" + _TAIL


def standard_imports(body: Sequence[str]) -> str:
    """What a text needs of Python's standard library."""
    joins = [name for name in ("add", "and_", "mul") if any(f"reduce({name}," in text for text in body)]
    lines = ["from functools import reduce"] if joins else []
    lines += ["from math import atan2, pi, sqrt, tan"] if any("def curves(" in text for text in body) else []
    lines += [f"from operator import {', '.join(joins)}"] if joins else []
    return "\n".join([*lines, "", ""]) if lines else ""


def helpers(program: Program, texts: Mapping[str, str]) -> list[str]:
    """The definitions that the outlines of a program need: those that all do, and those of their kinds."""
    kinds = {leaf.kind for leaf in leaves(program) if leaf.outline is not None}
    return [text.rstrip("\n") + "\n\n" for kind, text in texts.items() if kinds and (not kind or kind in kinds)]


class _Script(Chains):
    """Placements are multiplied to what they place."""

    signs: ClassVar[Mapping[Op, str]] = {"union": "+", "difference": "-", "intersection": "&"}

    def _primitive(self, leaf: Primitive, number: int) -> str:
        place = self._center(number)
        steps = [f"Pos({', '.join(place)})"] if any(c != "0" for c in place) else []
        for axis, angle in reversed(list(self._turns(leaf.rotation))):
            steps.append(f"Rot({', '.join(angle if a == axis else '0' for a in range(3))})")
        return " * ".join([*steps, _SHAPE[leaf.kind](*self._arguments(leaf, number))])

    def _repeat(self, repeat: Repeat, first: int) -> list[str]:
        # a list alone is no part
        copies = self._copies(repeat, first)
        return ["Part()", f"+ {copies}"] if repeat.join == "union" else [f"reduce(and_, {copies})"]

    def _operands(self, group: Group, first: int) -> list[list[str]]:
        operands: list[list[str]] = []
        for part, start in starts(group, first):
            spread = isinstance(part, Repeat) and part.join == "union" and group.op != "intersection" and start > first
            operands.append([self._copies(part, start)] if spread else self.lines(part, start))  # type: ignore[arg-type]
        if isinstance(group.parts[0], Repeat) and group.parts[0].join == group.op == "union":
            operands[:1] = [[line.removeprefix("+ ")] for line in operands[0]]
        return operands

    def _copies(self, repeat: Repeat, first: int) -> str:
        loop = next(self._loops)
        self._assign(repeat, first, loop.part)
        return _COPIES[repeat.kind](self, repeat, loop)

    def _row(self, _: Repeat, loop: Loop) -> str:
        place = write_moves(list(zip("ij", loop.steps, strict=False)), self._rounding.length, " * ")
        ranges = " ".join(f"for {i} in range({name})" for i, name in zip("ij", loop.counts, strict=False))
        return f"[Pos({place}) * {loop.part} {ranges}]"

    def _circle(self, repeat: Repeat, loop: Loop) -> str:
        if max(map(abs, repeat.axis)) < 1:
            places = [self._place(motion) for motion in repeat.motions()]
            return f"[place * {loop.part} for place in ({', '.join(places)})]"
        angle = f"360 / {loop.counts[0]} * i" if repeat.is_full else f"{self._rounding.angle(abs(repeat.angle))} * i"
        sign = "" if sum(repeat.axis) * repeat.angle > 0 else "-"
        turn = f"Rot({', '.join(sign + angle if c else '0' for c in repeat.axis)})"
        center = self._vector(loop.center)
        there, back = (f"Pos({center}) * ", f"Pos({self._vector(loop.center, -1)}) * ") if center != "0, 0, 0" else ("", "")
        return f"[{there}{turn} * {back}{loop.part} for i in range({loop.counts[0]})]"

    def _mirror(self, repeat: Repeat, loop: Loop) -> str:
        origin = ", ".join(write_expression(_half(e), self._rounding.length) for e in loop.shift)
        normal = ", ".join(plain(round(n, 12)) for n in repeat.axis)
        return f"[{loop.part}, mirror({loop.part}, about=Plane(origin=({origin}), z_dir=({normal})))]"

    def _place(self, motion: Motion) -> str:
        leaf = move_leaf(_FRAME, motion)
        turns = [f"Rot({', '.join(self._rounding.angle(leaf.rotation[a]) if b == a else '0' for b in range(3))})" for a in (2, 1, 0)]
        return " * ".join([f"Pos({', '.join(self._rounding.length(c) for c in leaf.center)})", *turns])

    def _vector(self, v: Sequence[Expression], sign: int = 1) -> str:
        return ", ".join(t if sign > 0 or t == "0" else f"-({t})" for t in (write_expression(e, self._rounding.length) for e in v))


_COPIES: Mapping[str, Callable[[_Script, Repeat, Loop], str]] = {
    "linear": _Script._row,
    "grid": _Script._row,
    "circular": _Script._circle,
    "mirror": _Script._mirror,
}


def _half(e: Expression) -> Expression:
    return Expression(tuple(type(t)(t.name, t.coefficient / 2) for t in e.terms), e.constant / 2)
