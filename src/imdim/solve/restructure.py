"""Another structure for a program of a noisy cloud: the one that tells the points in the shortest message.

Detection sees what noise leaves of edges and small faces, and the search believes it. Here parts are put in, left out, exchanged, turned
from part to cut and moved in the order, by what the points say (`parsimony`). What could be put in comes from outside (`lent`), from the
places that the program does not explain (`missing`) and from its own parts. All single changes are looked at over one `mixture`; the
numbers of the most promising are fitted, and the first that shortens the message is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from imdim.deadline import Deadline
from imdim.geometry import kernels
from imdim.program.cost import count
from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Combine, Primitive, Program
from imdim.solve.compounds import shells, stadiums
from imdim.solve.likelihood import Shown
from imdim.solve.maximise import Likely, MaximiseConfig, maximise
from imdim.solve.missing import alternatives, hollows, missing, trimmed
from imdim.solve.mixture import Draws, Mixture, Scene, Steps, folded, to_steps
from imdim.solve.parsimony import length, numbers
from imdim.solve.pool import Choice, Cloud, distinct, own_moves, uses
from imdim.solve.rims import rims

ROUNDS = 40
SEEN = 2048  # points that changes are looked at with
GLANCE = 4  # each so-manieth of them for a first look
LOOKED = 120  # changes that get a second one
TRIED = 16  # changes whose numbers get a first step
FEWER = 2  # each so-manieth point for that
REFITTED = 4  # of them, whose numbers are fitted
LONGEST = 40  # steps of a sequence
SLACK = 0.05  # nats per point that a change may cost before its numbers are fitted
WORTH = 2e-3  # nats per point, what the samples of the surface leave in doubt; a change for fewer numbers need not be worth it
UNEXPLAINED = (3.0, 2.2)  # deviations of the noise
OWN = 3.0  # deviations of the noise, within which a primitive explains a point
BLURRED = 0.3  # deviations of the noise by which both skins of a wall must lie off their middle to be told from one
TAPER = 0.05  # of a radius
HOLLOW = ("box", "sphere", "cylinder")
FIRST = MaximiseConfig(rounds=2, through=0.0)
REFIT = MaximiseConfig(rounds=4, through=0.0)


def restructured(
    likely: Likely,
    points: np.ndarray,
    lent: Sequence[Program],
    axes: np.ndarray,
    deadline: Deadline,
    draws: Draws | None = None,
) -> Likely:
    """The program with the changes that shorten the message of `points` [n, 3], each the best of its round.

    `axes` [3, 3] has the part's directions as columns. Sequences of more than LONGEST steps stay as they are. `draws` of the `glanced`
    points keep for other calls what was computed for single parts.
    """
    if deadline.passed():
        return likely
    area = Shown.of(likely.program, likely.noise.sigma).area
    scene = Scene(draws or glanced(points), likely.noise, area, len(points))
    search = _Search(points, Cloud.of(points), scene, lent, axes, deadline)
    best, cost = likely, length(likely.program, points, likely.noise, likely.nll)
    for _ in range(ROUNDS):
        found = search.shorter(best, cost)
        if found is None:
            break
        best, cost = found
    return best


def glanced(points: np.ndarray) -> Draws:
    """Of points [n, 3], those that changes are looked at with."""
    return Draws(_every(points, SEEN))


def most_telling(programs: Sequence[Program], draws: Draws, likely: Likely, most: int) -> list[Program]:
    """The `most` of `programs`, as they are, that tell the points of `draws` in the shortest messages; `likely` gives noise and area."""
    scene = Scene(draws, likely.noise, Shown.of(likely.program, likely.noise.sigma).area)
    lengths = Mixture.of(scene, [], programs).lengths([((i, True),) for i in range(len(programs))])
    return [programs[i] for i in np.argsort(lengths, kind="stable")[:most]]


def _every(points: np.ndarray, count: int) -> np.ndarray:
    return points[:: max(1, len(points) // count)]


@dataclass(frozen=True)
class _Search:
    points: np.ndarray
    cloud: Cloud
    scene: Scene
    lent: Sequence[Program]
    axes: np.ndarray
    deadline: Deadline

    def shorter(self, best: Likely, cost: float) -> tuple[Likely, float] | None:
        """The most promising change whose message is shorter than `cost` once its numbers are fitted, and its length."""
        steps = to_steps(best.program)
        if self.deadline.passed() or len(steps) > LONGEST:
            return None
        worth = cost - WORTH
        fewer = numbers(best.program)
        firsts = self._fitted([(p, best) for p in self._promising(best, steps)], self.points[::FEWER], FIRST)
        fitted = self._fitted([(trial.program, trial) for _, trial in firsts[:REFITTED]], self.points, REFIT)
        shorter = [(after, trial) for after, trial in fitted if after < (cost if numbers(trial.program) < fewer else worth)]
        return (shorter[0][1], shorter[0][0]) if shorter else None

    def _fitted(self, tried: Sequence[tuple[Program, Likely]], points: np.ndarray, config: MaximiseConfig) -> list[tuple[float, Likely]]:
        """Programs with their numbers fitted to `points`, from the noise beside each, and the lengths of their messages that tell all
        points at that density, the shortest first."""
        out = []
        for program, known in tried:
            if self.deadline.passed():
                return []
            trial = maximise(program, points, known.noise, config, self.deadline)
            out.append((length(trial.program, self.points, trial.noise, trial.nll), trial))
        return sorted(out, key=itemgetter(0))

    def _promising(self, best: Likely, steps: Steps) -> list[Program]:
        """Changed programs, not fitted, the shortest message first."""
        single, compound = _sorted([*self._guesses(best, steps), *self.lent])
        others = [*distinct(single, self.cloud), *compound, *_lessened(steps)]
        mixture = Mixture.of(self.scene, [p for p, _ in steps], others)
        start: Choice = tuple((i, sign) for i, (_, sign) in enumerate(steps))
        new = (c for i in range(len(steps), len(mixture.parts)) for c in uses(i, start))
        moves = [*own_moves(start), *(c for c in new if all(sign or not _is_wall(mixture.parts[i]) for i, sign in c))]
        glance = [start, *(moves[i - 1] for i in _shortest(mixture.lengths([start, *moves], GLANCE), LOOKED))]
        lengths = mixture.lengths(glance)
        return [folded(mixture.steps(glance[i])) for i in _shortest(lengths, TRIED) if lengths[i] < lengths[0] + SLACK]

    def _guesses(self, best: Likely, steps: Steps) -> list[Program]:
        """What might be missing, and other shapes for the points of each primitive of the sequence."""
        cloud, axes, sigma = self.cloud, self.axes, best.noise.sigma
        # deep in a thin plate nothing is far from its surface
        out: list[Program] = [p for far in UNEXPLAINED for p, _ in missing(best.program, cloud, axes, far * sigma)]
        leaf, value, _, _ = kernels.program_tangent(best.program, cloud.points)
        near, first = np.abs(value) < OWN * sigma, 0
        for part, positive in steps:
            own = near & (leaf == first)
            first += count(part).primitives
            if isinstance(part, Primitive):
                out += [
                    *trimmed(part, cloud.points[own]),
                    *alternatives(cloud.points[own], axes, cloud),
                    *_tapered(part),
                    *stadiums(part, sigma),
                ]
                if positive and own.any():
                    out += [*_hollowed(part, value[own], cloud, sigma), *rims(part, cloud.points, sigma)]
        return out


def _hollowed(part: Primitive, value: np.ndarray, cloud: Cloud, sigma: float) -> list[Program]:
    """The part's cavities, and walls about its skin where the distances `value` [m] of its points from it are more than noise."""
    half = float(np.sqrt(max(np.mean(value**2) - sigma**2, 0.0)))
    walls = shells(part, 2 * half, cloud, sigma) if half > BLURRED * sigma else ()
    return [*walls, *(hollows(part, float(np.median(np.abs(value))), cloud) if part.kind in HOLLOW else ())]


