"""OpenSCAD text: parameters, then one line per primitive, n-ary operations, numbers as a person would write them.

It is flat, or has repeated parts as modules in ``for`` loops: how often and how far apart are named parameters then. Where there are
outlines, the text ends with a module that divides their arcs by `$fn`, as `geometry.solid` does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from imdim.export.customizer import customizer_head
from imdim.export.drawing import write_areas, write_loops
from imdim.export.edge_text import DrawnEdges
from imdim.export.feature_notes import write_notes
from imdim.export.loops import Loop, less
from imdim.export.numbers import Expression, Rounding, plain, write_expression, write_moves, write_sizes
from imdim.export.own_directions import OwnPlaces
from imdim.export.parameters import Parameters
from imdim.geometry.solid import SEGMENTS
from imdim.program.cost import count
from imdim.program.edges import describe_edges
from imdim.program.nary import fold_nary
from imdim.program.outline import has_ellipse
from imdim.program.repeats import Folded, Group, Repeat, expand, starts
from imdim.program.tree import OPS, Primitive, Program, leaves

OUTLINE = """\
// Closed loops of lines and arcs, of which an odd number hold what is inside. A line runs from a vertex [x, y], an arc from
// [x, y, bulge], bulge = tan(turn / 4). In place of the bulge [x, y, way] is its centre, way 1 for counter-clockwise or -1; [r, way] its
// radius, and with both ends written as its centre one that the lines beside it touch; [r] that of one that rounds the corner at both its
// ends; "before" or "after" the curve that it touches, "cusp before" or "cusp after" where it comes back along it; bend(degrees) its turn.
// A ring is a circle, an ngon a regular polygon with a corner at an angle, across_flats the same by its width from side to side; reach is
// half a chord, d from the centre.
function ring(r, x = 0, y = 0) = [[x - r, y, 1], [x + r, y, 1]];
function ngon(sides, r, x = 0, y = 0, angle = 0) = [for (k = [0 : sides - 1]) [x, y] + r * direction(angle + 360 * k / sides)];
function across_flats(sides, width, x = 0, y = 0, angle = 0) = ngon(sides, width / 2 / cos(180 / sides), x, y, angle);
function direction(angle) = [cos(angle), sin(angle)];
function reach(r, d) = sqrt(r * r - d * d);
function bend(degrees) = tan(degrees / 4);
module outline(loops) {
  rings = [for (loop = loops) outline_points(loop)];
  starts = [for (i = 0, n = 0; i < len(rings); n = n + len(rings[i]), i = i + 1) n];
  polygon([for (ring = rings) each ring], [for (i = [0 : len(rings) - 1]) [for (k = [0 : len(rings[i]) - 1]) starts[i] + k]]);
}
function outline_points(loop) = [for (i = [0 : len(loop) - 1]) each curve_points(loop, i)];
function written(loop, i) = loop[(i + len(loop)) % len(loop)];
function point(loop, i) = [written(loop, i)[0], written(loop, i)[1]];
function rounds(loop, i) = is_list(written(loop, i)[2]) && len(written(loop, i)[2]) == 1;
function is_end(loop, i) = is_list(written(loop, i)[2]) && len(written(loop, i)[2]) == 2 && point(loop, i) == point(loop, i + 1);
function end_radius(loop, i) = is_end(loop, i) ? written(loop, i)[2][0] * written(loop, i)[2][1] : 0;
function radius_at(loop, i) = is_end(loop, i) ? end_radius(loop, i) : end_radius(loop, i - 1);
function line_angle(loop, i) = let(d = point(loop, i + 1) - point(loop, i))
  atan2(d[1], d[0]) - asin((radius_at(loop, i + 1) - radius_at(loop, i)) / norm(d));
function place_touching(loop, i, angle) = point(loop, i) + radius_at(loop, i) * [sin(angle), -cos(angle)];
function place(loop, i) =
  is_end(loop, i) ? place_touching(loop, i, line_angle(loop, i - 1)) : is_end(loop, i - 1) ? place_touching(loop, i, line_angle(loop, i)) :
  rounds(loop, i) ? place_beside(loop, i, i - 1) : rounds(loop, i - 1) ? place_beside(loop, i - 1, i + 1) : point(loop, i);
function place_beside(loop, i, k) = let(along = point(loop, k) - point(loop, i))
  point(loop, i) + written(loop, i)[2][0] * tan(abs(corner_turn(loop, i)) / 2) * along / norm(along);
