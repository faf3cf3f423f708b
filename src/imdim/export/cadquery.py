"""A CadQuery script: the program as Python that a modeller can edit, parameters first, then one line per primitive.

CadQuery's box, sphere and cylinder are centred with their axis along z, as ours are. A placement is a turn about each of the fixed axes
and a shift, called on what it places. What repeats has a name, and its copies are a list that is joined.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from imdim.export.blend_texts import BlendTexts
from imdim.export.chains import Chains
from imdim.export.loops import Loop
from imdim.export.numbers import Expression, Rounding, plain, write_expression, write_moves
from imdim.export.parameters import Parameters
from imdim.export.script import CURVES, ELLIPSE, RINGS, helpers, standard_imports
from imdim.program.edges import EdgeFeature
from imdim.program.repeats import Folded, Repeat
from imdim.program.tree import Op, Primitive, Program, Vec3, leaves

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"cq.Workplane().box({x}, {y}, {z})",
    "sphere": lambda r: f"cq.Workplane().sphere({r})",
    "cylinder": lambda r, h: f"cq.Workplane().cylinder({h}, {r})",
    "cone": lambda bottom, top, h: f"make_cone({bottom}, {top}, {h})" if bottom != top else f"cq.Workplane().cylinder({h}, {bottom})",
    "torus": lambda major, minor: f"cq.Workplane(cq.Solid.makeTorus({major}, {minor}))",
    "ellipsoid": lambda x, y, z: f"make_ellipsoid({x}, {y}, {z})",
    "extrude": lambda h, *areas: f"extruded({', '.join([h, *areas])})",
    "drafted": lambda h, draft, *areas: f"drafted({', '.join([h, draft, *areas])})",
    "revolve": lambda angle, *areas: f"turned({', '.join([angle, *areas])})",
}

_HEAD = '''"""CSG program as a CadQuery script: pip install cadquery, then run this file to write part.step."""

{standard}import cadquery as cq

'''

_BLENDS = '''
def edges_of(part):
    """All edges of a part."""
    return part.val().Edges()


def points_of(edge):
    """Some points of an edge, its middle first."""
    return [edge.positionAt(t).toTuple() for t in (0.5, 0.1, 0.3, 0.7, 0.9)]


def points_beside(edge, face):
    """Two points by the middle of an edge, one of which is on the face."""
    middle = edge.positionAt(0.5)
    across = edge.tangentAt(0.5).cross(face.normalAt(middle)) * (edge.Length() / 100)
    return (middle + across).toTuple(), (middle - across).toTuple()


def checked(solid):
    """A solid as a part; an error if it is not valid."""
    if not solid.isValid():
        raise ValueError("the solid is not valid")
    return cq.Workplane(solid)


def fillet_edges(part, edges, sizes, first):
    """The part with edges rounded."""
    return checked(part.val().fillet(*sizes, edges))


def chamfer_edges(part, edges, sizes, first):
    """The part with edges bevelled; of two distances the first is that along the first face."""
    if len(sizes) == 1:
        return checked(part.val().chamfer(*sizes, None, edges))
    # CadQuery measures the first one along the first face of the part that has the edge
    solid = part.val()
    faces = [[face for face in solid.Faces() if any(map(edge.isSame, face.Edges()))] for edge in edges]
    swapped = {beside(edge, one, first) > beside(edge, two, first) for edge, (one, two) in zip(edges, faces)}
    if len(swapped) > 1:
        raise ValueError("the edges lie on both sides of their faces")
    return checked(solid.chamfer(*(reversed(sizes) if True in swapped else sizes), edges))


'''

_SOUND = [
    "# booleans may leave tolerances by which a shape is not valid, and none of its blends would be",
    "part = cq.Workplane(part.val().fix())",
]

_END = """
if __name__ == "__main__":
    cq.exporters.export(part, "part.step")
