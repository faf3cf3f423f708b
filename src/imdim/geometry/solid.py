"""Exact solids: programs and meshes as manifold3d solids, whose booleans are the referee of every other backend.

Curved primitives are inscribed polyhedra with `segments` edges per circle, as in OpenSCAD: at 96 segments a cylinder lacks 0.07 % of its
volume and a sphere 0.3 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from manifold3d import CrossSection, Error, FillRule, Manifold, Mesh64, OpType, triangulate

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.drafting import inset_at_top, shrink
from imdim.program.motions import is_round
from imdim.program.nary import fold_nary
from imdim.program.outline import Outline, Ring, arc_center, arc_radius, curve_distance, flatten_loop, ring_curves
from imdim.program.tree import FULL_TURN, Op, Primitive, Program, leaves, longest

if TYPE_CHECKING:
    import trimesh  # half a second, which the process that writes STEP does without

SEGMENTS = 96
GRID = 1e-9  # of the power of ten above the largest size, in steps of which corners lie
TOUCHING = 5  # steps that places along an axis are apart at most where they are one: rounding alone may part what is a digit apart
ALONG = 1e-9  # of the cosine of a right angle, or none
CRUMB = 1e-7  # of the volume: a smaller piece is what booleans leave of faces that touch
KEPT = 32  # solids: one step asks for what the steps before it made
SWEEPS_KEPT = 256  # drawings that are extruded or turned

_LOCAL: Mapping[str, Callable[[tuple[float, ...], int], Manifold]] = {
    "box": lambda s, n: Manifold.cube((s[0], s[1], s[2]), True),
    "sphere": lambda s, n: Manifold.sphere(s[0], n),
    "cylinder": lambda s, n: Manifold.cylinder(s[1], s[0], s[0], n, True),
    "cone": lambda s, n: Manifold.cylinder(s[2], s[0], s[1], n, True),
    "torus": lambda s, n: CrossSection.circle(s[1], n).translate((s[0], 0.0)).revolve(n),
    "ellipsoid": lambda s, n: Manifold.sphere(1.0, n).scale((s[0], s[1], s[2])),
}

COMBINE: Mapping[Op, Callable[[list[Manifold]], Manifold]] = {
    "union": lambda parts: Manifold.batch_boolean(parts, OpType.Add),
    "intersection": lambda parts: Manifold.batch_boolean(parts, OpType.Intersect),
    "difference": lambda parts: Manifold.batch_boolean(parts, OpType.Subtract),
}


def primitive_to_manifold(primitive: Primitive, segments: int = SEGMENTS) -> Manifold:
    """One placed primitive as an inscribed polyhedron."""
    return _place(primitive, exact_rotation(primitive), np.array(primitive.center), segments)


def _place(primitive: Primitive, rotation: np.ndarray, center: np.ndarray, segments: int) -> Manifold:
    """A primitive turned by a `rotation` [3, 3] of its own, not that which it has, at a `center` [3]."""
    placement = np.column_stack([rotation, center])
    if primitive.outline is None:
        return _LOCAL[primitive.kind](primitive.size, segments).transform(placement)
    return _sweep(primitive.kind, primitive.size, primitive.outline, segments).transform(placement)


@lru_cache(SWEEPS_KEPT)
def _sweep(kind: str, size: tuple[float, ...], outline: Outline, segments: int) -> Manifold:
    """An outline about its own origin, extruded as high or turned by as many degrees as the `size` says. It is placed in a moment; trials
    have most of their drawings in common."""
    if kind == "drafted":
        return _loft(outline, shrink(outline, inset_at_top(*size)), size[0], segments)
    section, extent = draw_section(outline, segments), size[0]
    if kind == "extrude":
        return section.extrude(extent).translate((0.0, 0.0, -extent / 2))
    # manifold3d takes all of these for the part of the turn, OpenSCAD its share of them
    divisions = max(3, math.floor(segments * extent / FULL_TURN + 1e-9))
    return section.revolve(divisions, extent)


def _loft(foot: Outline, top: Outline, height: float, segments: int) -> Manifold:
    """The solid between two outlines of which one is the other with its walls moved inward: its walls are flat from facet to facet."""
    below = [np.array(flatten_loop(ring, segments)) for ring in foot.rings]
    above = [_move_corners(*rings) for rings in zip(below, foot.rings, top.rings, strict=True)]
    count = sum(map(len, below))
    starts = np.repeat(np.cumsum([0, *map(len, below[:-1])]), [*map(len, below)])
    lengths = np.repeat([*map(len, below)], [*map(len, below)])
    at = np.arange(count)
    after = starts + (at - starts + 1) % lengths
    walls = np.concatenate([np.column_stack([at, after, after + count]), np.column_stack([at, after + count, at + count])])
    caps = np.concatenate([triangulate(below)[:, ::-1], triangulate(above) + count])
    half = np.full(count, height / 2)
    corners = np.concatenate([np.column_stack([np.concatenate(below), -half]), np.column_stack([np.concatenate(above), half])])
    return solid_of(corners, np.concatenate([walls, caps]))


def _move_corners(corners: np.ndarray, foot: Ring, top: Ring) -> np.ndarray:
    """Where corners [n, 2] of a flattened ring come to lie on another one, whose arcs have the same centres."""
    arcs = [(one, other) for one, other in zip(ring_curves(foot), ring_curves(top), strict=True) if one[4]]
    vertices = {(x, y): (u, v) for (x, y, _), (u, v, _) in zip(foot, top, strict=True)}
    out = []
    for corner in map(tuple, corners.tolist()):
        if corner in vertices:
            out.append(vertices[corner])
            continue
        one, other = min(arcs, key=lambda pair: curve_distance(pair[0], corner))
        (x, y), share = arc_center(one), arc_radius(other) / arc_radius(one)
        out.append((x + (corner[0] - x) * share, y + (corner[1] - y) * share))
    return np.array(out)


def draw_section(outline: Outline, segments: int) -> CrossSection:
    """The plane region with `segments` edges per circle."""
    return CrossSection([np.array(flatten_loop(loop, segments)) for loop in outline.loops], FillRule.EvenOdd)


def join_touching(program: Program, segments: int = SEGMENTS) -> Manifold:
    """As `to_manifold`; corners lie on a grid, as in OpenSCAD, and those a few steps apart along an axis lie at one place: faces that are
    one to the digits of floats, and drawn ones to the 27 bits behind the point that sections keep of them, touch. The axes are those that
    most primitives lie along, since a grid parts faces that lean to it, and from which the corners of round ones begin."""
    axes = _find_common_axes(program)
    own = [_find_own_rotation(leaf, axes) for leaf in leaves(program)]
    parts = [_place(leaf, turn, axes.T @ leaf.center, segments) for leaf, turn in zip(leaves(program), own, strict=True)]
    step = GRID * 10.0 ** math.ceil(math.log10(longest(leaves(program))))
    known = [np.unique(places) for places in np.vstack([corners_of(part) for part in parts]).T]
    shared = [_share_places(places, step) for places in known]

    def place(corners: np.ndarray) -> np.ndarray:
        places = zip(shared, known, corners.T, strict=True)
        return np.column_stack([to[np.searchsorted(of, along)] for to, of, along in places])

    joined = fold_nary(program, lambda i, _: parts[i].warp_batch(place), COMBINE)
    return joined.transform(np.column_stack([axes, np.zeros(3)]))


def _find_common_axes(program: Program) -> np.ndarray:
    """The axes that most primitives lie along, as the columns of a rotation [3, 3]: those of the world unless others are more often. Round
    ones lie along any that hold their axis."""
    rest, best, most = np.array([exact_rotation(leaf) for leaf in leaves(program) if not is_round(leaf)]), np.eye(3), 0
    axes = best
    while len(rest) > most:
        along = _lies_along(axes.T @ rest).all(1)
        if along.sum() > most:
            best, most = axes, int(along.sum())
        rest = rest[~along]
        axes = rest[0] if len(rest) else axes
    return best


def _find_own_rotation(leaf: Primitive, axes: np.ndarray) -> np.ndarray:
    """How a leaf is turned within `axes` [3, 3]; by right angles alone where it lies along them but for the digits of floats."""
    turn = axes.T @ exact_rotation(leaf)
    along = _lies_along(turn)
    if along.all():
        return np.round(turn)
    if not is_round(leaf) or not along[2]:
        return turn
    z = np.round(turn[:, 2])
    return np.column_stack([np.roll(z, 1), np.roll(z, 2), z]) * (1.0, z.sum(), 1.0)


def _lies_along(turns: np.ndarray) -> np.ndarray:
    """Which axes of rotations [..., 3, 3] lie along those that they are turned from, bool [..., 3]."""
    return np.abs(turns - np.round(turns)).max(-2) < ALONG


def _share_places(places: np.ndarray, step: float) -> np.ndarray:
    """The places [n] on the grid that sorted ones [n] get, those at most TOUCHING steps apart one."""
    groups = np.concatenate([[0], np.cumsum(np.diff(places) > TOUCHING * step)])
    first = np.searchsorted(groups, np.arange(groups[-1] + 1))
    return (np.round(places[first] / step) * step)[groups]


def to_manifold(program: Program, segments: int = SEGMENTS) -> Manifold:
    """The exact solid of `program`, with `segments` edges per circle; empty where the program is empty."""
    # a primitive is made in a moment, and takes no other's place among those that are kept
    return _make(program, segments) if isinstance(program, Primitive) else _make_once(program, segments)


def _make(program: Program, segments: int) -> Manifold:
    solid = fold_nary(program, lambda _, primitive: primitive_to_manifold(primitive, segments), COMBINE)
    solid.status()  # makes it now: what is put off may be made in another order with what it is combined with
    return solid


_make_once = lru_cache(KEPT)(_make)


def time_solid(program: Program, now: Callable[[], float]) -> float:
    """How many seconds of the clock `now` the exact solid of a program takes to be made anew."""
    begun = now()
    _make(program, SEGMENTS)
    return now() - begun


def exact_rotation(primitive: Primitive) -> np.ndarray:
    """The rotation matrix [3, 3] with the noise of right angles removed, so that coincident faces stay coincident."""
    rotation = matrix_from_euler(primitive.rotation)
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < 1e-15, nearest, rotation)


def mesh_to_manifold(mesh: trimesh.Trimesh) -> Manifold:
    """The solid that a closed, outward oriented mesh bounds.

    Vertices at the same place are merged: exactly first, then, if that leaves it open, on a grid of 1e-6 of the diagonal.
    Raises ValueError that names the reason when the mesh is not a closed manifold or encloses no volume.
    """
    vertices = np.asarray(mesh.vertices, np.float64)
    if not len(mesh.faces) or not np.isfinite(vertices).all():
        raise ValueError(f"mesh of {len(vertices)} vertices and {len(mesh.faces)} faces bounds no solid: it is empty or not finite")
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    solid = _merge_vertices(mesh, vertices)
    if solid.status() != Error.NoError:
        solid = _merge_vertices(mesh, np.round(vertices / max(diagonal * 1e-6, 1e-300)))
    if solid.status() != Error.NoError:
        raise ValueError(f"mesh of {len(mesh.faces)} faces is not a closed manifold: {solid.status().name}")
    if solid.volume() <= 0:
        raise ValueError(f"mesh of {len(mesh.faces)} faces encloses no volume: {solid.volume():g}")
    return solid


def _merge_vertices(mesh: trimesh.Trimesh, keys: np.ndarray) -> Manifold:
    """A solid whose vertices with equal rows of `keys` [v, 3] are one; faces that thereby collapse are dropped."""
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return solid_of(np.asarray(mesh.vertices, np.float64)[first], drop_collapsed(inverse.reshape(-1)[np.asarray(mesh.faces)]))


def drop_collapsed(faces: np.ndarray) -> np.ndarray:
    """The faces with three different corners."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def solid_of(vertices: np.ndarray, faces: np.ndarray) -> Manifold:
    """The solid of a mesh whose equal vertices are one; its status says where there is none."""
    return Manifold(Mesh64(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.uint64)))


