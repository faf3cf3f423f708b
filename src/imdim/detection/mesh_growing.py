"""What growing a carrier over the facets of a mesh needs: tolerances, and which facets are free with their smooth neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.detection.facets import Facets


@dataclass(frozen=True)
class MeshSurfaceConfig:
    """Tolerances relative to the diagonal, angles in degrees."""

    on_surface: float = 2e-4  # corner to carrier
    loose: float = 8e-4  # the same in the second pass
    smooth_deg: float = 46.0  # facets that meet under more are not one smooth surface (an octagon still is)
    follow_deg: float = 24.0  # facet normal to carrier normal at the facet's corners
    wide_span: float = 2.6  # a facet spanning this many times the typical angle is a flat, not a part of the curve
    max_failures: int = 150
    most_work: int = 40_000_000  # triangles looked at, per pass; it ends the search for curves on huge or noisy meshes
    max_planes: int = 160
    least_plane: float = 2e-7  # of the squared diagonal
    same_plane_deg: float = 0.3


@dataclass
class Growing:
    """What the hypotheses share: which facets are free, and each facet's smooth neighbours."""

    facets: Facets
    free: np.ndarray
    neighbours: list[list[int]]
    config: MeshSurfaceConfig
    spent: int = 0  # triangles looked at


def points_of(facets: Facets, chosen: np.ndarray) -> np.ndarray:
    """Distinct corners [n, 3] of the chosen facets."""
    return np.unique(facets.corners[facets.triangles(chosen)].reshape(-1, 3), axis=0)
