"""Carrier surfaces of a triangle mesh by hypothesis and growing over its flat facets.

A tessellated CAD face has its vertices on the true surface, so the test is strict: a facet belongs to a carrier when all its corners
lie on it and its normal follows the carrier's. Hypotheses come from a seed facet with its smooth neighbours (two strips fix a
cylinder, three facets a cone, a ring of facets a sphere or torus); the kind that explains the largest area wins. A sphere's
band of latitude is also an exact cone: area decides that too. What no curved carrier explains is flat.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from imdim.geometry.rotations import frame_from_axis
from imdim.geometry.surface import Patch, Surface, normals, signed_distance
from imdim.seeding.facets import Facets, facets_of
from imdim.seeding.fit_surface import fit_surface

LEAST_STEPS = {"sphere": 2.5, "torus": 4.5}  # facets along a patch; four circles of corners may lie on a torus by mere symmetry


@dataclass(frozen=True)
class MeshSurfaceConfig:
    """Tolerances relative to the diagonal, angles in degrees."""

    on_surface: float = 2e-4  # corner to carrier
    loose: float = 8e-4  # the same in the second pass
    smooth_deg: float = 46.0  # facets that meet under more are not one smooth surface (an octagon still is)
    follow_deg: float = 24.0  # facet normal to carrier normal at the facet's corners
    wide_span: float = 2.6  # a facet spanning this many times the typical angle is a flat, not a part of the curve
    max_failures: int = 150
    max_planes: int = 160
    least_plane: float = 2e-7  # of the squared diagonal
    same_plane_deg: float = 0.3


def detect_patches(mesh: trimesh.Trimesh, config: MeshSurfaceConfig | None = None) -> list[Patch]:
    """Carriers with their visible pieces, curved ones first, each kind by falling area."""
    config = config or MeshSurfaceConfig()
    facets = facets_of(mesh)
    curved, free = _curved(facets, np.ones(len(facets.areas), bool), config)
    # corners where two tessellations cut each other lie on chords: what the strict pass leaves gets a second one
    more, free = _curved(facets, free, replace(config, on_surface=config.loose, max_failures=config.max_failures // 3))
    return sorted(curved + more, key=lambda p: -p.area) + _planes(facets, free, config)


@dataclass
class _Growing:
    """What the hypotheses share: which facets are free, and each facet's smooth neighbours."""

    facets: Facets
    free: np.ndarray
    neighbours: list[list[int]]
    config: MeshSurfaceConfig


def _curved(facets: Facets, free: np.ndarray, config: MeshSurfaceConfig) -> tuple[list[Patch], np.ndarray]:
    """Curved patches among the `free` facets [u], and the facets that stay free."""
    smooth = (facets.angles > 1e-3) & (facets.angles < np.radians(config.smooth_deg))
    neighbours: list[list[int]] = [[] for _ in facets.areas]
    for a, b in facets.edges[smooth]:
        neighbours[a].append(int(b))
        neighbours[b].append(int(a))
    state = _Growing(facets, free.copy(), neighbours, config)
    patches, failures = [], 0
    for seed in np.argsort(-facets.areas, kind="stable"):
        if not state.free[seed] or len(neighbours[seed]) == 0:
            continue
        found = _grow_from(int(seed), state)
        if found is None:
            failures += 1
            if failures >= config.max_failures:
                break
            continue
        surface, members = found
        slack = 1.0 + _sagitta(surface, facets, members) / (config.on_surface * facets.diagonal)
        members = np.union1d(members, _members(surface, state, slack))
        state.free[members] = False
        patches.append(_patch(surface, facets, members))
    return patches, state.free


def _grow_from(seed: int, state: _Growing) -> tuple[Surface, np.ndarray] | None:
    """The carrier through a seed facet that explains the largest area, with its facets."""
    best: tuple[float, Surface, np.ndarray] | None = None
    for preference, guess in _hypotheses(seed, state):
        found = _settle(guess, state)
        if found is None or seed not in found[1]:
            continue
        area = float(state.facets.areas[found[1]].sum()) * preference
        if best is None or area > best[0]:
            best = (area, *found)
    return best[1:] if best else None


