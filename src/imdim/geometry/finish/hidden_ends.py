"""Cones that end where they meet the hole, or the shaft, that they are about: a countersink is as deep as one sees it.

The narrow end of a countersink lies within its hole, where nothing tells how deep. A person would let it begin with the hole's radius.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.outline import circle_of, nesting
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, longest, map_leaves

TOUCH = 2e-4  # of the largest size, within which two axes are one: numbers are not rounded yet
ALIGNED = 1e-6  # of the cosine between them


@dataclass(frozen=True)
class _Tube:
    """A round wall about an axis through `center` [3] along `axis` [3], from `low` to `high` along it; `sign` -1 where it cuts."""

    center: np.ndarray
    axis: np.ndarray
    low: float
    high: float
    radius: float
    sign: int


def shorten_cones(program: Program) -> Program:
    """The program with cones that begin at the radius of a round wall about their axis that adds or cuts as they do, not within."""
    parts, sign = list(leaves(program)), signs(program)
    slack = TOUCH * longest(parts)
    # within a wide one nothing tells where a narrow one is met
    widest_first = sorted((tube for p, s in zip(parts, sign, strict=True) for tube in _tubes(p, s)), key=lambda tube: -tube.radius)

    def shortened(i: int, leaf: Primitive) -> Primitive:
        return _shorten(leaf, [t for t in widest_first if t.sign == sign[i]], slack) if leaf.kind == "cone" else leaf

    return map_leaves(program, shortened)


def _tubes(p: Primitive, sign: int) -> Iterator[_Tube]:
    """The cylinder, or what the circles of an extrusion are."""
    frame, center = matrix_from_euler(p.rotation), np.array(p.center)
    axis = frame[:, 2]
    if p.kind == "cylinder":
        yield _Tube(center, axis, -p.size[1] / 2, p.size[1] / 2, p.size[0], sign)
    elif p.kind == "extrude" and p.outline is not None:
        for loop, side in zip(p.outline.loops, nesting(p.outline.loops), strict=True):
            found = circle_of(loop)
            if found is not None:
                x, y, radius = found
                yield _Tube(center + frame @ (x, y, 0.0), axis, -p.size[0] / 2, p.size[0] / 2, radius, sign * side)


def _shorten(cone: Primitive, tubes: list[_Tube], slack: float) -> Primitive:
    bottom, top, height = cone.size
    axis, center = matrix_from_euler(cone.rotation)[:, 2], np.array(cone.center)
    narrow, wide, up = (bottom, top, 1.0) if bottom < top else (top, bottom, -1.0)
    for tube in tubes:
        away = center - tube.center
        along = float(away @ tube.axis)
        same_axis = abs(float(axis @ tube.axis)) > 1 - ALIGNED and np.linalg.norm(away - along * tube.axis) <= slack
        if not same_axis or not narrow < tube.radius - slack or not tube.radius < wide - slack:
            continue
        left = height * (wide - tube.radius) / (wide - narrow)
        # the wide end stays
        moved = center + up * axis * (height - left) / 2
        met = float((moved - up * axis * left / 2 - tube.center) @ tube.axis)
        if tube.low - slack <= met <= tube.high + slack:
            return replace(cone, size=(tube.radius, wide, left) if up > 0 else (wide, tube.radius, left), center=vec(moved))
    return cone
