"""The solids of edge features: what a chamfer or a fillet of a convex edge takes off, and what one of a concave edge fills in.

Two faces meet in a line or, about a common axis, in a circle. Where along it the solid has an edge is asked of the solid: around a point of
it there are four quadrants between the two faces, and one of them alone is material (a convex edge) or alone is air (a concave one). There
the section of the blend is swept along: an extrusion, or a turned outline. Where an edge ends in the air the sweep goes on, so that blends
mitre; where two blends meet round a corner of the other sense, what both would take by going on is theirs too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.faces import carrier, corners
from imdim.geometry.kernels import inside
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.geometry.solid import SEGMENTS, surface_with_owners, to_manifold
from imdim.geometry.surface import Surface
from imdim.program.edges import EdgeFeature, EdgeKind
from imdim.program.outline import Outline, Vertex, curve_bounds, loop_curves, reverse_loop
from imdim.program.tree import FULL_TURN, Combine, Primitive, Program, Vec3, combine_all, leaves, longest

PARALLEL = 1e-6  # sine, below which directions are one
COAXIAL = 1e-5  # of the program's size, within which two axes are one
LOOK = 2e-3  # of a blend's size: how far from the edge its quadrants are looked at
PER_SIZE = 1.0  # places along an edge that are looked at, per size of the blend
PLACES = (64, 4000)  # at least and at most
PARTS, DIVISIONS = 16, 9  # by which the place where an edge ends is narrowed, each time
BEYOND = 0.25  # of a blend's size, by which its section goes past the two faces, so that no skin stays
GO_ON = 2.0  # times its size, by which a blend goes on where its edge ends in the air
JOIN = 1e-6  # of its size, by which it goes into the next one, so that no fin stays between
SHORTEST = 0.05  # of its size, below which a stretch of an edge is none
SKIN = 2e-8  # of the diagonal, below which what separates two faces is rounding
MEET = 1e-3  # of its size, within which ends of two blends are one corner
ROOM = 0.98  # of the way to where a blend meets a face, which is still face
ROOM_PLACES = np.linspace(0.2, 0.8, 7)  # along an edge
QUADRANTS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])

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


@dataclass(frozen=True)
class _Track:
    """The curve in which two faces meet: a line from `origin` along `axis`, or with a `radius` a circle about that axis. `normals` [2, 2]
    are those of the two faces in the section: across the line along the first two columns of `frame`, in the half plane (r, z) of the
    circle."""

    origin: np.ndarray
    frame: np.ndarray
    normals: np.ndarray
    radius: float = 0.0

    @property
    def is_round(self) -> bool:
        return self.radius > 0

    def at(self, t: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Points [n, 3] at lengths or angles `t` [n], moved by `across` [n, 2] in the section."""
        if not self.is_round:
            return self.origin + t[:, None] * self.frame[:, 2] + across @ self.frame[:, :2].T
        r = self.radius + across[:, 0]
        local = np.stack([r * np.cos(t), r * np.sin(t), across[:, 1]], axis=1)
        return self.origin + local @ self.frame.T


class _Interval(NamedTuple):
    """A piece of a track, from `low` to `high`, along which one quadrant (`sides` of the two faces) is material alone, or air alone."""

    low: float
    high: float
    sides: tuple[int, int]
    is_convex: bool
    is_closed: bool = False


