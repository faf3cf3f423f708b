"""The arrangement of carrier surfaces: parallel planes collected into directions, curved surfaces, and the codes of points.

Two points with equal codes lie in one canonical intersection (Du et al. 2018, definition 2): no candidate that is made of
these carriers can tell them apart. A `Direction` holds all the offsets at which a candidate may begin or end along it:
detected planes, planes through centres of curved surfaces and tangent to them, and two sentinels beyond the part, which are
where a cutter may overshoot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice

import numpy as np

from imdim.geometry.surface import AXISLESS, CLOSED_KINDS, Surface, signed_distance
from imdim.search.kernels import mark_inside_cylinder, slabs_of

PARALLEL = 1 - 1e-6  # cosine above which two axes are one direction (0.08 degrees)
SAME_WEIGHT = 1e-5  # of the visible area, within which two directions show as much
ORTHOGONAL = 1.5e-3  # largest cosine of a right angle


@dataclass(frozen=True)
class Direction:
    """A unit vector and the sorted plane offsets [n >= 2] along it; the first and last are sentinels outside the part.

    `shown` [n] is the visible area of the planes at an offset, 0 for those of centres, tangents and sentinels.
    """

    vector: np.ndarray
    offsets: np.ndarray
    shown: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def detected(self) -> np.ndarray:
        """Which offsets [n] are those of planes."""
        return self.shown > 0

    def bins(self, points: np.ndarray) -> np.ndarray:
        """Index [n] of the slab between consecutive offsets that holds each of `points` [n, 3]."""
        return slabs_of(self.offsets, points @ self.vector)


@dataclass(frozen=True)
class Arrangement:
    """Directions with offsets, curved carriers with the area that each shows, triples of orthogonal directions (box frames), and three
    boxes [2, 3].

    `part` is the part's, `bounds` has a margin about it; `outer` holds the whole of every curved carrier that is not far larger than the
    part, so that what a sphere has outside the part counts against it until something cuts it off.
    """

    directions: tuple[Direction, ...]
    curved: tuple[Surface, ...]
    shown: tuple[float, ...]
    axis_of: tuple[int, ...]  # direction index of each curved surface's axis, -1 where it has none
    frames: tuple[tuple[int, int, int], ...]
    part: np.ndarray
    bounds: np.ndarray
    outer: np.ndarray

    def rotation(self, frame: tuple[int, int, int]) -> np.ndarray:
        """The proper rotation [3, 3] nearest to three of the directions, which detection makes orthogonal to tolerance only."""
        axes = np.stack([self.directions[i].vector for i in frame], axis=1)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        left, _, right = np.linalg.svd(axes)
        return left @ right


@dataclass(frozen=True)
class ArrangementConfig:
    """Limits that keep the arrangement searchable."""

    margin: float = 0.03  # of the diagonal, between the part and the sentinels
    reach: float = 1.0  # of the diagonal, how far beyond the part curved carriers are followed
    merge: float = 4e-4  # of the diagonal, under which two offsets are one
    max_offsets: int = 48  # along one direction; the planes with least area go first
    least_direction: float = 2e-3  # of the visible area; directions with less are not searched
    max_directions: int = 40
    least_wall: float = 1.0  # of the visible area; directions with more are walls of outlines, though boxes are not searched along them
    max_curved: int = 80
    max_frames: int = 12


def arrange(surfaces: Sequence[Surface], areas: Sequence[float], bounds: np.ndarray, config: ArrangementConfig) -> Arrangement:
    """Collect carriers with their visible areas into an arrangement over the part's bounding box `bounds` [2, 3]."""
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    box = np.stack([bounds[0] - config.margin * diagonal, bounds[1] + config.margin * diagonal])
    curved = sorted(((s, a) for s, a in zip(surfaces, areas, strict=True) if s.kind != "plane"), key=lambda c: -c[1])[: config.max_curved]
    vectors = _direction_vectors(surfaces, areas, config)
    curved = [(s, a) for s, a in curved if s.kind in CLOSED_KINDS or _axis_index(s, vectors) >= 0]
    frames = _frames(vectors, config)
    vectors += _wall_vectors(surfaces, areas, vectors, config)
    outer = _outer([s for s, _ in curved], box, config.reach * diagonal)
    tol = config.merge * diagonal
    directions = tuple(_direction(v, _offsets(v, surfaces, areas, box, outer, tol, config), surfaces, areas, tol) for v in vectors)
    axis_of = tuple(_axis_index(s, vectors) for s, _ in curved)
    carriers, shown = tuple(s for s, _ in curved), tuple(a for _, a in curved)
    return Arrangement(directions, carriers, shown, axis_of, frames, bounds, box, outer)


