"""The edges of a program's solid, each by the two named faces that meet in it."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from imdim.geometry.faces import carrier
from imdim.geometry.lowering import lower
from imdim.geometry.solid import surface_with_owners
from imdim.geometry.surface import Surface, normals, signed_distance
from imdim.program.edges import Face, faces_of
from imdim.program.tree import Program, leaves

if TYPE_CHECKING:
    import trimesh

BLUNT = math.cos(math.radians(20.0))  # cosine between normals of faces that meet under so small an angle that no blend can be told
SHORTEST = 0.02  # of the solid's size, that all stretches of an edge are long together at least


@dataclass(frozen=True, eq=False)
class FacedSolid:
    """The surface of a program, its named faces with their carriers, and for each triangle [f] the number of the face that it is a piece
    of; -1 where its leaf has none."""

    mesh: trimesh.Trimesh
    faces: tuple[Face, ...]
    surfaces: tuple[Surface, ...]
    face_of: np.ndarray

    @staticmethod
    def of(program: Program) -> FacedSolid:
        mesh, owners = surface_with_owners(program)
        middles, ways, lowered = mesh.triangles_center, mesh.face_normals, lower(program)
        faces, surfaces, face_of = list[Face](), list[Surface](), np.full(len(middles), -1)
        for i, leaf in enumerate(leaves(program)):
            own = np.flatnonzero(owners == i)
            least = np.full(len(own), np.inf)
            for face in (Face(i, name) for name in faces_of(leaf)) if len(own) else ():
                if (surface := carrier(face, leaf, lowered)) is None:
                    continue
                turned = 1 - np.abs((normals(surface, middles[own]) * ways[own]).sum(1))
                off = np.abs(signed_distance(surface, middles[own])) + turned * float(np.ptp(middles))
                face_of[own[off < least]] = len(faces)
                least = np.minimum(least, off)
                faces.append(face)
                surfaces.append(surface)
        return FacedSolid(mesh, tuple(faces), tuple(surfaces), face_of)

    def edges(self) -> list[tuple[Face, Face]]:
        """The pairs of faces that meet in edges, longest first; those that touch, and short ones, are left out."""
        pairs = np.asarray(self.mesh.face_adjacency).reshape(-1, 2)
        between = np.sort(self.face_of[pairs], axis=1)
        parted = np.flatnonzero((between[:, 0] != between[:, 1]) & (between[:, 0] >= 0))
        ends = self.mesh.vertices[self.mesh.face_adjacency_edges[parted]]
        spans = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        lengths: dict[tuple[int, int], float] = defaultdict(float)
        for (a, b), at, span in zip(between[parted].tolist(), ends.mean(axis=1), spans, strict=True):
            one, two = (normals(self.surfaces[i], at[None])[0] for i in (a, b))
            if abs(one @ two) < BLUNT:
                lengths[a, b] += float(span)
        least = SHORTEST * float(np.linalg.norm(self.mesh.extents))
        order = sorted((pair for pair, length in lengths.items() if length > least), key=lambda pair: -lengths[pair])
        return [(self.faces[a], self.faces[b]) for a, b in order]