@dataclass(frozen=True)
class BlendedEdge:
    """A stretch of an edge of a solid along which edge number `edge` of feature number `feature` is blended: with `sizes`, the first along
    the first face. `goes_on` says for each end whether what lies beyond it is as what the blend is swept through."""

    feature: int
    edge: int
    track: _Track
    stretch: _Interval
    sizes: tuple[float, float]
    kind: EdgeKind
    goes_on: tuple[bool, bool]

    @property
    def size(self) -> float:
        return max(self.sizes)

    @property
    def first_along(self) -> np.ndarray:
        """The unit vector [3] from the middle of the stretch along its first face."""
        inward = self.track.normals * np.array(self.stretch.sides)[:, None]
        middle = np.array([(self.stretch.low + self.stretch.high) / 2])
        return (self.track.at(middle, _into(inward[0], inward[1])[None]) - self.track.at(middle, np.zeros((1, 2))))[0]

    def points(self, count: int) -> np.ndarray:
        """Points [count, 3] along the stretch at equal distances, both ends among them."""
        return self.track.at(np.linspace(self.stretch.low, self.stretch.high, count), np.zeros((count, 2)))

    def distances(self, points: np.ndarray) -> np.ndarray:
        """How far points [n, 3] are from the stretch, [n]."""
        local = (points - self.track.origin) @ self.track.frame
        t = local[:, 2]
        if self.track.is_round:
            middle = (self.stretch.low + self.stretch.high) / 2
            t = middle + np.remainder(np.arctan2(local[:, 1], local[:, 0]) - middle + math.pi, 2 * math.pi) - math.pi
        nearest = t if self.stretch.is_closed else np.clip(t, self.stretch.low, self.stretch.high)
        return np.linalg.norm(points - self.track.at(nearest, np.zeros((len(points), 2))), axis=1)

    def end(self, k: int) -> np.ndarray:
        """The point [3] in which the stretch begins, k = 0, or ends."""
        return self.track.at(np.array([self.stretch[k]]), np.zeros((1, 2)))[0]

    def solid(self, low: float, high: float) -> Primitive:
        """The blend going on by lengths `low` and `high`."""
        loop = _section(self.track.normals, self.stretch.sides, self.sizes, self.kind, self.track.radius)
        scale = self.track.radius if self.track.is_round else 1.0
        start, end = self.stretch.low - low / scale, self.stretch.high + high / scale
        if self.track.is_round:
            return _turned(self.track, loop, start, FULL_TURN if self.stretch.is_closed else math.degrees(end - start))
        return _extruded(self.track, loop, start, end)


class FoundEdges(NamedTuple):
    """Where edge features apply, and the numbers of features and edges that are none of the solid (any more)."""

    edges: tuple[BlendedEdge, ...]
    missing: tuple[tuple[int, int], ...]


def find_edges(program: Program, features: Sequence[EdgeFeature]) -> FoundEdges:
    """Where the solid of `program` has the edges of its features."""
    numbers, parts = lower(program), list(leaves(program))
    reach = _reach(program)
    edges: list[BlendedEdge] = []
    missing: list[tuple[int, int]] = []
    for i, feature in enumerate(features):
        sizes = (feature.sizes[0], feature.sizes[-1])
        for k, (one, two) in enumerate(feature.edges):
            given = [(face, parts[face.leaf]) for face in (one, two) if face.leaf < len(parts)]
            pair = [surface for face, leaf in given if (surface := carrier(face, leaf, numbers)) is not None]
            ends = [points for face, leaf in given if len(points := corners(face, leaf, numbers))]
            found = list(_along(numbers, pair[0], pair[1], max(sizes), reach, ends)) if len(pair) == 2 else []
            edges += [BlendedEdge(i, k, track, stretch, sizes, feature.kind, goes_on) for track, stretch, goes_on in found]
            missing += [] if found else [(i, k)]
    return FoundEdges(tuple(edges), tuple(missing))


def has_room(solid: Lowered, edge: BlendedEdge) -> bool:
    """Whether both faces of a blend reach as far as it does, at most of the places that are looked at."""
    inward, feet, _ = _feet(edge.track.normals, edge.stretch.sides, edge.sizes, edge.kind)
    low, high, _, is_convex, _ = edge.stretch
    t = low + (high - low) * ROOM_PLACES
    step = LOOK * edge.size
    for normal, foot in zip(inward, feet, strict=True):
        on, off = (
            inside(solid, edge.track.at(t, np.broadcast_to(ROOM * foot + way * step * normal, (len(t), 2)))) == is_convex for way in (1, -1)
        )
        if (on & ~off).mean() < 0.5:
            return False
    return True