def _shortest(lengths: np.ndarray, most: int) -> np.ndarray:
    """Indices of the `most` shortest, of those that come to the same the first, and none of those that come to what the first of all does:
    in another order the same solid comes about."""
    first = np.unique(np.round(lengths, 9), return_index=True)[1]
    return first[first > 0][:most]


def _is_wall(part: Program) -> bool:
    """Whether a part is no cut: what is left of a cut in its middle would stand alone."""
    return isinstance(part, Combine) and part.op == "difference"


def _sorted(programs: Sequence[Program]) -> tuple[list[Primitive], list[Combine]]:
    """Primitives, and others."""
    return [p for p in programs if isinstance(p, Primitive)], [p for p in programs if isinstance(p, Combine)]


def _tapered(part: Primitive) -> Iterator[Primitive]:
    """Cones in the place of a cylinder, a little wider at either end."""
    if part.kind == "cylinder":
        radius, height = part.size
        for by in (TAPER, -TAPER):
            yield Primitive("cone", (radius * (1 - by), radius * (1 + by), height), part.center, part.rotation)


def _lessened(steps: Steps) -> Iterator[Program]:
    """Parts that are no primitives, each without one of their leaves."""
    for part, _ in steps:
        if isinstance(part, Combine):
            yield from (less for path, _ in leaf_paths(part) if (less := without(part, [path])) is not None)
