"""Choose relations by description length, one after the other, each given those before it.

The code: a number of the program that stays free costs ``log2(width / deviation)`` bits, its prior width over the deviation to which the
fit knows it; a relation that gives its place costs the `bits` that name it among its alternatives, and leaves ``z^2 / (2 ln 2)`` bits for
how far the fit is from it in deviations. Both together are the logarithm of a Bayes factor between two normal distributions of the
relation's residuals, that of the prior and that of the fit. What is accepted narrows the distribution (a Kalman update), so that later
candidates are judged by what is known then. Rows of the Jacobian that accepted ones span are redundant: they save nothing.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.lowering import Lowered
from imdim.geometry.pose import Pose
from imdim.program.constraints import Constraint
from imdim.relations.residuals import rows_of

SPANNED = 1e-7  # squared share of a row that accepted ones do not explain, below which they span it


@dataclass(frozen=True)
class RelationCandidate:
    """A relation that may hold, and the bits that name it among its alternatives."""

    constraint: Constraint
    bits: float


@dataclass(frozen=True)
class Judgement:
    """A candidate's saving in bits, and the rank of its new rows."""

    saving: float
    rank: int


class RelationSelection:
    """A normal distribution of the numbers that narrows with each accepted relation.

    `mean` [9 k] is the shift from `numbers`.
    """

    def __init__(self, numbers: Lowered, covariance: np.ndarray, prior: np.ndarray, spanned: float = SPANNED) -> None:
        self.numbers, self.pose = numbers, Pose.of(numbers)
        self.spanned = spanned
        self.before = covariance
        self.width = 1 / prior.ravel()
        self.mean = np.zeros(len(covariance))
        # filled column by column: an orthonormal basis of accepted rows, and what each took from the covariance as an outer product
        self._basis, self._known = np.zeros_like(covariance), np.zeros_like(covariance)
        self.rank = 0
        self.rows: dict[Constraint, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self.taken: list[Constraint] = []

    @property
    def basis(self) -> np.ndarray:
        return self._basis[:, : self.rank]

    @property
    def known(self) -> np.ndarray:
        return self._known[:, : self.rank]

    @property
    def covariance(self) -> np.ndarray:
        """Of the numbers given what was accepted."""
        return self.before - self.known @ self.known.T

    def _block(self, columns: np.ndarray) -> np.ndarray:
        known = self.known[columns]
        return self.before[np.ix_(columns, columns)] - known @ known.T

    def judge(self, candidate: RelationCandidate) -> Judgement:
        """What accepting the candidate now would save."""
        residual, jacobian, columns = self._rows(candidate.constraint)
        if len(residual) == 1:
            return self._judge_row(float(residual[0]), jacobian[0], columns, candidate.bits)
        combine = self._new(jacobian, columns)
        if not combine.shape[1]:
            return Judgement(0.0, 0)
        jacobian, residual = combine.T @ jacobian, combine.T @ residual
        fit = jacobian @ self._block(columns) @ jacobian.T
        wide = (jacobian * self.width[columns]) @ jacobian.T
        spreads = np.linalg.eigvalsh(fit)
        if spreads[0] <= 0:  # but for rounding, nothing of it is open
            return Judgement(0.0, 0)
        z2 = float(residual @ np.linalg.solve(fit, residual))
        volume = (np.linalg.slogdet(wide)[1] - np.log(spreads).sum()) / 2
        saving = (volume - z2 / 2) / math.log(2) - candidate.bits
        return Judgement(saving, combine.shape[1])

    def _judge_row(self, residual: float, row: np.ndarray, columns: np.ndarray, bits: float) -> Judgement:
        """As `judge` for a single equation, which most candidates are."""
        along = row @ self.basis[columns]
        if 1 - float(along @ along) / float(row @ row) <= self.spanned:
            return Judgement(0.0, 0)
        fit, wide = float(row @ self._block(columns) @ row), float(row * row @ self.width[columns])
        if fit <= 0:  # as there
            return Judgement(0.0, 0)
        z2 = residual**2 / fit
        return Judgement((math.log(wide / fit) - z2) / 2 / math.log(2) - bits, 1)

    def accept(self, constraint: Constraint) -> None:
        """Let the relation hold from now on."""
        residual, jacobian, columns = self._rows(constraint)
        combine = self._new(jacobian, columns)
        self.taken.append(constraint)
        if not combine.shape[1]:
            return
        jacobian, residual = combine.T @ jacobian, combine.T @ residual
        spread = self.before[:, columns] @ jacobian.T - self.known @ (self.known[columns].T @ jacobian.T)
        root = np.linalg.cholesky(jacobian @ spread[columns])
        taken = np.linalg.solve(root, spread.T).T
        self.mean -= taken @ np.linalg.solve(root, residual)
        new = slice(self.rank, self.rank + len(residual))
        self._basis[:, new] = self._orthonormal(jacobian, columns)
        self._known[:, new] = taken
        self.rank += len(residual)

    def greedy(self, candidates: Iterable[RelationCandidate], deadline: Deadline = NEVER) -> list[Constraint]:
        """Accept the candidate that saves most, again and again, while one saves anything and there is time; those accepted, in order.

        Savings are only looked at again when a candidate comes to the top: they seldom grow.
        """
        order = [(-self.judge(c).saving, i, c) for i, c in enumerate(takewhile(lambda _: not deadline.has_passed(), candidates))]
        heapq.heapify(order)
        accepted: list[Constraint] = []
        while order and not deadline.has_passed():
            _, i, candidate = heapq.heappop(order)
            judged = self.judge(candidate)
            if judged.rank == 0 or judged.saving <= 0:
                continue
            if order and judged.saving < -order[0][0]:
                heapq.heappush(order, (-judged.saving, i, candidate))
                continue
            self.accept(candidate.constraint)
            accepted.append(candidate.constraint)
        return accepted

    def _rows(self, constraint: Constraint) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals [m] at the mean, Jacobian [m, c] and its columns [c], those of the leaves that it moves."""
        if constraint not in self.rows:
            rows = rows_of([constraint], self.pose)
            columns = np.flatnonzero(np.abs(rows.jacobian).max(0, initial=0.0) > 0)
            self.rows[constraint] = rows.residual, rows.jacobian[:, columns], columns
        residual, jacobian, columns = self.rows[constraint]
        return residual + jacobian @ self.mean[columns], jacobian, columns

    def _new(self, jacobian: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Combinations [m, n] of rows that are independent of each other and of what was accepted."""
        scale = np.linalg.norm(jacobian, axis=1)
        unit = jacobian / np.maximum(scale, 1e-300)[:, None]
        along = unit @ self.basis[columns]
        values, vectors = np.linalg.eigh(unit @ unit.T - along @ along.T)
        kept = values > self.spanned
        return vectors[:, kept] / np.maximum(scale, 1e-300)[:, None]

    def _orthonormal(self, jacobian: np.ndarray, columns: np.ndarray) -> np.ndarray:
        full = np.zeros((len(self.mean), len(jacobian)))
        full[columns] = jacobian.T
        for _ in range(2):  # once more removes what rounding left
            full -= self.basis @ (self.basis.T @ full)
            full = np.linalg.qr(full)[0]
        return full