def sweep_blends(edges: Sequence[BlendedEdge]) -> tuple[BlendSolid, ...]:
    """The solids of the blends of some edges of one program."""
    pieces = [BlendSolid(e.feature, e.edge, e.stretch.is_convex, e.solid(*_lengths(e))) for e in edges]
    return (*pieces, *_corners(edges))


def blend_solids(program: Program, features: Sequence[EdgeFeature]) -> Blends:
    """The solids of edge features of `program`, and which of their edges are none."""
    return _blend_solids(program, tuple(features))


@lru_cache(maxsize=8)  # one delivery asks for those of one program many times
def _blend_solids(program: Program, features: tuple[EdgeFeature, ...]) -> Blends:
    found = find_edges(program, features)
    return Blends(sweep_blends(found.edges), found.missing)


def with_edges(program: Program, features: Sequence[EdgeFeature]) -> Program:
    """The program with its edge features as ordinary primitives: what they fill is united with it, what they take off is cut."""
    return program if not features else join_blends(program, blend_solids(program, features))


def solid_with_edges(program: Program, features: Sequence[EdgeFeature], segments: int = SEGMENTS) -> Manifold:
    """The exact solid of a program with its edge features, without the skins and ledges that rounding leaves where blends meet walls."""
    if not features:
        return to_manifold(program, segments)
    solid = to_manifold(with_edges(program, features), segments)
    low, high = np.array(solid.bounding_box()).reshape(2, 3)
    skin = max(SKIN * float(np.linalg.norm(high - low)), 10 * JOIN * max(max(f.sizes) for f in features))
    return solid.as_original().simplify(skin)


