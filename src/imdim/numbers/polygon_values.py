"""The numbers that a person would have typed for a regular polygon: its centre, its size and the angle at which it lies.

The size is that of the circle through its corners, or across its flats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from imdim.numbers.design_values import decimal
from imdim.numbers.ellipse_values import STEPS_DEG
from imdim.numbers.outline_grids import OutlineGrids
from imdim.program.outline import Point
from imdim.program.regular_polygon import RegularPolygon


def snap_polygon(given: RegularPolygon, grids: OutlineGrids, centers: Sequence[Point] = ()) -> RegularPolygon:
    """The polygon with round numbers, about one of the `centers` that are known if it is there; no corner moves by more than about the
    tolerance of the `grids`."""
    (x, y), tolerance = given.center, grids.tolerance
    center = next((c for c in centers if math.dist(c, given.center) <= tolerance), (grids.round(x)[0], grids.round(y)[0]))
    return replace(given, center=center, radius=_round_radius(given, grids), angle=_round_angle(given, tolerance))


def _round_radius(given: RegularPolygon, grids: OutlineGrids) -> float:
    """The radius of round corners, or that of flats a round number apart, whichever a mesh says or is rounder."""
    flat = given.across_flats / given.radius
    if (typed := grids.read(given.radius)[0]) is not None:
        return typed
    (radius, width), (across, apart) = grids.round(given.radius), grids.round(given.across_flats, grids.tolerance * flat)
    return across / flat if apart > width else radius


def _round_angle(given: RegularPolygon, tolerance: float) -> float:
    """The angle on the coarsest step that moves corners by no more than the tolerance."""
    for step in STEPS_DEG:
        angle = decimal(round(decimal(given.angle / step)) * step)
        if given.radius * abs(math.sin(math.radians(angle - given.angle))) <= tolerance:
            return angle % (360 / given.sides)
    return given.angle
