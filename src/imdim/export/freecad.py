"""A FreeCAD macro: the program as a tree of FreeCAD's own objects, whose sizes and places follow a spreadsheet of the named parameters.

FreeCAD's boxes stand on a corner and its cylinders and cones on the middle of their lower ends: these places are written as sums of the
same names. Copies are written one by one. Of outlines lines, arcs and circles are a sketch with constraints, whose datums follow the names;
regular polygons and ellipses are objects beside it. A fillet or chamfer belongs to the edges that were found when the macro ran.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial

from imdim.export import freecad_texts as texts
from imdim.export.blend_texts import BlendTexts
from imdim.export.drawing import circle_sums, pair_loops
from imdim.export.drawn_vertex import BendAngle, BendRadius, Center, DrawnPolygon, DrawnVertex, Touching
from imdim.export.feature_names import label_features
from imdim.export.feature_notes import write_notes
from imdim.export.numbers import SIGNIFICANT_DIGITS, Expression, Rounding, plain, simple_fraction, weighted_sum, write_expression
from imdim.export.parameters import DrawnLoop, Parameters, is_count
from imdim.export.script import CURVES, RINGS, standard_imports
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.edges import EdgeFeature
from imdim.program.nary import fold_nary
from imdim.program.outline import has_ellipse
from imdim.program.tree import ANGLES, SIZE_NAMES, Op, Primitive, Program, leaves

MOST_DRIVEN = 100  # curves of a loop that has constraints: FreeCAD's solver takes seconds for more
LENGTH, ANGLE = " mm", " deg"
_HEAD = '''"""CSG program as a FreeCAD macro. It makes a document with a spreadsheet: change a number there, and the part is built anew."""

import re
{standard}
import FreeCAD as App
import Part
{sketcher}
'''
_ORIGIN: Mapping[str, tuple[int, ...]] = {"box": (0, 1, 2), "cylinder": (2,), "cone": (2,)}  # axes at whose lower end FreeCAD's origin is
_WORDS: Mapping[Op, str] = {"union": "fuse", "difference": "cut", "intersection": "common"}
_KINDS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "box": ("Box", ("Length", "Width", "Height")),
    "sphere": ("Sphere", ("Radius",)),
    "cylinder": ("Cylinder", ("Radius", "Height")),
    "cone": ("Cone", ("Radius1", "Radius2", "Height")),
    "torus": ("Torus", ("Radius1", "Radius2")),
    "ellipsoid": ("Ellipsoid", ("Radius2", "Radius3", "Radius1")),  # whose first radius lies along z
}
_SWEEPS = {"extrude": "extruded", "revolve": "turned", "drafted": "drafted"}


def to_freecad(program: Program, parameters: Parameters | None = None, edges: Sequence[EdgeFeature] = ()) -> str:
    """Text of a FreeCAD macro that builds `program` in the program's own units (FreeCAD takes them for mm), then blends its `edges`.

    Numbers follow `parameters` if given.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program)
    writer = _Macro(rounding, named, named.labels or label_features(program))
    lines = fold_nary(program, writer.leaf, {op: partial(_call, word) for op, word in _WORDS.items()})
    blends = BlendTexts.of(program, edges, named, rounding, _change)
    head = blends.add_sizes(named.head(rounding.size, counted=False))
    helpers = [*_helpers(program, lines, blends), *blends.helpers(texts.BLENDS)]
    build = ["part = (", *("    " + line for line in lines), ")"]
    blended = ["part = in_body(part)", *blends.calls] if blends.calls else []
    body = [*head, *_units(head, named), "", *helpers, *build, *blended]
    is_drawn = any(leaf.outline for leaf in leaves(program))
    start = _HEAD.format(standard=standard_imports(body).rstrip("\n"), sketcher="import Sketcher\n" if is_drawn else "")
    return start + "\n".join(body) + "\n" + texts.END