def surface_with_edges(program: Program, features: Sequence[EdgeFeature], segments: int = SEGMENTS) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The surface of a program with its edge features, and for each of its faces [f] the number of the leaf that made it; what a blend made
    belongs to the leaf of the first face of its edge."""
    blends = blend_solids(program, features)
    pieces = [*(p for p in blends.pieces if not p.cuts), *(p for p in blends.pieces if p.cuts)]
    made_by = [features[p.feature].edges[p.edge][0].leaf for p in pieces for _ in leaves(p.solid)]
    surface, owners = surface_with_owners(join_blends(program, blends), segments)
    return surface, np.array([*range(sum(1 for _ in leaves(program))), *made_by])[owners]


def join_blends(program: Program, blends: Blends) -> Program:
    """A program with what blends do to it."""
    fills = [piece.solid for piece in blends.pieces if not piece.cuts]
    cuts = [piece.solid for piece in blends.pieces if piece.cuts]
    filled = combine_all("union", [program, *fills])
    return combine_all("difference", [filled, *cuts])


def gather_pieces(pieces: Sequence[BlendSolid]) -> list[BlendSolid]:
    """The pieces, those that are extruded along one direction between the same two levels as one outline of several loops."""
    groups: list[list[BlendSolid]] = []
    for piece in pieces:
        like = next((g for g in groups if _can_share(g, piece)), None)
        if like is None:
            groups.append([piece])
        else:
            like.append(piece)
    return [group[0] if len(group) == 1 else group[0]._replace(solid=_shared([p.solid for p in group])) for group in groups]


def _can_share(group: Sequence[BlendSolid], piece: BlendSolid) -> bool:
    """Whether a piece goes along with a group of them, and lies beside them all."""
    first, other = group[0], piece.solid
    if (first.feature, first.cuts) != (piece.feature, piece.cuts):
        return False
    if not all(isinstance(p, Primitive) and p.kind == "extrude" for p in (first.solid, other)):
        return False
    assert isinstance(first.solid, Primitive)
    assert isinstance(other, Primitive)
    turn, own = matrix_from_euler(first.solid.rotation), matrix_from_euler(other.rotation)
    height = first.solid.size[0]
    level = float((np.asarray(other.center) - first.solid.center) @ turn[:, 2])
    if abs(abs(own[:, 2] @ turn[:, 2]) - 1) > PARALLEL**2 or max(abs(level), abs(other.size[0] - height)) > COAXIAL * height:
        return False
    bounds = [curve_bounds(loop_curves(_loop_in(first.solid, p.solid))) for p in (*group, piece)]
    (left, bottom), (right, top) = bounds[-1]
    return not any(left < high[0] and low[0] < right and bottom < high[1] and low[1] < top for low, high in bounds[:-1])


def _shared(parts: Sequence[Program]) -> Primitive:
    """Extrusions that `_can_share` as one."""
    first = parts[0]
    assert isinstance(first, Primitive)
    loops = tuple(_loop_in(first, part) for part in parts)
    (left, low), (right, high) = Outline(loops).bounds
    x, y = (left + right) / 2, (low + high) / 2
    turn = matrix_from_euler(first.rotation)
    return replace(first, center=_vec3(first.center + turn[:, 0] * x + turn[:, 1] * y), outline=Outline(loops).shift(-x, -y))


def _loop_in(first: Primitive, part: Program) -> tuple[Vertex, ...]:
    """The loop of an extrusion in the frame of another one along the same line, either way."""
    assert isinstance(part, Primitive)
    assert part.outline is not None
    turn, own = matrix_from_euler(first.rotation), matrix_from_euler(part.rotation)
    same = float(own[:, 2] @ turn[:, 2]) > 0
    loop = np.array(part.outline.loops[0])
    world = np.asarray(part.center) + loop[:, :2] @ own[:, :2].T
    flat = (world - first.center) @ turn[:, :2]
    placed = tuple((float(x), float(y), float(b) if same else -float(b)) for (x, y), b in zip(flat, loop[:, 2], strict=True))
    return placed if same else reverse_loop(placed)


def _reach(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """A ball that holds the program: its centre, and its radius as an array of one."""
    parts = list(leaves(program))
    centers = np.array([p.center for p in parts])
    middle = (centers.min(0) + centers.max(0)) / 2
    return middle, np.array([np.linalg.norm(np.ptp(centers, axis=0)) + 2 * longest(parts)])


def _lengths(s: BlendedEdge) -> tuple[float, float]:
    """By how much a blend goes on at its two ends: into the next one so little that its facets stay those of its wall."""
    low, high = ((GO_ON if goes_on else JOIN) * s.size for goes_on in s.goes_on)
    return low, high


# --- where the edges are ---------------------------------------------------------------------------------------------


def _along(
    solid: Lowered, one: Surface, two: Surface, size: float, reach: tuple[np.ndarray, np.ndarray], ends: Sequence[np.ndarray]
) -> Iterator[tuple[_Track, _Interval, tuple[bool, bool]]]:
    """Where a solid has an edge between two carriers, and whether it ends in the air (in material, of a concave edge) at either end.

    It is no longer than the faces, of which `ends` are corners: where one touches the next, the solid alone does not show where it ends.
    """
    middle, radius = reach
    for track in _tracks(one, two, COAXIAL * float(radius[0])):
        if track.is_round:
            span = (0.0, 2 * math.pi)
            places = track.radius * 2 * math.pi / size * PER_SIZE
        else:
            at = float((middle - track.origin) @ track.frame[:, 2])
            along = [(points - track.origin) @ track.frame[:, 2] for points in ends]
            low = max([at - float(radius[0]), *(float(t.min()) for t in along)])
            high = min([at + float(radius[0]), *(float(t.max()) for t in along)])
            if high - low < SHORTEST * size:
                continue
            span, places = (low, high), (high - low) / size * PER_SIZE
        t = np.linspace(*span, int(np.clip(places, *PLACES)))
        step = LOOK * size
        codes = _codes(solid, track, t, step)
        for stretch in _stretches(solid, track, t, codes, step):
            stretch = _clip(track, stretch, ends)
            length = (stretch.high - stretch.low) * (track.radius or 1.0)
            if length > SHORTEST * size:
                yield track, stretch, _ends(solid, track, stretch, step)


def _clip(track: _Track, stretch: _Interval, ends: Sequence[np.ndarray]) -> _Interval:
    """The stretch, as far as faces with the points `ends` go: corners of a flat one, of an arc its two ends and its middle."""
    low, high = stretch.low, stretch.high
    for points in ends:
        local = (points - track.origin) @ track.frame
        if not track.is_round:
            low, high = max(low, float(local[:, 2].min())), min(high, float(local[:, 2].max()))
        elif len(points) == 3:
            first, _, middle = np.arctan2(local[:, 1], local[:, 0])
            half = abs((first - middle + math.pi) % (2 * math.pi) - math.pi)
            middle += 2 * math.pi * round(((low + high) / 2 - middle) / (2 * math.pi))
            low, high = (middle - half, middle + half) if stretch.is_closed else (max(low, middle - half), min(high, middle + half))
            stretch = stretch._replace(is_closed=False)
    return stretch._replace(low=low, high=high)


def _codes(solid: Lowered, track: _Track, t: np.ndarray, step: float) -> np.ndarray:
    """For each place [n] of a track: q + 1 where quadrant q alone is material, -q - 1 where it alone is air, else 0."""
    ways = QUADRANTS @ np.linalg.inv(track.normals).T * step
    where = np.concatenate([track.at(t, np.broadcast_to(way, (len(t), 2))) for way in ways])
    held = inside(solid, where).reshape(4, len(t))
    count = held.sum(0)
    return np.where(count == 1, held.argmax(0) + 1, np.where(count == 3, -held.argmin(0) - 1, 0))


def _stretches(solid: Lowered, track: _Track, t: np.ndarray, codes: np.ndarray, step: float) -> Iterator[_Interval]:
    """Runs of one code, their ends found by halving."""
    if track.is_round:
        if (codes == codes[0]).all():
            if codes[0]:
                yield _stretch(t[0], t[-1], int(codes[0]), is_closed=True)
            return
        # begin where the code changes, so that no run lies across the cut
        first = int(np.flatnonzero(codes[:-1] != codes[1:])[0]) + 1
        t = np.concatenate([t[first:-1], t[: first + 1] + 2 * math.pi])
        codes = np.concatenate([codes[first:-1], codes[: first + 1]])
    change = np.flatnonzero(codes[:-1] != codes[1:])
    low, high = t[change], t[change + 1]
    for _ in range(DIVISIONS if len(change) else 0):
        inner = low + (high - low) * np.linspace(0, 1, PARTS + 1)[1:-1, None]
        before = _codes(solid, track, inner.ravel(), step).reshape(inner.shape) == codes[change]
        # the last place that is as the low end, all before it being so too
        kept = np.cumprod(before, axis=0).sum(0)
        width = (high - low) / PARTS
        low, high = low + kept * width, low + (kept + 1) * width
    bounds = (low + high) / 2
    if track.is_round:
        # the run that begins at the first place begins at the last change, a turn earlier
        yield from (_stretch(b - 2 * math.pi, c, int(codes[0])) for b, c in [(bounds[-1], bounds[0])] if codes[0])
    else:
        bounds = np.concatenate([t[:1], bounds, t[-1:]])
        change = np.concatenate([[-1], change])
    for k in range(len(bounds) - 1):
        if code := int(codes[change[k] + 1]):
            yield _stretch(bounds[k], bounds[k + 1], code)


def _stretch(low: float, high: float, code: int, is_closed: bool = False) -> _Interval:
    one, two = QUADRANTS[abs(code) - 1]
    return _Interval(float(low), float(high), (int(one), int(two)), code > 0, is_closed)


def _ends(solid: Lowered, track: _Track, stretch: _Interval, step: float) -> tuple[bool, bool]:
    """Whether just beyond each end, within the quadrant, there is air (material, of a concave edge)."""
    if stretch.is_closed:
        return False, False
    way = np.array(stretch.sides) @ np.linalg.inv(track.normals).T * step
    past = 10 * step / (track.radius or 1.0)
    where = track.at(np.array([stretch.low - past, stretch.high + past]), np.broadcast_to(way, (2, 2)))
    low, high = inside(solid, where) != stretch.is_convex
    return bool(low), bool(high)


def _tracks(one: Surface, two: Surface, slack: float) -> Iterator[_Track]:
    """The lines or circles in which two carriers meet under an angle that does not change along them."""
    if one.kind == two.kind == "plane":
        a, b = np.asarray(one.axis), np.asarray(two.axis)
        along = np.cross(a, b)
        if np.linalg.norm(along) < PARALLEL:
            return
        along /= np.linalg.norm(along)
        origin = np.linalg.solve(np.stack([a, b, along]), np.array([a @ one.point, b @ two.point, 0.0]))
        frame = frame_from_axis(along)
        yield _Track(origin, frame, np.stack([a @ frame[:, :2], b @ frame[:, :2]]))
        return
    round_one = one if one.kind in ("cylinder", "cone") else two
    if round_one.kind not in ("cylinder", "cone"):
        return
    axis, origin = np.asarray(round_one.axis), np.asarray(round_one.point)
    lines = [line for surface in (one, two) if (line := _profile(surface, origin, axis, slack)) is not None]
    if len(lines) < 2:
        return
    (n1, d1), (n2, d2) = lines
    normals = np.stack([n1, n2])
    if abs(np.linalg.det(normals)) < PARALLEL:
        return
    r, z = np.linalg.solve(normals, np.array([d1, d2]))
    if r > slack:
        yield _Track(origin + z * axis, frame_from_axis(axis), normals, float(r))


def _profile(surface: Surface, origin: np.ndarray, axis: np.ndarray, slack: float) -> tuple[np.ndarray, float] | None:
    """The line n . (r, z) = d that a carrier shows in a half plane beside an axis, None where it is not turned about that."""
    own = np.asarray(surface.axis)
    away = np.asarray(surface.point) - origin
    if np.linalg.norm(np.cross(own, axis)) > PARALLEL:
        return None
    way = math.copysign(1.0, float(own @ axis))
    if surface.kind == "plane":
        return np.array([0.0, 1.0]), float(away @ axis)
    if np.linalg.norm(np.cross(away, axis)) > slack:
        return None
    if surface.kind == "cylinder":
        return np.array([1.0, 0.0]), surface.sizes[0]
    if surface.kind == "cone":
        half = surface.sizes[0]
        normal = np.array([math.cos(half), -way * math.sin(half)])
        return normal, float(normal[1] * (away @ axis))
    return None


# --- their solids ----------------------------------------------------------------------------------------------------


def _section(normals: np.ndarray, sides: tuple[int, int], sizes: tuple[float, float], kind: EdgeKind, radius: float) -> tuple[Vertex, ...]:
    """The section of a blend about the edge's point, counter-clockwise."""
    inward, (a, b), half = _feet(normals, sides, sizes, kind)
    beyond = BEYOND * max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    if radius:
        beyond = min(beyond, radius / 4)
    corner = np.linalg.solve(inward, np.array([-beyond, -beyond]))
    ring = [a, b, b - inward[1] * beyond, corner, a - inward[0] * beyond]
    bulge = math.tan((math.pi - 2 * half) / 4) if kind == "fillet" else 0.0
    x, y = np.array(ring).T
    if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0:
        return tuple((float(p[0]), float(p[1]), -bulge if k == 0 else 0.0) for k, p in enumerate(ring))
    ring = [b, a, *ring[:1:-1]]
    return tuple((float(p[0]), float(p[1]), -bulge if k == 0 else 0.0) for k, p in enumerate(ring))


