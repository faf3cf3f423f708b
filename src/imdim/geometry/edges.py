"""Where the edges of edge features are: the curves in which two faces meet, and the stretches of them along which the solid has an edge.

Two faces meet in a line or, about a common axis, in a circle. Whether the solid has an edge there is asked of the solid: around a point of
the curve there are four quadrants between the two faces, and one of them alone is material (a convex edge) or alone is air (a concave one).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence, Set
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from imdim.geometry.blended_edge import QUADRANTS, BlendedEdge, Interval, Track, meet_faces
from imdim.geometry.faces import carrier, corners
from imdim.geometry.kernels import inside
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.rotations import cross, frame_from_axis
from imdim.geometry.surface import Surface
from imdim.program.edges import EdgeFeature
from imdim.program.tree import Program, leaves, longest

PARALLEL = 1e-6  # sine, below which directions are one
COAXIAL = 1e-5  # of the program's size, within which two axes are one
LOOK = 2e-3  # of a blend's size: how far from the edge its quadrants are looked at
PER_SIZE = 1.0  # places along an edge that are looked at, per size of the blend
PLACES = (64, 4000)  # at least and at most
PARTS, DIVISIONS = 16, 9  # by which the place where an edge ends is narrowed, each time
SHORTEST = 0.05  # of its size, below which a stretch of an edge is none
SMALLEST = 1e-6  # of the program's size, below which a blend cannot be told from a sharp edge
ROOM = 0.98  # of the way to where a blend meets a face, which is still face
ROOM_PLACES = np.linspace(0.2, 0.8, 7)  # along an edge
HAIR = 1e-6  # of a blend's size: how far from an end it is looked whether that moved


class FoundEdges(NamedTuple):
    """Where edge features apply, and the numbers of features and edges that are none of the solid (any more)."""

    edges: tuple[BlendedEdge, ...]
    missing: tuple[tuple[int, int], ...]

    @staticmethod
    def of(features: Sequence[EdgeFeature], found: Sequence[Sequence[BlendedEdge]]) -> FoundEdges:
        """What was `found` of each edge of each feature, in their order."""
        numbers = [(i, k) for i, feature in enumerate(features) for k in range(len(feature.edges))]
        missing = (number for number, edges in zip(numbers, found, strict=True) if not edges)
        return FoundEdges(tuple(edge for edges in found for edge in edges), tuple(missing))


def find_edges(program: Program, features: Sequence[EdgeFeature]) -> FoundEdges:
    """Where the solid of `program` has the edges of its features; none for blends that are larger than it, or too small to be told."""
    meetings = _Meetings(program, features)
    return FoundEdges.of(features, [meetings.edges(i, k) for i, k in meetings.numbers])


class NearbyEdges:
    """Where edges are in programs that differ from one by a little: those whose faces, and ends, are where they were are not looked for
    again, which takes a fifth of the time of finding all."""

    def __init__(self, program: Program, features: Sequence[EdgeFeature]) -> None:
        self._features = tuple(features)
        self._meetings = _Meetings(program, features)
        self._edges = [self._meetings.edges(i, k) for i, k in self._meetings.numbers]
        self._codes = self._look(self._meetings)
        self.found = FoundEdges.of(features, self._edges)

    def at(self, program: Program, features: Sequence[EdgeFeature]) -> FoundEdges:
        """As `find_edges`, of a program and features that have the same edges with other numbers."""
        now = _Meetings(program, features, self._meetings)
        same = self._codes.keys() & now.numbers
        codes = self._look(now) if same else {}
        found = []
        for edges, (i, k) in zip(self._edges, now.numbers, strict=True):
            stays = edges and features[i].sizes == self._features[i].sizes and now.are_like(self._meetings, i, k)
            stays = stays and np.array_equal(codes[i, k], self._codes[i, k])
            found.append(edges if stays else now.edges(i, k))
        return FoundEdges.of(features, found)

    def _look(self, meetings: _Meetings) -> dict[tuple[int, int], np.ndarray]:
        """For the edges that there are, what a program shows on both sides of their ends, where those of the first program are."""
        places, owners = [], []
        for number, edges in zip(meetings.numbers, self._edges, strict=True):
            for edge in edges:
                places.append(_around_ends(edge))
                owners += [number] * len(places[-1])
        if not places:
            return {}
        held = inside(meetings.solid, np.concatenate(places))
        starts = np.flatnonzero([i == 0 or owners[i] != owners[i - 1] for i in range(len(owners))])
        return dict(zip([owners[i] for i in starts], np.split(held, starts[1:]), strict=True))


class _Meetings:
    """The faces of a program that meet in the edges of its features; `numbers` are those of features and their edges."""

    def __init__(self, program: Program, features: Sequence[EdgeFeature], like: _Meetings | None = None) -> None:
        """Of a program that is `like` another one, whose features have the same edges, faces of equal leaves are not placed again."""
        self.solid, self._parts = lower(program), list(leaves(program))
        self._middle, self._radius = _reach(program)
        self._features = features
        self.numbers = [(i, k) for i, feature in enumerate(features) for k in range(len(feature.edges))]
        pairs = enumerate(zip(self._parts, like._parts if like else (), strict=False))
        kept = {number for number, (leaf, other) in pairs if leaf == other}
        self._faces = {number: self._meet(*number, kept, like) for number in self.numbers}

    def _meet(self, i: int, k: int, kept: Set[int], like: _Meetings | None) -> tuple[list[Surface], list[np.ndarray]]:
        if like is not None and all(face.leaf in kept for face in self._features[i].edges[k]):
            return like._faces[i, k]
        given = [(face, self._parts[face.leaf]) for face in self._features[i].edges[k] if face.leaf < len(self._parts)]
        pair = [surface for face, leaf in given if (surface := carrier(face, leaf, self.solid)) is not None]
        return pair, [corners(face, leaf, self.solid) for face, leaf in given]

    def are_like(self, other: _Meetings, i: int, k: int) -> bool:
        """Whether the faces of an edge lie and end where those of another program do."""
        (mine, my_ends), (its, its_ends) = self._faces[i, k], other._faces[i, k]
        if my_ends is its_ends:
            return True
        return mine == its and all(np.array_equal(a, b) for a, b in zip(my_ends, its_ends, strict=True))

    def edges(self, i: int, k: int) -> list[BlendedEdge]:
        """The stretches of one edge; none where there are none."""
        pair, ends = self._faces[i, k]
        feature = self._features[i]
        sizes = (feature.sizes[0], feature.sizes[-1])
        if len(pair) < 2 or not SMALLEST * self._radius < max(sizes) < self._radius:
            return []
        along = _along(self.solid, pair[0], pair[1], max(sizes), self._middle, self._radius, ends)
        return [BlendedEdge(i, k, track, stretch, sizes, feature.kind, goes_on) for track, stretch, goes_on in along]


@lru_cache(1024)  # those of the first program are asked for again for every other one
def _around_ends(edge: BlendedEdge) -> np.ndarray:
    """Points [n, 3] that show where a stretch ends: in all quadrants a hair before and behind, and beyond where it may go on."""
    track, stretch, step = edge.track, edge.stretch, LOOK * edge.size
    ends = np.array([stretch.low, stretch.high])
    hair = HAIR * edge.size / (track.radius or 1.0)
    t = (ends[:, None] + np.array([-hair, hair])).ravel()
    beyond, way = _beyond(track, stretch, step)
    return np.concatenate([track.around(t, track.quadrants * step), track.at(beyond, way)])


def has_room(solid: Lowered, edge: BlendedEdge) -> bool:
    """Whether both faces of a blend reach as far as it does, at most of the places that are looked at."""
    inward, feet, _ = meet_faces(edge.track.normals, edge.stretch.sides, edge.sizes, edge.kind)
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


def _reach(program: Program) -> tuple[np.ndarray, float]:
    """A ball that holds the program: its centre [3] and its radius."""
    parts = list(leaves(program))
    centers = np.array([p.center for p in parts])
    middle = (centers.min(0) + centers.max(0)) / 2
    return middle, float(np.linalg.norm(np.ptp(centers, axis=0))) + 2 * longest(parts)


def _along(
    solid: Lowered, one: Surface, two: Surface, size: float, middle: np.ndarray, radius: float, ends: Sequence[np.ndarray]
) -> Iterator[tuple[Track, Interval, tuple[bool, bool]]]:
    """Where a solid has an edge between two carriers, and whether it ends in the air (in material, of a concave edge) at either end.

    The solid lies within `radius` of `middle`. An edge is no longer than the faces, of which `ends` are corners, none for those that have
    no end along it: where one touches the next, the solid alone does not show where it ends.
    """
    for track in tracks_between(one, two, COAXIAL * radius):
        if track.is_round:
            span = (0.0, 2 * math.pi)
            places = track.radius * 2 * math.pi / size * PER_SIZE
        else:
            at = float((middle - track.origin) @ track.frame[:, 2])
            if not _is_across(track, ends, COAXIAL * radius):
                continue
            along = [(points - track.origin) @ track.frame[:, 2] for points in ends if len(points)]
            low = max([at - radius, *(float(t.min()) for t in along)])
            high = min([at + radius, *(float(t.max()) for t in along)])
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


def _is_across(track: Track, ends: Sequence[np.ndarray], slack: float) -> bool:
    """Whether a line lies on both faces and not beside one, in the plane of that, where another face may be."""
    for normal, points in zip(track.normals, ends, strict=True):
        if len(points) == 4:
            across = (points - track.origin) @ track.frame[:, :2] @ np.array([-normal[1], normal[0]]) / np.linalg.norm(normal)
            if not across.min() - slack <= 0 <= across.max() + slack:
                return False
    return True


def _clip(track: Track, stretch: Interval, ends: Sequence[np.ndarray]) -> Interval:
    """The stretch, as far as faces with the points `ends` go: corners of a flat one, of an arc its two ends and its middle."""
    low, high = stretch.low, stretch.high
    for points in (points for points in ends if len(points)):
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


def _codes(solid: Lowered, track: Track, t: np.ndarray, step: float) -> np.ndarray:
    """For each place [n] of a track: q + 1 where quadrant q alone is material, -q - 1 where it alone is air, else 0."""
    held = inside(solid, track.around(t, track.quadrants * step)).reshape(4, len(t))
    count = held.sum(0)
    return np.where(count == 1, held.argmax(0) + 1, np.where(count == 3, -held.argmin(0) - 1, 0))


def _stretches(solid: Lowered, track: Track, t: np.ndarray, codes: np.ndarray, step: float) -> Iterator[Interval]:
    """Runs of one code, their ends found by dividing."""
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


def _stretch(low: float, high: float, code: int, is_closed: bool = False) -> Interval:
    one, two = QUADRANTS[abs(code) - 1]
    return Interval(float(low), float(high), (int(one), int(two)), code > 0, is_closed)


def _ends(solid: Lowered, track: Track, stretch: Interval, step: float) -> tuple[bool, bool]:
    """Whether just beyond each end, within the quadrant, there is air (material, of a concave edge)."""
    if stretch.is_closed:
        return False, False
    low, high = inside(solid, track.at(*_beyond(track, stretch, step))) != stretch.is_convex
    return bool(low), bool(high)


def _beyond(track: Track, stretch: Interval, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Places [2] along a track just beyond both ends of a stretch, and where [2, 2] in the section its quadrant is."""
    way = np.array(stretch.sides) @ np.linalg.inv(track.normals).T * step
    past = 10 * step / (track.radius or 1.0)
    return np.array([stretch.low - past, stretch.high + past]), np.broadcast_to(way, (2, 2))


