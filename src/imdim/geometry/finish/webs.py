"""Rounded inner corners that were found as parts of their own become arcs of the drawing that they round.

Where two walls of a drawing meet in an inner corner, a search may find what fills the corner, a small prism with one hollow wall, before
it finds that the drawing has an arc there. Its other walls lie in the material or run along the walls of the drawing, and miss them by a
hair: the next edit opens a slit there, and the web stays behind when its corner moves. As an arc it has a radius, and goes along.

The same holds for cutters: one that fills the inner corner of a pocket's drawing is an arc of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.census import census_of
from imdim.geometry.finish.cutter_walls import redraw_loop
from imdim.geometry.solid import join_touching, volume_iou
from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Curve,
    Outline,
    Point,
    Ring,
    arc_center,
    arc_radius,
    curve_distance,
    has_ellipse,
    is_in_loop,
    orient_loops,
    ring_curves,
)
from imdim.program.paths import leaf_paths, polarity, without
from imdim.program.rewrite.cells import prism_along
from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.joints import angle_at, direction, dot, minus
from imdim.program.tree import Primitive, Program, replace_leaves
from imdim.program.vectors import dot as dot_3d

NEAR = 1e-3  # of the drawing's extent, by which a web's walls may miss those of the drawing
MOST_CURVES = 5  # of a web: the arc, and what is beside and behind it
LOST = 1e-5  # of the volume IoU, that it may cost
SHARES = tuple((k + 0.5) / 9 for k in range(9))  # of a curve, where points tell whether it is hidden
STEP = 0.02  # the same, from one such point to the next where an arc is prolonged
AHEAD = tuple(1 + STEP * k for k in range(26))
HALVINGS = 40  # until where an arc goes into a drawing is known
PARALLEL = 1e-3  # of a sine, below which two walls have no corner between them


def draw_webs(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` with an arc in the drawing in place of each web that rounds an inner corner of it, where the target `solid` allows it.

    Both are in one frame. No body, hole or void comes or goes that the target has not, and the IoU with it stays. Past the `deadline` (by
    default never) the other webs stay.
    """
    while trial := next((trial for trial in _proposals(program) if not deadline.has_passed() and is_as_near(trial, program, solid)), None):
        program = trial
    return program


def is_as_near(after: Program, before: Program, solid: Manifold) -> bool:
    """Whether a program has the target's `solid` as well as the one before it: the IoU stays, and bodies, holes and voids are no further
    off."""
    made, out = join_touching(before), join_touching(after)
    if volume_iou(out, solid) < volume_iou(made, solid) - LOST:
        return False
    kinds = zip(*(census_of(some).kind for some in (made, out, solid)), strict=True)
    return all(abs(after - wanted) <= abs(before - wanted) for before, after, wanted in kinds)


def _proposals(program: Program) -> Iterator[Program]:
    """The program with the webs in one corner of one drawing as an arc of that."""
    found = leaf_paths(program)
    for i, (path, leaf) in enumerate(found):
        if leaf.outline is None or leaf.kind != "extrude" or has_ellipse(leaf.outline):
            continue
        slack = NEAR * math.dist(*leaf.outline.bounds)
        drawings = [(other, web) for other, web in found if other != path and web.kind == "extrude"]
        beside = [(other, web) for other, web in drawings if polarity(program, other) == polarity(program, path)]
        arcs = {other: arc for other, web in beside if (arc := _arc_of(web, leaf, leaf.outline, slack)) is not None}
        # along a corner there may be one behind the other
        for corner in {tuple(other for other in arcs if _are_near(arcs[other], arc, slack)): None for arc in arcs.values()}:
            drawn = _round_corner_of(leaf, leaf.outline, arcs[corner[0]], slack)
            shorter = None if drawn is None else without(replace_leaves(program, {i: drawn}), corner)
            if shorter is not None:
                yield shorter


def _arc_of(web: Primitive, leaf: Primitive, outline: Outline, slack: float) -> Curve | None:
    """The one wall of a web that is seen beside an extrusion with an `outline`, in the plane of that, where it is a hollow one."""
    frame = axes(leaf)
    prism, own = prism_along(web, frame), prism_along(leaf, frame)
    if prism is None or own is None or len(prism.outline.loops) > 1 or prism.outline.curve_count > MOST_CURVES:
        return None
    if min(prism.high, own.high) <= max(prism.low, own.low):
        return None
    x, y = (dot_3d(leaf.center, axis) for axis in frame[:2])
    (ring,) = orient_loops(prism.outline.shift(-x, -y).loops)
    assert not isinstance(ring, Ellipse)
    arcs = [curve for curve in ring_curves(ring) if curve[4] < 0]
    if len(arcs) != 1 or not _is_seen(arcs[0], outline, slack):
        return None
    return None if any(_is_seen(curve, outline, slack) for curve in ring_curves(ring) if curve != arcs[0]) else arcs[0]


def _are_near(a: Curve, b: Curve, slack: float) -> bool:
    return max(math.dist(_at(a, share), _at(b, share)) for share in (0.0, 0.5, 1.0)) <= slack


def _round_corner_of(leaf: Primitive, outline: Outline, arc: Curve, slack: float) -> Primitive | None:
    """An extrusion with an arc in its `outline`; None where that rounds no corner of it."""
    start, end = (_end_of(way, outline, slack) for way in (_turned(arc), arc))
    for k, loop in enumerate(orient_loops(outline.loops)):
        if not isinstance(loop, Ellipse) and (rounded := round_corner(loop, arc, start, end, slack)) is not None:
            return redraw_loop(leaf, k, rounded)
    return None


