"""The holes of drawings as cuts: pockets in a row, compartments, and holes through a part that another drawing shows better.

What is drawn from above has holes where pockets are, but its walls seldom run from end to end of what they are in. Each set of holes of
one drawing is offered as one cut, its pockets alike where they nearly are, between the ends at which its walls and floors have the most
points of the cloud and the least room without.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.geometry.surface_map import surface_area
from imdim.numbers.ties import tie_alike
from imdim.program.tree import Combine, Primitive, Program, combine_all, leaves
from imdim.search.mdl.candidates.drawn import holes_of, take_holes_apart
from imdim.search.mdl.description_length import PARALLEL_DEG
from imdim.search.mdl.primitive_selection import Cloud

BAND = 1.5  # deviations of the noise, within which a face has its points
KEPT = 0.73  # of a normal distribution within one BAND more than twice what is in the next one on one side
OUTERMOST = (0.01, 0.99)  # quantiles of coordinates, beyond which points may be strays
OUT = 4.0  # deviations of the noise by which an open end leaves the part
FEWEST = 8  # points of a floor
MOST_DRAWINGS = 4
MOST_HOLES = 24  # of one drawing
ALIKE = 3.0  # deviations of the noise by which pockets differ that may be copies


def pockets(drawn: Sequence[Primitive], cloud: Cloud) -> list[Program]:
    """The holes of the extrusions among what is `drawn` as cuts, those first that the most points bear out: all of a drawing together, also
    in the block that it draws, and each of the best drawing's alone."""
    sections: dict[tuple[object, ...], list[Primitive]] = {}
    for leaf in drawn:
        if leaf.kind == "extrude" and leaf.outline is not None and len(leaf.outline.loops) > 1:
            sections.setdefault((leaf.rotation, leaf.outline), []).append(leaf)
    found = sorted(filter(None, (_cut_holes(same, cloud) for same in sections.values())), key=lambda holed: -holed.worth)[:MOST_DRAWINGS]
    together = [tie_alike(combine_all("union", list(holed.cuts)), ALIKE * cloud.noise, PARALLEL_DEG) for holed in found]
    blocks = [Combine("difference", holed.block, cuts) for holed, cuts in zip(found, together, strict=True) if holed.block]
    alone = [*leaves(together[0])] if together else []
    return [*dict.fromkeys([*together, *blocks, *(alone if len(alone) > 1 else [])])]


@dataclass(frozen=True)
class _Holed:
    """The `cuts` of a drawing, by how many points they are borne out, and the block that they are in, where it draws one."""

    worth: float
    cuts: tuple[Primitive, ...]
    block: Primitive | None


def _cut_holes(same: Sequence[Primitive], cloud: Cloud) -> _Holed | None:
    """Those holes of extrusions of the `same` drawing that points bear out, between the ends between which they do so the most; None where
    there are none."""
    holes = holes_of(same[0], 0.0)
    if not 0 < len(holes) <= MOST_HOLES:
        return None
    heights = _Heights.of(same, cloud)
    within = np.any([_Walls.of(hole, heights.points, cloud).within for hole in holes], axis=0)
    spans = [*heights.spans(OUT * cloud.noise, _find_floor(heights.points[within], cloud.noise))]
    plain = [hole for hole in holes if hole.outline is None]
    best = [_most_borne(hole, [_in_place(p, hole) for p in plain] if hole.outline else [], spans, heights, cloud) for hole in holes]
    totals = np.maximum([worth for _, worth in best], 0.0).sum(0)
    span = int(np.argmax(totals))
    cuts = tuple(_between(hole, heights.axis, spans[span]) for hole, worth in best if worth[span] > 0)
    return _Holed(float(totals[span]), cuts, _find_block(same[0], heights, cloud)) if cuts else None


def _find_floor(height: np.ndarray, sigma: float) -> list[float]:
    """The height about which the most of those [n] of points in holes lie; none where there are few."""
    if len(height) < FEWEST:
        return []
    ordered = np.sort(height)
    low, high = (np.searchsorted(ordered, ordered + sign * BAND * sigma) for sign in (-1, 1))
    densest = int(np.argmax(high - low))
    return [float(ordered[low[densest] : high[densest]].mean())]


def _most_borne(
    hole: Primitive, others: Sequence[Primitive], spans: Sequence[tuple[float, float]], heights: _Heights, cloud: Cloud
) -> tuple[Primitive, list[float]]:
    """The hole, or the one of others in its place that points bear out more, and by how many of them in each span."""
    options = []
    for option in (hole, *others):
        walls = _Walls.of(option, heights.points, cloud)
        options.append((option, [walls.worth(*span, heights.ends) for span in spans]))
    return max(options, key=lambda option: max(option[1]))


