"""A program's numbers rounded to those that its designer may have typed, as far as a mesh or a calm cloud bears that out.

Rounding is judged by the distance of surface points, which is fast, and so is the volume it changed; exact booleans judge the outcome.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.hidden_ends import shorten_cones
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.geometry.surface import Patch, signed_distance
from imdim.numbers.circles import round_circles
from imdim.numbers.design_values import Values, decimal, find_parted_groups, plainest_first, round_to_grid
from imdim.numbers.inches import are_inches
from imdim.numbers.origin import find_offset
from imdim.numbers.precision import precision_of
from imdim.numbers.shared_numbers import find_parted_lengths, find_split_numbers, share_number
from imdim.numbers.slanting_axes import find_parted_axes
from imdim.numbers.snap import SnapConfig, accept_changes, snap
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.outline import are_near
from imdim.program.tree import Op, Primitive, Program, Vec3, fold, leaves, longest, map_leaves, replace_leaves
from imdim.program.vectors import minus
from imdim.reconstruction.observation import Observation
from imdim.reconstruction.preserve import preserve, volume_difference
from imdim.target.target import Frame

SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may move
SAME_CONES = 2e-5  # of the volume, that cones may change that begin where they are seen
SAME_SIZE = 1e-6  # of a length, within which leaves are copies of one: what a mesh's single precision leaves of equal ones
HAIR = 5e-5  # of the largest size, by which places and radii differ that nobody drew as two
SNAP_DEG = 3.0  # by which a rotation is rounded at most
SNAP_LOSS = 1e-4  # of the volume IoU with a mesh, that rounder numbers may cost: typed ones cost none,
HARDLY = 5e-6  # of the volume: what each round of rounding may cost all the same where those before have taken all,
SHARED = 5e-5  # and what it may cost that all places are one which are a hair apart,
FACETED = 0.03  # but for facets: as this share of what is between the surfaces
ROUGH = SnapConfig(max_move=2e-5, abs_tolerance=2e-5, finest=4e-4, max_deg=0.0)  # numbers as near to a grid twenty times as wide
MOVED, MOVED_LOSS = 1e-4, 5e-4  # of the diagonal and of the volume IoU, that a part is moved by at most to have its places on the grid
ON_SURFACE = 3e-6  # of the diagonal: what a mesh's single precision leaves between a corner and its surface
TELLING, TELLING_SHARE = 12, 0.3  # corners on a surface, and of all that its facets have, that are enough to tell its numbers by
JUDGING = 6000  # points by which what rounding changes of the solid is told
SLACK = 1.5  # times the limits: what they may be off by, since they are told by points
SURELY = 0.9 * SLACK  # times what an IoU may fall by: where the solid changes by less, it has not, even as booleans round
CAUTIONS = (1.0, 2.0, 4.0)  # by which the limits are divided until the solid is kept
CHOICES = 3  # numbers of those that were equal, that are tried for all
SNAP_TRIES = 10  # programs that are made to find which rounder primitives can stand together
ORIGIN = (0.0, 0.0, 0.0)
MOST_ROWS = 256  # distances of all points to one primitive, that are kept while numbers are rounded
VALUES: Mapping[Op, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {  # of a program at some points, from those of its parts
    "union": np.minimum,
    "intersection": np.maximum,
    "difference": lambda keep, cut: np.maximum(keep, -cut),
}


def settle_origin(program: Program, seen: Observation, frame: Frame) -> Frame:
    """The frame of a body whose places, in its units, would all be round but for a hair by which it was moved: it leads to the round ones.

    The hair is no longer than the surface bears out, as volume IoU with the mesh; without a mesh the frame stays.
    """
    mesh = seen.target.mesh
    if mesh is None or seen.solid is None:
        return frame
    offset = np.abs(wanted := np.array(find_offset([canonical(leaf) for leaf in leaves(program)], MOVED / frame.scale)))
    # what a short move uncovers is the area that looks its way
    lost = offset * frame.scale * (np.abs(mesh.face_normals).T @ mesh.area_faces) / seen.solid.volume()
    cheapest = np.argsort(lost)
    kept = cheapest[np.cumsum(lost[cheapest]) <= MOVED_LOSS]
    x, y, z = (center - wanted[axis] * (axis in kept) for axis, center in enumerate(frame.center))
    return replace(frame, center=(float(x), float(y), float(z)))


def snap_numbers(program: Program, seen: Observation, frame: Frame, deadline: Deadline = NEVER) -> Program:
    """A program in the body's units with the numbers that its designer may have typed there, as far as time allows.

    What even the greatest caution does not keep is not rounded.
    """
    if deadline.has_passed():
        return map_leaves(program, lambda _, leaf: canonical(leaf))
    program = preserve(program, shorten_cones(program), SAME_CONES, deadline=deadline)
    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if deadline.has_passed():
        return plain
    mesh = seen.target.mesh
    precision = 0.0 if mesh is None else precision_of(frame.to_world(mesh.vertices))
    # a part that lies anywhere has round sizes all the same, and its places are rounded from where most of them are round
    offset = _offset_of(plain, precision) if precision else ORIGIN
    near = replace(frame, center=minus(frame.center, offset))
    start = _move(plain, minus(ORIGIN, offset))
    judge = _SolidJudge(start, seen, near)
    rounding = _Rounding(start, _distance_from(seen, near), judge, precision, deadline)
    for caution in CAUTIONS:
        out = rounding.run(caution)
        if out == start or judge.keeps(out):
            return plain if out == start else _move(out, offset)
    return plain


def _offset_of(program: Program, precision: float) -> Vec3:
    """By how much the places of a part are off the grid, to the precision of its mesh; parts in inches stay where they are."""
    parts = list(leaves(program))
    if are_inches(parts):
        return ORIGIN
    digit = 10.0 ** math.floor(math.log10(precision))
    x, y, z = (round_to_grid(v, digit) for v in find_offset(parts, math.inf))
    return x, y, z


def _move(program: Program, by: Vec3) -> Program:
    """A program moved, with decimal places."""
    if by == ORIGIN:
        return program
    x, y, z = by
    return map_leaves(
        program, lambda _, p: replace(p, center=(decimal(p.center[0] + x), decimal(p.center[1] + y), decimal(p.center[2] + z)))
    )


def _distance_from(seen: Observation, frame: Frame) -> Callable[[Program], float]:
    """The mean distance of the target's surface points from a program in the body's units."""
    points, limit = _surface_points(seen), 2e-3 if seen.target.mesh is not None else 1e-2
    # most leaves of a trial are those of the trials before it
    values_of = lru_cache(MOST_ROWS)(lambda leaf: kernels.program_sdf(frame.apply(leaf), points))

    def distance(trial: Program) -> float:
        values = fold(trial, lambda _, leaf: values_of(leaf), VALUES)
        return float(np.minimum(np.abs(values), limit).mean())

    return distance


class Costs(NamedTuple):
    """What rounder numbers change of a solid, and lose of it against its target, as shares of its volume."""

    changed: float
    lost: float


NOTHING = Costs(0.0, 0.0)


@dataclass(frozen=True)
class _Rounding:
    """Rounds the numbers of `plain`, of a body of whose mesh places are off by the `precision`, as boldly as its solid bears; that of a
    cloud is 0."""

    plain: Program
    distance: Callable[[Program], float]
    judge: _SolidJudge
    precision: float
    deadline: Deadline

    def run(self, caution: float) -> Program:
        """The program with rounder numbers, the judge's limits divided by `caution`."""
        out, move, loss = self.plain, *((1e-3, 2e-6) if self.precision else (2e-3, 2e-5))
        for boldness in (1.0, 0.1, 0.01, 0.001) if self.precision else (1.0, 0.3):
            config = SnapConfig(
                max_move=move * boldness, abs_tolerance=loss * boldness, max_deg=SNAP_DEG * boldness, precision=self.precision
            )
            out, whole = self._take(out, config, caution)
            if whole:
                break
        most = (1 + SnapConfig().rel_tolerance) * min(self.distance(self.plain), self.distance(out)) + loss
        if self.precision:
            out, _ = self._take(out, ROUGH, caution)
            most = max(most, self.distance(out))
        out = self._rejoin(out, most, caution)
        most = max(most, self.distance(out) + loss)
        out = self._share_numbers(out, most, caution)
        if self.deadline.has_passed():
            return out

        def bears(trial: Program) -> bool:
            return self._bears(trial, caution) and self.distance(trial) <= most

        out = round_circles(self.plain, out, bears, self.precision)
        parted = find_parted_axes(list(leaves(self.plain)), list(leaves(out)), SAME_SIZE * longest(leaves(out)))
        return accept_changes(out, list(parted), lambda trial, change: replace_leaves(trial, dict([change])), bears, SNAP_TRIES)

    def _take(self, out: Program, config: SnapConfig, caution: float) -> tuple[Program, bool]:
        """What the solid bears of a rounding, and whether that is all of it."""
        if self.deadline.has_passed():
            return out, True
        # corners of a drawn wall lie on the ends of what cuts it: they do not tell that it turns
        old, new = list(leaves(out)), list(leaves(snap(out, self.distance, config=config, deadline=self.deadline)))
        changes = _group_copies(old, [(i, leaf) for i, leaf in enumerate(new) if leaf != old[i]])
        spent = self._costs(out)
        out = accept_changes(out, changes, replace_leaves, lambda trial: self._bears(trial, caution, spent), SNAP_TRIES)
        return out, list(leaves(out)) == new

    def _rejoin(self, out: Program, most: float, caution: float) -> Program:
        """What was equal made equal again, if the solid bears it: what is rounded in one leaf and not in another is one plane no longer."""
        before, slack = Values.of(list(leaves(self.plain))), SAME_SIZE * longest(list(leaves(self.plain)))
        spent = self._costs(out)

        def rejoined(values: Values) -> Program | None:
            parts = values.primitives_or_none()
            return None if parts is None else map_leaves(out, lambda i, _: parts[i])

        def bears(values: Values) -> bool:
            trial = rejoined(values)
            return trial is not None and self._bears(trial, caution, spent) and self.distance(trial) <= most

        values = Values.of(list(leaves(out)))
        for rank in range(CHOICES):
            groups = find_parted_groups(before, values, slack)
            offers = [(group, choices[rank]) for group in groups if rank < len(choices := plainest_first(values.numbers[group]))]
            values = accept_changes(values, offers, Values.with_numbers, bears, SNAP_TRIES)
        return rejoined(values) or out

    def _share_numbers(self, out: Program, most: float, caution: float) -> Program:
        """Lengths that were equal, of drawings too, made equal again, and places and radii that are a hair from each other made one, if the
        solid bears it."""
        spent, parts = self._costs(out), tuple(leaves(out))

        def bears(parts: tuple[Primitive, ...]) -> bool:
            trial = map_leaves(out, lambda i, _: parts[i])
            return self._bears(trial, caution, spent, SHARED) and self.distance(trial) <= most

        for rank in range(CHOICES):
            parted = find_parted_lengths(list(leaves(self.plain)), parts, SAME_SIZE * longest(parts))
            parts = accept_changes(parts, [offers[rank] for offers in parted if rank < len(offers)], share_number, bears, SNAP_TRIES)
        split = find_split_numbers(parts, HAIR * longest(parts)) if self.precision else []
        parts = accept_changes(parts, split, share_number, bears, SNAP_TRIES)
        return map_leaves(out, lambda i, _: parts[i])

    def _costs(self, program: Program) -> Costs:
        return self.judge.costs(program)

    def _bears(self, trial: Program, caution: float, spent: Costs = NOTHING, more: float = HARDLY) -> bool:
        return not self.deadline.has_passed() and self.judge.seems_kept(trial, caution, spent, more)


