"""Edge features as the Python scripts write them: sizes with names, and edges picked by the two faces that meet in them.

A face is written as a function of points, from the same numbers and names as its primitive: how far a point is from it. An edge of the
finished part that lies on both faces is one of the feature, so that the blends follow when a name gets another value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import count

from imdim.export.drawing import write_loops
from imdim.export.drawn_vertex import DrawnPolygon
from imdim.export.numbers import Expression, Rounding, weighted_sum, write_expression, write_sizes
from imdim.export.parameters import Parameters
from imdim.program.edges import EdgeFeature, Face, name_edges, wall_curve
from imdim.program.ellipse import Ellipse
from imdim.program.outline import arc_middle, loop_area, ring_curves
from imdim.program.tree import ACROSS, PLANE_ENDS, SIZE_NAMES, Primitive, Program, leaves

FACES = '''def as_placed(point, center, turn):
    """A point as a primitive has it that was turned by degrees about x, y and z, and then moved."""
    p = [a - b for a, b in zip(point, center)]
    for axis in (2, 1, 0):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        turned_back = complex(p[u], p[v]) * exp(-1j * radians(turn[axis]))
        p[u], p[v] = turned_back.real, turned_back.imag
    return p


def flat_face(center, axis, level, reach=(inf, inf, inf), turn=(0, 0, 0)):
    """How far points are from the face across an axis of a primitive, which goes no further than its reach along the others."""

    def distance(point):
        p = dict(zip("xyz", as_placed(point, center, turn)))
        return max(abs(p[a] - level) if a == axis else abs(p[a]) - r for a, r in zip("xyz", reach))

    return distance


def round_face(center, bottom, top=None, height=1, turn=(0, 0, 0)):
    """How far points are from a cylinder, or from a cone of two radii."""

    def distance(point):
        x, y, z = as_placed(point, center, turn)
        return abs(hypot(x, y) - bottom - (0 if top is None else (top - bottom) * (z / height + 1 / 2)))

    return distance


'''

WALLS = '''def off_curve(point, start, *others):
    """How far a point is from a line or an arc."""
    at, start, *middle, end = (complex(*p) for p in (point, start, *others))
    along, chord = (at - start) / (end - start), end - start
    if not middle:
        return abs(chord) * max(abs(along.imag), -along.real, along.real - 1)
    bend = (middle[0] - start) / chord
    if bend.imag * along.imag < -1e-6:
        return min(abs(at - start), abs(at - end))
    center = start + chord * complex(1 / 2, (abs(bend) ** 2 - bend.real) / (2 * bend.imag))
    return abs(abs(at - center) - abs(start - center))


def moved_in(start, *others, by):
    """A line or an arc, moved to its left by so much."""
    start, *middle, end = (complex(*p) for p in (start, *others))
    chord = end - start
    if not middle:
        step = 1j * chord / abs(chord) * by
        return [(p.real, p.imag) for p in (start + step, end + step)]
    bend = (middle[0] - start) / chord
    center = start + chord * complex(1 / 2, (abs(bend) ** 2 - bend.real) / (2 * bend.imag))
    share = 1 - by / abs(start - center) * (1 if bend.imag < 0 else -1)
    return [(p.real, p.imag) for p in (center + (p - center) * share for p in (start, *middle, end))]


def wall_face(center, loop, number, height=None, turn=(0, 0, 0), draft=0):
    """How far points are from a curve of a loop, extruded to a height or, without one, turned about z; extruded walls may lean inward."""
    curve = list(curves(loop))[number]

    def distance(point):
        x, y, z = as_placed(point, center, turn)
        drawn = moved_in(*curve, by=(z + height / 2) * tan(radians(draft))) if draft else curve
        off = off_curve((hypot(x, y), z) if height is None else (x, y), *drawn)
        return off if height is None else max(off, abs(z) - height / 2)

    return distance


def wall_faces(center, loop, *numbers, **place):
    """The faces of several curves of a loop."""
    return [wall_face(center, loop, number, **place) for number in numbers]


'''


BLENDED = '''def edges_between(part, pairs, tolerance):
    """The edges of a part along which it lies on both faces of some pair."""

    def lies(point):
        return any(max(first(point), second(point)) < tolerance for first, second in pairs)

    return [edge for edge in edges_of(part) if all(map(lies, points_of(edge)))]


def beside(edge, face, first):
    """How far a face of the part, just beside an edge of it, is from another face."""
    return min(map(first, points_beside(edge, face)))


def blended(part, change, sizes, groups):
    """A part with its edges between faces changed, all at once or, where that fails, one by one; each group is a face and those that it
    meets. Says which edges there are not, and which stay sharp."""
    pairs = [(one, other) for one, *others in groups for other in others]
    tolerance, first = min(sizes) / 100, pairs[0][0]

    def rest(tried):
        edges = edges_between(part, pairs, tolerance)
        return [edge for edge in edges if all(dist(points_of(edge)[0], place) > tolerance for place in tried)]

    edges = rest({})
    points = [point for edge in edges for point in points_of(edge)]
    gone = sum(all(max(one(point), other(point)) > tolerance for point in points) for one, other in pairs)
    if gone:
        print(f"{change.__name__} finds no edge between {gone} of {len(pairs)} pairs of faces")
    tried = {}
    try:
        part = change(part, edges, sizes, first) if edges else part
    except Exception:
        # what is blended shortens the edges beside it: they are looked for anew
        while left := rest(tried):
            place = points_of(left[0])[0]
            tried[place] = "no reason is given"
            try:
                part = change(part, left[:1], sizes, first)
            except Exception as error:
                tried[place] = str(error)
    for place in [points_of(edge)[0] for edge in rest({})]:
        said = [error for near, error in tried.items() if dist(near, place) <= tolerance]
        print(f"{change.__name__} leaves the edge at {[round(c, 6) for c in place]} sharp: {(said or ['no reason is given'])[0]}")
    return part


'''


@dataclass(frozen=True)
class BlendTexts:
    """What a script says of edge features: lines ``name = size``, calls that blend edges of `part`, and whether these need walls."""

    sizes: list[str]
    calls: list[str]
    has_walls: bool

    @staticmethod
    def of(
        program: Program,
        features: Sequence[EdgeFeature],
        named: Parameters,
        rounding: Rounding,
        change: Callable[[EdgeFeature], str] = lambda feature: f"{feature.kind}_edges",
    ) -> BlendTexts:
        """The texts; sizes that are among the names of `named` have lines already. `change` is the function that blends edges."""
        if not all(feature.name for feature in features):
            features = name_edges(features, {*named.values, *named.counts})
        sizes = [(name, size) for f in features for name, size in zip(f.size_names, f.sizes, strict=True) if name not in named.values]
        faces = _Faces(list(leaves(program)), named, rounding)
        calls = [line for feature in features for line in _calls(feature, faces, change(feature))]
        calls = _name_loops(calls, faces.loops, {*named.values, *named.counts})
        walls = any(_loop_of(face) for feature in features for edge in feature.edges for face in edge)
        return BlendTexts([f"{name} = {rounding.size(size)}" for name, size in sizes], calls, walls)

    def add_sizes(self, head: list[str]) -> list[str]:
        """The lines of names with those of sizes below."""
        return [*head[:-1], *self.sizes, ""] if self.sizes else head

    def helpers(self, own: str) -> list[str]:
        """The definitions that the calls need, those of the script's `own` library among them."""
        texts = [FACES, *([WALLS] if self.has_walls else []), own, BLENDED]
        return [text.rstrip("\n") + "\n\n" for text in texts] if self.calls else []


