"""Cylinders with a tip: pins that end in a cone or a half ball, drilled holes, countersinks and tapered ends.

A search that changes one primitive at a time does not get there: fitted to the tip too, a cylinder ends somewhere in its middle, and a cone
on top of that has nothing to stand for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import vec
from imdim.program.tree import Combine, Primitive, Program
from imdim.search.mdl.primitive_selection import Cloud

FEWEST = 12  # points about an end
LONGEST = 3.0  # radii by which a tip begins before the end of the cylinder, or goes beyond it
PLACES = 17  # of where a tip may begin, and where it may end
MOST = 300  # points that are looked at
WIDTHS = 0.0, 0.5, 1.5  # radii of a cone's far end
BEYOND = 3.0  # deviations of the noise, beyond which a point is as good as any other
SHORTEST = 2.0  # deviations of the noise, of a tip
WORTH = 1.0  # times what the numbers of a tip cost, that it has to explain: less is not worth a look
NUMBERS = 3


class _CylinderEnd(NamedTuple):
    """What is about one end of a cylinder: how far its points lie from the axis and along it, outwards from the middle, [n]; the radius,
    half the length, the deviation of the noise, and how many points each stands for."""

    rho: np.ndarray
    z: np.ndarray
    radius: float
    half: float
    sigma: float
    each: float

    @property
    def places(self) -> np.ndarray:
        """Where a tip may begin or end."""
        return np.linspace(self.low, self.half + LONGEST * self.radius, PLACES)

    @property
    def low(self) -> float:
        """Where what is looked at begins."""
        return max(self.half - LONGEST * self.radius, -self.half)

    def badness(self, far: np.ndarray, area: np.ndarray) -> np.ndarray:
        """How many nats the points take with surfaces [m] from which they lie so `far`, [m, n]: the larger the `area` [m] over which they
        are spread, the more, as a share of that of the cylinder; a point that none explains takes as much everywhere."""
        spread = np.log(np.maximum(area, 1e-9) / (2 * np.pi * self.radius * (self.half - self.low) + np.pi * self.radius**2))
        return self.each * np.minimum((far / self.sigma) ** 2 / 2 + spread[:, None], BEYOND**2 / 2).sum(-1)

    def side_area(self, until: np.ndarray) -> np.ndarray:
        """Of the side of the cylinder as far as some places."""
        return 2 * np.pi * self.radius * (until - self.low)


def tips(part: Primitive, cloud: Cloud, sigma: float) -> Iterator[Program]:
    """The cylinder with the cone and with the half ball at either end that the points about it show; `sigma` is the deviation of their
    noise."""
    # a tip of a pin that is all noise is none
    if part.kind != "cylinder" or LONGEST * part.size[0] <= SHORTEST * sigma:
        return
    radius, height = part.size
    rotation = matrix_from_euler(part.rotation)
    local = (cloud.points - part.center) @ rotation
    rho = np.hypot(local[:, 0], local[:, 1])
    wide = max(WIDTHS) * radius + BEYOND * sigma
    for sign in (1, -1):
        z = sign * local[:, 2]
        here = (rho < wide) & (z > max(height / 2 - LONGEST * radius, -height / 2)) & (z < height / 2 + LONGEST * radius)
        if here.sum() < FEWEST:
            continue
        some = subsample(np.column_stack([rho, z])[here], MOST)
        end = _CylinderEnd(some[:, 0], some[:, 1], radius, height / 2, sigma, here.sum() / len(some))
        flat = float(end.badness(_from_flat(end, end.places), end.side_area(end.places) + np.pi * radius**2).min())
        for begin, tip, bad in (_best_cone(end), _best_ball(end)):
            if bad < flat - WORTH * NUMBERS * 0.5 * math.log(len(cloud.points)):
                yield _with_tip(part, rotation, sign, begin, tip)


def _from_flat(end: _CylinderEnd, at: np.ndarray) -> np.ndarray:
    """How far the points lie from a cylinder that ends `at` so many places [m], [m, n]."""
    cap = np.hypot(end.z[None] - at[:, None], np.maximum(end.rho[None] - end.radius, 0.0))
    return np.minimum(_from_side(end, at), cap)


def _from_side(end: _CylinderEnd, until: np.ndarray) -> np.ndarray:
    """How far the points lie from the side of the cylinder as far as some places [m] along it, [m, n]."""
    return np.hypot(end.rho[None] - end.radius, np.maximum(end.z[None] - until[:, None], 0.0))


def _best_cone(end: _CylinderEnd) -> tuple[float, tuple[float, float], float]:
    """Where a cone begins on the cylinder, its height and the radius at its far end, and how bad it is."""
    begin, until, wide = (g.ravel() for g in np.meshgrid(end.places, end.places, np.array(WIDTHS) * end.radius, indexing="ij"))
    proper = until - begin > SHORTEST * end.sigma
    begin, until, wide = begin[proper], until[proper], wide[proper]
    far = np.minimum(_from_side(end, begin), _from_slant(end, begin, until, wide))
    cap = np.hypot(end.z[None] - until[:, None], np.maximum(end.rho[None] - wide[:, None], 0.0))
    slant = np.pi * (end.radius + wide) * np.hypot(wide - end.radius, until - begin)
    bad = end.badness(np.minimum(far, cap), end.side_area(begin) + slant + np.pi * wide**2)
    best = int(bad.argmin())
    return float(begin[best]), (float(until[best] - begin[best]), float(wide[best])), float(bad[best])


def _from_slant(end: _CylinderEnd, begin: np.ndarray, until: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """How far the points lie from the slanted side between the cylinder's end `begin` [m] and the radius `wide` [m] at `until`, [m, n]."""
    across, along = wide - end.radius, until - begin
    share = ((end.rho[None] - end.radius) * across[:, None] + (end.z[None] - begin[:, None]) * along[:, None]) / (across**2 + along**2)[
        :, None
    ]
    share = np.clip(share, 0.0, 1.0)
    return np.hypot(end.rho[None] - end.radius - share * across[:, None], end.z[None] - begin[:, None] - share * along[:, None])


def _best_ball(end: _CylinderEnd) -> tuple[float, None, float]:
    """Where the middle of a half ball as wide as the cylinder lies, and how bad it is."""
    begin = np.linspace(end.low, end.half + end.radius, 2 * PLACES)
    ball = np.abs(np.hypot(end.rho[None], end.z[None] - begin[:, None]) - end.radius)
    side = _from_side(end, begin)
    bad = end.badness(np.where(end.z[None] > begin[:, None], ball, side), end.side_area(begin) + 2 * np.pi * end.radius**2)
    best = int(bad.argmin())
    return float(begin[best]), None, float(bad[best])


def _with_tip(part: Primitive, rotation: np.ndarray, sign: int, begin: float, cone: tuple[float, float] | None) -> Program:
    """The cylinder as far as a tip begins, with a `cone` of a height and a far radius, or a ball, at that end."""
    radius, height = part.size
    out = sign * rotation[:, 2]
    low = -height / 2
    if cone is None:
        tip = Primitive("sphere", (radius,), vec(part.center + begin * out))
    else:
        long, wide = cone
        turn = part.rotation if sign > 0 else euler_from_matrix(rotation * np.array([1.0, -1.0, -1.0]))
        tip = Primitive("cone", (radius, wide, long), vec(part.center + (begin + long / 2) * out), turn)
    if begin - low < 1e-3 * radius:
        return tip
    body = Primitive("cylinder", (radius, begin - low), vec(part.center + (begin + low) / 2 * out), part.rotation)
    return Combine("union", body, tip)
