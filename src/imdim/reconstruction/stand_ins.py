"""Primitives that stand for a chamfer or a fillet: tilted boxes, cones and prisms whose whole effect is slivers along edges.

A search that has no word for a bevel along one edge cuts it with a box. What that does is known exactly, so it is read off the solids
with and without the primitive: each piece in which they differ shows one narrow plane between two others. Those of boxes and prisms become
edge features of the program without them, where that is the same solid; the round ones are left, as lone round edges are.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.detection.blends import Blend, Chain
from imdim.geometry import kernels
from imdim.geometry.census import find_pieces
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.finish.active_zone import zone_within
from imdim.geometry.finish.extend import plane_faces
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.holes import find_holes
from imdim.geometry.solid import SEGMENTS, bounds_of, exact_rotation, to_manifold, to_trimesh
from imdim.geometry.surface import Surface, vec
from imdim.program.holes import SUNK
from imdim.program.paths import Path, at, leaf_paths, without
from imdim.program.roles import signs
from imdim.program.tree import Combine, Primitive, Program, leaves
from imdim.reconstruction.edge_features import find_edge_features
from imdim.target.target import Target

SHARE = 0.02  # of the part's volume, that all pieces hold at most
NARROW = 0.1  # of the part's diagonal: how wide a blend is at most
LONG = 1.5  # times its width, that it is long at least
LEANS = np.cos(np.radians([105.0, 168.0]))  # between its face and others, both outwards: 135 degrees for a chamfer of a square edge
MOSTLY = 0.7  # of an area
ALIKE = 1 - 1e-5  # cosine between normals of one plane
NEAR = 1e-6  # of the part's diagonal
CHORDS = 1e-3  # of a cone's radius, by which its facets miss it
FAR = 2  # times SHARE: a change that is larger is not looked at piece by piece
FILM = 1e-6  # of the part's volume: a smaller piece is nothing
PLAIN = 4  # lines of a prism at most
SAME = 0.1  # of what a primitive does, that edges in its place may do otherwise


@dataclass(frozen=True, eq=False)
class Sliver:
    """What a primitive adds to a part (or takes away: `cuts`) along an edge: the `width` of the plane or cone that it shows there, the
    corners [n, 3] of that, its outward normal and those of its neighbours by triangle, [m, 3] each, and their areas [m]."""

    cuts: bool
    width: float
    corners: np.ndarray
    normal: np.ndarray
    beside: np.ndarray
    areas: np.ndarray


@dataclass(frozen=True, eq=False)
class StandIn:
    """A primitive by its number and kind, the share of the part's volume that it changes, and where."""

    number: int
    kind: str
    share: float
    slivers: tuple[Sliver, ...]

    @property
    def width(self) -> float:
        return max(s.width for s in self.slivers)


def take_off_stand_ins(
    program: Program, target: Target, deadline: Deadline = NEVER, known: Set[int] = frozenset()
) -> tuple[Program, tuple[Chain, ...]]:
    """A program of a mesh without the boxes and prisms that stand for chamfers, and the chains that they stood for, in the target's units;
    as far as time allows. The primitives of `known` numbers are none."""
    chains: list[Chain] = []
    volume = to_manifold(program, CHECK_SEGMENTS).volume()
    for stand_in in sorted(_find_both_ways(program, deadline, known), key=lambda s: -s.number):
        own = [chain for sliver in stand_in.slivers if stand_in.kind != "cone" for chain in _chain_of(sliver)]
        rest = without(program, {leaf_paths(program)[stand_in.number][0]})
        if rest is None or len(own) < len(stand_in.slivers) or deadline.has_passed():
            continue
        edges = find_edge_features(rest, own, target).features
        before, after = to_manifold(program), solid_with_edges(rest, edges)
        if ((before - after) + (after - before)).volume() <= SAME * stand_in.share * volume:
            program, chains = rest, [*own, *chains]
    return program, tuple(chains)


def _find_both_ways(program: Program, deadline: Deadline, known: Set[int]) -> Iterator[StandIn]:
    """Those of a program as it is, and those that show once cutters overshoot: a box that ends a hair inside the part takes off more than
    its bevels."""
    main, seats = _largest(program), _seats(program)
    asked = {i for i, leaf in enumerate(leaves(program)) if i not in known and _may_stand_in(leaf, main)} - seats
    if not asked:
        return
    told = dict(_look(program, deadline, asked))
    yield from filter(None, told.values())
    # what changes far more than slivers is no bevel that ends a hair too early
    asked = {number for number, stand_in in told.items() if stand_in is None}
    others = {(i, face) for i, leaf in enumerate(leaves(program)) if i not in asked for face in plane_faces(leaf)}
    longer = overshoot(program, deadline=deadline, kept=others)
    # what does not overshoot does what it did
    moved = {i for i, (old, new) in enumerate(zip(leaves(program), leaves(longer), strict=True)) if old != new}
    if moved:
        yield from find_stand_ins(longer, deadline, moved, to_manifold(program, CHECK_SEGMENTS))


