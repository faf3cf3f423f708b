"""Guesses of the carrier through a seed facet of a mesh: two strips fix a cylinder, three facets a cone, a ring of them the rest."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from imdim.detection.facets import STRAIGHT, Facets, Growing, points_of
from imdim.detection.fit_ellipsoid import lies_on, quadric_ellipsoid
from imdim.detection.fit_elliptic import elliptic_guesses
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.detection.mesh_support import members_of
from imdim.geometry.rotations import cross
from imdim.geometry.surface import Surface, signed_distance, vec

LEAST_CORNERS = 11  # of an ellipsoid, which nine fix
RINGS = (8, 30, 150)  # facets
INNER = 3  # facets
NEAR_CUTS = 10  # times as far off as drawn corners may be those of a ring, many of which a cut has made
ALIKE_STEPS = (0.25, 4.0)  # times as wide as a band of a torus is what is beside it: a tessellation turns evenly
SAME_RADIUS = 1e-3  # of it
SAME_TURN = 0.01  # of it: strips of one cylinder turn alike
ALIKE = 0.3  # of a facet's area, that the next one has at least where a surface goes on evenly
BENT = 0.2  # of its radius, by which strips beside one of a tube leave that at most
GENTLE = math.cos(math.radians(20.0))  # between facets of one piece of a cone; across its rim the next face turns away by more


class Guess(NamedTuple):
    """A carrier through a seed facet, with a factor by which it is preferred: simple kinds win ties. `cut` where it was told from one facet
    alone that is whole, so that corners of those beside it may lie on chords."""

    preference: float
    surface: Surface
    cut: bool = False


def hypotheses(seed: int, state: Growing) -> list[Guess]:
    """Guesses through the seed."""
    facets, out = state.facets, list[Guess]()
    near, alike = _free_beside(seed, state)
    largest = sorted(alike, key=lambda n: -facets.areas[n])[:4]
    out += [Guess(1.02, _cylinder_through(facets, np.array([seed, other]))) for other in largest]
    known = [guess.surface.sizes[0] for guess in out]
    told = (s for s in _cylinder_of_strip(facets, seed, largest) if all(abs(s.sizes[0] - r) > SAME_RADIUS * r for r in known))
    out += [Guess(1.02, s, cut=True) for s in told]
    ring = ring_of(seed, alike, state, 30)
    if len(ring) >= 3:
        # along a cone the three neighbours under the smallest angles are its own strips, across it something else may follow
        gentlest = [alike[i] for i in np.argsort(-(facets.normals[alike] @ facets.normals[seed]), kind="stable")[:3]]
        trios = [np.array([seed, a, b]) for a, b in itertools.combinations(gentlest, 2)]
        out += [Guess(1.01, s) for s in (_cone_through(facets, trio) for trio in [*trios, ring]) if s]
    # where strips and trios explain all around them, the fits that take longest could explain no more
    if len(ring) >= 8 and any(len(members_of(guess, state, 1.0, ring)) == len(ring) for _, guess, _ in out):
        return out
    if state.config.elliptic:
        out += [Guess(0.97, s) for s in elliptic_guesses(seed, near, state)]
    if len(ring) >= 4:
        points, point_normals = _corner_normals(facets, ring)
        # where a cut turns away gently its own corners pass for inner ones, but for the ring that keeps off it
        inner = [_inner_corners(facets, around) for around in (ring, ring_of(seed, alike, state, 30, GENTLE))]
        for corners in dict.fromkeys(own.tobytes() for own in inner if len(own) >= MIN_POINTS["sphere"]):
            out.append(Guess(1.0, _fit_freely("sphere", corners)))
        # a small ring keeps clear of cuts, a wide one is more exact
        for around in _rings(seed, alike, state):
            chosen = points_of(facets, around)
            if len(chosen) >= 5:
                out.append(Guess(1.0, _fit_freely("sphere", chosen.tobytes())))
            if len(chosen) >= LEAST_CORNERS and not lies_on(out[-1].surface, chosen, facets.diagonal):
                found = _quadric_ellipsoid(chosen.tobytes())
                out += [Guess(0.9, s) for s in (found,) if s and lies_on(s, chosen, NEAR_CUTS * facets.diagonal)]
        if len(ring) >= 8:
            out.append(Guess(0.95, _fit_freely("torus", points.tobytes(), point_normals.tobytes(), 15)))
    return out


def _free_beside(seed: int, state: Growing) -> tuple[list[int], list[int]]:
    """The free smooth neighbours of a seed facet, and those of like size."""
    areas, near = state.facets.areas, [n for n in state.neighbours[seed] if state.free[n]]
    return near, [n for n in near if 0.02 < areas[n] / areas[seed] < 50]


def cone_in_rings(seed: int, state: Growing) -> Iterator[Surface]:
    """A guess of the cone around a seed facet, if any: where it is in several rings of facets, these are no strips, whose planes would meet
    in its apex."""
    _, alike = _free_beside(seed, state)
    gentle = ring_of(seed, alike, state, 30, GENTLE)
    if len(gentle) >= 8:
        points, point_normals = _corner_normals(state.facets, gentle)
        yield _fit_freely("cone", points.tobytes(), point_normals.tobytes(), 15)


def tori_along(band: Surface, members: np.ndarray, state: Growing) -> Iterator[Surface]:
    """Tori of which the facets `members` [m] that show a cone or cylinder are a band: one around the axis, or a strip of the tube.
    What is beside it tells the rest."""
    known = set(members.tolist())
    beside = np.array(sorted({n for m in known for n in state.neighbours[m] if state.free[n]} - known), int)
    if len(beside):
        yield from _tori_about(band, members, beside, state)
        if band.kind == "cylinder":
            yield from _tori_of_tube(band, members, beside, state)


def _tori_about(band: Surface, members: np.ndarray, beside: np.ndarray, state: Growing) -> Iterator[Surface]:
    """Tori about the axis of a band: in half a section its two edges and the next corner on either side fix a circle each."""
    facets, axis = state.facets, np.asarray(band.axis)

    def section(chosen: np.ndarray) -> np.ndarray:
        arms = points_of(facets, chosen) - np.asarray(band.point)
        along = arms @ axis
        return np.column_stack([np.linalg.norm(arms - along[:, None] * axis, axis=1), along])

    own, others = section(members), section(beside)
    half = band.sizes[0] if band.kind == "cone" else 0.0
    wall = np.array([math.sin(half), math.cos(half)])
    reach, beyond = own @ wall, others @ wall
    slack = state.config.on_surface * facets.diagonal
    low, high = own[reach < reach.min() + slack].mean(0), own[reach > reach.max() - slack].mean(0)
    for outside, edge in ((beyond > reach.max() + slack, high), (beyond < reach.min() - slack, low)):
        if not outside.any():
            continue
        away = np.linalg.norm(others[outside] - edge, axis=1)
        least, most = np.multiply(ALIKE_STEPS, np.linalg.norm(high - low))
        if not least < away.min() < most:
            continue  # a wall, or what it runs into
        circle = _circle_through(low, high, others[outside][away < away.min() + slack].mean(0))
        if circle is not None and circle[0] > slack:
            yield Surface("torus", vec(np.asarray(band.point) + circle[1] * axis), band.axis, (circle[0], circle[2]))


def _tori_of_tube(strip: Surface, members: np.ndarray, beside: np.ndarray, state: Growing) -> Iterator[Surface]:
    """The torus through a strip of its tube and those on either side of it."""
    facets = state.facets
    triangles = facets.triangles(beside)
    off = np.abs(signed_distance(strip, facets.corners[triangles].reshape(-1, 3))).reshape(-1, 3).max(1)
    far = np.zeros(len(facets.areas))
    np.maximum.at(far, facets.facet_of[triangles], off)
    near = beside[far[beside] < BENT * strip.sizes[0]]
    if len(near) >= INNER and len(members) + len(near) >= 8:
        points, point_normals = _corner_normals(facets, np.concatenate([members, near]))
        yield _fit_freely("torus", points.tobytes(), point_normals.tobytes(), 15)


def _circle_through(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[float, float, float] | None:
    """Centre and radius of the circle through three points of a plane; None where they are on a line."""
    rows = 2 * np.array([b - a, c - a])
    if abs(np.linalg.det(rows)) < 1e-12 * np.abs(rows).max() ** 2:
        return None
    x, y = np.linalg.solve(rows, [b @ b - a @ a, c @ c - a @ a])
    return float(x), float(y), math.hypot(a[0] - x, a[1] - y)


@lru_cache(4096)  # what found nothing is tried again by the next pass, and beside edges that were put aside
def _fit_freely(kind: str, points: bytes, facing: bytes | None = None, iterations: int = 30) -> Surface:
    """As `fit_surface` without a start, of points and normals [n, 3] in bytes."""
    normals = None if facing is None else np.frombuffer(facing).reshape(-1, 3)
    return fit_surface(kind, np.frombuffer(points).reshape(-1, 3), normals, iterations=iterations)[0]


@lru_cache(4096)
def _quadric_ellipsoid(points: bytes) -> Surface | None:
    return quadric_ellipsoid(np.frombuffer(points).reshape(-1, 3))


def ring_of(seed: int, near: list[int], state: Growing, most: int, gentle: float = -1.0) -> np.ndarray:
    """The seed, its smooth neighbours of like size, theirs, and so on up to `most` facets; those alone that turn no further from one to the
    next than by what has the cosine `gentle`."""
    areas, facing = state.facets.areas, state.facets.normals
    near = near if gentle <= -1 else [m for m in near if facing[m] @ facing[seed] > gentle]
    found, known = [seed, *near], {seed, *near}
    limit = 50 * areas[seed]
    for n in found:
        if len(found) >= most:
            break
        fresh = [m for m in state.neighbours[n] if m not in known and state.free[m] and areas[m] < limit]
        fresh = fresh if gentle <= -1 else [m for m in fresh if facing[m] @ facing[n] > gentle]
        known.update(fresh)
        found += fresh
    return np.array(found[:most])


def _rings(seed: int, near: list[int], state: Growing) -> Iterator[np.ndarray]:
    """Wider and wider rings, as far as there are more facets."""
    known = 0
    for most in RINGS:
        ring = ring_of(seed, near, state, most)
        if len(ring) == known:
            return
        known = len(ring)
        yield ring


def _inner_corners(facets: Facets, chosen: np.ndarray) -> np.ndarray:
    """Corners [n, 3] in which INNER or more of the chosen facets meet: those that a cut has made lie between two at most."""
    triangles = facets.triangles(chosen)
    number = facets.distinct[1][triangles].ravel()
    met = np.unique(np.stack([number, np.repeat(facets.facet_of[triangles], 3)]), axis=1)[0]
    corner, count = np.unique(met, return_counts=True)
    return facets.distinct[0][corner[count >= INNER]]


def _corner_normals(facets: Facets, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct corners with the mean normal of the chosen facets that meet there."""
    triangles = facets.triangles(chosen)
    points, member = np.unique(facets.corners[triangles].reshape(-1, 3), axis=0, return_inverse=True)
    per_corner = np.repeat(facets.normals[facets.facet_of[triangles]], 3, axis=0)
    total = np.stack([np.bincount(member.reshape(-1), per_corner[:, i]) for i in range(3)], axis=1)
    return points, total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def _cylinder_through(facets: Facets, pair: np.ndarray) -> Surface:
    axis = cross(*facets.normals[pair])
    axis /= np.linalg.norm(axis)
    points = points_of(facets, pair)
    flat = points - np.outer(points @ axis, axis)
    middle = flat.mean(0)
    q = flat - middle
    # Kasa's circle in the plane across the axis; the column of ones carries the radius
    solution = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q * q).sum(1), rcond=1e-9)[0]
    center = solution[:3] - solution[:3] @ axis * axis
    radius = float(np.sqrt(max(solution[3] + center @ center, 1e-24)))
    return Surface("cylinder", vec(middle + center), vec(axis), (radius,))


