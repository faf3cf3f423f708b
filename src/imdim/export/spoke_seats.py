"""Bosses in a circle that lie along its spokes, and the bores through them: the bores stay where the bosses are, and as long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.outline_joints import Row
from imdim.export.outline_walls import EXACT
from imdim.export.seats import ALIGNED, world_axis
from imdim.export.seen import FACING
from imdim.export.seen_walls import TRACE, surface_of
from imdim.geometry.solid import exact_rotation
from imdim.geometry.surface import unit
from imdim.program.repeats import Folded, repeats, size
from imdim.program.roles import signs
from imdim.program.tree import FLAT_ENDS, Primitive, Program, leaves

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem


class _Spokes(NamedTuple):
    """Equal parts whose axes are the spokes of a circle: the first leaf, its spoke, a point and a unit vector that looks outwards [3], from
    where to where it goes along that, the variables of the circle's diameter and of its height, and the centres [n, 3] of all."""

    leaf: int
    hub: np.ndarray
    outwards: np.ndarray
    low: float
    high: float
    circle: int
    height: int
    centers: np.ndarray

    def goes_through(self, other: _Spokes, slack: float) -> bool:
        """Whether all parts have the spokes of another circle's, and go at least from end to end of those."""
        if len(self.centers) != len(other.centers) or np.abs(self.hub - other.hub).max() > slack:
            return False
        mine, its = (unit(spokes.centers - self.hub) for spokes in (self, other))
        are_shared = (mine @ its.T).max(1).min() > 1 - ALIGNED
        return bool(are_shared and self.low < other.low + slack and self.high > other.high - slack)

    def shows_end(self, program: Program, slack: float) -> bool:
        """Whether one of the ends of the first part is seen on the solid."""
        surface, owners = surface_of(program)
        off = (surface.triangles_center - self.hub) @ self.outwards
        is_level = (np.abs(off - self.low) <= slack) | (np.abs(off - self.high) <= slack)
        faces = (owners == self.leaf) & is_level & (np.abs(surface.face_normals @ self.outwards) > FACING)
        return bool(surface.area_faces[faces].sum() > TRACE * surface.area)


def bind_bores(system: LinearSystem, program: Program, folded: Folded) -> Iterator[Row]:
    """Of each circle of cuts that go all the way through a circle of bosses, of which no end is seen: both circles and both heights differ
    by what they differ by now."""
    parts, sign, slack = list(leaves(program)), signs(program), EXACT * system.length
    found = list(_list_spokes(system, parts, folded))
    for bore, boss in product((s for s in found if sign[s.leaf] < 0), (s for s in found if sign[s.leaf] > 0)):
        if bore.goes_through(boss, slack) and not bore.shows_end(program, slack):
            system.followers |= {bore.circle, bore.height}
            yield {bore.circle: 1.0, boss.circle: -1.0}
            yield {bore.height: 1.0, boss.height: -1.0}


def _list_spokes(system: LinearSystem, parts: Sequence[Primitive], folded: Folded) -> Iterator[_Spokes]:
    circles = {leaf: v for v, (leaf, word) in enumerate(system.extras, system.extra) if word == "circle"}
    for first, repeat in repeats(folded):
        axis, part = world_axis(np.array(repeat.axis)), parts[first]
        column = FLAT_ENDS.get(part.kind, {}).get(2)
        height = system.heights.get(first) if column is None else 6 * first + column
        if repeat.kind != "circular" or size(repeat.part) > 1 or axis is None or first not in circles or height is None:
            continue
        hub = np.array(repeat.point)
        hub[axis] = part.center[axis]
        away = np.subtract(part.center, hub)
        reach = float(np.linalg.norm(away))
        if abs(away @ exact_rotation(part)[:, 2]) < (1 - ALIGNED) * reach:
            continue
        half = system.start[height] / 2
        centers = np.array([p.center for p in parts[first : first + repeat.number]])
        yield _Spokes(first, hub, away / reach, reach - half, reach + half, circles[first], height, centers)
