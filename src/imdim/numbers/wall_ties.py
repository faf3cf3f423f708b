"""Walls that noise lets nobody tell apart are of one thickness.

Where a wall is no thicker than a few deviations of the noise its thickness is known far worse than the place of its middle: each wall alone
tells it by as much as its two skins widen the spread of its points. Who draws a part draws most of its walls alike, so that all of them
together tell one thickness; walls that clearly differ do not become one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.numbers.information import Coordinates
from imdim.numbers.likelihood import SurfaceSamples
from imdim.numbers.measured import Measured, chi_squared_95
from imdim.program.tree import Program

THICKEST = 6.0  # deviations of the noise: skins that lie farther apart are told apart
SAMPLES = 3000  # of the surface, whose opposite sides are looked for
PROBES = 24  # places in a wall
HALVINGS = 20  # of the step in which it ends
OPPOSITE = -0.98  # cosine of the angle between the normals of two skins
ALIKE = 0.05  # of how the thickness changes with the numbers, within which samples are of one wall
FEWEST = 0.005  # of the samples, that a wall has at least
MOST_WALLS = 64
APART = 2.0  # standard deviations by which walls of one thickness may differ
SHOWN = 1e-3  # share of a thickness that may hang on numbers that no point shows


class Wall(NamedTuple):
    """How thick a wall is, and how that grows with each coordinate of the program [p]."""

    thickness: float
    slope: np.ndarray


def tie_walls(known: Measured) -> tuple[Program, np.ndarray] | None:
    """The measured program with walls in one thickness that cannot be told apart, and combinations [m, p] of its coordinates that are to
    stay as they are for that; None where no two walls are so.

    The numbers are the likeliest under these ties where the logarithm of the likelihood is a parabola; that the walls of one thickness do
    not differ by more than chance is tested as Wald (1943) has it.
    """
    walls = find_walls(known)
    groups = _group_alike(walls, known.covariance)
    if not groups:
        return None
    rows = np.concatenate([[walls[i].slope - walls[group[0]].slope for i in group[1:]] for group in groups])
    off = np.concatenate([[walls[i].thickness - walls[group[0]].thickness for i in group[1:]] for group in groups])
    pull = known.covariance @ rows.T
    step = -pull @ np.linalg.lstsq(rows @ pull, off, rcond=None)[0]
    return known.start.move(known.shift + step), rows


def find_walls(known: Measured) -> list[Wall]:
    """The walls of a measured program that are no thicker than THICKEST deviations of the noise, as far as the points show them."""
    now, numbers = Coordinates.of(known.program), lower(known.program)
    shown = SurfaceSamples.of(known.program, known.noise.sigma, SAMPLES)
    if not len(shown.points):
        return []
    thick = _thickness(numbers, shown, THICKEST * known.noise.sigma)
    thin = np.flatnonzero(np.isfinite(thick))
    places = shown.points[thin] - thick[thin, None] * shown.normals[thin]
    leaf, _, _, normals = kernels.program_tangent(numbers, places)
    facing = np.einsum("ni,ni->n", shown.normals[thin], normals) < OPPOSITE
    thin, places, leaf, normals = thin[facing], places[facing], leaf[facing], normals[facing]
    if not len(thin):
        return []
    one, other = (
        SurfaceSamples(p, n, 0.0, 0.0, leaf=at)
        for p, n, at in ((shown.points[thin], shown.normals[thin], shown.leaf[thin]), (places, normals, leaf))
    )
    slopes = -(now.tangents(one) + now.tangents(other))
    told = np.linalg.norm(slopes @ known.hidden, axis=1) <= SHOWN * np.linalg.norm(slopes, axis=1)
    # turns thin a wall at one end and thicken it at the other: in the mean they do nothing
    turns = [9 * leaf + k for leaf in range(len(numbers.kinds)) for k in (6, 7, 8)]
    slopes[:, turns] = 0.0
    slopes = slopes @ known.free @ known.free.T
    slopes[:, turns] = 0.0
    return _gather(thick[thin][told], slopes[told], round(FEWEST * len(shown.points)))


def _thickness(numbers: Lowered, shown: SurfaceSamples, most: float) -> np.ndarray:
    """How far behind each sample the material ends, [m], infinite where it goes on for more than `most`."""
    steps = np.linspace(0.0, most, PROBES + 1)

    def is_inside(depth: np.ndarray) -> np.ndarray:
        return kernels.inside(numbers, shown.points - depth[:, None] * shown.normals)

    within = np.column_stack([is_inside(np.full(len(shown.points), step)) for step in steps[1:]])
    ends, first = ~within.all(1), within.argmin(1)
    low, high = steps[first], steps[first + 1]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = is_inside(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(ends, (low + high) / 2, np.inf)


def _gather(thick: np.ndarray, slopes: np.ndarray, fewest: int) -> list[Wall]:
    """One wall for the samples of a thickness [n] that change alike with the numbers, `slopes` [n, p], where there are some."""
    left, walls = np.arange(len(thick)), list[Wall]()
    while len(left) > fewest and len(walls) < MOST_WALLS:
        first = slopes[left[0]]
        alike = np.linalg.norm(slopes[left] - first, axis=1) < ALIKE * np.linalg.norm(first)
        own, left = left[alike], left[~alike]
        if len(own) > fewest and first.any():
            walls.append(Wall(float(np.median(thick[own])), slopes[own].mean(0)))
    return walls


def _group_alike(walls: Sequence[Wall], covariance: np.ndarray) -> list[list[int]]:
    """Walls by number that may be of one thickness, the best known of each group first."""
    if len(walls) < 2:
        return []
    thick, slopes = np.array([w.thickness for w in walls]), np.array([w.slope for w in walls])
    known = slopes @ covariance @ slopes.T
    left, groups = [int(i) for i in np.argsort(np.diagonal(known), kind="stable")], list[list[int]]()
    while left:
        first, *others = left
        spread = {i: np.sqrt(max(known[i, i] + known[first, first] - 2 * known[i, first], 0.0)) for i in others}
        group = [first, *(i for i in others if spread[i] > 0 and abs(thick[i] - thick[first]) < APART * spread[i])]
        while len(group) > 1 and (worst := _find_odd(group, thick, known)) is not None:
            group.remove(worst)
        groups.append(group)
        left = [i for i in left if i not in group]
    return [group for group in groups if len(group) > 1]


def _find_odd(group: list[int], thick: np.ndarray, known: np.ndarray) -> int | None:
    """The wall that differs most from the first of its group, where together they differ by more than chance; None where they do not."""
    away = np.column_stack([-np.ones(len(group) - 1), np.eye(len(group) - 1)])
    off, spread = away @ thick[group], away @ known[np.ix_(group, group)] @ away.T
    if off @ np.linalg.lstsq(spread, off, rcond=None)[0] <= chi_squared_95(len(off)):
        return None
    return group[1 + int(np.argmax(np.abs(off) / np.sqrt(np.maximum(np.diagonal(spread), 1e-300))))]