def _outer(curved: Sequence[Surface], box: np.ndarray, reach: float) -> np.ndarray:
    """The box grown to hold spheres, tori, ellipsoids and the girth of cylinders, by `reach` at most on each side."""
    low, high = box[0].copy(), box[1].copy()
    for surface in curved:
        if surface.kind == "cone":
            continue
        center, axis = np.asarray(surface.point), np.asarray(surface.axis)
        if surface.kind == "cylinder":
            center = center + ((box.mean(0) - center) @ axis) * axis
            extent = surface.sizes[0] * np.sqrt(np.maximum(1 - axis**2, 0))
        elif surface.kind == "elliptic":
            center = center + ((box.mean(0) - center) @ axis) * axis
            extent = np.linalg.norm(surface.frame[:, :2] * surface.sizes, axis=1)
        elif surface.kind == "ellipsoid":
            extent = np.linalg.norm(surface.frame * surface.sizes, axis=1)
        else:
            extent = np.full(3, sum(surface.sizes))
        low, high = np.minimum(low, center - 1.01 * extent), np.maximum(high, center + 1.01 * extent)
    return np.stack([np.maximum(low, box[0] - reach), np.minimum(high, box[1] + reach)])


def _direction_vectors(surfaces: Sequence[Surface], areas: Sequence[float], config: ArrangementConfig) -> list[np.ndarray]:
    """Distinct plane normals and axes by falling weight, completed so that each has two orthogonal partners.

    Of directions that weigh the same the one nearest to x comes first, then to y: the last digits of areas are those of a turn.
    """
    vectors, weights = _weigh_vectors(surfaces, areas)
    least, same = config.least_direction * sum(areas), SAME_WEIGHT * sum(areas)
    ranked = sorted(range(len(vectors)), key=lambda i: (-round(weights[i] / same), *(-abs(vectors[i]).round(6)).tolist()))
    order = [i for i in ranked if weights[i] >= least][: config.max_directions]
    kept = [vectors[i] for i in order] or [np.array([0.0, 0.0, 1.0])]
    return _complete(kept)


def _weigh_vectors(surfaces: Sequence[Surface], areas: Sequence[float]) -> tuple[list[np.ndarray], list[float]]:
    """Distinct plane normals and axes in order of appearance, with the area that each shows."""
    vectors: list[np.ndarray] = []
    weights: list[float] = []
    for surface, area in zip(surfaces, areas, strict=True):
        if surface.kind in AXISLESS:
            continue
        axis = _canonical_sign(_snap_axis(np.asarray(surface.axis)))
        match = next((i for i, v in enumerate(vectors) if abs(v @ axis) > PARALLEL), None)
        if match is None:
            vectors.append(axis)
            weights.append(area)
        else:
            weights[match] += area
    return vectors, weights


def _wall_vectors(
    surfaces: Sequence[Surface], areas: Sequence[float], known: Sequence[np.ndarray], config: ArrangementConfig
) -> list[np.ndarray]:
    """Normals of planes and axes of cylinders that are not `known`, of those that show enough for a wall."""
    vectors, weights = _weigh_vectors(surfaces, areas)
    least = config.least_wall * sum(areas)
    order = [i for i in sorted(range(len(vectors)), key=lambda i: -weights[i]) if weights[i] >= least]
    new = [vectors[i] for i in order if not any(abs(vectors[i] @ v) > PARALLEL for v in known)]
    return new[: max(config.max_directions - len(known), 0)]


def _snap_axis(axis: np.ndarray) -> np.ndarray:
    """A coordinate axis where `axis` is within 0.1 degrees of it."""
    lead = int(np.argmax(np.abs(axis)))
    return np.eye(3)[lead] * np.sign(axis[lead]) if abs(axis[lead]) > 1 - 1.5e-6 else axis


def _canonical_sign(axis: np.ndarray) -> np.ndarray:
    axis = axis / np.linalg.norm(axis)
    lead = int(np.argmax(np.abs(axis) > 0.5)) if (np.abs(axis) > 0.5).any() else int(np.argmax(np.abs(axis)))
    out = axis if axis[lead] > 0 else -axis
    return out + 0.0  # no negative zeros in the output


def _complete(vectors: list[np.ndarray]) -> list[np.ndarray]:
    """Append the missing axes of each direction's box frame; the heaviest direction in sight lends its orientation."""
    out = list(vectors)
    for v in vectors:
        partners = [w for w in out if abs(v @ w) < ORTHOGONAL]
        if not partners:
            guide = next((w for w in [*out, *np.eye(3)] if abs(v @ w) < 0.99), np.eye(3)[0])
            partners = [_canonical_sign(guide - (guide @ v) * v)]
            out.append(partners[0])
        third = np.cross(v, partners[0])
        if not any(abs(third @ w) > PARALLEL for w in out):
            out.append(_canonical_sign(third))
    return out


