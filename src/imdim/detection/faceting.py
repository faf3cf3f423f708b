"""How far a mesh lies from the smooth surfaces that its facets stand for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from imdim.geometry.surface import Patch, normals, signed_distance

ON_SURFACE = 2e-4  # of the diagonal: a corner of a facet lies on its surface
FACING = 0.9  # cosine between a facet and its surface: the end of a cylinder has its corners on it too
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
