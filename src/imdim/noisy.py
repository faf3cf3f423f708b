"""Programs of noisy clouds, judged by how likely they make the points: which of several, how short, with what numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from imdim.body import NOISY, Seen
from imdim.geometry.cloud import Frame, Target
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program
from imdim.proposals import proposals
from imdim.seeding.cloud_normals import measure_scale
from imdim.solve.discover import DiscoverConfig, discover
from imdim.solve.likelihood import Noise, Shown, shares
from imdim.solve.maximise import Likely, maximise
from imdim.solve.parsimony import length, shortened

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

MOST_POINTS = 8192
QUICK_POINTS = 4096
GUESS = 1.2  # times the measured deviation: a fit that starts too calm takes points for clutter


def unlabelled(body: Target, policy: Policy | None, out_of_time: Callable[[], bool]) -> Program | None:
    """A program of a noisy cloud of which detection cannot tell the inside: the best that the solver makes of the policy's beam.

    None for a calm cloud or a mesh, which then have no inside, and where nothing is left of the cloud.
    """
    frame = Frame.of(body)
    points = frame.normalise(body).points
    sigma = measure_scale(points, np.random.default_rng(0)).sigma
    if body.mesh is not None or sigma <= NOISY:
        return None
    found = proposals(policy, points)
    return frame.undo(_settled(found[0].program, points, sigma, out_of_time)) if found else None


def likelier(program: Program, other: Program, seen: Seen) -> bool:
    """Whether the first of two programs in the body's units, both fitted to its noisy cloud, tells the points in fewer words."""
    points, noise = _thinned(seen.target.points, QUICK_POINTS), Noise(GUESS * seen.sigma)
    lengths = [length(c.program, points, c.noise, c.nll) for c in (maximise(seen.frame.apply(p), points, noise) for p in (program, other))]
    return lengths[0] < lengths[1]


def most_likely(program: Program, seen: Seen, out_of_time: Callable[[], bool]) -> Program:
    """`program` in the body's units fitted to its noisy cloud, shortened, and with the relations that the points bear out."""
    return seen.frame.undo(_settled(seen.frame.apply(program), seen.target.points, seen.sigma, out_of_time))


def _settled(program: Program, points: np.ndarray, sigma: float, out_of_time: Callable[[], bool]) -> Program:
    quick, points = _thinned(points, QUICK_POINTS), _thinned(points, MOST_POINTS)
    short = shortened(maximise(program, quick, Noise(GUESS * sigma)), quick, out_of_time)
    return _related(maximise(reduce_program(short.program), points, short.noise), points)


def _related(likely: Likely, points: np.ndarray) -> Program:
    """With the relations that the points bear out made exact, unless that makes the points less likely than as many numbers are worth."""
    found = discover(likely.program, points, config=DiscoverConfig(fit=False))
    after = shares(points, Shown.of(found.program, likely.noise.sigma), likely.noise).nll
    worth = 0.5 * len(found.constraints) * math.log(len(points)) / len(points)
    return found.program if after < likely.nll + worth else likely.program


def _thinned(points: np.ndarray, count: int) -> np.ndarray:
    return points[:: max(1, len(points) // count)]
