"""Outlined leaves that are one of the six kinds that numbers alone describe: a rectangle extruded is a box, a circle a cylinder."""

from __future__ import annotations

import math

from imdim.program.drafting import inset_at_top
from imdim.program.ellipse import Ellipse
from imdim.program.motions import euler
from imdim.program.outline import Loop, Point, Ring, circle_of
from imdim.program.rewrite.containment import axes
from imdim.program.tree import FULL_TURN, Primitive
from imdim.program.vectors import along

SQUARE = 1e-9  # of an edge: how far the corners of a rectangle may be off


def to_simple(leaf: Primitive) -> Primitive | None:
    """The leaf as one of the six kinds; None for an outline that is none of them alone."""
    if leaf.outline is None:
        return leaf
    loop, *others = leaf.outline.loops
    if others or isinstance(loop, Ellipse):
        return None
    if leaf.kind == "drafted":
        return _drafted_circle(leaf, loop)
    if leaf.kind == "extrude":
        return _extruded_circle(leaf, loop) or _extruded_rectangle(leaf, loop)
    return (_turned_circle(leaf, loop) or _turned_rectangle(leaf, loop)) if leaf.size[0] == FULL_TURN else None


def _extruded_circle(leaf: Primitive, loop: Loop) -> Primitive | None:
    circle = circle_of(loop)
    if circle is None:
        return None
    x, y, radius = circle
    return Primitive("cylinder", (radius, leaf.size[0]), _moved(leaf, (x, y, 0.0)), leaf.rotation)


def _drafted_circle(leaf: Primitive, loop: Loop) -> Primitive | None:
    circle = circle_of(loop)
    if circle is None:
        return None
    x, y, radius = circle
    return Primitive("cone", (radius, radius - inset_at_top(*leaf.size), leaf.size[0]), _moved(leaf, (x, y, 0.0)), leaf.rotation)


def _extruded_rectangle(leaf: Primitive, loop: Ring) -> Primitive | None:
    """A box; one whose edges lean in the plane of the outline is turned by as much more."""
    found = _rectangle(loop)
    if found is None:
        return None
    (x, y), (ux, uy), width, height = found
    center = _moved(leaf, (x, y, 0.0))
    if uy == 0 or ux == 0:
        size = (width, height) if uy == 0 else (height, width)
        return Primitive("box", (*size, leaf.size[0]), center, leaf.rotation)
    u, v, w = axes(leaf)
    side = along((ux * u[0], ux * u[1], ux * u[2]), v, uy)
    other = along((-uy * u[0], -uy * u[1], -uy * u[2]), v, ux)
    return Primitive("box", (width, height, leaf.size[0]), center, euler(side, other, w))


def _turned_circle(leaf: Primitive, loop: Loop) -> Primitive | None:
    circle = circle_of(loop)
    if circle is None:
        return None
    major, height, minor = circle
    return Primitive("torus", (max(major, minor), minor), _moved(leaf, (0.0, 0.0, height)), leaf.rotation)


def _turned_rectangle(leaf: Primitive, loop: Ring) -> Primitive | None:
    """A cylinder, where one edge is on the axis."""
    found = _rectangle(loop)
    if found is None or min(x for x, _, _ in loop) != 0:
        return None
    (x, z), (ux, uz), width, height = found
    if ux != 0 and uz != 0:
        return None
    return Primitive("cylinder", (2 * x, height if uz == 0 else width), _moved(leaf, (0.0, 0.0, z)), leaf.rotation)


def _rectangle(loop: Ring) -> tuple[Point, Point, float, float] | None:
    """Middle, direction of the first edge, and both edges of a loop that is a rectangle."""
    if len(loop) != 4 or any(bulge for _, _, bulge in loop):
        return None
    a, b, c, d = ((x, y) for x, y, _ in loop)
    width, height = math.dist(a, b), math.dist(b, c)
    skew = abs((b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])) / max(width, height)
    if math.dist((a[0] + c[0], a[1] + c[1]), (b[0] + d[0], b[1] + d[1])) > SQUARE * width or skew > SQUARE * min(width, height):
        return None
    return ((a[0] + c[0]) / 2, (a[1] + c[1]) / 2), ((b[0] - a[0]) / width, (b[1] - a[1]) / width), width, height


def _moved(leaf: Primitive, local: tuple[float, float, float]) -> tuple[float, float, float]:
    """The place of a local point."""
    at = leaf.center
    for axis, shift in zip(axes(leaf), local, strict=True):
        at = along(at, axis, shift)
    return at
