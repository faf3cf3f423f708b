"""Balls and lying cylinders of which a face shows only the upper part, such as domes and half-round bars on a thin plate.

A search that changes one primitive at a time does not get there: the whole ball comes out below the plate, and a cut that takes that off
has nothing to take off before the ball is there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import Combine, Primitive, Program
from imdim.search.mdl.candidates.residual import LEAST, place

LOWEST = 0.01  # quantile of the heights of its points, from which a round part is taken to begin
DEEPEST = -0.75  # radii from the middle to where it begins: below that most of it shows
HIGHEST = 0.8  # radii, above which too little of it shows
LYING = 0.1  # cosine of the angle between the axis of a lying cylinder and the way that it is seen from
INTO = 1.0  # deviations of the noise by which it goes into what it stands on
BEYOND = 4.0  # deviations of the noise by which a cut leaves it


def half_rounds(part: Primitive, points: np.ndarray, axes: np.ndarray, sigma: float) -> Iterator[Program]:
    """The sphere or cylinder without what lies below its own `points` [n, 3], seen along each of the `axes` [3, 3] (columns) from either
    side; none where it shows nearly whole. `sigma` is the deviation of the points' noise."""
    if part.kind not in ("sphere", "cylinder") or len(points) < LEAST:
        return
    radius, center = part.size[0], np.array(part.center)
    along = matrix_from_euler(part.rotation)[:, 2]
    local = (points - center) @ axes
    for k in range(3):
        if part.kind == "cylinder" and abs(float(along @ axes[:, k])) > LYING:
            continue
        for sign in (1, -1):
            low = float(np.quantile(sign * local[:, k], LOWEST))
            if DEEPEST * radius < low < HIGHEST * radius:
                yield Combine("difference", part, _below(part, k, sign, low - INTO * sigma, axes, BEYOND * sigma))


def _below(part: Primitive, k: int, sign: int, level: float, axes: np.ndarray, beyond: float) -> Primitive:
    """The box about all of the part that lies below a level of its own, along axis k, and that goes `beyond` it."""
    radius = part.size[0]
    long = part.size[1] / 2 * np.abs(axes.T @ matrix_from_euler(part.rotation)[:, 2]) if part.kind == "cylinder" else np.zeros(3)
    half = radius + long + beyond
    half[k] = (level + radius + beyond) / 2
    middle = np.zeros(3)
    middle[k] = sign * (level - half[k])
    return place("box", 2 * half, axes.T @ np.array(part.center) + middle, axes)
