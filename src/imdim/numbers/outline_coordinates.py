"""Coordinates of an outline that move on their own: what a fit may change without a line along x or y losing its direction.

A vertex has two, x and y, and an arc the height over its chord; a line exactly along an axis of the plane joins those of its ends, a full
circle has its centre and radius, and what lies on the axis of a turned outline stays there. An ellipse has its centre, and both semi-axes
grow alike. All are lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.sparse import csr_array

from imdim.geometry.lowering import Outlines
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Ring, circle_of
from imdim.program.tree import Primitive

MOST_BENT = 3.0  # bulge of an arc; a step makes none rounder
LEAST_AXIS = 0.1  # of a semi-axis, which a step leaves
LEAST_NORMAL = 1e-9  # of length 1, below which what is left of a normal in the outline's plane is rounding
SMALL = 1e-6  # half an arc's turn, in radians, below which it is a line


@dataclass(frozen=True)
class OutlineCoordinates:
    """`map` [3 v, p] takes steps of the coordinates to those of all vertices, x, y and an arc's height, loop after loop; an ellipse counts
    as a vertex, its centre, with what its semi-axes grow by as the height."""

    outline: Outline
    map: np.ndarray

    @property
    def count(self) -> int:
        return self.map.shape[1]

    def rows(self, points: np.ndarray, normals: np.ndarray) -> csr_array:
        """How far along their outward unit `normals` [n, 2] the `points` [n, 2] of the outline move by each coordinate: [n, p]. Few of an
        outline with many curves move a point."""
        curves = Outlines.pack([self.outline]).curves
        # one kind of array is one kernel to compile
        flat = np.ascontiguousarray(points), np.ascontiguousarray(normals)
        values, columns = _vertex_rows(curves, _following(self.outline), *flat)
        starts = np.arange(0, values.size + 1, values.shape[1])
        return csr_array((values.ravel(), columns.ravel(), starts), (len(points), len(self.map))) @ csr_array(self.map)

    def move(self, step: np.ndarray) -> Outline:
        """The outline after a step [p]. Raises ValueError for one that bounds nothing."""
        moves = (self.map @ step).reshape(-1, 3).tolist()
        loops, first = [], 0
        for loop in self.outline.loops:
            loops.append(_move_loop(loop, moves[first : first + len(loop)]))
            first += len(loop)
        return Outline(tuple(loops))


@lru_cache(maxsize=4096)
def outline_coordinates(outline: Outline, turned: bool) -> OutlineCoordinates:
    """The coordinates of an outline that is extruded or `turned`."""
    slots = list(range(3 * sum(map(len, outline.loops))))
    scale, fixed, circles = np.ones(len(slots)), set[int](), list[int]()
    first = 0
    for loop in outline.loops:
        if circle_of(loop):
            circles.append(first)
        elif not isinstance(loop, Ellipse):
            _join_slots(loop, 3 * first, slots, fixed, turned)
        first += len(loop)
    columns = []
    for root in dict.fromkeys(slots):
        members = [i for i, s in enumerate(slots) if s == root]
        if not fixed.intersection(members) and not any(3 * c <= members[0] < 3 * c + 6 for c in circles):
            columns.append((members, scale[members]))
    for c in circles:
        x, y = [3 * c, 3 * c + 3], [3 * c + 1, 3 * c + 4]
        away = np.sign(loop_vertex(outline, c + 1)[0] - loop_vertex(outline, c)[0])  # a circle's are vertices
        columns += [(x, np.ones(2)), (y, np.ones(2)), (x, np.array([-away, away]))]
    table = np.zeros((len(slots), len(columns)))
    for j, (members, by) in enumerate(columns):
        table[members, j] = by
    return OutlineCoordinates(outline, table)


def loop_vertex(outline: Outline, index: int) -> tuple[float, float, float]:
    """The vertex of this index, loop after loop, ellipses counted."""
    return [v for loop in outline.loops for v in ([(loop.x, loop.y, 0.0)] if isinstance(loop, Ellipse) else loop)][index]


def center_leaf(leaf: Primitive) -> Primitive:
    """The same solid with the bounding box of its outline about the origin, of a turned one about height 0; others as they are."""
    if leaf.outline is None:
        return leaf
    (left, low), (right, high) = leaf.outline.bounds
    x, y = (0.0 if leaf.kind == "revolve" else (left + right) / 2), (low + high) / 2
    away = np.array([0.0, 0.0, y] if leaf.kind == "revolve" else [x, y, 0.0])
    center = np.array(leaf.center) + matrix_from_euler(leaf.rotation) @ away
    return replace(leaf, center=tuple(center.tolist()), outline=leaf.outline.shift(-x, -y))


def _join_slots(loop: Ring, first: int, slots: list[int], fixed: set[int], turned: bool) -> None:
    """Give coordinates that a line along x or y holds together one slot, and note the `fixed` ones."""
    n = len(loop)
    for i, (x, y, bulge) in enumerate(loop):
        j = (i + 1) % n
        if turned and x == 0:
            fixed.add(slots[first + 3 * i])
        if bulge == 0:
            fixed.add(first + 3 * i + 2)
            for c, same in ((0, x == loop[j][0]), (1, y == loop[j][1])):
                if same:
                    old, new = slots[first + 3 * j + c], slots[first + 3 * i + c]
                    fixed.update({new} if old in fixed else ())
                    slots[:] = [new if s == old else s for s in slots]


def _move_loop(loop: Loop, moves: list[list[float]]) -> Loop:
    if isinstance(loop, Ellipse):
        ((dx, dy, grown),) = moves
        rx, ry = (max(r + grown, LEAST_AXIS * r) for r in (loop.rx, loop.ry))
        return replace(loop, rx=rx, ry=ry, x=loop.x + dx, y=loop.y + dy)
    corners = [(x + dx, y + dy) for (x, y, _), (dx, dy, _) in zip(loop, moves, strict=True)]
    out = []
    for i, ((x, y, bulge), (_, _, by)) in enumerate(zip(loop, moves, strict=True)):
        j = (i + 1) % len(loop)
        if bulge and not circle_of(loop):
            bulge = max(-MOST_BENT, min(MOST_BENT, bulge + 2 * by / max(math.dist((x, y), loop[j][:2]), 1e-300)))
        out.append((*corners[i], bulge))
    return tuple(out)


def _following(outline: Outline) -> np.ndarray:
    """The vertex at the end of each curve."""
    out, first = [], 0
    for loop in outline.loops:
        out += [*range(first + 1, first + len(loop)), first]
        first += len(loop)
    return np.array(out)


@njit(nogil=True, cache=True)
def _vertex_rows(curves, following, points, normals):  # pragma: no cover - compiled
    """How far along their normals the points move by x and y of the vertex before them, by the height of its arc, and by x and y of the
    vertex behind them, [n, 5], and which of the 3 v numbers of all vertices these are [n, 5]."""
    out, which = np.zeros((len(points), 5)), np.zeros((len(points), 5), np.int64)
    for j in range(len(points)):
        if abs(normals[j, 0]) + abs(normals[j, 1]) < LEAST_NORMAL:  # on an end
            continue
        i = _find_nearest(curves, points[j, 0], points[j, 1])
        if curves[i, 7] < 0.0:
            _, at = _place_on_ellipse(curves[i], points[j, 0], points[j, 1])
        else:
            at = _place_on(curves[i], points[j, 0], points[j, 1])
        first, after = 3 * i, 3 * following[i]
        which[j, 0], which[j, 1], which[j, 2], which[j, 3], which[j, 4] = first, first + 1, first + 2, after, after + 1
        nx, ny, half = normals[j, 0], normals[j, 1], 2 * math.atan(curves[i, 4])
        ux, uy = curves[i, 2] - curves[i, 0], curves[i, 3] - curves[i, 1]
        if curves[i, 7] < 0.0:
            cosine, sine, length = math.cos(at), math.sin(at), math.sqrt(ux * ux + uy * uy)
            out[j, 0], out[j, 1] = nx, ny
            out[j, 2] = (nx * (cosine * ux - sine * uy) + ny * (cosine * uy + sine * ux)) / length
            continue
        along, aside, along_by, aside_by = _arc(at, half)
        # a point of a curve is start + along * chord + aside * chord turned left
        ex, ey = along * nx + aside * ny, along * ny - aside * nx
        out[j, 0], out[j, 1], out[j, 3], out[j, 4] = nx - ex, ny - ey, ex, ey
        if half != 0.0:
            # the tangent of half a turn's half is twice the height by the chord
            by_height = math.cos(half / 2) ** 2 * 4 / math.sqrt(ux * ux + uy * uy)
            out[j, 2] = (along_by * (ux * nx + uy * ny) + aside_by * (ux * ny - uy * nx)) * by_height
    return out, which


@njit(nogil=True, cache=True)
def _find_nearest(curves, x, y):  # pragma: no cover - compiled
    """Which of the curves is the nearest to a point, without an angle of it."""
    nearest2, nearest = np.inf, 0
    for c in range(len(curves)):
        ax, ay, bx, by, bulge, cx, cy, radius = curves[c]
        if radius < 0.0:
            d2, _ = _place_on_ellipse(curves[c], x, y)
        else:
            ux, uy, wx, wy = bx - ax, by - ay, x - ax, y - ay
            at = min(max((wx * ux + wy * uy) / (ux * ux + uy * uy), 0.0), 1.0)
            px, py = wx - at * ux, wy - at * uy
            if bulge != 0.0:
                away = max(math.hypot(x - cx, y - cy), 1e-300)
                gx, gy = cx + (x - cx) * radius / away, cy + (y - cy) * radius / away
                if (ux * (gy - ay) - uy * (gx - ax)) * bulge <= 0:
                    px, py = x - gx, y - gy
                else:
                    px, py = (wx, wy) if wx * wx + wy * wy < (x - bx) ** 2 + (y - by) ** 2 else (x - bx, y - by)
            d2 = px * px + py * py
        if d2 < nearest2:
            nearest2, nearest = d2, c
    return nearest


@njit(nogil=True, cache=True)
def _place_on(curve, x, y):  # pragma: no cover - compiled
    """Where along a curve the foot of a point is, 0 to 1."""
    ax, ay, bx, by, bulge, cx, cy, _ = curve
    if bulge == 0.0:
        ux, uy = bx - ax, by - ay
        return min(max(((x - ax) * ux + (y - ay) * uy) / (ux * ux + uy * uy), 0.0), 1.0)
    turn = 4 * math.atan(bulge)
    px, py, qx, qy = ax - cx, ay - cy, x - cx, y - cy
    angle = math.copysign(1.0, turn) * math.atan2(px * qy - py * qx, px * qx + py * qy)
    # measured from the middle of the arc what lies beyond an end is nearer to that end
    middle = abs(turn) / 2
    angle = (angle - middle + math.pi) % (2 * math.pi) - math.pi + middle
    return min(max(angle / abs(turn), 0.0), 1.0)


@njit(nogil=True, cache=True)
def _place_on_ellipse(curve, x, y):  # pragma: no cover - compiled
    """Squared distance of a point near an ellipse from the point on it at the same eccentric angle, and that angle."""
    ax, ay, bx, by, ratio, cx, cy, _ = curve
    ux, uy, wx, wy = (bx - ax) / 2, (by - ay) / 2, x - cx, y - cy
    square, across = ux * ux + uy * uy, abs(ratio)
    p, q = (wx * ux + wy * uy) / square, (wy * ux - wx * uy) / (across * square)
    away = max(math.sqrt(p * p + q * q), 1e-300)
    return ((p - p / away) ** 2 + (across * (q - q / away)) ** 2) * square, math.atan2(q, p)


@njit(nogil=True, cache=True)
def _arc(at, half):  # pragma: no cover - compiled
    """A place on the arc over a unit chord from 0 to 1 that turns by twice `half`: along it, to its left, and both by `half`."""
    if abs(half) <= SMALL:
        return at, 0.0, 0.0, 0.0
    by = 2 * at - 1
    sine, cosine = math.sin(half), math.cos(half)
    radius, radius_by, rise = 0.5 / sine, -0.5 * cosine / sine**2, cosine - math.cos(half * by)
    along_by = radius_by * math.sin(half * by) + radius * by * math.cos(half * by)
    return 0.5 + radius * math.sin(half * by), radius * rise, along_by, radius_by * rise + radius * (by * math.sin(half * by) - sine)
