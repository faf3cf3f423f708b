"""The bodies of a triangle mesh: pieces joined by edges, their signed volumes, and which lies inside which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.geometry.components import components
from imdim.geometry.sampling import subsample
from imdim.geometry.winding import winding_number

PROBES = 7  # vertices of a body that must all lie inside another for it to be nested
SCRAPS = 0.01  # of the surface, that loose open pieces beside closed ones have at most
THIN = 1e-9  # volume relative to the area to the power of 1.5, up to which a body is a scrap of a surface walked both ways


@dataclass(frozen=True, eq=False)
class Bodies:
    """`label` [m] is each face's body; per body: signed `volume`, `depth` (how many others hold it), the outermost holder `root`
    and the innermost holder `parent` (both itself at depth 0)."""

    label: np.ndarray
    volume: np.ndarray
    depth: np.ndarray
    root: np.ndarray
    parent: np.ndarray

    @property
    def count(self) -> int:
        return len(self.volume)


def edge_table(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Per face side [3 m] (side i belongs to face i mod m): lower vertex, higher vertex, walked from low to high, undirected edge label."""
    start, end = faces.T.reshape(-1), np.roll(faces, -1, axis=1).T.reshape(-1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    label = np.unique(low * (int(faces.max()) + 1) + high, return_inverse=True)[1]
    return low, high, start < end, label


def mesh_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The signed volume by the divergence theorem, positive when the faces are seen counter-clockwise from outside.

    An open mesh is closed towards the mean of its corners.
    """
    return float(_face_volumes(vertices, faces, np.zeros(len(faces), np.int64)).sum())


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals [m, 3] (zero for a face without area) and areas [m], at any scale of coordinates."""
    a, b, c = (np.asarray(vertices, float)[faces[:, i]] for i in range(3))
    unit = np.abs(np.stack([b - a, c - a])).max(initial=0.0) or 1.0
    cross = np.cross((b - a) / unit, (c - a) / unit)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2 * unit * unit


def compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mesh without the vertices that none of its faces has."""
    used, corners = np.unique(faces, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3).astype(np.int64)


def count_bodies(faces: np.ndarray) -> int:
    """How many pieces are joined by edges."""
    return int(_pieces(faces).max(initial=-1)) + 1


def find_bodies(vertices: np.ndarray, faces: np.ndarray) -> Bodies:
    """The bodies of a mesh whose equal vertices are merged, numbered by falling absolute volume."""
    label = _pieces(faces)
    volume = np.bincount(label, _face_volumes(vertices, faces, label))
    order = np.argsort(-np.abs(volume), kind="stable")
    label, volume = np.argsort(order)[label], volume[order]
    holders = _holders(vertices, faces, label, len(volume))
    depth = np.array([len(h) for h in holders])
    own = range(len(volume))
    root = np.array([next((j for j in h if depth[j] == 0), i) for i, h in zip(own, holders, strict=True)])
    parent = np.array([max(h, key=lambda j: depth[j], default=i) for i, h in zip(own, holders, strict=True)])
    return Bodies(label, volume, depth, root, parent)


def leave_out_flat(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, int]:
    """The faces of those bodies of a closed mesh that hold something, and how many others there were; all where none does."""
    label = _pieces(faces)
    volume, area = (np.bincount(label, v) for v in (_face_volumes(vertices, faces, label), face_normals(vertices, faces)[1]))
    holds = np.abs(volume) > THIN * area**1.5
    return (faces[holds[label]], int((~holds).sum())) if holds.any() else (faces, 0)


def leave_out_scraps(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, int]:
    """The faces without loose pieces that are open, and how many those have; all of them, unless the rest is closed and such pieces have
    next to nothing of the surface."""
    label, piece = edge_table(faces)[3], _pieces(faces)
    at_rim = np.bincount(label)[label] % 2 == 1
    is_open = np.zeros(piece.max() + 1, bool)
    is_open[np.tile(piece, 3)[at_rim]] = True
    loose, area = is_open[piece], face_normals(vertices, faces)[1]
    if loose.all() or area[loose].sum() > SCRAPS * area.sum():
        return faces, 0
    return faces[~loose], int(loose.sum())


def split_faces(vertices: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """Face indices [k] per solid body, largest first: a body of negative volume is a cavity and stays with the body around it."""
    bodies = find_bodies(vertices, faces)
    group = np.where(bodies.volume < 0, bodies.parent, np.arange(bodies.count))
    owner = group[bodies.label]
    return [np.flatnonzero(owner == g) for g in np.unique(group)]


def _pieces(faces: np.ndarray) -> np.ndarray:
    count = len(faces)
    label = edge_table(faces)[3]
    order = np.argsort(label, kind="stable")
    together = label[order[1:]] == label[order[:-1]]
    one, two = order[1:][together] % count, order[:-1][together] % count
    return components(one, two, count)[1]


def _face_volumes(vertices: np.ndarray, faces: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Signed tetrahedra [m] from each face to the mean corner of its body."""
    corners = np.asarray(vertices, float)[faces]
    weight = np.bincount(label)
    middle = np.stack([np.bincount(label, corners[:, :, i].mean(axis=1)) / weight for i in range(3)], axis=1)[label]
    a, b, c = (corners[:, i] - middle for i in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6


def _holders(vertices: np.ndarray, faces: np.ndarray, label: np.ndarray, count: int) -> list[list[int]]:
    """Per body, the larger bodies that hold it."""
    if count == 1:
        return [[]]
    order = np.argsort(label, kind="stable")
    members = np.split(order, np.searchsorted(label[order], np.arange(1, count)))
    triangles = [vertices[faces[m]] for m in members]
    low = np.array([t.min(axis=(0, 1)) for t in triangles])
    high = np.array([t.max(axis=(0, 1)) for t in triangles])
    holders = []
    for i, own in enumerate(triangles):
        probes = subsample(own.reshape(-1, 3), PROBES)
        around = np.flatnonzero(((low[:i] < low[i]) & (high[:i] > high[i])).all(axis=1))
        holders.append([int(j) for j in around if (np.abs(winding_number(triangles[j], probes)) > 0.5).all()])
    return holders
