"""Teeth of rims are set aside before the search, and put on its program as one drawn tooth each, repeated on a circle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.detection.facets import facets_of
from imdim.detection.toothed_rims import ToothedRim, find_toothed_rims, place_loop, take_off_teeth
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.solid import to_trimesh
from imdim.numbers.design_values import round_to_grid
from imdim.numbers.outline_coordinates import center_leaf
from imdim.program.outline import Outline, circle_of
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Program, combine_all, leaves
from imdim.reconstruction.observation import find_solid
from imdim.target.target import Target, with_mesh

SUNK = (0.1, 0.02, 0.004)  # of the radius of a rim, by which teeth begin within the disc: the most that fills no hole
STEEP = 0.6  # cosine between the end of a flank and the way to the axis
FILLED = 1e-5  # of the volume of the teeth, that they may fill beside themselves
FINE = 2e-5  # of the radius: numbers of a tooth are rounded to the next finer power of ten
ONE_AXIS = 1e-3  # of the radius, by which the axis of the teeth may be off that of a part, which is theirs then
ONE_LEVEL = 1e-4  # of it, likewise for their ends
PARALLEL = 1 - 1e-9


class Untoothed(NamedTuple):
    """A target without teeth, and the rims that had them, in its units."""

    target: Target
    rims: tuple[ToothedRim, ...] = ()


def set_teeth_aside(target: Target) -> Untoothed:
    """The target without the teeth of its rims; a cloud, or a mesh that bounds no solid, as it is."""
    solid = plain = find_solid(target) if target.is_solid else None
    if target.mesh is None or solid is None or plain is None:
        return Untoothed(target)
    rims: list[ToothedRim] = []
    for rim in find_toothed_rims(facets_of(target.mesh), solid):
        less = take_off_teeth(plain, rim)
        if less is not None:
            plain, rims = less, [*rims, _begin_within(rim, solid)]
    return Untoothed(with_mesh(target, to_trimesh(plain)), tuple(rims)) if rims else Untoothed(target)


def put_teeth_on(program: Program, rims: tuple[ToothedRim, ...]) -> Program:
    """The program with the teeth of rims, about the axes and between the levels that its parts have there."""
    parts = [*leaves(program)]
    return combine_all("union", [program, *(tooth for rim in rims for tooth in _draw(rim, parts))])


def _begin_within(rim: ToothedRim, solid: Manifold) -> ToothedRim:
    """The rim, its teeth closed by a line within the disc."""
    own = place_loop(rim, rim.tooth).volume()
    deeper = (rim._replace(tooth=_go_on(rim, share * rim.radius)) for share in SUNK)
    return next((d for d in deeper if (place_loop(d, d.tooth) - solid).volume() <= FILLED * own), rim)


def _go_on(rim: ToothedRim, depth: float) -> np.ndarray:
    """The tooth [c, 2] with flanks that go on straight to about a `depth` within the disc, and end at a round number: with a corner on the
    root circle a wall would all but touch another. Flanks that end along that circle get a corner there all the same, from which they go on
    towards the axis."""
    tooth = rim.tooth
    within = -tooth / np.linalg.norm(tooth, axis=1)[:, None] * (1 if rim.outward else -1)
    ends: list[list[np.ndarray]] = []
    step = 0.5 * 10.0 ** math.floor(math.log10(depth))
    for at, beside in ((0, 1), (-1, -2)):
        flank = (tooth[at] - tooth[beside]) / np.linalg.norm(tooth[at] - tooth[beside])
        steep = float(flank @ within[at])
        end = tooth[at] + flank * depth / max(steep, STEEP)
        if steep > STEEP:
            end += flank * (round_to_grid(float(end[0]), step) - end[0]) / flank[0]
        goes_on = steep > STEEP and end[1] * tooth[at, 1] > 0
        ends.append([end] if goes_on else [tooth[at] + depth * within[at], tooth[at]])
    return np.array([*ends[0], *tooth[1:-1], *ends[1][::-1]])


def _draw(rim: ToothedRim, parts: list[Primitive]) -> Iterator[Primitive]:
    """The teeth."""
    axis = rim.frame[:, 2]
    parallel = [p for p in parts if abs(float(np.dot(axes(p)[2], axis))) > PARALLEL]
    point = min(_middles(parallel), key=lambda q: _apart(q, rim), default=rim.point)
    point = point if _apart(point, rim) < ONE_AXIS * rim.radius else rim.point
    ends = [
        float((np.array(p.center) - rim.point) @ axis) + way * p.size[-1] / 2 for p in parallel for way in (-1, 1) if p.kind != "revolve"
    ]
    low, high = (min(ends, key=lambda end, z=z: abs(end - z), default=z) for z in (rim.low, rim.high))
    low, high = (end if abs(end - z) < ONE_LEVEL * rim.radius else z for end, z in ((low, rim.low), (high, rim.high)))
    step = 10.0 ** math.floor(math.log10(FINE * rim.radius))
    loop = tuple((round_to_grid(x, step), round_to_grid(y, step), 0.0) for x, y in rim.tooth.tolist())
    middle = point + ((low + high) / 2 + (rim.point - point) @ axis) * axis
    height = round_to_grid(high - low, step)
    for place in rim.places:
        angle = 2 * math.pi * place / rim.count
        c, s = math.cos(angle), math.sin(angle)
        turns = euler_from_matrix(rim.frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
        x, y, z = (round_to_grid(v, step) for v in middle.tolist())
        yield center_leaf(Primitive("extrude", (height,), (x, y, z), turns, Outline((loop,))))


def _middles(parts: list[Primitive]) -> Iterator[np.ndarray]:
    """Points of the axes that parts are round about."""
    for part in parts:
        if part.kind in ("cylinder", "cone", "torus", "revolve"):
            yield np.array(part.center)
        elif part.outline is not None:
            x, y, _ = axes(part)
            circles = (circle_of(loop) for loop in part.outline.loops)
            yield from (np.array(part.center) + c[0] * np.array(x) + c[1] * np.array(y) for c in circles if c is not None)


def _apart(point: np.ndarray, rim: ToothedRim) -> float:
    """How far a point lies from the axis of a rim."""
    arm = point - rim.point
    return float(np.linalg.norm(arm - (arm @ rim.frame[:, 2]) * rim.frame[:, 2]))
