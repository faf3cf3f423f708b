"""A build123d script: the program as Python that a modeller can edit, parameters first, then one line per primitive.

build123d's primitives are centred with their axis along z, as ours are. Rotations are written one axis at a time, since its
three-angle `Rot` turns about the moved axes and OpenSCAD's about the fixed ones. Outlines are faces of true lines and arcs.
Holes are build123d's own where these make the same solid. What repeats has a name, and its copies are a list.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from imdim.deadline import NEVER, Deadline
from imdim.export.blend_texts import BlendTexts
from imdim.export.chains import Chains
from imdim.export.hole_calls import HoleCalls
from imdim.export.loops import Loop
from imdim.export.numbers import Expression, Rounding, plain, write_expression, write_moves
from imdim.export.parameters import Parameters
from imdim.program.edges import EdgeFeature
from imdim.program.motions import Motion, move_leaf
from imdim.program.outline import has_ellipse
from imdim.program.repeats import Folded, Group, Repeat, group_up, starts
from imdim.program.tree import Op, Primitive, Program, Vec3, leaves

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"Box({x}, {y}, {z})",
    "sphere": lambda r: f"Sphere({r})",
    "cylinder": lambda r, h: f"Cylinder({r}, {h})",
    "cone": lambda bottom, top, h: f"Cone({bottom}, {top}, {h})" if bottom != top else f"Cylinder({bottom}, {h})",
    "torus": lambda major, minor: f"Torus({major}, {minor})",
    "ellipsoid": lambda x, y, z: f"scale(Sphere(1), by=({x}, {y}, {z}))",
    "extrude": lambda h, *regions: f"extruded({', '.join([h, *regions])})",
    "drafted": lambda h, draft, *regions: f"drafted({', '.join([h, draft, *regions])})",
    "revolve": lambda angle, *regions: f"turned({', '.join([angle, *regions])})",
}

_HEAD = '''"""CSG program as a build123d script: pip install build123d, then run this file to write part.step."""

{standard}from build123d import {names}

'''

RINGS = '''def ring(r, x=0, y=0):
    """A circle as a loop of two half arcs."""
    return [[x - r, y, 1], [x + r, y, 1]]


def reach(r, d):
    """How far a circle reaches along a line, d from its centre."""
    return sqrt(r * r - d * d)


def bend(degrees):
    """The bulge of an arc by how far it turns."""
    return tan(radians(degrees) / 4)


def ngon(sides, r, x=0, y=0, angle=0):
    """A regular polygon as a loop, with a corner at an angle in degrees."""
    turns = [radians(angle) + 2 * pi * k / sides for k in range(sides)]
    return [[x + r * cos(turn), y + r * sin(turn)] for turn in turns]


def across_flats(sides, width, x=0, y=0, angle=0):
    """A regular polygon by its width from side to side."""
    return ngon(sides, width / 2 / cos(pi / sides), x, y, angle)


'''

CURVES = '''def curves(loop):
    """Start, middle and end of each curve of a closed loop; a line, from a vertex [x, y], has no middle.

    From a vertex [x, y, bulge] runs an arc that turns by 4 atan(bulge), counter-clockwise where that is positive. In place of the
    bulge [x, y, way] is its centre, way 1 for counter-clockwise or -1; [r, way] its radius, and with both ends written as its centre
    one that the lines beside it touch; [r] that of one that rounds the corner at both its ends; "before" or "after" the curve that
    it touches, "cusp before" or "cusp after" where it comes back along that.
    """
    n = len(loop)
    written = [complex(*vertex[:2]) for vertex in loop]
    at, arcs = list(written), [vertex[2] if len(vertex) > 2 else 0 for vertex in loop]
    ends = {i: arc for i, arc in enumerate(arcs) if isinstance(arc, list) and len(arc) == 2 and at[i] == at[(i + 1) % n]}
    radii = {k % n: r * way for i, (r, way) in ends.items() for k in (i, i + 1)}

    def line(i):
        between, off = written[(i + 1) % n] - written[i % n], radii.get((i + 1) % n, 0) - radii.get(i % n, 0)
        return between / abs(between) * exp(-1j * asin(off / abs(between)))

    for i, (r, way) in ends.items():
        into, out = line(i - 1), line(i + 1)
        at[i], at[(i + 1) % n] = written[i] - r * way * 1j * into, written[i] - r * way * 1j * out
        arcs[i] = way * tan(way * phase(out / into) % (2 * pi) / 4)
    for i, arc in enumerate(arcs):
        if isinstance(arc, list) and len(arc) == 1:
            into, out = written[i] - written[i - 1], written[(i + 2) % n] - written[i]
            turn = phase(out / into)
            at[i] -= arc[0] * tan(abs(turn) / 2) * into / abs(into)
            at[(i + 1) % n] += arc[0] * tan(abs(turn) / 2) * out / abs(out)
            arcs[i] = tan(turn / 4)
    chords = [at[(i + 1) % n] - at[i] for i in range(n)]

    def half_turn(i):
        arc = arcs[i]
        if arc == "before":
            return phase(chords[i] / chords[i - 1] / exp(1j * half_turn((i - 1) % n)))
        if arc == "after":
            return phase(chords[(i + 1) % n] / chords[i] / exp(1j * half_turn((i + 1) % n)))
        if arc == "cusp before":
            return phase(-chords[i] / chords[i - 1] / exp(1j * half_turn((i - 1) % n)))
        if arc == "cusp after":
            return phase(-chords[(i + 1) % n] / chords[i] / exp(1j * half_turn((i + 1) % n)))
        if not isinstance(arc, list):
            return 2 * atan(arc)
        *said, way = arc
        if len(said) == 1:
            return way * asin(abs(chords[i]) / 2 / said[0])
        center = complex(*said)
        return way * (way * phase((at[(i + 1) % n] - center) / (at[i] - center)) % (2 * pi)) / 2

    for i, chord in enumerate(chords):
        middle = at[i] + chord / 2 * (1 - 1j * tan(half_turn(i) / 2))
        points = [at[i], at[(i + 1) % n]] if arcs[i] == 0 else [at[i], middle, at[(i + 1) % n]]
        yield [(point.real, point.imag) for point in points]


'''

ELLIPSE = '''def ellipse(rx, ry, x=0, y=0, angle=0):
    """A loop that is an ellipse, its first semi-axis at an angle in degrees."""
    return rx, ry, x, y, angle


'''

_FACE = '''def face(outer, *holes):
    """The area in a loop, without its holes."""
    area = make_face([Line(*curve) if len(curve) == 2 else ThreePointArc(*curve) for curve in curves(outer)])
    for hole in holes:
        area -= face(hole)
    return area


'''

_FACE_WITH_ELLIPSES = '''def face(outer, *holes):
    """The area in a loop, without its holes."""
    if isinstance(outer, tuple):
        rx, ry, x, y, angle = outer
        area = Pos(x, y) * Rot(0, 0, angle) * Ellipse(rx, ry)
    else:
        area = make_face([Line(*curve) if len(curve) == 2 else ThreePointArc(*curve) for curve in curves(outer)])
    for hole in holes:
        area -= face(hole)
    return area


'''

_EXTRUDED = '''def extruded(height, *areas):
    """Areas, each an outer loop and its holes, from -height / 2 to height / 2 along z."""
    return Part() + [Pos(0, 0, -height / 2) * extrude(face(*area), height, dir=(0, 0, 1)) for area in areas]


'''

_DRAFTED = '''def drafted(height, draft, *areas):
    """Areas from -height / 2 to height / 2 along z, at the foot as they are drawn; walls lean inward by the draft on the way up."""

    def lean(loop, inset):
        foot = face(loop).face().outer_wire()
        top = foot.offset_2d(-inset, kind=Kind.INTERSECTION)
        return Solid.make_loft([Pos(0, 0, -height / 2) * foot, Pos(0, 0, height / 2) * top], ruled=True)

    part, inset = Part(), height * tan(radians(draft))
    for outer, *holes in areas:
        part += lean(outer, inset) - [lean(hole, -inset) for hole in holes]
    return part


'''

_TURNED = '''def turned(angle, *areas):
    """Areas, each an outer loop and its holes, in the plane of x and z, turned about z."""
    return Part() + [revolve(Plane.XZ * face(*area), Axis.Z, angle) for area in areas]


'''

_HELPERS = {
    "ring": RINGS + CURVES + _FACE,
    "ellipse": ELLIPSE + RINGS + CURVES + _FACE_WITH_ELLIPSES,
    "extrude": _EXTRUDED,
    "drafted": _DRAFTED,
    "revolve": _TURNED,
}
_RARE = (
    "Axis",
    "CounterBoreHole",
    "CounterSinkHole",
    "Ellipse",
    "Hole",
    "Kind",
    "Line",
    "Part",
    "Plane",
    "Solid",
    "ThreePointArc",
    "chamfer",
    "extrude",
    "fillet",
    "make_face",
    "mirror",
    "revolve",
)  # what plain scripts do without
_NAMES = sorted((*_RARE, "Box", "Cone", "Cylinder", "Pos", "Rot", "Sphere", "Torus", "export_step", "scale"))
_FRAME = Primitive("box", (1.0, 1.0, 1.0))  # turned and moved, it shows a placement

_BLENDS = '''def edges_of(part):
    """All edges of a part."""
    return part.edges()


def points_of(edge):
    """Some points of an edge, its middle first."""
    return [tuple(edge.position_at(t)) for t in (0.5, 0.1, 0.3, 0.7, 0.9)]


def points_beside(edge, face):
    """Two points by the middle of an edge, one of which is on the face."""
    middle = edge.position_at(0.5)
    across = edge.tangent_at(0.5).cross(face.normal_at(middle)) * (edge.length / 100)
    return tuple(middle + across), tuple(middle - across)


def fillet_edges(part, edges, sizes, first):
    """The part with edges rounded."""
    return fillet(edges, *sizes)


def chamfer_edges(part, edges, sizes, first):
    """The part with edges bevelled; of two distances the first is that along the first face."""
    if len(sizes) == 1:
        return chamfer(edges, *sizes)
    faces = [face for face in part.faces() if edges[0] in face.edges()]
    return chamfer(edges, *sizes, reference=min(faces, key=lambda face: beside(edges[0], face, first)))


'''

_END = """
if __name__ == "__main__":
    export_step(part, "part.step")
