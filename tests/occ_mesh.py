"""Programs as OpenCASCADE tessellates them, which FreeCAD, CadQuery and build123d export: round faces in rings of triangles, some of them
between corners that no other ring has."""

from __future__ import annotations

from pathlib import Path

import trimesh

from imdim.export.step import to_shape
from imdim.export.step_booleans import ocp
from imdim.program.tree import Program


def occ_mesh(program: Program, folder: Path, off: float = 0.01, turn: float = 0.15) -> trimesh.Trimesh:
    """The mesh of a program's STEP shape, at most `off` it and turning by at most `turn` radians from one facet to the next, by an STL file
    in `folder`."""
    shape, path = to_shape(program), folder / "occ.stl"
    ocp("BRepMesh").BRepMesh_IncrementalMesh(shape, off, False, turn, False)
    ocp("StlAPI").StlAPI_Writer().Write(shape, str(path))
    mesh = trimesh.load_mesh(path)
    mesh.merge_vertices()
    return mesh
