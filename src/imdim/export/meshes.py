"""Mesh files of an exact solid - binary STL, GLB, 3MF - the same bytes for the same solid."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.metrics import diagonal
from imdim.geometry.solid import to_trimesh

# STL and GLB hold single precision: what collapses there is removed before, while the solid stays closed
SINGLE_PRECISION = 1e-6


def write_meshes(solid: Manifold, folder: Path) -> None:
    """Write `mesh.stl`, `mesh.glb` and `mesh.3mf` into an existing folder; raises ValueError for an empty solid, OSError as usual."""
    mesh = to_trimesh(solid)
    if not len(mesh.faces):
        raise ValueError("an empty solid has no mesh to write")
    clean = to_trimesh(solid.simplify(SINGLE_PRECISION * diagonal(mesh.vertices)))
    for suffix, data in _DATA.items():
        (folder / f"mesh.{suffix}").write_bytes(data(clean))


def stl_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Binary STL."""
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    records = np.zeros(len(corners), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]))
    records["normal"], records["corners"] = mesh.face_normals, corners
    return b"IMDIM".ljust(80, b" ") + np.uint32(len(corners)).tobytes() + records.tobytes()


def glb_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Binary glTF, z up as in the program."""
    # unmerged corners, so that viewers shade faces flat
    corners = np.asarray(mesh.vertices)[mesh.faces].reshape(-1, 3)
    flat = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    data = trimesh.Scene({"part": flat}).export(file_type="glb")
    return bytes(data)  # type: ignore[arg-type]


def threemf_bytes(mesh: trimesh.Trimesh) -> bytes:
    """3MF core package with one object, lengths as mm."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in (("[Content_Types].xml", _TYPES), ("_rels/.rels", _RELATIONS), ("3D/3dmodel.model", _model(mesh))):
            # a fixed date, for the same bytes every time
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            package.writestr(entry, text)
    return buffer.getvalue()


_DATA: Mapping[str, Callable[[trimesh.Trimesh], bytes]] = {"stl": stl_bytes, "glb": glb_bytes, "3mf": threemf_bytes}

_XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
_TYPES = f"""{_XML}<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""
_RELATIONS = f"""{_XML}<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""


def _model(mesh: trimesh.Trimesh) -> str:
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>\n' for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in mesh.faces.tolist())
    return f"""{_XML}<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh>
<vertices>
{vertices}</vertices>
<triangles>
{triangles}</triangles>
</mesh></object></resources>
<build><item objectid="1"/></build>
</model>
"""