"""


def to_script(
    program: Program,
    parameters: Parameters | None = None,
    folded: Folded | None = None,
    edges: Sequence[EdgeFeature] = (),
    deadline: Deadline = NEVER,
) -> str:
    """Python text that builds `program` as `part` with build123d, in the program's own units (build123d takes them for mm).

    Numbers follow `parameters` if given. `folded`, which `program` is the expansion of, gives it loops. Then its `edges` are blended.
    Past the `deadline` (by default never) holes are calls only where all may be.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)
    writer = _Script(rounding, named)
    groups = group_up(program) if folded is None else folded
    writer.holes = HoleCalls.of(program, groups, named, rounding, deadline)
    lines = writer.flat(program) if folded is None and not writer.holes.calls else writer.lines(groups)
    blends = BlendTexts.of(program, edges, named, rounding)
    body = [*blends.add_sizes(named.head(rounding.size)), *helpers(program, _HELPERS), *blends.helpers(_BLENDS), *writer.parts]
    body += ["part = (", *("    " + text for text in lines), ")", *blends.calls]
    text = "\n".join(body)
    used = [n for n in _NAMES if n not in _RARE or re.search(rf"\b{n}[(.]", text)]
    return _HEAD.format(standard=standard_imports(body), names=", ".join(used)) + "\n".join(body) + "\n" + _END


