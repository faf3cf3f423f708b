"""Where turned drawings end along their axis, how they are cut off there, and their centre midway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imdim.geometry.solid import exact_rotation
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, Ring, Vertex, orient_loops, ring_curves
from imdim.program.tree import Primitive, Program, map_leaves


def reach_along(leaf: Primitive) -> tuple[float, float]:
    """From where to where a turned drawing reaches along its axis, from its centre."""
    assert leaf.outline is not None
    (_, low), (_, high) = leaf.outline.bounds
    return low, high


def centre_turned(program: Program) -> Program:
    """The same program; turned drawings have their centre midway between their ends, from which their height is measured both ways."""
    return map_leaves(program, lambda _, leaf: _centre(leaf) if leaf.kind == "revolve" else leaf)


def _centre(leaf: Primitive) -> Primitive:
    assert leaf.outline is not None
    middle = sum(reach_along(leaf)) / 2
    if not middle:
        return leaf
    x, y, z = (np.array(leaf.center) + middle * exact_rotation(leaf)[:, 2]).tolist()
    return replace(leaf, center=(x, y, z), outline=leaf.outline.shift(0.0, -middle))


def cut_off(leaf: Primitive, side: int, place: float, slack: float) -> Primitive | None:
    """A turned drawing without what lies beyond a `place` on its axis to a `side`, 1 or -1; None for one that is cut there more than once,
    or in an arc or within `slack` of a corner, or that has several loops."""
    assert leaf.outline is not None
    (loop, *others) = orient_loops(leaf.outline.loops)
    ring = None if others or isinstance(loop, Ellipse) else _clip(loop, side, place, slack)
    return None if ring is None else replace(leaf, outline=Outline((ring,)))


def _clip(ring: Sequence[Vertex], side: int, place: float, slack: float) -> Ring | None:
    """The part of a ring that is not beyond a place to a side."""
    kept: list[Vertex] = []
    crossings = 0
    for x, y, u, v, bulge in ring_curves(tuple(ring)):
        inside, goes_on = side * y <= side * place, side * v <= side * place
        if inside:
            kept.append((x, y, bulge))
        if inside != goes_on:
            if bulge or min(abs(y - place), abs(v - place)) <= slack:
                return None
            crossings += 1
            kept.append((x + (u - x) * (place - y) / (v - y), place, 0.0))
    return tuple(kept) if crossings == 2 else None
