"""The conical ends of holes that a search leaves out: the point of a drill and the seat of a countersunk head.

They hold so little of a part that a search which pays for each curve takes the hole without them. Yet the mesh shows them as surfaces
of their own, on the axis of a hole that was found: what is missing is known, and exact volumes say whether it fits. Where a point would be
a feature more, since its hole is a loop of a drawing, it has to be worth that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imdim.geometry.holes import find_holes
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import Patch, vec
from imdim.program.cost import count
from imdim.program.holes import Hole
from imdim.program.outline import Outline, circle_of
from imdim.program.roles import signs
from imdim.program.tree import OPS, Combine, Primitive, Program, Vec3, combine_all, fold, leaves

COAXIAL = 5e-4  # of the part's diagonal, and of a radian: by how much a cone may be off the axis of a hole
MEETS = 0.03  # of a radius, within which the edge of a cone lies on the wall of a hole
NEAR = 0.1  # of the height of a cone, within which it ends at the face that the hole enters
POINTED = 0.2  # of the height of a cone, from its apex, up to which it is seen where it has a point
BEYOND = 1.5  # of a point's height, by which the bottom that was found may be above it


class _Cone(NamedTuple):
    """A hollow cone about the axis of a hole, as depths below its opening; `near` and `far` are where it is seen."""

    apex: float
    slope: float  # radius per depth, signed: negative where it narrows inwards
    near: float
    far: float

    def radius(self, depth: float) -> float:
        return self.slope * (depth - self.apex)


class _Ends(NamedTuple):
    """A turned cutter in place of a wall, by the number of the leaf and the number of its loop (-1 for a cylinder)."""

    leaf: int
    loop: int
    turned: Primitive


def complete_holes(
    program: Program, patches: Sequence[Patch], iou: Callable[[Program], float | None], price: Callable[[Program], float]
) -> Program:
    """The program with the points and seats that cones among `patches` show at its holes, where `iou` with the target is better with them,
    and the `price` of error and length no higher if they make it longer. All is in the unit frame.
    """
    cones = [p for p in patches if p.surface.kind == "cone" and p.outward < 0]
    holes = find_holes(program) if cones else ()
    points = [end for hole in holes for end in _points(hole, program, cones)]
    seats = [seat for hole in holes for seat in _seats(hole, cones)]
    out, best = program, iou(program) if points or seats else None
    if best is None:
        return program
    by_leaf = [[end for end in points if end.leaf == leaf] for leaf in dict.fromkeys(end.leaf for end in points)]
    trials: list[Callable[[Program], Program]] = [lambda p, s=seats: combine_all("difference", [p, *s])] if seats else []
    # a trial of points changes no number of a leaf before it: those of later leaves come first
    trials += [lambda p, e=ends: _with_points(p, e) for ends in sorted(by_leaf, key=lambda ends: -ends[0].leaf)]
    for change in trials:
        trial = change(out)
        fits = iou(trial)
        longer = count(trial).primitives > count(out).primitives
        if fits is not None and fits > best and not (longer and price(trial) > price(out)):
            out, best = trial, fits
    return out


def _cones_of(hole: Hole, patches: Sequence[Patch]) -> Iterator[_Cone]:
    """Cones on the axis of a hole."""
    start, axis = np.array(hole.point), np.array(hole.direction)
    for patch in patches:
        apex, way = np.array(patch.surface.point) - start, float(np.array(patch.surface.axis) @ axis)
        if abs(way) < 1 - COAXIAL or np.linalg.norm(np.cross(apex, axis)) > COAXIAL:
            continue
        reach = (patch.points - patch.surface.point) @ np.array(patch.surface.axis)
        ends = sorted(float(apex @ axis) + math.copysign(r, way) for r in (reach.min(), reach.max()))
        yield _Cone(float(apex @ axis), math.copysign(math.tan(patch.surface.sizes[0]), way), *ends)


def _points(hole: Hole, program: Program, patches: Sequence[Patch]) -> Iterator[_Ends]:
    """The wall of a hole with a flat bottom, with the point that a cone shows below it."""
    last = hole.sections[-1]
    number, *others = last.leaves
    if hole.through or last.is_cone or last.corners or others or signs(program)[number] > 0:
        return
    for cone in _cones_of(hole, patches):
        height = cone.far - cone.near
        is_point = cone.slope < 0 and cone.apex - cone.far <= POINTED * height and _meets(cone, cone.near, last.diameter)
        if is_point and -NEAR * height <= cone.apex - hole.depth <= BEYOND * height:
            yield from _turned(hole, cone, list(leaves(program))[number], number)
            return


def _turned(hole: Hole, cone: _Cone, leaf: Primitive, number: int) -> Iterator[_Ends]:
    """A cutter with the radius and the upper end of the leaf's wall, and the cone below."""
    turn = matrix_from_euler(leaf.rotation)
    for loop, x, y, radius in _circles(leaf):
        center = np.array(leaf.center) + turn[:, 0] * x + turn[:, 1] * y
        if np.linalg.norm(np.cross(center - hole.point, hole.direction)) > COAXIAL or not _meets(cone, cone.near, 2 * radius):
            continue
        down = 1.0 if turn[:, 2] @ np.array(hole.direction) > 0 else -1.0
        top = float((center - hole.point) @ np.array(hole.direction)) - leaf.size[-1] / 2
        half, bottom = (cone.apex - top) / 2, cone.apex + radius / cone.slope
        levels = [half, bottom - top - half, -half, -half]
        profile = tuple((r, down * z, 0.0) for r, z in zip((0.0, radius, radius, 0.0), levels, strict=True))
        middle = center + ((top + half) - float((center - hole.point) @ np.array(hole.direction))) * np.array(hole.direction)
        yield _Ends(number, loop, Primitive("revolve", (360.0,), vec(middle), leaf.rotation, Outline((profile,))))
        return


