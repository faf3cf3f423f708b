"""Outlines as candidate families: per plane arrangement, the best region of faces between the best two levels.

What a field of cells wins in every face and slab is summed once; for each pair of levels the faces that win something bound what any
outline between them can win, and for the most promising pairs the region is found by `outline_region`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.rows import lengths
from imdim.geometry.surface import Surface, vec
from imdim.program.cost import DRAWN, FREE_CURVES, count_charged_curves
from imdim.program.outline import Outline
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import FULL_TURN, Primitive
from imdim.search.arrangement import ORTHOGONAL, Arrangement, span_along
from imdim.search.cells import Cells
from imdim.search.drafted_planes import DraftedPlane, draft_leaf, find_drafted_planes
from imdim.search.group_sums import Slots
from imdim.search.outline_drawing import draw_outline
from imdim.search.outline_kernels import offer_outlines, sum_below
from imdim.search.outline_plane import OutlinePlane, Walls, corners_of, frame_across, make_plane, window_across
from imdim.search.outline_region import best_region, count_curves

PAID = (FREE_CURVES, DRAWN)  # how many curves of an outline are free, and what is charged at least
CURVE_OF_WIDER, HARMLESS = 1e-3, 1e-6  # of a face that matters: what a curve costs, and a harmless face wins, where an outline is widened
SAME_AXIS = 4e-4  # of the unit frame, within which two axes are one
MOST_WALLS = 90  # of one plane; the faces grow with the square
CLEAR = 1.5e-3  # of the unit frame, that other walls keep from an ellipse
ALONG_AXIS = 1 - 1e-9  # cosine
RING = 720  # points of an ellipse, where other walls are looked for
TUBE = 2  # cylinders about an axis that need no turned outline


@dataclass(frozen=True)
class PricedPlanes:
    """The planes of an arrangement, and what a curve of an outline costs in volume."""

    planes: tuple[OutlinePlane, ...]
    curve_price: float


NO_PLANES = PricedPlanes((), 0.0)


def find_planes(arrangement: Arrangement, drafted: bool = True) -> tuple[OutlinePlane, ...]:
    """Planes across directions with three walls or more along them, or, `drafted`, that lean to them alike, and half planes about axes with
    several surfaces about them."""
    leaning = find_drafted_planes(arrangement, MOST_WALLS) if drafted else ()
    found = [*_extruded(arrangement), *leaning, *_turned(arrangement)]
    return tuple(plane for plane in found if plane is not None and plane.faces)


def _extruded(arrangement: Arrangement) -> Iterator[OutlinePlane | None]:
    for a, direction in enumerate(arrangement.directions):
        across, lines, rounds, ovals = _walls_along(arrangement, a)
        count = len(lines) + len(rounds) + len(ovals)
        if not across or (count < 3 and len(ovals) < 2):
            continue
        if count > MOST_WALLS:
            lines, rounds, ovals = _largest(arrangement, lines, rounds, ovals)
        frame = frame_across(direction.vector, arrangement.directions[across[0]].vector)
        walls = _walls_across(arrangement, frame[:, :2], lines, rounds)
        yield make_plane("extrude", a, np.zeros(3), frame, _add_ovals(walls, arrangement, frame[:, :2], ovals))


def _walls_along(arrangement: Arrangement, a: int) -> tuple[list[int], list[tuple[int, int]], list[int], list[int]]:
    """The directions across one, and the walls that stand along it: planes by direction and offset, round and elliptic cylinders."""
    along = arrangement.directions[a].vector
    across = [b for b, d in enumerate(arrangement.directions) if b != a and abs(d.vector @ along) < ORTHOGONAL]
    lines = [(b, k) for b in across for k in np.flatnonzero(arrangement.directions[b].detected).tolist()]
    rounds = [c for c, s in enumerate(arrangement.curved) if arrangement.axis_of[c] == a and s.kind == "cylinder"]
    ovals = [c for c, s in enumerate(arrangement.curved) if arrangement.axis_of[c] == a and s.kind == "elliptic"]
    return across, lines, rounds, ovals


def area_of_walls(arrangement: Arrangement, axis: int) -> float:
    """The area of the walls along an axis of the frame that an outline may run along."""
    a = next((a for a, d in enumerate(arrangement.directions) if abs(d.vector[axis]) > ALONG_AXIS), None)
    if a is None:
        return 0.0
    lines, rounds, ovals = _largest(arrangement, *_walls_along(arrangement, a)[1:])
    planes = sum(float(arrangement.directions[b].shown[k]) for b, k in lines)
    return planes + sum(arrangement.shown[c] for c in (*rounds, *ovals))


def _largest(
    arrangement: Arrangement, lines: list[tuple[int, int]], rounds: list[int], ovals: list[int]
) -> tuple[list[tuple[int, int]], list[int], list[int]]:
    """The MOST_WALLS of these walls that show the most: the least may be missed, a plane may not."""
    areas = [float(arrangement.directions[b].shown[k]) for b, k in lines] + [arrangement.shown[c] for c in (*rounds, *ovals)]
    kept = set(np.argsort([-area for area in areas], kind="stable")[:MOST_WALLS].tolist())
    walls = [*lines, *rounds, *ovals]
    bounds = np.cumsum([0, len(lines), len(rounds), len(ovals)]).tolist()
    each = [[walls[i] for i in range(first, last) if i in kept] for first, last in pairwise(bounds)]
    return each[0], each[1], each[2]


def _walls_across(arrangement: Arrangement, axes: np.ndarray, lines: Sequence[tuple[int, int]], rounds: Sequence[int]) -> Walls:
    """Walls in the plane of two `axes` [3, 2]: offsets of directions, and cylinders."""
    normals = np.array([arrangement.directions[b].vector @ axes for b, _ in lines]).reshape(-1, 2)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.array([arrangement.directions[b].offsets[k] for b, k in lines])
    centers = np.array([np.asarray(arrangement.curved[c].point) @ axes for c in rounds]).reshape(-1, 2)
    radii = np.array([arrangement.curved[c].sizes[0] for c in rounds])
    return Walls(normals, offsets, centers, radii, window_across(arrangement.bounds, axes), (*lines, *((c, None) for c in rounds)))


def _add_ovals(walls: Walls, arrangement: Arrangement, axes: np.ndarray, ovals: Sequence[int]) -> Walls:
    """With those elliptic cylinders that no other wall comes near: only whole ellipses can be drawn."""
    for c in ovals:
        surface = arrangement.curved[c]
        center, semi_axes = np.asarray(surface.point) @ axes, (surface.frame[:, :2] * surface.sizes).T @ axes
        index = len(walls.radii)
        wider = replace(
            walls,
            centers=np.concatenate([walls.centers, center[None]]),
            radii=np.append(walls.radii, max(surface.sizes)),
            columns=(*walls.columns, (c, None)),
            ovals={**walls.ovals, index: semi_axes.T},
        )
        ring = wider.around(index, np.linspace(0, 2 * np.pi, RING, endpoint=False))
        walls = walls if _comes_near(walls, ring) else wider
    return walls


def _comes_near(walls: Walls, ring: np.ndarray) -> bool:
    """Whether one of the walls crosses a ring of points [n, 2], or all but touches it."""
    off = [ring @ normal - offset for normal, offset in zip(walls.normals, walls.offsets, strict=True)]
    for circle, (center, radius) in enumerate(zip(walls.centers, walls.radii, strict=True)):
        away = ring - center
        if circle in walls.ovals:
            semi_axes = walls.ovals[circle]
            local = away @ np.linalg.inv(semi_axes).T
            level = lengths(local)
            slope = lengths(local @ np.linalg.inv(semi_axes))
            off.append((level - 1) * level / np.maximum(slope, 1e-300))
        else:
            off.append(lengths(away) - radius)
    return any(d.min() < CLEAR and d.max() > -CLEAR for d in off)


def _turned(arrangement: Arrangement) -> Iterator[OutlinePlane | None]:
    for a, foot, members in _axes(arrangement):
        along = arrangement.directions[a].vector
        u = frame_across(along, np.eye(3)[np.argmin(np.abs(along))])[:, 0]
        walls = _walls_about(arrangement, a, foot, members)
        yield make_plane("revolve", a, foot, np.stack([u, along, np.cross(u, along)], axis=1), walls)


def _walls_about(arrangement: Arrangement, a: int, foot: np.ndarray, members: Sequence[int]) -> Walls:
    """Walls in the half plane (radius, height) about an axis along direction `a`: planes across it, and surfaces `members` about it."""
    direction = arrangement.directions[a]
    levels = np.flatnonzero(direction.detected)
    levels = np.sort(levels[np.argsort(-direction.shown[levels], kind="stable")[: max(MOST_WALLS - len(members), 0)]]).tolist()
    straight = [c for c in members if arrangement.curved[c].kind in ("cylinder", "cone")]
    bent = [c for c in members if c not in straight]
    lines = [(0.0, 1.0, float(direction.offsets[k])) for k in levels]
    lines += [_line_about(arrangement.curved[c], direction.vector) for c in straight]
    middles = [np.asarray(arrangement.curved[c].point) @ direction.vector for c in bent]
    centers = [(sum(arrangement.curved[c].sizes[:-1]), height) for c, height in zip(bent, middles, strict=True)]
    corners = corners_of(arrangement.bounds) - foot
    heights = corners @ direction.vector
    reach = np.sqrt(np.maximum((corners**2).sum(1) - heights**2, 0)).max()
    table = np.array(lines).reshape(-1, 3)
    return Walls(
        table[:, :2],
        table[:, 2],
        np.array(centers).reshape(-1, 2),
        np.array([arrangement.curved[c].sizes[-1] for c in bent]),
        np.array([[0.0, heights.min()], [reach, heights.max()]]),
        (*((a, k) for k in levels), *((c, None) for c in (*straight, *bent))),
    )


def _line_about(surface: Surface, along: np.ndarray) -> tuple[float, float, float]:
    """Normal and offset of a cylinder or a cone in the half plane about its axis, its inside in front."""
    if surface.kind == "cylinder":
        return -1.0, 0.0, -surface.sizes[0]
    up, angle = float(np.sign(np.asarray(surface.axis) @ along)), surface.sizes[0]
    return -math.cos(angle), up * math.sin(angle), up * math.sin(angle) * float(np.asarray(surface.point) @ along)


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
        if len(members) > TUBE or any(arrangement.curved[c].kind != "cylinder" for c in members):
            yield a, foot, sorted(members)


def find_faces(planes: Sequence[OutlinePlane], cells: Cells) -> list[np.ndarray]:
    """The face [m] of each cell in each plane."""
    return [plane.faces_of(cells) for plane in planes]


Drawn = tuple[float, tuple[tuple[int, int], ...], bytes]  # what an outline wins, its levels, its faces


class OutlineCells:
    """The outlines over one set of cells: what `Families` asks, plane by plane."""

    def __init__(self, arrangement: Arrangement, cells: Cells, outlines: PricedPlanes, faces: Sequence[np.ndarray] | None = None) -> None:
        self.arrangement, self.outlines, self.planes = arrangement, outlines, outlines.planes
        self._outlines: dict[tuple[int, bytes], Outline] = {}
        self._costs: dict[tuple[int, bytes], float] = {}
        self.faces = find_faces(self.planes, cells) if faces is None else faces
        self._slabs = [cells.slabs[:, p.direction] if p.kind != "revolve" else np.zeros(len(cells.points), np.int16) for p in self.planes]

    @cached_property
    def slots(self) -> list[Slots]:
        """Per plane the slot of each cell in a table of faces and levels, which has one row more for cells that no face has."""
        out = []
        for plane, face, slab in zip(self.planes, self.faces, self._slabs, strict=True):
            levels = self._levels(plane)
            slots = (np.where(face < 0, plane.faces, face) * levels + slab + 1).astype(np.int32)
            out.append(Slots(slots, (plane.faces + 1) * levels))
        return out

    @cached_property
    def table_sizes(self) -> np.ndarray:
        """The numbers of faces and levels of each plane [p, 2]."""
        return np.array([(plane.faces, self._levels(plane)) for plane in self.planes], np.int64).reshape(-1, 2)

    def best(self, index: int, sums: np.ndarray, floor: float) -> Drawn | None:
        """The best outline of a plane by the sums over its slots, less its curves' price; None below `floor`."""
        plane, price = self.planes[index], self.outlines.curve_price
        _, count, lo, hi, wins, faces = offer_outlines(plane.graph, sums, plane.faces, self._levels(plane), 1.0, floor, price, PAID)
        return self.first_drawable(index, wins[:count], (lo, hi), faces)

    def first_drawable(self, index: int, wins: np.ndarray, levels: tuple[int, int], faces: np.ndarray) -> Drawn | None:
        """The first of some outlines of a plane, each with what it wins and its faces [n, f], that can be drawn."""
        ranges = (levels,) if self.planes[index].kind != "revolve" else ()
        for won, inside in zip(wins.tolist(), faces, strict=False):
            packed = np.packbits(inside).tobytes()
            if self._is_drawable(index, ranges, packed):
                return won, ranges, packed
        return None

    def _is_drawable(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes) -> bool:
        """Whether the boundary of a region crosses nothing: a few regions among walls that nearly coincide have none that does not. Walls
        that lean have to do so all one way, and not to meet between the levels."""
        try:
            self._outline(index, faces)
            if isinstance(self.planes[index], DraftedPlane):
                self.primitive(index, ranges, faces)
        except ValueError:
            return False
        return True

    def _levels(self, plane: OutlinePlane) -> int:
        return len(self.arrangement.directions[plane.direction].offsets) if plane.kind != "revolve" else 2

    def widen(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes, matters: np.ndarray) -> bytes:
        """The faces of an outline with others on which no cell between the levels `matters` [m], where that takes no more curves: what is
        cut away ends beyond the part, not in its faces."""
        plane, inside = self.planes[index], self._unpack(index, faces)
        lo, hi = ranges[0] if ranges else (0, 1)
        cells = np.flatnonzero(matters)
        sums = self.slots[index].sum_values(cells, np.ones(len(cells)))
        below = sum_below(sums, plane.faces, self._levels(plane), 1.0)
        harmless = below[:, hi] - below[:, lo] == 0
        gains = np.where(harmless, HARMLESS, np.where(inside, 1.0, -1.0))
        region = best_region(plane, gains, CURVE_OF_WIDER)
        if region is None or (region.inside != inside)[~harmless].any() or region.curves > count_curves(plane, inside):
            return faces
        wider = np.packbits(region.inside).tobytes()
        return wider if self._is_drawable(index, ranges, wider) else faces

    def mask(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes) -> np.ndarray:
        """The cells [m] of an outline between two levels."""
        inside = np.append(self._unpack(index, faces), False)
        covered = inside[self.faces[index]]
        return covered & (self._slabs[index] >= ranges[0][0]) & (self._slabs[index] < ranges[0][1]) if ranges else covered

    def curve_cost(self, index: int, faces: bytes) -> float:
        """What the curves of an outline cost, in volume."""
        known = self._costs.get((index, faces))
        if known is None:
            curves = count_curves(self.planes[index], self._unpack(index, faces))
            known = self._costs[index, faces] = self.outlines.curve_price * count_charged_curves(curves)
        return known

    def _outline(self, index: int, faces: bytes) -> Outline:
        if (index, faces) not in self._outlines:
            self._outlines[index, faces] = draw_outline(self.planes[index], self._unpack(index, faces))
        return self._outlines[index, faces]

    def _unpack(self, index: int, faces: bytes) -> np.ndarray:
        return np.unpackbits(np.frombuffer(faces, np.uint8), count=self.outlines.planes[index].faces).astype(bool)

    def primitive(self, index: int, ranges: Sequence[tuple[int, int]], faces: bytes) -> Primitive:
        """The solid of an outline; one of the six kinds where it is one."""
        plane = self.outlines.planes[index]
        outline = self._outline(index, faces)
        (left, low), (right, high) = outline.bounds
        x, y = (left + right) / 2, (low + high) / 2
        if plane.kind == "revolve":
            turned = np.stack([plane.frame[:, 0], np.cross(plane.frame[:, 1], plane.frame[:, 0]), plane.frame[:, 1]], axis=1)
            center = plane.origin + y * plane.frame[:, 1]
            leaf = Primitive("revolve", (FULL_TURN,), vec(center), euler_from_matrix(turned), outline.shift(0.0, -y))
            return to_simple(leaf) or leaf
        offsets = self.arrangement.directions[plane.direction].offsets
        bottom, top = float(offsets[ranges[0][0]]), float(offsets[ranges[0][1]])
        if isinstance(plane, DraftedPlane):
            # drawn where the part ends, not beyond: an opening is as wide as it is there
            low, high = span_along(self.arrangement.part, plane.frame[:, 2])
            leaf = draft_leaf(plane, outline, self._unpack(index, faces), max(bottom, low), min(top, high))
            return to_simple(leaf) or leaf
        center = plane.frame @ np.array([x, y, (bottom + top) / 2])
        leaf = Primitive("extrude", (top - bottom,), vec(center), euler_from_matrix(plane.frame), outline.shift(-x, -y))
        return to_simple(leaf) or leaf
