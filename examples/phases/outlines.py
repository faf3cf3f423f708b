"""From control points to curves and surfaces, and from those to a cloud: distances with slopes, and the projection weights W."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from cloud_fit import Distances

from imdim.sketch.residuals import TINY


def project_on_faces(cloud: np.ndarray, corners: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """W [m, n]: the convex weights of control points for which W @ corners is the point nearest to each cloud point [m, 3].

    Faces are parallelograms, given by four corners in turn; a row has at most four entries and sums to one.
    """
    best, weights = np.full(len(cloud), np.inf), np.zeros((len(cloud), len(corners)))
    for a, b, c, d in faces:
        e, f = corners[b] - corners[a], corners[d] - corners[a]
        u, v = _nearest_shares(cloud - corners[a], e, f)
        row = np.zeros_like(weights)
        row[:, a], row[:, b], row[:, c], row[:, d] = (1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v
        gap = np.linalg.norm(cloud - row @ corners, axis=1)
        closer = gap < best
        best[closer], weights[closer] = gap[closer], row[closer]
    return weights


def _nearest_shares(w: np.ndarray, e: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u and v in 0..1 for which u e + v f is nearest to w [m, 3]: within, or on one of four edges."""
    ee, ff, ef, we, wf = e @ e, f @ f, e @ f, w @ e, w @ f
    area = max(ee * ff - ef * ef, TINY)
    inner = (we * ff - wf * ef) / area, (wf * ee - we * ef) / area
    options = [inner]
    for fixed in (0.0, 1.0):
        level = np.full(len(w), fixed)
        options += [(level, np.clip((wf - fixed * ef) / ff, 0, 1)), (np.clip((we - fixed * ef) / ee, 0, 1), level)]
    outside = (np.minimum(*inner) < 0) | (np.maximum(*inner) > 1)
    gaps = np.stack([np.linalg.norm(w - u[:, None] * e - v[:, None] * f, axis=1) for u, v in options])
    gaps[0, outside] = np.inf
    pick = gaps.argmin(axis=0), np.arange(len(w))
    return np.stack([u for u, _ in options])[pick], np.stack([v for _, v in options])[pick]


def to_faces(cloud: np.ndarray, faces: Sequence[Sequence[int]]) -> Distances:
    """Vectors from W @ corners to the cloud, with W held at its best: its own slope is zero or along the surface."""

    def distances(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weights = project_on_faces(cloud, corners, faces)
        apart = cloud - weights @ corners
        length = np.sqrt((apart**2).sum(axis=1))
        return length, -weights[:, :, None] * (apart / np.maximum(length, TINY)[:, None])[:, None]

    return distances


def to_polygon(cloud: np.ndarray) -> Distances:
    """Unsigned distances of cloud [m, 3] from the closed polygon of the control points, in their order."""

    def distances(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, rows = len(corners), np.arange(len(cloud))
        ends = np.roll(corners, -1, axis=0)
        share, apart = _to_segments(cloud, corners, ends)
        side = (apart**2).sum(axis=2).argmin(axis=1)
        vector, t = apart[rows, side], share[rows, side]
        length = np.sqrt((vector**2).sum(axis=1))
        unit = vector / np.maximum(length, TINY)[:, None]
        slopes = np.zeros((len(cloud), n, 3))
        slopes[rows, side] = -(1 - t)[:, None] * unit
        slopes[rows, (side + 1) % n] = -t[:, None] * unit
        return length, slopes

    return distances


def _to_segments(cloud: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The share along each segment of the nearest point [m, s], and the vector from it [m, s, 3]."""
    t = ends - starts
    w = cloud[:, None] - starts
    share = np.clip((w * t).sum(-1) / np.maximum((t * t).sum(-1), TINY), 0, 1)
    return share, w - share[..., None] * t


def polygon_error(cloud: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Mean squared distance [b] of cloud [m, 3] from each of many closed polygons [b, n, 3], in the plane."""
    starts, c = corners[:, None, :, :2], cloud[None, :, None, :2]
    t = np.roll(corners, -1, axis=1)[:, None, :, :2] - starts
    w = c - starts
    share = np.clip((w * t).sum(-1) / np.maximum((t * t).sum(-1), TINY), 0, 1)
    return ((w - share[..., None] * t) ** 2).sum(-1).min(axis=2).mean(axis=1)


def to_arc(cloud: np.ndarray) -> Distances:
    """Distances in the plane from the arc about control point 0, the virtual anchor, from point 1 counterclockwise to point 2.

    Points 1 and 2 should be equally far from the anchor; the radius is their mean. Beyond an end, the distance is to that end. A cloud
    point in the arc's angle gives its signed distance.
    """

    def distances(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        anchor, ends = x[0], x[1:3]
        spokes = ends - anchor
        radii = np.maximum(np.linalg.norm(spokes, axis=1), TINY)
        w = cloud - anchor
        far = np.maximum(np.linalg.norm(w, axis=1), TINY)
        begin, stop = np.arctan2(spokes[:, 1], spokes[:, 0])
        within = (np.arctan2(w[:, 1], w[:, 0]) - begin) % (2 * np.pi) <= (stop - begin) % (2 * np.pi)
        slopes = np.zeros((len(cloud), len(x), 3))
        slopes[:, 1:3] = -0.5 * spokes / radii[:, None]
        slopes[:, 0] = -w / far[:, None] + 0.5 * (spokes / radii[:, None]).sum(axis=0)
        residual = far - radii.mean()
        gap = cloud[:, None] - ends
        lengths = np.maximum(np.linalg.norm(gap, axis=2), TINY)
        end = lengths.argmin(axis=1)
        out = np.flatnonzero(~within)
        residual[out] = lengths[out, end[out]]
        slopes[out] = 0
        slopes[out, 1 + end[out]] = -gap[out, end[out]] / residual[out, None]
        return residual, slopes

    return distances


def to_circle(cloud: np.ndarray) -> Distances:
    """Signed distances in the plane from the circle about control point 0, the virtual anchor, through control point 1."""

    def distances(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        w, spoke = cloud - x[0], x[1] - x[0]
        far, radius = np.maximum(np.linalg.norm(w, axis=1), TINY), max(float(np.linalg.norm(spoke)), TINY)
        slopes = np.zeros((len(cloud), len(x), 3))
        slopes[:, 1] = -spoke / radius
        slopes[:, 0] = spoke / radius - w / far[:, None]
        return far - radius, slopes

    return distances
