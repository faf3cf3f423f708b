"""Cutters whose wall or end runs along a face of what they cut, or stops a hair before it: they go on past the material instead.

Where the outline of a cutter follows a face of the solid, what is left there is as thick as the two curves differ by: nothing, or a film
far thinner than anything that was measured. It closes what is open, though its volume does not show. `overshoot` moves plane ends that
only just meet; here the target is known, so that a film may be told from a thin wall that is meant.

A curve of a cutter's outline is free if the cutter would change nothing just beyond it, from the thickness of a film on, and it is needed
if the cutter takes something away right behind it. A run of free curves of which one is needed is replaced by a line further out, to which
the lines beside the run are prolonged. Points tell where that may be. Exact booleans over all of the solid decide: nothing may be added,
and what goes may not be the target's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import matters_at, probes, zone_within
from imdim.geometry.finish.extend import Face, between, length, plane_faces, within
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.solid import bounds_of, exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Curve,
    Loop,
    Outline,
    Point,
    Ring,
    arc_center,
    arc_radius,
    check_crossings,
    circle,
    circle_of,
    curve_bounds,
    nesting,
    orient_loops,
    ring_curves,
)
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, replace_leaves

FILM = 1e-3  # of the target's diagonal: the thickest that is taken for a film
BEHIND = 1e-4  # of it, behind a wall, where a cutter that needs the wall takes something away
REACH = 2e-2  # of it: a cutter goes on by the power of ten below that
NEARER = 0.1  # of that, where there is no room for all of it
STEPS = 4  # from there to where a film ends, at which the cutter may matter
# points of a wall: along its curve, along the axis that it is swept along, and about the one that it is turned about
ACROSS, ALONG, ABOUT = 8, 5, 12
LEANING = 0.3  # least cosine between a line that is prolonged and the way out
OWN = 0.1  # of what a move takes away: the share that may be the target's, whose facets lie inside its curves
SHOWS = 2e-3  # of the target's surface: the two sides of a film that is worth more curves
INSIDE = (1e-5, 1e-4, 1e-3, 1e-2, 0.05, 0.2, 0.5)  # of FILM, out of a wall: where a film shows
MORE_CURVES = 2  # that opening a film may take
STAYS = 1e-3  # of a step: a wall that has moved by less is where it was


def open_films(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` whose cutters go on past faces of the material that they run along or all but reach, where the target `solid` is open too.

    Both are in one frame. The program itself where there is nothing to open. Its solid only loses what is not the target's. Past the
    `deadline` (by default never) the other cutters stay.
    """
    judge = _Judge.of(solid)
    for i in [i for i, sign in enumerate(signs(program)) if sign < 0]:
        if deadline.has_passed():
            break
        program = _open_ends(program, i, judge)
        if list(leaves(program))[i].kind in ("extrude", "revolve"):
            program = _open_walls(program, i, judge)
    return program


@dataclass(frozen=True)
class _Judge:
    """The target, its volume and diagonal, and the step by which cutters go on."""

    solid: Manifold
    volume: float
    size: float
    step: float

    @property
    def strides(self) -> list[float]:
        """Steps to try, the farthest first; a film must lie within each."""
        return [step for step in (self.step, NEARER * self.step) if step > FILM * self.size]

    @staticmethod
    def of(solid: Manifold) -> _Judge:
        corners = bounds_of(solid)
        size = float(np.linalg.norm(corners[1] - corners[0]))
        return _Judge(solid, solid.volume(), size, 10.0 ** math.floor(math.log10(REACH * size)))

    def allows(self, program: Program, i: int, leaf: Primitive) -> bool:
        """Whether `leaf` may take the place of cutter `i`: it takes away what that does, and beyond it nothing that is the target's. One of
        more curves has to open a film that shows."""
        placed = _posed(program)
        old, new = placed[i], PosedPrimitive(leaf)
        if (old.solid - new.solid).volume() > NOTHING * self.volume:
            return False
        further = new.solid - old.solid
        gone = zone_within(program, placed, i, new, further)
        if _curves(leaf) > _curves(old.leaf) and gone.surface_area() < SHOWS * self.solid.surface_area():
            return False
        return (gone ^ self.solid).volume() <= max(OWN * gone.volume(), NOTHING * self.volume)


def _curves(leaf: Primitive) -> int:
    return 0 if leaf.outline is None else leaf.outline.curve_count


def _open_ends(program: Program, i: int, judge: _Judge) -> Program:
    """With the plane ends of cutter `i` that a film parts from the open moved past it; ends that only meet a face are for `overshoot`."""
    for face in plane_faces(list(leaves(program))[i]):
        leaf = list(leaves(program))[i]
        if length(leaf, face) < 4 * FILM * judge.size:
            continue
        for step in judge.strides:
            further = between(leaf, face, -length(leaf, face), step)
            if any(_look_beyond(program, i, [_end(leaf, face, judge)], judge, step).film) and judge.allows(program, i, further):
                program = replace_leaves(program, {i: further})
                break
    return program


