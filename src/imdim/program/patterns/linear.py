"""Rows, grids and circles among points: which of them stand at equal steps."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from imdim.program.tree import Vec3
from imdim.program.vectors import dot, is_forward, minus, plus, times

Vec2 = tuple[float, float]
SKEW_POINTS = 24  # of more points grids have right angles
ROUNDING = 1e-9  # degrees
TRIPLES = 14  # of more points circles have their centre at a hub or in the middle of all


class Lattice(NamedTuple):
    """Numbers of points, those along the last step next to each other; one or two counts, and from which point to which each steps."""

    members: tuple[int, ...]
    counts: tuple[int, ...]


class Ring(NamedTuple):
    """Numbers of points counter-clockwise at equal angles (degrees) round a centre."""

    members: tuple[int, ...]
    center: Vec2
    angle: float


def lattices(points: Sequence[Vec3], tolerance: float) -> Iterator[Lattice]:
    """Rows of three points or more that are as long as can be, and grids of two by two or more."""
    grid = _Lookup(points, tolerance)
    for first, at in enumerate(points):
        steps = [minus(p, at) for i, p in enumerate(points) if i != first]
        starts = [s for s in steps if is_forward(s, tolerance) and grid.find(minus(at, s)) is None]
        rows = [(s, grid.run(at, s)) for s in starts]
        yield from (Lattice(tuple(row), (len(row),)) for _, row in rows if len(row) > 2)
        for (u, row), (v, column) in combinations(rows, 2):
            if len(points) <= SKEW_POINTS or abs(dot(u, v)) <= tolerance * math.hypot(*u):
                yield from _grids(grid, u, row, v, column) if _main_axis(u) > _main_axis(v) else _grids(grid, v, column, u, row)


def _main_axis(v: Vec3) -> int:
    """Grids run along x first."""
    return max(range(3), key=lambda a: abs(v[a]))


def _grids(grid: _Lookup, u: Vec3, row: list[int], v: Vec3, column: list[int]) -> Iterator[Lattice]:
    """Grids from one corner: for every width the greatest height."""
    if len(row) < 2 or len(column) < 2 or abs(dot(u, v)) > (1 - 1e-6) * math.hypot(*u) * math.hypot(*v):  # or one row
        return
    rows = [row]
    for start in column[1:]:
        found = grid.run(grid.points[start], u)[: len(rows[-1])]
        if len(found) < 2:
            break
        if len(found) < len(rows[-1]) and len(rows) > 1:
            yield _grid(rows)
        rows = [r[: len(found)] for r in rows] + [found]
    if len(rows) > 1:
        yield _grid(rows)


def _grid(rows: list[list[int]]) -> Lattice:
    return Lattice(tuple(i for row in rows for i in row), (len(rows), len(rows[0])))


class _Lookup:
    """Points by their coordinates, each equal within the tolerance."""

    def __init__(self, points: Sequence[Vec3], tolerance: float) -> None:
        self.points, self.tolerance = points, tolerance
        self._levels = [_levels([p[a] for p in points], tolerance) for a in range(3)]
        self._at = {key: i for i, p in reversed(list(enumerate(points))) if (key := self._key(p)) is not None}

    def find(self, p: Vec3) -> int | None:
        """The number of the point at `p`."""
        return self._at.get(self._key(p))  # type: ignore[arg-type]

    def run(self, start: Vec3, step: Vec3) -> list[int]:
        """The points at `start` and steps from there, as far as there are any; the step is that to the last, shared out."""
        out: list[int] = []
        at: Vec3 = start
        while (found := self.find(at)) is not None and found not in out:
            out.append(found)
            last, n = self.points[found], len(out)
            at = plus(last, step if n == 1 else times(minus(last, start), 1 / (n - 1)))
        return out

    def _key(self, p: Vec3) -> tuple[int, ...] | None:
        out = []
        for value, levels in zip(p, self._levels, strict=True):
            i = bisect_left(levels, value - self.tolerance)
            if i == len(levels) or levels[i] > value + self.tolerance:
                return None
            out.append(i)
        return tuple(out)


def _levels(values: Sequence[float], tolerance: float) -> list[float]:
    out: list[float] = []
    for value in sorted(values):
        if not out or value > out[-1] + tolerance:
            out.append(value)
    return out


def rings(points: Sequence[Vec2], hubs: Sequence[Vec2], tolerance: float) -> Iterator[Ring]:
    """Circles of three points or more: all the way round, or arcs (without a hub of four or more)."""
    centers = {_cell(c, tolerance): (c, False) for c in _centers(points)} | {_cell(c, tolerance): (c, True) for c in hubs}
    for center, hub in centers.values():
        polar = [(math.dist(p, center), math.degrees(math.atan2(p[1] - center[1], p[0] - center[0])) % 360) for p in points]
        todo = [i for i in range(len(points)) if polar[i][0] > 2 * tolerance]
        while len(todo) > 2:
            radius = min(polar[i][0] for i in todo)
            near = sorted((i for i in todo if polar[i][0] <= radius + 2 * tolerance), key=lambda i: polar[i][1])
            todo = [i for i in todo if i not in near]
            slack = math.degrees(2 * tolerance / radius)
            angles = [polar[i][1] for i in near]
            yield from (Ring(tuple(near[i] for i in found), center, angle) for found, angle in _evenly(angles, slack, hub))


def _cell(p: Vec2, tolerance: float) -> tuple[int, int]:
    return round(p[0] / tolerance), round(p[1] / tolerance)


def _centers(points: Sequence[Vec2]) -> Iterator[Vec2]:
    n = len(points)
    if n > 2:
        yield sum(p[0] for p in points) / n, sum(p[1] for p in points) / n
        yield from filter(None, (_circumcenter(a, b, c) for a, b, c in combinations(points, 3)) if n <= TRIPLES else ())


def _circumcenter(a: Vec2, b: Vec2, c: Vec2) -> Vec2 | None:
    """The centre of the circle through three points; None where they are in line."""
    (bx, by), (cx, cy) = (b[0] - a[0], b[1] - a[1]), (c[0] - a[0], c[1] - a[1])
    d = 2 * (bx * cy - by * cx)
    if abs(d) <= 1e-6 * math.hypot(bx, by) * math.hypot(cx, cy):
        return None
    bb, cc = bx * bx + by * by, cx * cx + cy * cy
    return a[0] + (cy * bb - by * cc) / d, a[1] + (bx * cc - cx * bb) / d


def _evenly(angles: Sequence[float], slack: float, hub: bool) -> Iterator[tuple[tuple[int, ...], float]]:
    """The largest full circle among sorted angles, and arcs that are no part of one."""
    for count in range(len(angles), 2, -1):
        full = next((run for start in range(len(angles)) if len(run := _arc(angles, start, 360 / count, slack, count)) == count), None)
        if full:
            yield tuple(full), 360 / count
            break
    for start, second in combinations(range(len(angles)), 2):
        for a, b in ((start, second), (second, start)):
            angle = (angles[b] - angles[a]) % 360
            run = _arc(angles, a, angle, slack, len(angles)) if slack < angle < 180 else []
            if len(run) > (2 if hub else 3) and _at(angles, angles[a] - angle, slack) is None:
                yield tuple(run), angle


def _arc(angles: Sequence[float], start: int, angle: float, slack: float, most: int) -> list[int]:
    out = [start]
    while len(out) < most and (found := _at(angles, angles[start] + len(out) * angle, slack)) is not None and found not in out:
        out.append(found)
    return out


def _at(angles: Sequence[float], angle: float, slack: float) -> int | None:
    """The number of the one of sorted angles, in [0, 360), that is nearest to an angle, where it is within the slack."""
    middle, reach = angle % 360, slack + ROUNDING
    windows = ((middle + turn - reach, middle + turn + reach) for turn in (-360, 0, 360))
    close = (i for low, high in windows for i in range(bisect_left(angles, low), bisect_right(angles, high)))
    off, found = min(((abs((angles[i] - angle + 180) % 360 - 180), i) for i in close), default=(math.inf, -1))
    return found if off <= slack else None
