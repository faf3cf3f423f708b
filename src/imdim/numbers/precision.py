"""How well a mesh says where its faces are: to the last bits of single precision, or to the digits that its file was written with."""

from __future__ import annotations

import numpy as np

from imdim.numbers.design_values import LAST_BITS

DIGITS = (3, 4, 5, 6)  # after the point, that files are written with, fewest first
SIGNIFICANT = 6  # digits in all, as OpenSCAD and others write: 8.3 may be 8.29999
MOST = 20_000  # coordinates that are looked at
WRITTEN = 0.5  # of the different coordinates that all have so many digits, at most, have fewer: designers mostly type fewer


def precision_of(vertices: np.ndarray) -> float:
    """By how much a coordinate of vertices [n, 3] may be off, in their unit: by what single precision leaves of the largest, or half of the
    last digit - of the largest, where digits are counted from the first - where all have as many and most use them."""
    extent = float(np.abs(vertices).max(initial=0.0))
    bits = LAST_BITS * max(extent, float(np.ptp(vertices, axis=0).max(initial=0.0)))
    coordinates = np.unique(vertices)
    coordinates = coordinates[:: -(-len(coordinates) // MOST)]
    for digits in DIGITS:
        step = 10.0**-digits
        if step < 4 * bits:
            break
        if (_off(coordinates, step) <= bits).all():
            return step / 2 if (_off(coordinates, 10 * step) <= bits).mean() < WRITTEN else bits
    apart = np.abs(coordinates[coordinates != 0.0])
    if not len(apart):
        return bits
    steps = 10.0 ** (np.floor(np.log10(apart) + LAST_BITS) - SIGNIFICANT + 1)
    written, fewer = (_off(apart, factor * steps) <= LAST_BITS * apart for factor in (1.0, 10.0))
    return max(bits, float(steps.max()) / 2) if written.all() and fewer.mean() < WRITTEN else bits


def _off(numbers: np.ndarray, step: float | np.ndarray) -> np.ndarray:
    return np.abs(numbers - np.round(numbers / step) * step)