def _end(leaf: Primitive, face: Face, judge: _Judge) -> _Wall:
    """Points of a plane end."""
    out = face[1] * exact_rotation(leaf)[:, face[0]]
    points = probes(within(leaf, face, BEHIND * judge.size))
    top = leaf.center @ out + length(leaf, face) / 2
    return _Wall(points + (top - points @ out)[:, None] * out, np.repeat(out[None], len(points), axis=0))


def _open_walls(program: Program, i: int, judge: _Judge) -> Program:
    """With the walls of the outline of cutter `i` further out where a film or nothing parts them from the open."""
    outline = list(leaves(program))[i].outline
    assert outline is not None
    for k, (loop, side) in enumerate(zip(outline.loops, nesting(outline.loops), strict=True)):
        while side > 0 and not isinstance(loop, Ellipse):
            opened = _open_wall(program, i, k, judge)
            if opened is program:
                break
            program = opened
    return program


def _open_wall(program: Program, i: int, k: int, judge: _Judge) -> Program:
    """With one run of walls over loop `k` further out; the program itself where none may be."""
    leaf = list(leaves(program))[i]
    assert leaf.outline is not None
    ring = orient_loops(leaf.outline.loops)[k]
    assert not isinstance(ring, Ellipse)
    walls = [_wall(leaf, curve) for curve in ring_curves(ring)]
    for step in judge.strides:
        for wider in _wider(ring, _look_beyond(program, i, walls, judge, step), step):
            redrawn = redraw_loop(leaf, k, wider)
            if redrawn is not None and judge.allows(program, i, redrawn):
                return replace_leaves(program, {i: redrawn})
    return program


@lru_cache(maxsize=2)
def _posed(program: Program) -> list[PosedPrimitive]:
    """The leaves in their places, which every wall asks for."""
    return [PosedPrimitive(leaf) for leaf in leaves(program)]


@dataclass(frozen=True)
class _Wall:
    """Points [n, 3] of a wall or an end of a cutter, and the normals `out` [n, 3] of it there."""

    points: np.ndarray
    out: np.ndarray


@dataclass(frozen=True)
class _Seen:
    """For each wall whether it is `free`, whether it is free and `needed`, and whether it is both and a `film` is before it."""

    free: tuple[bool, ...]
    needed: tuple[bool, ...]
    film: tuple[bool, ...]


def _look_beyond(program: Program, i: int, walls: Sequence[_Wall], judge: _Judge, step: float) -> _Seen:
    """What points up to a `step` beyond them tell of walls of cutter `i`."""
    placed = _posed(program)

    def matters(which: Sequence[int], out: float) -> list[int]:
        """Those of the walls so far out of which the cutter would matter."""
        if not which:
            return []
        found = matters_at(program, placed, i, np.concatenate([walls[k].points + out * walls[k].out for k in which]))
        ends = np.cumsum([len(walls[k].points) for k in which])[:-1]
        return [k for k, shows in zip(which, np.split(found, ends), strict=True) if shows.any()]

    free = list(range(len(walls)))
    for out in np.linspace(FILM * judge.size, step, STEPS).tolist():
        stuck = matters(free, out)
        free = [k for k in free if k not in stuck]
    needed = matters(free, -BEHIND * judge.size)
    film = {k for share in INSIDE for k in matters(needed, share * FILM * judge.size)}
    numbers = range(len(walls))
    return _Seen(tuple(k in free for k in numbers), tuple(k in needed for k in numbers), tuple(k in film for k in numbers))


def _wall(leaf: Primitive, curve: Curve) -> _Wall:
    """Points of the wall over a curve of an outlined leaf."""
    flat, out = _along(curve)
    if leaf.kind == "extrude":
        levels = np.repeat(leaf.size[0] * ((np.arange(ALONG) + 0.5) / ALONG - 0.5), ACROSS)
        points = np.column_stack([np.tile(flat, (ALONG, 1)), levels])
        normals = np.column_stack([np.tile(out, (ALONG, 1)), np.zeros(len(levels))])
    else:
        turns = np.radians(leaf.size[0]) * (np.arange(ABOUT) + 0.5) / ABOUT
        points, normals = _turn(flat, turns), _turn(out, turns)
    rotation = exact_rotation(leaf)
    return _Wall(points @ rotation.T + leaf.center, normals @ rotation.T)