def _hypotheses(seed: int, state: _Growing) -> list[tuple[float, Surface]]:
    """Guesses through the seed with a preference factor; simple kinds win ties."""
    facets, out = state.facets, []
    near = [n for n in state.neighbours[seed] if state.free[n]]
    alike = [n for n in near if 0.02 < facets.areas[n] / facets.areas[seed] < 50]
    for other in sorted(alike, key=lambda n: -facets.areas[n])[:4]:
        out.append((1.02, _cylinder_through(facets, np.array([seed, other]))))
    ring = _ring(seed, alike, state, 30)
    if len(ring) >= 3:
        trios = [np.array([seed, a, b]) for a, b in itertools.combinations(_gentlest(seed, alike, state), 2)]
        out += [(1.01, s) for s in (_cone_through(facets, trio) for trio in [*trios, ring]) if s]
    if len(ring) >= 4:
        points, point_normals = _corner_normals(facets, ring)
        # a small ring keeps clear of cuts, a wide one is more exact
        for size in (8, 30, 150):
            chosen = _points(facets, _ring(seed, alike, state, size))
            if len(chosen) >= 5:
                out.append((1.0, fit_surface("sphere", chosen)[0]))
        if len(ring) >= 8:
            out.append((0.95, fit_surface("torus", points, point_normals, iterations=15)[0]))
    return out


def _gentlest(seed: int, near: list[int], state: _Growing) -> list[int]:
    """The three neighbours under the smallest angles: along a cone they are its own strips, across it something else may follow."""
    cosines = state.facets.normals[near] @ state.facets.normals[seed] if near else np.zeros(0)
    return [near[i] for i in np.argsort(-cosines, kind="stable")[:3]]


def _ring(seed: int, near: list[int], state: _Growing, most: int) -> np.ndarray:
    """The seed, its smooth neighbours of like size, theirs, and so on up to `most` facets."""
    found, known = [seed, *near], {seed, *near}
    limit = 50 * state.facets.areas[seed]
    for n in found:
        if len(found) >= most:
            break
        fresh = [m for m in state.neighbours[n] if m not in known and state.free[m] and state.facets.areas[m] < limit]
        known.update(fresh)
        found += fresh
    return np.array(found[:most])


def _points(facets: Facets, chosen: np.ndarray) -> np.ndarray:
    return np.unique(facets.corners[facets.triangles(chosen)].reshape(-1, 3), axis=0)


