"""What a solid is by kind and by size: how many bodies, holes through them and voids inside, how large it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.components import components
from imdim.geometry.solid import CRUMB, solid_of, to_trimesh


@dataclass(frozen=True)
class SolidCensus:
    """`bodies` that hang together, holes that go `through` them (the sum of the genus of their surfaces), `voids` closed in by them; the
    `size` of the box along x, y, z, and the `volume`."""

    bodies: int
    through: int
    voids: int
    size: tuple[float, float, float]
    volume: float

    @property
    def kind(self) -> tuple[int, int, int]:
        """What stays the same while only sizes change."""
        return self.bodies, self.through, self.voids


def census_of(solid: Manifold, least: float = CRUMB) -> SolidCensus:
    """Count the closed surfaces of a solid that hold more than a `least` share of its volume; one that encloses a negative volume bounds
    a void."""
    volume, box, mesh = solid.volume(), solid.bounding_box(), to_trimesh(solid)
    of_corner, of_face, volumes = _measure_surfaces(mesh)
    corners, faces = (np.bincount(label, minlength=len(volumes)) for label in (of_corner, of_face))
    genus = 1 - (corners - faces // 2) // 2  # Euler's formula, with three halves of a side for each face
    counted = np.abs(volumes) > least * volume
    voids = int((volumes[counted] < 0).sum())
    size = (box[3] - box[0], box[4] - box[1], box[5] - box[2])
    return SolidCensus(int(counted.sum()) - voids, int(genus[counted].sum()), voids, size, volume)


def find_pieces(solid: Manifold, least: float) -> list[Manifold]:
    """The closed surfaces of a solid that enclose more than a `least` volume, either way, as solids; one of a negative volume bounds a
    void."""
    mesh = to_trimesh(solid)
    _, of_face, volumes = _measure_surfaces(mesh)
    if len(volumes) < 2:
        return [solid] * int((np.abs(volumes) > least).sum())
    corners, ends = np.asarray(mesh.vertices), np.cumsum(np.bincount(of_face, minlength=len(volumes)))
    own = np.split(np.asarray(mesh.faces)[np.argsort(of_face, kind="stable")], ends[:-1])
    used = [np.unique(faces, return_inverse=True) for faces, volume in zip(own, volumes, strict=True) if abs(volume) > least]
    return [solid_of(corners[places], sides.reshape(-1, 3)) for places, sides in used]


def _measure_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The surface of each corner [v] and of each face [f] of a mesh, and the volume that each surface encloses [n]."""
    count, of_corner = label_surfaces(mesh)
    of_face = of_corner[mesh.faces[:, 0]]
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return of_corner, of_face, np.bincount(of_face, np.einsum("ij,ij->i", a - a[:1], np.cross(b - a, c - a)) / 6, minlength=count)


def label_surfaces(mesh: trimesh.Trimesh) -> tuple[int, np.ndarray]:
    """How many surfaces hang together in a mesh whose equal corners are one, and the surface of each corner [v], numbered as they come:
    for thousands of them at once, of which manifold3d makes a solid each, in the square of the time."""
    start, end = mesh.faces[:, (0, 1)].T
    return components(np.concatenate([start, end]), np.concatenate([end, mesh.faces[:, 2]]), len(mesh.vertices))


def split_surfaces(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """A mesh for each of the surfaces of a mesh."""
    count, of_corner = label_surfaces(mesh)
    if count < 2:
        return [mesh]
    of_face = of_corner[mesh.faces[:, 0]]
    order, corner_order = np.argsort(of_face, kind="stable"), np.argsort(of_corner, kind="stable")
    ends, corner_ends = (np.cumsum(np.bincount(label, minlength=count)) for label in (of_face, of_corner))
    place = np.empty(len(of_corner), np.int64)
    place[corner_order] = np.arange(len(of_corner)) - np.repeat(corner_ends - np.bincount(of_corner), np.bincount(of_corner))
    faces, corners = np.split(place[mesh.faces[order]], ends[:-1]), np.split(mesh.vertices[corner_order], corner_ends[:-1])
    return [trimesh.Trimesh(own, sides, process=False) for own, sides in zip(corners, faces, strict=True)]
