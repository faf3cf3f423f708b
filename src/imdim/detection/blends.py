"""Find the blends of a mesh: chains of fillets and chamfers that run along its edges.

A fillet is a piece of cylinder, torus or sphere that both its neighbours touch; a chamfer a narrow flat, or piece of a cone, of one width
between two. What joins pieces of one size is a chain. A chain that runs in one direction alone, or about one axis, is an outline's corner
or a turned part's profile: those draw it as well as any edge feature could, so it is no blend here. But a narrow chamfer of a round rim
is one: without it a hole or a pin is a cylinder, and with it a stack of two.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import trimesh

from imdim.detection.facets import Facets, facets_of
from imdim.detection.mesh_surfaces import Shown, detect_shown
from imdim.geometry.components import components
from imdim.geometry.surface import Patch, Surface, normals, signed_distance, vec
from imdim.program.edges import EdgeKind
from imdim.program.holes import SUNK

TANGENT = 6.0  # degrees, below which surfaces touch; coarse facets leave some
HALF_STEP = 0.7  # of a step between facets, below which the first one touches what is beside it
FLAT = 0.01  # radians, by which triangles of one facet may turn
ON_SURFACE = 2e-4  # of the diagonal, within which a facet's corners lie on a surface
LIKE_OWN = 1.02  # times what the corners of a patch's own facets are off it
FOLLOWS = 0.999  # cosine between a facet's normal and the surface's in its middle
SLOPE = (10.0, 80.0)  # degrees, between a chamfer and its neighbours
NARROW = 0.35  # of its neighbours' size, as the root of their area: a chamfer's width at most
LONG = 1.5  # times its width, that a chamfer's shorter side is at least
BESIDE = 0.5  # of a piece's boundary, that its two neighbours take
LIKE = 0.03  # by which sizes within a chain may differ
SMALLEST, LARGEST = 5e-4, 0.1  # of the diagonal: a blend's size
CORNER = 2.0  # times its squared size: the area of a small piece between blends at most
MOSTLY = 0.7  # of a curved patch's area: one facet that has more of it is a face of its own
BLUNT = 2.0  # times the radius of a pin's flat end, that the pin has at most: what ends in less is a point
STRANGE = 0.5  # of a mesh's area, that shows no carrier: beyond, it has no faces that blends could lie between
ONE_WAY = 1.0  # degrees, within which a chain's pieces run in one direction


@dataclass(frozen=True, eq=False)
class Blend:
    """A piece of a chain: its triangles and their corners [n, 3], the carriers of the two faces that met in the edge, and how it runs.

    `sizes` are a fillet's radius, or a chamfer's distances along its two sides. `outside` is +1 where the edge is convex and -1 where it
    is concave. A sphere in a corner has the sides of all the fillets that meet there.
    """

    kind: EdgeKind
    sizes: tuple[float, ...]
    outside: int
    triangles: np.ndarray
    corners: np.ndarray
    carrier: Surface
    sides: tuple[Surface, ...]


@dataclass(frozen=True, eq=False)
class Chain:
    """Blends of one kind and size that join each other."""

    blends: tuple[Blend, ...]

    @property
    def kind(self) -> EdgeKind:
        return self.blends[0].kind

    @property
    def sizes(self) -> tuple[float, ...]:
        return self.blends[0].sizes

    @property
    def outside(self) -> int:
        return self.blends[0].outside

    @property
    def is_rim(self) -> bool:
        """Whether it is the narrow chamfer of a round hole's rim, or of a pin's end."""
        return len(self.blends) == 1 and _is_rim(self.blends[0])


class _Piece(NamedTuple):
    """A connected piece of a carrier: its number, its patch, its triangles and their corners [n, 3], its area, by how many degrees its
    facets turn, and per piece beside it what `_Border` says."""

    number: int
    patch: Patch
    triangles: np.ndarray
    corners: np.ndarray
    area: float
    step: float
    beside: Mapping[int, _Border]


class _Border(NamedTuple):
    """Where two pieces meet: how long, by how many degrees their carriers and their facets turn there, and whether it is convex."""

    length: float
    angle: float
    bend: float
    convex: bool


def find_chains(mesh: trimesh.Trimesh) -> list[Chain]:
    """The chains of blends of a mesh whose equal vertices are one, largest first; see the module for what counts as one."""
    facets = facets_of(mesh)
    return chains_among(mesh, facets, detect_shown(facets))


def chains_among(mesh: trimesh.Trimesh, facets: Facets, shown: Sequence[Shown]) -> list[Chain]:
    """As `find_chains`, of a mesh whose facets and carriers are known."""
    pieces = _pieces(mesh, facets, shown)
    diagonal = float(np.linalg.norm(mesh.extents))
    found = {p.number: blend for p in pieces.values() if (blend := _blend(p, pieces, diagonal)) is not None}
    found = _rings(pieces, diagonal) | found
    while more := dict(_going_on(pieces, found, diagonal)) | dict(_corners(pieces, found)):
        found |= more
    chains = [Chain(tuple(found[i] for i in group)) for group in _joined(found, mesh)]
    return sorted((c for c in chains if not _runs_one_way(c)), key=lambda c: -sum(len(b.triangles) for b in c.blends))


def _pieces(mesh: trimesh.Trimesh, facets: Facets, shown: Sequence[Shown]) -> dict[int, _Piece]:
    """The pieces of the surface by their numbers; a facet that shows no carrier lies in a plane of its own. None of a mesh, of a scan, that
    shows hardly any."""
    owner = np.full(len(facets.areas), -1)
    patches = [s.patch for s in shown]
    for i, (patch, members) in enumerate(shown):
        areas = facets.areas[members]
        # a wall with the first strip of a rounding at either end lies on a curve too, but is flat
        if patch.surface.kind == "plane" or areas.max() < MOSTLY * areas.sum():
            owner[members] = i
    _give_back(owner, patches, facets)
    if facets.areas[owner < 0].sum() > STRANGE * facets.areas.sum():
        return {}
    for facet in np.flatnonzero(owner < 0):
        owner[facet] = len(patches)
        plane = Surface("plane", vec(facets.centers[facet]), vec(facets.normals[facet]))
        patches.append(Patch(plane, facets.centers[facet][None], float(facets.areas[facet])))
    owner = owner[facets.facet_of]
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    joined = owner[pairs[:, 0]] == owner[pairs[:, 1]]
    piece_of = components(pairs[joined, 0], pairs[joined, 1], len(owner))[1]
    owner_of = np.zeros(piece_of.max() + 1, int)
    owner_of[piece_of] = owner
    areas = np.bincount(piece_of, mesh.area_faces)
    borders: dict[int, dict[int, _Border]] = defaultdict(dict)
    for (a, b), edges in _edges_between(piece_of, pairs).items():
        ends = mesh.vertices[mesh.face_adjacency_edges[edges]]
        length = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())
        convex = bool(np.mean(mesh.face_adjacency_convex[edges]) > 0.5)
        at = ends.reshape(-1, 3)
        cosine = np.abs((normals(patches[owner_of[a]].surface, at) * normals(patches[owner_of[b]].surface, at)).sum(1))
        angle = math.degrees(math.acos(min(float(np.median(cosine)), 1.0)))
        bend = math.degrees(float(np.median(mesh.face_adjacency_angles[edges])))
        borders[a][b] = borders[b][a] = _Border(length, angle, bend, convex)
    steps = _steps(mesh, piece_of, pairs)
    order = np.argsort(piece_of, kind="stable")
    triangles = np.split(order, np.cumsum(np.bincount(piece_of))[:-1])
    corners = [np.asarray(mesh.vertices)[np.unique(mesh.faces[t])] for t in triangles]
    return {
        i: _Piece(i, patches[int(owner)], triangles[i], corners[i], float(areas[i]), steps.get(i, 0.0), borders[i])
        for i, owner in enumerate(owner_of)
    }


def _give_back(owner: np.ndarray, patches: Sequence[Patch], facets: Facets) -> None:
    """Let facets that passed for flat ones, or for some of a smaller patch beside, belong to the curved patch that they lie on."""
    own_area = np.bincount(owner[owner >= 0], facets.areas[owner >= 0], len(patches))
    worth = np.where([patch.surface.kind != "plane" for patch in patches], own_area, 0.0)
    order = np.argsort(facets.facet_of, kind="stable")
    triangles = np.split(order, np.cumsum(np.bincount(facets.facet_of, minlength=len(owner)))[:-1])
    corners = [facets.corners[own].reshape(-1, 3) for own in triangles]
    slack = [_slack(patch, [corners[f] for f in np.flatnonzero(owner == i)], facets.diagonal) for i, patch in enumerate(patches)]
    ways = np.concatenate([facets.edges, facets.edges[:, ::-1]])
    refused: set[tuple[int, int]] = set()
    while True:
        taken = False
        own = np.where(owner >= 0, worth[owner], 0.0)
        for facet, beside in ways[own[ways[:, 1]] > own[ways[:, 0]]].tolist():
            home = int(owner[beside])
            is_worse = owner[facet] < 0 or worth[owner[facet]] < worth[home]
            # strips beside a flat wall may lie on a wide curve with it
            is_face = facets.areas[facet] > MOSTLY * (facets.areas[facet] + worth[home])
            if not is_worse or is_face or (facet, home) in refused:
                continue
            # a sliver that booleans leave faces any way
            facing = facets.normals[facet] if _is_wide(corners[facet], float(facets.areas[facet]), facets.diagonal) else None
            if _lies_on(patches[home].surface, corners[facet], facing, slack[home]):
                owner[facet], taken = home, True
            else:
                refused.add((facet, home))
        if not taken:
            return


def _slack(patch: Patch, corners: Sequence[np.ndarray], diagonal: float) -> float:
    """How far the corners [n, 3] of one more facet may be off a curved patch: as those of its own facets, which are outside where these are
    coarse, and the surface runs between corners and facets."""
    if patch.surface.kind == "plane" or not corners:
        return ON_SURFACE * diagonal
    return max(ON_SURFACE * diagonal, LIKE_OWN * float(np.abs(signed_distance(patch.surface, np.concatenate(corners))).max()))


def _is_wide(corners: np.ndarray, area: float, diagonal: float) -> bool:
    """Whether a facet with `corners` [n, 3] is as wide as what counts as off a surface."""
    return area > ON_SURFACE * diagonal * float(np.linalg.norm(np.ptp(corners, axis=0)))


def _lies_on(surface: Surface, corners: np.ndarray, facing: np.ndarray | None, slack: float) -> bool:
    """Whether a facet with `corners` [n, 3] that faces `facing`, if it can be told, is one of a curved surface's."""
    if (np.abs(signed_distance(surface, corners)) > slack).any():
        return False
    return facing is None or bool(abs(normals(surface, corners.mean(0)[None])[0] @ facing) > FOLLOWS)