function corner_turn(loop, i) = turn_between(point(loop, i) - point(loop, i - 1), point(loop, i + 2) - point(loop, i));
function turn_between(u, v) = atan2(u[0] * v[1] - u[1] * v[0], u * v);
function chord(loop, i) = place(loop, i + 1) - place(loop, i);
function turned(v, angle) = [v[0] * cos(angle) - v[1] * sin(angle), v[0] * sin(angle) + v[1] * cos(angle)];
function half_turn(loop, i) = let(arc = written(loop, i)[2], n = is_list(arc) ? len(arc) : 0)
  is_undef(arc) ? 0 : is_num(arc) ? 2 * atan(arc) :
  arc == "before" ? turn_between(turned(chord(loop, i - 1), half_turn(loop, i - 1)), chord(loop, i)) :
  arc == "after" ? turn_between(chord(loop, i), turned(chord(loop, i + 1), -half_turn(loop, i + 1))) :
  arc == "cusp before" ? turn_between(-turned(chord(loop, i - 1), half_turn(loop, i - 1)), chord(loop, i)) :
  arc == "cusp after" ? turn_between(chord(loop, i), -turned(chord(loop, i + 1), -half_turn(loop, i + 1))) :
  n == 1 ? corner_turn(loop, i) / 2 :
  is_end(loop, i) ? arc[1] * ((1440 + arc[1] * (line_angle(loop, i + 1) - line_angle(loop, i - 1))) % 360) / 2 :
  n == 2 ? arc[1] * asin(norm(chord(loop, i)) / 2 / arc[0]) :
  half_about(arc, place(loop, i), place(loop, i + 1));
function half_about(c, a, b) = c[2] * ((720 + c[2] * turn_between(a - [c[0], c[1]], b - [c[0], c[1]])) % 360) / 2;
function curve_points(loop, i) = let(a = place(loop, i), half = half_turn(loop, i)) half == 0 ? [a] : let(
  b = place(loop, i + 1), c = (a + b) / 2 + turned(b - a, 90) / 2 / tan(half), way = sign(half), r = norm(a - c), step = 360 / $fn,
  from = way * atan2(a[1] - c[1], a[0] - c[0]) / step, to = from + 2 * abs(half) / step, last = ceil(to - 1e-4) - 1
) [a, for (k = [floor(from + 1e-4) + 1 : 1 : last]) c + r * [cos(k * step), way * sin(k * step)]];
"""

# what the module above is given for an ellipse
ELLIPSE = """\
// An ellipse by its semi-axes, the first at an angle.
function ellipse(rx, ry, x = 0, y = 0, angle = 0) =
  [for (k = [0 : $fn - 1]) [x, y] + turned([rx * cos(360 * k / $fn), ry * sin(360 * k / $fn)], angle)];
"""

# after the module above, where walls lean
DRAFTED = """\
// Areas, each an outer loop and its holes, from -height / 2 to height / 2. They are drawn at the foot, and all walls lean inward by the
// draft on the way up: scaled where that is all that happens to the area, else a wedge is cut off along each curve.
module drafted(height, draft, areas) {
  for (area = areas) {
    points = outline_points(area[0]);
    moved = [for (i = [0 : len(points) - 1]) moved_in(points, i, height * tan(draft) * sign(signed_area(points)))];
    middle = (corner(points, 1) + corner(points, -1)) / 2;
    size = corner(points, 1) - corner(points, -1);
    share = [for (k = [0, 1]) (corner(moved, 1) - corner(moved, -1))[k] / size[k]];
    off = [for (i = [0 : len(points) - 1]) norm(moved[i] - middle - [for (k = [0, 1]) share[k] * (points[i] - middle)[k]])];
    if (len(area) == 1 && max(off) < 1e-9 * norm(size)) translate([middle[0], middle[1], -height / 2])
      linear_extrude(height = height, scale = share) polygon([for (p = points) p - middle]);
    else difference() {
      linear_extrude(height = height, center = true) outline(area);
      for (k = [0 : len(area) - 1]) let(left = sign(signed_area(outline_points(area[k]))) * (k == 0 ? 1 : -1))
        for (i = [0 : len(area[k]) - 1]) translate([0, 0, -height / 2])
          if (half_turn(area[k], i) == 0) wedge(area[k], i, height, height * tan(draft), left);
          else ring_wedge(area[k], i, height, height * tan(draft), left);
    }
  }
}
// what leans over a line whose inside is to its left (1) or right (-1); in a corner that points inward, with what leans over the next line
module wedge(loop, i, height, inset, left) {
  turn = left * turn_between(chord(loop, i), chord(loop, i + 1));
  along_line(loop, i, height, inset, left, -height / 1000, norm(chord(loop, i)) + height / 1000);
  if (half_turn(loop, i + 1) == 0 && turn < 0) intersection() {
    along_line(loop, i, height, inset, left, norm(chord(loop, i)) - height / 1000, norm(chord(loop, i)) + inset * tan(-turn / 2));
    along_line(loop, i + 1, height, inset, left, -inset * tan(-turn / 2), height / 1000);
  }
}
module along_line(loop, i, height, inset, left, from, to) translate([place(loop, i)[0], place(loop, i)[1], 0])
  rotate([90, 0, 90 + atan2(chord(loop, i)[1], chord(loop, i)[0])]) translate([0, 0, from]) linear_extrude(height = to - from)
    polygon([for (p = wedge_section(height, inset, (height + inset) / 500)) [left * p[0], p[1]]]);