def _frames(vectors: list[np.ndarray], config: ArrangementConfig) -> tuple[tuple[int, int, int], ...]:
    right = {pair for pair in combinations(range(len(vectors)), 2) if abs(vectors[pair[0]] @ vectors[pair[1]]) < ORTHOGONAL}
    triples = (t for t in combinations(range(len(vectors)), 3) if right.issuperset(combinations(t, 2)))
    return tuple(islice(triples, config.max_frames))


def _direction(v: np.ndarray, offsets: np.ndarray, surfaces: Sequence[Surface], areas: Sequence[float], tol: float) -> Direction:
    planes = [(at, area) for s, area in zip(surfaces, areas, strict=True) if s.kind == "plane" for _, at in _propose_offsets(s, v)]
    at, shown = np.array(planes).reshape(-1, 2).T
    return Direction(v, offsets, (np.abs(offsets[:, None] - at) <= tol) @ shown)


def _offsets(
    v: np.ndarray,
    surfaces: Sequence[Surface],
    areas: Sequence[float],
    box: np.ndarray,
    outer: np.ndarray,
    tol: float,
    config: ArrangementConfig,
) -> np.ndarray:
    """Sorted offsets along `v`: detected planes first, then invented ones (centres, tangents) while there is room."""
    low, high = span_along(box, v)
    proposals: list[tuple[float, float]] = []
    for surface, area in zip(surfaces, areas, strict=True):
        proposals += [(rank * area, offset) for rank, offset in _propose_offsets(surface, v)]
    proposals.sort(key=lambda p: (-p[0], p[1]))
    kept: list[float] = []
    for _, offset in proposals:
        if len(kept) >= config.max_offsets:
            break
        if all(abs(offset - other) > tol for other in kept) and low + tol < offset < high - tol:
            kept.append(offset)
    farthest = span_along(outer, v)
    ends = [low, high] if max(low - farthest[0], farthest[1] - high) < tol else [*farthest, low, high]
    return np.array(sorted([*kept, *ends]))


def span_along(box: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Smallest and largest offset of a box along `v`."""
    middle, half = box.mean(0) @ v, (box[1] - box[0]) / 2 @ np.abs(v)
    return float(middle - half), float(middle + half)


def _propose_offsets(surface: Surface, v: np.ndarray) -> list[tuple[float, float]]:
    """(rank, offset) pairs along `v`; detected planes outrank whatever is invented."""
    at = float(np.asarray(surface.point) @ v)
    along = abs(float(np.asarray(surface.axis) @ v))
    if surface.kind == "plane":
        sign = float(np.sign(np.asarray(surface.axis) @ v))
        return [(1e6, sign * float(np.asarray(surface.point) @ np.asarray(surface.axis)))] if along > PARALLEL else []
    if surface.kind == "cone":
        return [(1e3, at)] if along > PARALLEL or along < ORTHOGONAL else []
    if surface.kind in AXISLESS:
        return [(1.0, at)]
    radius = float(np.linalg.norm(v @ surface.frame[:, :2] * surface.sizes)) if surface.kind == "elliptic" else surface.sizes[0]
    if surface.kind == "torus":
        return [(1.0, at), (0.5, at - surface.sizes[1]), (0.5, at + surface.sizes[1])] if along > PARALLEL else []
    return [(1.0, at), (0.5, at - radius), (0.5, at + radius)] if along < ORTHOGONAL else []


def _axis_index(surface: Surface, vectors: list[np.ndarray]) -> int:
    if surface.kind in CLOSED_KINDS:
        return -1
    along = [abs(float(v @ np.asarray(surface.axis))) for v in vectors]
    best = int(np.argmax(along))
    return best if along[best] > PARALLEL - 2e-6 else -1


def codes(arrangement: Arrangement, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slab indices [n, directions] int16 and inside flags [n, curved] bool of `points` [n, 3]."""
    slabs = np.stack([d.bins(points) for d in arrangement.directions], axis=1).astype(np.int16)
    points, inside = np.ascontiguousarray(points), np.empty((len(points), len(arrangement.curved)), bool, order="F")
    for column, surface in zip(inside.T, arrangement.curved, strict=True):
        if surface.kind == "cylinder":
            mark_inside_cylinder(column, points, np.array(surface.point), np.array(surface.axis), surface.sizes[0])
        else:
            column[:] = signed_distance(surface, points) < 0
    return slabs, inside
