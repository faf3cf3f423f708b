"""Cones and turned drawings that end on the face they stand on.

The foot of a boss goes on as a cone into its plate, where nobody sees it, and a search leaves its end anywhere in there: its diameter is
then that of a place inside the plate, and where the plate is narrow the cone comes out at its sides. People measure a foot where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import find_change
from imdim.geometry.finish.extend import between, length, plane_faces
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import ALIGNED, TOUCH
from imdim.geometry.finish.turned_ends import cut_off, reach_along
from imdim.geometry.solid import exact_rotation, to_manifold, volume_iou
from imdim.program.roles import signs
from imdim.program.tree import FULL_TURN, Primitive, Program, leaves, longest, replace_leaves

NOTHING = 1e-6  # of IoU, which rounding errors of the booleans may cost
MOST_HELD = 4  # targets, that one and a program which is worth a look hold together


def stand_on_faces(program: Program, target: Manifold, deadline: Deadline = NEVER) -> Program:
    """The program whose added cones and turned drawings end at faces of other added parts, as far up as its IoU with the `target` does not
    fall: what is taken off is hidden in others, or in the air. Past the `deadline` (by default never) the others stay."""
    for i, sign in enumerate(signs(program)):
        for side in (-1, 1) if sign > 0 else ():
            for shorter in _shorten(program, i, side):
                if deadline.has_passed():
                    return program
                trial = replace_leaves(program, {i: shorter})
                if _is_as_near(trial, i, program, target):
                    program = trial
                    break
    return program


def _is_as_near(trial: Program, i: int, program: Program, target: Manifold) -> bool:
    """Whether a trial, whose leaf `i` is the one of the program that was shortened, has no lower IoU with the target."""
    before = list(leaves(program))[i]
    lost, whole = find_change(trial, i, before, CHECK_SEGMENTS), target.volume()
    if lost.volume() <= NOTHING * whole:
        return True
    needed = (lost ^ target).volume()
    if needed <= NOTHING * whole:
        return True
    # what both share falls by what was needed, what either holds by the rest: the ratio, at most one, falls where the first is more
    if needed - (lost.volume() - needed) > MOST_HELD * NOTHING * whole:
        return False
    return volume_iou(to_manifold(trial, CHECK_SEGMENTS), target) >= volume_iou(to_manifold(program, CHECK_SEGMENTS), target) - NOTHING


def _shorten(program: Program, i: int, side: int) -> Iterator[Primitive]:
    """Leaf `i`, if it is a cone or turned drawing, ended at the faces of added leaves that its end on a `side` may stand on; the
    shortest first."""
    parts = list(leaves(program))
    leaf, slack = parts[i], TOUCH * longest(parts)
    ends = _ends_of(leaf)
    if ends is None:
        return
    axis = exact_rotation(leaf)[:, 2]
    places = (float(axis @ (point - leaf.center)) for point in _faces_against(program, i, -side * axis))
    for place in sorted((z for z in places if ends[0] + slack < z < ends[1] - slack), key=lambda z: side * z):
        shorter = _end_at(leaf, side, place, slack)
        if shorter is not None:
            yield shorter


def _faces_against(program: Program, i: int, direction: np.ndarray) -> Iterator[np.ndarray]:
    """Middles [3] of the plane faces of other added leaves that look along a `direction`."""
    for k, (part, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        if sign < 0 or k == i:
            continue
        frame = exact_rotation(part)
        for axis, side in plane_faces(part):
            normal = side * frame[:, axis]
            if normal @ direction > 1 - ALIGNED:
                yield np.array(part.center) + normal * length(part, (axis, side)) / 2


def _ends_of(leaf: Primitive) -> tuple[float, float] | None:
    """From where to where a cone or a turned drawing reaches along its axis, from its centre; None for other leaves."""
    if leaf.kind == "cone":
        return -leaf.size[2] / 2, leaf.size[2] / 2
    return reach_along(leaf) if leaf.kind == "revolve" and leaf.size[0] == FULL_TURN else None


def _end_at(leaf: Primitive, side: int, place: float, slack: float) -> Primitive | None:
    """The leaf without what lies beyond a place on its axis; None for a drawing that cannot be cut off there."""
    if leaf.kind == "cone":
        return between(leaf, (2, side), -length(leaf, (2, side)), side * place - leaf.size[2] / 2)
    return cut_off(leaf, side, place, slack)
