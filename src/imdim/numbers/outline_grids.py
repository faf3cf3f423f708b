"""The grids that numbers of an outline are rounded to: the coarsest that a tolerance allows, or that to which a mesh bears them out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imdim.numbers.design_values import grids, round_to_grid, typed_widths
from imdim.program.outline import Outline

DIGITS = 9  # of places that are one
FINER = 10.0  # times a tolerance is wider than the finest grid


@dataclass(frozen=True)
class OutlineGrids:
    """Widths of grids, coarsest first: those that numbers may be moved to by a `tolerance`, and those on which a number is no chance that
    single precision moves by `bits`; none of these where a target is known less well. Lines across x and y that are near one of
    their `levels` are on it, and arcs have one of the `radii` that they may have."""

    widths: tuple[float, ...]
    typed: tuple[float, ...]
    tolerance: float
    bits: float
    levels: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    radii: tuple[float, ...] = ()

    @staticmethod
    def of(outline: Outline, tolerance: float, inches: bool, bits: float) -> OutlineGrids:
        """Of an outline; `inches` says that fractions of these are round too."""
        (left, low), (right, high) = outline.bounds
        largest = max(abs(v) for v in (left, low, right, high))

        def widths(slack: float) -> list[float]:
            return grids(max(largest, 4 * slack), slack / FINER, inches)

        typed = typed_widths(_places(outline), widths(FINER * bits), bits) if bits else []
        return OutlineGrids(tuple(widths(tolerance)), tuple(typed), tolerance, bits)

    def round(self, number: float, slack: float | None = None) -> tuple[float, float]:
        """The number on the coarsest grid that moves it by no more than the `slack`, by default the tolerance, and the grid's width; what
        it was typed as, if a mesh says so."""
        slack = self.tolerance if slack is None else slack
        place, width = self.read(number)
        if place is not None and abs(place - number) <= slack:
            return place, width
        for width in self.widths:
            rounded = round_to_grid(number, width)
            if abs(rounded - number) <= slack:
                return rounded, width
        return number, 0.0

    def place(self, axis: int, number: float) -> float:
        """Where a line across the axis is, that is at this number."""
        near = min(self.levels[axis], key=lambda level: abs(level - number), default=math.inf)
        return near if abs(near - number) <= self.tolerance else self.round(number)[0]

    def read(self, number: float) -> tuple[float | None, float]:
        """What a number was typed as, and the grid's width; None where nothing tells."""
        found = ((round_to_grid(number, width), width) for width in self.typed)
        return next(((place, width) for place, width in found if abs(place - number) <= self.bits), (None, 0.0))


def _places(outline: Outline) -> np.ndarray:
    """The different coordinates of an outline's corners."""
    return np.unique(np.round([v for ring in outline.rings for x, y, _ in ring for v in (x, y)], DIGITS))
