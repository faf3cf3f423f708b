"""The lengths and positions that a person would have typed: what snapping makes equal and round.

An aligned box is known by the positions of its six faces, an aligned cylinder, cone or extrusion by those of its two ends and by its axis;
other leaves by sizes and centre. Values of one class (positions along x, y, z; lengths) may be made equal to each other. Outlines are left
to `outline_values`, and so is the angle of a turned one, which is no length.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.symmetry_normal_form import AXIAL, EXACT
from imdim.program.tree import ACROSS, Primitive, envelope

COARSE = 20.0  # half-widths of an interval, that a grid must be wide: it then holds one of its numbers by chance one time in ten
APART = 4.0  # half-widths of an interval, that numbers of a grid on which the whole part lies must be apart
ON_GRID = 0.9  # share of a part's numbers that are on its grid
SURE = 7.0  # logarithm of the odds for a grid
NORMAL_95 = 1.959964  # standard deviations to either side that hold 95 % of a normal distribution
FINE = 0.1  # of a half-width, by which a number may be rounded without a claim
INCH = 25.4  # millimetres
FINEST_FRACTION = 128
THIRD = 30.0  # times as wide as the finest grid for typed numbers is one whose thirds are typed: what is spread evenly over a length
FEWER = 5  # digits, than one beside it, that a number has which is rounded already
LAST_BITS = 1e-7  # of a part's span, by which single precision moves a value
RARE = 50  # times that: a grid so wide holds a value by chance one time in 25
SCARCE = 20  # times that: the least for a grid that all numbers of a part are on
LENGTH = 3  # classes 0, 1, 2 are positions along x, y, z
UNUSED = -1

# Canonical rotations of axes along x, y, z.
ALIGNED = {(0.0, 90.0, 0.0): 0, (90.0, 0.0, 0.0): 1, (0.0, 0.0, 0.0): 2}


@dataclass(frozen=True)
class Values:
    """`numbers` [6 k] and their classes [6 k]; entries of class UNUSED are padding. `leaves` holds what is not a value."""

    leaves: tuple[Primitive, ...]
    numbers: np.ndarray
    classes: np.ndarray

    @staticmethod
    def of(leaves: list[Primitive]) -> Values:
        """Read the leaves, whose rotations must be canonical."""
        readings = [_reading(p) for p in leaves]
        numbers = [reading.matrix @ row_of(p) for reading, p in zip(readings, leaves, strict=True)]
        return Values(tuple(leaves), np.concatenate(numbers), np.concatenate([reading.classes for reading in readings]))

    @property
    def matrices(self) -> list[np.ndarray]:
        """Of each leaf the matrix [6, 6] from (sizes, centre) to its values."""
        return [_reading(p).matrix for p in self.leaves]

    def primitives(self) -> list[Primitive]:
        """The leaves with these numbers; raises ValueError where a size is not positive."""
        return [self._leaf(i, p) for i, p in enumerate(self.leaves)]

    def primitives_or_none(self) -> list[Primitive] | None:
        """The leaves with these numbers, or None where a size is not proper."""
        try:
            return self.primitives()
        except ValueError:
            return None

    def _leaf(self, i: int, p: Primitive) -> Primitive:
        numbers, reading = self.numbers[6 * i : 6 * i + 6], _reading(p)
        if np.array_equal(numbers, reading.matrix @ row_of(p)):
            return p
        # sums of decimal numbers are decimal again
        row = [decimal(v) for v in (reading.inverse @ numbers).tolist()]
        return replace(p, size=tuple(row[: len(p.size)]), center=(row[3], row[4], row[5]))

    def with_numbers(self, change: tuple[np.ndarray, float]) -> Values:
        """One number in the place of those with some indices."""
        numbers = self.numbers.copy()
        numbers[change[0]] = change[1]
        return replace(self, numbers=numbers)


def row_of(p: Primitive) -> np.ndarray:
    """Sizes, padded with zeros, and centre [6]."""
    return np.array([*p.size, *(0.0,) * (3 - len(p.size)), *p.center])


@dataclass(frozen=True)
class _Reading:
    """The matrix [6, 6] from (sizes, centre) to values, its inverse, and the values' classes [6]."""

    matrix: np.ndarray
    inverse: np.ndarray
    classes: np.ndarray


def _reading(p: Primitive) -> _Reading:
    if p.kind == "box" and p.rotation == (0.0, 0.0, 0.0):
        return _reading_of(len(p.size), tuple((axis, axis) for axis in range(3)))
    if p.kind in AXIAL and p.kind != "torus" and p.rotation in ALIGNED:
        return _reading_of(len(p.size), ((len(p.size) - 1, ALIGNED[p.rotation]),))
    if p.outline is not None:
        return _outlined_reading(p)
    return _reading_of(len(p.size), ())


