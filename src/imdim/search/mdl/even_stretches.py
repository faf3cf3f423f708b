"""Stretches along a direction over which a cloud is evenly dense: walls alone.

Between them lie the flat faces across the direction, one or several that noise blurs into one. The best piecewise constant density by a
penalised Poisson likelihood, exactly, over all places where it may change (optimal partitioning, Jackson et al. 2005).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

PRICE = 3.0  # times half the logarithm of the number of points: a change of density has a place and a number
MOST_BINS = 200
OUTERMOST = (0.005, 0.995)  # quantiles of heights, beyond which points may be strays


def find_even_stretches(height: np.ndarray, sigma: float, least: float) -> list[tuple[float, float]]:
    """Low and high ends of the stretches of `height` [n], in their order, that are longer than `least` deviations `sigma` of the noise."""
    low, high = (float(end) for end in np.quantile(height, OUTERMOST))
    bins = min(math.ceil((high - low) / sigma), MOST_BINS)
    if bins < least:
        return []
    counts = np.histogram(height, bins, (low, high))[0]
    ends = low + (high - low) / bins * _split(np.concatenate([[0], np.cumsum(counts)]), PRICE * math.log(len(height)))
    return [(float(a), float(b)) for a, b in pairwise(ends) if b - a > least * sigma]


def _split(sums: np.ndarray, price: float) -> np.ndarray:
    """Where the density changes, with both ends, int [m], by the points below each end of a bin, [b + 1]."""
    count = len(sums) - 1
    cost, before = np.zeros(count + 1), np.zeros(count + 1, int)
    for j in range(1, count + 1):
        points, wide = sums[j] - sums[:j], j - np.arange(j)
        total = cost[:j] - points * np.log(np.maximum(points, 1) / wide) + price
        before[j] = total.argmin()
        cost[j] = total[before[j]]
    ends = [count]
    while ends[-1]:
        ends.append(int(before[ends[-1]]))
    return np.array(ends[::-1])
