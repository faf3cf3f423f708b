"""Many theories over equally many points as one stacked system of residuals and Jacobians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imdim.sketch.residuals import FORMS, form_of
from imdim.sketch.theory import LENGTHS, Theory, TheoryError

DEGENERATE = 1e-6  # a reference shorter than this share of the theory's length defines nothing


@dataclass(frozen=True)
class Block:
    """The constraints of one form: theory and constraint number [r], first row [r], indices [r, k], targets [r]."""

    form: str
    theory: np.ndarray
    number: np.ndarray
    row: np.ndarray
    indices: np.ndarray
    target: np.ndarray


@dataclass(frozen=True)
class TheorySystem:
    """B theories; residuals are [B, rows] and Jacobians [B, rows, n * dimension], with zeros for the rows a theory lacks.

    Points are [B, n, 3] in units of `scale` [B], the length of each theory.
    """

    theories: tuple[Theory, ...]
    scale: np.ndarray
    blocks: tuple[Block, ...]
    rows: int

    @classmethod
    def of(cls, theories: Sequence[Theory], scale: np.ndarray) -> TheorySystem:
        first = theories[0]
        if any((t.n_points, t.dimension) != (first.n_points, first.dimension) for t in theories):
            raise TheoryError("theories of one system have equally many points and one dimension")
        entries: dict[str, list[tuple]] = {}
        rows = 0
        for b, theory in enumerate(theories):
            row = 0
            for number, c in enumerate(theory.constraints):
                form = form_of(c)
                target = c.value / scale[b] if c.kind in LENGTHS else c.value
                entries.setdefault(form, []).append((b, number, row, c.indices, target))
                row += FORMS[form].width
            rows = max(rows, row)
        return cls(tuple(theories), np.asarray(scale, float), tuple(_block(f, e) for f, e in entries.items()), rows)

    def evaluate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals [B, rows] and Jacobians [B, rows, n * dimension] at points [B, n, 3]."""
        batch, n, _ = points.shape
        axes = self.theories[0].dimension
        values, slopes = np.zeros((batch, self.rows)), np.zeros((batch, self.rows, n, 3))
        for block in self.blocks:
            residual, jacobian = FORMS[block.form].residual(points[block.theory[:, None], block.indices], block.target)
            for part in range(residual.shape[1]):
                values[block.theory, block.row + part] = residual[:, part]
                for slot in range(block.indices.shape[1]):
                    slopes[block.theory, block.row + part, block.indices[:, slot]] += jacobian[:, part, slot]
        return values, np.ascontiguousarray(slopes[..., :axes]).reshape(batch, self.rows, n * axes)

    def references(self, points: np.ndarray) -> np.ndarray:
        """The smallest reference [B] that a constraint of each theory divides by."""
        smallest = np.full(len(points), np.inf)
        for block in self.blocks:
            np.minimum.at(smallest, block.theory, FORMS[block.form].reference(points[block.theory[:, None], block.indices]))
        return smallest

    def rows_of(self) -> list[np.ndarray]:
        """The rows of each constraint [m] of a single theory, in order."""
        rows = {
            int(number): np.arange(row, row + FORMS[block.form].width)
            for block in self.blocks
            for number, row in zip(block.number, block.row, strict=True)
        }
        return [rows[i] for i in sorted(rows)]

    def per_constraint(self, residuals: np.ndarray) -> np.ndarray:
        """The norm of each constraint's residual [m] of a single theory: the violations, relative to its length or in radians."""
        return np.array([np.sqrt((residuals[0][rows] ** 2).sum()) for rows in self.rows_of()])


def _block(form: str, entries: list[tuple]) -> Block:
    theory, number, row, indices, target = (np.array(column) for column in zip(*entries, strict=True))
    return Block(form, theory, number, row, indices, target.astype(float))


def check_points(theory: Theory, points: np.ndarray) -> np.ndarray:
    """The points [n, 3] as float64; raises TheoryError for a wrong shape and for what is not finite."""
    points = np.array(points, float)
    if points.shape != (theory.n_points, 3):
        raise TheoryError(f"{theory.n_points} control points need an array [{theory.n_points}, 3], got {list(points.shape)}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        users = [i for i, c in enumerate(theory.constraints) if bad[0] in c.indices]
        raise TheoryError(f"control point {bad[0]} is not finite" + (f", used by {theory.name(users[0])}" if users else ""))
    points[:, theory.dimension :] = 0
    return points


def length_of(theory: Theory, points: np.ndarray) -> float:
    """The theory's own length, or the extent of the points where it fixes none; 1 where they all coincide."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    return theory.length() or extent or 1.0


def violations(theory: Theory, points: np.ndarray) -> np.ndarray:
    """How far each constraint [m] is from holding at points [n, 3]: lengths relative to the theory's length, angles in radians.

    Raises TheoryError that names the first constraint whose reference has no length there.
    """
    points = check_points(theory, points)
    scale = length_of(theory, points)
    system = TheorySystem.of([theory], np.array([scale]))
    x = points[None] / scale
    for block in system.blocks:
        short = np.flatnonzero(FORMS[block.form].reference(x[block.theory[:, None], block.indices]) < DEGENERATE)
        if len(short):
            raise TheoryError(f"{theory.name(int(block.number[short[0]]))}: its reference points coincide or lie on one line")
    return system.per_constraint(system.evaluate(x)[0])