def _calls(feature: EdgeFeature, faces: _Faces, change: str) -> list[str]:
    """The call for one feature, or where it has two distances one for each face that the first lies along."""
    pairs = [(one, f"    ({faces.write((one,))}, {faces.write(others)}),") for one, others in _gather(feature, faces)]
    sizes = ", ".join(feature.size_names)
    lines: list[str] = []
    for first in dict.fromkeys(one if len(feature.sizes) > 1 else None for one, _ in pairs):
        its = [text for one, text in pairs if first in (one, None)]
        lines += [f"part = blended(part, {change}, [{sizes}], [", *its, "])"]
    return lines


def _name_loops(calls: list[str], loops: Iterable[str], taken: Collection[str]) -> list[str]:
    """The calls, with the loops that they have more than once assigned to names before."""
    text, heads = "\n".join(calls), list[str]()
    names = (name for n in count(1) if (name := f"loop{n if n > 1 else ''}") not in taken)
    for loop in loops:
        if text.count(loop) > 1:
            name = next(names)
            text = text.replace(loop, name)
            heads.append(f"{name} = {loop}")
    return [*heads, *text.splitlines()]


def _gather(feature: EdgeFeature, faces: _Faces) -> list[tuple[Face, tuple[Face, ...]]]:
    """The edges of a feature, those of one face with the walls of one loop together; without what can be none, of a sphere or a torus."""
    groups: dict[tuple[Face, int, str], list[Face]] = {}
    for one, two in feature.edges:
        if not (faces.can_write(one) and faces.can_write(two)):
            continue
        if len(feature.sizes) == 1 and _loop_of(one) and not _loop_of(two):
            one, two = two, one
        groups.setdefault((one, two.leaf, _loop_of(two) or two.name), []).append(two)
    return [(one, tuple(twos)) for (one, _, _), twos in groups.items()]