module ring_wedge(loop, i, height, inset, left) {
  half = half_turn(loop, i);
  c = place(loop, i) + chord(loop, i) / 2 + turned(chord(loop, i), 90) / 2 / tan(half);
  start = (half > 0 ? place(loop, i) : place(loop, i + 1)) - c;
  r = norm(start);
  inward = -left * sign(half);
  off = min((height + inset) / 500 + 2 * r * (1 - cos(180 / $fn)), r / 2);
  translate([c[0], c[1], 0]) rotate(atan2(start[1], start[0]) - 0.01) rotate_extrude(angle = 2 * abs(half) + 0.02)
    polygon([for (p = wedge_section(height, inset, off)) [r + inward * p[0], p[1]]]);
}
// it begins a little below the foot, ends as much above the top, and goes on so far off on the other side of the wall
function wedge_section(height, inset, off) =
  [[-inset / 1000, -height / 1000], [1.001 * inset, 1.001 * height], [-off, 1.001 * height], [-off, -height / 1000]];
function corner(points, way) = [for (k = [0, 1]) way * max([for (p = points) way * p[k]])];
function signed_area(points, n = 0) = n == len(points) ? 0 :
  let(a = points[n], b = points[(n + 1) % len(points)]) a[0] * b[1] - b[0] * a[1] + signed_area(points, n + 1);
function left_of(a, b) = [a[1] - b[1], b[0] - a[0]] / norm(b - a);
function moved_in(points, i, by) = let(
  n = len(points), u = left_of(points[(i + n - 1) % n], points[i]), v = left_of(points[i], points[(i + 1) % n])
) points[i] + by * (u + v) / (1 + u * v);
"""

SWITCH = {
    True: "edges = true; // false leaves the chamfers and fillets below out",
    False: "edges = false; // true draws the chamfers and fillets below too",
}
WHERE_DRAWN = "if (edges)"
TURN = "rotate"  # of the whole part

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"cube([{x}, {y}, {z}], center = true)",
    "sphere": lambda r: f"sphere(r = {r})",
    "cylinder": lambda r, h: f"cylinder(h = {h}, r = {r}, center = true)",
    "cone": lambda bottom, top, h: f"cylinder(h = {h}, r1 = {bottom}, r2 = {top}, center = true)",
    "torus": lambda major, minor: f"rotate_extrude() translate([{major}, 0, 0]) circle(r = {minor})",
    "ellipsoid": lambda x, y, z: f"scale([{x}, {y}, {z}]) sphere(r = 1)",
    "extrude": lambda h, loops: f"linear_extrude(height = {h}, center = true) outline({loops})",
    "drafted": lambda h, draft, areas: f"drafted({h}, {draft}, {areas})",
    "revolve": lambda angle, loops: f"rotate_extrude(angle = {angle}) outline({loops})",
}


def to_openscad(program: Program, segments: int = SEGMENTS, parameters: Parameters | None = None, edges: DrawnEdges | None = None) -> str:
    """OpenSCAD text of `program` in its own units, with `$fn` at `segments`, and numbers that follow `parameters` if given.

    Lengths keep about nine significant digits of the model's size, angles nine decimals. Cutters are written as they are: see `overshoot`.
    `edges` are drawn where the text's own switch says so, which is on where they are `shown`.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program)
    named, aslant = _along_own(named), named.own
    written = program if aslant is None else aslant.directions.turn_program(program)

    def line(number: int, leaf: Primitive) -> list[str]:
        return _primitive(leaf, rounding, named, number, named.centers[number])

    lines = _turn_lines(fold_nary(written, line, {op: _block(op) for op in OPS}), aslant)
    head = customizer_head(named, rounding.size, counted=False)
    if edges is None or not edges.pieces:
        return "\n".join([f"$fn = {segments};", "", *head, *lines, "", *_definitions(program)])
    drawn = [*_switch(edges), "", *_with_blends(lines, edges, rounding), ""]
    return "\n".join([f"$fn = {segments};", "", *head, *drawn, *(_definitions(program) or [OUTLINE])])


