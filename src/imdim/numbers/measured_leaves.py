"""Which rounder numbers the intervals of measured ones allow."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import FINE, UNUSED, Values, common_grid, finest_grid, grids, is_designed, round_to_grid, row_of
from imdim.numbers.measured import Measured
from imdim.numbers.symmetry_normal_form import turn_over
from imdim.program.motions import is_round
from imdim.program.outline import Outline
from imdim.program.tree import KINDS, Primitive, Program, leaves, map_leaves

FLAT = 0.9  # cosine between two poses of one leaf: beyond that it was written in another frame, and nothing is compared
EXACT = 1e-12  # of the largest number, within which nothing has moved


@dataclass(frozen=True)
class MeasuredLeaves:
    """The leaves of a measured program, half-widths [k, 3] of the 95 % intervals of their turns, as lengths at their bounding radii, and
    of moves along their own axes as far as outlines tell these, and the grid on which most numbers lie, 0 where there is none."""

    known: Measured
    parts: tuple[Primitive, ...]
    turns: np.ndarray
    slides: np.ndarray
    common: float

    @staticmethod
    def of(known: Measured) -> MeasuredLeaves:
        parts = tuple(leaves(known.program))
        slopes = np.zeros((3 * len(parts), known.start.count))
        for i in range(len(parts)):
            slopes[3 * i : 3 * i + 3, 9 * i + 6 : 9 * i + 9] = np.eye(3)
        bare = MeasuredLeaves(known, parts, np.zeros((len(parts), 3)), np.zeros((len(parts), 3)), 0.0)
        turns, slides = bare._told(slopes).reshape(-1, 3), np.zeros((len(parts), 3))
        for leaf, axis, is_turn, half in _outline_moves(known):
            (turns if is_turn else slides)[leaf, axis] = min(half, known.noise.sigma)
        bare = replace(bare, turns=turns, slides=slides)
        half = np.concatenate([bare._half_widths(i, np.eye(6)) for i in range(len(parts))])
        return replace(bare, common=common_grid(np.concatenate([row_of(p) for p in parts]), half))

    def allow(self, trial: Program) -> bool:
        """Whether each number of the program is the one measured, but for digits that say nothing, or one that its interval holds and
        that is too round to be there by chance; turns and outlines have to be within their intervals."""
        return all(p == q or self._allows(i, p, q) for i, (p, q) in enumerate(zip(leaves(trial), self.parts, strict=True)))

    def _allows(self, leaf: int, trial: Primitive, own: Primitive) -> bool:
        trial = _facing(trial, own)
        turn = _turn(trial, own)
        if turn is None or (np.abs(turn) * self.known.start.radii[leaf] > self.turns[leaf] + EXACT).any():
            return False
        off, half = np.abs(row_of(trial) - row_of(own)), self._half_widths(leaf, np.eye(6))
        values = Values.of([trial])
        used, (matrix,) = values.classes != UNUSED, values.matrices
        read, measured = values.numbers, matrix @ row_of(own)
        wide = self._half_widths(leaf, matrix)
        if (off > half + self._nothing(leaf)).any() or (np.abs(read - measured)[used] > wide[used] + self._nothing(leaf)).any():
            return False
        own_sums, as_read = self._allowed(row_of(trial), row_of(own), half), self._allowed(read, measured, wide)
        # of two ends, their distance and their middle two say all
        either = all(own_sums[group].sum() + (as_read[group].sum() if spans else 0) >= len(group) for group, spans in _groups(matrix, used))
        return either and self._allows_outline(leaf, trial.outline, own.outline)

    def round_sizes(self, program: Program) -> Program:
        """The program with sizes, then places, on the coarsest grids that are allowed: ends need not be round for what lies between."""

        def rounded(leaf: int, part: Primitive) -> Primitive:
            half, own = self._half_widths(leaf, np.eye(6)), row_of(self.parts[leaf])
            (matrix,) = Values.of([part]).matrices
            for number in (*range(len(part.size)), 3, 4, 5):
                # where both ends were rounded, what lies between was not: it starts again from what was measured
                others = [i for i in np.flatnonzero(matrix[number]).tolist() if i != number]
                anew = reduce(lambda p, i: _with_number(p, i, _trimmed(float(own[i]), float(half[i])) or float(own[i])), others, part)
                offers = (v for v in _offers(float(own[number]), float(half[number]), self.common) if v > 0 or number >= len(part.size))
                trials = (_with_number(start, number, value) for value in offers for start in (part, anew))
                part = next((trial for trial in trials if self._allows(leaf, trial, self.parts[leaf])), part)
            return part

        return map_leaves(program, rounded)

    def _allowed(self, values: np.ndarray, measured: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Which values [n] differ from what was measured by digits that say nothing, or are too round to be there by chance."""
        triples = list(zip(values.tolist(), measured.tolist(), half.tolist(), strict=True))
        return np.array([abs(v - m) <= FINE * h or is_designed(v, m, h, self.common) for v, m, h in triples])

    def _nothing(self, leaf: int) -> float:
        return EXACT * float(self.known.start.radii[leaf])

    def _half_widths(self, leaf: int, matrix: np.ndarray) -> np.ndarray:
        """Of combinations [n, 6] of the sizes and the centre of a leaf."""
        slopes = np.zeros((len(matrix), self.known.start.count))
        along = matrix[:, 3:] @ self.known.start.numbers.rotations[leaf]
        slopes[:, 9 * leaf : 9 * leaf + 3] = matrix[:, :3]
        slopes[:, 9 * leaf + 3 : 9 * leaf + 6] = np.where(self.slides[leaf] > 0, 0.0, along)
        others = np.where(np.abs(slopes).max(1) > EXACT, self._told(slopes), 0.0)
        return np.hypot(others, np.linalg.norm(along * self.slides[leaf], axis=1))

    def _told(self, slopes: np.ndarray) -> np.ndarray:
        """By how much numbers with these derivatives [n, p] may be rounded: one that is not known beside the others as far as it is known
        while they stay, and by no more than the noise hides."""
        half = self.known.half_widths(slopes)
        alone = [self.known.half_width_alone(own) if np.isinf(wide) else wide for own, wide in zip(slopes, half, strict=True)]
        return np.where(np.isfinite(half), half, np.minimum(alone, self.known.noise.sigma))

    def _allows_outline(self, leaf: int, trial: Outline | None, own: Outline | None) -> bool:
        if trial is None or own is None or trial == own:
            return trial == own
        if list(map(len, trial.loops)) != list(map(len, own.loops)):
            return False
        coordinates, first = next((c, first) for i, c, first in self.known.start.outlines if i == leaf)
        places = [i for i in range(len(coordinates.map)) if i % 3 < 2]
        slopes = np.zeros((len(places), self.known.start.count))
        slopes[:, first : first + coordinates.count] = coordinates.map[places]
        moved = np.array(_vertices(trial)) - np.array(_vertices(own))
        return bool((np.abs(moved).ravel() <= self._told(slopes) + EXACT).all())


