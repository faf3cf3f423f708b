"""Cutters that stick out of the part end at the face they leave it by.

A search lets a cutter go on to the end of the box that it looks at, a few hundredths beyond the part: its length is then a number of that
box. How far a cutter stands out is a matter of how solids are built, so its end goes back to where it stops to cut; who delivers it lets it
stand out again, by a round number (`overshoot`). Cutters that are alike but for their places stay so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from manifold3d import Manifold, OpType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.extend import Face, between, length
from imdim.geometry.finish.overshoot import REACH
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import ALIGNED, TOUCH
from imdim.geometry.finish.turned_ends import cut_off, reach_along
from imdim.geometry.solid import bounds_of, corners_of, exact_rotation, primitive_to_manifold
from imdim.program.roles import signs
from imdim.program.tree import PLANE_ENDS, Primitive, Program, leaves, longest, replace_leaves

ENDED = (*PLANE_ENDS, "revolve")  # what has ends along an axis


def draw_back(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid, whose cutters end no farther out than all that is added does, at round places where that is no face. Past the
    `deadline` (by default never) the others stay."""
    parts = list(leaves(program))
    added = [primitive_to_manifold(part, CHECK_SEGMENTS) for part, sign in zip(parts, signs(program), strict=True) if sign > 0]
    material = Manifold.batch_boolean(added, OpType.Add)
    slack = TOUCH * longest(parts)
    for group, face in _free_ends(program, slack):
        if deadline.has_passed():
            break
        parts = list(leaves(program))
        spare = min(_spare_of(parts[i], face, material, slack) for i in group)
        if spare > slack:
            shorter = {i: new for i in group if (new := _without_end(parts[i], face, spare, slack)) is not None}
            program = replace_leaves(program, shorter)
    return program


def _free_ends(program: Program, slack: float) -> Iterator[tuple[list[int], Face]]:
    """The plane ends of cutters, those of leaves that are alike together."""
    rows: dict[object, list[int]] = {}
    for i, (leaf, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        if sign < 0 and leaf.kind in ENDED:
            turn = np.round(exact_rotation(leaf), 6).ravel().tolist()
            bounds = () if leaf.outline is None else np.ravel(leaf.outline.bounds)
            key = (leaf.kind, *(round(v / (100 * slack)) for v in (*leaf.size, *bounds)), *turn)
            rows.setdefault(key, []).append(i)
    for (kind, *_), group in rows.items():  # type: ignore[misc]
        yield from ((group, (axis, side)) for axis in PLANE_ENDS.get(kind, (2,)) for side in (-1, 1))


def _spare_of(leaf: Primitive, face: Face, material: Manifold, slack: float) -> float:
    """By how much a leaf is too long at an end: it stops to cut there, or a little further in; 0 where it does not stick out."""
    direction = exact_rotation(leaf)[:, face[0]] * face[1]
    end = _place(leaf, face, direction)
    bounds = bounds_of(material)
    if end <= np.maximum(bounds[0] * direction, bounds[1] * direction).sum() + slack:
        return 0.0
    met = primitive_to_manifold(leaf, CHECK_SEGMENTS) ^ material
    if met.is_empty():
        return 0.0
    last = float((corners_of(met) @ direction).max())
    if not _is_curved(met, direction, last, slack):
        return end - last
    if np.abs(direction).max() < 1 - ALIGNED:
        return 0.0  # no place along a slanted way is round
    step = 10.0 ** math.floor(math.log10(REACH * float(np.linalg.norm(np.ptp(bounds, axis=0)))))
    return max(end - step * math.ceil(last / step), 0.0)


def _is_curved(met: Manifold, direction: np.ndarray, last: float, slack: float) -> bool:
    """Whether what is cut ends in no face across a direction: in a curved wall, whose facets tell no number, or an edge."""
    mesh = met.to_mesh64()
    triangles = (np.asarray(mesh.vert_properties)[:, :3] @ direction)[np.asarray(mesh.tri_verts)]
    return not (triangles >= last - slack).all(axis=1).any()


def _place(leaf: Primitive, face: Face, direction: np.ndarray) -> float:
    middle = float(direction @ leaf.center)
    if leaf.kind == "revolve":
        low, high = reach_along(leaf)
        return middle + (high if face[1] > 0 else -low)
    return middle + length(leaf, face) / 2


def _without_end(leaf: Primitive, face: Face, spare: float, slack: float) -> Primitive | None:
    """The leaf, shorter by so much; None for drawings that cannot be cut there, and where nothing would be left."""
    if leaf.kind == "revolve":
        return cut_off(leaf, face[1], reach_along(leaf)[face[1] > 0] - face[1] * spare, slack)
    whole = length(leaf, face)
    return between(leaf, face, -whole, -spare) if spare < whole - slack else None
