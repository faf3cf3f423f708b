"""The solids of edge features: what a chamfer or a fillet of a convex edge takes off, and what one of a concave edge fills in.

Along each stretch of an edge the section of the blend is swept: an extrusion, or a turned outline. Where the edge ends in the air the sweep
goes on, so that blends mitre; where two blends meet round a corner of the other sense, what both would take by going on is theirs too.
Where three fillets of one radius meet, a ball rolls into the corner.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.geometry.blended_edge import BlendedEdge, Interval, Track, meet_faces
from imdim.geometry.corner_balls import find_corner_balls
from imdim.geometry.near_pairs import near_pairs
from imdim.geometry.rotations import cross, euler_from_matrix
from imdim.geometry.solid import SEGMENTS, bounds_of, surface_with_owners, to_manifold, without_slivers
from imdim.geometry.surface import vec
from imdim.program.edges import EdgeFeature, EdgeKind
from imdim.program.outline import Outline, Vertex
from imdim.program.tree import FULL_TURN, Combine, Primitive, Program, combine_all, leaves

if TYPE_CHECKING:
    import trimesh

BEYOND = 0.25  # of a blend's size, by which its section goes past the two faces, so that no skin stays
GO_ON = 2.0  # times its size, by which a blend goes on where its edge ends in the air
JOIN = 1e-6  # of its size, by which it goes into the next one, so that no fin stays between
SKIN = 2e-8  # of the diagonal, below which what separates two faces is rounding
MEET = 1e-3  # of its size, within which ends of two blends are one corner
ALIGNED = 0.1  # sine, below which two blends have one direction

Corner = tuple[float, float]


class BlendSolid(NamedTuple):
    """One piece of a blend: the number of its feature and of its edge there, whether it is taken off, and its solid."""

    feature: int
    edge: int
    cuts: bool
    solid: Program


@dataclass(frozen=True)
class Blends:
    """What edge features do to a solid; `missing` are the numbers of features and edges in which the solid has no edge (any more)."""

    pieces: tuple[BlendSolid, ...]
    missing: tuple[tuple[int, int], ...]


def blend_pieces(edges: Sequence[BlendedEdge]) -> tuple[BlendSolid, ...]:
    """The solids of the blends of some edges of one program: their sweeps, and what balls leave of the corners in which three meet."""
    balls = (BlendSolid(b.edge.feature, b.edge.edge, b.edge.stretch.is_convex, b.solid) for b in find_corner_balls(edges))
    return (*sweep_blends(edges), *balls)


def sweep_blends(edges: Sequence[BlendedEdge]) -> tuple[BlendSolid, ...]:
    """The sweeps of the blends of some edges of one program, which mitre in all corners: those of each edge in turn, then of corners."""
    pieces = [BlendSolid(e.feature, e.edge, e.stretch.is_convex, sweep_edge(e, *_lengths(e))) for e in edges]
    return (*pieces, *_corners(edges))


@lru_cache(maxsize=1024)  # edges that an edit leaves where they are stay the same objects
def sweep_edge(edge: BlendedEdge, low: float, high: float) -> Primitive:
    """The blend of one stretch, going on by lengths `low` and `high` at its ends."""
    track, stretch = edge.track, edge.stretch
    loop = _section(track, stretch, edge.sizes, edge.kind)
    scale = track.radius if track.is_round else 1.0
    low, high = (0.0, 0.0) if stretch.is_closed else (low / scale, high / scale)  # all around there is nothing to go into
    start, end = stretch.low - low, stretch.high + high
    if track.is_round:
        return _turned(track, loop, start, FULL_TURN if stretch.is_closed else math.degrees(end - start))
    return _extruded(track, loop, start, end)


def blend_solids(program: Program, features: Sequence[EdgeFeature]) -> Blends:
    """The solids of edge features of `program`, and which of their edges are none."""
    return _blend_solids(program, tuple(features))


@lru_cache(maxsize=8)  # one delivery asks for those of one program many times
def _blend_solids(program: Program, features: tuple[EdgeFeature, ...]) -> Blends:
    from imdim.geometry.edges import find_edges  # with it come compiled kernels, which the process that writes STEP does without

    found = find_edges(program, features)
    return Blends(blend_pieces(found.edges), found.missing)


def with_edges(program: Program, features: Sequence[EdgeFeature]) -> Program:
    """The program with its edge features as ordinary primitives: what they fill is united with it, what they take off is cut."""
    return program if not features else join_blends(program, blend_solids(program, features))


def solid_with_edges(
    program: Program, features: Sequence[EdgeFeature], segments: int = SEGMENTS, build: Callable[[Program, int], Manifold] = to_manifold
) -> Manifold:
    """The exact solid of a program with its edge features, as `build` makes it, without the skins and ledges that rounding leaves where
    blends meet walls."""
    if not features:
        return build(program, segments)
    solid = build(with_edges(program, features), segments)
    low, high = bounds_of(solid)
    skin = max(SKIN * float(np.linalg.norm(high - low)), 10 * JOIN * max(max(f.sizes) for f in features))
    return without_slivers(solid.as_original(), skin)


def surface_with_edges(program: Program, features: Sequence[EdgeFeature], segments: int = SEGMENTS) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The surface of a program with its edge features, and for each of its faces [f] the number of the leaf that made it; what a blend made
    belongs to the leaf of the first face of its edge."""
    blends = blend_solids(program, features)
    surface, owners = surface_with_owners(join_blends(program, blends), segments)
    made_by = [features[p.feature].edges[p.edge][0].leaf for p in _in_order(blends) for _ in leaves(p.solid)]
    return surface, np.array([*range(sum(1 for _ in leaves(program))), *made_by])[owners]


