"""The numbers that a person would have typed for an ellipse: its centre, its length and width, and the angle at which it lies."""

from __future__ import annotations

import math
from collections.abc import Sequence

from imdim.numbers.design_values import decimal, round_to_grid
from imdim.program.ellipse import Ellipse, Point
from imdim.program.outline import Loop, ellipse

STEPS_DEG = (15.0, 1.0, 0.1)


def snap_ellipse(
    given: Ellipse, tolerance: float, widths: Sequence[float], centers: Sequence[Point] = (), lengths: Sequence[float] = ()
) -> Loop:
    """The ellipse with round numbers, or one of the `centers` and of the `lengths`, of semi-axes, that are known; a circle where its
    semi-axes are equal. No point of it moves by more than about `tolerance`; `widths` are those of the grids, coarsest first."""
    e = given.plain
    x, y = next((c for c in centers if math.dist(c, (e.x, e.y)) <= tolerance), None) or (
        _round(e.x, tolerance, widths),
        _round(e.y, tolerance, widths),
    )
    if abs(e.rx - e.ry) <= tolerance:
        rx = ry = _semi_axis((e.rx + e.ry) / 2, tolerance, widths, lengths)
    else:
        rx, ry = (_semi_axis(r, tolerance, widths, lengths) for r in (e.rx, e.ry))
    return ellipse(rx, ry, x, y, _angle(e, tolerance))


def _semi_axis(length: float, tolerance: float, widths: Sequence[float], known: Sequence[float]) -> float:
    """One that is known, or half of a round diameter."""
    return next((k for k in known if abs(k - length) <= tolerance), None) or decimal(_round(2 * length, 2 * tolerance, widths) / 2)


def _round(number: float, slack: float, widths: Sequence[float]) -> float:
    return next((r for r in (round_to_grid(number, width) for width in widths) if abs(r - number) <= slack), number)


def _angle(e: Ellipse, tolerance: float) -> float:
    """The angle on the coarsest step that moves the ends of the semi-axes by no more than the tolerance."""
    for step in STEPS_DEG:
        angle = decimal(round(decimal(e.angle / step)) * step)
        if abs(e.rx - e.ry) * abs(math.sin(math.radians(angle - e.angle))) <= tolerance:
            return angle + 0.0
    return e.angle
