"""Discover the relations that hold among the primitives of a program, and solve its numbers under them.

How well each number is known comes from the cloud (`relations.belief`). Directions are settled first, then sizes and places; each relation
must shorten the description (`relations.select`). The numbers are then fitted to the cloud under all that were taken (`relations.hold`);
what the cloud contradicts, by a test of the cost that each adds, is given up again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from imdim.geometry.constraints import holding, rows_of
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import Pose, radii
from imdim.program.constraints import Constraint
from imdim.program.roles import named
from imdim.program.tree import Program
from imdim.solve.faces import lifted
from imdim.solve.relations.belief import CUT, Cloud, Normal, Shown, away_from_edges, covariance, noise_of, normal_equations, prior, uniform
from imdim.solve.relations.directions import relate_directions
from imdim.solve.relations.features import Places
from imdim.solve.relations.hold import fitted, onto, strains
from imdim.solve.relations.merge import merged, pruned
from imdim.solve.relations.places import proposals
from imdim.solve.relations.select import Choice

TILTED = 1e-2  # while axes are off by degrees: what a row keeps beside those that span it once they are not
REACH = 8.0  # deviations
SAME = 1e-10  # what a number moves by rounding, as a share of the part


@dataclass
class DiscoverConfig:
    """`floor` is a share of the part's diagonal below which no number counts as known: what exact targets differ from their design by."""

    floor: float = 2e-6
    min_support: float = 6.0  # what fewer points show is not shown, as in `refine`
    significance: float = 1e-4  # of the test by which a relation is given up
    reviews: int = 8  # relations that are given up at most
    fit: bool = True  # fit to the cloud under the relations; else the numbers move no further than these need, as a crude program bears


@dataclass(frozen=True)
class Discovery:
    """`program` with numbers under `constraints`, which are independent and hold to rounding.

    `saved_bits` is what they save of the description, `dropped` holds candidates that were not taken, with the reason. `noise` is the
    standard deviation of the cloud around the given program, `cost` and `cost_before` the robust sums of squared distances with and
    without the constraints, over the squared noise.
    """

    program: Program
    constraints: tuple[Constraint, ...]
    dropped: tuple[tuple[Constraint, str], ...]
    saved_bits: float
    noise: float
    cost: float
    cost_before: float


def discover(
    program: Program,
    points: np.ndarray,
    *,
    normals: np.ndarray | None = None,
    config: DiscoverConfig | None = None,
    out_of_time: Callable[[], bool] = bool,
) -> Discovery:
    """Relations among the primitives of `program`, whose numbers fit `points` [n, 3] of the target's surface (see `refine`).

    `normals` [n, 3] (unit, outward) help where faces lie close together. Once `out_of_time` (by default never) no more are taken.
    Raises ValueError unless there are finite points of some extent.
    """
    config = config or DiscoverConfig()
    cloud = Cloud.of(points, normals)
    start = lower(program)
    noise = max(noise_of(start, cloud), config.floor * cloud.length)
    floor = config.floor * cloud.length
    cloud = away_from_edges(cloud, start, noise)
    shown = Shown.of(start, cloud, floor, config.min_support)
    metric = normal_equations(start, cloud, CUT * noise)
    known = covariance(start, cloud, floor)
    chosen = _chosen(start, known, prior(start, cloud.length), shown, metric, out_of_time)
    taken, dropped = chosen.taken, chosen.dropped
    numbers, cost = _solved(start, taken, cloud, noise, known if config.fit else None)
    for _ in range(config.reviews):
        worst = None if out_of_time() else _strained(numbers, taken, cloud, noise, config.significance)
        if worst is None:
            break
        number, reason = worst
        dropped.append((taken.pop(number), reason))
        numbers, cost = _solved(start, taken, cloud, noise, known if config.fit else None)
    before = min(metric.cost, fitted(start, [], cloud, CUT * noise)[1])
    constraints = named(merged(pruned(taken, numbers)), program)
    return Discovery(lifted(program, start, numbers), constraints, tuple(dropped), chosen.saved, noise, cost / noise**2, before / noise**2)


