"""Carrier surfaces of a point cloud by efficient RANSAC (Schnabel, Wahl & Klein 2007), for clouds with and without normals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_denoise import denoise, inliers
from imdim.detection.cloud_hypotheses import propose
from imdim.detection.cloud_kernels import ELLIPSOID, PLANE, gains, largest_plane, pack, score, sharp_gains, unpack
from imdim.detection.cloud_normals import estimate_normals
from imdim.detection.cloud_occupancy import orient
from imdim.detection.cloud_reassign import gather_points, patches_of, prune, settle
from imdim.detection.cloud_state import CloudConfig, DetectionState, pieces, sane
from imdim.detection.fit_ellipsoid import shows_ellipsoid
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.detection.noise import NoiseModel
from imdim.detection.regularise import regularise
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import AXISLESS, SURFACE_KINDS, Patch, Surface, signed_distance

# a richer kind must explain more to be preferred: plane, sphere, cylinder, cone, torus, ellipsoid
_PREFERENCE = np.array([1.0, 0.95, 0.95, 0.9, 0.8, 0.7])
# and needs more points to be believed at all
_LEAST = np.array([1.0, 1.3, 1.0, 1.6, 2.2, 4.0])


def detect_cloud(
    points: np.ndarray,
    normals: np.ndarray | None,
    noise: NoiseModel,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> tuple[list[Patch], NoiseModel]:
    """Carrier surfaces that the cloud shows, each with the points that lie on it; points on none are left out. And the noise, less what
    first surfaces show to have been curvature or thin walls.

    `points` [n, 3] in any units, `normals` [n, 3] unit vectors (of trusted sign or not) or None. Pieces of one carrier
    share one patch. `area` is the points' number times the area that one stands for. Past the `deadline` (by default never) no more
    surfaces are looked for, beyond a first one, and those found are settled in haste.
    """
    points = np.asarray(points, float)
    cloud = _begin(points, normals, noise, CloudConfig(), rng)
    _extract(cloud, rng, 1, deadline)
    # by the medians of the points' distances from the surfaces found
    spread = [np.median(np.abs(signed_distance(s, cloud.points[cloud.owner == i]))) for i, s in enumerate(cloud.found)]
    calmer = 1.4826 * float(min(spread, default=math.inf))
    if calmer < 0.5 * noise.sigma:  # curvature or thin walls were taken for noise
        noise = replace(noise, sigma=calmer)
        cloud = _begin(points, normals, noise, cloud.config, rng)
    if noise.blurs:
        cloud = _calm(cloud, rng)
    _extract(cloud, rng, cloud.config.rounds, deadline)
    settle(cloud, deadline)
    if noise.blurs:
        prune(cloud, deadline)
    patches = regularise(patches_of(cloud), max(cloud.config.exact * cloud.noise.diagonal, 0.3 * noise.sigma))
    if cloud.raw is None:
        return orient(patches, points, deadline=deadline), noise
    return orient([gather_points(p) for p in patches], cloud.raw, deadline=deadline), noise


def _calm(begun: DetectionState, rng: np.random.Generator) -> DetectionState:
    """Surfaces of a noisy cloud are found in a calmed one and fitted to the points as measured; patches hold points on their carriers."""
    kept, given = inliers(begun.points), begun.viewed == 0
    points, normals = begun.points[kept], begun.normals[kept] if given else None
    noise = replace(begun.noise, diagonal=float(np.linalg.norm(np.ptp(points, axis=0))))  # strays widened the box
    calm, directed = denoise(points, normals, noise, rng)
    trust = np.full(len(points), 0.9)
    return DetectionState(calm, directed, trust, noise, begun.config, np.full(len(points), -1), 0 if given else len(points), raw=points)


def _begin(
    points: np.ndarray, normals: np.ndarray | None, noise: NoiseModel, config: CloudConfig, rng: np.random.Generator
) -> DetectionState:
    if normals is None:
        directed, trust = estimate_normals(points, noise, rng)
    else:
        directed, trust = np.array(normals, dtype=float), np.ones(len(points))
    return DetectionState(points, directed, trust, noise, config, np.full(len(points), -1), len(points) if normals is None else 0)


def _extract(cloud: DetectionState, rng: np.random.Generator, rounds: int, deadline: Deadline) -> None:
    """Round by round, take the surfaces with the most support out of the points that are left."""
    misses = 0
    for _ in range(rounds):
        rest = np.flatnonzero(cloud.owner < 0)
        if len(rest) < cloud.least or misses >= cloud.config.patience or (cloud.found and deadline.has_passed()):
            break
        if len(rest) < 0.6 * cloud.viewed and len(rest) > 24:
            # without the faces already found, small ones show their own normals
            if cloud.raw is None:
                cloud.normals[rest], cloud.trust[rest] = estimate_normals(cloud.points[rest], cloud.noise, rng)
            else:
                cloud.points[rest], cloud.normals[rest] = denoise(cloud.raw[rest], None, cloud.noise, rng)
            cloud.viewed = len(rest)
        candidates = _candidates(cloud, rest, rng, deadline)
        misses = 0 if _accept(cloud, candidates) else misses + 1


def _candidates(
    cloud: DetectionState, rest: np.ndarray, rng: np.random.Generator, deadline: Deadline
) -> list[tuple[float, Surface, np.ndarray]]:
    """Polished hypotheses as (preferred support, surface, indices of the points), best first."""
    points, normals, trust = cloud.points[rest], cloud.normals[rest], cloud.trust[rest]
    kinds, rows = propose(points, normals, *_collect_directions(cloud), cloud.config.hypotheses, rng, not cloud.noisy)
    # hypotheses of few points are off: a wider band lets them show what they might become
    wide = np.where(kinds == PLANE, 1.5, 3.0) * cloud.tolerance(kinds, rows)
    thin = rng.choice(len(rest), min(len(rest), 1200), replace=False)
    narrow = np.minimum(wide, max(cloud.config.curved * cloud.noise.diagonal, cloud.config.noise * cloud.sigma))
    raw = [score(kinds, rows, band, points[thin], normals[thin], trust[thin], cloud.cosine) for band in (wide, narrow)]
    out = []
    aside = rng.spawn(1)[0]  # a guess at an ellipsoid, of which few clouds have one, draws no numbers from what is found of the others
    for kind in range(len(SURFACE_KINDS)):
        mine = np.flatnonzero(kinds == kind)
        # the two rankings in turn: rough but large surfaces, and exact but small ones
        order = np.column_stack([mine[np.argsort(-r[mine], kind="stable")] for r in raw]).ravel()
        claimed: list[np.ndarray] = []
        for i in order[: 4 * cloud.config.polished]:
            if len(claimed) == cloud.config.polished or (out and deadline.has_passed()):
                break
            near = gains(kind, rows[i], wide[i], points, normals, trust, cloud.cosine) > 0
            if any((near & c).sum() > 0.7 * near.sum() for c in claimed):
                continue
            claimed.append(near)
            if kind == ELLIPSOID and not shows_ellipsoid(unpack(kind, rows[i]), points[near], 0.0):
                continue
            result = _polish(cloud, rest, kind, rows[i])
            if result is not None and (kind == PLANE or not _mostly_flat(cloud, result[1], result[2], aside if kind == ELLIPSOID else rng)):
                out.append(result)
    out.sort(key=lambda item: -item[0])
    return out


def _collect_directions(cloud: DetectionState) -> tuple[np.ndarray, np.ndarray]:
    """Distinct directions [d, 3] and axes [a, 6] of the surfaces found so far, at most 16 of each."""
    directions: list[np.ndarray] = []
    axes: list[np.ndarray] = []
    for s in cloud.found:
        axis, point = np.asarray(s.axis), np.asarray(s.point)
        if s.kind not in AXISLESS and all(abs(axis @ d) < 0.9999 for d in directions):
            across = [np.cross(axis, d) for d in directions if abs(axis @ d) < 1e-3]
            directions.append(axis)
            directions += [c for c in across if all(abs(c @ d) < 0.9999 for d in directions)]
        if s.kind in ("cylinder", "cone", "torus") and not any(
            abs(axis @ a[3:]) > 0.9999 and np.linalg.norm(np.cross(point - a[:3], axis)) < 2e-3 * cloud.noise.diagonal for a in axes
        ):
            axes.append(np.concatenate([point, axis]))
    return np.array(directions[:16]).reshape(-1, 3), np.array(axes[:16]).reshape(-1, 6)


def _polish(cloud: DetectionState, rest: np.ndarray, kind: int, row: np.ndarray) -> tuple[float, Surface, np.ndarray] | None:
    """Refit to the points within a shrinking band, then measure the connected support."""
    points, normals, trust = cloud.points[rest], cloud.normals[rest], cloud.trust[rest]
    surface = unpack(kind, row)
    for factor in (2.0, 1.5, 1.0) if kind == PLANE else (3.0, 2.5, 2.0, 1.5, 1.0):
        band = factor * cloud.tolerance_of(surface)
        near = np.flatnonzero(gains(kind, row, band, points, normals, trust, cloud.cosine) > 0.05)
        if len(near) < max(MIN_POINTS[surface.kind], cloud.least):
            return None
        surface, _ = fit_surface(surface.kind, points[subsample(near, 800)], start=surface, scale=band / 2, iterations=8)
        row = pack(surface)
        if not sane(surface, cloud.noise.diagonal):
            return None
    return _support(cloud, rest, kind, surface)


def _mostly_flat(cloud: DetectionState, surface: Surface, index: np.ndarray, rng: np.random.Generator) -> bool:
    """Whether one plane holds a good part of a curved surface's points: it then leans over an edge between faces."""
    points = cloud.points[index]
    if len(points) > 400:
        points = points[rng.choice(len(points), 400, replace=False)]
    triples = rng.integers(len(points), size=(200, 3))
    band = max(cloud.config.flat * cloud.noise.diagonal, 1.5 * cloud.sigma)
    share = 0.3
    if surface.kind == "cylinder":
        # what a plane at the best depth cuts out of a whole thin cylinder
        share = min(max(share, 1.5 * math.acos(max(1 - 2 * band / surface.sizes[0], -1.0)) / math.pi), 0.6)
    return bool(largest_plane(points, triples, band) > max(share * len(points), 5))


