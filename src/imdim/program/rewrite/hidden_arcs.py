"""Arcs of drawings that other parts hide: a frame between four round posts is drawn with arcs at its corners, where the posts are.

Without them its lines go on until they meet inside of the posts, and the frame is a rectangle with another one cut from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import permutations

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Loop, Outline, Point, Ring, arc_center, arc_radius, check_crossings, orient_loops, ring_curves
from imdim.program.rewrite.joints import CurveJoint, close_ring, join
from imdim.program.tree import Primitive, Program, leaves, replace_leaves

SLACK = 1e-4  # of an outline's extent, within which arcs are of one circle, and lines are one
MOST = 4  # ends of lines at one circle


def without_hidden_arcs(program: Program, change: Callable[[Program, int, Primitive], float], tolerance: float) -> Program:
    """The program with the lines of its extruded outlines prolonged into the circles at which they end, where the volume in which they
    `change` the solid of a program, of whose leaves they replace one, is no more than `tolerance`."""
    for number, leaf in enumerate(leaves(program)):
        for outline in _fuller(leaf):
            fuller = replace(leaf, outline=outline)
            if change(program, number, fuller) <= tolerance:
                program = replace_leaves(program, {number: fuller})
                break
    return program


def _fuller(leaf: Primitive) -> Iterator[Outline]:
    """Outlines without the arcs of all circles that go into what they hold, or without those of one."""
    if leaf.kind != "extrude" or leaf.outline is None:
        return
    low, high = leaf.outline.bounds
    slack = SLACK * math.dist(low, high)
    loops = orient_loops(leaf.outline.loops)
    rings = [loop for loop in loops if not isinstance(loop, Ellipse)]
    curves = [curve for ring in rings for curve in ring_curves(ring)]
    groups = _circles(rings, slack)
    for chosen in ([*groups], *([group] for group in groups if len(groups) > 1)):
        drawn = _without(rings, curves, chosen, slack)
        if drawn is None or not chosen:
            continue
        outline = Outline((*drawn, *(loop for loop in loops if isinstance(loop, Ellipse))))
        if outline.area > leaf.outline.area and not _crosses(outline):
            yield outline


def _crosses(outline: Outline) -> bool:
    try:
        check_crossings(outline)
    except ValueError:
        return True
    return False


def _circles(rings: Sequence[Ring], slack: float) -> list[list[int]]:
    """The numbers of the arcs of each circle that go into what the rings hold, but for rings that have nothing else."""
    groups: list[tuple[Point, float, list[int]]] = []
    first = 0
    for ring in rings:
        arcs = {first + k: curve for k, curve in enumerate(ring_curves(ring)) if curve[4] < 0}
        first += len(ring)
        for number, arc in arcs.items() if len(arcs) < len(ring) else ():
            center, radius = arc_center(arc), arc_radius(arc)
            own = next((own for c, r, own in groups if math.dist(c, center) <= slack and abs(r - radius) <= slack), None)
            if own is None:
                groups.append((center, radius, [number]))
            else:
                own.append(number)
    return [own for _, _, own in groups]


def _without(rings: Sequence[Ring], curves: Sequence[Curve], circles: Sequence[Sequence[int]], slack: float) -> list[Loop] | None:
    """The rings that are left without the arcs of some circles; None where lines that end at one do not meet in it."""
    behind: dict[int, int] = {}
    first = 0
    for ring in rings:
        behind |= {first + k: first + (k + 1) % len(ring) for k in range(len(ring))}
        first += len(ring)
    before = {after: number for number, after in behind.items()}
    gone = {number for circle in circles for number in circle}
    joints = {number: CurveJoint(curves[after][:2]) for number, after in behind.items() if number not in gone}
    for circle in circles:
        into, out_of = [before[i] for i in circle], [behind[i] for i in circle]
        if gone.intersection(into) or gone.intersection(out_of) or len(circle) > MOST:
            return None
        pairs = _pair([curves[i] for i in into], [curves[i] for i in out_of], curves[circle[0]], slack)
        if pairs is None:
            return None
        for number, (after, joint) in zip(into, pairs, strict=True):
            behind[number], joints[number] = out_of[after], joint
    return _trace(curves, behind, joints)


def _pair(ends: Sequence[Curve], starts: Sequence[Curve], arc: Curve, slack: float) -> list[tuple[int, CurveJoint]] | None:
    """For each of some curves that end at a circle the number of that which starts there and that it goes on in, inside of the circle."""
    center, radius = arc_center(arc), arc_radius(arc)

    def meets(a: Curve, b: Curve) -> CurveJoint | None:
        joint = join(a, b, slack)
        inside = joint is not None and (joint.corner is None or math.dist(joint.corner, center) <= radius + slack)
        return joint if inside else None

    for order in permutations(range(len(starts))):
        joints = [meets(a, starts[k]) for a, k in zip(ends, order, strict=True)]
        if None not in joints:
            return [(k, joint) for k, joint in zip(order, joints, strict=True) if joint is not None]
    return None


def _trace(curves: Sequence[Curve], behind: dict[int, int], joints: dict[int, CurveJoint]) -> list[Loop] | None:
    """The rings of curves that follow each other."""
    left, out = set(joints), list[Loop]()
    while left:
        chain = [min(left)]
        while (after := behind[chain[-1]]) != chain[0]:
            chain.append(after)
        closed = close_ring([curves[i] for i in chain], [joints[i] for i in chain])
        if closed is None:
            return None
        out.append(closed[0])
        left -= set(chain)
    return out
