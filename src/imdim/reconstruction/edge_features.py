"""Edges of a target: blends are set aside before the search, which sees the sharp part, and put back onto the program that it finds.

Which faces of the program a blend lies between is read off their carriers. Whether it belongs there is asked of the target: what a blend
takes off has to be air there, what it fills in material, for the most part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.detection.blends import Blend, Chain, chains_among
from imdim.detection.facets import facets_of
from imdim.detection.mesh_surfaces import detect_patches, detect_shown
from imdim.detection.sharpen import sharpen
from imdim.geometry.blended_edge import BlendedEdge
from imdim.geometry.edge_solids import sweep_blends
from imdim.geometry.edges import find_edges
from imdim.geometry.faces import carrier
from imdim.geometry.kernels import program_sdf
from imdim.geometry.lowering import lower
from imdim.geometry.solid import mesh_to_manifold, to_manifold
from imdim.geometry.surface import Patch, Surface, normals, signed_distance, vec
from imdim.program.edges import EdgeFeature, Face, describe_size, faces_of, name_edges
from imdim.program.tree import Primitive, Program, leaves
from imdim.target.target import Frame, Target, with_mesh

NEAR = 0.05  # of a blend's size, and
NEAR_PART = 3e-4  # of the part's, within which a face of the program is one that a blend lies beside
ALIGNED = 0.9995  # cosine between their normals
RIGHT = 0.7  # of the volume of a blend that has to be right
SHORTEST = 0.5  # of its size, that the stretches of an edge are long together at least
TIDY = 5e-3  # of a size, by which it may be rounded
ECHO, ECHO_AREA, ECHO_COSINE = 1e-3, 0.1, 0.9995  # of the diagonal, of the larger flat's area, and between normals
PLACES = 7, 400  # of a stretch, at least and at most, at which it is looked whether it runs along another one,
PER_SIZE = 8.0  # so many per size of its blend
FOLLOWED = 0.5  # of a blend's length, that edges follow at least
GATHERED = 1e-2  # of a size, within which chains have one


@dataclass(frozen=True)
class MeasuredSizes:
    """What the points of a cloud say of the sizes of an edge feature, and half of the 95 % interval of each."""

    sizes: tuple[float, ...]
    half: float


@dataclass(frozen=True)
class EdgesFound:
    """Edge features of a program, a sentence for each chain of the target that is none of them, or for edges that its points leave open,
    and what a cloud `measured` of each feature."""

    features: tuple[EdgeFeature, ...]
    left_out: tuple[str, ...]
    measured: tuple[MeasuredSizes, ...] = ()


class SetAside(NamedTuple):
    """A target with sharp edges in place of `chains` of fillets and chamfers, in its units; the `patches` that its mesh shows, if they are
    known. `kept` are chains that could not be taken off."""

    target: Target
    chains: tuple[Chain, ...] = ()
    patches: list[Patch] | None = None
    kept: tuple[Chain, ...] = ()


def set_edges_aside(target: Target, deadline: Deadline = NEVER) -> SetAside:
    """The target without its fillets and chamfers; a cloud, or a mesh that bounds no solid, as it is.

    They stay on where less time is left until the `deadline` than was spent: surfaces of the sharp part have to be found once more.
    """
    if target.mesh is None or not target.is_solid:
        return SetAside(target)
    began = deadline.now()
    facets = facets_of(target.mesh)
    shown = detect_shown(facets, deadline)
    if deadline.left() < deadline.now() - began:
        return SetAside(target, patches=[s.patch for s in shown])
    chains = chains_among(target.mesh, facets, shown)
    sharp = sharpen(target.mesh, chains) if chains else None
    if sharp is None or not sharp.chains:
        return SetAside(target, patches=[s.patch for s in shown], kept=tuple(chains))
    gone = {blend.carrier for chain in sharp.chains for blend in chain.blends}
    expected = [s.patch.surface for s in shown if s.patch.surface.kind != "plane" and s.patch.surface not in gone]
    patches = _without_echoes(detect_patches(sharp.mesh, deadline, expected=expected), sharp.mesh)
    return SetAside(with_mesh(target, sharp.mesh), tuple(sharp.chains), patches, tuple(sharp.kept))


def _without_echoes(patches: list[Patch], mesh: trimesh.Trimesh) -> list[Patch]:
    """The patches without small flats that all but lie in a larger one: corners that moved may leave facets that lean a little, and a
    search that cuts along both would part a body by a hair."""
    slack = ECHO * float(np.linalg.norm(mesh.extents))
    flats = [p for p in patches if p.surface.kind == "plane"]

    def echoes(patch: Patch) -> bool:
        larger = (p.surface for p in flats if p.area * ECHO_AREA > patch.area)
        return any(
            abs(np.dot(s.axis, patch.surface.axis)) > ECHO_COSINE and (np.abs(signed_distance(s, patch.points)) < slack).all()
            for s in larger
        )

    return [p for p in patches if p.surface.kind != "plane" or not echoes(p)]


def place_chain(chain: Chain, frame: Frame) -> Chain:
    """A chain in the unit frame, put back into the target's units and place."""

    def surface(s: Surface) -> Surface:
        sizes = s.sizes if s.kind == "cone" else tuple(size / frame.scale for size in s.sizes)
        axis, across = (vec(frame.turn_back(np.asarray(v))) for v in (s.axis, s.across))
        return replace(
            s, point=vec(frame.to_world(np.asarray(s.point))), axis=s.axis if s.kind == "sphere" else axis, across=across, sizes=sizes
        )

    def blend(b: Blend) -> Blend:
        sizes = tuple(size / frame.scale for size in b.sizes)
        return replace(b, sizes=sizes, corners=frame.to_world(b.corners), carrier=surface(b.carrier), sides=tuple(map(surface, b.sides)))

    return Chain(tuple(map(blend, chain.blends)))


