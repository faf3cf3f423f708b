"""Faces that a person clicks: which one a ray meets, and what is known of it from the numbers of its primitive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.app.lab.drawing import CAP_OF, SPAN, Drawing, Piece
from imdim.app.lab.edits import ConstrainedProgram
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.constraints import AXES, AXES_OF, FACES_OF, Ref
from imdim.program.outline import Outline, arc_center, arc_radius, ring_curves
from imdim.program.tree import Primitive, leaves
from imdim.target.target import Frame

LEVEL = 0.999  # cosine, from which a normal is that of a plane face
NEAR = 1e-3  # of the view, within which triangles are of one face


@dataclass(frozen=True, eq=False)
class Pick:
    """A face of thing number `leaf`, clicked at `point` [3] in the target's units, where its outward normal is `normal` [3].

    `face` names it where relations can: a plane face of a primitive. A round face has the `axis` [3] and the `center` [3] of its primitive,
    and where it is a cylinder its `radius`. `triangles` [m, 3, 3] are seen in the view.
    """

    leaf: int
    point: np.ndarray
    normal: np.ndarray
    face: Ref | None
    axis: np.ndarray | None
    center: np.ndarray | None
    radius: float | None
    triangles: np.ndarray

    @property
    def is_flat(self) -> bool:
        return self.center is None


def pick_face(
    theory: ConstrainedProgram, scene: Drawing, frame: Frame, leaf: int, origin: np.ndarray, direction: np.ndarray
) -> Pick | None:
    """The face that a ray of the view meets, `leaf` being what it met first; behind a translucent cutter what that one made, which of
    a round hole is its wall where the ray goes through. None where it meets nothing."""
    hits = [(hit, piece) for piece in scene.pieces if (hit := _meet(piece, origin, direction)) is not None]
    parts = list(leaves(theory.program))
    own = hits
    if any(ghost.leaf == leaf for ghost in scene.ghosts):
        own = [pair for pair in hits if pair[1].leaf == leaf]
        if not own and parts[leaf].kind == "cylinder":
            return _look_through(scene, parts[leaf], leaf)
    if not (own or hits):
        return None
    (far, face), piece = min(own or hits, key=lambda pair: pair[0][0])
    if piece.leaf == CAP_OF:
        return None
    point = frame.to_world((origin + far * direction) / SPAN)
    normals = _normals(piece)
    if piece.leaf >= len(parts):
        center = point if np.isclose(normals @ normals[face], 1.0).sum() < 3 else None
        return Pick(piece.leaf, point, normals[face], None, None, center, None, _corners(piece))
    return _describe(piece, parts[piece.leaf], point, normals, face, frame)


def _look_through(scene: Drawing, part: Primitive, leaf: int) -> Pick:
    """The wall of a round hole through which a ray goes without meeting it."""
    axis, center = matrix_from_euler(part.rotation)[:, 2], np.array(part.center)
    walls = [
        corners for piece in scene.pieces if piece.leaf == leaf for corners in [_corners(piece)[np.abs(_normals(piece) @ axis) < LEVEL]]
    ]
    return Pick(leaf, center, axis, None, axis, center, part.size[0], np.concatenate([np.zeros((0, 3, 3)), *walls]))


def is_same_face(one: Pick, two: Pick) -> bool:
    """Whether a face was clicked twice."""
    return one.leaf == two.leaf and one.face == two.face and np.array_equal(one.triangles, two.triangles)


def _describe(piece: Piece, part: Primitive, point: np.ndarray, normals: np.ndarray, face: int, frame: Frame) -> Pick:
    rotation, center = matrix_from_euler(part.rotation), np.array(part.center)
    normal = normals[face]
    local, facing = rotation.T @ (point - center), rotation.T @ normal
    level = int(np.argmax(np.abs(facing)))
    corners = _corners(piece)
    if AXES[level] in FACES_OF.get(part.kind, ()) and abs(facing[level]) > LEVEL:
        side = "+" if local[level] > 0 else "-"
        return Pick(piece.leaf, point, normal, Ref(piece.leaf, f"{side}{AXES[level]}"), None, None, None, _flat(corners, normals, face))
    if AXES_OF[part.kind] == ("z",):
        found = _round_wall(part, local, facing)
        if found is None:
            return Pick(piece.leaf, point, normal, None, None, None, None, _flat(corners, normals, face))
        middle, radius = found
        at = rotation @ middle + center
        seen = _around(corners, normals, rotation[:, 2], frame.to_unit(at) * SPAN, frame.to_unit(point) * SPAN, part)
        return Pick(piece.leaf, point, normal, None, rotation[:, 2], at, radius, seen)
    return Pick(piece.leaf, point, normal, None, None, center, part.size[0] if part.kind == "sphere" else None, corners)


def _round_wall(part: Primitive, local: np.ndarray, facing: np.ndarray) -> tuple[np.ndarray, float | None] | None:
    """Centre [3] and radius, in a primitive's own frame, of its round face at `local` [3]; no radius where that changes along the axis,
    None where it is flat there."""
    if part.kind in ("cylinder", "cone", "torus", "revolve"):
        if part.kind == "revolve" and abs(facing[2]) > LEVEL:
            return None
        is_straight = part.kind != "torus" and abs(facing[2]) < 1 - LEVEL
        return np.zeros(3), (part.size[0] if part.kind == "cylinder" else float(np.hypot(*local[:2]))) if is_straight else None
    assert part.outline is not None
    if part.kind == "drafted":  # its arcs are cones, of no one radius
        return None
    return _arc_at(part.outline, local)


def _arc_at(outline: Outline, local: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Centre and radius of the arc of an outline on which a point lies, None where that is a line or an ellipse."""

    def off(curve: tuple[float, ...]) -> float:
        x, y, u, v, bulge = curve
        if bulge:
            middle = np.array(arc_center((x, y, u, v, bulge)))
            return abs(float(np.hypot(*(local[:2] - middle))) - arc_radius((x, y, u, v, bulge)))
        along = np.array([u - x, v - y])
        share = np.clip((local[:2] - [x, y]) @ along / (along @ along), 0.0, 1.0)
        return float(np.hypot(*(local[:2] - [x, y] - share * along)))

    curves = [curve for ring in outline.rings for curve in ring_curves(ring)]
    if not curves:
        return None
    nearest = min(curves, key=off)
    return (np.array([*arc_center(nearest), 0.0]), arc_radius(nearest)) if nearest[4] else None