def surface_with_blends(program: Program, blends: Blends, segments: int = SEGMENTS) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The surface of a program with `blends`, and for each of its faces [f] the number of the leaf that made it; the number of the feature
    after those of the leaves for what a blend made."""
    surface, owners = surface_with_owners(join_blends(program, blends), segments)
    count = sum(1 for _ in leaves(program))
    return surface, np.array([*range(count), *(count + p.feature for p in _in_order(blends) for _ in leaves(p.solid))])[owners]


def _in_order(blends: Blends) -> list[BlendSolid]:
    """The pieces as `join_blends` joins them."""
    return [*(p for p in blends.pieces if not p.cuts), *(p for p in blends.pieces if p.cuts)]


def join_blends(program: Program, blends: Blends) -> Program:
    """A program with what blends do to it."""
    fills = [piece.solid for piece in blends.pieces if not piece.cuts]
    cuts = [piece.solid for piece in blends.pieces if piece.cuts]
    filled = combine_all("union", [program, *fills])
    return combine_all("difference", [filled, *cuts])


def _lengths(s: BlendedEdge) -> tuple[float, float]:
    """By how much a blend goes on at its two ends: into the next one so little that its facets stay those of its wall."""
    low, high = ((GO_ON if goes_on else JOIN) * s.size for goes_on in s.goes_on)
    return low, high


# --- their solids ----------------------------------------------------------------------------------------------------


def _section(track: Track, stretch: Interval, sizes: tuple[float, float], kind: EdgeKind) -> tuple[Vertex, ...]:
    """The section of a blend about the edge's point, counter-clockwise."""
    inward, (a, b), half = meet_faces(track.normals, stretch.sides, sizes, kind)
    beyond = BEYOND * max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    if track.is_round:
        beyond = min(beyond, track.radius / 4)
    corner = np.linalg.solve(inward, np.array([-beyond, -beyond]))
    ring = [a, b, b - inward[1] * beyond, corner, a - inward[0] * beyond]
    bulge = math.tan((math.pi - 2 * half) / 4) if kind == "fillet" else 0.0
    x, y = np.array(ring).T
    if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0:
        return tuple((float(p[0]), float(p[1]), -bulge if k == 0 else 0.0) for k, p in enumerate(ring))
    ring = [b, a, *ring[:1:-1]]
    return tuple((float(p[0]), float(p[1]), -bulge if k == 0 else 0.0) for k, p in enumerate(ring))


def _extruded(track: Track, loop: tuple[Vertex, ...], start: float, end: float) -> Primitive:
    outline, (x, y) = _centred(loop)
    center = track.origin + track.frame @ np.array([x, y, (start + end) / 2])
    return Primitive("extrude", (end - start,), vec(center), euler_from_matrix(track.frame), outline)


def _turned(track: Track, loop: tuple[Vertex, ...], start: float, degrees: float) -> Primitive:
    loop = tuple((x + track.radius, y, bulge) for x, y, bulge in loop)
    low = min(y for _, y, _ in loop)
    middle = (low + max(y for _, y, _ in loop)) / 2
    outline = Outline((tuple((max(x, 0.0), y - middle, bulge) for x, y, bulge in loop),))
    cosine, sine = math.cos(start), math.sin(start)
    frame = track.frame @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    center = track.origin + track.frame[:, 2] * middle
    return Primitive("revolve", (min(degrees, FULL_TURN),), vec(center), euler_from_matrix(frame), outline)


def _centred(loop: tuple[Vertex, ...]) -> tuple[Outline, Corner]:
    """A loop as an outline about the middle of its box, and that."""
    x = (min(v[0] for v in loop) + max(v[0] for v in loop)) / 2
    y = (min(v[1] for v in loop) + max(v[1] for v in loop)) / 2
    return Outline((loop,)).shift(-x, -y), (x, y)


def _corners(swept: Sequence[BlendedEdge]) -> Iterator[BlendSolid]:
    """Where two blends of a feature end in one corner and neither goes on: what both would reach if they did."""
    ends = [(s, k) for s in swept if not s.stretch.is_closed for k in (0, 1) if not s.goes_on[k]]
    if not ends:
        return
    at = np.array([s.end(k) for s, k in ends])
    for i, j in near_pairs(at, MEET * max(s.size for s, _ in ends)):
        (a, k), (b, m) = ends[i], ends[j]
        if a is b or a.feature != b.feature or a.stretch.is_convex != b.stretch.is_convex:
            continue
        if np.linalg.norm(at[i] - at[j]) > MEET * a.size or np.linalg.norm(cross(a.direction(at[i]), b.direction(at[i]))) < ALIGNED:
            continue
        one, two = (sweep_edge(s, *((GO_ON * s.size if e == end else 0.0) for e in (0, 1))) for s, end in ((a, k), (b, m)))
        yield BlendSolid(a.feature, a.edge, a.stretch.is_convex, Combine("intersection", one, two))