"""

_SOLIDS = {
    "cone": '''
def make_cone(bottom, top, height):
    """A cone about z by its two radii, centred."""
    return cq.Workplane(cq.Solid.makeCone(bottom, top, height, cq.Vector(0, 0, -height / 2)))


''',
    "ellipsoid": '''
def make_ellipsoid(x, y, z):
    """An ellipsoid by its semi-axes."""
    stretch = cq.Matrix([[x, 0, 0, 0], [0, y, 0, 0], [0, 0, z, 0]])
    return cq.Workplane(cq.Workplane().sphere(1).val().transformGeometry(stretch))


''',
}

_DRAW = '''def draw(plane, loops):
    """An outer loop and its holes as closed wires."""
    sketch = cq.Workplane(plane)
    for loop in loops:
        drawn = list(curves(loop))
        sketch = sketch.moveTo(*drawn[0][0])
        for _, *middle, end in drawn:
            sketch = sketch.threePointArc(*middle, end) if middle else sketch.lineTo(*end)
        sketch = sketch.close()
    return sketch


'''

_DRAW_WITH_ELLIPSES = _DRAW.replace(
    "        drawn = list",
    """\
        if isinstance(loop, tuple):
            rx, ry, x, y, angle = loop
            sketch = sketch.moveTo(x, y).ellipse(rx, ry, angle)
            continue
        drawn = list""",
)

_OUTLINES = {
    "ring": "\n" + RINGS + CURVES + _DRAW,
    "ellipse": "\n" + ELLIPSE + RINGS + CURVES + _DRAW_WITH_ELLIPSES,
    "extrude": '''
def extruded(height, *areas):
    """Areas, each an outer loop and its holes, from -height / 2 to height / 2 along z."""
    return reduce(add, [draw("XY", area).extrude(height).translate((0, 0, -height / 2)) for area in areas])


''',
    "drafted": '''
def drafted(height, draft, *areas):
    """Areas from -height / 2 to height / 2 along z, at the foot as they are drawn; walls lean inward by the draft on the way up."""

    def lean(loop, inset):
        foot = draw("XY", [loop]).wires().val()
        (top,) = foot.offset2D(-inset, "intersection")
        ends = [wire.translate(cq.Vector(0, 0, z)) for wire, z in ((foot, -height / 2), (top, height / 2))]
        return cq.Workplane(cq.Solid.makeLoft(ends, ruled=True))

    inset = height * tan(radians(draft))
    return reduce(add, [reduce(sub, [lean(outer, inset), *(lean(hole, -inset) for hole in holes)]) for outer, *holes in areas])


''',
    "revolve": '''
def turned(angle, *areas):
    """Areas, each an outer loop and its holes, in the plane of x and z, turned about z."""
    return reduce(add, [draw("XZ", area).revolve(angle, (0, 0, 0), (0, 1, 0)) for area in areas])


''',
}


def to_cadquery(
    program: Program, parameters: Parameters | None = None, folded: Folded | None = None, edges: Sequence[EdgeFeature] = ()
) -> str:
    """Python text that builds `program` as `part` with CadQuery, in the program's own units (CadQuery takes them for mm).

    Numbers follow `parameters` if given. `folded`, which `program` is the expansion of, gives it loops. Then its `edges` are blended.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)
    writer = _CadQuery(rounding, named)
    lines = writer.flat(program) if folded is None else writer.lines(folded)
    solids = [text for kind, text in _SOLIDS.items() if any(leaf.kind == kind for leaf in leaves(program))]
    blends = BlendTexts.of(program, edges, named, rounding)
    head = [*blends.add_sizes(named.head(rounding.size)), *solids, *helpers(program, _OUTLINES), *blends.helpers(_BLENDS)]
    sound = _SOUND if blends.calls else []
    body = [*head, *writer.parts, "part = (", *("    " + text for text in lines), ")", *sound, *blends.calls]
    return _HEAD.format(standard=standard_imports(body)) + "\n".join(body) + "\n" + _END


class _CadQuery(Chains):
    """Placements are called on what they place."""

    signs: ClassVar[Mapping[Op, str]] = {"union": "+", "difference": "-", "intersection": "*"}

    def _primitive(self, leaf: Primitive, number: int) -> str:
        place = self._center(number)
        text = _SHAPE[leaf.kind](*self._arguments(leaf, number))
        for axis, angle in self._turns(leaf.rotation):
            text += f".rotate((0, 0, 0), ({', '.join(str(int(a == axis)) for a in range(3))}), {angle})"
        return text + (f".translate(({', '.join(place)}))" if any(c != "0" for c in place) else "")

    def _repeat(self, repeat: Repeat, first: int) -> list[str]:
        loop = next(self._loops)
        self._assign(repeat, first, loop.part)
        join = "add" if repeat.join == "union" else "mul"
        return [f"reduce({join}, {_COPIES[repeat.kind](self, repeat, loop)})"]

    def _row(self, _: Repeat, loop: Loop) -> str:
        moves = write_moves(list(zip("ij", loop.steps, strict=False)), self._rounding.length, " * ")
        ranges = " ".join(f"for {i} in range({name})" for i, name in zip("ij", loop.counts, strict=False))
        return f"[{loop.part}.translate(({moves})) {ranges}]"

    def _circle(self, repeat: Repeat, loop: Loop) -> str:
        angle = f"360 / {loop.counts[0]} * i" if repeat.is_full else f"{self._rounding.angle(abs(repeat.angle))} * i"
        center = self._vector(loop.center)
        ahead = ", ".join(f"{c} + {plain(round(n, 12))}" if n else c for c, n in zip(center, _forward(repeat), strict=True))
        return f"[{loop.part}.rotate(({', '.join(center)}), ({ahead}), {angle}) for i in range({loop.counts[0]})]"

    def _mirror(self, repeat: Repeat, loop: Loop) -> str:
        normal = ", ".join(plain(round(n, 12)) for n in repeat.axis)
        origin = ", ".join(f"({text}) / 2" if text != "0" else text for text in self._vector(loop.shift))
        return f"[{loop.part}, {loop.part}.mirror(({normal}), ({origin}))]"

    def _vector(self, v: Sequence[Expression]) -> list[str]:
        return [write_expression(e, self._rounding.length) for e in v]


def _forward(repeat: Repeat) -> Vec3:
    """The axis about which the copies turn counter-clockwise."""
    sign = 1 if repeat.angle > 0 else -1
    x, y, z = (sign * c for c in repeat.axis)
    return x, y, z


_COPIES: Mapping[str, Callable[[_CadQuery, Repeat, Loop], str]] = {
    "linear": _CadQuery._row,
    "grid": _CadQuery._row,
    "circular": _CadQuery._circle,
    "mirror": _CadQuery._mirror,
}
