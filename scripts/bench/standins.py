"""Find primitives that stand for a chamfer or a fillet: ``python scripts/bench/standins.py RESULTS``

RESULTS holds results folders. A box, a cone or a plain prism (an extruded drawing of at most four lines) stands for a blend if all that it
does to the part, what it adds or takes away, is slivers along edges: pieces that show one narrow plane of it, or its one conical side,
which leans to the other faces of the piece. The seat of a countersunk head and the point of a drill belong to their holes and do not count,
nor does what holds more than two hundredths of the part. Exit status 1 where there is one.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry import kernels
from imdim.geometry.holes import find_holes
from imdim.geometry.solid import exact_rotation, to_manifold, to_trimesh
from imdim.program import codec
from imdim.program.holes import SUNK
from imdim.program.paths import leaf_paths, without
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves

SHARE = 0.02  # of the part's volume, that all pieces hold at most
NARROW = 0.1  # of the part's diagonal: how wide a blend is at most
LONG = 1.5  # times its width, that it is long at least
LEANS = np.cos(np.radians([105.0, 168.0]))  # between its face and others, both outwards: 135 degrees for a chamfer of a square edge
MOSTLY = 0.7  # of an area
NEAR = 1e-6  # of the part's diagonal
CHORDS = 1e-3  # of a cone's radius, by which its facets miss it
FILM = 1e-6  # of the part's volume: a smaller piece is nothing
PLAIN = 4  # lines of a prism at most


class StandIn(NamedTuple):
    """A primitive by its number and kind, and what it does: the share of the part's volume, and the width of its widest sliver."""

    number: int
    kind: str
    share: float
    width: float


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    documents = sorted(parser.parse_args().results.glob("*/program.json"))
    if not documents:
        print("no folder there has a program.json", file=sys.stderr)
        return 2
    total = 0
    for path in documents:
        found = list(find_stand_ins(codec.from_json(codec.parse(path.read_bytes()))))
        total += len(found)
        told = ", ".join(f"{s.number} ({s.kind}, {s.width:.2g} wide, {s.share:.1e} of the volume)" for s in found)
        print(f"{path.parent.name}: {told or 'none'}", flush=True)
    print(f"{len(documents)} parts: {total} primitives stand for a chamfer or a fillet")
    return 1 if total else 0


def find_stand_ins(program: Program) -> Iterator[StandIn]:
    """Those of a program, without its edge features."""
    whole, seats = to_manifold(program), _seats(program)
    size = _diagonal(whole)
    for number, (path, leaf) in enumerate(leaf_paths(program)):
        rest = without(program, {path}) if _may_stand_in(leaf) and number not in seats else None
        if rest is None:
            continue
        other = to_manifold(rest)
        pieces = [p for change in (whole - other, other - whole) for p in change.decompose() if p.volume() > FILM * whole.volume()]
        share = sum(p.volume() for p in pieces) / whole.volume()
        widths = [_sliver_width(p, leaf, rest, size) for p in pieces] if 0 < share <= SHARE else []
        if widths and all(width is not None for width in widths):
            yield StandIn(number, leaf.kind, share, max(width for width in widths if width is not None))


def _diagonal(solid: Manifold) -> float:
    return float(np.linalg.norm(np.diff(np.reshape(solid.bounding_box(), (2, 3)), axis=0)))


def _may_stand_in(leaf: Primitive) -> bool:
    if leaf.kind != "extrude":
        return leaf.kind in ("box", "cone")
    loops = leaf.outline.loops if leaf.outline else ()
    return len(loops) == 1 and isinstance(loops[0], tuple) and len(loops[0]) <= PLAIN and not any(v[2] for v in loops[0])


def _seats(program: Program) -> set[int]:
    """The primitives that are heads and points of holes."""
    holes = find_holes(program)
    sections = [s for hole in holes for s in (hole.head, hole.point_section) if s is not None]
    sunk = {i for i, (p, sign) in enumerate(zip(leaves(program), signs(program), strict=True)) if sign < 0 and _is_sunk(p)}
    return sunk | {leaf for section in sections for leaf in section.leaves}


def _is_sunk(leaf: Primitive) -> bool:
    """Whether a cone is as wide as the seat of a head, such as those of two holes that run into each other."""
    return leaf.kind == "cone" and max(leaf.size[:2]) >= SUNK * min(leaf.size[:2])


def _sliver_width(piece: Manifold, leaf: Primitive, rest: Program, size: float) -> float | None:
    """How wide the face is that a piece shows of a leaf, beside those of the `rest`; None where the piece is no sliver along an edge."""
    mesh = to_trimesh(piece)
    near = NEAR * size + (CHORDS * max(leaf.size[:2]) if leaf.kind == "cone" else 0.0)
    own, others = (np.abs(kernels.program_sdf(solid, mesh.triangles_center)) < near for solid in (leaf, rest))
    own &= ~others
    if not own.any() or own.all():
        return None
    face = _conical_face(mesh, own, leaf) if leaf.kind == "cone" else _plane_face(mesh, own)
    if face is None:
        return None
    width, towards = face
    other = mesh.area_faces[~own]
    cosines = (towards[~own] * mesh.face_normals[~own]).sum(1)
    leaning = other[(cosines > LEANS[1]) & (cosines < LEANS[0])].sum()
    is_narrow = width <= NARROW * size and mesh.area_faces[own].sum() >= LONG * width**2
    return width if is_narrow and leaning >= MOSTLY * other.sum() else None


def _plane_face(mesh: trimesh.Trimesh, own: np.ndarray) -> tuple[float, np.ndarray] | None:
    """The width of the one plane that a leaf shows, and its normal, for each triangle [n, 3]."""
    areas, normals = mesh.area_faces[own], mesh.face_normals[own]
    normal = normals[areas.argmax()]
    flat = normals @ normal > 1 - 1e-6
    if areas[flat].sum() < MOSTLY * areas.sum():
        return None
    triangles = mesh.triangles[own][flat]
    across = np.cross(normal, (np.roll(triangles, 1, 1) - triangles).reshape(-1, 3))
    across /= np.linalg.norm(across, axis=1)[:, None]
    return float(np.ptp(triangles.reshape(-1, 3) @ across.T, axis=0).min()), np.tile(normal, (len(own), 1))


def _conical_face(mesh: trimesh.Trimesh, own: np.ndarray, leaf: Primitive) -> tuple[float, np.ndarray] | None:
    """The same of the side of a cone, whose normal is that beside each triangle."""
    axis = exact_rotation(leaf)[:, 2]
    arms = mesh.triangles_center - leaf.center
    along = arms @ axis
    outwards = arms - np.outer(along, axis)
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1), 1e-300)[:, None]
    leaned = mesh.face_normals @ axis
    side = own & (np.abs(leaned) < 1 - 1e-6)
    if mesh.area_faces[side].sum() < MOSTLY * mesh.area_faces[own].sum():
        return None
    down = (leaf.size[0] - leaf.size[1]) / leaf.size[2]
    way = np.sign((mesh.face_normals[side] * (outwards[side] + down * axis)).sum())
    ends = (mesh.triangles[side].reshape(-1, 3) - leaf.center) @ axis
    return float(np.ptp(ends) * np.hypot(1.0, down)), way * (outwards + down * axis) / np.hypot(1.0, down)


if __name__ == "__main__":
    sys.exit(main())