def _units(head: Sequence[str], named: Parameters) -> list[str]:
    """The dictionary of names and their units."""
    names = [line.split(" = ")[0] for line in head if line]
    units = {name: "" if is_count(name) else "deg" if name in named.angles else "mm" for name in names}
    return ["UNITS = {", *(f'    "{name}": "{unit}",' for name, unit in units.items()), "}"]


def _helpers(program: Program, lines: Sequence[str], blends: BlendTexts) -> list[str]:
    """The definitions that a program needs."""
    parts, used = list(leaves(program)), "\n".join(lines)
    outlined = [leaf for leaf in parts if leaf.outline]
    found = [texts.SHEET]
    found += [text for word, text in (("fuse(", texts.FUSE), ("cut(", texts.CUT), ("common(", texts.COMMON)) if word in used]
    if "cut(" in used and "fuse(" not in used:
        found.insert(1, texts.FUSE)
    if outlined:
        # a line of a name and a number alone would be a parameter
        constants = f'MOST_DRIVEN = {MOST_DRIVEN}  # curves of a loop\nFACE_MAKER = "Part::FaceMakerBullseye"\n\n'
        found += [constants, CURVES, texts.SKETCHES]
        found += [texts.POLYGON] if "polygon(" in used or "across_flats(" in used else []
        found += [texts.ACROSS_FLATS] if "across_flats(" in used else []
        found += [texts.ELLIPSE] if any(has_ellipse(leaf.outline) for leaf in outlined if leaf.outline) else []
        sweeps = ("extrude", texts.EXTRUDED), ("revolve", texts.TURNED), ("drafted", texts.DRAFTED)
        found += [text for kind, text in sweeps if any(p.kind == kind for p in outlined)]
    found += [RINGS] if blends.has_walls and blends.calls else []
    return [text.rstrip("\n") + "\n\n" for text in found]


def _change(feature: EdgeFeature) -> str:
    return f"{feature.kind}_edges({', '.join(map(_quote, feature.size_names))})"


def _call(word: str, parts: list[list[str]]) -> list[str]:
    """A call on objects, each ending with a comma; comments stay above them."""
    ended = [[*part[:-1], part[-1] + ","] for part in parts]
    return [f"{word}(", *("    " + line for part in ended for line in part), ")"]


