"""From any start to control points that meet a theory exactly, or to the constraints that conflict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Literal, NamedTuple

import numpy as np

from imdim.sketch.descent import DescentConfig, adam, polish
from imdim.sketch.system import DEGENERATE, TheorySystem, check_points, length_of
from imdim.sketch.theory import Theory, TheoryError


@dataclass
class SolveConfig:
    descent: DescentConfig = field(default_factory=DescentConfig)
    rounds: int = 3  # of restarts, where the first start leads to no solution
    restarts: int = 8  # in each round, together
    kick: float = 0.3  # half of them start about this far from the best so far, as a share of the theory's length


@dataclass(frozen=True)
class Solution:
    """Points [n, 3] and the violation of each constraint [m]: lengths relative to the theory's length, angles in radians.

    `conflict` are the numbers of constraints that cannot hold together, of which none can be left out; `starts` counts the starts tried.
    """

    points: np.ndarray
    violations: np.ndarray
    stop: Literal["solved", "conflict", "not_converged"]
    conflict: tuple[int, ...] = ()
    starts: int = 1

    @property
    def violation(self) -> float:
        """The largest, 0 without constraints."""
        return float(self.violations.max(initial=0.0))

    def raise_for_conflict(self, theory: Theory) -> None:
        """Raises TheoryError, one line that names the constraints, unless solved."""
        if self.stop == "conflict":
            raise TheoryError(f"no points meet {', '.join(map(theory.name, self.conflict))} together")
        if self.stop == "not_converged":
            worst = theory.name(int(np.argmax(self.violations)))
            raise TheoryError(f"no solution found from {self.starts} starts; {worst} is missed by {self.violation:.3g}")


def solve(theory: Theory, start: np.ndarray | None = None, *, rng: np.random.Generator, config: SolveConfig | None = None) -> Solution:
    """The solution near `start` [n, 3], or from a random start; the same for the same `rng`.

    Raises TheoryError for a start that is not finite or has another shape. Whether a theory can be met is judged by the starts tried:
    a conflict that is reported was missed by all of them.
    """
    config = config or SolveConfig()
    first = random_starts(theory, 1, rng)[0] if start is None else check_points(theory, start)
    scale = length_of(theory, first)
    found = _attempt(theory, first[None] / scale, replace(config.descent, adam_steps=0), scale)
    if not found.good:  # only then: soft penalties lead away from a solution close by
        found = min(found, _attempt(theory, first[None] / scale, config.descent, scale), key=attrgetter("worst"))
    starts = 1
    for _ in range(config.rounds):
        if found.good:
            break
        fresh = _restarts(theory, found.points, scale, config, rng)
        starts += len(fresh)
        found = min(found, _attempt(theory, fresh, config.descent, scale), key=attrgetter("worst"))
    if found.good:
        return Solution(found.points * scale, found.violations, "solved", starts=starts)
    conflict = _conflict(theory, found, scale, config, rng)
    return Solution(found.points * scale, found.violations, "conflict" if conflict else "not_converged", conflict, starts)


def random_starts(theory: Theory, count: int, rng: np.random.Generator) -> np.ndarray:
    """Normal points [count, n, 3] as wide as the theory's length."""
    points = rng.normal(size=(count, theory.n_points, 3)) * (theory.length() or 1.0)
    points[..., theory.dimension :] = 0
    return points


def relax(theories: Sequence[Theory], starts: np.ndarray, scale: np.ndarray, config: DescentConfig) -> tuple[np.ndarray, np.ndarray]:
    """Each theory from its own start [B, n, 3], all at once: points [B, n, 3] and the largest violation [B] of each.

    Theories need equally many points and one dimension. A violation is infinite where a reference has collapsed.
    """
    system = TheorySystem.of(theories, scale)
    x = starts / scale[:, None, None]
    axes = theories[0].dimension

    def spatial(flat: np.ndarray) -> np.ndarray:
        points = np.zeros_like(x)
        points[..., :axes] = flat.reshape(*x.shape[:2], axes)
        return points

    def evaluate(flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return system.evaluate(spatial(flat))

    points = spatial(polish(evaluate, adam(evaluate, x[..., :axes].reshape(len(x), -1), config), config))
    worst = np.abs(system.evaluate(points)[0]).max(axis=1, initial=0.0)
    worst[system.references(points) < DEGENERATE] = np.inf
    return points * scale[:, None, None], worst


class _Attempt(NamedTuple):
    """The best of several starts, in units of the theory's length; `good` where the constraints hold."""

    worst: float
    good: bool
    points: np.ndarray
    violations: np.ndarray


def _attempt(theory: Theory, starts: np.ndarray, config: DescentConfig, scale: float) -> _Attempt:
    copies, scales = [theory] * len(starts), np.full(len(starts), scale)
    points, worst = relax(copies, starts * scale, scales, config)
    best = int(np.argmin(worst))
    system = TheorySystem.of([theory], scales[:1])
    violations = system.per_constraint(system.evaluate(points[best : best + 1] / scale)[0])
    return _Attempt(float(worst[best]), bool(worst[best] <= config.tolerance), points[best] / scale, violations)


def _restarts(theory: Theory, best: np.ndarray, scale: float, config: SolveConfig, rng: np.random.Generator) -> np.ndarray:
    near = config.restarts // 2
    starts = random_starts(theory, config.restarts, rng) / scale
    kicks = config.kick * 3.0 ** (1 - np.arange(near))
    starts[:near] = best + kicks[:, None, None] * rng.normal(size=(near, *best.shape))
    starts[..., theory.dimension :] = 0
    return starts


def _conflict(theory: Theory, found: _Attempt, scale: float, config: SolveConfig, rng: np.random.Generator) -> tuple[int, ...]:
    """A minimal conflicting set by deletion (Chinneck and Dravnieks 1991), empty where its members can be met after all.

    At a least-squares point the residuals balance like the stresses of a bar frame: what is not strained takes no part, so the search
    begins with the strained constraints.
    """

    def met(numbers: Sequence[int]) -> bool:
        part = theory.only(numbers)
        starts = np.concatenate([found.points[None], _restarts(theory, found.points, scale, config, rng)])
        return _attempt(part, starts, config.descent, scale).good

    strained = [int(i) for i in np.flatnonzero(found.violations > 1e-6 * found.violations.max(initial=0))]
    everything = list(range(len(theory.constraints)))
    kept = everything if met(strained) else strained
    for number in sorted(kept, key=lambda i: found.violations[i]):
        rest = [i for i in kept if i != number]
        if not met(rest):
            kept = rest
    return tuple(sorted(kept)) if not any(met(kept) for _ in range(3)) else ()
