"""The numbers of a program whose structure is found: fitted to a cloud, rounded to what may have been typed, related to each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.hidden_ends import shorten_cones
from imdim.geometry.finish.pattern_outlier import regularise_outliers
from imdim.geometry.lowering import lower
from imdim.geometry.metrics import diagonal
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.geometry.surface import Patch, signed_distance
from imdim.numbers.circles import round_circles
from imdim.numbers.information import Coordinates
from imdim.numbers.measured import measure
from imdim.numbers.measured_leaves import MeasuredLeaves
from imdim.numbers.refine import RefineConfig, refine
from imdim.numbers.snap import SnapConfig, accept_changes, snap
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.outline import are_near
from imdim.program.tree import Op, Primitive, Program, fold, leaves, longest, map_leaves
from imdim.reconstruction.observation import Observation
from imdim.reconstruction.preserve import is_same, preserve
from imdim.relations.discover import exact_relations, hold_constraints
from imdim.relations.residuals import rows_of
from imdim.target.target import Frame, Target

POOR = 0.05  # of the volume; a search that leaves more is compared with the decision tree
SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may move
SAME_CONES = 2e-5  # of the volume, that cones may change that begin where they are seen
SAME_SIZE = 1e-6  # of a length, within which leaves are copies of one: what a mesh's single precision leaves of equal ones
LIKE = 2e-4  # of the diagonal, within which primitives are equal
SHOWN = 8192  # points of a target that numbers and relations are judged by
ROUNDED = 1e-2  # of the part, by which a number is rounded at most, if its interval is that wide
SNAP_DEG = 3.0  # by which a rotation is rounded at most
SNAP_LOSS = 1e-4  # of the volume IoU with a mesh, that rounder numbers may cost: typed ones cost none,
FACETED = 0.03  # but for facets: as this share of what is between the surfaces
MOST_RELATED = 120  # primitives; the time that relations take grows with the square
RELATE_ERROR, RELATE_MOVE = 1e-2, 1e-5  # shares of mean distance and diagonal that relations may cost
ON_SURFACE = 3e-6  # of the diagonal: what a mesh's single precision leaves between a corner and its surface
TELLING, TELLING_SHARE = 12, 0.3  # corners on a surface, and of all that its facets have, that are enough to tell its numbers by
JUDGING = 6000  # points by which what rounding changes of the solid is told
SLACK = 1.5  # times the limits: what they may be off by, since they are told by points
CAUTIONS = (1.0, 2.0, 4.0)  # by which the limits are divided until the solid is kept
SNAP_TRIES = 10  # programs that are made to find which rounder primitives can stand together
MOST_ROWS = 256  # distances of all points to one primitive, that are kept while numbers are rounded
VALUES: Mapping[Op, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {  # of a program at some points, from those of its parts
    "union": np.minimum,
    "intersection": np.maximum,
    "difference": lambda keep, cut: np.maximum(keep, -cut),
}
HOLD_TRIES = 24  # programs that are made to find which relations hold beside rounder numbers

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
    before its numbers were rounded. None once time is out, and none that would change the solid."""
    if deadline.has_passed():
        return program, ()
    if found is not None:
        return _hold(program, found, subsample(target.points, SHOWN))
    exact, constraints = relations_of(program, deadline)
    return (exact, constraints) if is_same(program, exact) else (program, ())


def _hold(program: Program, found: Sequence[Constraint], points: np.ndarray) -> Related:
    """As many of the relations that a cloud supported as can hold with the program as near to its points."""
    limit = (1 + RELATE_ERROR) * _mean_distance(program, points) + RELATE_MOVE * diagonal(points)

    def near(constraints: tuple[Constraint, ...]) -> bool:
        return _mean_distance(hold_constraints(program, constraints)[0], points) <= limit

    return hold_constraints(program, accept_changes(tuple[Constraint, ...](), found, lambda taken, more: (*taken, more), near, HOLD_TRIES))


