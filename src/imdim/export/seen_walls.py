"""Which walls of drawings have a part in the surface of a solid; what others are drawn by is no dimension."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from trimesh import Trimesh

from imdim.export.drawn_vertex import DrawnVertex, numbers_of, numbers_of_bend
from imdim.export.outline_joints import Row
from imdim.export.outline_rows import Drawn, Sum
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.solid import exact_rotation, surface_with_owners
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, arc_center, arc_radius, ring_curves
from imdim.program.tree import Primitive, Program, leaves, longest

LEVEL = 1e-6  # of the largest size, within which a triangle lies in a wall
TURN = 2.5 * math.pi / CHECK_SEGMENTS  # by which a facet of a round wall may be turned from it
ALONG = 1e-3  # the cosine between a normal and what is square to it
TRACE = 1e-6  # of the surface: less of a wall is what rounding leaves of it

Wall = tuple[int, int, int]  # leaf, loop, curve


def rows_of_walls(drawn: Mapping[int, Drawn], program: Program) -> Iterator[tuple[Row, bool]]:
    """The sums of variables by which outlines are drawn, and whether a wall that they move is seen."""
    hidden, parts = find_hidden_walls(program), list(leaves(program))
    for leaf, loops in drawn.items():
        outline = parts[leaf].outline
        assert outline is not None
        for n, (loop, ring) in enumerate(zip(loops, outline.loops, strict=True)):
            if isinstance(loop, tuple) and not isinstance(ring, Ellipse) and parts[leaf].kind == "extrude":
                curves = ring_curves(ring)
                seen = [(leaf, n, k) not in hidden for k in range(len(curves))]
                yield from (row for k, v in enumerate(loop) for row in _rows_of_vertex(v, k, curves, seen))
            else:
                yield from ((number.row, True) for number in numbers_of(loop))


def _rows_of_vertex(vertex: DrawnVertex[Sum], k: int, curves: Sequence[Curve], seen: Sequence[bool]) -> Iterator[tuple[Row, bool]]:
    """A line moves across itself alone, and an arc that has a centre with that and its radius: where they end is where the other one is."""
    beside, reach = [(curves[j], seen[j]) for j in (k - 1, k)], vertex.reach
    for axis, number in enumerate((vertex.x, vertex.y)):
        moved = beside if reach is None else [(c, shows) for c, shows in beside if bool(c[4]) == (axis == reach.axis)]
        yield number.row, any(shows and (c[4] != 0 or c[1 - axis] != c[3 - axis]) for c, shows in moved)
    yield from ((number.row, seen[k]) for number in numbers_of_bend(vertex.bulge))
    if reach is not None:
        yield reach.radius.row, any(shows for c, shows in beside if c[4])


class _Facets(NamedTuple):
    """Triangles near an extrusion, in its frame: their middles [n, 2] and normals [n, 2] across its axis, and areas [n]; near what is
    turned those in the half plane beside its axis, and by how much a `chord` there misses its circle."""

    middles: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    chord: float = 0.0


@lru_cache(maxsize=4)
def surface_of(program: Program) -> tuple[Trimesh, np.ndarray]:
    """Its surface, and the leaf that made each face."""
    return surface_with_owners(program, CHECK_SEGMENTS)


@lru_cache(maxsize=4)
def find_hidden_walls(program: Program) -> frozenset[Wall]:
    """The walls of extrusions, and of what is turned, of which nothing is seen."""
    parts = list(leaves(program))
    surface, _ = surface_of(program)
    slack, least = LEVEL * longest(parts), TRACE * surface.area
    found = set[Wall]()
    for i, part in enumerate(parts):
        if part.outline is not None:
            near = _facets_near if part.kind == "extrude" else _facets_about
            facets = near(part, surface.triangles_center, surface.face_normals, surface.area_faces, slack)
            rings = [() if isinstance(loop, Ellipse) else ring_curves(loop) for loop in part.outline.loops]
            walls = ((n, k, curve) for n, ring in enumerate(rings) for k, curve in enumerate(ring))
            found |= {(i, n, k) for n, k, curve in walls if facets.areas[_lie_in(curve, facets, slack + facets.chord)].sum() <= least}
    return frozenset(found)


def _facets_near(part: Primitive, middles: np.ndarray, normals: np.ndarray, areas: np.ndarray, slack: float) -> _Facets:
    """Those of triangles [n] that look across the axis of an extrusion and lie in its box."""
    assert part.outline is not None
    turn = exact_rotation(part)
    local = (middles - np.array(part.center)) @ turn
    low, high = (np.array([*corner, side * part.size[0] / 2]) for corner, side in zip(part.outline.bounds, (-1, 1), strict=True))
    near = ((local >= low - slack) & (local <= high + slack)).all(1) & (np.abs(normals @ turn[:, 2]) < ALONG)
    return _Facets(local[near, :2], (normals[near] @ turn)[:, :2], areas[near])


def _facets_about(part: Primitive, middles: np.ndarray, normals: np.ndarray, areas: np.ndarray, slack: float) -> _Facets:
    """Those of triangles [n] that lie in the box around an outline that is turned."""
    assert part.outline is not None
    turn, (low, high) = exact_rotation(part), part.outline.bounds
    local, facing = (middles - np.array(part.center)) @ turn, normals @ turn
    reach, chord = np.hypot(local[:, 0], local[:, 1]), high[0] * (1 - math.cos(math.pi / CHECK_SEGMENTS))
    flat = np.column_stack([reach, local[:, 2]])
    way = np.sign((local[:, :2] * facing[:, :2]).sum(1))
    out = np.column_stack([np.hypot(facing[:, 0], facing[:, 1]) * way, facing[:, 2]])
    near = ((flat >= np.array(low) - slack - chord) & (flat <= np.array(high) + slack)).all(1)
    return _Facets(flat[near], out[near], areas[near], chord)


def _lie_in(curve: Curve, facets: _Facets, slack: float) -> np.ndarray:
    """Which facets [n] lie in the wall over a curve, however long."""
    x, y, u, v, bulge = curve
    if not bulge:
        way = np.array([u - x, v - y]) / math.hypot(u - x, v - y)
        off = (facets.middles - (x, y)) @ (way[1], -way[0])
        return (np.abs(off) <= slack) & (np.abs(facets.normals @ way) < ALONG)
    radius, away = arc_radius(curve), facets.middles - arc_center(curve)
    reach = np.linalg.norm(away, axis=1)
    chord = radius * (1 - math.cos(math.pi / CHECK_SEGMENTS)) + slack
    cosines = np.abs((facets.normals * away).sum(1)) / np.maximum(reach, slack)
    return (np.abs(reach - radius) <= 2 * chord) & (cosines > math.cos(TURN))
