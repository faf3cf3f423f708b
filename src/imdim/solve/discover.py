"""Discover the relations that hold among the primitives of a program, and solve its numbers under them.

How well each number is known comes from the cloud (`relations.belief`). Directions are settled first, then sizes and places; each relation
must shorten the description (`relations.select`). The numbers are then fitted to the cloud under all that were taken (`relations.hold`);
what the cloud contradicts, by a test of the cost that each adds, is given up again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from imdim.geometry.constraints import Pose, rows_of
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.sampling import surface_points
from imdim.program.constraints import Constraint
from imdim.program.roles import named
from imdim.program.tree import Program
from imdim.solve.faces import lifted
from imdim.solve.relations.belief import CUT, Cloud, Shown, covariance, noise_of, normal_equations, prior
from imdim.solve.relations.directions import relate_directions
from imdim.solve.relations.hold import fitted, onto, strains
from imdim.solve.relations.merge import merged
from imdim.solve.relations.places import Places, proposals
from imdim.solve.relations.select import Choice

SAME = 1e-10  # what a number moves by rounding, as a share of the part
EXACT_POINTS = 6000  # of a program's own surface, which say what of it shows


@dataclass
class DiscoverConfig:
    """`floor` is a share of the part's diagonal below which no number counts as known: what exact targets differ from their design by."""

    floor: float = 2e-6
    min_support: float = 6.0  # what fewer points show is not shown, as in `refine`
    significance: float = 1e-4  # of the test by which a relation is given up
    reviews: int = 8  # relations that are given up at most
    fit: bool = True  # fit to the cloud; else the numbers move only as far as the relations need


@dataclass(frozen=True)
class Discovery:
    """`program` with numbers under `constraints`, which are independent and hold to rounding.

    `saved_bits` is what the constraints save, `dropped` holds candidates that were not taken, with the reason. `noise` is the standard
    deviation of the cloud around the given program, `cost` and `cost_before` the robust sums of squared distances with and without
    the constraints, over the squared noise.
    """

    program: Program
    constraints: tuple[Constraint, ...]
    dropped: tuple[tuple[Constraint, str], ...]
    noise: float
    cost: float
    cost_before: float


def discover(program: Program, points: np.ndarray, *, normals: np.ndarray | None = None, config: DiscoverConfig | None = None) -> Discovery:
    """Relations among the primitives of `program`, whose numbers fit `points` [n, 3] of the target's surface (see `refine`).

    `normals` [n, 3] (unit, outward) help where faces lie close together. Raises ValueError unless there are finite points of some extent.
    """
    config = config or DiscoverConfig()
    cloud = Cloud.of(points, normals)
    start = lower(program)
    noise = max(noise_of(start, cloud), config.floor * cloud.length)
    taken, dropped = _chosen(start, cloud, config)
    numbers, cost, before = _solved(start, taken, cloud, noise, config)
    for _ in range(config.reviews):
        worst = _strained(numbers, taken, cloud, noise, config)
        if worst is None:
            break
        number, reason = worst
        dropped.append((taken.pop(number), reason))
        numbers, cost, before = _solved(start, taken, cloud, noise, config)
    constraints = named(merged(taken), program)
    return Discovery(lifted(program, start, numbers), constraints, tuple(dropped), noise, cost / noise**2, before / noise**2)


def exact_relations(program: Program, rng: np.random.Generator, config: DiscoverConfig | None = None) -> Discovery:
    """Relations that the numbers of a finished program bear out by themselves, to the floor of `config`; none without a surface.

    Numbers move by no more than that. What of the program shows is told by points of its own surface, drawn with `rng`.
    """
    points = surface_points(program, EXACT_POINTS, rng)[0]
    if len(points) == 0:
        return Discovery(program, (), (), 0.0, 0.0, 0.0)
    return discover(program, points, config=replace(config or DiscoverConfig(), fit=False))


def _chosen(start: Lowered, cloud: Cloud, config: DiscoverConfig) -> tuple[list[Constraint], list[tuple[Constraint, str]]]:
    """The relations that shorten the description, directions first."""
    floor = config.floor * cloud.length
    noise = max(noise_of(start, cloud), floor)
    spread, wide = covariance(start, cloud, floor), prior(start, cloud.length)
    first = Choice(start, spread, wide)
    directions, accepted = relate_directions(first)
    numbers = onto(start, accepted, cloud, normal_equations(start, cloud, CUT * noise))
    choice = Choice(numbers, spread, wide)
    for constraint in accepted:
        choice.accept(constraint)
    places = Places(Pose.of(numbers), choice.covariance.copy(), Shown.of(start, cloud, floor, config.min_support), directions)
    choice.greedy(proposals(places))
    return choice.taken, first.dropped + choice.dropped


def _solved(
    start: Lowered, taken: Sequence[Constraint], cloud: Cloud, noise: float, config: DiscoverConfig
) -> tuple[Lowered, float, float]:
    """Numbers and cost under the constraints, and the cost without."""
    scale = CUT * noise
    free = normal_equations(start, cloud, scale)
    if config.fit:
        numbers, cost = fitted(start, taken, cloud, scale)
        return numbers, cost, min(free.cost, fitted(start, [], cloud, scale)[1])
    numbers = _unmoved(start, onto(start, taken, cloud, free), cloud.length)
    return numbers, normal_equations(numbers, cloud, scale).cost, free.cost


def _unmoved(before: Lowered, after: Lowered, length: float) -> Lowered:
    """`after`, with the numbers of `before` wherever only rounding moved them."""

    def kept(old: np.ndarray, new: np.ndarray, scale: float) -> np.ndarray:
        return np.where(np.abs(new - old) <= SAME * scale, old, new)

    sizes, centers = kept(before.sizes, after.sizes, length), kept(before.centers, after.centers, length)
    return replace(after, sizes=sizes, centers=centers, rotations=kept(before.rotations, after.rotations, 1.0))


def _strained(numbers: Lowered, taken: Sequence[Constraint], cloud: Cloud, noise: float, config: DiscoverConfig) -> tuple[int, str] | None:
    """The relation that adds most to the cost beyond what noise adds, if any does."""
    if not taken:
        return None
    rows = rows_of(taken, numbers)
    strain = strains(numbers, rows, cloud, noise, len(taken))
    counts = np.bincount(rows.owner, minlength=len(taken))
    limits = chi2.ppf(1 - config.significance, np.maximum(counts, 1))
    worst = int(np.argmax(strain / limits))
    if strain[worst] <= limits[worst]:
        return None
    return worst, f"costs {strain[worst]:.1f} squared deviations, noise {limits[worst]:.1f} at most"