def _turn(flat: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Vectors [n, 2] of the half plane (radius, height), turned by angles [t] about the axis [t n, 3]."""
    return np.concatenate([np.column_stack([flat[:, 0] * math.cos(t), flat[:, 0] * math.sin(t), flat[:, 1]]) for t in turns])


def _along(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 2] of a curve, and the normals [n, 2] to the right of it."""
    x, y, u, v, bulge = curve
    share = (np.arange(ACROSS)[:, None] + 0.5) / ACROSS
    if not bulge:
        normal = np.array([v - y, x - u]) / math.hypot(u - x, v - y)
        return (1 - share) * (x, y) + share * (u, v), np.repeat(normal[None], ACROSS, axis=0)
    cx, cy = arc_center(curve)
    angle = math.atan2(y - cy, x - cx) + 4 * math.atan(bulge) * share[:, 0]
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.array([cx, cy]) + arc_radius(curve) * ray, math.copysign(1.0, bulge) * ray


def _wider(ring: Ring, seen: _Seen, step: float) -> list[Ring]:
    """Rings with a run of free curves that are needed further out, those of fewest curves first; of more only where there is a film."""
    if not any(seen.needed):
        return []
    if all(seen.free):
        return [_around(ring, step)]
    found: list[Ring] = []
    for first, count in _runs(seen.free):
        inner = [k for k in range(count) if seen.needed[(first + k) % len(ring)]]
        film = any(seen.film[(first + k) % len(ring)] for k in range(count))
        for start, end in dict.fromkeys([(inner[0], inner[-1] + 1), (0, count)]) if inner else ():
            moved = straighten_run(ring, (first + start) % len(ring), end - start, step)
            # a wall that stays where it was is not opened, and would be asked for again and again
            opens = moved and not any(_is_along(moved, ring_curves(ring)[(first + k) % len(ring)], step) for k in inner)
            found += [moved] if moved and opens and len(moved) <= len(ring) + MORE_CURVES * film else []
        if film:
            around = _surround_run(ring, first, count, step)
            found += [around] if len(around) <= len(ring) + MORE_CURVES else []
    return sorted(found, key=len)


def _is_along(ring: Ring, wall: Curve, step: float) -> bool:
    """Whether a line of a ring runs along a straight wall."""
    x, y, u, v, bulge = wall
    lines = [] if bulge else [np.array(c[:4]).reshape(2, 2) for c in ring_curves(ring) if not c[4]]
    middle = np.array([x + u, y + v]) / 2
    return any(_off_line(middle, line) < STAYS * step for line in lines)


def _off_line(point: np.ndarray, line: np.ndarray) -> float:
    """Distance of a point [2] from a line between two [2, 2]."""
    along = line[1] - line[0]
    share = np.clip((point - line[0]) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(point - line[0] - share * along))


def _runs(flags: Sequence[bool]) -> Iterator[tuple[int, int]]:
    """Start and length of each run of true flags round a ring that has a false one."""
    start = next(k for k, flag in enumerate(flags) if not flag)
    turned = [(start + k) % len(flags) for k in range(len(flags))]
    for flag, run in groupby(turned, lambda k: flags[k]):
        members = list(run)
        if flag:
            yield members[0], len(members)


def _around(ring: Ring, step: float) -> Ring:
    """A ring round another: a larger circle round a circle, else a rectangle."""
    found = circle_of(ring)
    if found is not None:
        x, y, radius = found
        return circle(radius + step, x, y)
    (left, low), (right, high) = curve_bounds(ring_curves(ring))
    left, low, right, high = left - step, low - step, right + step, high + step
    return ((left, low, 0.0), (right, low, 0.0), (right, high, 0.0), (left, high, 0.0))


def straighten_run(ring: Ring, first: int, count: int, step: float) -> Ring | None:
    """The ring with a line beyond the `count` curves from number `first` in their place; the lines beside them are prolonged to it, and
    where an arc is beside them a line leads there. None where that line has no length."""
    n = len(ring)
    curves = ring_curves(ring)
    run, before, after = [curves[(first + k) % n] for k in range(count)], curves[first - 1], curves[(first + count) % n]
    start, end = np.array(run[0][:2]), np.array(run[-1][2:4])
    if not (reach := float(np.linalg.norm(end - start))):
        return None
    along = (end - start) / reach
    out = np.array([along[1], -along[0]])
    _, (_, highest) = _bounds_in(run, along, out, start)
    height = max(highest, 0.0) + step
    lead_out, lead_in = _lead(before, 1.0, out), _lead(after, -1.0, out)
    begin = start + height * (out if lead_out is None else lead_out)
    close = end + height * (out if lead_in is None else lead_in)
    if (close - begin) @ along <= step:
        return None
    kept = [ring[(first + count + k) % n] for k in range(1, n - count)]
    x, y, bulge = ring[(first + count) % n]
    head = [] if lead_out is not None else [(*map(float, start), 0.0)]
    tail = [(*map(float, close), 0.0), (x, y, bulge)] if lead_in is None else [(*map(float, close), bulge)]
    return (*head, (*map(float, begin), 0.0), *tail, *kept)  # type: ignore[return-value]


def _surround_run(ring: Ring, first: int, count: int, step: float) -> Ring:
    """The ring with the box of the `count` curves from number `first`, larger by a step, in their place.

    It is entered and left along the lines beside them, or the shortest way where an arc is beside them.

    It takes in what reaches farther sideways than where the run begins and ends, such as an arc of more than half a turn.
    """
    n = len(ring)
    curves = ring_curves(ring)
    (left, low), (right, high) = curve_bounds([curves[(first + k) % n] for k in range(count)])
    box = np.array([[left - step, low - step], [right + step, high + step]])
    before, after = curves[first - 1], curves[(first + count) % n]
    start, end = np.array(ring[first][:2]), np.array(after[:2])
    begin, close = _leave_box(box, start, before, 1.0), _leave_box(box, end, after, -1.0)
    around = [begin, *_corners_between(box, begin, close), close]
    head = [] if not before[4] else [start]
    x, y, bulge = ring[(first + count) % n]
    tail = [] if not bulge else [(x, y, bulge)]
    kept = [ring[(first + count + k) % n] for k in range(1, n - count)]
    lines = [(float(u), float(v), 0.0) for u, v in (*head, *around)]
    return (*lines, *tail, *kept)


def _leave_box(box: np.ndarray, point: np.ndarray, beside: Curve, way: float) -> np.ndarray:
    """Where the border of a box [2, 2] is met from a point [2] in it.

    Along the curve beside it, passed forwards or back (`way`), if that is a line, else the shortest way.
    """
    x, y, u, v, bulge = beside
    ray = way * np.array([u - x, v - y])
    if bulge:
        gaps = np.abs(box - point)
        side, axis = np.unravel_index(int(gaps.argmin()), gaps.shape)
        ray = np.zeros(2)
        ray[axis] = 2.0 * side - 1.0
    with np.errstate(divide="ignore"):
        reach = np.where(ray > 0, (box[1] - point) / ray, np.where(ray < 0, (box[0] - point) / ray, math.inf))
    axis = int(reach.argmin())
    met = point + reach[axis] * ray
    met[axis] = box[int(ray[axis] > 0), axis]
    return met


def _corners_between(box: np.ndarray, begin: np.ndarray, close: np.ndarray) -> list[np.ndarray]:
    """Corners of a box [2, 2] that are passed from one point of its border to another, its middle on the left."""
    (left, low), (right, high) = box
    corners = [np.array(c) for c in ((right, low), (right, high), (left, high), (left, low))]

    def passed(point: np.ndarray) -> float:
        """Sides of the box, the bottom first, up to a point of it."""
        x, y = (point - box[0]) / (box[1] - box[0])
        return [y + 1.0, 3.0 - x, 4.0 - y, x][int(np.abs([1.0 - x, 1.0 - y, x, y]).argmin())]

    first, last = passed(begin), passed(close)
    last += 4.0 * (last <= first)
    return [corners[(k - 1) % 4] for k in range(1, 9) if first < k < last]


def _lead(curve: Curve, way: float, out: np.ndarray) -> np.ndarray | None:
    """By how much [2] a line beside a run, passed forwards or back (`way`), moves on per unit of the way `out` [2]; None for an arc and for
    a line that hardly leads there."""
    x, y, u, v, bulge = curve
    ray = way * np.array([u - x, v - y]) / math.hypot(u - x, v - y)
    return None if bulge or ray @ out < LEANING else ray / (ray @ out)


def _bounds_in(run: Sequence[Curve], along: np.ndarray, out: np.ndarray, start: np.ndarray) -> tuple[Point, Point]:
    """Low and high corner of curves in the frame of a chord."""

    def turn(x: float, y: float) -> Point:
        away = np.array([x, y]) - start
        return float(away @ along), float(away @ out)

    # the frame is left-handed: arcs turn the other way
    return curve_bounds([(*turn(x, y), *turn(u, v), -bulge) for x, y, u, v, bulge in run])


def redraw_loop(leaf: Primitive, k: int, ring: Loop) -> Primitive | None:
    """The leaf with another loop number `k`, the box of its outline about its centre; None where curves cross."""
    assert leaf.outline is not None
    try:
        outline = Outline(tuple(ring if j == k else loop for j, loop in enumerate(leaf.outline.loops)))
        (left, low), (right, high) = outline.bounds
        x, y = (left + right) / 2 if leaf.kind == "extrude" else 0.0, (low + high) / 2
        local = np.array([x, y, 0.0]) if leaf.kind == "extrude" else np.array([0.0, 0.0, y])
        a, b, c = (leaf.center + exact_rotation(leaf) @ local).tolist()
        check_crossings(outline)
        return replace(leaf, center=(a, b, c), outline=outline.shift(-x, -y))
    except ValueError:
        return None