def _in_place(plain: Primitive, drawn: Primitive) -> Primitive:
    """A hole of one of the six kinds in the middle of one that is drawn with curves of its own: noise draws one in a row otherwise."""
    low, high = (np.array(corner) for corner in drawn.outline.bounds) if drawn.outline else (np.zeros(2), np.zeros(2))
    return replace(plain, center=vec(np.array(drawn.center) + matrix_from_euler(drawn.rotation)[:, :2] @ ((low + high) / 2)))


def _find_block(leaf: Primitive, heights: _Heights, cloud: Cloud) -> Primitive | None:
    """What a drawing bounds, without its holes, between the ends between which the most points bear it out; None where it bounds several
    or they do not."""
    block = take_holes_apart(leaf, 0.0)[0]
    if block == leaf:
        return None
    walls, spans = _Walls.of(block, heights.points, cloud, solid=True), [*heights.spans(0.0)]
    worth = [walls.worth(*span, (-np.inf, np.inf)) for span in spans]
    return _between(block, heights.axis, spans[int(np.argmax(worth))]) if max(worth) > 0 else None


@dataclass(frozen=True)
class _Heights:
    """Heights of the `points` [n] of a cloud along an `axis`, the `ends` between which they lie, and the low and high `levels` of
    extrusions."""

    axis: np.ndarray
    points: np.ndarray
    ends: tuple[float, float]
    levels: tuple[tuple[float, ...], tuple[float, ...]]

    @staticmethod
    def of(same: Sequence[Primitive], cloud: Cloud) -> _Heights:
        axis = matrix_from_euler(same[0].rotation)[:, 2]
        points = cloud.points @ axis
        low, high = (float(end) for end in np.quantile(points, OUTERMOST))
        middles = [float(np.dot(leaf.center, axis)) for leaf in same]
        levels = (tuple(m + sign * leaf.size[0] / 2 for m, leaf in zip(middles, same, strict=True)) for sign in (-1, 1))
        return _Heights(axis, points, (low, high), (next(levels), next(levels)))

    def spans(self, beyond: float, floors: Sequence[float] = ()) -> Iterator[tuple[float, float]]:
        """From each low level or floor, and from `beyond` the cloud, to each high one or floor."""
        bottoms = dict.fromkeys([self.ends[0] - beyond, *self.levels[0], *floors])
        tops = dict.fromkeys([self.ends[1] + beyond, *self.levels[1], *floors])
        yield from ((bottom, top) for bottom in bottoms for top in tops if top > bottom)


@dataclass(frozen=True)
class _Walls:
    """Of a hole without ends, or of a solid, how far points lie in its wall, and how high, [n]; whether they lie within; points for each
    unit of length along its walls and height, and for all of a floor; the deviation of the noise."""

    off: np.ndarray
    height: np.ndarray
    within: np.ndarray
    along: float
    floor: float
    sigma: float
    solid: bool

    @staticmethod
    def of(hole: Primitive, height: np.ndarray, cloud: Cloud, solid: bool = False) -> _Walls:
        flat, tall = (surface_area(hole.kind, _as_long(hole, length), hole.outline) for length in (1e-9, 1.0))
        endless = replace(hole, size=_as_long(hole, 10 * cloud.diagonal))
        off, dense = kernels.program_sdf(endless, cloud.points), cloud.spacing**-2
        within = off < -BAND * cloud.noise
        return _Walls(-off if solid else off, height, within, (tall - flat) * dense, flat / 2 * dense, cloud.noise, solid)

    def worth(self, bottom: float, top: float, ends: tuple[float, float]) -> float:
        """How many more points its faces have between two heights than would be missing; a floor beyond the `ends` is none."""
        low, high = max(bottom, ends[0]), min(top, ends[1])
        if high <= low:
            return 0.0
        beside = self.off[(self.height > low) & (self.height < high)]
        seen, meant = self._stand_out(beside), self.along * (high - low)
        above = self.height[self.within]
        for floor, off in ((bottom, bottom - above), (top, above - top)):
            if ends[0] < floor < ends[1]:
                seen, meant = seen + self._stand_out(-off if self.solid else off), meant + self.floor
        return min(2 * seen, 2 * meant) - meant

    def _stand_out(self, off: np.ndarray) -> float:
        """How many points lie about a face in which they are so far: more than there are in the empty space before it. Behind it may lie
        the other skin of a thin wall."""
        band = BAND * self.sigma
        return (np.count_nonzero(np.abs(off) < band) - 2 * np.count_nonzero((off > -2 * band) & (off <= -band))) / KEPT


def _as_long(hole: Primitive, length: float) -> tuple[float, ...]:
    return (length,) if hole.outline is not None else (*hole.size[:-1], length)


def _between(hole: Primitive, axis: np.ndarray, span: tuple[float, float]) -> Primitive:
    """The hole between two heights along its own last axis, which is `axis`."""
    bottom, top = span
    shift = ((bottom + top) / 2 - float(np.dot(hole.center, axis))) * axis
    return replace(hole, size=_as_long(hole, top - bottom), center=vec(np.array(hole.center) + shift))
