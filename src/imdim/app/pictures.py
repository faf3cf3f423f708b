"""Small pictures of signed sequences for tensorboard: target on the left, what was written for it on the right."""

from __future__ import annotations

import numpy as np
import torch

from imdim.data.solids import Solids
from imdim.data.surfaces import surface_clouds
from imdim.export.preview import RESULT_COLOUR, TARGET_COLOUR, Camera, discs, view_axes

PIXELS = 128
POINTS = 12_000


def pairs(truth: Solids, found: Solids, most: int = 8) -> np.ndarray:
    """One picture uint8 [rows * PIXELS, 2 * PIXELS, 3] of the first `most` rows; solids have a diagonal of about 1 around 0."""
    panels = [_panels(solids[:most], colour) for solids, colour in ((truth, TARGET_COLOUR), (found, RESULT_COLOUR))]
    return np.concatenate([np.concatenate(row, 1) for row in zip(*panels, strict=True)], 0)


def _panels(solids: Solids, colour: np.ndarray) -> list[np.ndarray]:
    chance = torch.Generator(solids.kinds.device).manual_seed(0)
    points, normals, count = surface_clouds(solids, POINTS, chance)
    rows = zip(points.cpu().double().numpy(), normals.cpu().double().numpy(), count.tolist(), strict=True)
    return [draw_cloud(p[: c or 0], n[: c or 0], colour) for p, n, c in rows]


def draw_cloud(points: np.ndarray, normals: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Oriented points [n, 3] as lit discs on white, nearest on top, uint8 [PIXELS, PIXELS, 3]."""
    camera = Camera(view_axes(), np.zeros(3), 0.9 * PIXELS, PIXELS)
    # what faces away would shine through between the discs
    front = normals @ camera.axes[2] > 0
    if not front.any():
        return np.full((PIXELS, PIXELS, 3), 255, np.uint8)
    return np.asarray(discs(points[front], normals[front], camera, colour))
