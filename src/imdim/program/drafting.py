"""Drafted outlines: what is drawn at the foot of an extrusion whose walls lean inward by one angle, as far up as wanted.

Every line moves inward parallel to itself and every arc keeps its centre, so that a corner of two lines stays a corner and an arc that
touches its neighbours still does. All vertices then move along straight lines, and no bulge changes: a section higher up is the outline
at the foot plus so many times one fixed motion. Draft is what a mould is drawn with; build123d and CadQuery call it taper.
"""

from __future__ import annotations

import math
from functools import lru_cache

from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Curve,
    Outline,
    Point,
    Ring,
    arc_center,
    arc_radius,
    check_crossings,
    has_ellipse,
    orient_loops,
    regions,
    ring_curves,
)

TOUCHES = 0.02  # sine of the angle, within which an arc and its neighbour are taken to touch
SHORTEST = 1e-6  # of a curve, the share that is left of it at the top
ALL_BUT = 0.35  # radians between an arc and a line that are meant to touch where one of both is a little off
FOLDED = -1 + 1e-6  # cosine between the normals of two lines that come back along each other


def foot_of(outline: Outline) -> Outline:
    """The outline with what is inside on the left of every curve, and the holes of each area behind its outer loop, else in the same order;
    itself where it is drawn so."""
    place = {loop: k for k, loop in enumerate(orient_loops(outline.loops))}
    areas = sorted(regions(outline), key=lambda area: place[area[0]])
    loops = tuple(loop for outer, *holes in areas for loop in (outer, *sorted(holes, key=place.__getitem__)))
    return outline if loops == outline.loops else Outline(loops)


@lru_cache(1024)
def shrink(outline: Outline, inset: float) -> Outline:
    """The outline, as `foot_of` has it, with all walls moved inward by `inset`.

    Raises ValueError, a line that names loop and curve, for an ellipse, for an arc that does not touch its neighbours, and where a curve
    would vanish or the walls would meet.
    """
    if has_ellipse(outline):
        raise ValueError("no draft for an ellipse: walls that all lean from it by one angle end in none")
    moved = Outline(tuple(_shrink_ring(i, ring, inset) for i, ring in enumerate(outline.rings)))
    if inset:
        try:
            check_crossings(moved)
        except ValueError as error:
            raise ValueError(f"an inset of {inset:g} is too much: {error}") from None
    return moved


def steps_of(i: int, ring: Ring) -> list[Point]:
    """How the vertices of loop `i` move per unit of inset."""
    curves = ring_curves(ring)
    return [_step(i, k, curves[k - 1], curve) for k, curve in enumerate(curves)]


def _shrink_ring(i: int, ring: Ring, inset: float) -> Ring:
    curves, steps = ring_curves(ring), steps_of(i, ring)
    moved = [(x + inset * dx, y + inset * dy, b) for (x, y, b), (dx, dy) in zip(ring, steps, strict=True)]
    for k, (before, after) in enumerate(zip(curves, ring_curves(tuple(moved)), strict=True)):
        left = (after[2] - after[0]) * (before[2] - before[0]) + (after[3] - after[1]) * (before[3] - before[1])
        if left < SHORTEST * ((before[2] - before[0]) ** 2 + (before[3] - before[1]) ** 2):
            raise ValueError(f"an inset of {inset:g} is too much: loop {i} curve {k} vanishes")
    return tuple(moved)


def _step(i: int, k: int, before: Curve, after: Curve) -> Point:
    """The motion of the vertex between two curves."""
    (ax, ay), (bx, by) = _left_of_end(before, -1), _left_of_end(after, 0)
    if before[4] or after[4]:
        if abs(ax * by - ay * bx) > TOUCHES or ax * bx + ay * by < 0:
            raise ValueError(f"no draft for loop {i} curve {k}: an arc and its neighbour do not touch where they meet")
        return (bx, by) if after[4] else (ax, ay)
    cosine = ax * bx + ay * by
    if cosine <= FOLDED:
        raise ValueError(f"no draft for loop {i} curve {k}: it comes back along the one before")
    return (ax + bx) / (1 + cosine), (ay + by) / (1 + cosine)


def _left_of_end(curve: Curve, end: int) -> Point:
    """The unit normal to the left of a curve at its start (0) or its end (-1)."""
    x, y, u, v, b = curve
    if b:
        (cx, cy), radius = arc_center(curve), arc_radius(curve)
        px, py = (x, y) if end == 0 else (u, v)
        way = math.copysign(1.0, b) / radius
        return (cx - px) * way, (cy - py) * way
    length = math.hypot(u - x, v - y)
    return (y - v) / length, (u - x) / length


def make_touch(outline: Outline) -> Outline:
    """The outline whose arcs between two lines that they all but touch do touch them: as round as before, about a centre that is as far
    from either line. Raises ValueError where lines would run backward then."""
    return Outline(tuple(loop if isinstance(loop, Ellipse) else _make_ring_touch(loop) for loop in outline.loops))


def _make_ring_touch(ring: Ring) -> Ring:
    curves, out = ring_curves(ring), list(ring)
    for k, arc in enumerate(curves):
        before, after = curves[k - 1], curves[(k + 1) % len(curves)]
        if len(curves) < 4 or not arc[4] or before[4] or after[4]:
            continue
        one, two, start, end = (_left_of_end(*pair) for pair in ((before, -1), (after, 0), (arc, 0), (arc, -1)))
        if max(_angle(one, start), _angle(end, two)) > ALL_BUT:
            continue
        radius = arc_radius(arc) * math.copysign(1.0, arc[4])
        center = _beside_both(before, after, radius, arc_center(arc))
        turn = _turn(one, two) % (math.copysign(2 * math.pi, arc[4]))
        for place, normal in ((k, one), ((k + 1) % len(ring), two)):
            out[place] = (center[0] - radius * normal[0], center[1] - radius * normal[1], out[place][2])
        out[k] = (*out[k][:2], math.tan(turn / 4))
    for k, (x, y, u, v, b) in enumerate(ring_curves(tuple(out))):
        p, q, r, s, _ = curves[k]
        if not b and (u - x) * (r - p) + (v - y) * (s - q) <= 0:
            raise ValueError(f"curve {k} has no length between arcs that touch it")
    return tuple(out)


def _beside_both(before: Curve, after: Curve, radius: float, near: Point) -> Point:
    """The point that lies so far to the left of two lines; of parallel ones that beside the first one and nearest to a point."""
    (ax, ay), (bx, by) = _left_of_end(before, 0), _left_of_end(after, 0)
    p = ax * before[0] + ay * before[1] + radius
    q = bx * after[0] + by * after[1] + radius
    cross = ax * by - ay * bx
    if abs(cross) < TOUCHES:
        off = p - ax * near[0] - ay * near[1]
        return near[0] + off * ax, near[1] + off * ay
    return (p * by - q * ay) / cross, (q * ax - p * bx) / cross


def _angle(u: Point, v: Point) -> float:
    return abs(_turn(u, v))


def _turn(u: Point, v: Point) -> float:
    """The angle from one unit vector to another, counter-clockwise."""
    return math.atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])


def inset_at_top(height: float, draft: float) -> float:
    """By how much walls that lean by `draft` degrees are farther in at the top."""
    return height * math.tan(math.radians(draft))