def _along_own(named: Parameters) -> Parameters:
    """The parameters with places along the program's own directions."""
    return named if named.own is None else replace(named, centers=named.own.centers, loops=named.own.loops)


def _turn_lines(lines: Sequence[str], aslant: OwnPlaces | None) -> list[str]:
    """Statements that are turned as one where their places are along other directions than the world's."""
    if aslant is None:
        return list(lines)
    return [f"{TURN}([{', '.join(map(Rounding.angle, aslant.directions.rotation))}]) {{", *("  " + line for line in lines), "}"]


def _switch(edges: DrawnEdges) -> list[str]:
    """The line that says whether blends are drawn, and one that says which names they do not follow."""
    stuck = [f"// They stay where they are when one of these changes: {', '.join(edges.stuck)}"] if edges.stuck else []
    return [SWITCH[edges.shown], *stuck]


def _with_blends(lines: Sequence[str], edges: DrawnEdges, rounding: Rounding) -> list[str]:
    """The statement of a sharp program as that of the part with its blends."""
    first = np.cumsum([0, *(count(piece.solid).primitives for piece in edges.pieces)])

    def write(cuts: bool) -> list[str]:
        out: list[str] = []
        for number, feature in enumerate(edges.features):
            pieces = [(k, piece) for k, piece in enumerate(edges.pieces) if (piece.feature, piece.cuts) == (number, cuts)]
            out += [f"// {describe_edges(feature)}"] if pieces else []
            for k, piece in pieces:
                out += fold_nary(piece.solid, partial(leaf, int(first[k])), {op: _block(op) for op in OPS})
        return [f"{WHERE_DRAWN} {{", *("  " + line for line in out), "}"] if out else []

    def leaf(start: int, number: int, primitive: Primitive) -> list[str]:
        return _primitive(primitive, rounding, edges.named, start + number, edges.named.centers[start + number])

    filled = [*lines, *write(cuts=False)]
    union = ["union() {", *("  " + line for line in filled), "}"] if len(filled) > len(lines) else filled
    cut = write(cuts=True)
    return ["difference() {", *("  " + line for line in (*union, *cut)), "}"] if cut else union


def to_openscad_loops(folded: Folded, segments: int, named: Parameters) -> str:
    """OpenSCAD text of a program with repeats in its own units, with `$fn` at `segments`, and numbers that follow `named`."""
    program = expand(folded)
    rounding = Rounding.of(program)
    named, aslant = _along_own(named), named.own
    writer = _Writer(rounding, named)
    body = _turn_lines(writer.lines(folded if aslant is None else aslant.directions.turn_folded(folded), 0), aslant)
    head = customizer_head(named, rounding.size)
    return "\n".join([f"$fn = {segments};", "", *head, *writer.modules, *body, "", *_definitions(program)])


def _definitions(program: Program) -> list[str]:
    """What the text ends with: how its outlines are drawn. OpenSCAD knows it all the same, and a person reads the part first."""
    outlines = [leaf.outline for leaf in leaves(program) if leaf.outline]
    drafted = any(leaf.kind == "drafted" for leaf in leaves(program))
    return [OUTLINE + (ELLIPSE if any(map(has_ellipse, outlines)) else "") + (DRAFTED if drafted else "")] if outlines else []


def _primitive(leaf: Primitive, rounding: Rounding, named: Parameters, number: int, center: Sequence[Expression]) -> list[str]:
    """``translate(..) rotate(..) shape(..);``, the identity parts left out; of an outline each loop has a line of its own, where
    walls lean each area. Above it what it is."""
    place = _step("translate", [write_expression(c, rounding.length, circled=True) for c in center])
    place += _step("rotate", [rounding.angle(a) for a in leaf.rotation])
    write = write_areas if leaf.kind == "drafted" else write_loops
    sizes, loops = write_sizes(leaf, named.sizes[number], rounding), write(leaf, named.outlines[number], rounding)
    notes = write_notes(named.notes, number, "//")
    if not loops:
        return [*notes, place + _SHAPE[leaf.kind](*sizes) + ";"]
    head, tail = _SHAPE[leaf.kind](*sizes, "[|]").split("|")
    return [*notes, place + head, *(f"  {loop}," for loop in loops[:-1]), f"  {loops[-1]}", tail + ";"]


