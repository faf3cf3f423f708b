"""Outlines that a noisy cloud shows: turned about axes, from all points by radius and height, and extruded, from those between two levels.

A wall stands on its outline in both views, whatever its shape; `curve_tracing` finds the closed curves, `curve_fitting` draws them.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations, product
from operator import itemgetter

import numpy as np
from scipy import ndimage

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.geometry.surface import vec
from imdim.numbers.outline_coordinates import center_leaf
from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Loop,
    Outline,
    Ring,
    check_crossings,
    circle,
    flatten_loop,
    loop_area,
    nesting,
    rectangle,
    reverse_ring,
    shift_loop,
)
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import FULL_TURN, Primitive
from imdim.search.mdl.curve_fitting import fit_outline
from imdim.search.mdl.curve_tracing import find_sides, trace_borders
from imdim.search.mdl.even_stretches import find_even_stretches

SECTORS = 12  # of a turn
ALL_AROUND = 0.6  # of the sectors that so many points would fill: what is turned
BESIDE = 2.0  # deviations of the noise about a level or an axis that hide what else is there
FEWEST = 120  # points that show an outline
MOST_LEVELS = 4  # of which all pairs are looked at
BORNE = 0.5  # share of an outline's points, and of the points meant, that must be near one another
NEAR = 2.5  # deviations of the noise
MOST_REDRAWN = 6
LONG = 6.0  # deviations of the noise, the least length of an even stretch
SAME_ENDS = 3.0  # deviations of the noise by which the ends of a stretch lie off levels that say the same
FULL = 0.9  # of its box, that a hole fills which is taken for a rectangle
SEGMENTS, MOST_WALKED = 96, 4096  # of a circle that is walked along, and places on the walk
BULGING = (0.7, 1.0, 2.0)  # deviations of the noise by which points lie off a wall that is drawn anew: less draws steps that hardly show


def trace_turned_outlines(points: np.ndarray, axes: np.ndarray, k: int, centers: Iterable[np.ndarray], sigma: float) -> Iterator[Primitive]:
    """Solids turned about lines along column `k` of `axes` [3, 3] through the `centers` [2] in the other two."""
    frame, local = frame_from_axis(axes[:, k]), points @ axes
    across = [(k + 1) % 3, (k + 2) % 3]
    for center in centers:
        arm = local[:, across] - center
        profile = np.column_stack([np.hypot(*arm.T), local[:, k]])
        profile = profile[_is_all_around(profile, np.arctan2(arm[:, 1], arm[:, 0]), sigma)]
        for outline in _draw(profile, sigma, turned=True):
            middle = np.zeros(3)
            middle[across] = center
            leaf = Primitive("revolve", (FULL_TURN,), vec(axes @ middle), euler_from_matrix(frame), outline)
            yield simplest(leaf)


def trace_extruded_outlines(
    points: np.ndarray, axes: np.ndarray, k: int, levels: list[float], sigma: float, deadline: Deadline = NEVER
) -> Iterator[Primitive]:
    """Solids extruded along column `k` of `axes` [3, 3] between two of the `levels`, given in their order, or along a stretch over which
    the points are evenly dense: its walls alone."""
    frame = np.roll(axes, -(k + 1), axis=1)
    frame = frame * np.array([1.0, 1.0, np.sign(np.linalg.det(frame))])
    local, side = points @ frame, frame[:, 2] @ axes[:, k]
    levels = sorted(float(side) * level for level in levels)
    pairs = [*combinations(range(len(levels)), 2)]
    if len(levels) > MOST_LEVELS:
        pairs = [(i, j) for i, j in pairs if j == i + 1 or (i == 0 and j == len(levels) - 1)]
    off = np.abs(local[:, 2, None] - np.array(levels)).min(1, initial=np.inf) > BESIDE * sigma
    known = [(levels[i], levels[j]) for i, j in pairs]
    even = find_even_stretches(local[:, 2], sigma, LONG)
    new = [(a, b) for a, b in even if not any(max(abs(a - c), abs(b - d)) < SAME_ENDS * sigma for c, d in known)]
    sections = [*((ends, (local[:, 2] > ends[0]) & (local[:, 2] < ends[1])) for ends in new)]
    sections += [(ends, off & (local[:, 2] > ends[0]) & (local[:, 2] < ends[1])) for ends in known]
    for ends, between in sections:
        if deadline.has_passed():
            return
        drawn = _draw(local[between, :2], sigma, turned=False)
        for outline, (bottom, top) in product(drawn, dict.fromkeys((ends, (levels[0], levels[-1])))):
            center = frame[:, 2] * (bottom + top) / 2
            yield simplest(Primitive("extrude", (top - bottom,), vec(center), euler_from_matrix(frame), outline))


def redraw(leaf: Primitive) -> Iterator[Primitive]:
    """The leaf with an outline of one vertex fewer, of one arc drawn straight, of one line drawn along x or y, or without a hole: what
    changes it least."""
    if leaf.outline is None:
        return
    loops, options = leaf.outline.loops, list[tuple[float, tuple[Loop, ...]]]()
    for i, loop in enumerate(loops):
        before, behind = loops[:i], loops[i + 1 :]
        options += [(far, (*before, new, *behind)) for far, new in _plainer(loop)]
        options += [(abs(loop_area(loop)) ** 0.5, before + behind)] if len(loops) > 1 else []
    yield from draw_with(leaf, (option for _, option in heapq.nsmallest(MOST_REDRAWN, options, key=itemgetter(0))))


def draw_with(leaf: Primitive, options: Iterable[tuple[Loop, ...]]) -> Iterator[Primitive]:
    """The leaf with each of several rows of loops as its outline, without those that are none: loops cross, or have no extent."""
    for loops in options:
        try:
            outline = Outline(loops)
            check_crossings(outline)
            yield simplest(replace(leaf, outline=outline))
        except ValueError:
            continue


def take_holes_apart(leaf: Primitive, beyond: float) -> tuple[Primitive, list[Primitive]]:
    """An extrusion without the holes of its outline, and these as cuts of their own that end `beyond` it. As it is, and none, where it has
    none, or more than one outer loop."""
    loops = leaf.outline.loops if leaf.kind == "extrude" and leaf.outline else ()
    sides = nesting(loops)
    if sides.count(1) != 1 or len(loops) < 2:
        return leaf, []
    return simplest(replace(leaf, outline=Outline((loops[sides.index(1)],)))), holes_of(leaf, beyond)


def holes_of(leaf: Primitive, beyond: float) -> list[Primitive]:
    """The holes of an extrusion's outline as solids that end `beyond` it; what is nearly a circle or a rectangle is one."""
    loops = leaf.outline.loops if leaf.kind == "extrude" and leaf.outline else ()
    return [_apart(leaf, loop, beyond) for loop, side in zip(loops, nesting(loops), strict=True) if side < 0]