def _outlined_reading(p: Primitive) -> _Reading:
    """The ends of an aligned extrusion; where a leaf lies in the plane of its outline goes with that, and by how much its walls lean is no
    length."""
    frame = np.abs(matrix_from_euler(p.rotation))
    sizes, axis = (1 if p.kind in ACROSS else 0), int(frame[:, 2].argmax())
    if not is_level(p):
        return _reading_of(sizes, ())
    reading = _reading_of(sizes, ((0, axis),) if sizes else ())
    classes = reading.classes.copy()
    classes[[3 + a for a in range(3) if (a != axis) == (sizes == 1)]] = UNUSED
    return replace(reading, classes=classes)


def is_level(p: Primitive) -> bool:
    """Whether a leaf's own axes are along the world's."""
    frame = matrix_from_euler(p.rotation)
    return bool(np.abs(frame - np.round(frame)).max() < EXACT)


@cache
def _reading_of(sizes: int, ends: tuple[tuple[int, int], ...]) -> _Reading:
    """Of a leaf with so many sizes, of which some (size, axis) are read as the positions of two ends."""
    matrix, classes = np.eye(6), np.array([LENGTH] * 3 + [0, 1, 2])
    classes[sizes:3] = UNUSED
    for size, axis in ends:
        # (size, centre along axis) become the positions of the lower and the upper end
        for row, sign in ((size, -0.5), (3 + axis, 0.5)):
            matrix[row] = 0
            matrix[row, size], matrix[row, 3 + axis] = sign, 1.0
            classes[row] = axis
    return _Reading(matrix, np.linalg.inv(matrix), classes)


def decimal(value: float) -> float:
    """`value` to 12 significant digits, which drops what binary fractions add to decimal ones."""
    return float(f"{value:.12g}") + 0.0


def span(leaves: list[Primitive]) -> float:
    """The largest value that occurs, or difference of positions: what a decimal grid has to be compared with."""
    values = Values.of(leaves)
    widths = [np.ptp(places) for axis in range(3) if len(places := values.numbers[values.classes == axis])]
    drawn = [max(envelope(p).size) for p in leaves if p.outline is not None]
    return float(max(0.0, *widths, *drawn, values.numbers[values.classes == LENGTH].max(initial=0.0)))


def clusters(values: Values, width: float, typed: Collection[float] = ()) -> list[tuple[np.ndarray, float]]:
    """Groups (indices, common value) of two or more unequal values of one class that span at most `width`; where one of them was `typed`,
    the others come to that, and where several were, nothing does."""
    found = []
    for kind in range(LENGTH + 1):
        index = np.flatnonzero(values.classes == kind)
        index = index[np.argsort(values.numbers[index], kind="stable")]
        while len(index):
            close = values.numbers[index] <= values.numbers[index[0]] + width
            numbers = values.numbers[index[close]]
            known = {number for number in numbers.tolist() if number in typed}
            if numbers[-1] > numbers[0] and len(known) < 2:
                found.append((index[close], known.pop() if known else _common_value(numbers)))
            index = index[~close]
    return found


def _common_value(numbers: np.ndarray) -> float:
    """Of numbers that nearly agree the one that is rounded already, or else the middle one."""
    plainest, middle = plainest_first(numbers)[0], float(np.median(numbers))
    return plainest if _count_digits(plainest) + FEWER <= _count_digits(middle) else middle


def plainest_first(numbers: np.ndarray) -> list[float]:
    """The different ones of some numbers, those with the fewest digits first."""
    return sorted(set(numbers.tolist()), key=lambda number: (_count_digits(number), number))


def _count_digits(number: float) -> int:
    return len(f"{abs(number):.12g}")


def equal_groups(values: Values) -> list[np.ndarray]:
    """The indices of all values, those that are equal and of one class together."""
    groups: dict[tuple[int, float], list[int]] = {}
    for i, key in enumerate(zip(values.classes.tolist(), values.numbers.tolist(), strict=True)):
        if key[0] != UNUSED:
            groups.setdefault(key, []).append(i)
    return [np.array(g) for g in groups.values()]


def find_parted_groups(before: Values, after: Values, slack: float) -> list[np.ndarray]:
    """The indices of values of one class that were equal `before`, within the slack, and are no longer `after`; those of leaves that are
    read otherwise then are in none."""
    found = []
    for kind in range(LENGTH + 1):
        index = np.flatnonzero((before.classes == kind) & (after.classes == kind))
        index = index[np.argsort(before.numbers[index], kind="stable")]
        gaps = np.flatnonzero(np.diff(before.numbers[index]) > slack) + 1
        found += [group for group in np.split(index, gaps) if len(group) and np.ptp(after.numbers[group]) > slack]
    return found


