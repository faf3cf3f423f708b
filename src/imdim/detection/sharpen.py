"""Take the blends off a mesh: its faces are extended until they meet in sharp edges.

No volume is computed: the corners of a blend's triangles move onto the carriers of the faces that it lies between, by the shortest way.
A cross section thereby collapses into one point of the edge, and a corner that several blends share onto the faces of all.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Error, Manifold

from imdim.detection.blends import Chain
from imdim.geometry.rows import lengths
from imdim.geometry.solid import solid_of, to_trimesh
from imdim.geometry.surface import Surface, SurfaceTable, normals, signed_distance

STEPS, SETTLED = 30, 1e-13  # of Newton's method, and the step after which a corner stays
MOST_OF = 0.6  # of a chain's area, that has to come off for any of it to
ON_FACE = 2e-4  # of the diagonal, within which a corner has reached a face
FURTHEST = 4.0  # times a blend's size, that a corner may move
FLAT = 1e-3  # of the largest singular value, below which carriers touch and fix one direction together
ROUND = ("cone", "torus")  # blends of round edges: a flat may cut them anywhere, others only at their ends
SAME_PLANE = 1 - 1e-6  # cosine between normals of one plane
COLLAPSED = 2e-5  # of the diagonal, that edges of triangles are shorter than once they have collapsed


class Sharp(NamedTuple):
    """A mesh without the blends of `chains`; `kept` are chains that could not be taken off."""

    mesh: trimesh.Trimesh
    chains: list[Chain]
    kept: list[Chain]


def sharpen(mesh: trimesh.Trimesh, chains: Sequence[Chain]) -> Sharp:
    """The mesh, whose equal vertices are one, with sharp edges in place of `chains`, all of them or those for which that gives a solid."""
    whole = [_placeable(mesh, chain) for chain in chains]
    good = [chain for chain in whole if chain is not None]
    sharp = _solid(mesh, good)
    if sharp is None and len(good) > 1:
        good, sharp = _one_by_one(mesh, good)
    if sharp is None:
        return Sharp(mesh, [], list(chains))
    return Sharp(sharp, good, [chain for chain, w in zip(chains, whole, strict=True) if w is None or w not in good])


def _placeable(mesh: trimesh.Trimesh, chain: Chain) -> Chain | None:
    """The chain without the few blends that have a corner which finds no place."""
    area = [float(mesh.area_faces[b.triangles].sum()) for b in chain.blends]
    left = dict(zip(chain.blends, area, strict=True))
    while sum(left.values()) > MOST_OF * sum(area):
        rest = Chain(tuple(left))
        lost = _moved(mesh, rest)[1]
        if not lost:
            return rest
        left = {blend: a for blend, a in left.items() if not np.isin(mesh.faces[blend.triangles], lost).any()}
    return None


def _one_by_one(mesh: trimesh.Trimesh, chains: Sequence[Chain]) -> tuple[list[Chain], trimesh.Trimesh | None]:
    """Chains that can be taken off together, found one after the other."""
    good: list[Chain] = []
    best: trimesh.Trimesh | None = None
    for chain in chains:
        tried = _solid(mesh, [*good, chain])
        if tried is not None:
            good, best = [*good, chain], tried
    return good, best


def _solid(mesh: trimesh.Trimesh, chains: Sequence[Chain]) -> trimesh.Trimesh | None:
    """The mesh without `chains`, or None where a corner finds no place or the faces bound no solid then."""
    placed, lost = _moved(mesh, *chains)
    if lost or not chains:
        return None
    diagonal = float(np.linalg.norm(mesh.extents))
    solid = solid_of(placed, np.asarray(mesh.faces))
    if solid.status() != Error.NoError:
        return None
    solid = solid.simplify(COLLAPSED * diagonal)
    if solid.is_empty() or not _adds_up(mesh, solid, chains):
        return None
    return to_trimesh(solid)


def _adds_up(mesh: trimesh.Trimesh, solid: Manifold, chains: Sequence[Chain]) -> bool:
    """Whether the volume changed by no more than what blends of their area and size can hold, and the way that they say."""
    most = sum(float(mesh.area_faces[b.triangles].sum()) * max(b.sizes) for c in chains for b in c.blends)
    change = solid.volume() - float(mesh.volume)
    ways = {c.outside for c in chains}
    return abs(change) <= most and (len(ways) > 1 or change * next(iter(ways)) > 0)


def _moved(mesh: trimesh.Trimesh, *chains: Chain) -> tuple[np.ndarray, list[int]]:
    """The vertices [v, 3] with those of `chains` on the faces beside them, and the numbers of those that find no place near."""
    diagonal, vertices = float(np.linalg.norm(mesh.extents)), np.array(mesh.vertices, float)
    carriers: dict[int, dict[Surface, None]] = defaultdict(dict)
    size: dict[int, float] = {}
    of_blend = np.zeros(len(mesh.faces), bool)
    for blend in (b for c in chains for b in c.blends):
        of_blend[blend.triangles] = True
        for vertex in np.unique(mesh.faces[blend.triangles]):
            carriers[int(vertex)].update(dict.fromkeys(blend.sides))
            size[int(vertex)] = max(blend.sizes)
    # a chain ends in a face where it can; what is beside its end may also be a scrap, which then follows it
    beside: dict[int, dict[Surface, None]] = defaultdict(dict)
    for vertex, plane in _other_planes(mesh, of_blend, carriers):
        beside[vertex][plane] = None
    members = np.array([*carriers], int)
    faces, ends = [[*carriers[v]] for v in members.tolist()], [[*beside[v]] for v in members.tolist()]
    reach = FURTHEST * np.array([size[v] for v in members.tolist()])
    placed, good = _placed(vertices[members], [[*own, *end] for own, end in zip(faces, ends, strict=True)], reach, ON_FACE * diagonal)
    again = [i for i, end in enumerate(ends) if end and not good[i]]
    placed[again], good[again] = _placed(vertices[members[again]], [faces[i] for i in again], reach[again], ON_FACE * diagonal)
    for i, end in _crossed(mesh, chains, beside, dict(zip(members.tolist(), placed, strict=True)), ON_FACE * diagonal):
        # what a flat has cut away of an edge is not there: the chamfer's own border ends on the flat
        tries = [_placed(vertices[members[[i]]], [[side, end]], reach[[i]], ON_FACE * diagonal) for side in faces[i]]
        near = [place[0] for place, fits in tries if fits[0]]
        if near:
            placed[i], good[i] = min(near, key=lambda place: float(np.linalg.norm(place - vertices[members[i]]))), True
    vertices[members] = placed
    return vertices, members[~good].tolist()


def _crossed(
    mesh: trimesh.Trimesh,
    chains: Sequence[Chain],
    beside: Mapping[int, Mapping[Surface, None]],
    placed: Mapping[int, np.ndarray],
    tolerance: float,
) -> Iterator[tuple[int, Surface]]:
    """The number among those `placed` of each vertex of a round blend that left, or went through, a plane that cuts this, and the plane."""
    number, corners = {vertex: i for i, vertex in enumerate(placed)}, np.asarray(mesh.vertices)
    for blend in (b for c in chains for b in c.blends if b.carrier.kind in ROUND):
        own = np.unique(mesh.faces[blend.triangles])
        before, after = corners[own], np.array([placed[v] for v in own.tolist()])
        ends: list[Surface] = []
        for plane in (plane for v in own.tolist() for plane in beside.get(v, ())):
            if not any(
                abs(np.dot(plane.axis, e.axis)) > SAME_PLANE and abs(signed_distance(e, np.array([plane.point]))[0]) < tolerance
                for e in ends
            ):
                ends.append(plane)
        for end in ends:
            was, now = signed_distance(end, before), signed_distance(end, after)
            left = (np.abs(now) > tolerance) & ((np.abs(was) <= tolerance) | (was * now < 0))
            yield from ((number[v], end) for v in own[left].tolist())


def _placed(points: np.ndarray, faces: Sequence[Sequence[Surface]], reach: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3], each moved onto its own `faces`, and whether it [n] came there within its `reach` [n]."""
    if not len(points):
        return points, np.zeros(0, bool)
    numbers = {face: i for i, face in enumerate(dict.fromkeys(face for own in faces for face in own))}
    table, many = SurfaceTable([*numbers]), max(map(len, faces))
    own = np.array([[*(numbers[face] for face in some), *[-1] * (many - len(some))] for some in faces])
    placed = _onto(points, own, table)
    off = np.abs(_look(placed, own, table)[0]).max(axis=1)
    return placed, (off < tolerance) & (lengths(placed - points) < reach)


