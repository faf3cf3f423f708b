"""A part that lies aslant is reconstructed along its own axes, and its program turned back.

Much that is decided on the way looks along the axes: boxes that hold things, frames that drawings are made in, places that are rounded. A
part gives the same program wherever it lies if all that is done in a frame of its own.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from imdim.geometry.own_axes import ALONG, find_own_axes
from imdim.numbers.origin import MOST, find_offset, share_round_centers, widths_on_grid
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.tree import Primitive, Program, Vec3, leaves, map_leaves
from imdim.program.vectors import round_vector
from imdim.target.target import Frame, Target, as_matrix

DIGITS = 12  # of a place, that a turn there and back leaves


def find_own_frame(target: Target) -> Frame | None:
    """The frame along the axes of a mesh that bounds a solid and lies aslant, of the target's size; None for any other target.

    Its origin is the world's, about which the part was turned if its faces are at round places from there, or else in its largest faces.
    """
    if target.mesh is None or not target.is_solid:
        return None
    areas = np.asarray(target.mesh.area_faces)
    rotation = find_own_axes(np.asarray(target.mesh.face_normals), areas)
    if rotation is None:
        return None
    facing = np.abs(np.asarray(target.mesh.face_normals) @ rotation) > ALONG
    middles = np.asarray(target.mesh.triangles_center) @ rotation
    size = float(np.ptp(np.asarray(target.mesh.vertices) @ rotation, axis=0).max())
    origin = rotation @ [_origin_along(middles[on, k], areas[on], size) for k, on in enumerate(facing.T)]
    x, y, z = origin.tolist()
    return Frame((x, y, z), 1.0, as_matrix(rotation))


def _origin_along(places: np.ndarray, areas: np.ndarray, size: float) -> float:
    """Where places of faces along an axis, by their areas [n], are rounded from."""
    if not len(places) or areas[widths_on_grid(places, size) > 0].sum() >= MOST * areas.sum():
        return 0.0
    return float(places[int(areas.argmax())])


def turn_back(program: Program, own: Frame) -> Program:
    """A program of a part's own frame in the world, each leaf in the simplest of its equal frames, its place without the last digits, which
    are those of the turn."""
    turned = own.undo(program)
    largest = max(max(map(abs, (*leaf.center, *leaf.size))) for leaf in leaves(turned))
    decimals = DIGITS - math.ceil(math.log10(largest))

    def trim(leaf: Primitive) -> Primitive:
        return replace(canonical(leaf), center=round_vector(leaf.center, decimals))

    return map_leaves(turned, lambda _, leaf: trim(leaf))


def is_placed(program: Program, own: Frame) -> bool:
    """Whether a program of a part's own frame has round places in the world: its parts were put there, and not all of them as one."""
    parts, in_world = list(leaves(program)), share_round_centers(list(leaves(turn_back(program, own))))
    offset: Vec3 = find_offset(parts, np.inf)
    return in_world >= MOST and in_world > share_round_centers(parts, offset)
