"""Outlines as the texts write them: lists of loops, of vertices ``[x, y]`` from which a line runs, and ``[x, y, bulge]`` for an arc.

A circle is ``ring(r, x, y)``, an ellipse ``ellipse(rx, ry, x, y, angle)`` and a regular polygon ``ngon(sides, r, x, y, angle)``
or ``across_flats(sides, width, x, y, angle)``, functions
of each text. In place of a bulge a vertex
may have ``[x, y, way]``, the centre that the arc runs about and 1 for counter-clockwise or -1; ``[r, way]``, its radius, and if both its
ends are written at one place, that is its centre, and the lines beside it touch it; ``[r]`` if it rounds the corner that is written at
both; ``"before"`` or ``"after"``, the curve that it touches, ``"cusp before"`` or ``"cusp after"`` where it comes back along that;
or ``bend(angle)``, the degrees by which it turns. ``reach(r, d)`` is how far a circle reaches along a line at a distance from its centre.
`bends` works them out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction

from imdim.export.drawn_vertex import Bend, BendAngle, BendRadius, Center, DrawnPolygon, DrawnVertex, Touching, turn_round
from imdim.export.numbers import SIGNIFICANT_DIGITS, Expression, Rounding, plain, weighted_sum, write_expression
from imdim.export.parameters import DrawnLoop, constant_loop
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, loop_area, regions, reverse_loop
from imdim.program.tree import Primitive


def write_loops(leaf: Primitive, drawn: Sequence[DrawnLoop], rounding: Rounding) -> list[str]:
    """The loops of an outlined leaf, of the expressions that `drawn` says; nothing for other leaves."""
    return [_loop(loop, 1.0, rounding) for _, loop in pair_loops(leaf, drawn, rounding)] if leaf.outline else []


def write_regions(leaf: Primitive, drawn: Sequence[DrawnLoop], rounding: Rounding) -> list[str]:
    """Of each separate area of an outlined leaf the outer loop and its holes, as a list; nothing for other leaves."""
    outline = rounding.primitive(leaf).outline
    if outline is None:
        return []
    pairs = dict(pair_loops(leaf, drawn, rounding))
    oriented = pairs | {reverse_loop(loop): _reversed(written) for loop, written in pairs.items()}
    return [_list(_loop(oriented[loop], _way(loop), rounding) for loop in region) for region in regions(outline)]


def write_areas(leaf: Primitive, drawn: Sequence[DrawnLoop], rounding: Rounding) -> list[str]:
    """As `write_regions`, of a drafted leaf in the order of its loops: reading them gives that back."""
    areas: list[list[str]] = []
    for loop, written in pair_loops(leaf, drawn, rounding):
        if loop_area(loop) > 0:
            areas.append([])
        areas[-1].append(_loop(written, _way(loop), rounding))
    return list(map(_list, areas))


def _way(loop: Loop) -> float:
    return 1.0 if isinstance(loop, Ellipse) else loop[0][2]


def pair_loops(leaf: Primitive, drawn: Sequence[DrawnLoop], rounding: Rounding) -> list[tuple[Loop, DrawnLoop]]:
    """The rounded loops of an outlined leaf and what is written for them: numbers where rounding left out curves."""
    rounded = rounding.primitive(leaf).outline
    assert rounded is not None
    fewer = any(isinstance(ring, tuple) and len(loop) != len(ring) for loop, ring in zip(rounded.loops, drawn, strict=False))
    if fewer or len(rounded.loops) != len(drawn):
        drawn = list(map(constant_loop, rounded.loops))
    return list(zip(rounded.loops, drawn, strict=True))


def _reversed(loop: DrawnLoop) -> DrawnLoop:
    """As `reverse_loop` has it; the corners of a regular polygon follow from its centre, either way, and an ellipse has none."""
    if not isinstance(loop, tuple):
        return loop
    bulges = [turn_round(v.bulge) for v in reversed(loop)]
    return tuple(replace(v, bulge=b) for v, b in zip([loop[0], *reversed(loop[1:])], bulges, strict=True))


def _loop(loop: DrawnLoop, way: float, rounding: Rounding) -> str:
    """The vertices, or the ring that has just these, its bulges being `way`."""

    def write(e: Expression) -> str:
        return write_expression(e, rounding.length)

    if not isinstance(loop, tuple):
        *lengths, angle = loop.numbers()
        written = [*map(write, lengths), write_expression(angle, rounding.angle)]
        while written[-1] == "0":
            written.pop()
        return f"{loop.function if isinstance(loop, DrawnPolygon) else 'ellipse'}({', '.join(written)})"
    ring = circle_sums(loop, way)
    if ring is not None:
        written = list(map(write, ring))
        return f"ring({', '.join(written[:1] if written[1:] == ['0', '0'] else written)})"
    return _list(_list(_vertex(v, rounding)) for v in loop)


def circle_sums(loop: DrawnLoop, way: float) -> tuple[Expression, Expression, Expression] | None:
    """Radius and centre of a loop of two half arcs whose bulges are `way`; None for any other."""
    if not isinstance(loop, tuple) or len(loop) != 2 or abs(way) != 1:
        return None
    if not (loop[0].bulge == loop[1].bulge == way and loop[0].y == loop[1].y):
        return None
    (a, b), half = (v.x for v in loop), Fraction(1, 2)
    radius, x = weighted_sum((b, half), (a, -half)), weighted_sum((a, half), (b, half))
    return (radius, x, loop[0].y) if radius.constant >= 0 else None


def _vertex(v: DrawnVertex[Expression], rounding: Rounding) -> list[str]:
    def write(e: Expression) -> str:
        return write_expression(e, rounding.length)

    at = [write(v.x), write(v.y)]
    if v.reach is not None:
        from_center = f"{'-' if v.reach.sign < 0 else ''}reach({write(v.reach.radius)}, {write(v.reach.off)})"
        center = at[v.reach.axis]
        at[v.reach.axis] = from_center if center == "0" else f"{center} + {from_center}".replace("+ -", "- ")
    return [*at, *_bend(v.bulge, rounding)]


def _bend(bend: Bend[Expression], rounding: Rounding) -> list[str]:
    """How the curve from a vertex bends, nothing for a line."""
    if isinstance(bend, Center):
        return [_list([*(write_expression(e, rounding.length) for e in (bend.x, bend.y)), str(bend.way)])]
    if isinstance(bend, BendRadius):
        return [_list([write_expression(bend.radius, rounding.length), *([str(bend.way)] if bend.way else [])])]
    if isinstance(bend, BendAngle):
        return [f"{'-' if bend.way < 0 else ''}bend({write_expression(bend.angle, rounding.angle)})"]
    if isinstance(bend, Touching):
        return [f'"{bend.word}"']
    bulge = round(bend, SIGNIFICANT_DIGITS)
    return [plain(bulge)] if bulge else []


def _list(texts: Iterable[str]) -> str:
    return f"[{', '.join(texts)}]"
