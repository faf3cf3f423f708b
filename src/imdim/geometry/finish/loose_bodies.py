"""Bodies that a program has and its target has not: crumbs that cuts leave, and parts that miss each other by a hair.

A crumb is what one feature adds and the cuts about it do not quite take: one of these goes on past it, or the feature ends before it; a
feature that is all crumb goes. Parts that miss each other are joined: a feature of one of them goes on into the other, or a cut between
them ends earlier. One plane face or straight wall is moved each time, by as little as does it, and exact booleans over the whole solid
decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.census import SolidCensus, census_of, find_pieces
from imdim.geometry.finish.cutter_walls import redraw_loop, straighten_run
from imdim.geometry.finish.extend import Face, between, length, plane_faces
from imdim.geometry.finish.tolerances import TOUCH
from imdim.geometry.solid import (
    CRUMB,
    bounds_of,
    corners_of,
    exact_rotation,
    join_touching,
    symmetric_difference_volume,
    to_manifold,
    volume_iou,
)
from imdim.program.ellipse import Ellipse
from imdim.program.outline import arc_center, arc_radius, orient_loops, ring_curves
from imdim.program.paths import leaf_paths, without
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, map_leaves

REACH = 2e-2  # of it, that a face moves by at most
GAP = 1e-3  # of it: bodies further apart are not joined
OVERLAPS = 1e-4, 1e-5  # of it, by which bodies are joined at least: files and relations move faces by less, but a wide face may bear little
LOST = 3e-4  # of the volume IoU, that it may cost: a whole face may have to move
FACETED = 1e-2  # of a body's own diagonal, that its corners may lie off the feature that it is
MOST = 8  # bodies that are mended
BESIDE = 0.05  # of a round wall's chord, from either end, where its middle would have to move far
CHORDS = 6e-4  # of a radius, by which facets miss it


class DrawnWall(NamedTuple):
    """A wall of a drawing: its loop, and its curve there, of those that `orient_loops` gives."""

    loop: int
    curve: int


class FaceMove(NamedTuple):
    """Of one face or wall of the leaf with a number, outward by `by`; of a round wall it is its middle that moves, not its ends."""

    by: float
    leaf: int
    face: Face | DrawnWall


def join_bodies(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` with no more bodies than its target `solid` has, as far as a move of one face for each mends that.

    Both are in one frame. No hole or void comes or goes that the target has not, and the IoU with it stays. Past the `deadline` (by default
    never) the other bodies stay.
    """
    wanted = census_of(solid)
    for _ in range(MOST):
        if deadline.has_passed():
            return program
        # faces may part by their last digits, or lap over, which is gone on the grid of files
        found = max((_MadeSolid.of(program, make) for make in (to_manifold, join_touching)), key=lambda made: made.census.bodies)
        if found.census.bodies <= wanted.bodies:
            return program
        mended = _mend(program, found, solid, wanted, deadline)
        if mended is None:
            return program
        program = mended
    return program


class _MadeSolid(NamedTuple):
    """The solid of a program, by which of two ways to `make` one."""

    made: Manifold
    census: SolidCensus
    make: Callable[[Program], Manifold]

    @classmethod
    def of(cls, program: Program, make: Callable[[Program], Manifold]) -> _MadeSolid:
        made = make(program)
        return cls(made, census_of(made), make)


def _mend(program: Program, found: _MadeSolid, solid: Manifold, wanted: SolidCensus, deadline: Deadline) -> Program | None:
    """The program with one body less; None where no move does that."""
    made, before, make = found
    pieces = find_pieces(made, CRUMB * made.volume())
    *loose, main = sorted((body for body in pieces if body.volume() > 0), key=lambda body: body.volume())
    now: float | None = None
    for trial in (trial for body in loose for trial in _trials(program, body, main, solid)):
        if deadline.has_passed():
            return None
        out = make(trial)
        if (holes := _lost_holes(before, census_of(out), wanted)) is None:
            continue
        # no IoU changes by more than twice the volume that comes and goes; that with the target, of many facets, takes longest
        if not holes and symmetric_difference_volume(made, out) <= LOST / 2 * made.volume():
            return trial
        now = volume_iou(made, solid) if now is None else now
        # what brings the solid nearer to the target belongs there, and a hole that ends with it came by what parted the bodies
        if (gain := volume_iou(out, solid) - now) >= -LOST and (not holes or gain > 0):
            return trial
    return None