def _loop_of(face: Face) -> str:
    """What the names of all walls of one loop begin with; empty for other faces."""
    return face.name.rpartition("[")[0]


class _Faces:
    """Writes faces of the leaves `parts`, from the expressions that `named` has for their numbers."""

    def __init__(self, parts: list[Primitive], named: Parameters, rounding: Rounding) -> None:
        self._parts, self._named, self._rounding = parts, named, rounding
        self.loops: dict[str, None] = {}  # all that walls were written with, as texts

    def can_write(self, face: Face) -> bool:
        """Whether a face is a plane, a cylinder, a cone or a wall."""
        return face.name != "side" or self._parts[face.leaf].kind in ("cylinder", "cone")

    def write(self, faces: Sequence[Face]) -> str:
        """A face, or some walls of one loop, as items of a group."""
        number, name = faces[0]
        leaf = self._parts[number]
        sizes = self._named.sizes[number]
        center = f"({', '.join(self._length(c) for c in self._named.centers[number])})"
        angles = [self._rounding.angle(angle) for angle in leaf.rotation]
        turn = [f"turn=({', '.join(angles)})"] if any(angle != "0" for angle in angles) else []
        if name[0] in "+-":
            axis = "xyz".index(name[1])
            half = Fraction(1, 2)
            column = PLANE_ENDS.get(leaf.kind, {}).get(axis, -1)  # a revolve has its height last
            level = weighted_sum((sizes[column], half if name[0] == "+" else -half))
            reach = [f"reach=({', '.join(self._length(weighted_sum((size, half))) for size in sizes)})"] if leaf.kind == "box" else []
            return _call("flat_face", center, f'"{name[1]}"', self._length(level), *reach, *turn)
        if name == "side":
            written = write_sizes(leaf, sizes, self._rounding)
            return _call("round_face", center, *(written if leaf.kind == "cone" else written[:1]), *turn)
        loops = write_loops(leaf, self._named.outlines[number], self._rounding)
        found = [self._curve(leaf, number, face) for face in faces]
        written = dict(zip(SIZE_NAMES[leaf.kind], write_sizes(leaf, sizes, self._rounding), strict=True))
        height = [f"height={written['h']}"] if leaf.kind in ACROSS else []
        if leaf.kind == "drafted":
            height.append(f"draft={self._draft(leaf, number, found[0][0], written['draft'])}")
        self.loops[loops[found[0][0]]] = None
        wall = "wall_face" if len(found) == 1 else "*wall_faces"
        return _call(wall, center, loops[found[0][0]], *(str(k) for _, k in found), *height, *turn)

    def _draft(self, leaf: Primitive, number: int, loop: int, angle: str) -> str:
        """How far to the left of its curves the walls of a loop lean. A regular polygon is written counter-clockwise, also as a hole."""
        assert leaf.outline is not None
        drawn = self._named.outlines[number]
        is_polygon = len(drawn) == len(leaf.outline.loops) and isinstance(drawn[loop], DrawnPolygon)
        return f"-({angle})" if is_polygon and loop_area(leaf.outline.loops[loop]) < 0 else angle

    def _length(self, e: Expression) -> str:
        return write_expression(e, self._rounding.length)

    def _curve(self, leaf: Primitive, number: int, face: Face) -> tuple[int, int]:
        """The loop and the curve, as they are written, that a wall stands on: rounding may have left some out."""
        curve, outline = wall_curve(leaf, face.name), self._rounding.primitive(leaf).outline
        assert curve is not None
        assert outline is not None
        rings = [(i, loop) for i, loop in enumerate(outline.loops) if not isinstance(loop, Ellipse)]
        places = {(i, k): arc_middle(c) for i, loop in rings for k, c in enumerate(ring_curves(loop))}
        i, k = min(places, key=lambda at: math.dist(places[at], arc_middle(curve)))
        drawn = self._named.outlines[number]
        ring = drawn[i] if len(drawn) == len(outline.loops) else None
        return (i, self._side(ring, arc_middle(curve))) if isinstance(ring, DrawnPolygon) else (i, k)

    def _side(self, polygon: DrawnPolygon[Expression], middle: tuple[float, float]) -> int:
        """The side of a regular polygon that is nearest to a point: they are counted from the corner at its angle."""
        x, y, angle, sides = (self._value(e) for e in (polygon.x, polygon.y, polygon.angle, polygon.sides))
        turned = math.degrees(math.atan2(middle[1] - y, middle[0] - x)) - angle
        return round(turned / 360 * sides - 1 / 2) % round(sides)

    def _value(self, e: Expression) -> float:
        values = {**self._named.values, **self._named.counts}
        return e.constant + sum(float(t.coefficient) * values[t.name] for t in e.terms)


def _call(name: str, *arguments: str) -> str:
    return f"{name}({', '.join(arguments)})"