def find_edge_features(program: Program, chains: Sequence[Chain], target: Target) -> EdgesFound:
    """The edges of a program, in the target's units, that `chains` of it blend."""
    if not chains or target.mesh is None:
        return EdgesFound((), ())
    wanted, solid = mesh_to_manifold(target.mesh), to_manifold(program)
    faces, parts = list(_faces(program)), list(leaves(program))
    features: list[EdgeFeature] = []
    left_out: list[str] = []
    taken: list[BlendedEdge] = []
    for group in _gathered(chains):
        sizes = tidy_sizes(group[0].sizes)
        edges: list[tuple[Face, Face]] = []
        lost = 0
        for chain in group:
            pairs = [list(_pairs(blend, chain, faces, parts, target)) for blend in chain.blends]
            every = tuple(dict.fromkeys(pair for some in pairs for pair in some))
            runs = _borne_out(program, solid, wanted, EdgeFeature(chain.kind, sizes, every) if every else None, taken)
            found = [
                pair
                for pair in runs
                if any(pair in some and _is_followed(blend, some, runs) for blend, some in zip(chain.blends, pairs, strict=True))
            ]
            taken += [edge for pair in found for edge in runs[pair]]
            edges += found
            lost += not found
        if edges:
            features.append(EdgeFeature(group[0].kind, sizes, tuple(dict.fromkeys(edges))))
        if lost:
            said = describe_size(group[0].kind, sizes)
            left_out.append(f"{lost} of {len(group)} chains of {said} follow no edges of the program: these are sharp")
    return EdgesFound(name_edges(features), tuple(left_out))


def describe_kept(chains: Sequence[Chain]) -> str:
    """A sentence about chains of a target that stay in its shape."""
    said = dict.fromkeys(describe_size(chain.kind, tidy_sizes(chain.sizes)) for chain in chains)
    return f"{len(chains)} chains of {', '.join(said)} could not be taken off: they are part of the shape"


def _gathered(chains: Sequence[Chain]) -> Iterator[list[Chain]]:
    """Chains of one kind and size together, whichever way the two distances of a chamfer are told."""
    groups: list[list[Chain]] = []
    for chain in chains:
        like = next((g for g in groups if g[0].kind == chain.kind and _is_like(g[0].sizes, chain.sizes)), None)
        if like is None:
            groups.append([chain])
        else:
            like.append(chain)
    yield from groups


def _is_like(one: Sequence[float], two: Sequence[float]) -> bool:
    return len(one) == len(two) and all(abs(a - b) <= GATHERED * max(a, b) for a, b in zip(sorted(one), sorted(two), strict=True))


def tidy_sizes(sizes: Sequence[float]) -> tuple[float, ...]:
    """Sizes rounded as far as they bear it, smaller first; one where two are equal."""
    rounded = sorted(next((r for d in range(-1, 6) if (r := round(s, d)) > 0 and abs(r - s) <= TIDY * s), s) for s in sizes)
    return tuple(rounded[:1]) if _is_like(rounded[:1], rounded[-1:]) else tuple(rounded)


def _faces(program: Program) -> Iterator[tuple[Face, Surface]]:
    numbers = lower(program)
    for i, leaf in enumerate(leaves(program)):
        for name in faces_of(leaf):
            if (surface := carrier(Face(i, name), leaf, numbers)) is not None:
                yield Face(i, name), surface