def _trials(program: Program, body: Manifold, main: Manifold, solid: Manifold) -> Iterator[Program]:
    """The program without a feature that is all of a loose body, or with one face moved, by little first."""
    if not _is_part(body, solid):
        yield from filter(None, (without(program, [path]) for path, leaf in leaf_paths(program) if _is_all_of(leaf, body)))
    moves = dict.fromkeys(
        move for overlap in OVERLAPS for move in sorted(_moves(program, body, main, solid, overlap), key=lambda move: abs(move.by))
    )
    # a level is one number, and a wall is two corners
    for move in sorted(moves, key=lambda move: isinstance(move.face, DrawnWall)):
        yield map_leaves(program, lambda i, leaf, move=move: move_face(leaf, move) if i == move.leaf else leaf)


def _is_part(body: Manifold, solid: Manifold) -> bool:
    """Whether a body is the target's."""
    return (body ^ solid).volume() > body.volume() / 2


def _is_all_of(leaf: Primitive, body: Manifold) -> bool:
    """Whether a body ends where a feature does, all around."""
    corners = corners_of(body)
    return float(np.abs(kernels.program_sdf(leaf, corners)).max()) <= FACETED * float(np.linalg.norm(np.ptp(corners, axis=0)))


def _lost_holes(before: SolidCensus, after: SolidCensus, wanted: SolidCensus) -> int | None:
    """How many holes of the target go where bodies are joined; None where no body goes, or holes and voids are further from those of the
    target. Bodies that are joined at two places have a hole more between them."""
    joined, more = before.bodies - after.bodies, after.through - wanted.through
    if joined <= 0 or abs(after.voids - wanted.voids) > abs(before.voids - wanted.voids):
        return None
    if abs(more) <= abs(before.through - wanted.through) or 0 < more <= joined:
        return 0
    return -more if -joined <= more < 0 else None