def find_stand_ins(
    program: Program, deadline: Deadline = NEVER, among: Container[int] | None = None, rough: Manifold | None = None
) -> Iterator[StandIn]:
    """Those of a program (of the primitives `among` these numbers), without its edge features; a `rough` solid of it is made unless given.
    The seats of heads and the points of drills are of their holes, and are none."""
    return (stand_in for _, stand_in in _look(program, deadline, among, rough) if stand_in is not None)


def _look(
    program: Program, deadline: Deadline, among: Container[int] | None = None, rough: Manifold | None = None
) -> Iterator[tuple[int, StandIn | None]]:
    """The primitives whose change is hardly larger than slivers, by their numbers, and those of them that stand for a blend."""
    rough, seats = to_manifold(program, CHECK_SEGMENTS) if rough is None else rough, _seats(program)
    volume, size = rough.volume(), float(np.linalg.norm(np.diff(bounds_of(rough), axis=0)))
    main, placed = _largest(program), [PosedPrimitive(leaf, SEGMENTS) for leaf in leaves(program)]
    for number, (path, leaf) in enumerate(leaf_paths(program)):
        if deadline.has_passed():
            return
        if among is not None and number not in among:
            continue
        if number in seats or not _may_stand_in(leaf, main):
            continue
        rest = without(program, {path})
        if rest is None:
            continue
        film = FILM * volume
        changes = list(_changes(program, rest, path, placed, number, FAR * SHARE * volume, film))
        if not changes:
            continue
        pieces = [(cuts, piece) for cuts, change in changes for piece in find_pieces(change, film)]
        share = sum(piece.volume() for _, piece in pieces) / volume
        slivers = [_sliver(cuts, piece, leaf, rest, size) for cuts, piece in pieces] if 0 < share <= SHARE else []
        is_one = slivers and all(slivers)
        yield number, StandIn(number, leaf.kind, share, tuple(s for s in slivers if s)) if is_one else None


def _changes(
    program: Program, rest: Program, path: Path, placed: list[PosedPrimitive], number: int, most: float, least: float
) -> Iterator[tuple[bool, Manifold]]:
    """What the `rest` of a program without a primitive has that the program has not, and whether that is cut by it, either way where it is
    more than `least`; nothing where the volume differs by more than `most`, which takes long to tell piece by piece.

    It is the active zone of the primitive, which asks for no solid as a whole, except of what an intersection keeps: without the primitive
    the other part is not cut any more, beyond it too."""
    if not _keeps_others(program, path):
        change = zone_within(program, placed, number, placed[number], placed[number].solid, least)
        if least < change.volume() <= most:
            yield signs(program)[number] < 0, change
        return
    whole, other = to_manifold(program), to_manifold(rest)
    if abs(whole.volume() - other.volume()) > most:
        return
    cuts = other.volume() > whole.volume()
    more, less = (other, whole) if cuts else (whole, other)
    change = more - less
    yield cuts, change
    # what is lost and gained again leaves the volume as it is
    if change.volume() - (more.volume() - less.volume()) > least:
        yield not cuts, less - more


def _keeps_others(program: Program, path: Path) -> bool:
    """Whether a primitive keeps what it meets in an intersection: it itself, or what others are cut out of it."""
    for depth in range(len(path) - 1, -1, -1):
        node = at(program, path[:depth])
        if isinstance(node, Combine) and (node.op != "difference" or path[depth]):
            return node.op == "intersection"
    return False


def _largest(program: Program) -> Primitive:
    return max(leaves(program), key=lambda leaf: to_manifold(leaf).volume())


def _may_stand_in(leaf: Primitive, main: Primitive) -> bool:
    """Whether a leaf is a box that leans to the `main` one, a cone or a plain prism."""
    if leaf.kind == "box":
        return main.kind not in ("box", "extrude") or bool((np.abs(exact_rotation(main).T @ exact_rotation(leaf)).max(0) < ALIKE).any())
    if leaf.kind != "extrude":
        return leaf.kind == "cone"
    loops = leaf.outline.loops if leaf.outline else ()
    return len(loops) == 1 and isinstance(loops[0], tuple) and len(loops[0]) <= PLAIN and not any(v[2] for v in loops[0])


def _seats(program: Program) -> set[int]:
    """The primitives that are heads and points of holes."""
    sections = [s for hole in find_holes(program) for s in (hole.head, hole.point_section) if s is not None]
    sunk = {i for i, (p, sign) in enumerate(zip(leaves(program), signs(program), strict=True)) if sign < 0 and _is_sunk(p)}
    return sunk | {leaf for section in sections for leaf in section.leaves}


def _is_sunk(leaf: Primitive) -> bool:
    """Whether a cone is as wide as the seat of a head, such as those of two holes that run into each other."""
    return leaf.kind == "cone" and max(leaf.size[:2]) >= SUNK * min(leaf.size[:2])