def _circles(leaf: Primitive) -> Iterator[tuple[int, float, float, float]]:
    """Number, place and radius of the circles along a leaf."""
    if leaf.kind == "cylinder":
        yield -1, 0.0, 0.0, leaf.size[0]
    elif leaf.kind == "extrude" and leaf.outline is not None:
        for i, loop in enumerate(leaf.outline.loops):
            if (circle := circle_of(loop)) is not None:
                yield i, *circle


def _with_points(program: Program, ends: Sequence[_Ends]) -> Program:
    """The program with turned cutters in place of what they are of a leaf."""

    def change(number: int, leaf: Primitive) -> Program:
        own = [end for end in ends if end.leaf == number]
        if not own:
            return leaf
        turned: list[Program] = [end.turned for end in own]
        loops = () if leaf.outline is None else tuple(c for i, c in enumerate(leaf.outline.loops) if i not in {end.loop for end in own})
        kept: list[Program] = [replace(leaf, outline=Outline(loops))] if loops else []
        return combine_all("union", [*kept, *turned])

    return fold(program, change, {op: (lambda a, b, op=op: Combine(op, a, b)) for op in OPS})  # type: ignore[arg-type, return-value]


def _seats(hole: Hole, patches: Sequence[Patch]) -> Iterator[Primitive]:
    """Cutters for cones that widen an opening of a hole to its face."""
    entry, last = hole.sections[0], hole.sections[-1]
    for cone in _cones_of(hole, patches):
        slack = NEAR * (cone.far - cone.near)
        inwards = cone.slope < 0 and abs(cone.near) <= slack and not entry.is_cone and _meets(cone, cone.far, entry.diameter)
        outwards = cone.slope > 0 and abs(cone.far - hole.depth) <= slack and not last.is_cone and _meets(cone, cone.near, last.diameter)
        if inwards or (outwards and hole.through):
            near, far = (0.0, cone.far) if inwards else (cone.near, hole.depth)
            radii = (cone.radius(near), cone.radius(far))
            center = np.array(hole.point) + (near + far) / 2 * np.array(hole.direction)
            yield Primitive("cone", (*radii, far - near), vec(center), _euler_to(hole.direction))


def _meets(cone: _Cone, depth: float, diameter: float) -> bool:
    return abs(2 * cone.radius(depth) - diameter) <= MEETS * diameter


def _euler_to(direction: Vec3) -> Vec3:
    """Degrees that turn z to a direction."""
    x, y, z = direction
    return 0.0, math.degrees(math.atan2(math.hypot(x, y), z)), math.degrees(math.atan2(y, x)) if math.hypot(x, y) > 1e-9 else 0.0