def take_loops_apart(leaf: Primitive) -> list[Primitive]:
    """An extrusion of several loops, none within another, as one of each; as it is where there is no such thing."""
    if leaf.kind != "extrude" or leaf.outline is None or len(leaf.outline.loops) < 2 or min(nesting(leaf.outline.loops)) < 0:
        return [leaf]
    return [_apart(leaf, loop, 0.0) for loop in leaf.outline.loops]


def _apart(leaf: Primitive, loop: Loop, beyond: float) -> Primitive:
    return simplest(replace(leaf, size=(leaf.size[0] + 2 * beyond,), outline=Outline((_plain_hole(loop),))))


def _plain_hole(loop: Loop) -> Loop:
    """The rectangle or circle that a loop nearly is, the way round that an outline of its own runs; the loop itself otherwise."""
    if isinstance(loop, Ellipse):
        return loop
    area = abs(loop_area(loop))
    (left, low), (right, high) = Outline((loop,)).bounds
    width, height = right - left, high - low
    if area > FULL * width * height:
        return shift_loop(rectangle(width, height).loops[0], (left + right) / 2, (low + high) / 2)
    if min(width, height) > FULL * max(width, height) and abs(area / (math.pi / 4 * width * height) - 1) < 1 - FULL:
        return circle(math.sqrt(area / math.pi), (left + right) / 2, (low + high) / 2)
    return loop if loop_area(loop) > 0 else reverse_ring(loop)


def retrace(leaf: Primitive, points: np.ndarray, sigma: float) -> Iterator[Primitive]:
    """The leaf with its outline drawn anew through the `points` [n, 3] that it explains: the cheapest row of curves along it, and that
    along walls which bulge by more than the noise. Where it was first traced, points of other faces lay beside its own."""
    plane = in_plane(leaf, points, sigma)
    if leaf.outline is None or len(plane) < FEWEST:
        return
    turned = leaf.kind == "revolve"
    borders = [_walk(loop, sigma / 2) for loop in leaf.outline.loops]
    fitted = (fit_outline(borders, sigma, plane, by * sigma, turned) for by in BULGING)
    yield from (simplest(replace(leaf, outline=outline)) for outline in dict.fromkeys(fitted) if outline not in (None, leaf.outline))


