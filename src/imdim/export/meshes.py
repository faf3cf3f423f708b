"""Mesh files of an exact solid - binary STL, GLB, 3MF - the same bytes for the same solid.

A GLB has a node for each feature of the program, called and coloured as it, with flat normals; a 3MF an object for each body.
"""

from __future__ import annotations

import io
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold
from scipy.spatial import KDTree
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from imdim.export.part_names import ADDED, NAMELESS, Colour, PartNames
from imdim.geometry.census import split_surfaces
from imdim.geometry.edge_solids import with_edges
from imdim.geometry.kernels import program_sdf
from imdim.geometry.metrics import diagonal
from imdim.geometry.solid import to_trimesh, without_slivers
from imdim.program.edges import EdgeFeature
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import Primitive, Program, leaves
from imdim.program.units import UNSPECIFIED

# STL and GLB hold single precision: what collapses there is removed before, while the solid stays closed
SINGLE_PRECISION = 1e-6
BESIDE = 1e-2  # of the diagonal: no middle of a face lies so far from the feature that made it
SAME = 1e-7  # of the diagonal, by which surfaces that coincide may differ


class NamedFeatures(NamedTuple):
    """The program of a solid, its edge features, and what files call it and its parts."""

    program: Program
    edges: tuple[EdgeFeature, ...]
    names: PartNames

    @staticmethod
    def of(name: str, program: Program, edges: Sequence[EdgeFeature] = (), labels: Sequence[str] = ()) -> NamedFeatures:
        """Features are called by their `labels`, by default by their roles."""
        return NamedFeatures(program, tuple(edges), PartNames.of(program, name, tuple(labels) or None))


def write_meshes(solid: Manifold, folder: Path, named: NamedFeatures | None = None, units: str = UNSPECIFIED) -> None:
    """Write `mesh.stl`, `mesh.glb` and `mesh.3mf`, which alone says the `units`, into an existing folder; raises ValueError for an empty
    solid, OSError as usual."""
    mesh = to_trimesh(solid)
    if not len(mesh.faces):
        raise ValueError("an empty solid has no mesh to write")
    clean = without_slivers(solid, SINGLE_PRECISION * diagonal(mesh.vertices))
    mesh, name = to_trimesh(clean), NAMELESS if named is None else named.names.part
    data = {"stl": stl_bytes(mesh), "glb": glb_bytes(mesh, named), "3mf": threemf_bytes(split_surfaces(mesh), name, units)}
    for suffix, content in data.items():
        (folder / f"mesh.{suffix}").write_bytes(content)