def _corner_normals(facets: Facets, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct corners with the mean normal of the chosen facets that meet there."""
    triangles = facets.triangles(chosen)
    points, member = np.unique(facets.corners[triangles].reshape(-1, 3), axis=0, return_inverse=True)
    per_corner = np.repeat(facets.normals[facets.facet_of[triangles]], 3, axis=0)
    total = np.stack([np.bincount(member.reshape(-1), per_corner[:, i]) for i in range(3)], axis=1)
    return points, total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def _cylinder_through(facets: Facets, pair: np.ndarray) -> Surface:
    axis = np.cross(*facets.normals[pair])
    axis /= np.linalg.norm(axis)
    points = _points(facets, pair)
    flat = points - np.outer(points @ axis, axis)
    middle = flat.mean(0)
    q = flat - middle
    # Kasa's circle in the plane across the axis; the column of ones carries the radius
    solution = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q * q).sum(1), rcond=1e-9)[0]
    center = solution[:3] - solution[:3] @ axis * axis
    radius = float(np.sqrt(max(solution[3] + center @ center, 1e-24)))
    return Surface("cylinder", _vec(middle + center), _vec(axis), (radius,))


def _cone_through(facets: Facets, chosen: np.ndarray) -> Surface | None:
    """The planes of a cone's facets meet in the apex, and their normals lie on a circle about the axis."""
    if len(chosen) < 3:
        return None
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
    return Surface("cone", _vec(apex), _vec(axis), (angle,))


def _settle(guess: Surface, state: _Growing) -> tuple[Surface, np.ndarray] | None:
    """Refit on the members and collect again until nothing is added; None when there are too few facets."""
    facets, config = state.facets, state.config
    surface, members, loose = guess, _members(guess, state, 5.0), 5.0
    if len(members) < 2 or not _sane(surface, facets.diagonal):
        return None
    for _ in range(4):
        points = _points(facets, members)
        if len(points) < 7:
            return None
        surface, rms = _fitted(surface, points[:: max(1, len(points) // 1500)], facets, members, config)
        if not _sane(surface, facets.diagonal) or rms > config.on_surface * facets.diagonal:
            return None
        grown = _members(surface, state, 1.0)
        if len(grown) == len(members) and loose == 1.0:
            break
        members, loose = grown, 1.0
        if len(members) < 2:
            return None
    if not _believable(surface, members, facets):
        return None
    return _polished(surface, facets, members, config), members


def _fitted(surface: Surface, points: np.ndarray, facets: Facets, members: np.ndarray, config: MeshSurfaceConfig) -> tuple[Surface, float]:
    """The carrier through corners [n, 3] of its facets, and their rms distance to it.

    The normals of a cylinder's strips are exact, so they give its axis. Corners on chords lie off by the sagitta: where the plain fit
    is not good a robust one follows those on the curve.
    """
    hold = ""
    if surface.kind == "cylinder":
        n = facets.normals[members] * np.sqrt(facets.areas[members])[:, None]
        spread, vectors = np.linalg.eigh(n.T @ n)
        if spread[1] > 1e-3 * spread[2]:
            surface, hold = replace(surface, axis=_vec(vectors[:, 0])), "axis"
    tolerance = config.on_surface * facets.diagonal
    fitted, rms = fit_surface(surface.kind, points, start=surface, iterations=12, hold=hold)
    if rms > 0.3 * tolerance:
        return fit_surface(surface.kind, points, start=surface, scale=0.5 * tolerance, iterations=12, hold=hold)
    return fitted, rms


def _polished(surface: Surface, facets: Facets, members: np.ndarray, config: MeshSurfaceConfig) -> Surface:
    """Reweighted twice with the scale of the better half: a design's corners are exact but for those that cuts made."""
    points = _points(facets, members)
    hold = "axis" if surface.kind == "cylinder" else ""
    for _ in range(2):
        scale = 3 * float(np.median(np.abs(signed_distance(surface, points)))) + 1e-7 * facets.diagonal
        polished, rms = fit_surface(surface.kind, points, start=surface, scale=scale, iterations=12, hold=hold)
        if not _sane(polished, facets.diagonal) or not rms < config.on_surface * facets.diagonal:
            break
        surface = polished
    return surface


def _sagitta(surface: Surface, facets: Facets, members: np.ndarray) -> float:
    """How far the chords leave the carrier: where a cut crosses a facet its new corners lie on the chord, not on the curve."""
    middle = facets.corners[facets.triangles(members)].mean(1)
    return 1.5 * float(np.abs(signed_distance(surface, middle)).max())


def _sane(surface: Surface, diagonal: float) -> bool:
    if surface.kind == "cone":
        return 0.01 < surface.sizes[0] < 1.56
    if surface.kind == "torus" and surface.sizes[1] > surface.sizes[0]:
        return False
    return all(1e-5 * diagonal < s < 20 * diagonal for s in surface.sizes)


def _members(surface: Surface, state: _Growing, slack: float) -> np.ndarray:
    """Free facets whose every corner lies on the carrier and whose normal follows it there and in the middle."""
    facets, config = state.facets, state.config
    corners = facets.corners.reshape(-1, 3)
    off = np.abs(signed_distance(surface, corners)) > slack * config.on_surface * facets.diagonal
    bad_triangle = off.reshape(-1, 3).any(1) | ~state.free[facets.facet_of]
    fine = np.flatnonzero(~bad_triangle)
    # a disc within a torus's topmost circle, or a wall between two rounds, follows it at the corners alone
    probes = np.concatenate([facets.corners[fine], facets.corners[fine].mean(1, keepdims=True)], axis=1)
    gradient = normals(surface, probes.reshape(-1, 3)).reshape(-1, 4, 3)
    along = np.abs(np.einsum("tci,ti->tc", gradient, facets.normals[facets.facet_of[fine]])).min(1)
    bad_triangle[fine[along < np.cos(np.radians(config.follow_deg))]] = True
    bad = np.zeros(len(facets.areas), bool)
    bad[facets.facet_of[bad_triangle]] = True
    members = np.flatnonzero(~bad)
    return _without_flats(members, fine, along, state)


def _without_flats(members: np.ndarray, fine: np.ndarray, along: np.ndarray, state: _Growing) -> np.ndarray:
    """Drop facets that span much more of the curve than is typical: the flat of a D-shaft has its corners on the shaft."""
    if len(members) < 4:
        return members
    worst = np.ones(len(state.facets.areas))
    np.minimum.at(worst, state.facets.facet_of[fine], along)
    span = np.arccos(np.clip(worst[members], -1, 1))
    return members[(span <= state.config.wide_span * np.median(span)) | (span < np.radians(4.0))]


def _believable(surface: Surface, members: np.ndarray, facets: Facets) -> bool:
    """Enough facets for the turn they make: two coarse strips are a chamfer, not a cylinder."""
    least = {"cylinder": 3, "cone": 3, "sphere": 6, "torus": 8}[surface.kind]
    if surface.kind == "cone" and surface.sizes[0] > 1.35:
        least = 8  # nearly flat
    if len(members) < least:
        return False
    if surface.kind in LEAST_STEPS and _least_steps(surface, members, facets) < LEAST_STEPS[surface.kind]:
        return False
    n = facets.normals[members]
    turn = np.arccos(np.clip((n @ n.T).min() if len(n) < 800 else -1.0, -1, 1))
    return turn > np.radians(4.0)


def _least_steps(surface: Surface, members: np.ndarray, facets: Facets) -> float:
    """How many facets long a sphere's patch is along its pole, or a torus's along and about its axis, whichever is less.

    Two circles of corners lie on many spheres and tori, and mean a cone; strips that are one facet long mean a cylinder.
    """
    corners = facets.corners[facets.triangles(members)]
    direction = normals(surface, corners.reshape(-1, 3)).reshape(-1, 3, 3)
    axis = np.asarray(surface.axis)
    if surface.kind == "sphere":
        flat = direction.reshape(-1, 3)
        # the axis of a band, the pole of a cap
        axis = np.linalg.eigh(np.cov(flat.T))[1][:, 0]
        return _turns(np.arcsin(np.clip(direction @ axis, -1, 1)))
    frame = frame_from_axis(axis)
    local = (corners - surface.point) @ frame
    around = np.arctan2(local[..., 1], local[..., 0])
    radial = np.cos(around)[..., None] * frame[:, 0] + np.sin(around)[..., None] * frame[:, 1]
    along = np.arctan2(direction @ frame[:, 2], (direction * radial).sum(2))
    return min(_turns(along), _turns(around))


def _turns(angles: np.ndarray) -> float:
    """Range of angles [t, 3] of triangle corners over the median range within a triangle."""
    middle = np.arctan2(np.sin(angles).mean(), np.cos(angles).mean())
    centered = (angles - middle + np.pi) % (2 * np.pi)
    return float(np.ptp(centered)) / max(float(np.median(np.ptp(centered, axis=1))), 1e-9)


def _patch(surface: Surface, facets: Facets, members: np.ndarray) -> Patch:
    points = _points(facets, members)
    facing = (normals(surface, facets.centers[members]) * facets.normals[members]).sum(1) * facets.areas[members]
    return Patch(surface, points, float(facets.areas[members].sum()), 1 if facing.sum() > 0 else -1)


def _planes(facets: Facets, free: np.ndarray, config: MeshSurfaceConfig) -> list[Patch]:
    """Free facets collected into planes, largest first; the larger facet's plane stands for all that lie in it."""
    order = [i for i in np.argsort(-facets.areas, kind="stable") if free[i] and facets.areas[i] > config.least_plane * facets.diagonal**2]
    normal, at = np.empty((len(order), 3)), np.empty(len(order))
    groups: list[list[int]] = []
    count, cosine = 0, np.cos(np.radians(config.same_plane_deg))
    for i in order:
        n, c = facets.normals[i], facets.centers[i]
        side = normal[:count] @ n
        same = np.flatnonzero((np.abs(side) > cosine) & (np.abs(normal[:count] @ c - at[:count]) < config.on_surface * facets.diagonal))
        if len(same):
            groups[same[0]].append(int(i))
        elif count < 4 * config.max_planes:
            normal[count], at[count] = n, n @ c
            groups.append([int(i)])
            count += 1
    patches = [_plane_patch(facets, np.array(g)) for g in groups]
    return sorted(patches, key=lambda p: -p.area)[: config.max_planes]


def _plane_patch(facets: Facets, members: np.ndarray) -> Patch:
    largest = members[0]
    n = facets.normals[largest]
    sides = facets.normals[members] @ n
    outward = 1 if (sides > 0).all() else 0
    surface = Surface("plane", _vec(facets.centers[largest]), _vec(n))
    return Patch(surface, _points(facets, members), float(facets.areas[members].sum()), outward)


def _vec(v: np.ndarray) -> tuple[float, float, float]:
    return (float(v[0]), float(v[1]), float(v[2]))