class _Macro:
    """Writes primitives."""

    def __init__(self, rounding: Rounding, named: Parameters, label: Sequence[str]) -> None:
        self._rounding, self._named, self._label = rounding, named, label

    def leaf(self, number: int, leaf: Primitive) -> list[str]:
        """The call that makes a leaf; above it what it is, and each loop of an outline on a line of its own."""
        sizes = [self._size(name, size) for name, size in zip(SIZE_NAMES[leaf.kind], self._named.sizes[number], strict=True)]
        notes, label = write_notes(self._named.notes, number, "#"), _quote(self._label[number])
        place = self._place(number, leaf)
        if leaf.outline is None:
            kind, words = _KINDS[leaf.kind]
            if leaf.kind == "cone" and sizes[0] == sizes[1]:
                (kind, words), sizes = _KINDS["cylinder"], sizes[1:]
            written = [f"{word}={size}" for word, size in zip(words, sizes, strict=True)]
            return [*notes, f"add({', '.join([_quote(kind), label, *place, *written])})"]
        loops = [self._loop(drawn) for _, drawn in pair_loops(leaf, self._named.outlines[number], self._rounding)]
        head = f"{_SWEEPS[leaf.kind]}({', '.join([label, *sizes])},"
        return [*notes, head, *(f"    {loop}," for loop in loops), *(f"    {p}," for p in place), ")"]

    def _size(self, name: str, size: Expression) -> str:
        rounded = self._rounding.constant_of if size.terms else self._rounding.size_of
        return _sum(size, partial(rounded, name), ANGLE if name in ANGLES else LENGTH)

    def _place(self, number: int, leaf: Primitive) -> list[str]:
        """Where FreeCAD's origin of a primitive is, and how that is turned; nothing for what is so already."""
        turn, sizes = matrix_from_euler(leaf.rotation).tolist(), self._named.sizes[number]
        at = []
        for center, row in zip(self._named.centers[number], turn, strict=True):
            # a cylinder's and a cone's height is its last size
            back = [(sizes[a if leaf.kind == "box" else -1], simple_fraction(-round(row[a], 12) / 2)) for a in _ORIGIN.get(leaf.kind, ())]
            at.append(self._length(weighted_sum((center, Fraction(1)), *(part for part in back if part[1]))))
        turned = [self._rounding.angle(a) for a in leaf.rotation]
        written = {"at": at, "turn": turned}
        return [f"{word}=[{', '.join(three)}]" for word, three in written.items() if any(c != "0" for c in three)]

    def _length(self, e: Expression) -> str:
        return _sum(e, self._rounding.length, LENGTH)

    def _loop(self, loop: DrawnLoop) -> str:
        """A list of vertices, a circle as a tuple, or the call that makes another loop."""
        if not isinstance(loop, tuple):
            is_polygon = isinstance(loop, DrawnPolygon)
            first, second, x, y, angle = loop.numbers()
            written = [self._count(first) if is_polygon else self._length(first), *map(self._length, (second, x, y))]
            written.append(_sum(angle, self._rounding.angle, ANGLE))
            while written[-1] == "0":
                written.pop()
            word = "ellipse" if not is_polygon else "across_flats" if loop.is_across_flats else "polygon"
            return f"{word}({', '.join(written)})"
        bulge = loop[0].bulge
        ring = circle_sums(loop, bulge) if isinstance(bulge, int | float) else None
        if ring is not None and self._value(ring[0]) > 0:
            return f"({', '.join(map(self._length, ring))})"
        return f"[{', '.join(map(self._vertex, loop))}]"

    def _count(self, e: Expression) -> str:
        return _sum(e, plain, "")

    def _vertex(self, v: DrawnVertex[Expression]) -> str:
        at = [self._length(v.x), self._length(v.y)]
        if v.reach is not None:
            radius, off = (self._bare(e) for e in (v.reach.radius, v.reach.off))
            center, sign = (v.x, v.y)[v.reach.axis], "-" if v.reach.sign < 0 else "+"
            at[v.reach.axis] = _quote(f"{self._bare(center)} {sign} sqrt(({radius})^2 - ({off})^2)")
        return f"[{', '.join([*at, *self._arc(v)])}]"

    def _value(self, e: Expression) -> float:
        return e.constant + sum(float(t.coefficient) * self._named.values[t.name] for t in e.terms)

    def _bare(self, e: Expression) -> str:
        return write_expression(e, self._rounding.length, LENGTH)

    def _arc(self, v: DrawnVertex[Expression]) -> list[str]:
        """How the curve from a vertex bends, nothing for a line."""
        bend = v.bulge
        if isinstance(bend, Center):
            return [f"[{self._length(bend.x)}, {self._length(bend.y)}, {bend.way}]"]
        if isinstance(bend, BendRadius):
            return [f"[{', '.join([self._length(bend.radius), *([str(bend.way)] if bend.way else [])])}]"]
        if isinstance(bend, BendAngle):
            return [f"({_sum(bend.angle, self._rounding.angle, ANGLE)}, {bend.way})"]
        if isinstance(bend, Touching):
            return [_quote(bend.word)]
        bulge = round(bend, SIGNIFICANT_DIGITS)
        return [plain(bulge)] if bulge else []


def _sum(e: Expression, number: Callable[[float], str], unit: str) -> str:
    """A sum of names as a quoted text with units, a number alone as it is."""
    return _quote(write_expression(e, number, unit)) if e.terms else number(e.constant)


def _quote(text: str) -> str:
    return f'"{text}"'