def _steps(mesh: trimesh.Trimesh, piece_of: np.ndarray, pairs: np.ndarray) -> dict[int, float]:
    """By how many degrees the facets of each piece turn from one to the next, in the middle; none of flat ones."""
    bent = np.flatnonzero((piece_of[pairs[:, 0]] == piece_of[pairs[:, 1]]) & (mesh.face_adjacency_angles > FLAT))
    owner, turn = piece_of[pairs[bent, 0]], np.degrees(mesh.face_adjacency_angles[bent])
    groups = np.split(turn[np.argsort(owner, kind="stable")], np.cumsum(np.unique(owner, return_counts=True)[1])[:-1])
    return {int(i): float(np.median(group)) for i, group in zip(np.unique(owner), groups, strict=False)}


def _edges_between(piece_of: np.ndarray, pairs: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """The numbers of the mesh's edges between each two pieces, a < b."""
    between = np.sort(piece_of[pairs], axis=1)
    edges = np.flatnonzero(between[:, 0] != between[:, 1])
    if not len(edges):
        return {}
    keys, which = np.unique(between[edges], axis=0, return_inverse=True)
    which = which.reshape(-1)
    groups = np.split(edges[np.argsort(which, kind="stable")], np.cumsum(np.bincount(which, minlength=len(keys)))[:-1])
    return {(int(a), int(b)): group for (a, b), group in zip(keys, groups, strict=True)}


def _blend(piece: _Piece, pieces: Mapping[int, _Piece], diagonal: float, alone: bool = True) -> Blend | None:
    """The blend that a piece is, if any, told by itself `alone` or beside one that it may go on; corners are found later."""
    kind = piece.patch.surface.kind
    if kind in ("cylinder", "torus"):
        return _fillet(piece, pieces, diagonal, alone)
    if kind in ("plane", "cone"):
        return _chamfer(piece, pieces, diagonal) if alone else _chamfer_beside(piece, pieces, diagonal)
    return None


def _going_on(pieces: Mapping[int, _Piece], found: Mapping[int, Blend], diagonal: float) -> Iterator[tuple[int, Blend]]:
    """Pieces beside a blend that go on with it: too short, or too wide for a narrow neighbour, to be told alone."""
    for piece in pieces.values():
        beside = [found[i] for i in piece.beside if i in found]
        if piece.number not in found and beside:
            blend = _blend(piece, pieces, diagonal, alone=False)
            if blend is not None and any(_are_alike(blend, other) for other in beside):
                yield piece.number, blend


def _fillet(piece: _Piece, pieces: Mapping[int, _Piece], diagonal: float, alone: bool) -> Blend | None:
    surface = piece.patch.surface
    radius = surface.sizes[-1]
    if not SMALLEST * diagonal < radius < LARGEST * diagonal:
        return None
    # corners lie on the true curve: a face that touches it lies half a step beside the first facet
    tangent, bend = TANGENT if alone else 2 * TANGENT, HALF_STEP * piece.step
    touching = {i: b for i, b in piece.beside.items() if b.angle < tangent or b.bend < bend}
    # pieces that go on with the same radius are the chain's, not its sides
    sides = [i for i in sorted(touching, key=lambda i: -touching[i].length) if not _goes_on(pieces[i].patch.surface, radius)]
    whole = sum(b.length for b in piece.beside.values())
    if len(sides) < 2 or (alone and sum(b.length for b in touching.values()) < BESIDE * whole):
        return None
    one, two = (pieces[i].patch.surface for i in _two_sides(sides, pieces))
    if one == two:
        return None
    return Blend("fillet", (radius,), piece.patch.outward or 1, piece.triangles, piece.corners, surface, (one, two))


def _two_sides(sides: Sequence[int], pieces: Mapping[int, _Piece]) -> tuple[int, int]:
    """The longest of the sides, and the longest that lies on another carrier."""
    first = sides[0]
    return first, next((i for i in sides if pieces[i].patch.surface != pieces[first].patch.surface), first)


def _goes_on(surface: Surface, radius: float) -> bool:
    return surface.kind in ("cylinder", "torus", "sphere") and abs(surface.sizes[-1] - radius) < LIKE * radius


def _chamfer(piece: _Piece, pieces: Mapping[int, _Piece], diagonal: float) -> Blend | None:
    """The chamfer that a piece is by itself, if any."""
    whole = _beside_carriers(piece, pieces) if piece.patch.surface.kind == "cone" else piece
    order = _chamfer_sides(whole, pieces, alone=True)
    bevel = _bevel(whole, pieces, order, SMALLEST * diagonal)
    if bevel is None:
        return None
    width, is_rim = _across(whole, order), _is_even(bevel) and bevel.outside > 0 and _is_rim(bevel)
    shorter, longer = sorted(whole.beside[i].length for i in order)
    # the flat end of a pin is what its even chamfer leaves, and a bore may leave even less of it; an uneven cone is a shape of its own
    room = math.inf if is_rim else min(LARGEST * diagonal, *(min(_width(pieces[i]), NARROW * math.sqrt(pieces[i].area)) for i in order))
    if width >= room or shorter < max(LONG * width, BESIDE * longer):
        return None
    if shorter + longer < BESIDE * sum(b.length for b in whole.beside.values()):
        return None
    return replace(bevel, sizes=_rim_sizes(bevel)) if is_rim else bevel


def _chamfer_beside(piece: _Piece, pieces: Mapping[int, _Piece], diagonal: float) -> Blend | None:
    """The chamfer that a piece may be beside others, as long as some is left of its neighbours."""
    order = _chamfer_sides(piece, pieces, alone=False)
    room = (pieces[i].area / max(piece.beside[i].length, 1e-300) for i in order)
    return _bevel(piece, pieces, order, SMALLEST * diagonal, min([LARGEST * diagonal, *room]))


def _beside_carriers(piece: _Piece, pieces: Mapping[int, _Piece]) -> _Piece:
    """A piece with one border to all pieces of each carrier: flats along a pin cut its wall in two, and its chamfer not."""
    merged: dict[Surface, tuple[int, _Border]] = {}
    for i, border in sorted(piece.beside.items(), key=lambda item: -item[1].length):
        first, known = merged.get(pieces[i].patch.surface, (i, border._replace(length=0.0)))
        merged[pieces[i].patch.surface] = first, known._replace(length=known.length + border.length)
    return piece._replace(beside=dict(merged.values()))


def _bevel(piece: _Piece, pieces: Mapping[int, _Piece], order: Sequence[int], least: float, most: float = math.inf) -> Blend | None:
    """A piece as the chamfer of the edge in which the two sides in `order` met, if it leans to both and is between `least` and `most`
    wide."""
    if len(order) < 2:
        return None
    one, two = (piece.beside[i] for i in order)
    width = _across(piece, order)
    if one.convex != two.convex or not all(SLOPE[0] < b.angle < SLOPE[1] for b in (one, two)):
        return None
    if not least < width < most:
        return None
    turn = math.sin(math.radians(one.angle + two.angle))
    sizes = width * math.sin(math.radians(two.angle)) / turn, width * math.sin(math.radians(one.angle)) / turn
    a, b = (pieces[i].patch.surface for i in order)
    sign = 1 if one.convex else -1
    return Blend("chamfer", sizes, sign, piece.triangles, piece.corners, piece.patch.surface, (a, b))


def _across(piece: _Piece, order: Sequence[int]) -> float:
    """How wide a strip between two sides is."""
    return 2 * piece.area / max(sum(piece.beside[i].length for i in order), 1e-300)


def _width(piece: _Piece) -> float:
    """Of a strip across it, of anything else some length in between."""
    return 2 * piece.area / max(sum(b.length for b in piece.beside.values()), 1e-300)


def _chamfer_sides(piece: _Piece, pieces: Mapping[int, _Piece], alone: bool) -> list[int]:
    """The two pieces between which a piece may be a chamfer: its longest borders; of one that goes on, those of equal slopes."""
    order = sorted(piece.beside, key=lambda i: -piece.beside[i].length)
    if alone or len(order) < 3:
        return order[:2]
    known = [i for i in order if SLOPE[0] < piece.beside[i].angle < SLOPE[1]]
    pairs = ((a, b) for k, a in enumerate(known) for b in known[k + 1 :] if pieces[a].patch.surface != pieces[b].patch.surface)
    return list(min(pairs, key=lambda p: abs(piece.beside[p[0]].angle - piece.beside[p[1]].angle), default=order[:2]))


def _rings(pieces: Mapping[int, _Piece], diagonal: float) -> dict[int, Blend]:
    """Flats and cones that touch each other once around a mouth or a boss, at one distance: the chamfer of its rim, however low its wall
    is, as long as some of it is left."""
    bevels: dict[int, Blend] = {}
    for piece in pieces.values():
        if piece.patch.surface.kind in ("plane", "cone") and (bevel := _chamfer_beside(piece, pieces, diagonal)) is not None:
            bevels[piece.number] = bevel
    beside = {
        i: [j for j, b in pieces[i].beside.items() if j in bevels and b.angle < TANGENT and _are_alike(bevels[i], bevels[j])]
        for i in bevels
    }
    ends = [i for i in bevels if len(beside[i]) != 2]
    while ends:  # what an open run ends in is no ring, nor what that goes on from
        ends += [j for j in beside.pop(ends.pop(), ()) if j in beside]
    return {i: bevels[i] for i in beside}


def _corners(pieces: Mapping[int, _Piece], found: Mapping[int, Blend]) -> Iterator[tuple[int, Blend]]:
    """Spheres in which two or more fillets of their radius end, and small pieces that lie for the most part between blends alike."""
    for piece in pieces.values():
        beside = [i for i in piece.beside if i in found]
        if piece.number in found or len(beside) < 2:
            continue
        ends = [found[i] for i in beside if _are_alike(found[i], found[beside[0]])]
        size, surface = max(ends[0].sizes), piece.patch.surface
        between = sum(piece.beside[i].length for i in beside) > BESIDE * sum(b.length for b in piece.beside.values())
        ball = surface.kind == "sphere" and ends[0].kind == "fillet" and abs(surface.sizes[0] - size) < LIKE * size
        if len(ends) >= 2 and (ball or (between and piece.area < CORNER * size * size)):
            sides = tuple(dict.fromkeys(side for end in ends for side in end.sides))
            yield (
                piece.number,
                Blend(ends[0].kind, ends[0].sizes, ends[0].outside, piece.triangles, piece.corners, surface, sides),
            )


def _joined(found: Mapping[int, Blend], mesh: trimesh.Trimesh) -> Iterator[list[int]]:
    """Groups of blends of one kind, size and side that share vertices."""
    if not found:
        return
    at: dict[int, list[int]] = defaultdict(list)
    for i, blend in found.items():
        for vertex in np.unique(mesh.faces[blend.triangles]):
            at[int(vertex)].append(i)
    numbers = {i: k for k, i in enumerate(found)}
    links = {(numbers[a], numbers[b]) for near in at.values() for a in near for b in near if a < b and _are_alike(found[a], found[b])}
    ends = np.array(list(links), int).reshape(-1, 2)
    group = components(ends[:, 0], ends[:, 1], len(found))[1]
    order = list(found)
    for g in range(group.max() + 1):
        yield [order[k] for k in np.flatnonzero(group == g)]


def _are_alike(a: Blend, b: Blend) -> bool:
    if (a.kind, a.outside) != (b.kind, b.outside):
        return False
    return all(abs(p - q) <= LIKE * max(p, q) for p, q in zip(sorted(a.sizes), sorted(b.sizes), strict=True))


def _runs_one_way(chain: Chain) -> bool:
    """Whether all pieces of a chain run in one direction, or about one axis, as a corner of one outline does."""
    ways = np.array([_way(blend) for blend in chain.blends])
    is_round = [blend.carrier.kind in ("torus", "cone", "sphere") for blend in chain.blends]
    if len(chain.blends) == 1:
        return not chain.is_rim
    parallel = bool((np.abs(ways @ ways[0]) > math.cos(math.radians(ONE_WAY))).all())
    if not parallel or len(set(is_round)) > 1:
        return False
    return not is_round[0] or _share_axis([blend.carrier for blend in chain.blends])


def _is_rim(blend: Blend) -> bool:
    """Whether a piece lies between a flat and a round wall about its axis, and is narrow."""
    flat, tube = sorted(blend.sides, key=lambda side: side.kind != "plane")[:2]
    if (blend.carrier.kind, flat.kind, tube.kind) != ("cone", "plane", "cylinder"):
        return False
    across = math.sin(math.radians(ONE_WAY))
    is_square = all(np.linalg.norm(np.cross(blend.carrier.axis, side.axis)) < across for side in (flat, tube))
    is_centred = np.linalg.norm(np.cross(tube.axis, np.asarray(blend.carrier.point) - tube.point)) < LIKE * tube.sizes[0]
    radii = np.linalg.norm(np.cross(tube.axis, blend.corners - tube.point), axis=1)
    # wider ones are countersinks, and tips; a pin's end may have less left of it where its chamfer is an even one
    is_pins_end = abs(radii.max() / tube.sizes[0] - 1) < LIKE and _is_even(blend)
    return is_square and bool(is_centred) and bool(radii.max() < (BLUNT if is_pins_end else SUNK) * radii.min())


def _is_even(blend: Blend) -> bool:
    """Whether it goes as far along one side as along the other."""
    return max(blend.sizes) < (1 + LIKE) * min(blend.sizes)


def _rim_sizes(rim: Blend) -> tuple[float, float]:
    """The distances along the two sides of a round rim's chamfer, where its cone meets them: what flats cut away of it says nothing."""
    cone, slope = rim.carrier, math.tan(rim.carrier.sizes[0])
    (flat,), (tube,) = ([side for side in rim.sides if (side.kind == "plane") is plane] for plane in (True, False))
    height = abs(float(np.dot(flat.axis, np.subtract(flat.point, cone.point)) / np.dot(flat.axis, cone.axis)))
    across = abs(tube.sizes[0] - height * slope)
    along = across / slope
    return (across, along) if rim.sides[0] == flat else (along, across)


def _way(blend: Blend) -> np.ndarray:
    """Along a straight blend, about a round one: a unit vector [3]."""
    if blend.carrier.kind == "plane":
        across = np.cross(blend.sides[0].axis, blend.sides[1].axis) if all(s.kind == "plane" for s in blend.sides) else None
        if across is not None and np.linalg.norm(across) > 1e-6:
            return across / np.linalg.norm(across)
    return np.asarray(blend.carrier.axis)


def _share_axis(carriers: Sequence[Surface]) -> bool:
    axis, first = np.asarray(carriers[0].axis), np.asarray(carriers[0].point)
    size = max(max(c.sizes) for c in carriers)
    return all(np.linalg.norm(np.cross(axis, np.asarray(c.point) - first)) < LIKE * size for c in carriers)
