"""Small pictures of signed sequences for tensorboard: target on the left, what was written for it on the right."""

from __future__ import annotations

import numpy as np
import torch

from imdim.data.solids import Solids
from imdim.data.surfaces import surface_clouds

PIXELS = 128
POINTS = 12_000
DISC = 2  # pixels that a point reaches in each direction
VIEW = np.array([0.55, -0.68, 0.48])  # towards the camera
LIGHT = np.array([0.25, -0.6, 0.85])
TARGET, WRITTEN = np.array([168, 178, 190.0]), np.array([112, 158, 204.0])


def pairs(truth: Solids, found: Solids, most: int = 8) -> np.ndarray:
    """One picture uint8 [rows * PIXELS, 2 * PIXELS, 3] of the first `most` rows; solids have a diagonal of about 1 around 0."""
    panels = [_panels(solids[:most], colour) for solids, colour in ((truth, TARGET), (found, WRITTEN))]
    return np.concatenate([np.concatenate(row, 1) for row in zip(*panels, strict=True)], 0)


def _panels(solids: Solids, colour: np.ndarray) -> list[np.ndarray]:
    chance = torch.Generator(solids.kinds.device).manual_seed(0)
    points, normals, count = surface_clouds(solids, POINTS, chance)
    rows = zip(points.cpu().numpy(), normals.cpu().numpy(), count.tolist(), strict=True)
    return [drawn(p[: c or 0], n[: c or 0], colour) for p, n, c in rows]


def drawn(points: np.ndarray, normals: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Oriented points [n, 3] as lit discs on white, nearest on top, uint8 [PIXELS, PIXELS, 3]."""
    axes = _axes()
    # what faces away would shine through between the discs
    front = normals @ axes[2] > 0
    local, shade = points[front] @ axes.T, 0.5 + 0.5 * np.clip(normals[front] @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    reach = np.arange(-DISC, DISC + 1)
    dy, dx = (a.ravel() for a in np.meshgrid(reach, reach))
    column = (PIXELS / 2 + PIXELS * 0.9 * local[:, :1]).astype(int) + dx
    row = (PIXELS / 2 - PIXELS * 0.9 * local[:, 1:2]).astype(int) + dy
    seen = (column >= 0) & (column < PIXELS) & (row >= 0) & (row < PIXELS)
    depth, lit = (np.broadcast_to(v[:, None], seen.shape)[seen] for v in (local[:, 2], shade))
    nearest = np.argsort(depth, kind="stable")  # of equal indices the last one stays
    picture = np.full((PIXELS, PIXELS, 3), 255.0)
    picture[row[seen][nearest], column[seen][nearest]] = lit[nearest, None] * colour
    return picture.astype(np.uint8)


def _axes() -> np.ndarray:
    """Rows: right, up, towards the camera."""
    toward = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])