def in_plane(leaf: Primitive, points: np.ndarray, sigma: float) -> np.ndarray:
    """Where the `points` [n, 3] of a drawn leaf lie in the plane of its outline [m, 2], without those of its end faces; none of a leaf that
    is turned by less than all around, whose end faces lie in that plane."""
    local = (points - leaf.center) @ matrix_from_euler(leaf.rotation)
    if leaf.kind == "extrude":
        return local[np.abs(np.abs(local[:, 2]) - leaf.size[0] / 2) > BESIDE * sigma, :2]
    profile = np.column_stack([np.hypot(local[:, 0], local[:, 1]), local[:, 2]])
    return profile[:0] if leaf.size[0] != FULL_TURN else profile


def _walk(loop: Loop, step: float) -> np.ndarray:
    """Places [m, 2] along a loop, a `step` apart, at most MOST_WALKED."""
    corners = np.array(flatten_loop(loop, SEGMENTS))
    ring = np.vstack([corners, corners[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
    at = np.arange(0.0, length[-1], max(step, float(length[-1]) / MOST_WALKED))
    return np.column_stack([np.interp(at, length, ring[:, c]) for c in (0, 1)])


def _plainer(loop: Loop) -> Iterator[tuple[float, Loop]]:
    """The loop without one of its vertices, with one arc drawn straight or one line along x or y, and how far that moves it."""
    if isinstance(loop, Ellipse):
        return
    for k, (x, y, bulge) in enumerate(loop):
        (ax, ay, _), (bx, by, _) = loop[k - 1], loop[(k + 1) % len(loop)]
        if len(loop) > 3:
            chord = max(math.dist((ax, ay), (bx, by)), 1e-300)
            yield abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / chord, loop[:k] + loop[k + 1 :]
        slant = bx - x, by - y
        if not bulge and all(slant):
            yield _levelled(loop, k, 0 if abs(slant[0]) < abs(slant[1]) else 1)
        if bulge:
            yield abs(bulge) * math.dist((x, y), (bx, by)) / 2, (*loop[:k], (x, y, 0.0), *loop[k + 1 :])


def _levelled(loop: Ring, k: int, axis: int) -> tuple[float, Loop]:
    """The loop with both ends of its line k at their middle along an axis, and how far that moves them."""
    after = (k + 1) % len(loop)
    middle = (loop[k][axis] + loop[after][axis]) / 2
    moved = [(middle, y, b) if axis == 0 else (x, middle, b) for x, y, b in (loop[k], loop[after])]
    return abs(middle - loop[k][axis]), tuple(moved[(k, after).index(i)] if i in (k, after) else v for i, v in enumerate(loop))


def simplest(leaf: Primitive) -> Primitive:
    """One of the six kinds that numbers alone describe, where an outline is one of them."""
    leaf = center_leaf(leaf)
    return to_simple(leaf) or leaf


def _is_all_around(profile: np.ndarray, angle: np.ndarray, sigma: float) -> np.ndarray:
    """Mask [n] of the points whose neighbours in the `profile` [n, 2] lie all around the axis."""
    cell = np.floor((profile - profile.min(0)) / (BESIDE * sigma)).astype(int)
    sector = np.minimum(((angle / (2 * np.pi) + 0.5) * SECTORS).astype(int), SECTORS - 1)
    count = np.zeros((*(cell.max(0) + 1), SECTORS))
    np.add.at(count, (cell[:, 0], cell[:, 1], sector), 1)
    count = ndimage.convolve(count, np.ones((3, 3, 1)), mode="constant")
    filled, total = (count > 0.5).sum(2), count.sum(2)
    share = filled / (SECTORS * (1 - (1 - 1 / SECTORS) ** np.maximum(total, 1.0)))
    return share[cell[:, 0], cell[:, 1]] > ALL_AROUND


def _draw(points: np.ndarray, sigma: float, turned: bool) -> list[Outline]:
    """The outlines that `points` [n, 2] of a plane may show; none where few of them do, or it shows in few."""
    if len(points) < FEWEST:
        return []
    weight = 1 / np.maximum(points[:, 0], BESIDE * sigma) if turned else np.ones(len(points))
    found = find_sides(points, weight, sigma, turned)
    fitted = (fit_outline(trace_borders(sides), sides.cell, points, sigma, turned) for sides in found)
    return [outline for outline in dict.fromkeys(fitted) if outline and _share_near(outline, points, NEAR * sigma) > BORNE]


def _share_near(outline: Outline, points: np.ndarray, reach: float) -> float:
    return float((np.abs(kernels.outline_sdf(Outlines.pack([outline]).curves, points)) < reach).mean())
