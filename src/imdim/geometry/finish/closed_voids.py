"""Voids that a program has and its target has not: what its features leave closed in between them.

They weigh next to nothing, yet each is a void more than the part has, and the next edit of a number opens it. A feature beside the void
goes on past it, or a cut ends before it: one plane face or straight wall is moved each time, the one that keeps the solid nearest to the
target, by exact booleans over the whole of it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.census import SolidCensus, census_of, find_pieces
from imdim.geometry.finish.extend import plane_faces
from imdim.geometry.finish.loose_bodies import LOST, OVERLAPS, REACH, FaceMove, heights, move_face, round_up, straight_walls
from imdim.geometry.finish.tolerances import TOUCH
from imdim.geometry.solid import CRUMB, bounds_of, corners_of, to_manifold, volume_iou
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves, map_leaves

MOST = 12  # voids that are closed


def close_voids(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` with no more voids than its target `solid` has, as far as a move of one face for each closes them.

    Both are in one frame. The number of bodies stays, no hole comes or goes that the target has not, and each move costs next to nothing of
    the IoU with the target. Past the `deadline` (by default never) the other voids stay.
    """
    wanted = census_of(solid)
    for _ in range(MOST):
        made = to_manifold(program)
        before = census_of(made)
        if deadline.has_passed() or before.voids <= wanted.voids:
            return program
        closed = _close_one(program, made, solid, before, wanted, deadline)
        if closed is None:
            return program
        program = closed
    return program


def _close_one(
    program: Program, made: Manifold, solid: Manifold, before: SolidCensus, wanted: SolidCensus, deadline: Deadline
) -> Program | None:
    """The program with a void less, by the move that leaves it nearest to the target; None where no move closes one."""
    now, least = volume_iou(made, solid), CRUMB * made.volume()
    voids = sorted((body for body in find_pieces(made, least) if body.volume() < 0), key=lambda body: -body.volume())
    for corners, overlap in ((corners_of(void), overlap) for void in voids for overlap in OVERLAPS):
        found: list[tuple[float, Program]] = []
        for move in _moves(program, corners, solid, overlap):
            if deadline.has_passed():
                break
            trial = map_leaves(program, lambda i, leaf, move=move: move_face(leaf, move) if i == move.leaf else leaf)
            out = to_manifold(trial)
            if _is_closer(census_of(out), before, wanted):
                found.append((volume_iou(out, solid), trial))
        iou, closed = max(found, key=lambda pair: pair[0], default=(0.0, None))
        if iou >= now - LOST:
            return closed
    return None


def _is_closer(after: SolidCensus, before: SolidCensus, wanted: SolidCensus) -> bool:
    """Whether a solid has a void less of those that are too many, and is no further from the target in bodies and holes."""
    away = zip(after.kind, before.kind, wanted.kind, strict=True)
    return after.voids < before.voids and all(abs(a - c) <= abs(b - c) for a, b, c in away)


def _moves(program: Program, corners: np.ndarray, solid: Manifold, overlap: float) -> Iterator[FaceMove]:
    """What may close a void: the faces of features beside it that go on past it, and of cuts that end before it, by an `overlap`."""
    low, high = bounds_of(solid)
    size = float(np.linalg.norm(high - low))
    for i, (leaf, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        if np.abs(kernels.program_sdf(leaf, corners)).min() > TOUCH * size:
            continue
        walls = straight_walls(leaf, corners) if leaf.kind == "extrude" else ()
        for face, out in (*((face, heights(leaf, face, corners)) for face in plane_faces(leaf)), *walls):
            near, far = sorted(sign * out[[out.argmin(), out.argmax()]])
            if near <= TOUCH * size < far <= REACH * size:
                yield FaceMove(sign * round_up(far + overlap * size), i, face)
