"""The numbers of a program whose structure is found: fitted to a cloud, related to each other, rounded to what may have been typed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from imdim.body import Seen
from imdim.geometry import kernels
from imdim.geometry.cloud import Target
from imdim.geometry.likening import likened
from imdim.geometry.metrics import diagonal
from imdim.geometry.solid import SEGMENTS
from imdim.preserve import changed_volume, is_same
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.tree import Program, map_leaves
from imdim.solve.canonical import canonical
from imdim.solve.discover import exact_relations, held
from imdim.solve.refine import RefineConfig, refine
from imdim.solve.snap import SnapConfig, accepted, snap

POOR = 0.05  # of the volume; a search that leaves more is compared with the decision tree
SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may move
LIKE = 2e-4  # of the diagonal, within which primitives are equal
SNAP_LOSS = 1e-4  # of the volume IoU with a mesh, that rounder numbers may cost: typed ones cost none
MOST_RELATED = 120  # primitives; the time that relations take grows with the square
RELATE_ERROR, RELATE_MOVE = 1e-2, 1e-5  # shares of mean distance and diagonal that relations may cost
HOLD_TRIES = 24  # programs that are made to find which relations hold beside rounder numbers

Related = tuple[Program, tuple[Constraint, ...]]  # a program and what holds for it


def solved(program: Program, seen: Seen, body: Target, out_of_time: Callable[[], bool] = bool) -> Program:
    """The numbers fitted to a cloud, as far as time allows; a mesh's carriers are exact already, and its facets would pull them inwards."""
    if body.mesh is not None:
        return program
    chosen = body.points[:: max(1, len(body.points) // 8192)]
    fitted = refine(program, chosen, config=RefineConfig(adam_steps=0, start_scale=0.01), out_of_time=out_of_time).program
    nearer = _mean_distance(fitted, chosen) < _mean_distance(program, chosen)
    return fitted if nearer and seen.error(fitted) < seen.error(program) + POOR else program


def related(program: Program, target: Target, found: Sequence[Constraint] | None = None, out_of_time: Callable[[], bool] = bool) -> Related:
    """The relations of a finished program: those that its own numbers bear out or, where noise hides them, those `found` in the points
    before its numbers were rounded. None once time is out, and none that would change the solid."""
    if out_of_time():
        return program, ()
    if found is not None:
        return _held(program, found, target.points[:: max(1, len(target.points) // 8192)])
    exact, constraints = relations_of(program, out_of_time)
    return (exact, constraints) if is_same(program, exact) else (program, ())


def _held(program: Program, found: Sequence[Constraint], points: np.ndarray) -> Related:
    """As many of the relations that a cloud bore out as can hold with the program as near to its points."""
    limit = (1 + RELATE_ERROR) * _mean_distance(program, points) + RELATE_MOVE * diagonal(points)

    def near(constraints: tuple[Constraint, ...]) -> bool:
        return _mean_distance(held(program, constraints)[0], points) <= limit

    return held(program, accepted(tuple[Constraint, ...](), found, lambda taken, more: (*taken, more), near, HOLD_TRIES))


def relations_of(program: Program, out_of_time: Callable[[], bool] = bool) -> Related:
    """A finished program with the relations that its own numbers bear out; none for a very long one, and no more once time is out."""
    if count(program).primitives > MOST_RELATED:
        return program, ()
    found = exact_relations(program, out_of_time=out_of_time)
    return found.program, found.constraints


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def snapped(program: Program, seen: Seen, body: Target, out_of_time: Callable[[], bool] = bool) -> Program:
    """The program with the numbers that its designer may have typed, as far as time allows; of a mesh, odd ones are like their fellows.

    Snapping is judged by the distance of surface points, which is fast; the volume it changed decides whether it was too bold.
    """
    exact, diagonal = body.mesh is not None, 1 / seen.frame.scale
    points = _surface_points(seen)
    limit = (2e-3 if exact else 1e-2) * diagonal

    def distance(trial: Program) -> float:
        return float(np.minimum(np.abs(kernels.program_sdf(trial, points)), limit).mean())

    if exact and not out_of_time():
        program = likened(program, LIKE * diagonal, lambda trial: seen.iou(trial) or 0.0, out_of_time)
    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    if out_of_time():
        return plain
    loss = _loss(plain, seen)
    for boldness in (1.0, 0.1, 0.01) if exact else (1.0, 0.3):
        if out_of_time():
            break
        config = SnapConfig(max_move=(1e-3 if exact else 2e-3) * boldness, abs_tolerance=(2e-6 if exact else 2e-5) * boldness * diagonal)
        rounder = snap(program, distance, config=config, out_of_time=out_of_time)
        if changed_volume(plain, rounder, SEGMENTS) < (SNAP_CHANGE if exact else 10 * SNAP_CHANGE) and loss(rounder) < SNAP_LOSS:
            return rounder
    return plain


def _loss(plain: Program, seen: Seen) -> Callable[[Program], float]:
    """How much less of a mesh a program meets than `plain`, in volume IoU; nought where there is no mesh, or one that bounds no solid."""
    before = seen.iou(plain)
    return lambda program: 0.0 if before is None else before - (seen.iou(program) or 0.0)


def _surface_points(seen: Seen) -> np.ndarray:
    """Points of the true surface in the body's units: corners of a mesh's patches, or the cloud; some thousands, evenly picked."""
    if seen.target.mesh is None:
        points = seen.target.points
    else:
        points = np.concatenate([p.points[:: max(1, len(p.points) // 60)] for p in seen.patches])
    return points[:: max(1, len(points) // 6000)] / seen.frame.scale + np.asarray(seen.frame.center)
