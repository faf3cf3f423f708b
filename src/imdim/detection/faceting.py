"""How far a mesh lies from the smooth surfaces that its facets stand for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from imdim.detection.facets import Facets, MeshSurfaceConfig
from imdim.geometry.surface import Patch, normals, signed_distance, unit

ON_SURFACE = 2e-4  # of the diagonal: a corner of a facet lies on its surface
FACING = 0.9  # cosine between a facet and its surface: the end of a cylinder has its corners on it too
LEAST_TURN = 1e-3  # radians between two facets: less is a flat
ONE_SIDED = 0.6  # of its turns: a facet on which more of them lie to one side ends a curve
LARGEST_RADIUS = 6.0  # diagonals: what turns less is a flat with noise
# Quadrature over a triangle, exact for second degrees (Strang and Fix 1973): a chord is as far as a parabola.
QUADRATURE = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6


def volume_between(mesh: trimesh.Trimesh, patches: Sequence[Patch]) -> float:
    """Volume between the mesh and the curved surfaces that its corners lie on, in cubed units of the mesh: what an exact program of
    these surfaces differs by from the mesh, and no fault of it."""
    corners = np.asarray(mesh.triangles, float)
    left, total = np.ones(len(corners), bool), 0.0
    near = ON_SURFACE * float(np.linalg.norm(mesh.extents))
    for patch in (p for p in patches if p.surface.kind != "plane"):
        low, high = patch.points.min(0) - near, patch.points.max(0) + near
        about = np.flatnonzero(left & ((corners >= low) & (corners <= high)).all((1, 2)))
        on = np.abs(signed_distance(patch.surface, corners[about].reshape(-1, 3)).reshape(-1, 3)).max(1, initial=0.0) <= near
        about = about[on]
        facing = (normals(patch.surface, corners[about].mean(1)) * mesh.face_normals[about]).sum(1)
        about = about[np.abs(facing) >= FACING]
        inner = np.einsum("qc,tcx->tqx", QUADRATURE, corners[about])
        depth = np.abs(signed_distance(patch.surface, inner.reshape(-1, 3))).reshape(-1, 3).mean(1)
        total += float(depth @ mesh.area_faces[about])
        left[about] = False
    return total


def chord_heights(facets: Facets) -> tuple[np.ndarray, np.ndarray]:
    """How far each facet [u], as a chord, may lie from the curve that it stands for, and the radius [u] of that, in units of the mesh; both
    0 where a facet is a flat."""
    pairs, angle, half = chord_pairs(facets)
    height, radius = np.zeros(len(facets.areas)), np.full(len(facets.areas), np.inf)
    np.maximum.at(height, pairs, (half * np.tan(angle / 4))[:, None])
    np.minimum.at(radius, pairs, (half / np.sin(angle / 2))[:, None])
    return height, np.where(radius <= LARGEST_RADIUS * facets.diagonal, radius, 0.0)


def chord_pairs(facets: Facets) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbours [p, 2] that are chords of one curved surface, the angle [p] between their normals, and half the width [p] of the narrower.

    They meet in an edge that turns little, are of about one width - a wall beside a strip of a rounding is no chord of it - and the turn
    goes on beyond one of them: two flats that lean to each other are no curve.
    """
    smooth = (facets.angles > LEAST_TURN) & (facets.angles < np.radians(MeshSurfaceConfig.smooth_deg))
    pairs, angle = facets.edges[smooth], facets.angles[smooth]
    apart = facets.centers[pairs[:, 1]] - facets.centers[pairs[:, 0]]
    # from the middle of each to the line in which their planes meet: half of a strip's width
    half = np.abs(np.einsum("ex,efx->ef", apart, facets.normals[pairs[:, ::-1]])) / np.sin(angle)[:, None]
    less = half.min(1, initial=np.inf)
    alike = half.max(1, initial=0.0) <= MeshSurfaceConfig.wide_span * less
    # beside a wall a rounding of two strips goes on in it; beside a chamfer what goes on is told by strips alone
    chosen = alike & _goes_on(facets, pairs, angle, apart)
    chosen[alike] |= _goes_on(facets, pairs[alike], angle[alike], apart[alike])
    return pairs[chosen], angle[chosen], less[chosen]


def _goes_on(facets: Facets, pairs: np.ndarray, angle: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Whether the turn by `angle` [p] between two facets [p, 2] goes on beyond one of them, the same way and by about as much.

    `apart` [p, 3] leads from the middle of the first to that of the second.
    """
    bulges = np.einsum("ex,ex->e", apart, facets.normals[pairs[:, 0]]) < 0
    out = np.zeros(len(pairs), bool)
    for way in (True, False):
        chosen = np.flatnonzero(bulges == way)
        # turns to one side and the other, as vectors across the edges, cancel out
        sums, total = np.zeros((len(facets.areas), 3)), np.zeros(len(facets.areas))
        for end, sign in ((0, 1.0), (1, -1.0)):
            own = pairs[chosen, end]
            across = unit(_flatten(sign * apart[chosen], facets.normals[own])) * angle[chosen, None]
            np.add.at(sums, own, across)
            np.add.at(total, own, angle[chosen])
        continues = np.linalg.norm(sums, axis=1) < ONE_SIDED * total
        out[chosen] = continues[pairs[chosen]].any(1)
    return out


def _flatten(vectors: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """What of vectors [n, 3] lies in the planes of these normals [n, 3]."""
    return vectors - np.einsum("nx,nx->n", vectors, normals)[:, None] * normals
