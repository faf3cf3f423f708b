"""Geomview's OFF: rows of vertices, rows of polygons; colours and normals behind the numbers are passed over."""

from __future__ import annotations

import re

import numpy as np

from imdim.target.plain_numbers import read_numbers
from imdim.target.polygons import triangulate_polygons

COMMENT = re.compile(rb"#[^\n]*")
HEADERS = (b"OFF", b"COFF", b"NOFF", b"CNOFF", b"STOFF")


def read_off(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [n, 3] float64 and triangles [m, 3] int64; polygons are cut into triangles.

    Raises ValueError, one line, for another header and for less rows than it promises.
    """
    header, _, rest = COMMENT.sub(b"", data).lstrip().partition(b"OFF")
    if header + b"OFF" not in HEADERS:
        raise ValueError("it does not begin with OFF")
    rows = [row for row in (line.strip() for line in rest.splitlines()) if row]
    counts = [int(word) for word in (rows[0] if rows else b"").split()[:2]]
    if len(counts) < 2 or min(counts) < 0:
        raise ValueError("the row that counts vertices and faces is missing")
    points, faces = rows[1 : 1 + counts[0]], rows[1 + counts[0] : 1 + sum(counts)]
    if len(points) + len(faces) < sum(counts):
        raise ValueError(f"{len(rows) - 1} rows where the header promises {sum(counts)}")
    vertices = read_numbers(b" ".join(b" ".join(row.split()[:3]) for row in points), float)
    sizes = np.array([int(row.split(maxsplit=1)[0]) for row in faces], np.int64)
    corners = read_numbers(
        b" ".join(b" ".join(row.split()[1 : 1 + max(size, 0)]) for row, size in zip(faces, sizes, strict=True)), np.int64
    )
    if len(vertices) != 3 * counts[0] or len(corners) != sizes.sum() or (sizes < 0).any():
        raise ValueError(f"{len(vertices)} coordinates and {len(corners)} corners, {3 * counts[0]} and {sizes.sum()} are needed")
    return vertices.reshape(-1, 3), triangulate_polygons(vertices.reshape(-1, 3), corners, sizes)