def exact_relations(program: Program, config: DiscoverConfig | None = None, out_of_time: Callable[[], bool] = bool) -> Discovery:
    """Relations that the numbers of a finished program bear out by themselves, each known to the floor of `config`.

    Numbers move by no more than that. Unlike `discover`, it also sees faces that are hidden where parts meet.
    """
    config = config or DiscoverConfig()
    start = lower(program)
    length = _length(start)
    k, floor = len(start.kinds), config.floor * length
    chosen = _chosen(start, floor**2 * np.eye(9 * k), prior(start, length), Shown.everything(start), uniform(k), out_of_time)
    numbers = _unmoved(start, onto(start, chosen.taken, length, uniform(k)), length)
    constraints = named(merged(pruned(chosen.taken, numbers)), program)
    return Discovery(lifted(program, start, numbers), constraints, tuple(chosen.dropped), chosen.saved, floor, 0.0, 0.0)


def _chosen(start: Lowered, spread: np.ndarray, wide: np.ndarray, shown: Shown, metric: Normal, out_of_time: Callable[[], bool]) -> Choice:
    """The relations that shorten the description, directions first."""
    first = Choice(start, spread, wide, TILTED)
    directions, accepted = relate_directions(first)
    length = float(np.sqrt(1 / wide[:, :6].max()))
    numbers = onto(start, accepted, length, metric)
    choice = Choice(numbers, spread, wide)
    for constraint in accepted:
        choice.accept(constraint)
    choice.greedy(proposals(Places(Pose.of(numbers), choice.covariance, shown, directions)), out_of_time)
    choice.dropped[:0] = first.dropped
    choice.saved += first.saved
    return choice


def _solved(start: Lowered, taken: Sequence[Constraint], cloud: Cloud, noise: float, known: np.ndarray | None) -> tuple[Lowered, float]:
    """Numbers under the constraints, and their cost: fitted if that stays within what is `known` (a covariance), else as near as can be."""
    scale = CUT * noise
    if known is not None:
        numbers, cost = fitted(start, taken, cloud, scale)
        if _near(start, numbers, known):
            return numbers, cost
    numbers = onto(start, taken, cloud.length, normal_equations(start, cloud, scale))
    return numbers, normal_equations(numbers, cloud, scale).cost


def _near(before: Lowered, after: Lowered, known: np.ndarray) -> bool:
    """Whether no size or place moved by more than REACH deviations: further off lies another minimum."""
    shift = np.einsum("kji,kj->ki", before.rotations, after.centers - before.centers)
    moves = np.concatenate([after.sizes - before.sizes, shift], axis=1)
    return bool((np.abs(moves) <= REACH * np.sqrt(np.diagonal(known)).reshape(-1, 9)[:, :6]).all())


def _unmoved(before: Lowered, after: Lowered, length: float) -> Lowered:
    """`after`, with the numbers of `before` wherever only rounding moved them."""

    def kept(old: np.ndarray, new: np.ndarray, scale: float) -> np.ndarray:
        return np.where(np.abs(new - old) <= SAME * scale, old, new)

    sizes, centers = kept(before.sizes, after.sizes, length), kept(before.centers, after.centers, length)
    return replace(after, sizes=sizes, centers=centers, rotations=kept(before.rotations, after.rotations, 1.0))


def _strained(numbers: Lowered, taken: Sequence[Constraint], cloud: Cloud, noise: float, significance: float) -> tuple[int, str] | None:
    """The relation that adds most to the cost beyond what noise adds, if any does."""
    if not taken:
        return None
    rows = rows_of(taken, numbers)
    strain = strains(numbers, rows, cloud, noise, len(taken))
    counts = np.bincount(rows.owner, minlength=len(taken))
    # quantiles of chi squared; scipy.stats has them too, and takes a third of a second to import
    limits = 2 * gammaincinv(np.maximum(counts, 1) / 2, 1 - significance)
    worst = int(np.argmax(strain / limits))
    if strain[worst] <= limits[worst]:
        return None
    return worst, f"costs {strain[worst]:.1f} squared deviations, noise {limits[worst]:.1f} at most"


def held(program: Program, constraints: Sequence[Constraint]) -> tuple[Program, tuple[Constraint, ...]]:
    """The program moved onto the constraints by the shortest way, and those that then hold; numbers that none of them names stay."""
    start = lower(program)
    length = _length(start)
    moved = lifted(program, start, _unmoved(start, onto(start, constraints, length, uniform(len(start.kinds))), length))
    return moved, holding(moved, constraints)


def _length(numbers: Lowered) -> float:
    return float(np.linalg.norm(np.ptp(numbers.centers, axis=0)) + 2 * radii(numbers).max())
