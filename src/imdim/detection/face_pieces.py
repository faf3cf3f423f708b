"""Pieces that are raised from a flat face, or sunk into it, by one depth and with upright walls; and a mesh without them.

What is left of a mesh when the triangles of one plane go falls apart into what stands on that plane, what is sunk into it, and the rest.
Without a piece the face goes on where it stood: no boolean is asked, and no vertex moves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold, triangulate

from imdim.detection.faceting import ON_SURFACE
from imdim.detection.facets import Facets
from imdim.geometry.components import components
from imdim.geometry.solid import solid_of
from imdim.target.bodies import compact, edge_table

MOST_FACES = 200  # flat ones, the largest, that may carry pieces
FLAT_FACE = math.cos(math.radians(0.5))
UPRIGHT = math.sin(math.radians(1.0))  # cosine between a wall's normal and that of the face
LEAST_DEPTH = 2 * ON_SURFACE  # of the diagonal


class FacePiece(NamedTuple):
    """`triangles` [t] of a mesh: walls and what they end at, `depth` above a face, or below where that is negative. `rims` are loops of
    vertices [k] on the face, `outlines` the same [k, 2] in its plane; the piece is to their left."""

    triangles: np.ndarray
    depth: float
    rims: tuple[np.ndarray, ...]
    outlines: tuple[np.ndarray, ...]


class CarryingFace(NamedTuple):
    """A flat face and its `pieces`. The columns of the `frame` [3, 3] are two directions in its plane, the first two coordinates of its
    pieces from the `point` [3], and its normal."""

    point: np.ndarray
    frame: np.ndarray
    pieces: tuple[FacePiece, ...]


def number_faces(facets: Facets) -> tuple[np.ndarray, np.ndarray]:
    """The face [u] that each facet is of, one for all that lie in one plane, -1 beyond the MOST_FACES largest, and the areas of these."""
    order = np.argsort(-facets.areas, kind="stable")[:MOST_FACES]
    face, near, number = np.full(len(facets.areas), -1), ON_SURFACE * facets.diagonal, 0
    for i in order:
        if face[i] >= 0:
            continue
        level = np.abs((facets.centers - facets.centers[i]) @ facets.normals[i]) < near
        face[level & (facets.normals @ facets.normals[i] > FLAT_FACE) & (face < 0)] = number
        number += 1
    return face, np.bincount(face[face >= 0], facets.areas[face >= 0], number)


def find_face_pieces(mesh: trimesh.Trimesh, facets: Facets, least: int) -> Iterator[CarryingFace]:
    """The faces of a `mesh`, whose facets these are, that carry so many pieces at `least`."""
    faces = np.asarray(mesh.faces)
    sides = _Sides.of(faces)
    face = number_faces(facets)[0]
    own = face[facets.facet_of]
    for number in np.flatnonzero(_count_rims(sides, own, len(mesh.vertices)) > least):
        facet = int(np.flatnonzero(face == number)[np.argmax(facets.areas[face == number])])
        found = _look_at(mesh, facets, sides, own == number, facet)
        if len(found.pieces) >= least:
            yield found


def without_pieces(mesh: trimesh.Trimesh, pieces: Sequence[FacePiece]) -> Manifold:
    """The solid that a mesh bounds whose faces go on where their pieces were; its status says where there is none."""
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    kept = np.ones(len(faces), bool)
    kept[np.concatenate([piece.triangles for piece in pieces])] = False
    fills = [np.concatenate(piece.rims)[triangulate(list(piece.outlines))] for piece in pieces]
    return solid_of(*compact(vertices, np.concatenate([faces[kept], *fills]).astype(np.int64)))


class _Sides(NamedTuple):
    """The edges of a mesh between two triangles: vertices `start` and `end` [e] as the `one` [e] walks along it, and the `other` [e]."""

    start: np.ndarray
    end: np.ndarray
    one: np.ndarray
    other: np.ndarray

    @staticmethod
    def of(faces: np.ndarray) -> _Sides:
        start, end = faces.T.reshape(-1), np.roll(faces, -1, axis=1).T.reshape(-1)
        label = edge_table(faces)[3]
        order = np.argsort(label, kind="stable")
        order = order[np.bincount(label)[label[order]] == 2]
        first, second = order[::2], order[1::2]
        return _Sides(start[first], end[first], first % len(faces), second % len(faces))

    def meet(self, level: np.ndarray) -> _Sides:
        """Those at which one triangle is `level` [f] and the other is not, as the latter walks along them."""
        here, there = ~level[self.one] & level[self.other], level[self.one] & ~level[self.other]
        pairs = ((self.start, self.end), (self.end, self.start), (self.one, self.other), (self.other, self.one))
        return _Sides(*(np.concatenate([a[here], b[there]]) for a, b in pairs))


def _count_rims(sides: _Sides, own: np.ndarray, vertices: int) -> np.ndarray:
    """How many rims each face has whose triangles `own` [f] says, by its number."""
    nodes, ends = list[np.ndarray](), list[np.ndarray]()
    for this, that in ((sides.one, sides.other), (sides.other, sides.one)):
        rim = (own[this] != own[that]) & (own[this] >= 0)
        nodes.append(own[this][rim] * vertices + sides.start[rim])
        ends.append(own[this][rim] * vertices + sides.end[rim])
    known, place = np.unique(np.concatenate([*nodes, *ends]), return_inverse=True)
    half = len(place) // 2
    count, piece = components(place[:half], place[half:], len(known))
    face_of = np.zeros(count, np.int64)
    face_of[piece] = known // max(vertices, 1)
    return np.bincount(face_of, minlength=int(own.max(initial=-1)) + 1)


def _look_at(mesh: trimesh.Trimesh, facets: Facets, sides: _Sides, level: np.ndarray, facet: int) -> CarryingFace:
    """The face whose triangles are `level` [f], and whose largest facet this is, with its pieces."""
    normal, point = facets.normals[facet], facets.centers[facet]
    frame = _frame(normal)
    near = ON_SURFACE * facets.diagonal
    height = (np.asarray(mesh.vertices) - point) @ normal
    corners = height[np.asarray(mesh.faces)]
    joined = ~level[sides.one] & ~level[sides.other]
    count, piece = components(sides.one[joined], sides.other[joined], len(level))
    high, low = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(high, piece, corners.max(1))
    np.minimum.at(low, piece, corners.min(1))
    depth = np.where(high > -low, high, low)
    # a triangle of a piece is upright, or lies at its end
    facing = (facets.normals @ normal)[facets.facet_of]
    ends = (facing > FLAT_FACE) & (np.abs(corners - depth[piece][:, None]).max(1) < near)
    plain = np.bincount(piece, ~(ends | (np.abs(facing) < UPRIGHT)), count) == 0
    one_sided = np.where(depth > 0, low > -near, high < near) & (np.abs(depth) > LEAST_DEPTH * facets.diagonal)
    rim = sides.meet(level)
    carried = np.zeros(count, bool)
    carried[piece[rim.one]] = True
    by_piece, by_rim = np.argsort(piece, kind="stable"), np.argsort(piece[rim.one], kind="stable")
    starts, rim_starts = (np.searchsorted(own, np.arange(count + 1)) for own in (piece[by_piece], piece[rim.one[by_rim]]))
    found: list[FacePiece] = []
    for number in np.flatnonzero(plain & one_sided & carried).tolist():
        along = by_rim[rim_starts[number] : rim_starts[number + 1]]
        rims = _chain(rim.start[along].tolist(), rim.end[along].tolist())
        if rims:
            outlines = tuple((np.asarray(mesh.vertices)[loop] - point) @ frame[:, :2] for loop in rims)
            found.append(FacePiece(by_piece[starts[number] : starts[number + 1]], float(depth[number]), rims, outlines))
    return CarryingFace(point, frame, tuple(found))


def _frame(normal: np.ndarray) -> np.ndarray:
    """A frame [3, 3] whose last column this is, a right-handed one."""
    first = np.cross(np.eye(3)[int(np.abs(normal).argmin())], normal)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first), normal])


def _chain(starts: Sequence[int], ends: Sequence[int]) -> tuple[np.ndarray, ...]:
    """The loops of vertices that edges from `starts` to `ends` make; none where two touch, or one is open."""
    ahead = dict(zip(starts, ends, strict=True))
    if len(ahead) < len(starts) or set(ahead) != set(ends):
        return ()
    loops: list[np.ndarray] = []
    while ahead:
        loop = [next(iter(ahead))]
        while (after := ahead.pop(loop[-1])) != loop[0]:
            loop.append(after)
        loops.append(np.array(loop))
    return tuple(loops)