def _meet(piece: Piece, origin: np.ndarray, direction: np.ndarray) -> tuple[float, int] | None:
    """How far along a ray it first meets a mesh, and in which face (Möller and Trumbore 1997)."""
    a, b, c = np.moveaxis(_corners(piece), 1, 0)
    one, two = b - a, c - a
    across = np.cross(direction, two)
    volume = (one * across).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((origin - a) * across).sum(axis=1) / volume
        over = np.cross(origin - a, one)
        v = over @ direction / volume
        far = (over * two).sum(axis=1) / volume
        good = (np.abs(volume) > 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (far > 0)
    if not good.any():
        return None
    face = int(np.argmin(np.where(good, far, np.inf)))
    return float(far[face]), face


def _corners(piece: Piece) -> np.ndarray:
    return piece.vertices.astype(np.float64)[piece.faces]


def _normals(piece: Piece) -> np.ndarray:
    """Unit normals [f, 3]; of a face without area zero."""
    a, b, c = np.moveaxis(_corners(piece), 1, 0)
    across = np.cross(b - a, c - a)
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)


def _flat(corners: np.ndarray, normals: np.ndarray, face: int) -> np.ndarray:
    """The triangles in the plane of one of them."""
    off = np.abs((corners - corners[face, 0]) @ normals[face]).max(axis=1)
    return corners[(normals @ normals[face] > LEVEL) & (off < NEAR)]


def _around(corners: np.ndarray, normals: np.ndarray, axis: np.ndarray, at: np.ndarray, point: np.ndarray, part: Primitive) -> np.ndarray:
    """The triangles of the round face about an axis on which a point lies."""
    round_ones = np.abs(normals @ axis) < LEVEL
    if part.kind not in ("extrude", "revolve"):
        return corners[round_ones]

    def far(points: np.ndarray) -> np.ndarray:
        off = points - at
        return np.linalg.norm(off - (off @ axis)[..., None] * axis, axis=-1)

    return corners[round_ones & (np.abs(far(corners) - far(point[None])).max(axis=1) < 10 * NEAR)]
