"""Whether a rigid motion takes one extruded or turned outline to another, whatever the frames that they are drawn in.

The frame of an outline is arbitrary: the same solid may be drawn about another origin, turned in its plane, from another first vertex, or,
extruded, upside down. What is compared are the curves in space.
"""

from __future__ import annotations

import math
from itertools import islice

from imdim.program.drafting import inset_at_top
from imdim.program.ellipse import Ellipse, are_near_ellipses
from imdim.program.motions import Motion, is_round, move_leaf
from imdim.program.outline import Loop, Outline, Point, Ring, ring_curves
from imdim.program.rewrite.containment import axes
from imdim.program.tree import ACROSS, Primitive, Vec3
from imdim.program.vectors import along, dot, minus


def anchor_of(p: Primitive, outline: Outline) -> Vec3:
    """A point that moves along with the solid: the mean of an extrusion's vertices and of ellipses' centres; of turned ones on the axis,
    or in the middle between the ends."""
    x, y = _mean(outline)
    u, v, w = axes(p)
    if p.kind in ACROSS:
        return along(along(p.center, u, x), v, y)
    at = along(p.center, w, y)
    if is_round(p):
        return at
    middle = math.radians(p.size[0]) / 2
    return along(along(at, u, x * math.cos(middle)), v, x * math.sin(middle))


def _mean(outline: Outline) -> Point:
    vertices = [vertex for loop in outline.loops for vertex in ([(loop.x, loop.y)] if isinstance(loop, Ellipse) else loop)]
    return math.fsum(v[0] for v in vertices) / len(vertices), math.fsum(v[1] for v in vertices) / len(vertices)


def lengths_of(p: Primitive, outline: Outline) -> tuple[float, ...]:
    """Lengths that no motion changes: the height or how far the outermost vertex turns, how far walls lean in, the chords by their length,
    and semi-axes."""
    chords = sorted(math.hypot(u - x, v - y) for ring in outline.rings for x, y, u, v, _ in ring_curves(ring))
    semi_axes = sorted(r for loop in outline.loops if isinstance(loop, Ellipse) for r in sorted((loop.rx, loop.ry)))
    insets = [inset_at_top(*p.size)] if p.kind == "drafted" else []
    return (_length_along(p, outline), *insets, *chords, *semi_axes)


def _length_along(p: Primitive, outline: Outline) -> float:
    """The height, or how far the outermost vertex turns."""
    return math.radians(p.size[0]) * _reach(outline) if p.kind == "revolve" else p.size[0]


def _reach(outline: Outline) -> float:
    """How far vertices lie from the axis of what is turned, and ellipses reach."""
    return max(
        [*(x for ring in outline.rings for x, _, _ in ring), *(e.x + max(e.rx, e.ry) for e in outline.loops if isinstance(e, Ellipse))]
    )


def is_outlined_moved(a: Primitive, b: Primitive, motion: Motion, tolerance: float) -> bool:
    """Whether the motion takes `a` to `b`, no vertex and no middle of an arc being off by more than the tolerance."""
    moved = move_leaf(a, motion)
    assert moved.outline is not None
    assert b.outline is not None
    if not _agrees(_length_along(moved, moved.outline), _length_along(b, b.outline), tolerance):
        return False
    if a.kind == "drafted" and not _agrees(inset_at_top(*a.size), inset_at_top(*b.size), tolerance):
        return False
    loops = _turned_loops(moved, b, tolerance) if b.kind == "revolve" else _extruded_loops(moved, b, tolerance)
    return loops is not None and _same_loops(loops, b.outline.loops, tolerance)


def _agrees(a: float, b: float, tolerance: float) -> bool:
    return abs(a - b) <= tolerance