def grids(largest: float, finest: float, inches: bool = False) -> list[float]:
    """Decimal grid widths: 1 and 5 times powers of ten, from about `largest` down to `finest`. Of a part in `inches`
    their fractions, and between these the decimal ones, which few of its numbers are on."""
    top, bottom = math.floor(math.log10(largest)), math.ceil(math.log10(finest))
    widths = [digit * 10.0**e for e in range(top, bottom - 1, -1) for digit in (5.0, 1.0)]
    widths = [w for w in widths if w <= largest]
    if not inches:
        return widths
    rare = {w: w * (1 - ON_GRID) / ON_GRID for w in widths}
    return sorted([*widths, *inch_grids(largest, finest)], key=lambda w: -rare.get(w, w))


def inch_grids(largest: float, finest: float) -> Iterator[float]:
    """Widths of inches and fractions of them in millimetres, coarsest first: to 64ths, of radii 128ths, since people measure diameters."""
    width = INCH * 2.0 ** math.floor(math.log2(largest / INCH))
    while width >= max(finest, INCH / FINEST_FRACTION):
        yield width
        width /= 2


def coarsest_widths(numbers: np.ndarray, widths: Sequence[float], slack: float) -> np.ndarray:
    """For each of the numbers [n] the widest of the grids, coarsest first, on which it lies to within the slack; 0 where it is on none."""
    out = np.zeros(len(numbers))
    for width in reversed(widths):
        out[np.abs(numbers - np.round(numbers / width) * width) <= slack] = width
    return out


def round_to_thirds(number: float, grid: float) -> float:
    """The third of a multiple of `grid` next to `number`."""
    return decimal(round(3 * number / grid) * grid / 3)


def round_to_grid(number: float, grid: float) -> float:
    """The multiple of `grid` next to `number`, free of binary residue."""
    return decimal(round(number / grid) * grid)


def grid_of(value: float, finest: float) -> float:
    """The coarsest decimal grid, 1 or 5 times a power of ten, that `value` is on; 0 where it is on none as wide as `finest`."""
    exponent = math.floor(math.log10(max(abs(value), finest)))
    widths = (digit * 10.0**e for e in range(exponent, math.floor(math.log10(finest)) - 1, -1) for digit in (5.0, 1.0))
    return next((w for w in widths if w >= finest and abs(value - round_to_grid(value, w)) <= 1e-9 * max(abs(value), w)), 0.0)


def common_grid(measured: np.ndarray, half: np.ndarray) -> float:
    """The decimal grid on which the numbers of a part, `measured` [n] with 95 % intervals `half` [n], lie so well that it was made on it;
    0 where they tell of none. By the odds of that over numbers from anywhere; some of them may be off it all the same."""
    known = np.isfinite(half) & (half > 0) & (np.abs(measured) > half)  # what may be nothing is on every grid
    measured, deviation = measured[known], half[known] / NORMAL_95
    if not len(measured):
        return 0.0
    best, found = SURE, 0.0
    for grid in grids(float(np.abs(measured).max()), float(deviation.min())):
        off = measured - np.round(measured / grid) * grid
        near = np.exp(-0.5 * (off / deviation) ** 2) / (math.sqrt(2 * math.pi) * deviation)
        odds = float(np.log(ON_GRID * np.maximum(near * grid, 1.0 * (grid < deviation)) + 1 - ON_GRID).sum())
        if odds > best:
            best, found = odds, grid
    return found


def typed_widths(numbers: np.ndarray, widths: Sequence[float], bits: float) -> list[float]:
    """Those of the grids, coarsest first, on which one of the numbers [n], which may be off by `bits`, is no chance: those far wider than
    that, and all down to the one that the numbers are on together."""
    common = common_grid(numbers, np.full(len(numbers), bits))
    finest = min(RARE * bits, common) if common >= SCARCE * bits else RARE * bits
    return [width for width in widths if width >= finest * (1 - 1e-9)]


def finest_grid(half: np.ndarray | float, common: float) -> np.ndarray:
    """The finest grid that a number with a 95 % interval `half` may be rounded to in a part whose numbers lie on the `common` one."""
    coarse = COARSE * np.asarray(half, float)
    return np.minimum(coarse, np.maximum(common, APART * np.asarray(half, float))) if common else coarse


def is_designed(value: float, measured: float, half: float, common: float) -> bool:
    """Whether a number within the 95 % interval `half` about what was `measured` is so round, in a part whose numbers lie on the `common`
    grid, that a person rather than chance chose it."""
    return abs(value - measured) <= half and 0 < half < np.inf and grid_of(value, float(finest_grid(half, common))) > 0
