"""What a mesh says of its own noise: how far the facets of a scan lie off the smooth surfaces that were found among them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from imdim.detection.noise import EXACT, NoiseModel
from imdim.geometry.surface import Patch, signed_distance

SHAKEN = 1e-4  # of the diagonal, off which half the surface lies: that of a drawn part lies on its carriers to what its file rounds
DEVIATION = 4e-3  # of its diagonal, by which a real thing leaves what was drawn: bulges, dents, rounded edges
EXPLAINED = 0.95  # of the surface: carriers explain a drawn part whole, though where cuts cross its facets corners lie on chords


def measure_mesh_noise(mesh: trimesh.Trimesh, patches: Sequence[Patch]) -> NoiseModel:
    """The noise of a mesh in its unit frame by the root mean square distance of its facets' corners from the carriers that `patches` found,
    the median by area; EXACT for a drawn part. Its spacing is the side of the square that one of its triangles stands for."""
    areas = np.array([p.area for p in patches])
    if not len(patches) or areas.sum() > EXPLAINED * mesh.area:
        return EXACT
    off = np.array([np.sqrt(np.mean(signed_distance(p.surface, p.points) ** 2)) for p in patches])
    order = np.argsort(off, kind="stable")
    area = np.cumsum(areas[order])
    sigma = float(off[order][np.searchsorted(area, area[-1] / 2)])
    return NoiseModel(float(np.sqrt(mesh.area / len(mesh.faces))), sigma, 1.0, bulges=True) if sigma > SHAKEN else EXACT