def _look(points: np.ndarray, own: np.ndarray, table: SurfaceTable) -> tuple[np.ndarray, np.ndarray]:
    """Signed distances [n, k] and normals [n, k, 3] at points [n, 3] of their `own` faces [n, k]; 0 where that is -1, none."""
    off, slope = np.zeros(own.shape), np.zeros((*own.shape, 3))
    rows, slots = np.nonzero(own >= 0)
    off[rows, slots], slope[rows, slots] = table.look(points[rows], own[rows, slots])
    return off, slope


def _other_planes(mesh: trimesh.Trimesh, of_blend: np.ndarray, carriers: dict[int, dict[Surface, None]]) -> Iterator[tuple[int, Surface]]:
    """The planes of flat faces in which a vertex of a blend lies too, where these are none of its blends' sides: where a chain ends."""
    others = np.flatnonzero(~of_blend & np.isin(mesh.faces, list(carriers)).any(axis=1))
    # each look at an array of the mesh asks whether it has changed
    corners, faces, facing = np.asarray(mesh.vertices), np.asarray(mesh.faces), np.asarray(mesh.face_normals)
    facing_of: dict[int, list[np.ndarray]] = {}  # how the sides of its blends face at a vertex, which many triangles share
    for t in others:
        normal = facing[t]
        for vertex in faces[t].tolist():
            beside = carriers.get(vertex)
            if beside is None:
                continue
            if vertex not in facing_of:
                facing_of[vertex] = [normals(f, corners[vertex][None])[0] for f in beside]
            if max(abs(float(side @ normal)) for side in facing_of[vertex]) < 0.95:
                yield vertex, Surface("plane", tuple(corners[faces[t]].mean(0).tolist()), tuple(normal.tolist()))


def _onto(points: np.ndarray, own: np.ndarray, table: SurfaceTable) -> np.ndarray:
    """Points [n, 3], each moved onto all its `own` faces [n, k] of the table, by Newton's steps of least length; along faces that touch
    each other they count as one."""
    out, moving = points.copy(), np.arange(len(points))
    for _ in range(STEPS):
        off, slope = _look(out[moving], own[moving], table)
        finite = np.isfinite(off).all(axis=1) & np.isfinite(slope).all(axis=(1, 2))
        out[moving[~finite]] = points[moving[~finite]]
        moving, off, slope = moving[finite], off[finite], slope[finite]
        step = np.einsum("nij,nj->ni", np.linalg.pinv(slope, rcond=FLAT), off)
        out[moving] -= step
        moving = moving[np.abs(step).max(axis=1, initial=0.0) >= SETTLED]
        if not len(moving):
            break
    return out
