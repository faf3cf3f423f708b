"""Discover the relations that hold among the primitives of a program, and solve its numbers under them.

How well each number is known comes from the cloud (`relations.belief`). Directions are settled first, then sizes and places; each relation
must shorten the description (`relations.select`). The numbers then move onto all that were taken, no further than these need
(`relations.hold`); what the cloud contradicts, by a test of the cost that each adds, is given up again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from imdim.deadline import NEVER, Deadline
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import Pose, extent_of
from imdim.numbers.face_coordinates import lift_numbers
from imdim.program.constraints import WORLD, Constraint, ConstraintError
from imdim.program.roles import name_constraints
from imdim.program.tree import Program, leaves
from imdim.relations.belief import (
    CUT,
    DeterminedFaces,
    Normal,
    WeightedCloud,
    away_from_edges,
    covariance,
    noise_of,
    normal_equations,
    prior,
    uniform,
)
from imdim.relations.directions import relate_directions
from imdim.relations.features import Places
from imdim.relations.hold import onto, strains
from imdim.relations.places import proposals
from imdim.relations.residuals import holding, rows_of
from imdim.relations.select import RelationSelection

TILTED = 1e-2  # while axes are off by degrees: what a row keeps beside those that span it once they are not
SAME = 1e-10  # what a number moves by rounding, as a share of the part
FLOOR = 2e-6  # share of the part's diagonal below which no number counts as known: what exact targets differ from their design by
MIN_SUPPORT = 6.0  # what fewer points show is not shown, as in `refine`
SIGNIFICANCE = 1e-4  # of the test by which a relation is given up
ROUND = (1e-2, 1e-5)  # grids of rounder and of round numbers, times the power of ten below the part's size
ROUND_DEG = (10.0, 0.1)  # the same in degrees
NO_DIGITS = 99  # decimals of a number that is not round
FIRM, FIRMER = 1e4, 1e9  # points' worth that hold a round number, and a rounder one
REVIEWS = 8  # relations that are given up at most
SPANNED = 1e-6  # weights in combinations of rows that vanish
TRANSITIVE = ("parallel", "equal", "coaxial", "concentric")
ORDER = ("parallel", "perpendicular", "equal", "coaxial", "concentric")


@dataclass(frozen=True)
class Discovery:
    """`program` with numbers under `constraints`, which are independent and hold to rounding."""

    program: Program
    constraints: tuple[Constraint, ...]


def discover(program: Program, points: np.ndarray, deadline: Deadline = NEVER, noise: float | None = None) -> Discovery:
    """Relations among the primitives of `program`, whose numbers fit `points` [n, 3] of the target's surface (see `refine`).

    The deviation of their `noise` is by default told by their distances, too little of it where walls are thin. Past the `deadline` (by
    default never) no more are taken. Raises ValueError unless there are finite points of some extent.
    """
    cloud = WeightedCloud.of(points)
    start = lower(program)
    floor = FLOOR * cloud.length
    noise = max(noise_of(start, cloud) if noise is None else noise, floor)
    cloud = away_from_edges(cloud, start, noise)
    shown = DeterminedFaces.of(start, cloud, noise, MIN_SUPPORT)
    metric = normal_equations(start, cloud, CUT * noise)
    known = covariance(start, cloud, noise, floor)
    chosen = _choose(start, known, prior(start, cloud.length), shown, metric, deadline)
    taken = chosen.taken
    numbers = onto(start, taken, cloud.length, metric)
    for _ in range(REVIEWS):
        worst = None if deadline.has_passed() else _find_most_strained(numbers, taken, cloud, noise)
        if worst is None:
            break
        taken.pop(worst)
        numbers = onto(start, taken, cloud.length, metric)
    constraints = name_constraints(merge_transitive(prune_implied(taken, numbers)), program)
    return Discovery(lift_numbers(program, start, numbers), constraints)


def exact_relations(program: Program, deadline: Deadline = NEVER) -> Discovery:
    """Relations that the numbers of a finished program support by themselves, each known to FLOOR.

    Numbers move by no more than that, round ones less than others. Unlike `discover`, it also sees faces that are hidden where parts meet.
    """
    start = lower(program)
    length = extent_of(start)
    k, floor, metric = len(start.kinds), FLOOR * length, _firm_where_round(program, length)
    chosen = _choose(start, floor**2 * np.eye(9 * k), prior(start, length), DeterminedFaces.everything(start), metric, deadline)
    numbers = _keep_unmoved(start, _hold_roundly(start, chosen.taken, length, metric), length)
    constraints = name_constraints(merge_transitive(prune_implied(chosen.taken, numbers)), program)
    return Discovery(lift_numbers(program, start, numbers), constraints)


def _firm_where_round(program: Program, length: float) -> Normal:
    """A metric in which sizes, places and directions that are round weigh so much that the others come to them, and what is rounder by
    far more than that: of a bolt circle one hole is at 30, 0, and another at 15, 25.98, where rounding has put it."""
    grids = [share * 10.0 ** np.floor(np.log10(length)) for share in ROUND]
    weights = []
    for p in leaves(program):
        lengths = [_firmness((value,), grids, length) for value in (*p.size, *(1.0,) * (3 - len(p.size)), *p.center)]
        weights.append([*lengths, *[_firmness(p.rotation, ROUND_DEG, 360.0)] * 3])
    metric = uniform(len(weights))
    return replace(metric, matrix=metric.matrix * np.array(weights)[:, :, None])


def _firmness(values: Sequence[float], grids: Sequence[float], scale: float) -> float:
    """What numbers weigh that are all on a coarse or a fine grid, 1 for those on none."""
    on = (all(abs(v - grid * round(v / grid)) <= SAME * scale for v in values) for grid in grids)
    return next((weight for weight, round_ in zip((FIRMER, FIRM), on, strict=True) if round_), 1.0)


def _choose(
    start: Lowered, spread: np.ndarray, wide: np.ndarray, shown: DeterminedFaces, metric: Normal, deadline: Deadline
) -> RelationSelection:
    """The relations that shorten the description, directions first."""
    first = RelationSelection(start, spread, wide, TILTED)
    directions, accepted = relate_directions(first)
    length = float(np.sqrt(1 / wide[:, :6].max()))
    numbers = onto(start, accepted, length, metric)
    choice = RelationSelection(numbers, spread, wide)
    for constraint in accepted:
        choice.accept(constraint)
    choice.greedy(proposals(Places(Pose.of(numbers), choice.covariance, shown, directions)), deadline)
    return choice


def _hold_roundly(start: Lowered, constraints: Sequence[Constraint], length: float, metric: Normal) -> Lowered:
    """The numbers moved onto the constraints; round ones that gave way to each other go to one round place."""
    held = onto(start, constraints, length, metric)
    if _count_round(held, length) >= _count_round(start, length):
        return held
    digits = [_digits_of(values, length) for values in (start.sizes, start.centers)]
    tried = [held]
    # numbers with few digits and with more meet on the grid of these
    for least in range(_most_digits(length) + 1):
        sizes, centers = (_round_to(v, np.maximum(d, least)) for v, d in zip((held.sizes, held.centers), digits, strict=True))
        tried.append(onto(replace(held, sizes=sizes, centers=centers), constraints, length, metric))
    # nothing is rounder than any size
    there = [numbers for numbers in tried if (numbers.sizes[held.sizes > 0] > 0).all()]
    return max(there, key=lambda numbers: _count_round(numbers, length))


def _count_round(numbers: Lowered, length: float) -> int:
    return sum(int((_digits_of(values, length) < NO_DIGITS).sum()) for values in (numbers.sizes, numbers.centers))


def _digits_of(values: np.ndarray, length: float) -> np.ndarray:
    """How many decimals numbers have, NO_DIGITS for those that are not round in a part of this length."""
    digits = np.full(values.shape, NO_DIGITS)
    for count in range(_most_digits(length), -1, -1):
        digits[np.abs(values - np.round(values, count)) <= SAME * length] = count
    return digits


def _most_digits(length: float) -> int:
    """The decimals of a round number in a part of this length."""
    return max(round(-math.log10(ROUND[1])) - math.floor(math.log10(length)), 0)


def _round_to(values: np.ndarray, digits: np.ndarray) -> np.ndarray:
    """Numbers rounded to so many decimals, those of NO_DIGITS as they are."""
    scale = 10.0**digits
    return np.where(digits < NO_DIGITS, np.round(values * scale) / scale, values)


def _keep_unmoved(before: Lowered, after: Lowered, length: float) -> Lowered:
    """`after`, with the numbers of `before` wherever only rounding moved them."""

    def kept(old: np.ndarray, new: np.ndarray, scale: float) -> np.ndarray:
        return np.where(np.abs(new - old) <= SAME * scale, old, new)

    sizes, centers = kept(before.sizes, after.sizes, length), kept(before.centers, after.centers, length)
    return replace(after, sizes=sizes, centers=centers, rotations=kept(before.rotations, after.rotations, 1.0))


def _find_most_strained(numbers: Lowered, taken: Sequence[Constraint], cloud: WeightedCloud, noise: float) -> int | None:
    """The number of the relation that adds most to the cost beyond what noise adds, if any does."""
    if not taken:
        return None
    rows = rows_of(taken, numbers)
    strain = strains(numbers, rows, cloud, noise, len(taken))
    counts = np.bincount(rows.owner, minlength=len(taken))
    # quantiles of chi squared; scipy.stats has them too, and takes a third of a second to import
    limits = 2 * gammaincinv(np.maximum(counts, 1) / 2, 1 - SIGNIFICANCE)
    worst = int(np.argmax(strain / limits))
    return worst if strain[worst] > limits[worst] else None


def hold_constraints(program: Program, constraints: Sequence[Constraint]) -> tuple[Program, tuple[Constraint, ...]]:
    """The program moved onto the constraints by the shortest way, and those that then hold; numbers that none of them names stay.

    Raises ConstraintError where that way leaves a part without extent, as both faces of a thin plate in one plane do.
    """
    start = lower(program)
    length = extent_of(start)
    metric = _firm_where_round(program, length)
    held = _hold_roundly(start, constraints, length, metric)
    if (gone := ((start.sizes > FLOOR * length) & (held.sizes < FLOOR * length)).any(1)).any():
        raise ConstraintError(f"the relations leave part {int(gone.argmax())} without extent")
    moved = lift_numbers(program, start, _keep_unmoved(start, held, length))
    return moved, holding(moved, constraints)


# --- what was chosen, as one would say it: nothing twice, and pairs that say one thing of several features as one constraint ---------


def prune_implied(constraints: Sequence[Constraint], numbers: Lowered) -> list[Constraint]:
    """Without single equations that the others imply at `numbers`: what was said first may be said again by what came later."""
    kept = list(constraints)
    while kept:
        rows = rows_of(kept, numbers)
        scaled = rows.jacobian / np.maximum(np.linalg.norm(rows.jacobian, axis=1), 1e-300)[:, None]
        values, vectors = np.linalg.eigh(scaled @ scaled.T)
        weight = np.abs(vectors[:, values < SPANNED**2 * len(values)]).max(1, initial=0.0)
        single = np.bincount(rows.owner, minlength=len(kept))[rows.owner] == 1
        spare = np.flatnonzero(single & (weight > SPANNED**0.5))
        if not len(spare):
            break
        kept.pop(int(rows.owner[spare[np.argmax(weight[spare])]]))
    return kept


def merge_transitive(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
    """The same relations, transitive ones as one per connected group of features, in the order of their first pair."""
    out: list[Constraint] = []
    for constraint in constraints:
        if constraint.kind not in TRANSITIVE:
            out.append(constraint)
            continue
        # a ball may lie on several lines, which do not become one by that
        shared = {ref for ref in constraint.of if ref.feature or constraint.kind == "concentric"}
        touching = [o for o in out if o.kind == constraint.kind and set(o.of) & shared]
        for other in touching:
            out.remove(other)
        together = {ref: None for c in [*touching, constraint] for ref in c.of}
        # by leaf, those of the frame first; the line of a coaxial group needs an axis in front
        of = sorted(together, key=lambda r: (r.leaf != WORLD, not r.feature, r.leaf, r.feature))
        out.append(replace(constraint, of=tuple(of)))
    return tuple(sorted(out, key=lambda c: ORDER.index(c.kind) if c.kind in ORDER else len(ORDER)))
