"""Planes that no points show but the ends of other faces do: the rims of thin fins and sheets hold too few points to be detected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.detection.cloud_state import pieces
from imdim.geometry.surface import Patch, Surface, vec

VOTES = 2  # faces that must end at one place
ORTHOGONAL = 1e-2
PARALLEL = 1 - 1e-4
MIN_POINTS = 12


def closing_planes(patches: Sequence[Patch], spacing: float) -> list[Surface]:
    """Planes where at least two pieces of plane patches end together and no detected plane is within two `spacing`.

    Each piece of a plane ends along the normals of the planes orthogonal to it; ends are a third of a spacing beyond its last point.
    """
    planes = [p for p in patches if p.surface.kind == "plane"]
    normals = _distinct([np.asarray(p.surface.axis) for p in planes])
    out = []
    for normal in normals:
        known = [float(np.asarray(p.surface.point) @ normal) for p in planes if abs(np.asarray(p.surface.axis) @ normal) > PARALLEL]
        ends = np.sort([e for p in planes for e in _ends(p, normal, spacing)])
        for group in np.split(ends, np.flatnonzero(np.diff(ends) > 0.7 * spacing) + 1):
            offset = float(np.mean(group)) if len(group) else 0.0
            if len(group) >= VOTES and all(abs(offset - k) > 2 * spacing for k in known):
                out.append(Surface("plane", vec(offset * normal), vec(normal)))
    return out


def _ends(patch: Patch, normal: np.ndarray, spacing: float) -> list[float]:
    """Offsets along `normal` at which the connected pieces of a patch end; none unless the patch is orthogonal to it."""
    if abs(np.asarray(patch.surface.axis) @ normal) > ORTHOGONAL or len(patch.points) < MIN_POINTS:
        return []
    label = pieces(patch.points, 4 * spacing)
    at = patch.points @ normal
    out = []
    for piece in range(label.max() + 1):
        along = at[label == piece]
        if len(along) >= MIN_POINTS:
            out += [float(along.min()) - spacing / 3, float(along.max()) + spacing / 3]
    return out


def _distinct(vectors: list[np.ndarray]) -> list[np.ndarray]:
    out: list[np.ndarray] = []
    for v in vectors:
        if not any(abs(v @ w) > PARALLEL for w in out):
            out.append(v)
    return out