def _pairs(
    blend: Blend, chain: Chain, faces: Sequence[tuple[Face, Surface]], parts: Sequence[Primitive], target: Target
) -> Iterator[tuple[Face, Face]]:
    """Pairs of the faces of a program of these `parts` between which a blend may lie; the one along which it is smaller first.

    Of faces on one surface those come first that reach as far as the blend, for others part from it when a number changes, then those of
    one leaf.
    """
    assert target.mesh is not None
    slack = NEAR * max(chain.sizes) + NEAR_PART * float(np.linalg.norm(target.mesh.extents))
    beside: list[dict[Face, bool]] = []
    for side in blend.sides[:2]:
        there = np.unique(_along_side(side, blend.corners, slack), axis=0)  # however many triangles each is a corner of
        found = [face for face, surface in faces if _is_beside(surface, side, there, slack)]
        # a blend may go on beyond the end of a face, round a corner
        beside.append({face: bool(np.median(np.abs(program_sdf(parts[face.leaf], there))) <= slack) for face in found})
    if blend.sizes[0] > blend.sizes[-1]:
        beside.reverse()
    one, two = beside
    pairs = [(a, b) for a in one for b in two if a != b]
    yield from sorted(pairs, key=lambda p: (one[p[0]] + two[p[1]], p[0].leaf == p[1].leaf), reverse=True)


def _along_side(side: Surface, corners: np.ndarray, slack: float) -> np.ndarray:
    """Those corners of a blend that lie on a side of it."""
    off = np.abs(signed_distance(side, corners))
    return corners[off <= off.min() + slack / 2]


def _is_beside(surface: Surface, side: Surface, there: np.ndarray, slack: float) -> bool:
    """Whether a face of the program lies where a blend's side does, by the corners of the blend on that side."""
    if (np.abs(signed_distance(surface, there)) > slack).any():
        return False
    return bool((np.abs((normals(surface, there) * normals(side, there)).sum(1)) > ALIGNED).all())


def _borne_out(
    program: Program, solid: Manifold, wanted: Manifold, feature: EdgeFeature | None, taken: Sequence[BlendedEdge]
) -> dict[tuple[Face, Face], list[BlendedEdge]]:
    """Those edges of a feature that make the solid of a program more like the one `wanted`, with their stretches, but for edges that run
    along those `taken`, or others of these: faces of several primitives may lie in one plane. What is shorter than half its size is where
    faces cross by chance, and gone when a number changes; so is what goes on beyond another edge by no more."""
    if feature is None:
        return {}
    found = find_edges(program, [feature]).edges
    pieces = sweep_blends(found)[: len(found)]
    kept: dict[tuple[Face, Face], list[BlendedEdge]] = {}
    for k, edge in enumerate(feature.edges):
        known = [*taken, *(e for some in kept.values() for e in some)]
        right = whole = 0.0
        stretches = ((e, piece, _own_length(e, known)) for e, piece in zip(found, pieces, strict=True) if e.edge == k)
        own = [stretch for stretch in stretches if stretch[2] > 0]
        for _, piece, _ in own:
            blend = to_manifold(piece.solid)
            part = (blend ^ solid) if piece.cuts else (blend - solid)
            volume, inside = part.volume(), (part ^ wanted).volume()
            whole += volume
            right += volume - inside if piece.cuts else inside
        if right > RIGHT * whole > 0 and sum(length for _, _, length in own) >= SHORTEST * max(feature.sizes):
            kept[edge] = [e for e, _, _ in own]
    return kept


def _is_followed(blend: Blend, pairs: Sequence[tuple[Face, Face]], runs: Mapping[tuple[Face, Face], Sequence[BlendedEdge]]) -> bool:
    """Whether edges between some of the `pairs` of faces beside a blend follow most of it: what follows less of it is part of another face
    that ends elsewhere, or has no room for it once a number changes."""
    return sum(edge.share_of(blend.corners) for pair in pairs for edge in runs.get(pair, ())) >= FOLLOWED


def _own_length(edge: BlendedEdge, others: Sequence[BlendedEdge]) -> float:
    """How long an edge is where it does not run along others."""
    count = int(np.clip(PER_SIZE * edge.length / edge.size, *PLACES))
    low, high = edge.stretch.low, edge.stretch.high
    middles = low + (high - low) * (np.arange(count) + 0.5) / count
    points = edge.track.at(middles, np.zeros((count, 2)))
    free = np.all([other.distances(points) >= NEAR * edge.size for other in others], axis=0) if others else np.ones(count, bool)
    return edge.length * float(free.mean())