def to_trimesh(solid: Manifold) -> trimesh.Trimesh:
    """The surface of a solid, in double precision, one shared vertex per corner."""
    return _trimesh(solid.to_mesh64())


def _trimesh(mesh: Mesh64) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(np.array(mesh.vert_properties, np.float64)[:, :3], np.array(mesh.tri_verts, np.int64), process=False)


def corners_of(solid: Manifold) -> np.ndarray:
    """The corners [n, 3] of a solid, in double precision."""
    return np.asarray(solid.to_mesh64().vert_properties, np.float64)[:, :3]


def bounds_of(solid: Manifold) -> np.ndarray:
    """Low and high corner [2, 3] of a solid's box."""
    return np.reshape(solid.bounding_box(), (2, 3))


def without_slivers(solid: Manifold, tolerance: float) -> Manifold:
    """The solid without edges shorter than a tolerance and facets thinner than it. It stays as it is where manifold3d spoils it by that, as
    seen where parts touch up to rounding: more of the volume is lost than a surface that moves by the tolerance can hold."""
    clean = solid.simplify(tolerance)
    return clean if abs(clean.volume() - solid.volume()) <= tolerance * solid.surface_area() else solid


def surface_with_owners(program: Program, segments: int = SEGMENTS) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The surface of `program`, and for each of its faces [f] the number of the leaf that made it."""
    owners: dict[int, int] = {}

    def own(leaf: int, primitive: Primitive) -> Manifold:
        solid = primitive_to_manifold(primitive, segments).as_original()
        owners[solid.original_id()] = leaf
        return solid

    mesh = fold_nary(program, own, COMBINE).to_mesh64()
    runs = np.diff(np.array(mesh.run_index, np.int64)) // 3
    leaves = np.array([owners[i] for i in mesh.run_original_id], np.int64)
    return _trimesh(mesh), np.repeat(leaves, runs)


def volume(program: Program, segments: int = SEGMENTS) -> float:
    """Volume of the inscribed solid of `program`, in cubed model units."""
    return to_manifold(program, segments).volume()


def volume_iou(a: Manifold, b: Manifold) -> float:
    """Volume of the intersection over volume of the union, 0 to 1; 0 when both are empty."""
    # each by itself first: booleans that were put off are done in another order, which goes wrong where many faces coincide
    both = a.volume() + b.volume()
    common = (a ^ b).volume()
    joined = both - common
    return min(common / joined, 1.0) if joined > 0 else 0.0


def symmetric_difference_volume(a: Manifold, b: Manifold) -> float:
    """Volume that one of two solids holds and the other does not, up to rounding of either's own."""
    # each by itself first, as there
    both = a.volume() + b.volume()
    return both - 2 * (a ^ b).volume()
