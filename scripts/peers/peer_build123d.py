"""build123d's `detect_primitives`: planes, cylinders and spheres of a mesh, as faces for a person to build from. It makes no solid.

What is added here, in its favour: OpenCASCADE's volume maker closes cells between the faces, and those that lie in the part are its solid.
Rectangles stand for planes whatever their outline, and faces that do not quite meet close nothing: then there is no solid.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import build123d
import numpy as np
import trimesh
from build123d.topology import Shape
from manifold3d import Manifold, OpType
from OCP.BOPAlgo import BOPAlgo_MakerVolume  # pyright: ignore[reportAttributeAccessIssue] - its stubs lack it

from imdim.geometry.solid import mesh_to_manifold, to_trimesh

MEETING = 1e-4  # of the diagonal: gaps between faces that count as none
DEFLECTION = 1e-3  # of the diagonal: how far a cell's facets may be from its surface
MOST_OUTSIDE = 0.5  # of a cell's volume


def solve(mesh: trimesh.Trimesh, _: int) -> tuple[trimesh.Trimesh, int, str]:
    """The solid, and the number of faces detected. Raises ValueError where these enclose nothing of the part."""
    faces, leftovers, _code = build123d.detect_primitives(_shape(mesh))
    claimed = f"{len(faces)} faces detected, {1 - len(leftovers) / len(mesh.faces):.0%} of the triangles explained"
    if not faces:
        raise ValueError(f"no solid: {claimed}")
    part = mesh_to_manifold(mesh)
    size = float(np.linalg.norm(mesh.extents))
    cells = [cell for cell in _cells(faces, size) if (cell ^ part).volume() > (1 - MOST_OUTSIDE) * cell.volume()]
    if not cells:
        raise ValueError(f"no solid: {claimed}, they enclose nothing of the part")
    return to_trimesh(Manifold.batch_boolean(cells, OpType.Add)), len(faces), claimed


def _shape(mesh: trimesh.Trimesh) -> Shape:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.stl"
        mesh.export(path)
        shapes = build123d.Mesher().read(path)
    return shapes[0] if len(shapes) == 1 else build123d.Compound(shapes)


def _cells(faces: build123d.ShapeList, size: float) -> list[Manifold]:
    """What the faces enclose."""
    maker = BOPAlgo_MakerVolume()
    for face in faces:
        maker.AddArgument(face.wrapped)
    maker.SetIntersect(True)
    maker.SetAvoidInternalShapes(True)
    maker.SetFuzzyValue(MEETING * size)
    maker.Perform()
    if maker.HasErrors():
        raise ValueError(f"no solid: {len(faces)} faces detected, the volume maker fails on them")
    return [_meshed(solid, size) for solid in build123d.Compound(maker.Shape()).solids()]


def _meshed(solid: build123d.Solid, size: float) -> Manifold:
    vertices, triangles = solid.tessellate(DEFLECTION * size, 0.1)
    mesh = trimesh.Trimesh([tuple(v) for v in vertices], triangles)
    mesh.merge_vertices(digits_vertex=int(-np.log10(MEETING * size)))  # faces meet no closer than that
    try:
        return mesh_to_manifold(mesh)
    except ValueError:  # a crevice between faces, of no volume or not closed
        return Manifold()