def _cylinder_of_strip(facets: Facets, seed: int, beside: list[int]) -> Iterator[Surface]:
    """The cylinder that a whole strip tells alone where it turns to strips on both sides by the same angle, of which cuts may have left any
    part: the sides of a regular polygon have one width and one turn. None where the surface goes on as evenly across: that is a ball's."""
    facing, center = facets.normals[seed], facets.centers[seed]
    turns = np.cross(facing, facets.normals[beside]).reshape(-1, 3)
    sines = np.linalg.norm(turns, axis=1)
    pairs = itertools.combinations(range(len(beside)), 2)
    pair = next((p for p in pairs if np.linalg.norm(turns[p[0]] + turns[p[1]]) < SAME_TURN * sines[p[0]]), None)
    if pair is None:
        return
    sine, axis = float(sines[pair[0]]), turns[pair[0]] / sines[pair[0]]
    even = (sines < 2 * sine) & (sines > 0.5 * sine) & (facets.areas[beside] > ALIKE * facets.areas[seed])
    if (even & (np.abs(turns @ axis) < 0.5 * sines)).any():
        return
    across, corners = cross(axis, facing), points_of(facets, np.array([seed]))
    span = corners @ across
    if np.minimum(span - span.min(), span.max() - span).max() > STRAIGHT * facets.diagonal:
        return  # cut itself
    other = beside[pair[0]]
    half, angle = float(np.ptp(span)) / 2, math.atan2(sine, float(facing @ facets.normals[other])) / 2
    inwards = -facing if (facets.centers[other] - center) @ facing < 0 else facing
    middle = center + (float(span.min()) + half - float(center @ across)) * across
    yield Surface("cylinder", vec(middle + half / math.tan(angle) * inwards), vec(axis), (half / math.sin(angle),))


def _cone_through(facets: Facets, chosen: np.ndarray) -> Surface | None:
    """The planes of a cone's facets meet in the apex, and their normals lie on a circle about the axis."""
    n, c = facets.normals[chosen], facets.centers[chosen]
    middle = c.mean(0)
    apex = middle + np.linalg.lstsq(n, (n * (c - middle)).sum(1), rcond=1e-6)[0]
    spread, vectors = np.linalg.eigh(np.cov(n.T))
    axis = vectors[:, 0]
    if spread[1] < 1e-10:
        return None
    if (middle - apex) @ axis < 0:
        axis = -axis
    angle = float(np.arcsin(min(abs(float((n @ axis).mean())), 1.0)))
    if not 0.01 < angle < 1.56 or np.linalg.norm(apex - middle) > 50 * facets.diagonal:
        return None
    return Surface("cone", vec(apex), vec(axis), (angle,))