def standard_imports(body: Sequence[str]) -> str:
    """What a text needs of Python's standard library."""
    joins = [name for name in ("add", "and_", "mul", "sub") if any(f"reduce({name}," in text for text in body)]
    imports: dict[str, set[str]] = {"functools": {"reduce"} if joins else set(), "operator": set(joins)}
    for mark, modules in _IMPORTS.items():
        if any(mark in text for text in body):
            imports = {m: imports.get(m, set()) | modules.get(m, set()) for m in sorted({*imports, *modules})}
    lines = [f"from {module} import {', '.join(sorted(names))}" for module, names in imports.items() if names]
    return "\n".join([*lines, "", ""]) if lines else ""


_IMPORTS: Mapping[str, Mapping[str, set[str]]] = {
    "def curves(": {"cmath": {"exp", "phase"}, "math": {"asin", "atan", "pi", "tan"}},
    "degrees(atan(": {"math": {"atan", "degrees"}},
    "def ring(": {"math": {"cos", "pi", "radians", "sin", "sqrt", "tan"}},
    "def as_placed(": {"cmath": {"exp"}, "math": {"dist", "hypot", "inf", "radians"}},
}


def helpers(program: Program, texts: Mapping[str, str]) -> list[str]:
    """The definitions that the outlines of a program need: of loops, "ellipse" where there is one, else "ring", and of their kinds."""
    kinds = {leaf.kind for leaf in leaves(program) if leaf.outline is not None}
    kinds |= {"ellipse" if any(leaf.outline and has_ellipse(leaf.outline) for leaf in leaves(program)) else "ring"} if kinds else set()
    return [text.rstrip("\n") + "\n\n" for kind, text in texts.items() if kind in kinds]


class _Script(Chains):
    """Placements are multiplied to what they place."""

    signs: ClassVar[Mapping[Op, str]] = {"union": "+", "difference": "-", "intersection": "&"}
    holes: HoleCalls = HoleCalls()

    def _primitive(self, leaf: Primitive, number: int) -> str:
        if (hole := self.holes.calls.get(number)) is not None:
            place = [write_expression(c, self._rounding.length) for c in hole.at]
            return self._placed(place, hole.turn, hole.text)
        return self._placed(self._center(number), leaf.rotation, _SHAPE[leaf.kind](*self._arguments(leaf, number)))

    def _placed(self, place: Sequence[str], rotation: Vec3, shape: str) -> str:
        steps = [f"Pos({', '.join(place)})"] if any(c != "0" for c in place) else []
        for axis, angle in reversed(list(self._turns(rotation))):
            steps.append(f"Rot({', '.join(angle if a == axis else '0' for a in range(3))})")
        return " * ".join([*steps, shape])

    def _repeat(self, repeat: Repeat, first: int) -> list[str]:
        # a list alone is no part
        copies = self._copies(repeat, first)
        return ["Part()", f"+ {copies}"] if repeat.join == "union" else [f"reduce(and_, {copies})"]

    def _operands(self, group: Group, first: int) -> list[list[str]]:
        operands: list[list[str]] = []
        for part, start in starts(group, first):
            if isinstance(part, Primitive) and start in self.holes.dropped:
                continue
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
