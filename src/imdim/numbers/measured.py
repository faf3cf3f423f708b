"""The numbers of a program as a noisy cloud measures them, under relations that hold exactly, and how well it knows each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.numbers.design_values import NORMAL_95
from imdim.numbers.information import Coordinates, bends_of, inform, measure_spread
from imdim.numbers.likelihood import Noise, SurfaceSamples, expectation_step
from imdim.program.tree import Program

MAD = 1.4826  # from the median of absolute normal deviations to their standard deviation
ROUNDS = 5
STILL = 0.1  # of a standard error, below which a step ends the work
FAR = 3.0  # deviations of the noise, that a step moves a number by at most
SUPPORT = 6.0  # points that must show a direction of the numbers' space for a step along it, as in `refine`
LEAST = 0.05  # points that must show it to say how well it is known
SHOWN = 1e-3  # share of a number that may lie in directions that are not shown
DEPENDENT = 1e-9  # singular values of relations, relative to the largest
SAMPLES = 16_000  # of the surface
FINE = 0.05  # of the spacing of samples, below which they do not tell the noise of points between them
NOISE_ROUNDS, NOISE_SETTLED = 20, 5e-4  # steps to the likeliest noise, and the share of it by which the last one moves
ONE_SIDED_95 = 1.644854  # standard deviations, that a normal number is above one time in twenty


@dataclass(frozen=True)
class Measured:
    """The `program` that its points are likeliest for. In the coordinates [p] of `start`: its `shift` from there, their `covariance`
    [p, p], and orthonormal bases [p, q] of what relations leave `free`, and of what of that the points do not show."""

    start: Coordinates
    program: Program
    shift: np.ndarray
    covariance: np.ndarray
    free: np.ndarray
    hidden: np.ndarray
    noise: Noise

    @cached_property
    def _precision(self) -> np.ndarray:
        return np.linalg.pinv(self.covariance, rcond=DEPENDENT, hermitian=True)

    def count_told(self, leaves: Sequence[int]) -> int:
        """How many numbers of some leaves the points show apart from one another: those that a relation ties to others, and those of what
        shows nowhere, are none."""
        own = [9 * leaf + k for leaf in leaves for k in range(9)]
        own += [column for leaf, outline, at in self.start.outlines if leaf in leaves for column in range(at, at + outline.count)]
        return int(np.linalg.matrix_rank(self.covariance[np.ix_(own, own)], hermitian=True)) if own else 0

    def half_width_along(self, way: np.ndarray) -> float:
        """Half of the 95 % interval of a move of several coordinates at once along `way` [p], as a share of it, all others as they are but
        for those that relations take along; infinite where no points show it, and where relations hold all of them."""
        return self.half_width_alone(way) / float(way @ way)

    def half_width_alone(self, slope: np.ndarray) -> float:
        """Half of the 95 % interval of a number with these derivatives [p] where what it does not depend on stays, but for what relations
        take along; infinite where no points show it, and where relations hold it."""
        own = self.free @ (self.free.T @ slope)
        known = float(own @ self._precision @ own)
        return NORMAL_95 / math.sqrt(known) * float(own @ slope) if known > 0 else math.inf

    def half_widths(self, slopes: np.ndarray) -> np.ndarray:
        """Half of the 95 % interval of each number with these derivatives [n, p], in its units; infinite where no points show it, and where
        relations hold it, so that no points were asked."""
        variance = np.einsum("ni,ij,nj->n", slopes, self.covariance, slopes)
        size = np.linalg.norm(slopes, axis=1)
        hidden = np.linalg.norm(slopes @ self.hidden, axis=1) > SHOWN * size
        held = np.linalg.norm(slopes @ self.free, axis=1) <= SHOWN * size
        return np.where(hidden | held, np.inf, NORMAL_95 * np.sqrt(np.maximum(variance, 0.0)))


def measure(program: Program, points: np.ndarray, rows: np.ndarray, deadline: Deadline = NEVER, rounds: int = ROUNDS) -> Measured:
    """`program` moved to make `points` [n, 3] likeliest, as long as combinations `rows` [m, p] of its coordinates stay as they are.

    Newton's method. Past the `deadline` (by default never) there is one more round at the most. Of no `rounds` the program stays where it
    is, and how well its numbers are known there is all that is told.
    """
    start = Coordinates.of(program)
    basis = _null_space(np.concatenate([rows, np.eye(start.count)[start.twice]]), start.count)
    length = float(np.linalg.norm(np.ptp(points, axis=0)))
    noise = noise_beside(program, points)
    shift, at = np.zeros(basis.shape[1]), program
    covariance, hidden = np.zeros((len(shift), len(shift))), np.eye(len(shift))
    for done in range(max(rounds, 1)):
        now = Coordinates.of(at)
        shown = SurfaceSamples.of(at, noise.sigma, SAMPLES)
        if not len(shown.points):
            break
        bends = bends_of(now.numbers, shown.points, shown.normals, length)
        known = inform(points, shown, bends, now.tangents(shown) @ basis, noise)
        values, vectors = np.linalg.eigh(known.curvature)
        points_worth = values * noise.sigma**2
        seen, shown_well = points_worth >= LEAST, points_worth >= SUPPORT
        inverse = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
        covariance, hidden = inverse @ known.scatter @ inverse, vectors[:, ~seen]
        if rounds == 0:
            covariance *= measure_spread(known.places, known.residual)
            break
        step = (vectors[:, shown_well] / values[shown_well]) @ (vectors[:, shown_well].T @ known.slope)
        noise = known.noise
        step *= min(1.0, FAR * noise.sigma / max(float(np.abs(step).max(initial=0.0)), 1e-300))
        shift += step
        at = start.move(basis @ shift)
        still = np.abs(step) <= STILL * np.sqrt(np.maximum(np.diagonal(covariance), 0.0)) + 1e-12 * length
        if still.all() or deadline.has_passed() or done == rounds - 1:
            covariance *= measure_spread(known.places, known.residual)
            break
    return Measured(start, at, basis @ shift, basis @ covariance @ basis.T, basis, basis @ hidden, noise)


def noise_beside(program: Program, points: np.ndarray) -> Noise:
    """The likeliest noise of points [n, 3] beside a program that stays as it is.

    By the distances of the points alone both skins of a thin wall would have too little of it, since each point is told to be the nearer
    one's. That is where it begins, and where it ends if samples of the surface lie too far apart to tell more.
    """
    noise = Noise(max(MAD * float(np.median(np.abs(kernels.program_sdf(program, points)))), 1e-9))
    for _ in range(NOISE_ROUNDS):
        shown = SurfaceSamples.of(program, noise.sigma, SAMPLES)
        if not len(shown.points) or noise.sigma < FINE * shown.spacing:
            break
        before, noise = noise, expectation_step(points, shown, noise).noise
        if abs(noise.sigma - before.sigma) < NOISE_SETTLED * noise.sigma:
            break
    return noise


def _null_space(rows: np.ndarray, count: int) -> np.ndarray:
    """An orthonormal basis [count, q] of what leaves all `rows` [m, count] as they are."""
    if not len(rows):
        return np.eye(count)
    _, values, vectors = np.linalg.svd(rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None])
    rank = int((values > DEPENDENT * values.max(initial=0.0)).sum())
    return vectors[rank:].T


def chi_squared_95(degrees: int) -> float:
    """What a chi-squared number is above one time in twenty (Wilson & Hilferty 1931)."""
    spread = 2 / (9 * max(degrees, 1))
    return degrees * (1 - spread + ONE_SIDED_95 * math.sqrt(spread)) ** 3
