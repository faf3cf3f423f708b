"""Ends of a solid that lie outside its target's box, where no sample of the search ever was.

A search looks at a box around the part. A slanted bar that is added may reach beyond that box, and a cutter that takes its end off within
the box ends with the box: the rest of the bar stays outside, unseen. Such cutters are prolonged here until the stray end is gone.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.extend import Face, between, length, plane_faces
from imdim.geometry.solid import primitive_to_manifold, to_manifold, volume_iou
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves, map_leaves

MARGIN = 1e-3  # of the diagonal; what lies less far outside the target's box is no stray
NOTHING = 1e-6  # of the target's volume
REACHES = (0.1, 0.3, 1.0)  # of the diagonal, by which a cutter is prolonged


def without_strays(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` whose cutters reach as far out as what they cut off, where that leaves less beyond the box of the target `solid`.

    The program itself where nothing strays, or no cutter can end it; its IoU with the target never falls. Past the `deadline` (by default
    never) the other cutters stay.
    """
    corners = np.array(solid.bounding_box()).reshape(2, 3)
    diagonal = float(np.linalg.norm(corners[1] - corners[0]))
    home = Manifold.cube(tuple(corners[1] - corners[0] + 2 * MARGIN * diagonal)).translate(tuple(corners[0] - MARGIN * diagonal))

    def stray(trial: Program) -> Manifold:
        return to_manifold(trial) - home

    out = stray(program)
    for i, sign in enumerate(signs(program)):
        for face in plane_faces(list(leaves(program))[i]) if sign < 0 else ():
            if out.volume() <= NOTHING * solid.volume() or deadline.has_passed():
                return program
            further = primitive_to_manifold(between(list(leaves(program))[i], face, 0.0, diagonal))
            if (further ^ out).volume() <= NOTHING * solid.volume():
                continue
            trials = [_extend_leaf(program, i, face, reach * diagonal) for reach in REACHES]
            left = [stray(trial).volume() for trial in trials]
            # the shortest of those that leave least
            best = next(k for k, volume in enumerate(left) if volume <= min(left) + NOTHING * solid.volume())
            if left[best] < out.volume() - NOTHING * solid.volume() and _iou(trials[best], solid) >= _iou(program, solid):
                program, out = trials[best], stray(trials[best])
    return program


def _extend_leaf(program: Program, index: int, face: Face, reach: float) -> Program:
    return map_leaves(program, lambda i, leaf: between(leaf, face, -length(leaf, face), reach) if i == index else leaf)


def _iou(program: Program, solid: Manifold) -> float:
    return volume_iou(to_manifold(program), solid)