def tracks_between(one: Surface, two: Surface, slack: float) -> Iterator[Track]:
    """The lines or circles in which two carriers meet under an angle that does not change along them."""
    if one.kind == two.kind == "plane":
        a, b = np.asarray(one.axis), np.asarray(two.axis)
        along = cross(a, b)
        if np.linalg.norm(along) < PARALLEL:
            return
        along /= np.linalg.norm(along)
        origin = np.linalg.solve(np.stack([a, b, along]), np.array([a @ one.point, b @ two.point, 0.0]))
        frame = frame_from_axis(along)
        yield Track(origin, frame, np.stack([a @ frame[:, :2], b @ frame[:, :2]]))
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
        yield Track(origin + z * axis, frame_from_axis(axis), normals, float(r))


def _profile(surface: Surface, origin: np.ndarray, axis: np.ndarray, slack: float) -> tuple[np.ndarray, float] | None:
    """The line n . (r, z) = d that a carrier shows in a half plane beside an axis, None where it is not turned about that."""
    own = np.asarray(surface.axis)
    away = np.asarray(surface.point) - origin
    if np.linalg.norm(cross(own, axis)) > PARALLEL:
        return None
    way = math.copysign(1.0, float(own @ axis))
    if surface.kind == "plane":
        return np.array([0.0, 1.0]), float(away @ axis)
    if np.linalg.norm(cross(away, axis)) > slack:
        return None
    if surface.kind == "cylinder":
        return np.array([1.0, 0.0]), surface.sizes[0]
    if surface.kind == "cone":
        half = surface.sizes[0]
        normal = np.array([math.cos(half), -way * math.sin(half)])
        return normal, float(normal[1] * (away @ axis))
    return None
