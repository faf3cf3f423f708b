"""Tabs, ribs and spokes that stand on a round wall begin at a diameter of it.

A search ends such a box where its edges meet the wall, at sqrt(r^2 - (w / 2)^2): a number that nobody typed, which goes wrong with the
first edit of the radius or the width. People draw it from a wall farther in, the bore of the tube it stands on, or from the axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.active_zone import change_with, probes
from imdim.geometry.finish.extend import Face, between, length, plane_faces
from imdim.geometry.finish.tolerances import ALIGNED
from imdim.geometry.lowering import lower
from imdim.geometry.solid import SEGMENTS, exact_rotation
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, longest, replace_leaves

MET = 1e-5  # of the largest size, within which edges end on a wall, and sizes are one
SAGITTA = 1 - math.cos(math.pi / SEGMENTS)  # of a radius, by which facets lie within a round wall
SQUARE = 1e-6  # the cosine between two directions that are square to each other
ACROSS = {0: (1, 2), 1: (0, 2), 2: (0, 1)}


class _Axis(NamedTuple):
    """An axis in the world, and the radii of the round walls about it, outermost first."""

    point: np.ndarray
    direction: np.ndarray
    radii: tuple[float, ...]


class _Foot(NamedTuple):
    """A face of leaf number `leaf` whose edges meet a wall of a `radius`, and how far it may go on, nearest first."""

    leaf: int
    face: Face
    radius: float
    further: tuple[float, ...]


def begin_in_round_walls(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid, whose added boxes that end where their edges meet a round wall go on to the next one within, else to its axis.

    Those of one size move together or not at all. Past the `deadline` (by default never) the others stay.
    """
    parts = list(leaves(program))
    slack = MET * longest(parts)
    axes, rows = _axes(parts, slack), dict[tuple[float, ...], list[_Foot]]()
    for i, (part, sign) in enumerate(zip(parts, signs(program), strict=True)):
        for face in plane_faces(part) if sign > 0 and part.kind == "box" else ():
            if (foot := _foot(i, part, face, axes, slack)) is not None:
                alike = (foot.radius, length(part, face), *sorted(part.size), *foot.further)
                rows.setdefault(tuple(round(v / slack / 10) for v in alike), []).append(foot)
    for row in rows.values():
        for rank in range(len(row[0].further)):
            if deadline.has_passed():
                return program
            if all(_is_hidden(program, foot, foot.further[rank]) for foot in row):
                longer = {foot.leaf: _reach(program, foot, foot.further[rank]) for foot in row}
                program = replace_leaves(program, longer)
                break
    return program


def _reach(program: Program, foot: _Foot, further: float) -> Primitive:
    """The foot's leaf, `further` on."""
    part = list(leaves(program))[foot.leaf]
    return between(part, foot.face, -length(part, foot.face), further)


def _is_hidden(program: Program, foot: _Foot, further: float) -> bool:
    """Whether nothing is seen of how a foot goes on, but for what facets of its wall let through."""
    part = list(leaves(program))[foot.leaf]
    if not kernels.inside(lower(program), probes(between(part, foot.face, 0.0, further))).all():
        return False
    section = math.prod(part.size) / length(part, foot.face)
    return change_with(program, foot.leaf, _reach(program, foot, further)) <= SAGITTA * foot.radius * section


def _axes(parts: list[Primitive], slack: float) -> list[_Axis]:
    """The axes of cylinders and turned drawings, one for those that share it."""
    out: list[_Axis] = []
    for part in parts:
        radii = set(_radii(part))
        direction, point = exact_rotation(part)[:, 2], np.array(part.center)
        same = next((k for k, axis in enumerate(out) if radii and _is_one(axis, point, direction, slack)), None)
        if same is not None:
            out[same] = out[same]._replace(radii=tuple(sorted({*out[same].radii, *radii}, reverse=True)))
        elif radii:
            out.append(_Axis(point, direction, tuple(sorted(radii, reverse=True))))
    return out


def _radii(part: Primitive) -> Iterator[float]:
    """The radii of a part's walls along its own z axis."""
    if part.kind == "cylinder":
        yield part.size[0]
    if part.kind == "revolve" and part.outline is not None:
        for ring in part.outline.rings:
            for (x, _, bulge), (following, _, _) in zip(ring, (*ring[1:], ring[0]), strict=True):
                if x == following and x > 0 and not bulge:
                    yield x


def _is_one(axis: _Axis, point: np.ndarray, direction: np.ndarray, slack: float) -> bool:
    """Whether a line is an axis, either way."""
    return bool(abs(axis.direction @ direction) > 1 - ALIGNED and np.linalg.norm(np.cross(point - axis.point, axis.direction)) <= slack)


def _foot(number: int, part: Primitive, face: Face, axes: list[_Axis], slack: float) -> _Foot | None:
    """A face of a part as a foot; None where its edges do not lie on a round wall that it looks across."""
    frame = exact_rotation(part)
    outward = frame[:, face[0]] * face[1]
    end = np.array(part.center) + outward * length(part, face) / 2
    for axis in axes:
        off = axis.point - end
        off = off - axis.direction * (off @ axis.direction)
        depth = float(off @ outward)
        if abs(axis.direction @ outward) > SQUARE or depth <= slack or np.linalg.norm(off - depth * outward) > slack:
            continue
        half = [part.size[a] / 2 for a in ACROSS[face[0]] if abs(frame[:, a] @ axis.direction) <= SQUARE]
        met = [radius for radius in axis.radii if half and abs(math.hypot(depth, half[0]) - radius) <= slack]
        if met:
            return _Foot(number, face, met[0], tuple(depth - radius for radius in (*axis.radii, 0.0) if radius < depth - slack))
    return None
