"""Triangles made smaller: edges that are too long are halved, in both of their faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Refined(NamedTuple):
    """A finer mesh of the same surface: `vertices` [v, 3], the given ones first, `faces` [f, 3], and the face [f] that each is part of."""

    vertices: np.ndarray
    faces: np.ndarray
    parents: np.ndarray


def split_edges(vertices: np.ndarray, faces: np.ndarray, longest: float, most: int) -> Refined:
    """Edges beyond `longest` halved, longest first, until none is left or there are `most` faces."""
    parents = np.arange(len(faces))
    while True:
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        pairs, which = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True)
        a, b = vertices[pairs // len(vertices)], vertices[pairs % len(vertices)]
        length = np.linalg.norm(a - b, axis=1)
        room = max((most - len(faces)) // 2, 0)  # a halved edge parts two faces
        crowded = np.partition(length, -room - 1)[-room - 1] if room < len(length) else 0.0
        long = length > max(longest, length.max(initial=0.0) / 2, crowded)
        if not long.any():
            return Refined(vertices, faces, parents)
        number = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        vertices = np.concatenate([vertices, (a[long] + b[long]) / 2])
        faces, parts = _split_faces(faces, number[which].reshape(-1, 3))
        parents = parents[parts]


# Corners 0 to 2 are the face's, 3 to 5 the middles of its edges, turned so that halved edges come first.
_PARTS = {
    0: ((0, 1, 2),),
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    3: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}


def _split_faces(faces: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces [f, 3] split at the `middle` [f, 3] of edges 01, 12 and 20, -1 where an edge stays whole; and the face that each is part of."""
    split = middle >= 0
    turn = np.array([0, 0, 1, 0, 2, 2, 1, 0])[split @ [1, 2, 4]]
    order = (turn[:, None] + np.arange(3)) % 3
    six = np.concatenate([np.take_along_axis(faces, order, 1), np.take_along_axis(middle, order, 1)], axis=1)
    count = split.sum(axis=1)
    whole = {n: np.flatnonzero(count == n) for n in _PARTS}
    corners = [six[whole[n]][:, part] for n, parts in _PARTS.items() for part in parts]
    return np.concatenate(corners), np.concatenate([whole[n] for n, parts in _PARTS.items() for _ in parts])