def _moves(program: Program, body: Manifold, main: Manifold, solid: Manifold, overlap: float) -> Iterator[FaceMove]:
    """What may take a loose body away or, if it is the target's, join it to the `main` one."""
    low, high = bounds_of(solid)
    size, corners = float(np.linalg.norm(high - low)), corners_of(body)
    is_part = _is_part(body, solid)
    gap = body.min_gap(main, GAP * size) if is_part else 0.0
    if gap >= GAP * size:
        return
    near_main = corners_of(main)
    reach = gap + TOUCH * size
    beside = ((near_main >= corners.min(0) - reach) & (near_main <= corners.max(0) + reach)).all(axis=1)
    # where bodies meet, the corners may be those of either
    corners = np.vstack([corners, near_main[beside]]) if is_part else corners
    join = round_up(gap + overlap * size)
    for i, (leaf, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        if np.abs(kernels.program_sdf(leaf, corners)).min() > reach:
            continue
        faces: list[tuple[Face | DrawnWall, np.ndarray]] = [(face, heights(leaf, face, corners)) for face in plane_faces(leaf)]
        walls = list(straight_walls(leaf, corners)) if leaf.kind == "extrude" else []
        if is_part:
            ends = ((face, np.array([out.min(), out.max()])) for face, out in faces)
            yield from (FaceMove(sign * join, i, face) for face, out in ends if np.abs(out).min() <= reach)
            yield from (FaceMove(join, i, wall) for wall, out in walls if sign > 0 and np.abs(out).min() <= reach)
            continue
        bent_walls = _BENT_WALLS[leaf.kind](leaf, corners) if leaf.kind in _BENT_WALLS else ()
        for face, out in (*faces, *walls, *bent_walls):
            near, far = (out.min(), out.max()) if sign < 0 else (out.max(), out.min())
            # past a cut, or behind the end of what it is of
            if abs(near) <= TOUCH * size < abs(far) <= REACH * size:
                yield FaceMove(-sign * round_up(abs(far) + TOUCH * size), i, face)


def straight_walls(leaf: Primitive, points: np.ndarray) -> Iterator[tuple[DrawnWall, np.ndarray]]:
    """The straight walls of an extrusion, and how far points [n, 3] are outward of each."""
    assert leaf.outline is not None
    flat = ((points - leaf.center) @ exact_rotation(leaf))[:, :2]
    for k, ring in enumerate(orient_loops(leaf.outline.loops)):
        for j, (x, y, u, v, bulge) in enumerate([] if isinstance(ring, Ellipse) else ring_curves(ring)):
            if not bulge:
                yield DrawnWall(k, j), (flat - (x, y)) @ (v - y, x - u) / math.hypot(u - x, v - y)


def _round_walls(leaf: Primitive, points: np.ndarray) -> Iterator[tuple[DrawnWall, np.ndarray]]:
    """The round walls of an extrusion that all points [n, 3] lie beside, away from its ends, and how far out of each its middle has to
    move for it to reach them; nothing for those that lie on it, but for facets."""
    assert leaf.outline is not None
    flat = ((points - leaf.center) @ exact_rotation(leaf))[:, :2]
    for k, ring in enumerate(orient_loops(leaf.outline.loops)):
        for j, curve in enumerate([] if isinstance(ring, Ellipse) else ring_curves(ring)):
            x, y, u, v, bulge = curve
            if not 0 < abs(bulge) <= 1:
                continue
            chord, radius = np.array([u - x, v - y]), arc_radius(curve)
            share = (flat - (x, y)) @ chord / (chord @ chord)
            if ((share > BESIDE) & (share < 1 - BESIDE)).all():
                out = math.copysign(1.0, bulge) * (np.linalg.norm(flat - arc_center(curve), axis=1) - radius)
                facets = CHORDS * radius
                inside = np.where(out >= -facets, 0.0, out)
                yield DrawnWall(k, j), np.where(out > TOUCH * radius, out + facets, inside) / (4 * share * (1 - share))


def _turned_walls(leaf: Primitive, points: np.ndarray) -> Iterator[tuple[DrawnWall, np.ndarray]]:
    """The straight walls of a turned drawing, and how far points [n, 3] are outward of each; nothing for those that lie on it, but for
    facets."""
    assert leaf.outline is not None
    local = (points - leaf.center) @ exact_rotation(leaf)
    away = np.hypot(local[:, 0], local[:, 1])
    facets = CHORDS * float(away.max())
    for k, ring in enumerate(orient_loops(leaf.outline.loops)):
        for j, (x, y, u, v, bulge) in enumerate([] if isinstance(ring, Ellipse) else ring_curves(ring)):
            if not bulge:
                out = (np.column_stack([away, local[:, 2]]) - (x, y)) @ (v - y, x - u) / math.hypot(u - x, v - y)
                yield DrawnWall(k, j), np.where(np.abs(out) <= facets, 0.0, out + facets)


_BENT_WALLS: Mapping[str, Callable[[Primitive, np.ndarray], Iterator[tuple[DrawnWall, np.ndarray]]]] = {
    "extrude": _round_walls,
    "revolve": _turned_walls,
}


def move_face(leaf: Primitive, move: FaceMove) -> Primitive:
    if isinstance(move.face, DrawnWall):
        return _widened(leaf, move.face, move.by)
    whole = length(leaf, move.face)
    return between(leaf, move.face, -whole, move.by) if move.by > -whole else leaf


def _widened(leaf: Primitive, wall: DrawnWall, by: float) -> Primitive:
    """With a wall further out; the leaf itself where its outline allows that not."""
    assert leaf.outline is not None
    ring = orient_loops(leaf.outline.loops)[wall.loop]
    assert not isinstance(ring, Ellipse)
    x, y, u, v, bulge = ring_curves(ring)[wall.curve]
    if bulge:
        rounder = (x, y, bulge + 2 * by / math.hypot(u - x, v - y))
        return redraw_loop(leaf, wall.loop, (*ring[: wall.curve], rounder, *ring[wall.curve + 1 :])) or leaf
    wider = straighten_run(ring, wall.curve, 1, by)
    return (redraw_loop(leaf, wall.loop, wider) if wider else None) or leaf


def heights(leaf: Primitive, face: Face, points: np.ndarray) -> np.ndarray:
    """How far points [n, 3] are outward of a face."""
    axis, side = face
    return (points - leaf.center) @ exact_rotation(leaf)[:, axis] * side - length(leaf, face) / 2


def round_up(value: float) -> float:
    """To one digit, for moves are added to numbers that people read."""
    grid = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / grid) * grid
