"""Programs of noisy clouds, judged by how likely they make the points: which of several, how short, with what numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from imdim.body import Seen, UnitBody
from imdim.deadline import NEVER, Deadline
from imdim.geometry.axes import clearest_axes, main_axes, shared_axes
from imdim.geometry.sampling import subsample
from imdim.program.constraints import Constraint
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program, leaves, map_leaves
from imdim.proposals import proposals
from imdim.solve.canonical import canonical
from imdim.solve.compounds import compounds
from imdim.solve.discover import discover
from imdim.solve.likelihood import Noise, Shown, shares
from imdim.solve.maximise import Likely, MaximiseConfig, maximise
from imdim.solve.mixture import Draws
from imdim.solve.outlines import outlines
from imdim.solve.parsimony import length
from imdim.solve.pool import Cloud, distinct
from imdim.solve.restructure import REFIT, glanced, most_telling, restructured

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

MOST_POINTS = 8192
QUICK_POINTS = 4096
FITTED = 3  # starts whose numbers are fitted before one is chosen
QUICK = MaximiseConfig()
CAREFUL = MaximiseConfig(rounds=60, still=0.004, calmer=0.003)  # walls that blur thin or thicken slowly, as the noise grows or falls
SAME = 2e-3  # nats per point, what the samples of the surface leave in doubt


@dataclass(frozen=True)
class Told:
    """The program that tells a noisy cloud, with the relations that the points bear out; whether time has `cut` the search for it, or the
    fit of its numbers."""

    program: Program
    constraints: tuple[Constraint, ...]
    cut: bool


def unlabelled(body: UnitBody, policy: Policy | None, choose_by: Deadline, fit_by: Deadline = NEVER, calm: bool = False) -> Told | None:
    """A program of a noisy cloud of which detection cannot tell the inside, from its points and the policy's beam; both in the unit frame.

    None for a mesh and, unless `calm` ones are asked for too, a calm cloud, which then have no inside, and where nothing is left of the
    cloud. Time as for `most_likely`.
    """
    points, noise = body.target.points, body.noise
    if body.target.mesh is not None or not (noise.blurs or calm):
        return None
    found = [p.program for p in proposals(policy, points, noise.sigma, deadline=choose_by)]
    if not found or not noise.blurs:
        return Told(found[0], (), choose_by.passed()) if found else None
    return _Points.of(points, noise.sigma).told(found, choose_by, fit_by)


def most_likely(programs: Sequence[Program], seen: Seen, choose_by: Deadline, fit_by: Deadline = NEVER) -> Told:
    """The program that tells a noisy cloud in the shortest message, with the relations that the points bear out.

    `programs`, of which the last is tried in any case, are where the search for it starts; all lend their primitives.
    The search ends at `choose_by`, and the numbers of its program are fitted until `fit_by` (by default to the end).
    """
    shared = shared_axes([p.surface.axis for p in seen.patches], [p.area for p in seen.patches])
    return _Points.of(seen.target.points, seen.noise.sigma, shared).told(programs, choose_by, fit_by)


@dataclass(frozen=True)
class _Points:
    """A noisy cloud: points [n, 3], the deviation of their noise, the part's directions as columns [3, 3]."""

    points: np.ndarray
    sigma: float
    axes: np.ndarray

    @staticmethod
    def of(points: np.ndarray, sigma: float, *known: np.ndarray) -> _Points:
        """With the clearest of the directions: those `known` from surfaces, those of the points, and the given axes."""
        frames = [*known, main_axes(points[:QUICK_POINTS]), np.eye(3)]
        return _Points(points, sigma, clearest_axes(points, frames, 2 * sigma))

    @cached_property
    def quick(self) -> np.ndarray:
        return subsample(self.points, QUICK_POINTS)

    @cached_property
    def _draws(self) -> Draws:
        return glanced(self.quick)

    @cached_property
    def _cloud(self) -> Cloud:
        return Cloud.of(self.quick, self.sigma)

    def told(self, programs: Sequence[Program], choose_by: Deadline, fit_by: Deadline) -> Told:
        """The shortest message's program, by a search from one primitive, then from the best of `programs`, then from both."""
        found = outlines(self.points, self.axes, self.sigma, deadline=choose_by)
        found = distinct(found, self._cloud) if found else []
        seen = [*found, *compounds(found, self._cloud, self.sigma)]
        lent = [*seen, *dict.fromkeys(leaf for p in programs for leaf in leaves(p))]
        best = self._searched(programs, lent, choose_by)
        cut = choose_by.passed()
        points = self.quick if cut else subsample(self.points, MOST_POINTS)
        shorter = reduce_program(best.program, deadline=fit_by)
        program, constraints = _related(_fitted(shorter, points, best.noise, fit_by, CAREFUL), points, fit_by)
        return Told(program, constraints, cut or fit_by.passed())

    def _searched(self, programs: Sequence[Program], lent: Sequence[Program], deadline: Deadline) -> Likely:
        """The shorter of two searches' messages. What grows from one primitive is quick and stays short; of `programs`, which are long, the
        best start is known at least where time is out."""
        if deadline.passed() or not lent:
            return self._start(programs, deadline)
        first = self._start(lent, deadline)
        grown = self._changed(first, lent, deadline)
        second = self._start(programs, deadline)
        if second.program == first.program:
            return grown
        best, other = sorted((grown, self._changed(second, lent, deadline)), key=self._length)
        return self._changed(best, [*leaves(other.program)], deadline)

    def _changed(self, start: Likely, lent: Sequence[Program], deadline: Deadline) -> Likely:
        return restructured(start, self.quick, lent, self.axes, deadline, self._draws)

    def _start(self, starts: Sequence[Program], deadline: Deadline) -> Likely:
        """The likeliest of several programs, with its numbers fitted."""
        rough = Likely(starts[-1], Noise(self.sigma), np.inf, 0)
        few = most_telling([*dict.fromkeys(starts)], self._draws, rough, FITTED)
        start = min((maximise(p, self.quick, rough.noise, REFIT, deadline) for p in few), key=self._length)
        return start if deadline.passed() else _fitted(start.program, self.quick, start.noise, deadline)

    def _length(self, likely: Likely) -> float:
        return length(likely.program, self.quick, likely.noise, likely.nll)


def _fitted(program: Program, points: np.ndarray, noise: Noise, deadline: Deadline, config: MaximiseConfig = QUICK) -> Likely:
    """The numbers that make the points most likely, with ends let through what they only just meet, unless that hides what they show."""
    through, as_drawn = (maximise(program, points, noise, c, deadline) for c in (config, replace(config, through=0.0)))
    return through if through.nll < as_drawn.nll + SAME else as_drawn


def _related(likely: Likely, points: np.ndarray, deadline: Deadline) -> tuple[Program, tuple[Constraint, ...]]:
    """With the relations that the points bear out made exact, unless that makes the points less likely than as many numbers are worth."""
    if deadline.passed():
        return likely.program, ()
    plain = map_leaves(likely.program, lambda _, leaf: canonical(leaf))
    found = discover(plain, points, deadline)
    after = shares(points, Shown.of(found.program, likely.noise.sigma), likely.noise).nll
    worth = 0.5 * len(found.constraints) * math.log(len(points)) / len(points)
    return (found.program, found.constraints) if after < likely.nll + worth else (likely.program, ())