def _end_of(arc: Curve, outline: Outline, slack: float) -> Point:
    """Where an arc ends: where it goes into the outline, or comes as near to it as `slack`, if need be beyond where it is drawn to."""
    beyond = (share for share in AHEAD if _holds(outline, _at(arc, share)) or _gap(outline, _at(arc, share)) <= slack)
    end = next(beyond, 1.0)
    if not _holds(outline, _at(arc, end)) or _gap(outline, _at(arc, end)) <= slack:
        return _at(arc, end)
    out, in_ = max(share for share in (*SHARES, end - STEP) if not _holds(outline, _at(arc, share))), end
    for _ in range(HALVINGS):
        middle = (out + in_) / 2
        out, in_ = (out, middle) if _holds(outline, _at(arc, middle)) else (middle, in_)
    return _at(arc, in_)


def _gap(outline: Outline, point: Point) -> float:
    return min(curve_distance(curve, point) for curve in outline.curves)


def _turned(arc: Curve) -> Curve:
    return (*arc[2:4], *arc[:2], -arc[4])


def _holds(outline: Outline, point: Point) -> bool:
    return sum(is_in_loop(loop, *point) for loop in outline.loops) % 2 == 1


def _is_seen(curve: Curve, outline: Outline, slack: float) -> bool:
    """Whether some of a curve is out of an outline, and further from its curves than `slack`."""
    points = [point for share in SHARES if not _holds(outline, point := _at(curve, share))]
    return any(_gap(outline, point) > slack for point in points)


def round_corner(ring: Ring, arc: Curve, start: Point, end: Point, slack: float) -> Ring | None:
    """The ring, its inside on the left, with a clockwise arc from `start` to `end` in place of what is between; None where one of them is
    further away than `slack`. Between two lines that it all but touches it does."""
    curves, radius = ring_curves(ring), arc_radius(arc)
    first, last = (min(range(len(curves)), key=lambda j: curve_distance(curves[j], point)) for point in (start, end))
    if max(curve_distance(curves[first], start), curve_distance(curves[last], end)) > slack:
        return None
    start, end = _nearest_on(curves[first], start), _nearest_on(curves[last], end)
    touching = None if curves[first][4] or curves[last][4] else _touching(curves[first], curves[last], radius)
    if touching and math.dist(touching[0], arc_center(arc)) <= slack:
        start, end = touching[1:]
    if first == last and _share(curves[first], start) >= _share(curves[first], end):
        return None
    steps = (first - last) % len(curves) or len(curves)
    pieces = [_from(curves[last], end), *(curves[(last + k) % len(curves)] for k in range(1, steps)), _until(curves[first], start)]
    kept = [piece for piece in pieces if math.dist(piece[:2], piece[2:4]) > slack / 10]
    if not kept:
        return None
    (x, y), (u, v) = kept[-1][2:4], kept[0][:2]
    bulge = -math.tan(math.asin(min(math.dist((x, y), (u, v)) / 2 / radius, 1.0)) / 2)
    return (*((a, b, bend) for a, b, _, _, bend in kept), (x, y, bulge))


def _touching(first: Curve, last: Curve, radius: float) -> tuple[Point, Point, Point] | None:
    """The centre of a clockwise arc of a radius between two lines, to the right of both, and where it touches them; None where they are
    parallel."""
    (ax, ay), (bx, by) = direction(first), direction(last)
    cross = ax * by - ay * bx
    if abs(cross) < PARALLEL:
        return None
    gx, gy = minus(last[:2], first[:2])
    along = (gx * by - gy * bx) / cross
    x, y = first[0] + along * ax, first[1] + along * ay  # their corner
    reach = radius * math.tan(abs(math.atan2(cross, ax * bx + ay * by)) / 2)
    start, end = (x - reach * ax, y - reach * ay), (x + reach * bx, y + reach * by)
    return (start[0] + radius * ay, start[1] - radius * ax), start, end


def _at(curve: Curve, share: float) -> Point:
    """The point at a share of the way along a curve."""
    x, y, u, v, bulge = curve
    if not bulge:
        return x + share * (u - x), y + share * (v - y)
    (cx, cy), radius = arc_center(curve), arc_radius(curve)
    angle = angle_at((x, y), (cx, cy)) + share * 4 * math.atan(bulge)
    return cx + radius * math.cos(angle), cy + radius * math.sin(angle)


def _share(curve: Curve, point: Point) -> float:
    """How far along a curve the point of it is that is nearest to a point, as a share of all of it."""
    x, y, u, v, bulge = curve
    if not bulge:
        length = math.dist((x, y), (u, v))
        return min(max(dot(minus(point, (x, y)), direction(curve)) / length, 0.0), 1.0)
    center, turn = arc_center(curve), 4 * math.atan(bulge)
    gone = math.copysign(1.0, bulge) * (angle_at(point, center) - angle_at((x, y), center)) % (2 * math.pi)
    # what is out of the arc is nearest to one of its ends
    return gone / abs(turn) if gone <= abs(turn) else float(gone < math.pi + abs(turn) / 2)


def _nearest_on(curve: Curve, point: Point) -> Point:
    return _at(curve, _share(curve, point))


def _from(curve: Curve, start: Point) -> Curve:
    """The rest of a curve from a point of it on."""
    return (*start, *curve[2:4], math.tan(math.atan(curve[4]) * (1 - _share(curve, start))))


def _until(curve: Curve, end: Point) -> Curve:
    """A curve up to a point of it."""
    return (*curve[:2], *end, math.tan(math.atan(curve[4]) * _share(curve, end)))
