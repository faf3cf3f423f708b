"""Which rounder numbers the intervals of measured ones allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.design_values import COARSE, FINE, UNUSED, Values, grid_of, row_of
from imdim.numbers.measured import Measured
from imdim.program.motions import is_round
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, leaves

FLAT = 0.9  # cosine between two poses of one leaf: beyond that it was written in another frame, and nothing is compared
EXACT = 1e-12  # of the largest number, within which nothing has moved


@dataclass(frozen=True)
class MeasuredLeaves:
    """The leaves of a measured program, and half-widths [k] of 95 % intervals of any numbers of one by their derivatives."""

    known: Measured
    parts: tuple[Primitive, ...]
    turns: np.ndarray

    @staticmethod
    def of(known: Measured) -> MeasuredLeaves:
        parts = tuple(leaves(known.program))
        slopes = np.zeros((3 * len(parts), known.start.count))
        for i in range(len(parts)):
            slopes[3 * i : 3 * i + 3, 9 * i + 6 : 9 * i + 9] = np.eye(3)
        return MeasuredLeaves(known, parts, known.half_widths(slopes).reshape(-1, 3))

    def allow(self, trial: Program) -> bool:
        """Whether each number of the program is the one measured, but for digits that say nothing, or one that its interval holds and
        that is too round to be there by chance; turns and outlines have to be within their intervals."""
        return all(p == q or self._allows(i, p, q) for i, (p, q) in enumerate(zip(leaves(trial), self.parts, strict=True)))

    def _allows(self, leaf: int, trial: Primitive, own: Primitive) -> bool:
        turn = _turn(trial, own)
        if turn is None or (np.abs(turn) * self.known.start.radii[leaf] > self.turns[leaf] + EXACT).any():
            return False
        moved = row_of(trial) - row_of(own)
        half = self._half_widths(leaf, np.eye(6))
        if (np.abs(moved) > half + EXACT * self.known.start.radii[leaf]).any():
            return False
        values = Values.of([trial])
        used, (matrix,) = values.classes != UNUSED, values.matrices
        measured, half = matrix @ row_of(own), self._half_widths(leaf, matrix)
        pairs = zip(values.numbers[used].tolist(), measured[used].tolist(), half[used].tolist(), strict=True)
        return all(_is_allowed(*pair) for pair in pairs) and self._allows_outline(leaf, trial.outline, own.outline)

    def _half_widths(self, leaf: int, matrix: np.ndarray) -> np.ndarray:
        """Of combinations [n, 6] of the sizes and the centre of a leaf."""
        slopes = np.zeros((len(matrix), self.known.start.count))
        slopes[:, 9 * leaf : 9 * leaf + 3] = matrix[:, :3]
        slopes[:, 9 * leaf + 3 : 9 * leaf + 6] = matrix[:, 3:] @ self.known.start.numbers.rotations[leaf]
        return self.known.half_widths(slopes)

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
        return bool((np.abs(moved).ravel() <= self.known.half_widths(slopes) + EXACT).all())


def _is_allowed(value: float, measured: float, half: float) -> bool:
    off = abs(value - measured)
    return off <= FINE * half or (off <= half and grid_of(value, COARSE * half) > 0)


def _vertices(outline: Outline) -> list[Sequence[float]]:
    return [place for loop in outline.loops for place in ([v[:2] for v in loop] if isinstance(loop, tuple) else [(loop.x, loop.y)])]


def _turn(trial: Primitive, own: Primitive) -> np.ndarray | None:
    """The rotation vector [3] in the frame of `own` that leads to the trial; None where that was written in another frame."""
    between = matrix_from_euler(own.rotation).T @ matrix_from_euler(trial.rotation)
    if is_round(own):
        return np.array([-between[1, 2], between[0, 2], 0.0]) if between[2, 2] > FLAT else None
    if np.diagonal(between).min() <= FLAT:
        return None
    return np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]) / 2