def relations_of(program: Program, deadline: Deadline = NEVER) -> Related:
    """A finished program with the relations that its own numbers support; none for a very long one, and no more once time is out."""
    if count(program).primitives > MOST_RELATED:
        return program, ()
    found = exact_relations(program, deadline=deadline)
    return found.program, found.constraints


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def snap_numbers(program: Program, seen: Observation, frame: Frame, deadline: Deadline = NEVER) -> Program:
    """A program in the body's units with the numbers that its designer may have typed there, as far as time allows.

    Snapping is judged by the distance of surface points, which is fast, and so is the volume it changed; exact booleans judge the outcome.
    What even the greatest caution does not keep is not rounded.
    """
    exact, points, to_unit = seen.target.mesh is not None, _surface_points(seen), frame.apply
    limit = 2e-3 if exact else 1e-2
    # most leaves of a trial are those of the trials before it
    values_of = lru_cache(MOST_ROWS)(lambda leaf: kernels.program_sdf(leaf, points))

    def distance(trial: Program) -> float:
        values = fold(to_unit(trial), lambda _, leaf: values_of(leaf), VALUES)
        return float(np.minimum(np.abs(values), limit).mean())

    if deadline.has_passed():
        return map_leaves(program, lambda _, leaf: canonical(leaf))
    program = preserve(program, shorten_cones(program), SAME_CONES, deadline=deadline)
    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if deadline.has_passed():
        return plain

    def rounded(bears: Callable[[Program], bool]) -> Program:
        out, move, loss = plain, *((1e-3, 2e-6) if exact else (2e-3, 2e-5))
        for boldness in (1.0, 0.1, 0.01) if exact else (1.0, 0.3):
            if deadline.has_passed():
                break
            # corners of a drawn wall lie on the ends of what cuts it: they do not tell that it turns
            config = SnapConfig(max_move=move * boldness, abs_tolerance=loss * boldness, max_deg=SNAP_DEG * boldness)
            old, new = list(leaves(out)), list(leaves(snap(out, distance, config=config, deadline=deadline)))
            changes = [(i, leaf) for i, leaf in enumerate(new) if leaf != old[i]]
            alike = _group_copies(old, changes)
            out = accept_changes(out, alike, _with_leaves, lambda trial: not deadline.has_passed() and bears(trial), SNAP_TRIES)
            if list(leaves(out)) == new:
                break
        if deadline.has_passed():
            return out
        most = (1 + SnapConfig().rel_tolerance) * min(distance(plain), distance(out)) + loss
        return round_circles(plain, out, lambda trial: not deadline.has_passed() and distance(trial) <= most and bears(trial))

    judge = _SolidJudge(to_unit(plain), seen)
    for caution in CAUTIONS:
        out = rounded(lambda trial, caution=caution: judge.seems_kept(to_unit(trial), caution))
        if out == plain or judge.keeps(to_unit(out)):
            return out
    return plain


