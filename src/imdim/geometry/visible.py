"""What of a mesh is seen from above, pixel by pixel: scan conversion with a depth buffer (Catmull 1974)."""

from __future__ import annotations

import numpy as np
from numba import njit

SEAM = 1e-9  # pixels, by which a face reaches beyond its sides, so that none falls between two
UPRIGHT = 1e-9  # of its area, as which a face is seen that stands upright: it is not


def faces_seen(corners: np.ndarray, width: int, height: int) -> np.ndarray:
    """The face [height, width] that is nearest to the eye at the middle of each pixel, -1 where there is none.

    `corners` [f, 3, 3] are those of triangles in pixels: columns, rows (downward), and heights, of which the largest is nearest. Of equal
    heights the first face is seen.
    """
    return _faces_seen(np.require(corners, np.float64, ["C", "W"]), width, height)


@njit(nogil=True, cache=True)
def _faces_seen(corners: np.ndarray, width: int, height: int) -> np.ndarray:
    owner, nearest = np.full((height, width), -1), np.full((height, width), -np.inf)
    for f in range(len(corners)):
        a, b, c = corners[f]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        if nz * nz <= UPRIGHT * UPRIGHT * (nx * nx + ny * ny + nz * nz):
            continue
        low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        top, bottom = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        for row in range(max(int(np.ceil(top - 0.5 - SEAM)), 0), min(int(np.floor(bottom - 0.5 + SEAM)), height - 1) + 1):
            left, right = _span(corners[f], min(max(row + 0.5, top), bottom))
            for column in range(max(int(np.ceil(left - 0.5 - SEAM)), 0), min(int(np.floor(right - 0.5 + SEAM)), width - 1) + 1):
                # the plane of a face that stands almost upright leaves its range between two pixels
                at = a[2] - ((column + 0.5 - a[0]) * nx + (row + 0.5 - a[1]) * ny) / nz
                at = min(max(at, low), high)
                if at > nearest[row, column]:
                    owner[row, column], nearest[row, column] = f, at
    return owner


@njit(nogil=True, cache=True)
def _span(corners: np.ndarray, y: float) -> tuple[float, float]:
    """Where a triangle [3, 3] begins and ends at a height of the picture that it reaches."""
    left, right = np.inf, -np.inf
    for k in range(3):
        # a side from its upper end, whichever face it is asked of, so that two faces agree
        a, b = corners[k], corners[(k + 1) % 3]
        if a[1] > b[1]:
            a, b = b, a
        if not a[1] <= y <= b[1]:
            continue
        x = a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) if b[1] > a[1] else a[0]
        other = x if b[1] > a[1] else b[0]
        left, right = min(left, x, other), max(right, x, other)
    return left, right