def _support(cloud: DetectionState, rest: np.ndarray, kind: int, surface: Surface) -> tuple[float, Surface, np.ndarray] | None:
    row = pack(surface)
    gain = sharp_gains(kind, row, cloud.tolerance_of(surface), cloud.points[rest], cloud.normals[rest], cloud.trust[rest], cloud.cosine)
    near = np.flatnonzero(gain > 0)
    if len(near) < cloud.least:
        return None
    label = pieces(cloud.points[rest[near]], cloud.config.linked * cloud.noise.spacing)
    keep = np.bincount(label)[label] >= cloud.least
    if not keep.any():
        return None
    near = near[keep]
    if kind == ELLIPSOID and not shows_ellipsoid(surface, cloud.points[rest[near]], cloud.tolerance_of(surface)):
        return None
    if (kind != PLANE or cloud.noisy) and not _convincing(cloud, kind, cloud.points[rest[near]], gain[near]):
        return None
    value = float(gain[near].sum() * _PREFERENCE[kind])
    return value * (1.0 if _in_frame(cloud, surface) else cloud.config.off_frame), surface, rest[near]


def _convincing(cloud: DetectionState, kind: int, points: np.ndarray, gain: np.ndarray) -> bool:
    """Whether the points lie well within the tolerance, and as densely as a surface of the cloud does."""
    if len(points) < cloud.least * _LEAST[kind] or (kind != PLANE and gain.mean() < cloud.config.tightness):
        return False
    third = KDTree(points).query(points, k=4)[0][:, 3]
    return float(np.median(third)) < cloud.config.sparse * cloud.noise.spacing


def _in_frame(cloud: DetectionState, surface: Surface) -> bool:
    """Whether the axis is along a plane's normal or another axis of the part, as designed axes are."""
    known = [s.axis for s in cloud.found if s.kind not in AXISLESS]
    return surface.kind in ("plane", *AXISLESS) or not known or float(np.abs(np.array(known) @ surface.axis).max()) > 0.9995


def _accept(cloud: DetectionState, candidates: list[tuple[float, Surface, np.ndarray]]) -> bool:
    """Take the best, and others of the round that do not share its points and are of its order."""
    took = False
    best = candidates[0][0] if candidates else 0.0
    for value, surface, index in candidates:
        free = index[cloud.owner[index] < 0]
        if len(free) < cloud.least or len(free) < 0.95 * len(index) or value < 0.4 * best:
            continue
        cloud.owner[free] = len(cloud.found)
        cloud.found.append(surface)
        took = True
    return took