class _SolidJudge:
    """Tells whether programs with rounder numbers have the solid of `plain`, and miss that of a mesh by hardly more than it does."""

    def __init__(self, plain: Program, seen: Observation) -> None:
        self.solid, self.target = to_manifold(plain), seen.solid
        self.most = SNAP_CHANGE if seen.target.mesh is not None else 10 * SNAP_CHANGE
        self.iou = 0.0 if self.target is None else volume_iou(self.solid, self.target)
        points = subsample(seen.target.points, JUDGING)
        # a row of the distances of all points to a leaf serves all programs that have it
        self.values_of = lru_cache(MOST_ROWS)(lambda leaf: kernels.program_sdf(leaf, points))
        self.values = self._values(plain)
        self.thickness = self.solid.volume() / max(self.solid.surface_area(), 1e-300)
        self.missed = float(np.abs(self.values).mean()) / self.thickness
        # drawn numbers have come nearer to the facets than typed ones are
        self.most_lost = min(SNAP_LOSS + FACETED * self.missed, SNAP_CHANGE)

    def _values(self, program: Program) -> np.ndarray:
        return fold(program, lambda _, leaf: self.values_of(leaf), VALUES)

    def seems_kept(self, trial: Program, caution: float) -> bool:
        """Whether the distances of the target's points say so, by limits divided by `caution`: what lies between two surfaces is their mean
        distance times their area, up to a tenth where they are as near as here."""
        values = self._values(trial)
        changed = float(np.abs(values - self.values).mean()) / self.thickness
        lost = float(np.abs(values).mean()) / self.thickness - self.missed
        return changed * caution < self.most and (self.target is None or lost * caution < self.most_lost)

    def keeps(self, trial: Program) -> bool:
        """Whether exact booleans say so."""
        solid = to_manifold(trial)
        if self.target is not None and self.iou - volume_iou(solid, self.target) >= SLACK * self.most_lost:
            return False
        return 1 - volume_iou(self.solid, solid) < SLACK * self.most


def snap_measured(program: Program, found: Sequence[Constraint], seen: Observation, frame: Frame, deadline: Deadline = NEVER) -> Program:
    """A program of a noisy cloud in the body's units, its numbers as the points measure them under the relations `found`, and rounded where
    their intervals allow; as far as time allows."""
    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if deadline.has_passed():
        return plain
    rows = rows_of(found, lower(plain)).jacobian
    start = Coordinates.of(plain)
    known = measure(
        plain, frame.to_world(subsample(seen.target.points, SHOWN)), np.pad(rows, ((0, 0), (0, start.count - rows.shape[1]))), deadline
    )
    if 1 - volume_iou(to_manifold(plain), to_manifold(known.program)) >= 10 * SNAP_CHANGE:
        return plain
    bounds = MeasuredLeaves.of(known)
    config = SnapConfig(max_move=ROUNDED, equalise=False)
    return bounds.round_sizes(snap(known.program, lambda trial: 0.0 if bounds.allow(trial) else np.inf, config=config, deadline=deadline))


def _group_copies(old: Sequence[Primitive], changes: Sequence[tuple[int, Primitive]]) -> list[dict[int, Primitive]]:
    """Changes of leaves by number, those of leaves that were of one kind and size together: copies are rounded as one, or not at all."""
    groups: list[dict[int, Primitive]] = []
    for i, leaf in changes:
        known = next((group for group in groups if _are_copies(old[i], old[next(iter(group))])), None)
        if known is None:
            groups.append({i: leaf})
        else:
            known[i] = leaf
    return groups


def _are_copies(a: Primitive, b: Primitive) -> bool:
    return a.kind == b.kind and are_near(a.outline, b.outline, SAME_SIZE * longest([a])) and np.allclose(a.size, b.size, SAME_SIZE, 0)


def _with_leaves(program: Program, changes: Mapping[int, Primitive]) -> Program:
    return map_leaves(program, lambda i, leaf: changes.get(i, leaf))


def _surface_points(seen: Observation) -> np.ndarray:
    """Points of the true surface: corners of a mesh's patches, or the cloud; some thousands, evenly picked."""
    points = seen.target.points if seen.target.mesh is None else np.concatenate([subsample(_true_corners(p), 60) for p in seen.patches])
    return subsample(points, 6000)


def _true_corners(patch: Patch) -> np.ndarray:
    """The corners [n, 3] of a mesh's patch in the unit frame, for a round one those that lie on its surface, if these are many: where
    another surface cuts the facets, corners lie on chords, which would draw its numbers inwards."""
    if patch.surface.kind == "plane":
        return patch.points
    on = np.abs(signed_distance(patch.surface, patch.points)) <= ON_SURFACE
    return patch.points[on] if on.sum() >= max(TELLING, TELLING_SHARE * len(on)) else patch.points
