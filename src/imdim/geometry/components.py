"""Pieces that links make of what they join: facets of one body, points of one surface, cells of one region."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def components(rows: np.ndarray, columns: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """How many pieces the links between `rows` and `columns` make of `count` nodes, and the piece of each, numbered as they come."""
    return connected_components(coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(count, count)), directed=False)
