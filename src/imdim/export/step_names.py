"""Names and colours in STEP files: the product is called as the part, and each face as the feature that made it.

A face is of the feature on whose surface a point of it lies. Faces that cutters made are red, as in the report's page; those of no feature
are blends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from imdim.export.part_names import Colour, PartNames
from imdim.export.step_booleans import ocp
from imdim.geometry.off_surface import measure_distances
from imdim.program.tree import Program, leaves, longest

ON = 1e-5  # of the part's largest size, within which a point lies on a feature
COARSE = 0.05  # of the part's largest size, by which triangles may miss a face: they only say where a point of it is


def write_named(shape: Any, path: Path, program: Program, names: PartNames) -> bool:
    """Write the shape of a program, whose solids are one product; whether that could be done."""
    text = ocp("TCollection").TCollection_ExtendedString
    document = ocp("TDocStd").TDocStd_Document(text("BinXCAF"))
    _fill(document, shape, program, names)
    writer, settings = ocp("STEPCAFControl").STEPCAFControl_Writer(), ocp("Interface").Interface_Static
    settings.SetCVal_s("write.step.unit", "MM")
    settings.SetIVal_s("write.step.assembly", 0)
    settings.SetIVal_s("write.stepcaf.subshapes.name", 1)
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    return writer.Transfer(document, ocp("STEPControl").STEPControl_AsIs) and writer.Write(str(path)).name.endswith("RetDone")


def _fill(document: Any, shape: Any, program: Program, names: PartNames) -> None:
    tools, text = ocp("XCAFDoc"), ocp("TCollection").TCollection_ExtendedString
    shapes, colours = (getattr(tools.XCAFDoc_DocumentTool, f"{what}Tool_s")(document.Main()) for what in ("Shape", "Color"))
    rename, quantity = ocp("TDataStd").TDataStd_Name.Set_s, ocp("Quantity")
    root = shapes.AddShape(shape, False)
    rename(root, text(names.part))
    for face, name, colour in name_faces(shape, program, names):
        label = shapes.AddSubShape(root, face)
        rename(label, text(name))
        colours.SetColor(label, quantity.Quantity_Color(*colour, quantity.Quantity_TOC_sRGB), tools.XCAFDoc_ColorSurf)


def name_faces(shape: Any, program: Program, names: PartNames) -> Iterator[tuple[Any, str, Colour]]:
    """Each face of a shape with the name of its feature and its colour; the first of several features that lie in it."""
    faces, points = _faces_and_points(shape, longest(leaves(program)))
    if not faces:
        return
    off = np.stack([measure_distances(leaf, points) for leaf in leaves(program)])
    near: np.ndarray = off <= ON * longest(leaves(program))
    owners = np.where(np.any(near, axis=0), np.argmax(near, axis=0), len(off))
    for face, owner in zip(faces, owners.tolist(), strict=True):
        yield face, *names.feature(owner)


def _faces_and_points(shape: Any, size: float) -> tuple[list[Any], np.ndarray]:
    """The faces of a shape, and a point [3] of each well inside it."""
    topology, explorer = ocp("TopoDS").TopoDS, ocp("TopExp").TopExp_Explorer(shape, ocp("TopAbs").TopAbs_FACE)
    ocp("BRepMesh").BRepMesh_IncrementalMesh(shape, COARSE * size, False, math.radians(30.0), False)
    faces, points = [], []
    while explorer.More():
        face = topology.Face(explorer.Current())
        point = _point_of(face)
        if point is not None:
            faces.append(face)
            points.append(point)
        explorer.Next()
    ocp("BRepTools").BRepTools.Clean_s(shape)  # what is written has no triangles
    return faces, np.array(points).reshape(-1, 3)


def _point_of(face: Any) -> tuple[float, float, float] | None:
    """The point of a face at the middle, in its parameters, of the largest of its triangles; None for a face without any."""
    mesh = ocp("BRep").BRep_Tool.Triangulation_s(face, ocp("TopLoc").TopLoc_Location())
    if mesh is None or not mesh.NbTriangles() or not mesh.HasUVNodes():
        return None
    corners = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    nodes = np.array([mesh.Node(i).Coord() for i in range(1, mesh.NbNodes() + 1)])
    parameters = np.array([mesh.UVNode(i).Coord() for i in range(1, mesh.NbNodes() + 1)])
    a, b, c = (nodes[corners[:, k]] for k in range(3))
    largest = int(np.linalg.norm(np.cross(b - a, c - a), axis=1).argmax())
    u, v = parameters[corners[largest]].mean(axis=0).tolist()
    return ocp("BRepAdaptor").BRepAdaptor_Surface(face).Value(u, v).Coord()
