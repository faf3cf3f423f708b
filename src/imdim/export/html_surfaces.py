"""Surfaces as the report's page draws them: the solid with the leaf that made each face, the target with its distances, few and short.

Coordinates are whole steps along the sides of the box of all that is drawn, so that one part has the same size at any scale.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import KDTree

from imdim.export.surface_colours import ColouredResult, ColouredTarget
from imdim.geometry.refine import split_edges
from imdim.geometry.sampling import subsample
from imdim.geometry.triangles import distances, triangle_tree
from imdim.target.target import Target

MOST_FACES = 60_000  # of one surface
MOST_REFINED = 30_000  # faces of a target, halved where they are large
MOST_POINTS = 40_000  # of a cloud
FINENESS = 40  # edges along the diagonal: between two corners the page draws the mean of their colours
FINEST_GRID = 512  # cells along the longest side, where faces are too many
STEPS = 65_535  # along each side of a surface's box
SMALLEST_RANGE = 1e-3  # of the diagonal: a perfect result is not to look patchy


@dataclass(frozen=True)
class Box:
    """What the page draws lies in here: `low` and `high` [3], in model units."""

    low: np.ndarray
    high: np.ndarray

    @staticmethod
    def around(*points: np.ndarray) -> Box:
        """The box of all points [n, 3]; that of the origin where there are none."""
        every = np.concatenate([np.asarray(p, np.float64).reshape(-1, 3) for p in points])
        every = every if len(every) else np.zeros((1, 3))
        return Box(every.min(axis=0), every.max(axis=0))

    @property
    def diagonal(self) -> float:
        """Its length, in model units."""
        return float(np.linalg.norm(self.high - self.low))

    def pack_points(self, points: np.ndarray) -> str:
        """Points [n, 3] as base64 of whole steps."""
        side = np.maximum(self.high - self.low, 1e-300)
        return _base64(np.round((np.asarray(points, np.float64) - self.low) / side * STEPS).astype("<u2"))


def solid_values(surface: trimesh.Trimesh, owners: np.ndarray, box: Box, coverage: ColouredResult | None = None) -> dict[str, Any]:
    """The solid: corners, faces, and the leaf of each face as runs ``[leaf, faces]``; with a `coverage` also that of each face."""
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    if coverage is not None:
        vertices, faces, parents = split_edges(vertices, faces, box.diagonal / FINENESS, MOST_REFINED)
        owners = owners[parents]
    vertices, faces, kept = cluster_vertices(vertices, faces)
    starts = np.flatnonzero(np.diff(owners[kept], prepend=-1))
    counts = np.diff(np.append(starts, len(kept)))
    runs = np.column_stack([owners[kept][starts], counts])
    out = {"points": box.pack_points(vertices), "faces": _indices(faces, len(vertices)), "owners": runs.tolist()}
    if coverage is None:
        return out
    nearest = KDTree(coverage.mesh.triangles_center).query(vertices[faces].mean(1))[1]
    return {**out, "coverage": _base64(coverage.codes[nearest].astype(np.uint8))}


def target_values(
    target: Target, surface: trimesh.Trimesh, box: Box, worst: float | None = None, verdict: ColouredTarget | None = None
) -> dict[str, Any]:
    """The target with the distance of each corner or point to the result, in 255ths of `top`, the end of the scale.

    `worst` is the largest distance where it was measured better than over these corners. With a `verdict` also that on each face or point.
    """
    codes = np.empty(0)
    if target.mesh is None:
        points, faces = subsample(target.points, MOST_POINTS), None
        codes = codes if verdict is None else subsample(verdict.codes, MOST_POINTS)
    elif verdict is not None and verdict.mesh is not None:  # which is fine already
        points, faces, kept = cluster_vertices(np.asarray(verdict.mesh.vertices), np.asarray(verdict.mesh.faces))
        codes = verdict.codes[kept]
    else:
        points, faces, _ = cluster_vertices(np.asarray(target.mesh.vertices), np.asarray(target.mesh.faces))
        points, faces, _ = split_edges(points, faces, Box.around(points).diagonal / FINENESS, MOST_REFINED)
    far = distances(triangle_tree(surface), points) if len(surface.faces) else np.full(len(points), box.diagonal)
    top = max(far.max(initial=0.0) if worst is None else worst, SMALLEST_RANGE * box.diagonal)
    shade = np.round(np.clip(far / top, 0.0, 1.0) * 255).astype(np.uint8)
    out = {"points": box.pack_points(points), "distances": _base64(shade), "top": float(top)}
    if verdict is not None:
        out["verdicts"] = _base64(codes.astype(np.uint8))
    return out if faces is None else {**out, "faces": _indices(faces, len(points))}


def cluster_vertices(vertices: np.ndarray, faces: np.ndarray, most: int = MOST_FACES) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At most `most` faces: vertices in one cell of a grid become one (Rossignac and Borrel 1993), the finest grid that does it.

    Returns vertices [v, 3], faces [f, 3] and the number [f] that each had.
    """
    kept, cells = np.arange(len(faces)), FINEST_GRID
    merged, out = vertices, faces
    while len(out) > most:
        low, extent = vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-300)
        key = np.minimum((vertices - low) / extent * cells, cells - 1).astype(np.int64) @ [1 << 40, 1 << 20, 1]
        _, first, cell = np.unique(key, return_index=True, return_inverse=True)
        moved = cell.reshape(-1)[faces]
        kept = np.flatnonzero((moved[:, 0] != moved[:, 1]) & (moved[:, 1] != moved[:, 2]) & (moved[:, 2] != moved[:, 0]))
        merged, out = vertices[first], moved[kept]
        cells //= 2
    used, corners = np.unique(out.ravel(), return_inverse=True)
    return merged[used], corners.reshape(-1, 3), kept


def _indices(faces: np.ndarray, vertices: int) -> str:
    """Base64 of two bytes an index where these suffice, else of four."""
    return _base64(faces.astype("<u2" if vertices <= STEPS else "<u4"))


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
