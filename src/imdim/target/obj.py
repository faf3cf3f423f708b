"""Wavefront OBJ: its vertices and faces. Groups, materials, texture corners and normals say nothing of a solid and are passed over."""

from __future__ import annotations

import re

import numpy as np

from imdim.target.plain_numbers import read_numbers
from imdim.target.polygons import triangulate_polygons

BESIDE_VERTEX = re.compile(rb"/\S*")  # a corner's texture and normal


def read_obj(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [n, 3] float64 and triangles [m, 3] int64 of all its objects; polygons are cut into triangles.

    Raises ValueError, one line, for numbers that are none, vertices of less than three, and corners that name no vertex.
    """
    if b"\\" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    vertices, faces, before = [], [], []
    for line in data.splitlines():
        key, _, rest = line.lstrip().replace(b"\t", b" ").partition(b" ")
        if key == b"v":
            vertices.append(rest)
        elif key == b"f":
            faces.append(rest)
            before.append(len(vertices))
    points = _read_vertices(vertices)
    corners, sizes = _read_corners(faces)
    if (corners == 0).any():
        raise ValueError(f"{int((corners == 0).sum())} of {len(corners)} corners name vertex 0, but OBJ counts from 1")
    corners = np.where(corners < 0, np.repeat(np.array(before, np.int64), sizes) + corners, corners - 1)
    return points, triangulate_polygons(points, corners, sizes)


def _read_vertices(rows: list[bytes]) -> np.ndarray:
    """The first three numbers of each row; weights and colours may follow."""
    sizes = np.array([len(row.split()) for row in rows], np.int64)
    if (sizes < 3).any():
        raise ValueError(f"{int((sizes < 3).sum())} of {len(rows)} vertices have less than 3 numbers")
    numbers, starts = read_numbers(b" ".join(rows), float), np.cumsum(sizes) - sizes
    if len(numbers) != sizes.sum():
        raise ValueError(f"{len(numbers)} numbers where {sizes.sum()} are written")
    return numbers[starts[:, None] + np.arange(3)] if len(rows) else np.zeros((0, 3))


def _read_corners(rows: list[bytes]) -> tuple[np.ndarray, np.ndarray]:
    """Which vertex each corner [sum of s] names, as written, and how many corners each face has."""
    rows = BESIDE_VERTEX.sub(b"", b"\n".join(rows)).split(b"\n") if rows else []
    sizes = np.array([len(row.split()) for row in rows], np.int64)
    corners = read_numbers(b" ".join(rows), np.int64)
    if len(corners) != sizes.sum():
        raise ValueError(f"{len(corners)} corners where {sizes.sum()} are written")
    return corners, sizes
