"""The plane faces of a primitive, and how it is extended past them: a prism keeps its section, a cone and drafted walls their slope."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from imdim.geometry.finish.section import extent, inset
from imdim.geometry.solid import exact_rotation
from imdim.program.drafting import inset_at_top, shrink
from imdim.program.tree import FLAT_ENDS, PLANE_ENDS, Primitive

SHRINK = 2e-3  # fraction of a radius by which regions are narrower than their face, more than the sagitta at `section.CHECK_SEGMENTS`

Face = tuple[int, int]  # local axis, and +1 or -1 for the end on it


def plane_faces(leaf: Primitive) -> Iterator[Face]:
    """The plane faces that have an area: six of a box, the ends of a cylinder, cone or extrusion."""
    faces = ((axis, side) for axis in FLAT_ENDS.get(leaf.kind, ()) for side in (-1, 1))
    yield from (face for face in faces if leaf.kind != "cone" or _end_radii(leaf, face[1])[0] > 0)


def plane_face(name: str) -> Face | None:
    """The face that an edge names like ``+z``; None for a wall or a side."""
    return ("xyz".index(name[1]), 1 if name[0] == "+" else -1) if name[0] in "+-" else None


def flip_face(face: Face) -> Face:
    """The face of a mirror image, which is turned so that its local x is the other way."""
    return (0, -face[1]) if face[0] == 0 else face


def length(leaf: Primitive, face: Face) -> float:
    """Size of the leaf across `face`."""
    return leaf.size[PLANE_ENDS[leaf.kind][face[0]]]


def apex(leaf: Primitive, face: Face) -> float:
    """How far outward of `face` a cone has its apex; infinite where it widens, and for the other kinds."""
    slope = _slope(leaf, face) if leaf.kind == "cone" else 0.0
    return _end_radii(leaf, face[1])[0] / -slope if slope < 0 else math.inf


def between(leaf: Primitive, face: Face, low: float, high: float) -> Primitive:
    """The part of `leaf`, prolonged past `face`, from `low` to `high` measured outward from that face; a cone keeps its slope.

    A cone ends at its apex at the latest. Raises ValueError where walls with a draft meet before.
    """
    axis, side = face
    high = min(high, apex(leaf, face))
    shift = side * (length(leaf, face) + low + high) / 2
    x, y, z = (c + float(d) * shift for c, d in zip(leaf.center, exact_rotation(leaf)[:, axis], strict=True))
    if leaf.kind == "drafted" and leaf.outline is not None:
        foot = low + leaf.size[0] if side > 0 else -high
        drawn = shrink(leaf.outline, inset_at_top(foot, leaf.size[1]))
        return replace(leaf, size=(high - low, leaf.size[1]), center=(x, y, z), outline=drawn)
    return replace(leaf, size=_size_between(leaf, face, low, high), center=(x, y, z))


def beyond(leaf: Primitive, face: Face, skin: float, high: float) -> Primitive:
    """The region outward of `face`, from `skin` to `high`."""
    return _narrow(between(leaf, face, skin, high), face, skin)


def within(leaf: Primitive, face: Face, skin: float) -> Primitive:
    """The region from two skins to one behind `face`.

    As narrow as the face itself, although a cone is wider there: another cutter that meets the rim covers it.
    """
    widening = max(-_slope(leaf, face), 0.0) if leaf.kind == "cone" else 0.0  # of the radius, per unit of depth
    return _narrow(between(leaf, face, -2 * skin, -skin), face, skin * (1 + 2 * widening))


def _end_radii(cone: Primitive, side: int) -> tuple[float, float]:
    """Radius at the end on `side`, and at the other."""
    bottom, top, _ = cone.size
    return (top, bottom) if side > 0 else (bottom, top)


def _slope(cone: Primitive, face: Face) -> float:
    here, other = _end_radii(cone, face[1])
    return (here - other) / cone.size[2]


def _size_between(leaf: Primitive, face: Face, low: float, high: float) -> tuple[float, ...]:
    axis, side = face
    if leaf.kind == "box":
        return (*leaf.size[:axis], high - low, *leaf.size[axis + 1 :])
    if leaf.kind == "cylinder":
        return (leaf.size[0], high - low)
    if leaf.kind == "extrude":
        return (high - low,)
    here, slope = _end_radii(leaf, side)[0], _slope(leaf, face)
    inner, outer = max(here + slope * low, 0.0), max(here + slope * high, 0.0)
    return (inner, outer, high - low) if side > 0 else (outer, inner, high - low)


def _narrow(region: Primitive, face: Face, rim: float) -> Primitive:
    """The region without its rim, where coarser circles and lateral skins would decide."""
    if region.kind == "box":
        return replace(region, size=tuple(s if axis == face[0] else max(s - 2 * rim, s / 2) for axis, s in enumerate(region.size)))
    if region.outline is not None:
        return inset(region, SHRINK * extent(region.outline) + rim)
    radii = tuple(max(r * (1 - SHRINK) - rim, r / 2) for r in region.size[:-1])
    return replace(region, size=(*radii, region.size[-1]))