# --- slivers ------------------------------------------------------------------------------------------------------------


def _sliver(cuts: bool, piece: Manifold, leaf: Primitive, rest: Program, size: float) -> Sliver | None:
    """What a piece shows of a leaf, beside the faces of the `rest`; None where the piece is no sliver along an edge."""
    mesh = to_trimesh(piece)
    near = NEAR * size + (CHORDS * max(leaf.size[:2]) if leaf.kind == "cone" else 0.0)
    own, others = (np.abs(kernels.program_sdf(solid, mesh.triangles_center)) < near for solid in (leaf, rest))
    own &= ~others
    if not own.any() or own.all():
        return None
    face = _conical_face(mesh, own, leaf) if leaf.kind == "cone" else _plane_face(mesh, own)
    if face is None:
        return None
    width, towards = face
    out = Sliver(cuts, width, mesh.triangles[own].reshape(-1, 3), towards[~own], mesh.face_normals[~own], mesh.area_faces[~own])
    is_narrow = width <= NARROW * size and mesh.area_faces[own].sum() >= LONG * width**2
    return out if is_narrow and out.areas[_leaning(out)].sum() >= MOSTLY * out.areas.sum() else None


def _leaning(sliver: Sliver) -> np.ndarray:
    """Which of the neighbours bool [m] lean to the face as the sides of a blend do, and are no ends of it."""
    cosines = (sliver.normal * sliver.beside).sum(1)
    return (cosines > LEANS[1]) & (cosines < LEANS[0])


def _plane_face(mesh: trimesh.Trimesh, own: np.ndarray) -> tuple[float, np.ndarray] | None:
    """The width of the one plane that a leaf shows, and its normal, for each triangle [n, 3]."""
    areas, normals = mesh.area_faces[own], mesh.face_normals[own]
    normal = normals[areas.argmax()]
    flat = normals @ normal > ALIKE
    if areas[flat].sum() < MOSTLY * areas.sum():
        return None
    triangles = mesh.triangles[own][flat]
    across = np.cross(normal, (np.roll(triangles, 1, 1) - triangles).reshape(-1, 3))
    across /= np.linalg.norm(across, axis=1)[:, None]
    return float(np.ptp(triangles.reshape(-1, 3) @ across.T, axis=0).min()), np.tile(normal, (len(own), 1))


def _conical_face(mesh: trimesh.Trimesh, own: np.ndarray, leaf: Primitive) -> tuple[float, np.ndarray] | None:
    """The same of the side of a cone, whose normal is that beside each triangle."""
    axis = exact_rotation(leaf)[:, 2]
    arms = mesh.triangles_center - leaf.center
    outwards = arms - np.outer(arms @ axis, axis)
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1), 1e-300)[:, None]
    side = own & (np.abs(mesh.face_normals @ axis) < ALIKE)
    if mesh.area_faces[side].sum() < MOSTLY * mesh.area_faces[own].sum():
        return None
    down = (leaf.size[0] - leaf.size[1]) / leaf.size[2]
    way = np.sign((mesh.face_normals[side] * (outwards[side] + down * axis)).sum())
    ends = (mesh.triangles[side].reshape(-1, 3) - leaf.center) @ axis
    return float(np.ptp(ends) * np.hypot(1.0, down)), way * (outwards + down * axis) / np.hypot(1.0, down)


# --- what they stand for ------------------------------------------------------------------------------------------------


def _chain_of(sliver: Sliver) -> Iterator[Chain]:
    """The chamfer that a plane sliver is, as a chain of one piece; nothing where it has no two sides."""
    normals = _two_sides(sliver.beside[_leaning(sliver)], sliver.areas[_leaning(sliver)])
    if normals is None:
        return
    along = np.cross(normals[0], normals[1])
    ways = [np.cross(along, n) / np.linalg.norm(along) for n in normals]
    sizes = tuple(float(np.ptp(sliver.corners @ way)) for way in ways)
    sides = tuple(Surface("plane", vec(sliver.corners[(sliver.corners @ n).argmax()]), vec(n)) for n in normals)
    carrier = Surface("plane", vec(sliver.corners[0]), vec(sliver.normal[0]))
    outside = 1 if sliver.cuts else -1
    yield Chain((Blend("chamfer", sizes, outside, np.zeros(0, int), sliver.corners, carrier, sides),))


def _two_sides(normals: np.ndarray, areas: np.ndarray) -> Sequence[np.ndarray] | None:
    """The normals of the two planes that most of the triangles [n] lie in."""
    found: list[np.ndarray] = []
    left = areas.copy()
    for _ in range(2):
        if left.max(initial=0.0) <= 0:
            return None
        found.append(normals[left.argmax()])
        left[normals @ found[-1] > ALIKE] = 0.0
    return found if left.sum() <= (1 - MOSTLY) * areas.sum() else None