def _step(name: str, numbers: list[str]) -> str:
    return "" if all(number == "0" for number in numbers) else f"{name}([{', '.join(numbers)}]) "


def _block(head: str) -> Callable[[list[list[str]]], list[str]]:
    def lines(parts: list[list[str]]) -> list[str]:
        return [f"{head}() {{", *("  " + line for part in parts for line in part), "}"]

    return lines


class _Writer:
    """Writes nodes; `modules` are the definitions of what repeats."""

    def __init__(self, rounding: Rounding, named: Parameters) -> None:
        self._rounding, self._named = rounding, named
        self._loops: Iterator[Loop] = iter(named.loops)
        self.modules: list[str] = []

    def lines(self, node: Folded, first: int, origin: Sequence[Expression] | None = None) -> list[str]:
        """The statements of a node whose first leaf is number `first`; a primitive relative to `origin`."""
        if isinstance(node, Primitive):
            center = self._named.centers[first]
            center = center if origin is None else less(center, origin)
            return _primitive(node, self._rounding, self._named, first, center)
        if isinstance(node, Repeat):
            return [self._repeat(node, first)]
        return _block(node.op)(self._parts(node, first))

    def _parts(self, node: Group, first: int) -> list[list[str]]:
        return [self.lines(part, start) for part, start in starts(node, first)]

    def _repeat(self, repeat: Repeat, first: int) -> str:
        loop = next(self._loops)
        centered = repeat.kind == "circular" and self._vector(loop.center) != "[0, 0, 0]"
        relative = centered and isinstance(repeat.part, Primitive)
        is_union = isinstance(repeat.part, Group) and repeat.part.op == "union"
        origin = loop.center if relative else None
        parts = self._parts(repeat.part, first) if is_union else [self.lines(repeat.part, first, origin)]  # type: ignore[arg-type]
        self.modules += [*_block(f"module {loop.part}")(parts), ""]
        place = self._place(repeat, loop)
        if centered:
            back = "" if relative else f" translate(-{self._vector(loop.center)})"
            place = f"translate({self._vector(loop.center)}) {place}{back}"
        loops = "for" if repeat.join == "union" else "intersection_for"
        return f"{loops} ({self._ranges(repeat, loop)}) {place} {loop.part}();"

    def _ranges(self, repeat: Repeat, loop: Loop) -> str:
        if repeat.kind == "mirror":
            return "i = [0, 1]"
        return ", ".join(f"{i} = [0 : {name} - 1]" for i, name in zip("ij", loop.counts, strict=False))

    def _place(self, repeat: Repeat, loop: Loop) -> str:
        if repeat.kind in ("linear", "grid"):
            return f"translate({self._sums(list(zip('ij', loop.steps, strict=False)))})"
        if repeat.kind == "mirror":
            normal = ", ".join(f"{plain(round(n, 12))}*i" if n not in (0, 1) else "i" if n else "0" for n in repeat.axis)
            shift = self._sums([("i", loop.shift)])
            return (f"translate({shift}) " if shift != "[0, 0, 0]" else "") + f"mirror([{normal}])"
        angle = f"360/{loop.counts[0]}*i" if repeat.is_full else f"{self._rounding.angle(repeat.angle)}*i"
        if max(map(abs, repeat.axis)) < 1:
            return f"rotate(a = {angle}, v = [{', '.join(plain(round(c, 12)) for c in repeat.axis)}])"
        forward = sum(repeat.axis) * (1 if repeat.angle > 0 or not repeat.is_full else -1) > 0
        return f"rotate([{', '.join((angle if forward else '-' + angle) if c else '0' for c in repeat.axis)}])"

    def _sums(self, moves: list[tuple[str, tuple[Expression, ...]]]) -> str:
        """A vector of what is moved for each loop variable."""
        return f"[{write_moves(moves, self._rounding.length, '*')}]"

    def _vector(self, v: Sequence[Expression]) -> str:
        return f"[{', '.join(write_expression(e, self._rounding.length) for e in v)}]"
