"""Surfaces of a noisy cloud that the others explain: slabs through walls, cones and planes over edges that denoising rounded."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_state import DetectionState
from imdim.geometry.surface import signed_distance

_REACH = 3.0  # spacings within which a surface's points let it explain others
_CLIP = 3.0  # deviations; whatever is farther is a stray to every surface
_WORTH = 1.0  # mean gain in log likelihood per point that makes a surface worth having


def prune(cloud: DetectionState, sigma: float, deadline: Deadline = NEVER) -> None:
    """Let go, smallest first, of surfaces without which the measured points are about as likely; their points go to the others.

    The likelihood is that of Gaussian noise of deviation `sigma`, with distances clipped at three of it. Past the `deadline`
    (by default never) the others stay.
    """
    assert cloud.raw is not None
    if not cloud.found:
        return
    distance = np.column_stack([np.abs(signed_distance(s, cloud.raw)) for s in cloud.found]) / sigma
    distance = np.minimum(distance, _CLIP)
    while len(cloud.found) > 1 and not deadline.has_passed():
        counts = np.bincount(cloud.owner[cloud.owner >= 0], minlength=len(cloud.found))
        for j in np.argsort(counts, kind="stable"):
            mine = np.flatnonzero(cloud.owner == j)
            other = _others(cloud, distance, mine, int(j))
            gain = (other.min(1) ** 2 - distance[mine, j] ** 2) / 2
            if len(mine) == 0 or gain.mean() < _WORTH:
                cloud.owner[mine] = np.where(other.min(1) < _CLIP, other.argmin(1), -1)
                break
        else:
            return
        keep = np.arange(len(cloud.found)) != j
        number = np.cumsum(keep) - 1
        cloud.owner = np.where(cloud.owner >= 0, number[cloud.owner], -1)
        cloud.found = [s for s, k in zip(cloud.found, keep, strict=True) if k]
        distance = distance[:, keep]


def _others(cloud: DetectionState, distance: np.ndarray, mine: np.ndarray, j: int) -> np.ndarray:
    """Clipped distances [m, k] of the points `mine` to the surfaces that are present there, but for surface `j`."""
    out = distance[mine].copy()
    for k in range(len(cloud.found)):
        held = cloud.points[cloud.owner == k]
        if k == j or len(held) == 0:
            out[:, k] = _CLIP
            continue
        out[KDTree(held).query(cloud.points[mine])[0] > _REACH * cloud.noise.spacing, k] = _CLIP
    return out