def stl_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Binary STL."""
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    records = np.zeros(len(corners), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]))
    records["normal"], records["corners"] = mesh.face_normals, corners
    return b"IMDIM".ljust(80, b" ") + np.uint32(len(corners)).tobytes() + records.tobytes()


def glb_bytes(mesh: trimesh.Trimesh, named: NamedFeatures | None = None) -> bytes:
    """Binary glTF, z up as in the program; one node for each feature that made faces of the mesh."""
    scene, corners = trimesh.Scene(), np.asarray(mesh.vertices)[mesh.faces]
    for name, colour, faces in _pieces(mesh, named):
        # unmerged corners, so that viewers shade faces flat
        flat = trimesh.Trimesh(
            corners[faces].reshape(-1, 3),
            np.arange(3 * len(faces)).reshape(-1, 3),
            vertex_normals=np.repeat(np.asarray(mesh.face_normals)[faces], 3, axis=0),
            visual=TextureVisuals(material=PBRMaterial(name=name, baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=0.7)),
            process=False,
        )
        scene.add_geometry(flat, node_name=name, geom_name=name)
    return bytes(scene.export(file_type="glb", include_normals=True))  # type: ignore[arg-type]


def _pieces(mesh: trimesh.Trimesh, named: NamedFeatures | None) -> Iterator[tuple[str, Colour, np.ndarray]]:
    """For each feature its name, which no other has, its colour, and its faces of the mesh."""
    if named is None:
        yield NAMELESS, ADDED, np.arange(len(mesh.faces))
        return
    owners, used = assign_faces(mesh, named.program, named.edges), Counter[str]()
    for owner in np.unique(owners).tolist():
        name, colour = named.names.feature(owner)
        used[name] += 1
        yield name if used[name] == 1 else f"{name} ({used[name]})", colour, np.flatnonzero(owners == owner)


def assign_faces(mesh: trimesh.Trimesh, program: Program, edges: Sequence[EdgeFeature]) -> np.ndarray:
    """The leaf that made each face [f] of a solid, the first that its middle lies nearest to; of blends it is the number of leaves."""
    parts, middles, size = list(leaves(with_edges(program, edges))), np.asarray(mesh.triangles_center), diagonal(mesh.vertices)
    tree, first = KDTree(middles), np.full(len(middles), len(parts))

    def give(faces: np.ndarray, beside: Callable[[Primitive], np.ndarray]) -> np.ndarray:
        """The least distances of `faces`, with their owners set, of those features alone that each is `beside`, as numbers among them."""
        least = np.full(len(faces), np.inf)
        # twice, rather than to keep them all: thousands of features have as many distances from ten times as many faces
        for part in parts:
            near = beside(part)
            least[near] = np.minimum(least[near], np.abs(program_sdf(part, middles[faces[near]])))
        for i in reversed(range(len(parts))):
            near = beside(parts[i])
            first[faces[near[np.abs(program_sdf(parts[i], middles[faces[near]])) <= least[near] + SAME * size]]] = i
        return least

    # a feature made no face that is far from the ball around it, as thousands of faces are from most of thousands of features
    reach = BESIDE * size
    least = give(np.arange(len(middles)), lambda p: np.array(tree.query_ball_point(p.center, bounding_radius(p) + reach), np.int64))
    lost = np.flatnonzero(least + SAME * size > reach)
    if len(lost):  # which rounding moved off all features: that nearest to it may be any
        give(lost, lambda _: np.arange(len(lost)))
    return np.minimum(first, sum(1 for _ in leaves(program)))


def threemf_bytes(bodies: Sequence[trimesh.Trimesh], name: str = NAMELESS, units: str = UNSPECIFIED) -> bytes:
    """3MF core package with one object for each body, the largest first and called as the part; unspecified lengths are millimetres."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as package:
        for path, text in (("[Content_Types].xml", _TYPES), ("_rels/.rels", _RELATIONS), ("3D/3dmodel.model", _model(bodies, name, units))):
            # a fixed date, for the same bytes every time
            entry = zipfile.ZipInfo(path, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            package.writestr(entry, text)
    return buffer.getvalue()


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


def _model(bodies: Sequence[trimesh.Trimesh], name: str, units: str) -> str:
    ranked = sorted(bodies, key=lambda body: (-_volume(body), *body.bounds.ravel()))
    objects = "\n".join(_object(i, body, name if i == 1 else f"{name} ({i})") for i, body in enumerate(ranked, 1))
    items = "".join(f'<item objectid="{i}"/>' for i in range(1, len(ranked) + 1))
    unit = "millimeter" if units == UNSPECIFIED else units
    return f"""{_XML}<model unit="{unit}" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<metadata name="Title">{escape(name, quote=False)}</metadata>
<metadata name="Application">IMDIM</metadata>
<resources>{objects}</resources>
<build>{items}</build>
</model>
"""


def _volume(body: trimesh.Trimesh) -> float:
    """Of what lies within; a body may be a scrap without volume, about whose centre of mass trimesh warns."""
    a, b, c = np.moveaxis(body.triangles, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def _object(number: int, mesh: trimesh.Trimesh, name: str) -> str:
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>\n' for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in mesh.faces.tolist())
    return f"""<object id="{number}" type="model" name="{escape(name)}"><mesh>
<vertices>
{vertices}</vertices>
<triangles>
{triangles}</triangles>
</mesh></object>"""
