"""After the search for surfaces in a cloud: every point given to its nearest one, doubles dropped, all refitted.

Of a noisy cloud those are dropped that the others explain: slabs through walls, cones and planes over edges that denoising rounded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_state import DetectionState, pieces, sane
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.geometry.surface import Patch, signed_distance
from imdim.geometry.surface import normals as surface_normals

_REACH = 3.0  # spacings within which a surface's points let it explain others
_CLIP = 3.0  # deviations; whatever is farther is a stray to every surface
GATHERED = 8  # points of a noisy face whose middle stands for one of them
_WORTH = 1.0  # mean gain in log likelihood per point that makes a surface worth having


def settle(cloud: DetectionState, deadline: Deadline = NEVER) -> None:
    """Give every point its nearest surface; while there is time (by default any), refit, and let go of surfaces that others explain."""
    for _ in range(2):
        if deadline.has_passed():
            break
        _reassign(cloud)
        _merge(cloud)
        for i, surface in enumerate(cloud.found):
            mine = np.flatnonzero(cloud.owner == i)
            if len(mine) >= MIN_POINTS[surface.kind]:
                band = cloud.tolerance_of(surface)
                fitted, _ = fit_surface(surface.kind, cloud.points[mine], start=surface, scale=band / 2, iterations=10)
                if sane(fitted, cloud.noise.diagonal):
                    cloud.found[i] = fitted
    _reassign(cloud)


def _reassign(cloud: DetectionState) -> None:
    """Each point to the nearest surface that has its normal and a piece there; distances in units of what is common to all kinds."""
    nearest = np.full(len(cloud.points), np.inf)
    owner = np.full(len(cloud.points), -1)
    for i, surface in enumerate(cloud.found):
        near = cloud.members(surface)
        if len(near) < cloud.least:
            continue
        label = pieces(cloud.points[near], cloud.config.linked * cloud.noise.spacing)
        near = near[np.bincount(label)[label] >= cloud.least]
        distance = np.abs(signed_distance(surface, cloud.points[near]))
        better = near[distance < nearest[near]]
        nearest[near] = np.minimum(nearest[near], distance)
        owner[better] = i
    cloud.owner = owner
    _drop(cloud)


def _drop(cloud: DetectionState) -> None:
    counts = np.bincount(cloud.owner[cloud.owner >= 0], minlength=len(cloud.found))
    _keep(cloud, np.flatnonzero(counts >= cloud.least))


def _keep(cloud: DetectionState, keep: np.ndarray) -> None:
    """Let go of all surfaces but those numbered `keep` [k]; their points are free."""
    number = np.full(len(cloud.found) + 1, -1)
    number[keep] = np.arange(len(keep))
    cloud.owner = number[cloud.owner]
    cloud.found = [cloud.found[i] for i in keep]


def _merge(cloud: DetectionState) -> None:
    """A surface whose points a larger one explains as well is let go: doubles, and slivers between the sides of a faceted wall."""
    counts = np.bincount(cloud.owner[cloud.owner >= 0], minlength=len(cloud.found))
    for i in np.argsort(-counts, kind="stable"):
        if counts[i] == 0:
            continue
        member = np.zeros(len(cloud.points), bool)
        member[cloud.members(cloud.found[i])] = True
        for j in range(len(cloud.found)):
            mine = cloud.owner == j
            if j != i and 0 < counts[j] < counts[i] and member[mine].mean() > 0.9 and _as_well(cloud, i, j):
                cloud.owner[mine] = i
                counts[i] += counts[j]
                counts[j] = 0
    _drop(cloud)


def _as_well(cloud: DetectionState, i: int, j: int) -> bool:
    """In noise the tolerance is wider than walls are thick: there surface `i` must fit the points of `j` about as closely as `j`."""
    if not cloud.noisy:
        return True
    mine = cloud.points[cloud.owner == j]
    rms_i, rms_j = (float(np.sqrt((signed_distance(cloud.found[k], mine) ** 2).mean())) for k in (i, j))
    return rms_i < 1.25 * rms_j


def prune(cloud: DetectionState, deadline: Deadline = NEVER) -> None:
    """Let go, smallest first, of surfaces without which the measured points are about as likely; their points go to the others.

    The likelihood is that of the measured Gaussian noise, with distances clipped at three of it. Past the `deadline`
    (by default never) the others stay.
    """
    assert cloud.raw is not None
    if not cloud.found:
        return
    distance = np.column_stack([np.abs(signed_distance(s, cloud.raw)) for s in cloud.found]) / cloud.noise.sigma
    distance = np.minimum(distance, _CLIP)
    while len(cloud.found) > 1 and not deadline.has_passed():
        counts = np.bincount(cloud.owner[cloud.owner >= 0], minlength=len(cloud.found))
        for j in np.argsort(counts, kind="stable"):
            mine = np.flatnonzero(cloud.owner == j)
            other = _others(cloud, distance, mine, int(j))
            gain = (other.min(1) ** 2 - distance[mine, j] ** 2) / 2
            if len(mine) == 0 or gain.mean() < _WORTH:
                cloud.owner[mine] = np.where(other.min(1) < _CLIP, other.argmin(1), -1)
                break
        else:
            return
        keep = np.flatnonzero(np.arange(len(cloud.found)) != j)
        _keep(cloud, keep)
        distance = distance[:, keep]


def _others(cloud: DetectionState, distance: np.ndarray, mine: np.ndarray, j: int) -> np.ndarray:
    """Clipped distances [m, k] of the points `mine` to the surfaces that are present there, but for surface `j`."""
    out = distance[mine].copy()
    for k in range(len(cloud.found)):
        held = cloud.points[cloud.owner == k]
        if k == j or len(held) == 0:
            out[:, k] = _CLIP
            continue
        out[KDTree(held).query(cloud.points[mine])[0] > _REACH * cloud.noise.spacing, k] = _CLIP
    return out


def patches_of(cloud: DetectionState) -> list[Patch]:
    """By falling area; of a denoised cloud with the points as measured, and carriers fitted to those."""
    out = []
    for i, surface in enumerate(cloud.found):
        mine = (cloud.points if cloud.raw is None else cloud.raw)[cloud.owner == i]
        if cloud.raw is not None:
            fitted, _ = fit_surface(surface.kind, mine, start=surface, scale=1.5 * cloud.noise.sigma, iterations=15)
            surface = fitted if sane(fitted, cloud.noise.diagonal) else surface
        out.append(Patch(surface, mine, cloud.noise.spacing**2 * len(mine)))
    return sorted(out, key=lambda p: -p.area)


def gather_points(patch: Patch) -> Patch:
    """The patch with every point moved to the middle of its neighbours on it, and onto its carrier.

    Noise strews points past a face's edges; their neighbours' middles lie within.
    """
    near = KDTree(patch.points).query(patch.points, k=min(GATHERED, len(patch.points)))[1].reshape(len(patch.points), -1)
    points = patch.points[near].mean(1)
    for _ in range(2):
        points = points - signed_distance(patch.surface, points)[:, None] * surface_normals(patch.surface, points)
    return replace(patch, points=points)
