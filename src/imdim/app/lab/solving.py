"""Let the solver finish: numbers fitted to a target while constraints and locked numbers hold, and numbers that follow an edit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.detection.mesh_surfaces import detect_patches
from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import extent_of
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import Surface, signed_distance
from imdim.geometry.surface import normals as surface_normals
from imdim.numbers.face_coordinates import lift_numbers
from imdim.program.constraints import AXES, WORLD, Constraint, ConstraintError, Ref, describe
from imdim.program.tree import SIZE_NAMES, Primitive, Program, leaves, map_leaves
from imdim.relations.belief import CUT, WeightedCloud, by_faces, noise_of
from imdim.relations.hold import MET, fit_under_constraints, onto
from imdim.relations.residuals import rows_of
from imdim.target.target import Target, in_unit_frame

TURN = "turn"  # the lock of a whole orientation
SHOWN = 8192  # points that the solver sees
COARSEST, FINER, FINEST = 0.02, 0.3, 4e-6  # robust scales, of the diagonal: the first is what an edit may be off
INSET, SAME_WAY = 5e-3, 0.97  # of the diagonal, and a cosine: how far facets cut a surface short, and turn away from it
DIGITS = 10  # of the part's size, and of a degree, that a solved number keeps
CLOSER = 0.95  # of how far constraints were off before, after another round of steps towards them
STRAYS = 0.02  # of the diagonal: no point counts as farther away


@dataclass(frozen=True, order=True)
class Lock:
    """A number that is held: a size of leaf number `leaf`, "x", "y" or "z" of its centre, or "turn" for its orientation."""

    leaf: int
    name: str


def lock_constraints(program: Program, locks: Sequence[Lock]) -> list[Constraint]:
    """The rows that keep locked numbers where they are in `program`."""
    parts, out = list(leaves(program)), []
    for lock in locks:
        part = parts[lock.leaf]
        if lock.name == TURN:
            out += [Constraint("fixed", (Ref(lock.leaf, axis),)) for axis in AXES]
        elif lock.name in AXES:
            out.append(Constraint("fixed", (Ref(lock.leaf),), Ref(WORLD, lock.name), part.center[AXES.index(lock.name)]))
        else:
            value = part.size[SIZE_NAMES[part.kind].index(lock.name)]
            out.append(Constraint("fixed", (Ref(lock.leaf, lock.name),), None, value))
    return out


def finish(program: Program, constraints: Sequence[Constraint], locks: Sequence[Lock], target: Target) -> Iterator[Program]:
    """Programs whose numbers explain `target` better and better while everything holds.

    The robust scale shrinks from what an edit may be off to the noise. Raises ConstraintError where constraints and locks conflict.
    """
    cloud, start = WeightedCloud.of(*_fit_points(target)), lower(program)
    rows, numbers, scale = [*constraints, *lock_constraints(program, locks)], start, COARSEST * cloud.length
    while True:
        numbers, _ = fit_under_constraints(numbers, rows, cloud, scale)
        _check(numbers, rows, constraints, cloud.length)
        yield _plain(lift_numbers(program, start, numbers), cloud.length)
        noise = max(CUT * noise_of(numbers, cloud), FINEST * cloud.length)
        if scale <= noise:
            return
        scale = max(FINER * scale, noise)


def follow_constraints(program: Program, constraints: Sequence[Constraint], locks: Sequence[Lock]) -> Program:
    """The program with its faces moved by as little as the constraints need, locked numbers held.

    Raises ConstraintError where they conflict.
    """
    start = lower(program)
    rows, length = [*constraints, *lock_constraints(program, locks)], extent_of(start)
    numbers, off, metric = start, math.inf, by_faces(list(leaves(program)))
    while True:  # each step is as long as a primitive is large at most, and what goes farther takes several rounds
        numbers = onto(numbers, rows, length, metric)
        before, off = off, float(np.abs(rows_of(rows, numbers).residual).max(initial=0.0))
        if off <= MET * length or off > CLOSER * before:
            break
    _check(numbers, rows, constraints, length)
    return _plain(lift_numbers(program, start, numbers), length)


def violations(program: Program, constraints: Sequence[Constraint]) -> list[float]:
    """The largest residual of each constraint, a length or a sine, relative to the part."""
    numbers = lower(program)
    rows, out = rows_of(constraints, numbers), [0.0] * len(constraints)
    for owner, residual in zip(rows.owner.tolist(), np.abs(rows.residual) / extent_of(numbers), strict=True):
        out[owner] = max(out[owner], float(residual))
    return out


def misfit(program: Program, target: Target) -> float:
    """Mean distance of the target's points to the surface, by the signed distance, relative to the diagonal."""
    points = subsample(target.points, SHOWN)
    length = float(np.linalg.norm(np.ptp(points, axis=0)))
    return float(np.minimum(np.abs(kernels.program_sdf(program, points)), STRAYS * length).mean()) / length


def _plain(program: Program, length: float) -> Program:
    """The program without the last digits of its numbers, which are the solver's own noise; no negative zeros."""
    digits = DIGITS - math.floor(math.log10(length))

    def plain(values: Sequence[float], digits: int) -> tuple[float, ...]:
        return tuple(round(v, digits) + 0.0 for v in values)

    def leaf(_: int, p: Primitive) -> Primitive:
        (x, y, z), (rx, ry, rz) = plain(p.center, digits), plain(p.rotation, DIGITS)
        return replace(p, size=plain(p.size, digits), center=(x, y, z), rotation=(rx, ry, rz))

    return map_leaves(program, leaf)


def _check(numbers: Lowered, rows: Sequence[Constraint], constraints: Sequence[Constraint], length: float) -> None:
    found = rows_of(rows, numbers)
    off = np.abs(found.residual) / length
    if off.max(initial=0.0) <= MET:
        return
    worst = int(found.owner[np.argmax(off)])
    what = describe(worst, constraints[worst]) if worst < len(constraints) else "a locked number"
    raise ConstraintError(f"{what}: cannot hold together with the others, is off by {off.max() * length:.3g}")


def _fit_points(target: Target) -> tuple[np.ndarray, np.ndarray | None]:
    """Points that the numbers are fitted to; those of a mesh on the surfaces that its facets cut short."""
    points, normals = subsample(target.points, SHOWN), None if target.normals is None else subsample(target.normals, SHOWN)
    if target.mesh is None or normals is None:
        return points, normals
    whole, frame = in_unit_frame(target)
    assert whole.mesh is not None
    unit = _lift_to_surfaces(frame.to_unit(points), normals, [p.surface for p in detect_patches(whole.mesh)])
    return frame.to_world(unit), normals


def _lift_to_surfaces(points: np.ndarray, facing: np.ndarray, surfaces: Sequence[Surface]) -> np.ndarray:
    """Points [n, 3] of facets moved to the nearest of the detected surfaces that face the same way; the others stay."""
    least, out = np.full(len(points), INSET), points.copy()
    for surface in surfaces:
        distance, normal = signed_distance(surface, points), surface_normals(surface, points)
        nearer = (np.abs(distance) < least) & (np.abs((normal * facing).sum(1)) > SAME_WAY)
        least[nearer] = np.abs(distance)[nearer]
        out[nearer] = points[nearer] - distance[nearer, None] * normal[nearer]
    return out
