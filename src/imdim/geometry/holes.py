"""Find the holes of a program: round and hexagonal walls about an axis that is in the air, with material around them.

Which walls there may be is read off the leaves: cylinders, cones, circles and hexagons of extruded outlines, lines of turned ones. Whether
there is one, and from where to where, is asked of the solid: on a ring just inside it has to be air, on one just outside material. So it
does not matter which leaf cuts what: a hole may be a cutter, a loop of the plate's outline, or the inside of a turned part.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from imdim.geometry.kernels import inside
from imdim.geometry.lowering import Lowered, lower
from imdim.program.ellipse import Ellipse
from imdim.program.holes import SUNK, Hole, HoleSection
from imdim.program.outline import Loop, circle_of, ring_curves
from imdim.program.tree import FULL_TURN, PLANE_ENDS, Primitive, Program, Vec3, leaves, longest, top_of

COAXIAL = 2e-4  # of the largest size, within which walls have one axis
NEXT = 0.05  # of a diameter, by which the walls of one hole may be apart along it: a rounding between them is no wall
SKIN = 2e-3  # of a radius: how far inside and outside a wall it is looked, and how long a wall is at least
AROUND = 0.75  # of a ring outside that has to lie in material; the rest may be cut away at an edge
WIDEST = 3.0  # times the diameter of a hole: what is wider still is another hole, or no seat of a screw (DIN 974: 2 and less)
STATIONS = 16  # along a wall, beside those between the faces of leaves
ANGLES = np.arange(24) * 2 * np.pi / 24 + np.pi / 24  # of a ring; none is a corner of a hexagon
COSINES, SINES = np.cos(ANGLES), np.sin(ANGLES)
HALVINGS = 40
CLOSE = 1e-7  # of the largest size: faces that are nearer to each other have nothing between them
POINT = 0.05  # of the widest radius of a wall, below which its end is a point
REGULAR = 2e-3  # of its size, by which a hexagon may be off
MOST_WALLS = 300  # that are looked at, which takes seconds


class Wall(NamedTuple):
    """A wall that may be there: about `origin` along unit `axis`, from `low` to `high` along it, with the radii there (of a hexagon the
    distance of its sides), `across` and `up` unit vectors across the axis, the first to a corner of a hexagon."""

    leaf: int
    origin: np.ndarray
    axis: np.ndarray
    across: np.ndarray
    up: np.ndarray
    low: float
    high: float
    radius_low: float
    radius_high: float
    corners: int


@lru_cache(maxsize=16)
def find_holes(program: Program) -> tuple[Hole, ...]:
    """The holes of a program, by their first primitives; none where there are more than MOST_WALLS walls."""
    numbers, parts = lower(program), list(leaves(program))
    walls = list(_all_walls(parts, numbers))
    if not walls or len(walls) > MOST_WALLS:
        return ()
    length = longest(parts)
    solid = _Solid(numbers, _plane_faces(parts, numbers), length)
    found = [hole for group in _coaxial(walls, COAXIAL * length) for hole in solid.holes(group)]
    return tuple(sorted(found, key=lambda h: (h.leaves, h.point)))


def count_walls(program: Program) -> int:
    """How many walls would have to be looked at to find the holes."""
    return sum(1 for _ in _all_walls(list(leaves(program)), lower(program)))


# --- walls that there may be --------------------------------------------------------------------------------------------


def _all_walls(parts: Sequence[Primitive], numbers: Lowered) -> Iterator[Wall]:
    return (wall for i, p in enumerate(parts) for wall in _walls(i, p, numbers))


def _walls(leaf: int, p: Primitive, numbers: Lowered) -> Iterator[Wall]:
    """The round and hexagonal walls of a leaf."""
    turn, center = numbers.rotations[leaf], numbers.centers[leaf]

    def wall(x: float, y: float, low: float, high: float, radii: tuple[float, float], corners: int = 0, angle: float = 0.0) -> Wall:
        across = turn[:, 0] * math.cos(angle) + turn[:, 1] * math.sin(angle)
        origin, up = center + turn[:, 0] * x + turn[:, 1] * y, np.cross(turn[:, 2], across)
        return Wall(leaf, origin, turn[:, 2], across, up, low, high, *radii, corners)

    half = p.size[-1] / 2
    if p.kind == "cylinder":
        yield wall(0.0, 0.0, -half, half, (p.size[0], p.size[0]))
    elif p.kind == "cone":
        yield wall(0.0, 0.0, -half, half, (p.size[0], p.size[1]))
    elif p.kind == "extrude":
        assert p.outline is not None
        for loop in p.outline.loops:
            if (circle := circle_of(loop)) is not None:
                yield wall(circle[0], circle[1], -half, half, (circle[2], circle[2]))
            elif (hexagon := _hexagon(loop)) is not None:
                x, y, flats, angle = hexagon
                yield wall(x, y, -half, half, (flats / 2, flats / 2), 6, angle)
    elif p.kind == "drafted":
        assert p.outline is not None
        half = p.size[0] / 2
        for below, above in zip(p.outline.loops, top_of(p).loops, strict=True):
            if (circle := circle_of(below)) is not None and (end := circle_of(above)) is not None:
                yield wall(circle[0], circle[1], -half, half, (circle[2], end[2]))
    elif p.kind == "revolve" and p.size[0] == FULL_TURN:
        assert p.outline is not None
        for r, z, s, w, bulge in (c for ring in p.outline.rings for c in ring_curves(ring)):
            if not bulge and abs(w - z) > SKIN * max(r, s) and max(r, s) > 0:
                yield wall(0.0, 0.0, min(z, w), max(z, w), (r, s) if z < w else (s, r))


def _hexagon(loop: Loop) -> tuple[float, float, float, float] | None:
    """Centre, width across flats and angle of a corner of a loop that is a regular hexagon, else None."""
    if isinstance(loop, Ellipse) or len(loop) != 6 or any(bulge for _, _, bulge in loop):
        return None
    corners = np.array(loop)[:, :2]
    center = corners.mean(0)
    arms = corners - center
    reach = np.hypot(*arms.T)
    sides = np.hypot(*(corners - np.roll(corners, 1, 0)).T)
    if max(np.ptp(reach), np.ptp([*sides, *reach])) > REGULAR * reach.mean():
        return None
    return float(center[0]), float(center[1]), float(reach.mean() * math.sqrt(3)), math.atan2(arms[0, 1], arms[0, 0])


def _plane_faces(parts: Sequence[Primitive], numbers: Lowered) -> tuple[np.ndarray, np.ndarray]:
    """Points [m, 3] and normals [m, 3] of the plane faces of all leaves."""
    points, normals = [], []
    for leaf, p in enumerate(parts):
        turn, center = numbers.rotations[leaf], numbers.centers[leaf]
        ends = [(axis, side * p.size[column] / 2) for axis, column in PLANE_ENDS.get(p.kind, {}).items() for side in (-1, 1)]
        if p.kind == "revolve" and p.outline is not None:
            ends = [(2, z) for z in sorted({y for ring in p.outline.rings for _, y, _ in ring})]
        for axis, at in ends:
            points.append(center + turn[:, axis] * at)
            normals.append(turn[:, axis])
        if p.kind == "extrude" and p.outline is not None:
            for x, y, u, v, bulge in (c for ring in p.outline.rings for c in ring_curves(ring)):
                if not bulge:
                    points.append(center + turn[:, 0] * x + turn[:, 1] * y)
                    normals.append((turn[:, 0] * (v - y) - turn[:, 1] * (u - x)) / math.hypot(u - x, v - y))
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def _coaxial(walls: Sequence[Wall], slack: float) -> Iterator[list[Wall]]:
    """Walls by their axes, turned to one direction and measured along it from one origin."""
    groups: list[list[Wall]] = []
    for wall in walls:
        middle = wall.origin + wall.axis * (wall.low + wall.high) / 2
        reach = (wall.high - wall.low) / 2
        for first, *_ in groups:
            tilt = float(np.linalg.norm(np.cross(first.axis, wall.axis)))
            if tilt < 0.1 and tilt * reach <= slack and np.linalg.norm(np.cross(first.axis, middle - first.origin)) <= slack:
                break
        else:
            groups.append([wall if _is_forward(wall.axis) else _turned_round(wall)])
            continue
        same = wall if first.axis @ wall.axis > 0 else _turned_round(wall)
        along = float((same.origin - first.origin) @ same.axis)
        group = next(g for g in groups if g[0] is first)
        group.append(same._replace(origin=same.origin - along * same.axis, low=same.low + along, high=same.high + along))
    yield from groups


def _turned_round(wall: Wall) -> Wall:
    return wall._replace(axis=-wall.axis, low=-wall.high, high=-wall.low, radius_low=wall.radius_high, radius_high=wall.radius_low)


def _is_forward(axis: np.ndarray) -> bool:
    return bool(axis[np.abs(axis).argmax()] > 0)


# --- walls that are there -----------------------------------------------------------------------------------------------


class _Stretch(NamedTuple):
    """A wall that is there from `start` to `end` along its axis, and the radii at both."""

    wall: Wall
    start: float
    end: float
    radius_start: float
    radius_end: float

    @property
    def is_seat(self) -> bool:
        """Whether it widens so much that a screw's head sits in it: another screw comes from across."""
        narrow, wide = sorted((self.radius_start, self.radius_end))
        return wide >= narrow * SUNK


