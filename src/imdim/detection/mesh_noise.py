"""What a mesh says of its own noise: how far the facets of a scan lie off the smooth surfaces that were found among them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.detection.noise import EXACT, NoiseModel
from imdim.geometry.surface import Patch, signed_distance

SHAKEN = 1e-4  # of the diagonal, off which half the surface lies: that of a drawn part lies on its carriers to what its file rounds


def measure_mesh_noise(patches: Sequence[Patch], spacing: float) -> NoiseModel:
    """The noise of a mesh in its unit frame by the root mean square distance of its facets' corners from the carriers that `patches` found,
    the median by area; EXACT for a drawn part. `spacing` is the side of the square that one of its triangles stands for."""
    # any smooth surface is nearly an ellipsoid's for a while: what is off that is no noise
    patches = [p for p in patches if p.surface.kind != "ellipsoid"]
    if not patches:
        return EXACT
    off = np.array([np.sqrt(np.mean(signed_distance(p.surface, p.points) ** 2)) for p in patches])
    order = np.argsort(off, kind="stable")
    area = np.cumsum(np.array([p.area for p in patches])[order])
    sigma = float(off[order][np.searchsorted(area, area[-1] / 2)])
    return NoiseModel(spacing, sigma, 1.0) if sigma > SHAKEN else EXACT