def _feet(
    normals: np.ndarray, sides: tuple[int, int], sizes: tuple[float, float], kind: str
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], float]:
    """In a section about the edge's point: the normals [2, 2] from both faces into the quadrant, where the blend meets either face, and
    half the angle between these."""
    inward = normals * np.array(sides)[:, None]
    along = np.array([_into(inward[0], inward[1]), _into(inward[1], inward[0])])
    half = math.acos(float(np.clip(along[0] @ along[1], -1, 1))) / 2
    one, two = (s / math.tan(half) if kind == "fillet" else s for s in sizes)
    return inward, (along[0] * one, along[1] * two), half


def _into(normal: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The unit vector across `normal` that leads to where `other` points."""
    way = np.array([-normal[1], normal[0]])
    return way if way @ other > 0 else -way


def _extruded(track: _Track, loop: tuple[Vertex, ...], start: float, end: float) -> Primitive:
    outline, (x, y) = _centred(loop)
    center = track.origin + track.frame @ np.array([x, y, (start + end) / 2])
    return Primitive("extrude", (end - start,), _vec3(center), euler_from_matrix(track.frame), outline)


def _turned(track: _Track, loop: tuple[Vertex, ...], start: float, degrees: float) -> Primitive:
    loop = tuple((x + track.radius, y, bulge) for x, y, bulge in loop)
    low = min(y for _, y, _ in loop)
    middle = (low + max(y for _, y, _ in loop)) / 2
    outline = Outline((tuple((max(x, 0.0), y - middle, bulge) for x, y, bulge in loop),))
    cosine, sine = math.cos(start), math.sin(start)
    frame = track.frame @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    center = track.origin + track.frame[:, 2] * middle
    return Primitive("revolve", (min(degrees, FULL_TURN),), _vec3(center), euler_from_matrix(frame), outline)


def _centred(loop: tuple[Vertex, ...]) -> tuple[Outline, Corner]:
    """A loop as an outline about the middle of its box, and that."""
    x = (min(v[0] for v in loop) + max(v[0] for v in loop)) / 2
    y = (min(v[1] for v in loop) + max(v[1] for v in loop)) / 2
    return Outline((loop,)).shift(-x, -y), (x, y)


def _corners(swept: Sequence[BlendedEdge]) -> Iterator[BlendSolid]:
    """Where two blends of a feature end in one corner and neither goes on: what both would reach if they did."""
    ends = [(s, k, s.end(k)) for s in swept if not s.stretch.is_closed for k in (0, 1) if not s.goes_on[k]]
    for (a, i, p), (b, k, q) in combinations(ends, 2):
        if a is b or a.feature != b.feature or a.stretch.is_convex != b.stretch.is_convex:
            continue
        if np.linalg.norm(p - q) > MEET * a.size or _runs_on(a, b, p):
            continue
        one, two = (s.solid(*((GO_ON * s.size if e == end else 0.0) for e in (0, 1))) for s, end in ((a, i), (b, k)))
        yield BlendSolid(a.feature, a.edge, a.stretch.is_convex, Combine("intersection", one, two))


def _runs_on(a: BlendedEdge, b: BlendedEdge, at: np.ndarray) -> bool:
    """Whether two blends have one direction at a point."""
    return float(np.linalg.norm(np.cross(_direction(a, at), _direction(b, at)))) < 0.1


def _direction(s: BlendedEdge, at: np.ndarray) -> np.ndarray:
    axis = s.track.frame[:, 2]
    if not s.track.is_round:
        return axis
    out = np.cross(axis, at - s.track.origin)
    return out / np.linalg.norm(out)


def _vec3(v: np.ndarray) -> Vec3:
    return (float(v[0]), float(v[1]), float(v[2]))
