"""CoACD (Wei et al. 2022): approximate convex parts; the solid is the exact union of their hulls. All settings are its defaults."""

from __future__ import annotations

import coacd
import numpy as np
import trimesh
from manifold3d import Manifold, OpType

from imdim.geometry.solid import to_trimesh


def solve(mesh: trimesh.Trimesh, seed: int) -> tuple[trimesh.Trimesh, int, str]:
    """The union as a mesh, and the number of convex parts."""
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), seed=seed)
    solid = Manifold.batch_boolean([Manifold.hull_points(np.asarray(vertices)) for vertices, _ in parts], OpType.Add)
    return to_trimesh(solid), len(parts), ""