def _extruded_loops(a: Primitive, b: Primitive, tolerance: float) -> list[Loop] | None:
    """The loops of `a` in the plane of `b`; None where that is another plane, or walls would lean the other way."""
    assert a.outline is not None
    (u, v, w), (x, y, z) = axes(a), axes(b)
    facing = math.copysign(1.0, dot(w, z))
    off = minus(a.center, b.center)

    def place(p: float, q: float) -> Vec3:
        at = along(along(off, u, p), v, q)
        return dot(at, x), dot(at, y), dot(at, z)

    ends = [place(e.x + c * e.rx, e.y + s * e.rx) for e in a.outline.loops if isinstance(e, Ellipse) for c, s in (e.along,)]
    vertices = [place(p, q) for ring in a.outline.rings for p, q, _ in ring]
    if max(abs(height) for _, _, height in (*vertices, *ends)) > tolerance or (facing < 0 and a.kind == "drafted"):
        return None
    placed = iter(vertices)

    def place_loop(loop: Loop) -> Loop:
        if not isinstance(loop, Ellipse):
            return tuple((p, q, facing * bulge) for (_, _, bulge), (p, q, _) in zip(loop, islice(placed, len(loop)), strict=True))
        (c, s), (p, q, _) = loop.along, place(loop.x, loop.y)
        tip = place(loop.x + c, loop.y + s)
        return Ellipse(loop.rx, loop.ry, p, q, math.degrees(math.atan2(tip[1] - q, tip[0] - p)))

    return [place_loop(loop) for loop in a.outline.loops]


def _turned_loops(a: Primitive, b: Primitive, tolerance: float) -> list[Loop] | None:
    """The loops of `a` in the half plane of `b`; None where they turn about another axis, or, less than all around, from elsewhere."""
    assert a.outline is not None
    (u, _, w), (x, y, z) = axes(a), axes(b)
    off, facing = minus(a.center, b.center), math.copysign(1.0, dot(w, z))
    radius = _reach(a.outline)
    beside = math.hypot(dot(off, x), dot(off, y)) + radius * math.dist(w, (facing * z[0], facing * z[1], facing * z[2]))
    if beside > tolerance:
        return None
    if not is_round(b):
        # upside down it would turn the other way: it starts where the other one ends
        start = math.radians(b.size[0]) if facing < 0 else 0.0
        first = along(along((0.0, 0.0, 0.0), x, math.cos(start)), y, math.sin(start))
        if radius * math.dist(u, first) > tolerance:
            return None
    height = dot(off, z)

    def place_loop(loop: Loop) -> Loop:
        if isinstance(loop, Ellipse):
            return Ellipse(loop.rx, loop.ry, loop.x, height + facing * loop.y, facing * loop.angle)
        return tuple((p, height + facing * q, facing * bulge) for p, q, bulge in loop)

    return [place_loop(loop) for loop in a.outline.loops]


def _same_loops(a: list[Loop], b: tuple[Loop, ...], tolerance: float) -> bool:
    left = list(b)
    for loop in a:
        found = next((other for other in left if _same_loop(loop, other, tolerance)), None)
        if found is None:
            return False
        left.remove(found)
    return not left


def _same_loop(a: Loop, b: Loop, tolerance: float) -> bool:
    """Whether two loops run through the same places, from whichever vertex and either way."""
    if isinstance(a, Ellipse) or isinstance(b, Ellipse):
        return isinstance(a, Ellipse) and isinstance(b, Ellipse) and are_near_ellipses(a, b, tolerance)
    if len(a) != len(b):
        return False
    nodes, others = _nodes(a), _nodes(b)
    n = len(others)
    for start in range(0, n, 2):
        if math.dist(nodes[0], others[start]) > tolerance:
            continue
        for way in (1, -1):
            if all(math.dist(p, others[(start + way * i) % n]) <= tolerance for i, p in enumerate(nodes)):
                return True
    return False


def _nodes(loop: Ring) -> list[Point]:
    """The vertices, and after each the middle of its curve."""
    out: list[Point] = []
    for x, y, u, v, bulge in ring_curves(loop):
        out += [(x, y), ((x + u + bulge * (v - y)) / 2, (y + v - bulge * (u - x)) / 2)]
    return out