def _outline_moves(known: Measured) -> Iterator[tuple[int, int, bool, float]]:
    """Of what the outline of a leaf tells in the place of its pose: the leaf, its axis, whether it is a turn about that, and the half-width
    of its interval, of turns as a length at the bounding radius. The whole outline moves, and that all its walls show."""
    for leaf, own, first in known.start.outlines:
        places = np.array(_vertices(own.outline))
        turned = KINDS[known.start.numbers.kinds[leaf]] == "revolve"
        across = np.column_stack([-places[:, 1], places[:, 0]]) / known.start.radii[leaf]
        moves = {5: np.eye(2)[1]} if turned else {3: np.eye(2)[0], 4: np.eye(2)[1], 8: across}
        for number in set(moves) & {twice - 9 * leaf for twice in known.start.twice}:
            wanted = np.zeros((len(places), 3))
            wanted[:, :2] = moves[number]
            way = np.zeros(known.start.count)
            way[first : first + own.count] = np.linalg.lstsq(own.map, wanted.ravel(), rcond=None)[0]
            yield leaf, (number - 3) % 3, number == 8, known.half_width_along(way)


def _groups(matrix: np.ndarray, used: np.ndarray) -> Iterator[tuple[list[int], bool]]:
    """The numbers of a leaf that are read together: a size and a place as two ends, each other one by itself."""
    for i in np.flatnonzero(used):
        others = np.flatnonzero(matrix[i])
        if len(others) == 1 or i == others[0]:
            yield others.tolist(), len(others) > 1


def _offers(value: float, half: float, common: float) -> Iterator[float]:
    """The multiples of decimal grids within `half` of a value, the coarsest first."""
    if not 0 < half < np.inf or not value:
        return
    finest = float(finest_grid(half, common))
    for grid in grids(10 * max(abs(value), finest), finest):
        if grid >= finest and 0 < abs(round_to_grid(value, grid) - value) <= half:
            yield round_to_grid(value, grid)


def _trimmed(value: float, half: float) -> float:
    """A value without the digits that say nothing."""
    return round_to_grid(value, 10.0 ** math.floor(math.log10(2 * FINE * half))) if 0 < half < np.inf else value


def _with_number(part: Primitive, number: int, value: float) -> Primitive:
    if number < 3:
        return replace(part, size=tuple(value if i == number else s for i, s in enumerate(part.size)))
    x, y, z = (value if i == number - 3 else c for i, c in enumerate(part.center))
    return replace(part, center=(x, y, z))


def _vertices(outline: Outline) -> list[Sequence[float]]:
    return [place for loop in outline.loops for place in ([v[:2] for v in loop] if isinstance(loop, tuple) else [(loop.x, loop.y)])]


def _facing(trial: Primitive, own: Primitive) -> Primitive:
    """The trial with its axis on the side of `own`: a hair beyond a right angle the normal form of what is round points the other way."""
    if not is_round(own):
        return trial
    axis, other = (matrix_from_euler(p.rotation)[:, 2] for p in (trial, own))
    return turn_over(trial) if axis @ other < 0 else trial


def _turn(trial: Primitive, own: Primitive) -> np.ndarray | None:
    """The rotation vector [3] in the frame of `own` that leads to the trial; None where that was written in another frame."""
    between = matrix_from_euler(own.rotation).T @ matrix_from_euler(trial.rotation)
    if is_round(own):
        return np.array([-between[1, 2], between[0, 2], 0.0]) if between[2, 2] > FLAT else None
    if np.diagonal(between).min() <= FLAT:
        return None
    return np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]) / 2
