"""A section plane: what is drawn, cut open across an axis, with the cut filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from imdim.app.lab.drawing import CAP, CAP_OF, SPAN, Drawing, Piece, sharp_edges
from imdim.geometry.solid import mesh_to_manifold, to_trimesh
from imdim.target.target import Frame

KEPT = (-1.0, 1.0, -1.0)  # the side of the plane that stays: the view begins at +x, -y, +z
ON = 1e-6  # of the view, within which a vertex lies in the plane


@dataclass(frozen=True)
class Section:
    """The plane across axis number `axis` at `share` of the part's extent; what lies before it goes, seen
    from the corner that the view begins at, where `flipped` what lies behind it."""

    axis: int
    share: float
    flipped: bool = False

    def level(self, low: np.ndarray, high: np.ndarray) -> float:
        """Where the plane is in a box from `low` [3] to `high` [3]."""
        return float(low[self.axis] + self.share * (high[self.axis] - low[self.axis]))


def cut_drawing(scene: Drawing, section: Section, level: float, frame: Frame) -> Drawing:
    """The drawing without what lies beyond the plane at `level` of the target's axis; the solid's surface stays whole."""
    normal, at = _plane(section, level, frame)
    pieces = [part for piece in scene.pieces if (part := _cut_piece(piece, normal, at)) is not None]
    ghosts = [part for piece in scene.ghosts if (part := _cut_piece(piece, normal, at)) is not None]
    whole = trimesh.Trimesh(frame.to_unit(scene.surface.vertices) * SPAN, scene.surface.faces, process=False)
    caps, edges = _cap(whole, normal, at)
    return replace(scene, pieces=[*pieces, *caps], ghosts=ghosts, edges=edges)


def cut_original(piece: Piece, edges: np.ndarray, section: Section, level: float, frame: Frame) -> tuple[Sequence[Piece], np.ndarray]:
    """A target's surface without what lies beyond the plane, filled where it is closed; and its sharp edges."""
    normal, at = _plane(section, level, frame)
    left = _cut_piece(piece, normal, at)
    caps, cut = _cap(trimesh.Trimesh(piece.vertices, piece.faces, process=False), normal, at)
    return [*([left] if left is not None else []), *caps], cut if caps else _cut_lines(edges, normal, at)


def cut_points(points: np.ndarray, section: Section, level: float, frame: Frame) -> np.ndarray:
    """Those of points [n, 3] of the view that stay."""
    normal, at = _plane(section, level, frame)
    return points[points @ normal >= at]


def _plane(section: Section, level: float, frame: Frame) -> tuple[np.ndarray, float]:
    """The unit normal of what stays, and its distance from the middle of the view."""
    normal = np.zeros(3)
    normal[section.axis] = -KEPT[section.axis] if section.flipped else KEPT[section.axis]
    place = (level - frame.center[section.axis]) * frame.scale * SPAN
    return normal, float(place * normal[section.axis])


def _cut_piece(piece: Piece, normal: np.ndarray, at: float) -> Piece | None:
    """What of a piece stays, None where nothing does."""
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(piece.vertices.astype(np.float64), piece.faces, normal, at * normal)
    return replace(piece, vertices=vertices.astype(np.float32), faces=faces) if len(faces) else None


def _cut_lines(lines: np.ndarray, normal: np.ndarray, at: float) -> np.ndarray:
    """Those of lines [m, 2, 3] that stay as a whole."""
    return lines[(lines @ normal >= at - ON).all(axis=1)]


def _cap(whole: trimesh.Trimesh, normal: np.ndarray, at: float) -> tuple[list[Piece], np.ndarray]:
    """The filled cut, and the sharp edges of what stays; no cut where the surface is not closed."""
    try:
        solid = mesh_to_manifold(whole)
    except ValueError:
        return [], np.zeros((0, 2, 3), np.float32)
    x, y, z = normal.tolist()
    left = to_trimesh(solid.trim_by_plane((x, y, z), at))
    vertices = left.vertices.astype(np.float32)
    edges = sharp_edges(vertices, left)
    flat = (np.abs(left.vertices[left.faces] @ normal - at) < ON).all(axis=1)
    if not flat.any():
        return [], edges
    return [Piece(CAP_OF, vertices, np.asarray(left.faces[flat]), CAP)], edges
