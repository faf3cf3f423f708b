"""Polygons of meshes as triangles: fans where they are convex, cut so that none sticks out where they are not."""

from __future__ import annotations

import numpy as np
from manifold3d import triangulate as cut_into_triangles

BENT = 1e-9  # of a corner's own edges, by which it must turn the other way before a polygon counts as concave


def triangulate_polygons(points: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Triangles [m, 3] int64 of polygons of `points` [n, 3] that run one after the other through `corners`, with `sizes` corners each.

    They come in the order of their polygons, of which those with less than three corners have none. Raises ValueError where a corner
    names no point.
    """
    sizes, corners = np.asarray(sizes, np.int64), np.asarray(corners, np.int64)
    bad = int(((corners < 0) | (corners >= len(points))).sum())
    if bad:
        raise ValueError(f"{bad} of {len(corners)} corners name a vertex that is not among the {len(points)}")
    starts, pieces, owners = np.cumsum(sizes) - sizes, [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes >= 3]):
        polygons = np.flatnonzero(sizes == size)
        loops = corners[starts[polygons][:, None] + np.arange(size)]
        triangles = _fans(loops)
        if size > 3:
            for i in np.flatnonzero(_are_concave(points, loops)):
                triangles[i] = _cut(points, loops[i], triangles[i])
        pieces.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(polygons, size - 2))
    return np.concatenate(pieces)[np.argsort(np.concatenate(owners), kind="stable")]


def _fans(loops: np.ndarray) -> np.ndarray:
    """Triangles [k, s - 2, 3] that share the first corner of each loop [k, s]."""
    first = np.broadcast_to(loops[:, :1], (len(loops), loops.shape[1] - 2))
    return np.stack([first, loops[:, 1:-1], loops[:, 2:]], axis=2)


def _are_concave(points: np.ndarray, loops: np.ndarray) -> np.ndarray:
    """Whether some corner of each loop turns against the loop's own normal (Newell's)."""
    with np.errstate(all="ignore"):  # what is not finite is refused later
        along = points[np.roll(loops, -1, axis=1)] - points[loops]
        turns = np.cross(np.roll(along, 1, axis=1), along)
        lengths = np.linalg.norm(along, axis=2)
        normal = _newell(points[loops])
        back = np.einsum("ksi,ki->ks", turns, normal)
        return (back < -BENT * np.roll(lengths, 1, axis=1) * lengths).any(axis=1)


def _newell(loops: np.ndarray) -> np.ndarray:
    """Unit normals [k, 3] of loops of places [k, s, 3], by their areas seen along the axes."""
    seen_from = loops - loops[:, :1]
    area = np.cross(seen_from, np.roll(seen_from, -1, axis=1)).sum(axis=1)
    return area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)


def _cut(points: np.ndarray, loop: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Triangles of a concave loop, seen along its normal; `otherwise` for a loop that crosses itself, of which there is no right answer."""
    normal = _newell(points[loop][None])[0]
    aside = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    aside /= max(float(np.linalg.norm(aside)), 1e-300)
    flat = (points[loop] - points[loop[0]]) @ np.stack([aside, np.cross(normal, aside)], axis=1)
    if not np.isfinite(flat).all():
        return otherwise
    found = np.asarray(cut_into_triangles([flat]), np.int64)
    return loop[found] if found.shape == otherwise.shape else otherwise
