"""What stands along the edge of a flat face and leaves its middle free, as of a tray or a cup: the part made as high, and cut to the face.

A search that changes one primitive at a time does not get there: made higher the part hides the points of its face, and a cut that only
meets the face takes nothing away.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import FLAT_ENDS, Combine, Primitive, Program
from imdim.search.mdl.candidates.residual import LEAST, resize

ABOVE = 3.0  # deviations of the noise, from which a point is no longer the face's
TOP = 0.8  # quantile of the heights above the face: the top of a rim has more points than its walls
INNER = 0.1  # quantile of the distances from the middle
MIDDLE = 0.7  # of a side: nearer its ends stand the walls of others
OUT = 4.0  # deviations of the noise by which a cut leaves the part


def rims(part: Primitive, points: np.ndarray, sigma: float) -> Iterator[Program]:
    """The box or cylinder with a rim at each flat end above which there are `points` [n, 3]; `sigma` is the deviation of their noise."""
    if part.kind not in ("box", "cylinder"):
        return
    rotation = matrix_from_euler(part.rotation)
    local = (points - part.center) @ rotation
    half = np.array(part.size if part.kind == "box" else (2 * part.size[0], 2 * part.size[0], part.size[1])) / 2
    for k, slot in FLAT_ENDS[part.kind].items():
        across = [j for j in range(3) if j != k]
        over = (np.abs(local[:, across]) < half[across] + ABOVE * sigma).all(1)
        for sign in (-1, 1):
            height = sign * local[:, k] - half[k]
            above = over & (height > ABOVE * sigma)
            if above.sum() < LEAST:
                continue
            free = _free(part.kind, local[above][:, across], half[across], sigma)
            if free is None:
                continue
            high = float(np.quantile(height[above], TOP))
            size, middle = np.array(part.size, float), np.zeros(3)
            size[slot], middle[k] = size[slot] + high, sign * high / 2
            taller = resize(part, size, part.center + rotation @ middle)
            width, middle[across] = free
            size[[s for s in range(len(size)) if s != slot]] = width
            size[slot] = high + OUT * sigma
            middle[k] = sign * (half[k] + size[slot] / 2)
            yield Combine("difference", taller, resize(part, size, part.center + rotation @ middle))


def _free(kind: str, points: np.ndarray, half: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray] | None:
    """How wide [2] or in which radius [1] the middle of a face is free of `points` [m, 2] above it, and the middle of that [2]."""
    if kind == "cylinder":
        radius = np.quantile(np.hypot(*points.T), INNER)
        return (np.array([radius]), np.zeros(2)) if radius > ABOVE * sigma else None
    share = np.abs(points / half)
    out = half + OUT * sigma  # a side without points is open
    ends = np.outer([-1.0, 1.0], out)
    for j in range(2):
        for end, sign in enumerate((-1, 1)):
            here = sign * points[(share[:, 1 - j] < MIDDLE) & (share[:, j] > share[:, 1 - j]) & (sign * points[:, j] > 0), j]
            if len(here) >= LEAST:
                ends[end, j] = sign * np.quantile(here, INNER)
    width = ends[1] - ends[0]
    return (width, ends.mean(0)) if width.min() > 2 * ABOVE * sigma and (width < 2 * out).any() else None
