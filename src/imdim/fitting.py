"""The numbers of a program whose structure is found: fitted to a cloud, related to each other, rounded to what may have been typed."""

from __future__ import annotations

import numpy as np

from imdim.body import Seen
from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.cloud import Frame, Target
from imdim.geometry.likening import likened
from imdim.geometry.metrics import diagonal
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.tree import Program, map_leaves
from imdim.solve.canonical import canonical
from imdim.solve.discover import discover, exact_relations
from imdim.solve.refine import RefineConfig, refine
from imdim.solve.snap import SnapConfig, snap

POOR = 0.05  # of the volume; a search that leaves more is compared with the decision tree
SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may move
LIKE = 2e-4  # of the diagonal, within which primitives are equal
SHOWN = 8192  # points of a target that numbers and relations are judged by
SNAP_LOSS = 1e-4  # of the volume IoU with a mesh, that rounder numbers may cost: typed ones cost none
MOST_RELATED = 120  # primitives; the time that relations take grows with the square
RELATE_ERROR, RELATE_MOVE, RELATE_VOLUME = 1e-2, 1e-5, 2.5e-3  # shares of mean distance, diagonal, volume that relations may cost


def solved(program: Program, seen: Seen, deadline: Deadline = NEVER) -> Program:
    """The numbers fitted to a cloud, as far as time allows; of a mesh, odd ones are made like their fellows.

    A mesh's carriers are exact already, and its facets would pull them inwards.
    """
    if seen.target.mesh is not None:
        return program if deadline.passed() else likened(program, LIKE, lambda trial: seen.iou(trial) or 0.0, deadline)
    chosen = subsample(seen.target.points, SHOWN)
    fit = refine(program, chosen, config=RefineConfig(start_scale=0.01), deadline=deadline)
    fitted = fit.program if deadline.passed() else _constrained(fit.program, chosen, seen, deadline)
    nearer = _mean_distance(fitted, chosen) < _mean_distance(program, chosen)
    return fitted if nearer and seen.error(fitted) < seen.error(program) + POOR else program


def _constrained(program: Program, points: np.ndarray, seen: Seen, deadline: Deadline) -> Program:
    """The relations that a cloud bears out made exact, unless that explains its points or its volume worse."""
    found = discover(program, points, deadline).program
    nearer = _mean_distance(found, points) <= (1 + RELATE_ERROR) * _mean_distance(program, points)
    return found if nearer and seen.error(found) <= seen.error(program) + RELATE_VOLUME else program


def related(program: Program, target: Target, deadline: Deadline = NEVER) -> tuple[Program, tuple[Constraint, ...]]:
    """The relations that hold for a finished program; its numbers move by rounding alone, or not at all if the target is then missed.

    None once time is out.
    """
    if deadline.passed():
        return program, ()
    found, constraints = relations_of(program, deadline)
    shown = subsample(target.points, SHOWN)
    limit = (1 + RELATE_ERROR) * _mean_distance(program, shown) + RELATE_MOVE * diagonal(shown)
    return (found, constraints) if _mean_distance(found, shown) <= limit else (program, ())


def relations_of(program: Program, deadline: Deadline = NEVER) -> tuple[Program, tuple[Constraint, ...]]:
    """A finished program with the relations that its own numbers bear out; none for a very long one, and no more once time is out."""
    if count(program).primitives > MOST_RELATED:
        return program, ()
    found = exact_relations(program, deadline=deadline)
    return found.program, found.constraints


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def snapped(program: Program, seen: Seen, frame: Frame, deadline: Deadline = NEVER) -> Program:
    """A program in the body's units with the numbers that its designer may have typed there, as far as time allows.

    Snapping is judged by the distance of surface points, which is fast; the volume it changed decides whether it was too bold.
    """
    exact, points, to_unit = seen.target.mesh is not None, _surface_points(seen), frame.apply
    limit = 2e-3 if exact else 1e-2

    def distance(trial: Program) -> float:
        return float(np.minimum(np.abs(kernels.program_sdf(to_unit(trial), points)), limit).mean())

    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if deadline.passed():
        return plain
    before = seen.iou(to_unit(plain))
    for boldness in (1.0, 0.1, 0.01) if exact else (1.0, 0.3):
        if deadline.passed():
            break
        config = SnapConfig(max_move=(1e-3 if exact else 2e-3) * boldness, abs_tolerance=(2e-6 if exact else 2e-5) * boldness)
        rounder = snap(program, distance, config=config, deadline=deadline)
        if _changed_volume(plain, rounder) < (SNAP_CHANGE if exact else 10 * SNAP_CHANGE) and (
            before is None or before - (seen.iou(to_unit(rounder)) or 0.0) < SNAP_LOSS
        ):
            return rounder
    return plain


def _changed_volume(before: Program, after: Program) -> float:
    """Volume in which two programs differ, relative to the first; by exact booleans."""
    return 1 - volume_iou(to_manifold(before), to_manifold(after))


def _surface_points(seen: Seen) -> np.ndarray:
    """Points of the true surface: corners of a mesh's patches, or the cloud; some thousands, evenly picked."""
    points = seen.target.points if seen.target.mesh is None else np.concatenate([subsample(p.points, 60) for p in seen.patches])
    return subsample(points, 6000)
