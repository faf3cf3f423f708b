"""The numbers of a program whose structure is found: fitted to a cloud, rounded to what may have been typed, related to each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.pattern_outlier import regularise_outliers
from imdim.geometry.lowering import lower
from imdim.geometry.metrics import diagonal
from imdim.geometry.sampling import subsample
from imdim.numbers.information import Coordinates
from imdim.numbers.likelihood import negative_log_density
from imdim.numbers.measured import Measured, chi_squared_95, measure, noise_beside
from imdim.numbers.measured_leaves import MeasuredLeaves
from imdim.numbers.refine import RefineConfig, refine
from imdim.numbers.snap import SnapConfig, accept_changes, snap
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.constraints import Constraint, ConstraintError
from imdim.program.cost import count
from imdim.program.tree import Program, leaves, map_leaves
from imdim.reconstruction.observation import Observation
from imdim.reconstruction.preserve import is_same
from imdim.relations.discover import exact_relations, hold_constraints
from imdim.relations.residuals import holding, rows_of
from imdim.target.target import Target

POOR = 0.05  # of the volume; a search that leaves more is compared with the decision tree
LIKE = 2e-4  # of the diagonal, within which primitives are equal
SHOWN = 8192  # points of a target that numbers and relations are judged by
ROUNDED = 1e-2  # of the part, by which a number is rounded at most, if its interval is that wide
MOST_RELATED = 120  # primitives; the time that relations take grows with the square
RELATE_ERROR, RELATE_MOVE = 1e-2, 1e-5  # shares of mean distance and diagonal that relations may cost
HOLD_TRIES = 24  # programs that are made to find which relations hold beside rounder numbers
LIKELY_TRIES = 24  # programs that are made to find which rounded leaves the points allow together
SAMPLED = 40_000  # samples of a surface, by which programs of the same points are compared
DOUBT = 2e-3  # nats per point, what these leave in doubt

Related = tuple[Program, tuple[Constraint, ...]]  # a program and what holds for it


def fit_numbers(program: Program, seen: Observation, deadline: Deadline = NEVER) -> Program:
    """The numbers fitted to a cloud, as far as time allows; of a mesh, odd ones are made like their fellows.

    A mesh's carriers are exact already, and its facets would pull them inwards.
    """
    if seen.target.mesh is not None:
        return program if deadline.has_passed() else regularise_outliers(program, LIKE, lambda trial: seen.iou(trial) or 0.0, deadline)
    chosen = subsample(seen.target.points, SHOWN)
    fitted = refine(program, chosen, config=RefineConfig(start_scale=0.01), deadline=deadline).program
    nearer = _mean_distance(fitted, chosen) < _mean_distance(program, chosen)
    return fitted if nearer and seen.error(fitted) < seen.error(program) + POOR else program


def find_relations(program: Program, target: Target, found: Sequence[Constraint] | None = None, deadline: Deadline = NEVER) -> Related:
    """The relations of a finished program: those that its own numbers support or, where noise hides them, those `found` in the points
    before its numbers were rounded. None once time is out; where they would change the solid, since they move walls that coincide by a
    hair, those that the numbers meet as they are."""
    if deadline.has_passed():
        return program, ()
    if found is not None:
        return _hold(program, found, subsample(target.points, SHOWN))
    exact, constraints = relations_of(program, deadline)
    return (exact, constraints) if is_same(program, exact) else (program, holding(program, constraints))


def _hold(program: Program, found: Sequence[Constraint], points: np.ndarray) -> Related:
    """As many of the relations that a cloud supported as can hold with the program as near to its points."""
    limit = (1 + RELATE_ERROR) * _mean_distance(program, points) + RELATE_MOVE * diagonal(points)

    def near(constraints: tuple[Constraint, ...]) -> bool:
        try:
            held = hold_constraints(program, constraints)[0]
        except ConstraintError:
            return False
        return _mean_distance(held, points) <= limit

    return hold_constraints(program, accept_changes(tuple[Constraint, ...](), found, lambda taken, more: (*taken, more), near, HOLD_TRIES))


def relations_of(program: Program, deadline: Deadline = NEVER) -> Related:
    """A finished program with the relations that its own numbers support; none for a very long one, and no more once time is out."""
    if count(program).primitives > MOST_RELATED:
        return program, ()
    found = exact_relations(program, deadline=deadline)
    return found.program, found.constraints


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def snap_measured(program: Program, found: Sequence[Constraint], points: np.ndarray, deadline: Deadline = NEVER) -> Program:
    """A program of a noisy cloud with its numbers rounded where the intervals in which the `points` [n, 3] hold them allow it, under the
    relations `found`, and the points stay as likely as rounding to the true numbers would leave them; as far as time allows.

    The numbers are those of the program, unless others nearby, as those of a fit that was cut short, are clearly likelier.
    """
    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if deadline.has_passed():
        return plain
    rows, shown = Coordinates.of(plain).spread(rows_of(found, lower(plain)).jacobian), subsample(points, SHOWN)
    known = measure(plain, shown, rows, deadline)
    # each in its own noise: walls that have grown thicker leave less of it
    own = (known.program, known.noise), (plain, noise_beside(plain, shown))
    moved, stayed = (negative_log_density(p, shown, noise, SAMPLED) for p, noise in own)
    if not moved < stayed - DOUBT:
        if deadline.has_passed():
            return plain
        known = measure(plain, shown, rows, deadline, rounds=0)
    bounds = MeasuredLeaves.of(known)
    measured = map_leaves(known.program, lambda _, leaf: canonical(leaf))
    if not bounds.allow(measured):  # written in other frames: nothing can be compared
        return measured
    config = SnapConfig(max_move=ROUNDED, equalise=False)
    snapped = bounds.round_sizes(snap(measured, lambda trial: 0.0 if bounds.allow(trial) else np.inf, config=config, deadline=deadline))
    return _keep_likely(measured, snapped, shown, known, deadline)


def _keep_likely(measured: Program, snapped: Program, points: np.ndarray, known: Measured, deadline: Deadline = NEVER) -> Program:
    """The `measured` program with as many of the `snapped` leaves as its points [n, 3] allow, all or none past the deadline.

    At the true numbers twice the logarithm of the likelihood is less than at the likeliest by a chi-squared number of as many degrees as
    there are numbers that the points tell, each relation one less (Wilks 1938). That each is within its own interval does not say that
    all are together.
    """
    old, new, noise = list(leaves(measured)), list(leaves(snapped)), known.noise
    best = negative_log_density(measured, points, noise, SAMPLED)

    def put(program: Program, index: int) -> Program:
        return map_leaves(program, lambda i, leaf: new[i] if i == index else leaf)

    def is_likely(trial: Program) -> bool:
        rounded = known.count_told([i for i, (leaf, before) in enumerate(zip(leaves(trial), old, strict=True)) if leaf != before])
        lost = negative_log_density(trial, points, noise, SAMPLED) - best
        return lost <= chi_squared_95(rounded) / (2 * len(points)) + DOUBT

    if is_likely(snapped):
        return snapped
    changed = [i for i, (one, other) in enumerate(zip(old, new, strict=True)) if one != other]
    return accept_changes(measured, changed, put, lambda trial: not deadline.has_passed() and is_likely(trial), LIKELY_TRIES)
