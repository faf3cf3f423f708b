"""Coordinates in which a leaf's visible faces move on their own.

With (size, centre) as unknowns a hidden face follows the visible one opposite to it. Here a step [9] of a leaf, all entries lengths in
its own frame, moves what the surface shows:

=========  ================================================================================================
box        0-2 the faces at +x +y +z, 3-5 those at -x -y -z
cylinder   0 radius, 1 top, 5 bottom, 3-4 axis sideways
cone       0-1 radius in the bottom and top plane of before, 2 top, 5 bottom, both sliding on the slant of before,
           3-4 axis sideways; a pointed end stays pointed
extrude    0 the end at +z, 5 that at -z, 3-4 the section sideways
revolve    0 the angle at its bounding radius, where it is less than a full turn, 3-5 centre
others     0-2 sizes, 3-5 centre
all        6-8 rotation vector times the bounding radius
=========  ================================================================================================

Entries that the solid does not feel (a sphere's rotation, a cylinder's spin, unused sizes) are zero columns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imdim.geometry.lowering import Lowered
from imdim.geometry.pose import radii
from imdim.geometry.rotations import euler_from_matrix, skew
from imdim.program.tree import FLAT_ENDS, FULL_TURN, KINDS, SIZE_NAMES, Primitive, Program, map_leaves

BOX, SPHERE, CYLINDER, CONE, TORUS, ELLIPSOID, EXTRUDE, REVOLVE, DRAFTED = range(len(KINDS))

# One step may shrink a size to no less than this share and turn or shift a leaf by no more than this share of its bounding radius.
MIN_SHRINK = 0.3
MAX_STEP = 0.25


def step_maps(numbers: Lowered) -> np.ndarray:
    """Matrices [k, 9, 9] from steps in face coordinates to the kernels' (sizes, shift, rotation vector) of each leaf."""
    return np.stack([_step_map(*leaf) for leaf in zip(numbers.kinds, numbers.sizes, radii(numbers), strict=True)])


def _step_map(kind: int, size: np.ndarray, radius: float) -> np.ndarray:
    out = np.diag([1.0] * 6 + [1 / radius] * 3)
    used = len(SIZE_NAMES[KINDS[kind]])
    out[used:3] = 0
    for axis, column in FLAT_ENDS.get(KINDS[kind], {}).items():
        _opposite_faces(out, column, axis)
    if kind == CONE:
        slope = (size[1] - size[0]) / size[2]
        for end, column in ((0, 5), (1, 2)):
            pointed = size[end] == 0
            out[end, column] = 0 if pointed else slope
            out[end, end] = not pointed
    full = kind == REVOLVE and size[0] == FULL_TURN
    if kind == DRAFTED:
        out[1, 1] = 0  # it is an angle, and read off the walls that lean
    if kind == REVOLVE:
        out[0, 0] = 0 if full else np.degrees(1 / radius)
    if kind in (CYLINDER, CONE, TORUS) or full:
        out[8, 8] = 0
    if kind == SPHERE:
        out[6:, 6:] = 0
    return out


def _opposite_faces(out: np.ndarray, size: int, axis: int) -> None:
    """Let column `size` move the face at +`axis` and column 3 + `axis` the one at -`axis`; their distance is in row `size`."""
    for position, sign in ((size, 1.0), (3 + axis, -1.0)):
        out[size, position] = sign
        out[3 + axis, position] = 0.5


def move_limited(numbers: Lowered, maps: np.ndarray, steps: np.ndarray) -> Lowered:
    """The leaves after `steps` [k, 9] in face coordinates, cut short where they are too long; sizes stay positive."""
    shares = np.minimum(1.0, MAX_STEP * radii(numbers) / np.maximum(np.abs(steps).max(1), 1e-300))
    return shift_leaves(numbers, np.einsum("kij,kj->ki", maps, steps * shares[:, None]))


def shift_leaves(numbers: Lowered, raw: np.ndarray) -> Lowered:
    """The leaves after steps `raw` [k, 9] in the kernels' (sizes, shift, rotation vector); sizes stay positive."""
    sizes = np.maximum(numbers.sizes + raw[:, :3], MIN_SHRINK * numbers.sizes)
    tori = numbers.kinds == TORUS
    sizes[tori, 1] = np.minimum(sizes[tori, 1], sizes[tori, 0])
    turned = numbers.kinds == REVOLVE
    sizes[turned, 0] = np.minimum(sizes[turned, 0], FULL_TURN)
    centers = numbers.centers + np.einsum("kij,kj->ki", numbers.rotations, raw[:, 3:6])
    return replace(numbers, sizes=sizes, centers=centers, rotations=numbers.rotations @ _exponentials(raw[:, 6:9]))


def _exponentials(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices [k, 3, 3] of rotation vectors [k, 3] (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = skew(vectors / np.maximum(angle[:, :, 0], 1e-300))
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def lift_numbers(program: Program, before: Lowered, after: Lowered) -> Program:
    """`program` with the numbers of `after`; a leaf's rotation that did not move keeps its Euler degrees exactly."""

    def read(i: int, p: Primitive) -> Primitive:
        turned = not np.array_equal(before.rotations[i], after.rotations[i])
        rx, ry, rz = euler_from_matrix(after.rotations[i]) if turned else p.rotation
        size = tuple(after.sizes[i, : len(p.size)].tolist())
        place = tuple(after.centers[i].tolist()), (rx + 0.0, ry + 0.0, rz + 0.0)  # no negative zeros
        try:
            return Primitive(p.kind, size, *place, p.outline)
        except ValueError:
            if p.kind != "drafted":
                raise
            return Primitive(p.kind, p.size, *place, p.outline)  # so high its walls would meet

    return map_leaves(program, read)
