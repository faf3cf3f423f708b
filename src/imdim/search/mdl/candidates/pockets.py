"""The holes of drawings as cuts: pockets in a row, compartments, and holes through a part that another drawing shows better.

What is drawn from above has holes where pockets are, but its walls seldom run from end to end of what they are in. Each set of holes of
one drawing is offered as one cut, its pockets alike where they nearly are, between the ends at which its walls and floors have the most
points of the cloud and the least room without.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.geometry.surface_map import surface_area
from imdim.numbers.ties import tie_alike
from imdim.program.tree import Primitive, Program, combine_all, leaves
from imdim.search.mdl.candidates.drawn import holes_of
from imdim.search.mdl.description_length import PARALLEL_DEG
from imdim.search.mdl.primitive_selection import Cloud

BAND = 1.5  # deviations of the noise, within which a face has its points
KEPT = 0.73  # of a normal distribution within one BAND more than twice what is in the next one on one side
OUTERMOST = (0.01, 0.99)  # quantiles of coordinates, beyond which points may be strays
OUT = 4.0  # deviations of the noise by which an open end leaves the part
MOST_DRAWINGS = 4
MOST_HOLES = 24  # of one drawing
ALIKE = 2.0  # deviations of the noise by which pockets differ that may be copies


def pockets(drawn: Sequence[Primitive], cloud: Cloud) -> list[Program]:
    """The holes of the extrusions among what is `drawn` as cuts, those first that the most points bear out: all of a drawing together, and
    each of the best drawing's alone."""
    sections: dict[tuple[object, ...], list[Primitive]] = {}
    for leaf in drawn:
        if leaf.kind == "extrude" and leaf.outline is not None and len(leaf.outline.loops) > 1:
            sections.setdefault((leaf.rotation, leaf.outline), []).append(leaf)
    found = sorted(filter(None, (_cut_holes(same, cloud) for same in sections.values())), key=lambda each: -each[0])
    together = (tie_alike(combine_all("union", list(cuts)), ALIKE * cloud.noise, PARALLEL_DEG) for _, cuts in found[:MOST_DRAWINGS])
    out = list[Program](dict.fromkeys(together))
    alone = [*leaves(out[0])] if out else []
    return [*out, *(alone if len(alone) > 1 else [])]


def _cut_holes(same: Sequence[Primitive], cloud: Cloud) -> tuple[float, list[Primitive]] | None:
    """Those holes of extrusions of the `same` drawing that points bear out, between the ends between which they do so the most, and by how
    many points; None where there are none."""
    holes = holes_of(same[0], 0.0)
    if not 0 < len(holes) <= MOST_HOLES:
        return None
    axis = matrix_from_euler(same[0].rotation)[:, 2]
    height = cloud.points @ axis
    low, high = (float(end) for end in np.quantile(height, OUTERMOST))
    levels = [(float(np.dot(leaf.center, axis)), leaf.size[0] / 2) for leaf in same]
    bottoms = dict.fromkeys([low - OUT * cloud.noise, *(middle - half for middle, half in levels)])
    tops = dict.fromkeys([high + OUT * cloud.noise, *(middle + half for middle, half in levels)])
    walls = [_Walls.of(hole, height, cloud) for hole in holes]
    best = 0.0, list[Primitive]()
    for bottom, top in ((bottom, top) for bottom in bottoms for top in tops if top > bottom):
        worth = [own.worth(bottom, top, (low, high)) for own in walls]
        total = sum(max(each, 0.0) for each in worth)
        if total > best[0]:
            best = total, [_between(hole, axis, bottom, top) for hole, each in zip(holes, worth, strict=True) if each > 0]
    return best if best[1] else None


@dataclass(frozen=True)
class _Walls:
    """Of a hole without ends how far its points lie from its wall, outwards, and how high, [n]; points for each unit of length along its
    walls and height, and for all of a floor; the deviation of the noise."""

    off: np.ndarray
    height: np.ndarray
    along: float
    floor: float
    sigma: float

    @staticmethod
    def of(hole: Primitive, height: np.ndarray, cloud: Cloud) -> _Walls:
        flat, tall = (surface_area(hole.kind, _as_long(hole, length), hole.outline) for length in (1e-9, 1.0))
        endless = replace(hole, size=_as_long(hole, 10 * cloud.diagonal))
        dense = cloud.spacing**-2
        return _Walls(kernels.program_sdf(endless, cloud.points), height, (tall - flat) * dense, flat / 2 * dense, cloud.noise)

    def worth(self, bottom: float, top: float, ends: tuple[float, float]) -> float:
        """How many more points its faces have between two heights than would be missing; a floor beyond the `ends` of the cloud is none."""
        low, high = max(bottom, ends[0]), min(top, ends[1])
        if high <= low:
            return 0.0
        beside = self.off[(self.height > low) & (self.height < high)]
        seen, meant = self._stand_out(beside), self.along * (high - low)
        within = self.height[self.off < -BAND * self.sigma]
        for floor, off in ((bottom, bottom - within), (top, within - top)):
            if ends[0] < floor < ends[1]:
                seen, meant = seen + self._stand_out(off), meant + self.floor
        return min(2 * seen, 2 * meant) - meant

    def _stand_out(self, off: np.ndarray) -> float:
        """How many points lie about a face of which they are so far off, outwards: more than there are in the empty space before it. Behind
        it may lie the other skin of a thin wall."""
        band = BAND * self.sigma
        return (np.count_nonzero(np.abs(off) < band) - 2 * np.count_nonzero((off > -2 * band) & (off <= -band))) / KEPT


def _as_long(hole: Primitive, length: float) -> tuple[float, ...]:
    return (length,) if hole.outline is not None else (*hole.size[:-1], length)


def _between(hole: Primitive, axis: np.ndarray, bottom: float, top: float) -> Primitive:
    """The hole between two heights along its own last axis, which is `axis`."""
    shift = ((bottom + top) / 2 - float(np.dot(hole.center, axis))) * axis
    return replace(hole, size=_as_long(hole, top - bottom), center=vec(np.array(hole.center) + shift))
