"""The ellipse through points of a plane."""

from __future__ import annotations

import numpy as np


def fit_conic(section: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Centre [2], axes as columns [2, 2] and semi-axes [2] of the ellipse whose equation leaves the least squares over points [n, 2].

    None where the best conic is no ellipse. Solved in coordinates of unit spread about the mean, since squares of far ones drown the rest.
    """
    middle = section.mean(0)
    size = float(np.sqrt(((section - middle) ** 2).sum(1).mean())) or 1.0
    x, y = ((section - middle) / size).T
    rows = np.column_stack([x * x, 2 * x * y, y * y, 2 * x, 2 * y, np.ones_like(x)])
    a, b, c, d, e, f = np.linalg.svd(rows, full_matrices=False)[2][-1]
    square = np.array([[a, b], [b, c]])
    values, axes = np.linalg.eigh(square)
    if abs(values).min() <= 1e-9 * abs(values).max() or values[0] * values[1] < 0:
        return None
    center = -np.linalg.solve(square, [d, e])
    level = float(center @ square @ center - f)
    return None if level * values[0] <= 0 else (center * size + middle, axes, size * np.sqrt(level / values))
