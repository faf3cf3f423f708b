"""Walls along an extruded drawing, in the place of the solid: where noise hides both skins of a thin wall, a drawing runs between them.

Such a drawing is filled, and no hole that is traced beside it can be offered: what would show it lies on the drawing itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Ring, loop_area, nesting, ring_curves
from imdim.program.tree import Combine, Primitive, Program
from imdim.search.mdl.candidates.drawn import draw_with
from imdim.search.mdl.primitive_selection import Cloud

SHARP = 0.2  # one more than the cosine between the walls at a corner, below which nothing is drawn beside it
GRID = 24  # places along either side of a drawing's box, at which an end is looked at
DEEP = 0.5  # of the depth of its deepest place, from which a place of an end is far from the walls
OFF, MOSTLY = 1.2, 0.6  # spacings of the cloud from its nearest point that are none's, and the share of the places of a bare end
BEYOND = 4.0  # deviations of the noise, by which a cavity goes through the face that it opens


def draw_shells(part: Primitive, wall: float, cloud: Cloud, sigma: float) -> Iterator[Program]:
    """Walls of thickness `wall` along the drawing of an extrusion, open at the ends that bear no points, or closed all around; `sigma` is
    the deviation of the noise."""
    if part.kind != "extrude" or part.outline is None:
        return
    outer, inner = (_grow(part.outline, side * wall / 2) for side in (1, -1))
    if outer is None or inner is None:
        return
    found = tuple(sign for sign in (-1, 1) if _is_bare(part, part.outline, sign, cloud))
    for bare in dict.fromkeys((found, ())):
        if len(bare) == 2:
            yield from draw_with(part, [(*outer.loops, *inner.loops)])
            continue
        ends = [0.0 if sign in bare else wall / 2 for sign in (-1, 1)]
        within = [BEYOND * sigma if sign in bare else -wall / 2 for sign in (-1, 1)]
        if part.size[0] + sum(within) <= 0:
            continue
        walls, cavities = draw_with(_longer(part, *ends), [outer.loops]), draw_with(_longer(part, *within), [inner.loops])
        yield from (Combine("difference", whole, cavity) for whole, cavity in zip(walls, cavities, strict=False))


def _longer(part: Primitive, below: float, above: float) -> Primitive:
    """The extrusion longer by so much at either end."""
    middle = part.center + matrix_from_euler(part.rotation)[:, 2] * (above - below) / 2
    return replace(part, size=(part.size[0] + below + above,), center=vec(middle))


def _grow(outline: Outline, by: float) -> Outline | None:
    """The drawing with its walls further out by so much; None where a corner is too sharp, or nothing is left of a loop."""
    loops = []
    for loop, side in zip(outline.loops, nesting(outline.loops), strict=True):
        moved = grow_loop(loop, by if side > 0 else -by)
        if moved is None:
            return None
        loops.append(moved)
    try:
        return Outline(tuple(loops))
    except ValueError:
        return None


def grow_loop(loop: Loop, by: float) -> Loop | None:
    """The loop with its curves beside it at a distance, outside where that is positive. At corners of an arc and what it does not touch it
    turns as far as before. None where a corner is too sharp, or nothing is left."""
    if isinstance(loop, Ellipse):
        return replace(loop, rx=loop.rx + by, ry=loop.ry + by) if min(loop.rx, loop.ry) + by > 0 else None
    way = math.copysign(1.0, loop_area(loop))
    curves = ring_curves(loop)
    ways = [_ways(*curve) for curve in curves]
    out: list[tuple[float, float, float]] = []
    for k, (x, y, bulge) in enumerate(loop):
        (ax, ay), (cx, cy) = ways[k - 1][1], ways[k][0]
        square = 1 + ax * cx + ay * cy
        if square < SHARP:
            return None
        # to the right of both ways, as far as the curves beside them meet
        out.append((x + way * by * (ay + cy) / square, y - way * by * (ax + cx) / square, bulge))
    grown: Ring = tuple(out)
    turned = any(
        (u - x) * (p - m) + (v - y) * (q - n) <= 0 for (x, y, u, v, _), (m, n, p, q, _) in zip(curves, ring_curves(grown), strict=True)
    )
    return None if turned or loop_area(grown) * loop_area(loop) <= 0 else grown


def _ways(x: float, y: float, u: float, v: float, bulge: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The directions in which a curve begins and ends."""
    along, half = math.atan2(v - y, u - x), 2 * math.atan(bulge)
    return (math.cos(along - half), math.sin(along - half)), (math.cos(along + half), math.sin(along + half))


def _is_bare(part: Primitive, outline: Outline, sign: int, cloud: Cloud) -> bool:
    """Whether most of the middle of an end lies off the cloud."""
    (left, low), (right, high) = outline.bounds
    grid = np.stack(np.meshgrid(np.linspace(left, right, GRID), np.linspace(low, high, GRID)), -1).reshape(-1, 2)
    depth = -kernels.outline_sdf(Outlines.pack([outline]).curves, grid)
    middle = grid[depth > max(DEEP * float(depth.max()), 0.0)]
    if not len(middle):
        return False
    places = np.column_stack([middle, np.full(len(middle), sign * part.size[0] / 2)])
    away = cloud.tree.query(places @ matrix_from_euler(part.rotation).T + part.center)[0]
    return bool((away > OFF * cloud.spacing).mean() > MOSTLY)
