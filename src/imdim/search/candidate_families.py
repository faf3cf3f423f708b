"""Candidate families: all the solids that an arrangement of carriers allows, never listed one by one.

A family is a frame of three directions (boxes), a cylinder or cone with two caps along its axis, a single sphere, torus or ellipsoid, or
a plane arrangement (`outline_families`).
`Families.best` finds each family's candidate with the largest sum of a per-cell field; `mask` and `primitive` spell a candidate out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from imdim.geometry.rotations import euler_from_matrix, frame_from_axis
from imdim.geometry.surface import Surface, vec
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline
from imdim.program.tree import Primitive
from imdim.search.arrangement import Arrangement
from imdim.search.cells import Cells
from imdim.search.group_sums import Slots
from imdim.search.kernels import axial_best, best_box, box_best, merge_slabs
from imdim.search.look_kernels import Groups
from imdim.search.outline_families import NO_PLANES, OutlineCells, PricedPlanes
from imdim.search.outline_plane import pack_graphs

ALONG_AXIS = 1 - 1e-12  # largest component of a direction along an axis of the world


@dataclass(frozen=True, slots=True)
class Candidate:
    """A member of a family: `source` is ("box", frame index), ("curved", surface index) or ("outline", plane index), `ranges` offset
    indices (lo, hi) per axis, `faces` those within an outline, as bits."""

    source: tuple[str, int]
    ranges: tuple[tuple[int, int], ...]
    faces: bytes = b""


class _Grid(NamedTuple):
    """The `shape` of a box frame's grid, the `places` [s, 3] of it that hold cells, in their order, and the slot of each cell among these:
    of many planes most of a grid is empty."""

    slots: np.ndarray
    places: np.ndarray
    shape: tuple[int, int, int]


class Families:
    """The families of an arrangement over one set of cells, with `outlines` those of its plane arrangements too.

    `faces` are those [m] of the cells in each plane, found here where nobody knows them.
    """

    def __init__(
        self,
        arrangement: Arrangement,
        cells: Cells,
        outlines: PricedPlanes = NO_PLANES,
        faces: Sequence[np.ndarray] | None = None,
    ) -> None:
        self.arrangement = arrangement
        self.outlines = OutlineCells(arrangement, cells, outlines, faces)
        self.cells = cells
        self.work = 0.0  # cells summed so far: a measure of time that repeats
        # column by column, as they are asked for
        self._slabs, self._inside = np.asfortranarray(cells.slabs), np.asfortranarray(cells.inside)

    @cached_property
    def slots(self) -> list[Slots]:
        """Where each group sums the cells: the curved families' slabs in one long row, the boxes' grids, the faces and levels of planes."""
        boxes = (Slots(grid.slots, len(grid.places)) for grid in self._grids)
        return [self._pack_axial(), *boxes, *self.outlines.slots]

    @cached_property
    def packed(self) -> Groups:
        """The groups as the compiled look takes them."""
        axial, *rest = self.slots
        assert axial.starts is not None
        table = np.empty((len(rest), len(self.cells.points)), np.int32)
        for row, slots in zip(table, rest, strict=True):
            row[:] = slots.slots
        firsts = np.cumsum([0, *(slots.size for slots in self.slots)])
        places = np.concatenate([np.empty((0, 3), np.int32), *(grid.places for grid in self._grids)])
        shapes = np.array([grid.shape for grid in self._grids], np.int64).reshape(-1, 3)
        graphs = pack_graphs(self.outlines.planes)
        return Groups(table, axial.starts, axial.slots, firsts, self._ends, places, shapes, self.outlines.table_sizes, *graphs)

    @cached_property
    def _grids(self) -> list[_Grid]:
        return [self._pack_frame(axes) for axes in self.arrangement.frames]

    @cached_property
    def _ends(self) -> np.ndarray:
        """Where the slabs of each curved family end in their long row."""
        widths = [len(self.arrangement.directions[axis].offsets) - 1 if axis >= 0 else 1 for axis in self.arrangement.axis_of]
        return np.concatenate([[0], np.cumsum(widths)]).astype(np.int64)

    def _pack_axial(self) -> Slots:
        """The slots of each cell, one for each curved family that holds it."""
        cell, family = np.nonzero(self.cells.inside)
        axis = np.array(self.arrangement.axis_of, np.int64)[family]
        slots = (self._ends[family] + np.where(axis >= 0, self._slabs[cell, axis], 0)).astype(np.int32)
        return Slots(slots, int(self._ends[-1]), np.searchsorted(cell, np.arange(len(self._slabs) + 1)))

    def _pack_frame(self, axes: tuple[int, int, int]) -> _Grid:
        """The grid of a box frame."""
        a, b, c = (len(self.arrangement.directions[axis].offsets) - 1 for axis in axes)
        at = np.ravel_multi_index([self._slabs[:, axis].astype(np.int64) for axis in axes], (a, b, c))
        numbers = np.full(a * b * c, -1, np.int32)
        numbers[at] = 0
        held = np.flatnonzero(numbers == 0)
        numbers[held] = np.arange(len(held))
        places = np.column_stack(np.unravel_index(held, (a, b, c))).astype(np.int32)
        return _Grid(numbers[at], places, (a, b, c))

    @property
    def groups(self) -> int:
        """Number of groups: the curved families together, each box frame, and each plane of outlines."""
        return 1 + len(self.arrangement.frames) + len(self.outlines.planes)

    def count_asked(self, groups: int) -> None:
        """So many groups were asked."""
        self.work += groups * len(self.cells.points)

    def candidate_of(
        self, group: int, count: int, most: float, ranges: list[int], wins: np.ndarray, faces: np.ndarray
    ) -> tuple[float, Candidate | None]:
        """What a compiled look found in one group, and before it what it wins; for an outline the first of `count` that can be drawn, or
        else None and `most`."""
        frames = len(self.arrangement.frames)
        if group == 0:
            return most, Candidate(("curved", ranges[0]), ((ranges[1], ranges[2]),))
        if group <= frames:
            return most, Candidate(("box", group - 1), ((ranges[0], ranges[1]), (ranges[2], ranges[3]), (ranges[4], ranges[5])))
        plane = group - 1 - frames
        drawn = self.outlines.first_drawable(plane, wins[:count], (ranges[0], ranges[1]), faces)
        return (most, None) if drawn is None else (drawn[0], Candidate(("outline", plane), *drawn[1:]))

    def best(self, field: np.ndarray, per_frame: int, floor: float = 0.0, outlines: bool = False) -> list[tuple[float, Candidate]]:
        """Candidates whose sums of `field` [m] are above `floor`: one per curved family, up to `per_frame` (or none) per box frame, with
        `outlines` one per plane of them."""
        self.work += len(field) * (self.groups if per_frame else 1)
        cells = np.flatnonzero(field)
        values = field[cells]
        if np.maximum(values, 0.0).sum() <= floor:
            return []
        out = self._best_curved(self.slots[0].sum_values(cells, values), floor)
        for frame in range(len(self.arrangement.frames) if per_frame else 0):
            sums = self.slots[1 + frame].sum_values(cells, values)
            if per_frame == 1:
                out += self._best_box(frame, sums, max([floor, *(v for v, _ in out)]))
            else:
                out += self._best_boxes(frame, sums, per_frame, floor)
        for plane in range(len(self.outlines.planes) if outlines else 0):
            drawn = self.outlines.best(plane, self.outlines.slots[plane].sum_values(cells, values), floor)
            out += [(drawn[0], Candidate(("outline", plane), *drawn[1:]))] if drawn else []
        return out

    def curve_cost(self, candidate: Candidate) -> float:
        """What the curves of an outline cost beyond the price of a primitive, in volume; nothing for the others."""
        kind, index = candidate.source
        return self.outlines.curve_cost(index, candidate.faces) if kind == "outline" else 0.0

    def _best_curved(self, sums: np.ndarray, floor: float) -> list[tuple[float, Candidate]]:
        table = np.empty((len(self._ends) - 1, 3))
        axial_best(sums, self._ends, table)
        return [
            (float(table[i, 0]), Candidate(("curved", int(i)), ((int(table[i, 1]), int(table[i, 2])),)))
            for i in np.flatnonzero(table[:, 0] > floor)
        ]

    def _best_box(self, frame: int, sums: np.ndarray, floor: float) -> list[tuple[float, Candidate]]:
        """The best box of a frame, where it is above the `floor`."""
        out = np.empty(7)
        grid = self._grids[frame]
        most = best_box(sums, grid.places, grid.shape, 1.0, floor, out)
        if out[0] == -np.inf:
            return []
        i, j, k, m, n, o = out[1:].astype(int).tolist()
        return [(most, Candidate(("box", frame), ((i, j), (k, m), (n, o))))]

    def _best_boxes(self, frame: int, sums: np.ndarray, count: int, floor: float) -> list[tuple[float, Candidate]]:
        """The best boxes of a frame, of different slabs along one of its axes."""
        known = self._grids[frame]
        grid, *first = merge_slabs(sums, known.places, known.shape)
        order = sorted(range(3), key=lambda a: grid.shape[a])  # fewest slabs first is cheapest for the compiled loop
        grid = np.ascontiguousarray(grid.transpose(order))
        table = np.empty((len(grid) * (len(grid) + 1) // 2, 7))
        box_best(grid, floor, count, table)
        out = []
        for row in table[_top(table[:, 0], count, floor)]:
            ranges = [(0, 0)] * 3
            for position, axis in enumerate(order):
                lo, hi = row[1 + 2 * position : 3 + 2 * position].astype(int)
                ranges[axis] = (int(first[axis][lo]), int(first[axis][hi]))
            out.append((float(row[0]), Candidate(("box", frame), tuple(ranges))))
        return out

    def mask(self, candidate: Candidate) -> np.ndarray:
        """The cells [m] that a candidate covers."""
        kind, index = candidate.source
        if kind == "outline":
            return self.outlines.mask(index, candidate.ranges, candidate.faces)
        slabs = self._slabs
        if kind == "curved":
            axis = self.arrangement.axis_of[index]
            inside = self._inside[:, index]
            return inside & _between(slabs[:, axis], candidate.ranges[0]) if axis >= 0 else inside.copy()
        columns = self.arrangement.frames[index]
        return np.logical_and.reduce([_between(slabs[:, c], r) for c, r in zip(columns, candidate.ranges, strict=True)])

    def primitive(self, candidate: Candidate) -> Primitive:
        """The solid that a candidate stands for."""
        kind, index = candidate.source
        if kind == "outline":
            return self.outlines.primitive(index, candidate.ranges, candidate.faces)
        if kind == "box":
            return self._box(index, candidate.ranges)
        surface = self.arrangement.curved[index]
        axis = self.arrangement.axis_of[index]
        if axis < 0:
            return solid_within(surface)
        direction = self.arrangement.directions[axis]
        lo, hi = (float(direction.offsets[i]) for i in candidate.ranges[0])
        return _cap(surface, direction.vector, lo, hi)

    def _box(self, frame: int, ranges: tuple[tuple[int, int], ...]) -> Primitive:
        axes = self.arrangement.frames[frame]
        chosen = [self.arrangement.directions[i] for i in axes]
        spans = [(float(d.offsets[lo]), float(d.offsets[hi])) for d, (lo, hi) in zip(chosen, ranges, strict=True)]
        middle = sum(d.vector * (lo + hi) / 2 for d, (lo, hi) in zip(chosen, spans, strict=True))
        sizes = tuple(hi - lo for lo, hi in spans)
        return Primitive("box", sizes, vec(np.asarray(middle)), euler_from_matrix(self.arrangement.rotation(axes)))


def _top(sums: np.ndarray, count: int, floor: float) -> np.ndarray:
    """Indices of the `count` largest sums above `floor`, the first of equal ones first."""
    top = np.argsort(-sums, kind="stable")[:count]
    return top[sums[top] > floor]


def _between(slab: np.ndarray, bounds: tuple[int, int]) -> np.ndarray:
    return (slab >= bounds[0]) & (slab < bounds[1])


def solid_within(surface: Surface) -> Primitive:
    """The solid that a sphere, torus or ellipsoid bounds by itself."""
    if surface.kind == "sphere":
        return Primitive("sphere", surface.sizes, surface.point)
    frame = surface.frame if surface.kind == "ellipsoid" else frame_from_axis(np.asarray(surface.axis))
    return Primitive(surface.kind, surface.sizes, surface.point, euler_from_matrix(frame))


def _cap(surface: Surface, direction: np.ndarray, lo: float, hi: float) -> Primitive:
    """The cylinder, elliptic or not, or cone between two planes perpendicular to its axis; a cone starts at its apex at the earliest."""
    point = np.asarray(surface.point)
    at = float(point @ direction)
    radii = surface.sizes
    if surface.kind == "elliptic":
        return elliptic_solid(surface, direction, lo, hi)
    if surface.kind == "cone":
        opens_up = float(np.asarray(surface.axis) @ direction) > 0
        lo, hi = (max(lo, at), hi) if opens_up else (lo, min(hi, at))
        radii = tuple(abs(end - at) * math.tan(surface.sizes[0]) for end in (lo, hi))
    center = point - at * direction + (lo + hi) / 2 * direction
    return Primitive(surface.kind, (*radii, hi - lo), vec(center), euler_from_matrix(frame_from_axis(direction)))


def elliptic_solid(surface: Surface, direction: np.ndarray, lo: float, hi: float) -> Primitive:
    """The extruded ellipse of an elliptic cylinder between two offsets along its axis, or against it.

    Along an axis of the world it is drawn in the world's frame, elsewhere in that of its own semi-axes, the longer one first.
    """
    rx, ry = surface.sizes
    own = frame_from_axis(direction)
    across = own.T @ surface.across
    angle = math.degrees(math.atan2(across[1], across[0]))
    loop = Ellipse(rx, ry, angle=angle).plain
    if np.abs(direction).max() < ALONG_AXIS:
        turned = math.radians(angle if rx >= ry else angle + 90)
        u = math.cos(turned) * own[:, 0] + math.sin(turned) * own[:, 1]
        own, loop = np.column_stack([u, np.cross(direction, u), direction]), Ellipse(max(rx, ry), min(rx, ry))
    point = np.asarray(surface.point)
    center = point + ((lo + hi) / 2 - float(point @ direction)) * direction
    return Primitive("extrude", (hi - lo,), vec(center), euler_from_matrix(own), Outline((loop,)))