class _SolidJudge:
    """Tells whether programs with rounder numbers have the solid of `plain`, and miss that of a mesh by hardly more than it does; all in
    the units of a body, from which the `frame` leads to what was seen of it."""

    def __init__(self, plain: Program, seen: Observation, frame: Frame) -> None:
        self.plain, self.target, self.frame = plain, seen.solid, frame
        self.most = SNAP_CHANGE if seen.target.mesh is not None else 10 * SNAP_CHANGE
        points = subsample(seen.target.points, JUDGING)
        # a row of the distances of all points to a leaf serves all programs that have it
        self.values_of = lru_cache(MOST_ROWS)(lambda leaf: kernels.program_sdf(frame.apply(leaf), points))
        self.values = self._values(plain)
        coarse = to_manifold(plain, CHECK_SEGMENTS)
        self.thickness = frame.scale * coarse.volume() / max(coarse.surface_area(), 1e-300)
        self.missed = float(np.abs(self.values).mean()) / self.thickness
        # drawn numbers have come nearer to the facets than typed ones are
        self.most_lost = min(SNAP_LOSS + FACETED * self.missed, SNAP_CHANGE)

    def _values(self, program: Program) -> np.ndarray:
        return fold(program, lambda _, leaf: self.values_of(leaf), VALUES)

    def costs(self, trial: Program) -> Costs:
        """As the distances of the target's points say: what lies between two surfaces is their mean distance times their area, up to a
        tenth where they are as near as here."""
        values = self._values(trial)
        changed = float(np.abs(values - self.values).mean()) / self.thickness
        return Costs(changed, 0.0 if self.target is None else float(np.abs(values).mean()) / self.thickness - self.missed)

    def seems_kept(self, trial: Program, caution: float, spent: Costs = NOTHING, more: float = HARDLY) -> bool:
        """Whether it costs no more than limits divided by `caution`, or hardly `more` than was `spent` before: where the first numbers took
        all, the others may still become those that are all but theirs."""
        costs, limits = self.costs(trial), (self.most, self.most_lost)
        return all(cost < max(limit / caution, before + more) for cost, limit, before in zip(costs, limits, spent, strict=True))

    def keeps(self, trial: Program) -> bool:
        """Whether exact booleans say so. One less an IoU is a distance between solids: what changes the solid by less than
        may be lost of the mesh loses no more, and the mesh, which has the most faces, is not asked; nor are many facets of a circle where
        few say so, as both solids have them."""
        if volume_difference(self.plain, trial) < SURELY * self.most_lost:
            return True
        solid = self._solid(trial)
        changed = 1 - volume_iou(self.solid, solid)
        if changed >= SLACK * self.most:
            return False
        if self.target is None or changed < SURELY * self.most_lost:
            return True
        return self.iou - volume_iou(solid, self.target) < SLACK * self.most_lost

    def _solid(self, program: Program) -> Manifold:
        return to_manifold(self.frame.apply(program))

    @cached_property
    def solid(self) -> Manifold:
        """That of `plain`, in the frame of the target's."""
        return self._solid(self.plain)

    @cached_property
    def iou(self) -> float:
        """Of the solid of `plain` with that of the mesh."""
        return 0.0 if self.target is None else volume_iou(self.solid, self.target)


def _group_copies(old: Sequence[Primitive], changes: Sequence[tuple[int, Primitive]]) -> list[dict[int, Primitive]]:
    """Changes of leaves by number, those of leaves that were of one kind and size together: copies are rounded as one, or not at all, and
    stay copies."""
    groups: list[dict[int, Primitive]] = []
    for i, leaf in changes:
        known = next((group for group in groups if _are_copies(old[i], old[next(iter(group))])), None)
        if known is None:
            groups.append({i: leaf})
        else:
            known[i] = leaf
    return [group for group in groups if all(_are_copies(leaf, next(iter(group.values()))) for leaf in group.values())]


def _are_copies(a: Primitive, b: Primitive) -> bool:
    return a.kind == b.kind and are_near(a.outline, b.outline, SAME_SIZE * longest([a])) and np.allclose(a.size, b.size, SAME_SIZE, 0)


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