@dataclass(frozen=True)
class _Solid:
    """What is asked of the solid; `faces` are points and normals of the plane faces of its leaves, `length` is its largest size."""

    numbers: Lowered
    faces: tuple[np.ndarray, np.ndarray]
    length: float

    def holes(self, walls: Sequence[Wall]) -> Iterator[Hole]:
        """The holes about one axis."""
        for chain in self._chains(self._stretches(walls)):
            low, high = chain[0], chain[-1]
            is_low_open = self._is_open(low.wall, low.start, low.radius_start, -1.0)
            is_high_open = self._is_open(high.wall, high.end, high.radius_end, 1.0)
            if is_low_open or is_high_open:
                hole = _hole(chain, is_low_open, is_high_open)
                if hole.sections[0].diameter > 0:  # nothing is entered through the tip of a cone
                    yield hole

    def _stretches(self, walls: Sequence[Wall]) -> list[_Stretch]:
        """Along an axis the walls that are there, the innermost where there are several."""
        at, lower, upper = self._stations(walls)
        pairs = [(i, k) for k, wall in enumerate(walls) for i in np.flatnonzero((at > wall.low) & (at < wall.high))]
        if not pairs:
            return []
        numbers = np.array([k for _, k in pairs])
        there = self._is_wall(walls, numbers, at[[i for i, _ in pairs]])
        best = np.full(len(at), -1)
        nearest = np.full(len(at), np.inf)
        for (i, k), is_there in zip(pairs, there, strict=True):
            radius = _radius(walls[k], at[i])
            if is_there and radius < nearest[i]:
                best[i], nearest[i] = k, radius
        edges = np.flatnonzero(np.diff(np.concatenate([[-1], best, [-1]])))
        runs = [(first, end - 1, best[first]) for first, end in pairwise(edges) if best[first] >= 0]
        if not runs:
            return []
        first, last, which = np.array(runs).T
        lows, highs = np.array([walls[k].low for k in which]), np.array([walls[k].high for k in which])
        before, after = np.concatenate([[-np.inf], at[:-1]])[first], np.concatenate([at[1:], [np.inf]])[last]
        starts = self._ends(walls, which, at[first], np.maximum(before, lows), np.maximum(lower[first], lows))
        ends = self._ends(walls, which, at[last], np.minimum(after, highs), np.minimum(upper[last], highs))
        return [
            _Stretch(walls[k], a, b, _radius(walls[k], a), _radius(walls[k], b))
            for k, a, b in zip(which, starts.tolist(), ends.tolist(), strict=True)
            if b - a > SKIN * max(_radius(walls[k], a), _radius(walls[k], b))
        ]

    def _stations(self, walls: Sequence[Wall]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places [n] along the axis, one at least between any two faces that lie across it and any two places where walls meet; and the
        nearest such before and after each [n]."""
        points, normals = self.faces
        across = np.abs(normals @ walls[0].axis) > 1 - 1e-9
        levels = (points[across] - walls[0].origin) @ walls[0].axis
        low, high = min(w.low for w in walls), max(w.high for w in walls)
        ends = [t for wall in walls for t in (wall.low, wall.high)]
        levels = np.concatenate([levels, _meetings(walls)])
        cuts = np.unique(np.concatenate([levels[(levels > low) & (levels < high)], ends, np.linspace(low, high, STATIONS)]))
        wide = np.diff(cuts) > CLOSE * self.length
        low, high = cuts[:-1][wide], cuts[1:][wide]
        return (low + high) / 2, low, high

    def _ends(self, walls: Sequence[Wall], which: np.ndarray, there: np.ndarray, gone: np.ndarray, likely: np.ndarray) -> np.ndarray:
        """Where walls [n] end that are there at `there` and no more at `gone`, or just before it: where it is `likely` if that is so, else
        by bisection."""
        step = CLOSE * self.length * np.sign(gone - there)
        beyond = np.abs(gone - likely) > np.abs(step)
        found = self._is_wall(walls, which, likely - step) & ~(beyond & self._is_wall(walls, which, np.where(beyond, likely + step, there)))
        out, open_ = likely.copy(), np.flatnonzero(~found)
        there, gone, which = there[open_], gone[open_], which[open_]
        for _ in range(HALVINGS if len(open_) else 0):
            middle = (there + gone) / 2
            is_wall = self._is_wall(walls, which, middle)
            there, gone = np.where(is_wall, middle, there), np.where(is_wall, gone, middle)
        out[open_] = (there + gone) / 2
        return out

    def _is_wall(self, walls: Sequence[Wall], which: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Whether walls number `which` [n] are there at `at` [n]: air on the axis and inside, material around."""
        rings = [_rings(walls[k], t) for k, t in zip(which, at, strict=True)]
        is_solid = inside(self.numbers, np.concatenate(rings)).reshape(len(rings), 3, len(ANGLES))
        outer, inner, core = is_solid.mean(2).T
        return (outer >= AROUND) & (inner == 0) & (core == 0)

    def _is_open(self, wall: Wall, at: float, radius: float, way: float) -> bool:
        """Whether there is air beyond the end of a hole."""
        beyond = at + way * SKIN * max(radius, wall.radius_low, wall.radius_high)
        ring = _circle(wall, beyond, 0.9 * radius if radius > POINT * max(wall.radius_low, wall.radius_high) else 0.0)
        return bool(inside(self.numbers, ring).mean() < 0.5)

    def _chains(self, stretches: Sequence[_Stretch]) -> Iterator[list[_Stretch]]:
        """Stretches that make one hole: next to each other, or with one diameter on both sides of a gap, as where a drill leaves one ear of
        a fork and enters the other."""
        chain: list[_Stretch] = []
        for stretch in sorted(stretches, key=lambda s: s.start):
            if chain and not self._goes_on(chain[-1], stretch):
                yield chain
                chain = []
            chain.append(stretch)
        if chain:
            yield chain

    def _goes_on(self, a: _Stretch, b: _Stretch) -> bool:
        small, large = sorted((a.radius_end, b.radius_start))
        gap = b.start - a.end
        same = a.wall.corners == b.wall.corners and large - small <= SKIN * large
        if large > WIDEST * small or (gap > NEXT * 2 * large and (not same or a.is_seat or b.is_seat)):
            return False
        at = np.linspace(a.end, b.start, STATIONS + 2)[1:-1, None]
        return gap <= 1e-6 * self.length or not inside(self.numbers, a.wall.origin + at * a.wall.axis).any()


def _meetings(walls: Sequence[Wall]) -> np.ndarray:
    """Where cones have the radii of other walls."""
    low, high, a, b = np.array([(w.low, w.high, w.radius_low, w.radius_high) for w in walls]).T
    slope = (b - a) / (high - low)
    start = a - slope * low
    first, second = np.nonzero(np.abs(slope[:, None] - slope) > SKIN)
    return (start[second] - start[first]) / (slope[first] - slope[second])


def _radius(wall: Wall, at: float) -> float:
    share = (at - wall.low) / (wall.high - wall.low)
    return max(wall.radius_low + share * (wall.radius_high - wall.radius_low), 0.0)


def _rings(wall: Wall, at: float) -> np.ndarray:
    """Points just outside, just inside and halfway to the axis, where the last of them lies: [3 n, 3]."""
    radius = _radius(wall, at)
    rings = [_circle(wall, at, share * radius) for share in (1 + SKIN, 1 - SKIN, 0.5)]
    rings[2][::6] = wall.origin + at * wall.axis
    return np.concatenate(rings)


def _circle(wall: Wall, at: float, radius: float) -> np.ndarray:
    """Points [n, 3] on a circle about the axis, or on a hexagon whose sides are `radius` from it."""
    reach = np.full(len(ANGLES), radius)
    if wall.corners:
        sector = 2 * np.pi / wall.corners
        reach /= np.cos(ANGLES % sector - sector / 2)
    return wall.origin + at * wall.axis + (reach * COSINES)[:, None] * wall.across + (reach * SINES)[:, None] * wall.up


def _hole(chain: Sequence[_Stretch], is_low_open: bool, is_high_open: bool) -> Hole:
    """Entered at its open end; where both are, at the wider one, or from above."""
    low, high = chain[0], chain[-1]
    down = is_high_open
    if is_low_open and is_high_open:
        wide = [(s.wall.corners, r) for s, r in ((low, low.radius_start), (high, high.radius_end))]
        down = wide[1][0] > wide[0][0] or (wide[1][0] == wide[0][0] and wide[1][1] >= wide[0][1] * (1 - SKIN))
    entry = high.end if down else low.start
    axis = high.wall.axis if down else low.wall.axis
    origin = high.wall.origin if down else low.wall.origin
    sections: list[HoleSection] = []
    for s in reversed(chain) if down else chain:
        radii = (s.radius_end, s.radius_start) if down else (s.radius_start, s.radius_end)
        start, end = sorted((abs(s.start - entry), abs(s.end - entry)))
        section = HoleSection(start, end, 2 * radii[0], 2 * radii[1], s.wall.corners, (s.wall.leaf,))
        sections[-1:] = _joined(sections[-1], section) if sections else [section]
    return Hole(_vec3(origin + entry * axis), _vec3(-axis if down else axis), tuple(sections), is_low_open and is_high_open)


def _joined(a: HoleSection, b: HoleSection) -> list[HoleSection]:
    """Two sections that follow each other, one where they have one diameter."""
    same = not a.is_cone and not b.is_cone and a.corners == b.corners and abs(a.diameter - b.diameter) <= SKIN * a.diameter
    leaves = tuple(sorted({*a.leaves, *b.leaves}))
    return [HoleSection(a.start, b.end, a.diameter, a.narrow, a.corners, leaves)] if same else [a, b]


def _vec3(v: np.ndarray) -> Vec3:
    x, y, z = (float(c) + 0.0 for c in v)
    return x, y, z
