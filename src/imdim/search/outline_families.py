"""Outlines as candidate families: per plane arrangement, the best region of faces between the best two levels.

What a field of cells wins in every face and slab is summed once; for each pair of levels the faces that win something bound what any
outline between them can win, and for the most promising pairs the region is found by `outline_region`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.surface import vec
from imdim.program.cost import FREE_CURVES
from imdim.program.outline import Outline, circle_of, loop_curves
from imdim.program.tree import FULL_TURN, Primitive
from imdim.search.arrangement import ORTHOGONAL, Arrangement
from imdim.search.cells import Cells
from imdim.search.outline_plane import OutlinePlane, Walls, make_plane
from imdim.search.outline_region import best_region, count_curves, draw_outline

EVEN = 1e-12  # of the largest bound, that tells apart what is even
PAIRS = 3  # of levels between which the region is looked for, after the most promising
HARMLESS = 1e-3  # of a face that matters: what a curve costs where an outline may be wider
SAME_AXIS = 4e-4  # of the unit frame, within which two axes are one
MOST_WALLS = 90  # of one plane; the faces grow with the square
LEAST_TURNED = 2  # surfaces about an axis that are no mere cylinder, or walls, for an outline to be turned


@dataclass(frozen=True)
class PricedPlanes:
    """The planes of an arrangement, and what a curve of an outline costs in volume."""

    planes: tuple[OutlinePlane, ...]
    curve_price: float


NO_PLANES = PricedPlanes((), 0.0)


def find_planes(arrangement: Arrangement) -> tuple[OutlinePlane, ...]:
    """Planes across directions with three walls or more along them, and half planes about axes with several surfaces about them."""
    found = [*_extruded(arrangement), *_turned(arrangement)]
    return tuple(plane for plane in found if plane is not None and plane.faces)


def _extruded(arrangement: Arrangement) -> Iterator[OutlinePlane | None]:
    for a, direction in enumerate(arrangement.directions):
        across = [b for b, d in enumerate(arrangement.directions) if b != a and abs(d.vector @ direction.vector) < ORTHOGONAL]
        lines = [(b, k) for b in across for k in np.flatnonzero(arrangement.directions[b].detected).tolist()]
        rounds = [c for c, s in enumerate(arrangement.curved) if arrangement.axis_of[c] == a and s.kind == "cylinder"]
        if not across or len(lines) + len(rounds) < 3 or len(lines) + len(rounds) > MOST_WALLS:
            continue
        frame = _frame_across(direction.vector, arrangement.directions[across[0]].vector)
        normals = np.array([arrangement.directions[b].vector @ frame[:, :2] for b, _ in lines]).reshape(-1, 2)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        offsets = np.array([arrangement.directions[b].offsets[k] for b, k in lines])
        centers = np.array([np.asarray(arrangement.curved[c].point) @ frame[:, :2] for c in rounds]).reshape(-1, 2)
        radii = np.array([arrangement.curved[c].sizes[0] for c in rounds])
        columns = (*((True, b, k) for b, k in lines), *((False, c, 0) for c in rounds))
        corners = _corners(arrangement.bounds) @ frame[:, :2]
        walls = Walls(normals, offsets, centers, radii, np.stack([corners.min(0), corners.max(0)]), columns)
        yield make_plane("extrude", a, np.zeros(3), frame, walls)


def _turned(arrangement: Arrangement) -> Iterator[OutlinePlane | None]:
    for a, foot, members in _axes(arrangement):
        direction = arrangement.directions[a]
        along = direction.vector
        u = _frame_across(along, np.eye(3)[np.argmin(np.abs(along))])[:, 0]
        half = np.stack([u, along, np.cross(u, along)], axis=1)
        levels = np.flatnonzero(direction.detected).tolist()
        normals, offsets, centers, radii = [(0.0, 1.0)] * len(levels), [float(direction.offsets[k]) for k in levels], [], []
        columns, rounds = [(True, a, k) for k in levels], []
        for c in members:
            surface = arrangement.curved[c]
            height = float(np.asarray(surface.point) @ along)
            if surface.kind == "cylinder":
                normals.append((-1.0, 0.0))
                offsets.append(-surface.sizes[0])
                columns.append((False, c, 0))
            elif surface.kind == "cone":
                up, angle = float(np.sign(np.asarray(surface.axis) @ along)), surface.sizes[0]
                normal = (-float(np.cos(angle)), up * float(np.sin(angle)))
                normals.append(normal)
                offsets.append(normal[1] * height)
                columns.append((False, c, 0))
            else:
                centers.append((0.0 if surface.kind == "sphere" else surface.sizes[0], height))
                radii.append(surface.sizes[-1])
                rounds.append((False, c, 0))
        corners = _corners(arrangement.bounds) - foot
        reach = float(np.sqrt(np.maximum((corners**2).sum(1) - (corners @ along) ** 2, 0)).max())
        heights = _corners(arrangement.bounds) @ along
        window = np.array([[0.0, heights.min()], [reach, heights.max()]])
        if len(normals) + len(radii) <= MOST_WALLS:
            walls = Walls(np.array(normals).reshape(-1, 2), np.array(offsets), np.array(centers).reshape(-1, 2), np.array(radii), window,
                          (*columns, *rounds))  # fmt: skip
            yield make_plane("revolve", a, foot, half, walls)


def _axes(arrangement: Arrangement) -> Iterator[tuple[int, np.ndarray, list[int]]]:
    """Direction, foot [3] and surfaces of the axes about which an outline may be turned, each foot nearest to the origin."""
    feet: list[tuple[int, np.ndarray, list[int]]] = []
    for c, surface in enumerate(arrangement.curved):
        a = arrangement.axis_of[c]
        if surface.kind == "torus":
            parallel = [abs(float(d.vector @ np.asarray(surface.axis))) for d in arrangement.directions]
            a = int(np.argmax(parallel)) if max(parallel) > 1 - 1e-6 else -1
        if a < 0:
            continue
        along, point = arrangement.directions[a].vector, np.asarray(surface.point)
        foot = point - (point @ along) * along
        known = next((f for f in feet if f[0] == a and np.linalg.norm(f[1] - foot) < SAME_AXIS), None)
        if known:
            known[2].append(c)
        else:
            feet.append((a, foot, [c]))
    for a, foot, members in feet:
        along = arrangement.directions[a].vector
        for c, surface in enumerate(arrangement.curved):
            point = np.asarray(surface.point)
            if surface.kind == "sphere" and np.linalg.norm(point - foot - ((point - foot) @ along) * along) < SAME_AXIS:
                members.append(c)
        bent = sum(arrangement.curved[c].kind != "cylinder" for c in members)
        if bent >= 1 or len(members) > LEAST_TURNED:
            yield a, foot, sorted(members)


def _corners(box: np.ndarray) -> np.ndarray:
    return np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def _frame_across(along: np.ndarray, guide: np.ndarray) -> np.ndarray:
    """Columns (u, v, along), right-handed; along the coordinate axes where `along` is one of them."""
    if np.abs(along).max() > 1 - 1e-12 and along.max() > 0:
        lead = int(np.argmax(along))
        return np.eye(3)[:, [(lead + 1) % 3, (lead + 2) % 3, lead]]
    u = guide - (guide @ along) * along
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(along, u), along], axis=1)


Drawn = tuple[float, tuple[tuple[int, int], ...], bytes]  # what an outline wins, its levels, its faces


class OutlineCells:
    """The outlines over one set of cells: what `Families` asks, plane by plane."""

    def __init__(self, arrangement: Arrangement, cells: Cells, outlines: PricedPlanes) -> None:
        self.arrangement, self.outlines, self.planes = arrangement, outlines, outlines.planes
        self._outlines: dict[tuple[int, bytes], Outline] = {}
        self._costs: dict[tuple[int, bytes], float] = {}
        self._faces = [plane.faces_of(cells) for plane in outlines.planes]
        self._slabs = [cells.slabs[:, p.direction] if p.kind == "extrude" else np.zeros(len(cells.points), np.int16) for p in self.planes]
        # the slot of each cell in a table of faces and levels, which has one row more for cells that no face has
        places = zip(self.planes, self._faces, self._slabs, strict=True)
        self._slots = [np.where(face < 0, p.faces, face) * self._levels(p) + slab + 1 for p, face, slab in places]

    def best(self, index: int, field: np.ndarray, cells: np.ndarray, floor: float) -> Drawn | None:
        """What the best outline of a plane wins, less its curves' price, its levels and its faces; None below `floor`."""
        plane = self.outlines.planes[index]
        sums = self._sums(index, field, cells)
        bounds = _pair_bounds(sums)
        # of levels that win the same the farthest apart: what cuts ends beyond the part
        levels = np.arange(len(bounds))
        bounds += EVEN * bounds.max(initial=0.0) * np.maximum(levels[None] - levels[:, None], 0) * (bounds > 0)
        best: Drawn | None = None
        for flat in np.argsort(-bounds, axis=None)[:PAIRS].tolist():
            lo, hi = divmod(flat, bounds.shape[1])
            if bounds[lo, hi] <= floor:
                break
            found = self._drawn(plane, sums, lo, hi, flips=False)
            if found is not None and found[0] > floor:
                floor, best = found[0], found
        if best is None:
            return None
        lo, hi = best[1][0] if best[1] else (0, 1)
        better = self._drawn(plane, sums, lo, hi, flips=True)
        return better if better is not None and better[0] > best[0] else best

    def _drawn(self, plane: OutlinePlane, sums: np.ndarray, lo: int, hi: int, flips: bool) -> Drawn | None:
        """What is found between two levels."""
        region = best_region(plane, sums[:, hi] - sums[:, lo], self.outlines.curve_price, flips)
        if region is None:
            return None
        won = region.gain - self.outlines.curve_price * max(region.curves - FREE_CURVES, 0)
        return won, ((lo, hi),) if plane.kind == "extrude" else (), np.packbits(region.inside).tobytes()

    def _sums(self, index: int, field: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Sums of a field over each face below each level [f, levels]."""
        plane = self.planes[index]
        levels = self._levels(plane)
        slots = self._slots[index][cells]
        sums = np.bincount(slots, field[cells], (plane.faces + 1) * levels)
        return np.cumsum(sums.reshape(-1, levels)[:-1], axis=1)

    def _levels(self, plane: OutlinePlane) -> int:
        return len(self.arrangement.directions[plane.direction].offsets) if plane.kind == "extrude" else 2

    def widen(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes, matters: np.ndarray) -> bytes:
        """The faces of an outline with others on which no cell between the levels `matters` [m], where that takes no more curves: what is
        cut away ends beyond the part, not in its faces."""
        plane, inside = self.planes[index], self._unpack(index, faces)
        lo, hi = ranges[0] if ranges else (0, 1)
        sums = self._sums(index, matters.astype(float), np.flatnonzero(matters))
        harmless = sums[:, hi] - sums[:, lo] == 0
        gains = np.where(harmless, EVEN, np.where(inside, 1.0, -1.0))
        region = best_region(plane, gains, HARMLESS / plane.faces)
        if region is None or (region.inside != inside)[~harmless].any() or region.curves > count_curves(plane, inside):
            return faces
        return np.packbits(region.inside).tobytes()

    def mask(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes) -> np.ndarray:
        """The cells [m] of an outline between two levels."""
        inside = np.append(self._unpack(index, faces), False)
        covered = inside[self._faces[index]]
        return covered & (self._slabs[index] >= ranges[0][0]) & (self._slabs[index] < ranges[0][1]) if ranges else covered

    def curve_cost(self, index: int, faces: bytes) -> float:
        """What the curves of an outline cost, in volume."""
        known = self._costs.get((index, faces))
        if known is None:
            curves = count_curves(self.planes[index], self._unpack(index, faces))
            known = self._costs[index, faces] = self.outlines.curve_price * max(curves - FREE_CURVES, 0)
        return known

    def _outline(self, index: int, faces: bytes) -> Outline:
        if (index, faces) not in self._outlines:
            self._outlines[index, faces] = draw_outline(self.planes[index], self._unpack(index, faces))
        return self._outlines[index, faces]

    def _unpack(self, index: int, faces: bytes) -> np.ndarray:
        return np.unpackbits(np.frombuffer(faces, np.uint8), count=self.outlines.planes[index].faces).astype(bool)

    def primitive(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes) -> Primitive:
        """The solid of an outline; a box or cylinder where it is one."""
        plane = self.outlines.planes[index]
        outline = self._outline(index, faces)
        (left, low), (right, high) = outline.bounds
        x, y = (left + right) / 2, (low + high) / 2
        if plane.kind == "revolve":
            turned = np.stack([plane.frame[:, 0], np.cross(plane.frame[:, 1], plane.frame[:, 0]), plane.frame[:, 1]], axis=1)
            center = plane.origin + y * plane.frame[:, 1]
            return Primitive("revolve", (FULL_TURN,), vec(center), euler_from_matrix(turned), outline.shift(0.0, -y))
        offsets = self.arrangement.directions[plane.direction].offsets
        bottom, top = float(offsets[ranges[0][0]]), float(offsets[ranges[0][1]])
        center = plane.frame @ np.array([x, y, (bottom + top) / 2])
        return simplify(Primitive("extrude", (top - bottom,), vec(center), euler_from_matrix(plane.frame), outline.shift(-x, -y)))


def simplify(leaf: Primitive) -> Primitive:
    """A box for an extruded rectangle along its axes, a cylinder for an extruded circle, else the leaf."""
    outline = leaf.outline
    if outline is None or leaf.kind != "extrude" or len(outline.loops) != 1:
        return leaf
    round_ = circle_of(outline.loops[0])
    if round_:
        return Primitive("cylinder", (round_[2], leaf.size[0]), leaf.center, leaf.rotation)
    (left, low), (right, high) = outline.bounds
    curves = loop_curves(outline.loops[0])
    size = max(right - left, high - low)
    square = len(curves) == 4 and all(not b and min(abs(x - u), abs(y - v)) < 1e-9 * size for x, y, u, v, b in curves)
    return Primitive("box", (right - left, high - low, leaf.size[0]), leaf.center, leaf.rotation) if square else leaf


@njit(nogil=True, cache=True)
def _pair_bounds(sums):
    """What any outline between levels lo < hi can win at most [levels, levels]: the sum of what faces win there that win something."""
    faces, levels = sums.shape
    out = np.zeros((levels, levels))
    for f in range(faces):
        row = sums[f]
        if row[levels - 1] == 0.0 and row.max() == 0.0 and row.min() == 0.0:
            continue
        for lo in range(levels - 1):
            base = row[lo]
            for hi in range(lo + 1, levels):
                won = row[hi] - base
                if won > 0.0:
                    out[lo, hi] += won
    return out
