"""What a solid is by kind and by size: how many bodies, holes through them and voids inside, how large it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.components import components
from imdim.geometry.solid import to_trimesh

CRUMB = 1e-7  # of the volume: a smaller piece is what booleans leave of faces that touch


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
    count, of_corner = label_surfaces(mesh)
    of_face = of_corner[mesh.faces[:, 0]]
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    volumes = np.bincount(of_face, np.einsum("ij,ij->i", a - a[:1], np.cross(b - a, c - a)) / 6, minlength=count)
    corners, faces = np.bincount(of_corner, minlength=count), np.bincount(of_face, minlength=count)
    genus = 1 - (corners - faces // 2) // 2  # Euler's formula, with three halves of a side for each face
    counted = np.abs(volumes) > least * volume
    voids = int((volumes[counted] < 0).sum())
    size = (box[3] - box[0], box[4] - box[1], box[5] - box[2])
    return SolidCensus(int(counted.sum()) - voids, int(genus[counted].sum()), voids, size, volume)


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
