"""Programs of noisy clouds, judged by how likely they make the points: which of several, how short, with what numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from imdim.body import NOISY, Seen, uncrowded
from imdim.fitting import Related
from imdim.geometry.axes import clearest_axes, main_axes, shared_axes
from imdim.geometry.cloud import Frame, Target
from imdim.program.constraints import Constraint, scaled
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program, leaves, map_leaves
from imdim.proposals import proposals
from imdim.seeding.cloud_normals import measure_scale
from imdim.solve.canonical import canonical
from imdim.solve.compounds import compounds
from imdim.solve.discover import DiscoverConfig, discover
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


def unlabelled(
    body: Target,
    policy: Policy | None,
    out_of_time: Callable[[], bool],
    no_time_to_fit: Callable[[], bool] = bool,
    calm: bool = False,
) -> Related | None:
    """A program of a noisy cloud of which detection cannot tell the inside, from its points and the policy's beam, with its relations.

    None for a mesh and, unless `calm` ones are asked for too, a calm cloud, which then have no inside, and where nothing is left of the
    cloud. Time as for `most_likely`.
    """
    frame = Frame.of(body)
    points = uncrowded(frame.normalise(body)).points
    sigma = measure_scale(points, np.random.default_rng(0)).sigma
    if body.mesh is not None or (sigma <= NOISY and not calm):
        return None
    found = [p.program for p in proposals(policy, points, out_of_time=out_of_time)]
    if not found or sigma <= NOISY:
        return (frame.undo(found[0]), ()) if found else None
    return _undone(frame, *_Points.of(points, sigma).told(found, out_of_time, no_time_to_fit))


def most_likely(
    programs: Sequence[Program], seen: Seen, out_of_time: Callable[[], bool], no_time_to_fit: Callable[[], bool] = bool
) -> Related:
    """The program in the body's units that tells its noisy cloud in the shortest message, with the relations that the points bear out.

    `programs`, of which the last is tried in any case, are where the search for it starts; all lend their primitives.
    Once `out_of_time` the search ends, and the numbers of its program are fitted until there is `no_time_to_fit` (by default to the end).
    """
    shared = shared_axes([p.surface.axis for p in seen.patches], [p.area for p in seen.patches])
    points = _Points.of(seen.target.points, seen.sigma, shared)
    return _undone(seen.frame, *points.told([seen.frame.apply(p) for p in programs], out_of_time, no_time_to_fit))


def _undone(frame: Frame, program: Program, constraints: Sequence[Constraint]) -> Related:
    """A program of the unit frame in the body's units, with its constraints."""
    return frame.undo(program), scaled(constraints, 1 / frame.scale)


@dataclass(frozen=True)
class _Points:
    """A noisy cloud in its unit frame: points [n, 3], the deviation of their noise, the part's directions as columns [3, 3]."""

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
        return _thinned(self.points, QUICK_POINTS)

    @cached_property
    def _draws(self) -> Draws:
        return glanced(self.quick)

    @cached_property
    def _cloud(self) -> Cloud:
        return Cloud.of(self.quick)

    def told(self, programs: Sequence[Program], out_of_time: Callable[[], bool], no_time_to_fit: Callable[[], bool]) -> Related:
        """The shortest message's program, by a search from one primitive, then from the best of `programs`, then from both."""
        found = outlines(self.points, self.axes, self.sigma, out_of_time=out_of_time)
        found = distinct(found, self._cloud) if found else []
        seen = [*found, *compounds(found, self._cloud, self.sigma)]
        lent = [*seen, *dict.fromkeys(leaf for p in programs for leaf in leaves(p))]
        best = self._searched(programs, lent, out_of_time)
        points = self.quick if out_of_time() else _thinned(self.points, MOST_POINTS)
        shorter = reduce_program(best.program, out_of_time=no_time_to_fit)
        return _related(_fitted(shorter, points, best.noise, no_time_to_fit, CAREFUL), points, no_time_to_fit)

    def _searched(self, programs: Sequence[Program], lent: Sequence[Program], out_of_time: Callable[[], bool]) -> Likely:
        """The shorter of two searches' messages. What grows from one primitive is quick and stays short; of `programs`, which are long, the
        best start is known at least where time is out."""
        if out_of_time() or not lent:
            return self._start(programs, out_of_time)
        first = self._start(lent, out_of_time)
        grown = self._changed(first, lent, out_of_time)
        second = self._start(programs, out_of_time)
        if second.program == first.program:
            return grown
        best, other = sorted((grown, self._changed(second, lent, out_of_time)), key=self._length)
        return self._changed(best, [*leaves(other.program)], out_of_time)

    def _changed(self, start: Likely, lent: Sequence[Program], out_of_time: Callable[[], bool]) -> Likely:
        return restructured(start, self.quick, lent, self.axes, out_of_time, self._draws)

    def _start(self, starts: Sequence[Program], out_of_time: Callable[[], bool]) -> Likely:
        """The likeliest of several programs, with its numbers fitted."""
        rough = Likely(starts[-1], Noise(self.sigma), np.inf, 0)
        few = most_telling([*dict.fromkeys(starts)], self._draws, rough, FITTED)
        start = min((maximise(p, self.quick, rough.noise, REFIT, out_of_time) for p in few), key=self._length)
        return start if out_of_time() else _fitted(start.program, self.quick, start.noise, out_of_time)

    def _length(self, likely: Likely) -> float:
        return length(likely.program, self.quick, likely.noise, likely.nll)


def _fitted(program: Program, points: np.ndarray, noise: Noise, out_of_time: Callable[[], bool], config: MaximiseConfig = QUICK) -> Likely:
    """The numbers that make the points most likely, with ends let through what they only just meet, unless that hides what they show."""
    through, as_drawn = (maximise(program, points, noise, c, out_of_time) for c in (config, replace(config, through=0.0)))
    return through if through.nll < as_drawn.nll + SAME else as_drawn


def _related(likely: Likely, points: np.ndarray, out_of_time: Callable[[], bool]) -> Related:
    """With the relations that the points bear out made exact, unless that makes the points less likely than as many numbers are worth."""
    if out_of_time():
        return likely.program, ()
    plain = map_leaves(likely.program, lambda _, leaf: canonical(leaf))
    found = discover(plain, points, config=DiscoverConfig(fit=False), out_of_time=out_of_time)
    after = shares(points, Shown.of(found.program, likely.noise.sigma), likely.noise).nll
    worth = 0.5 * len(found.constraints) * math.log(len(points)) / len(points)
    return (found.program, found.constraints) if after < likely.nll + worth else (likely.program, ())


def _thinned(points: np.ndarray, count: int) -> np.ndarray:
    return points[:: max(1, len(points) // count)]
