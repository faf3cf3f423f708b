"""Frames between posts as rails: a drawing that other parts cover in places is what is seen of it.

A frame with a post in each corner is found as one drawing with the posts' arcs in it. What one sees are four rails that end in posts, and
people draw each as a box from the middle of one post to that of the next. Where posts cover a drawing from its first level to its last,
and leave rectangles of it, but for their ends, these take its place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.section import CHECK_SEGMENTS, extent
from imdim.geometry.finish.tolerances import ALIGNED, TOUCH
from imdim.geometry.solid import draw_section, exact_rotation
from imdim.program.outline import Outline, circle, ring_curves
from imdim.program.plain_outlines import to_simple
from imdim.program.roles import signs
from imdim.program.tree import FLAT_ENDS, OPS, Combine, Primitive, Program, combine_all, fold, leaves

MARGIN = 4e-3  # of a post's extent, by which it is taken to be thicker: arcs of one circle have their corners elsewhere
CRUMB = 1e-3  # of a drawing's extent: what is narrower is left by facets
DIGITS = 9  # of the extent, that computed ends are rounded to
FEWEST, MOST = 2, 12  # rails


def part_at_posts(program: Program, is_plainer: Callable[[Program, Program], bool], deadline: Deadline = NEVER) -> Program:
    """The program with rails in place of extruded outlines that posts cover in places, wherever `is_plainer` of the new program and the old
    one holds; that has to tell too whether both are one solid. Past the `deadline` (by default never) the others stay."""
    for leaf in [leaf for leaf in _added(program) if leaf.kind == "extrude"]:
        rails = None if deadline.has_passed() else _rails(leaf, [other for other in _added(program) if other != leaf])
        if rails:
            trial = fold(program, lambda _, old, own=leaf, new=rails: new if old == own else old, {op: partial(Combine, op) for op in OPS})
            program = trial if is_plainer(trial, program) else program
    return program


def _added(program: Program) -> list[Primitive]:
    return [leaf for leaf, sign in zip(leaves(program), signs(program), strict=True) if sign > 0]


def _rails(leaf: Primitive, others: Sequence[Primitive]) -> Program | None:
    """The boxes that `others` leave of a drawing."""
    assert leaf.outline is not None
    posts = [post for other in others if (post := _footprint(leaf, other)) is not None]
    if not posts:
        return None
    seen = draw_section(leaf.outline, CHECK_SEGMENTS)
    for _, section in posts:
        seen -= section
    size = extent(leaf.outline)
    pieces = [np.vstack(piece.to_polygons()) for piece in seen.decompose() if not piece.offset(-CRUMB * size, JoinType.Miter).is_empty()]
    if not FEWEST <= len(pieces) <= MOST:
        return None
    turns = sorted({_quarter(curve) for ring in leaf.outline.rings for curve in ring_curves(ring) if not curve[4]})
    rails = [_rail(leaf, points, turns, posts, size) for points in pieces]
    return combine_all("union", [rail for rail in rails if rail]) if turns and None not in rails else None


def _footprint(leaf: Primitive, other: Primitive) -> tuple[np.ndarray, CrossSection] | None:
    """Middle [2] and section, in the plane of a drawing, of what goes along it from its first level to its last; None for anything else."""
    turn, local = exact_rotation(leaf), exact_rotation(other).T @ exact_rotation(leaf)
    x, y, z = (np.array(other.center) - leaf.center) @ turn
    axis = int(np.abs(local[:, 2]).argmax())
    if abs(local[axis, 2]) < 1 - ALIGNED or (other.kind != "box" and (axis != 2 or other.kind != "cylinder")):
        return None
    reach = other.size[FLAT_ENDS[other.kind][axis]] / 2
    if abs(z) + leaf.size[0] / 2 > reach * (1 + TOUCH):
        return None
    if other.kind == "cylinder":
        section = draw_section(Outline((circle(other.size[0] * (1 + MARGIN)),)), CHECK_SEGMENTS)
    else:
        across = [k for k in range(3) if k != axis]
        corners = [[a * other.size[across[0]] / 2, b * other.size[across[1]] / 2] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        section = CrossSection([np.array(corners) * (1 + MARGIN) @ local[across, :2]], FillRule.NonZero)
    return np.array([x, y]), section.translate((x, y))


def _quarter(line: tuple[float, float, float, float, float]) -> float:
    """A line's angle within a quarter turn, in radians."""
    turn = math.atan2(line[3] - line[1], line[2] - line[0]) % (math.pi / 2)
    return 0.0 if min(turn, math.pi / 2 - turn) < TOUCH else turn


def _rail(
    leaf: Primitive, points: np.ndarray, turns: Sequence[float], posts: Sequence[tuple[np.ndarray, CrossSection]], size: float
) -> Primitive | None:
    """The box around points [n, 2] along one of some directions, with ends in the middle of the posts in which it ends."""
    if not turns:
        return None
    frame = min(map(_frame, turns), key=lambda way: float(np.prod(np.ptp(points @ way, axis=0))))
    flat = points @ frame
    low, high = flat.min(axis=0), flat.max(axis=0)
    bounds = [low.copy(), high.copy()]
    for axis, side in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corners = np.array([low, high])[[[side, 0], [side, 1]] if axis == 0 else [[0, side], [1, side]], [0, 1]]
        for middle, section in posts:
            if _all_in(corners @ frame.T, section.offset(CRUMB * size, JoinType.Miter)):
                bounds[side][axis] = (middle @ frame)[axis]
    decimals = DIGITS - math.ceil(math.log10(size))
    (x0, y0), (x1, y1) = ([round(float(v), decimals) for v in corner] for corner in bounds)
    if not (x0 < x1 and y0 < y1):
        return None
    loop = tuple((float(x), float(y), 0.0) for x, y in np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) @ frame.T)
    return to_simple(Primitive("extrude", leaf.size, leaf.center, leaf.rotation, Outline((loop,))))


def _frame(turn: float) -> np.ndarray:
    """Directions along and across an angle in radians, as columns [2, 2]."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s], [s, c]])


def _all_in(points: np.ndarray, section: CrossSection) -> bool:
    """Whether points [n, 2] lie in a section of one convex polygon."""
    (polygon,) = section.to_polygons()
    ahead = np.roll(polygon, -1, axis=0) - polygon
    off = points[:, None] - polygon
    return bool((ahead[:, 0] * off[..., 1] - ahead[:, 1] * off[..., 0] >= 0).all())
