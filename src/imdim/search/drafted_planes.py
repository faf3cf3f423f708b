"""The plane arrangements behind drafted outlines: planes that lean by one angle to a direction, and cones about it that widen as much.

At one level they are lines and circles, and at any other the same ones moved by their own steps, so that the faces between them are those
of upright walls (`outline_plane`) as long as no wall passes a corner of others. An outline's walls have to lean inward all the same way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.surface import vec
from imdim.program.drafting import foot_of, make_touch, shrink
from imdim.program.outline import Outline, circle_of
from imdim.program.tree import Primitive
from imdim.search.arrangement import Arrangement
from imdim.search.outline_kernels import LEFT, NEITHER, RIGHT
from imdim.search.outline_plane import OutlinePlane, Walls, frame_across, make_plane, window_across

LEAST_DEG, MOST_DEG = 0.2, 30.0  # of a draft: less is an upright wall, more a roof or a chamfer
SAME_DEG = 0.1  # within which two walls lean alike
FEWEST = 3  # walls of an outline
SIDEWAYS = 0.1  # sine between two lines that bound an area


@dataclass(frozen=True)
class Lean:
    """How the walls of a plane arrangement, drawn at a `level` along its normal, go on above: the `steps` [l + c] of lines along their
    normals, and of radii, per unit of height, all of one size, that of the tangent of the draft."""

    level: float
    steps: np.ndarray

    @property
    def tangent(self) -> float:
        """Of the draft."""
        return float(np.abs(self.steps).max())


@dataclass(frozen=True)
class DraftedPlane(OutlinePlane):
    """An arrangement of walls that lean, for outlines of which all move inward on the way up, or on the way down, where it is none that
    `narrows`."""

    lean: Lean = Lean(0.0, np.zeros(0))
    narrows: bool = True

    @property
    def sides(self) -> np.ndarray:
        """What a segment bounds lies where its wall moves to as that narrows; nothing may end at the window."""
        wall = self.segments.wall
        # the side in front of a line is on its left, and so is the inside of a circle, which is left as it shrinks
        to_left = self.lean.steps[np.maximum(wall, 0)] * np.where(wall < len(self.walls.offsets), 1, -1) > 0
        return np.where(wall < 0, NEITHER, np.where(to_left == self.narrows, LEFT, RIGHT)).astype(np.int8)


def find_drafted_planes(arrangement: Arrangement, most: int) -> Iterator[DraftedPlane]:
    """Two about each direction, for solids that narrow upward and for those that widen, and for each angle at which three walls or more, at
    most `most`, lean to it from several sides."""
    for a in range(len(arrangement.directions)):
        for group in _group_leaning(_list_leaning(arrangement, a)):
            if FEWEST <= len(group) <= most and (plane := _make_drafted(arrangement, a, group)) is not None:
                yield plane
                yield replace(plane, narrows=False)


class _Leaning(NamedTuple):
    """A wall that leans by so many degrees, its column in the codes of cells, and the area that shows."""

    degrees: float
    column: tuple[int, int | None]
    shown: float


def _list_leaning(arrangement: Arrangement, a: int) -> list[_Leaning]:
    """The planes that lean to a direction, and the cones about it, the least angle first."""
    along, found = arrangement.directions[a].vector, []
    for b, direction in enumerate(arrangement.directions):
        degrees = math.degrees(math.asin(min(abs(float(direction.vector @ along)), 1.0)))
        if LEAST_DEG <= degrees <= MOST_DEG:
            found += [_Leaning(degrees, (b, k), float(direction.shown[k])) for k in np.flatnonzero(direction.detected).tolist()]
    for c, surface in enumerate(arrangement.curved):
        if surface.kind == "cone" and arrangement.axis_of[c] == a and LEAST_DEG <= math.degrees(surface.sizes[0]) <= MOST_DEG:
            found.append(_Leaning(math.degrees(surface.sizes[0]), (c, None), arrangement.shown[c]))
    return sorted(found, key=lambda wall: wall.degrees)


def _group_leaning(walls: Sequence[_Leaning]) -> Iterator[list[_Leaning]]:
    """Walls of one angle each."""
    starts = [i for i, wall in enumerate(walls) if i == 0 or wall.degrees - walls[i - 1].degrees > SAME_DEG]
    yield from ([*walls[first:last]] for first, last in pairwise([*starts, len(walls)]))


def _make_drafted(arrangement: Arrangement, a: int, group: Sequence[_Leaning]) -> DraftedPlane | None:
    """The arrangement of a group of walls, at the level midway between the faces across them."""
    direction = arrangement.directions[a]
    lines = [wall.column for wall in group if wall.column[1] is not None]
    cones = [wall.column[0] for wall in group if wall.column[1] is None]
    vectors = np.array([arrangement.directions[b].vector for b, _ in lines])
    if not len(lines):  # cones alone are turned drawings
        return None
    frame = frame_across(direction.vector, vectors[0])
    flat, upward = vectors @ frame[:, :2], vectors @ frame[:, 2]
    lengths = np.linalg.norm(flat, axis=1)
    normals = flat / lengths[:, None]
    if not cones and np.abs(normals @ (normals[0, 1], -normals[0, 0])).max() < SIDEWAYS:
        return None
    tangent = math.tan(math.radians(np.average([wall.degrees for wall in group], weights=[wall.shown for wall in group])))
    levels = direction.offsets[direction.detected]
    level = float(levels.min() + levels.max()) / 2 if len(levels) else 0.0
    offsets = np.array([arrangement.directions[b].offsets[k] for b, k in lines])
    surfaces = [arrangement.curved[c] for c in cones]
    ups = np.array([float(np.sign(np.asarray(s.axis) @ frame[:, 2])) for s in surfaces])
    heights = np.array([float(np.asarray(s.point) @ frame[:, 2]) for s in surfaces])
    radii = ups * (level - heights) * np.tan([s.sizes[0] for s in surfaces])
    if (radii <= 0).any():
        return None
    walls = Walls(
        normals,
        (offsets - level * upward) / lengths,
        np.array([np.asarray(s.point) @ frame[:, :2] for s in surfaces]).reshape(-1, 2),
        radii,
        window_across(arrangement.bounds, frame[:, :2]),
        (*lines, *((c, None) for c in cones)),
    )
    plane = make_plane("drafted", a, np.zeros(3), frame, walls)
    if plane is None:
        return None
    lean = Lean(level, np.concatenate([-np.sign(upward), ups]) * tangent)
    return DraftedPlane(**{f.name: getattr(plane, f.name) for f in fields(plane)}, lean=lean)


def draft_leaf(plane: DraftedPlane, outline: Outline, inside: np.ndarray, bottom: float, top: float) -> Primitive:
    """The solid of an outline, that of the faces `inside` [f], between two levels.

    Raises ValueError where its walls lean both ways, or meet between the levels, and for what has no straight wall, or an arc that goes on
    in another one: of the first cones are found as such, and an edit of the second would leave arcs that touch nothing.
    """
    _check_sides(plane, inside)
    _check_arcs(outline)
    foot, way = (bottom, 1) if plane.narrows else (top, -1)
    drawn = shrink(make_touch(foot_of(outline)), plane.lean.tangent * (foot - plane.lean.level) * way)
    u, v, along = plane.frame.T
    frame = plane.frame
    if not plane.narrows:  # upside down, with y the other way
        drawn, frame = drawn.mirror().map_lengths(lambda length: 0.0 - length), np.stack([u, -v, -along], axis=1)
    (left, low), (right, high) = drawn.bounds
    x, y = (left + right) / 2, (low + high) / 2
    center = frame[:, :2] @ np.array([x, y]) + along * (bottom + top) / 2
    size = top - bottom, math.degrees(math.atan(plane.lean.tangent))
    return Primitive("drafted", size, vec(center), euler_from_matrix(frame), drawn.shift(-x, -y))


def _check_arcs(outline: Outline) -> None:
    """Raise ValueError unless all arcs but those of circles lie between two lines, of which there are some."""
    rings = [ring for ring in outline.rings if circle_of(ring) is None]
    bent = [[bool(bulge) for _, _, bulge in ring] for ring in rings]
    if not rings or any(one and other for ring in bent for one, other in zip(ring, [*ring[1:], ring[0]], strict=True)):
        raise ValueError("a drafted outline has lines, and its arcs lie between them")


def _check_sides(plane: DraftedPlane, inside: np.ndarray) -> None:
    """Raise ValueError where a region lies on the wrong side of a wall that bounds it."""
    at, _ = plane.boundary(inside)
    on_left = np.append(inside, False)[plane.segments.faces[at, 0]]
    if (plane.sides[at] != np.where(on_left, LEFT, RIGHT)).any():
        raise ValueError("the walls of a region lean inward and outward")
