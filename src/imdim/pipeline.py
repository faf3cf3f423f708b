"""From a target to a program: the only place that wires detection, search and solver together.

Per body: carriers (`seeding`), sample cells labelled inside or outside and the structure search over them (`search`), then the numbers
(`solve`). A generator of snapshots, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock
only cuts a search that outruns its budget, and the last snapshot then says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import trimesh

from imdim.config import Settings
from imdim.geometry import kernels
from imdim.geometry.cloud import Frame, InputError, Target, split_bodies, target_from
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.geometry.surface import Patch, Surface
from imdim.geometry.winding import inside_mesh
from imdim.program.cost import count
from imdim.program.simplify import reduce_program
from imdim.program.tree import Combine, Program, map_leaves
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.cells import Cells, sample_cells
from imdim.search.families import Families
from imdim.search.sequence import to_program
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure
from imdim.search.tidy import tidy
from imdim.seeding.closing import closing_planes
from imdim.seeding.cloud_normals import measure_scale
from imdim.seeding.cloud_surfaces import detect_cloud
from imdim.seeding.decision_tree import grow
from imdim.seeding.mesh_surfaces import detect_patches
from imdim.seeding.tree_to_csg import to_program as tree_to_program
from imdim.solve.canonical import canonical
from imdim.solve.refine import RefineConfig, refine
from imdim.solve.snap import SnapConfig, snap

CLOSING_AREA = 1e-7  # of the squared diagonal; implied planes rank behind detected ones
MOST_JOINT = 8  # bodies
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost
SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may cost
SEARCH_SHARE = 0.5  # of the budget; detection, the solver and delivery need the rest
METHODS = ("auto", "search", "tree")


@dataclass(frozen=True)
class Snapshot:
    """The state of a run: `program` in the target's units, `error` relative to the target's volume, `seconds` since the start.

    `stop` is None until the last snapshot, which says why the run ended: "finished" or "budget_spent".
    """

    stage: str
    program: Program
    error: float
    seconds: float
    stop: str | None = None


@dataclass
class _Clock:
    """Seconds since the start, and whether the search's share of the budget is spent."""

    budget_s: float
    now: Callable[[], float] = time.perf_counter
    start: float = field(init=False)
    cut: bool = False

    def __post_init__(self) -> None:
        self.start = self.now()

    def seconds(self) -> float:
        return self.now() - self.start

    def out_of_time(self) -> bool:
        self.cut = self.cut or self.seconds() > SEARCH_SHARE * self.budget_s
        return self.cut


@dataclass(frozen=True)
class _Seen:
    """What detection and labelling know of one body in its unit frame."""

    target: Target
    patches: list[Patch]
    families: Families

    @property
    def cells(self) -> Cells:
        return self.families.cells


def reconstruct(target: Target, settings: Settings, rng: np.random.Generator) -> Iterator[Snapshot]:
    """Yield better and better programs for `target`; the last one is the result.

    Raises InputError where the target shows no surface or has no volume, ValueError for an unknown method.
    """
    if settings.method not in METHODS:
        raise ValueError(f"unknown method {settings.method!r}; known are {', '.join(METHODS)}")
    clock = _Clock(settings.budget_s)
    last: Snapshot | None = None
    for last in _by_body(target, settings, clock, rng):
        yield last
    if last is None:
        raise InputError(f"{target.name}: no program found")
    yield Snapshot("finished", last.program, last.error, clock.seconds(), "budget_spent" if clock.cut else "finished")


def _by_body(target: Target, settings: Settings, clock: _Clock, rng: np.random.Generator) -> Iterator[Snapshot]:
    """Snapshots of the union of the bodies done so far; a few bodies are then tried as one, since one cut may have parted them."""
    bodies = split_bodies(target)
    done: Program | None = None
    last: Snapshot | None = None
    for body in bodies:
        for stage, program, error in _body(body, settings, clock, rng):
            whole = program if done is None else Combine("union", done, program)
            last = Snapshot(stage, whole, error, clock.seconds())
            yield last
        done = last.program if last else None
    if last is None or not 1 < len(bodies) <= MOST_JOINT or clock.out_of_time():
        return
    *_, (_, joint, error) = _body(target, settings, clock, rng)
    if count(joint).primitives < count(last.program).primitives and error < last.error + JOINT_ERROR:
        yield Snapshot("joint", joint, error, clock.seconds())


def _body(body: Target, settings: Settings, clock: _Clock, rng: np.random.Generator) -> Iterator[tuple[str, Program, float]]:
    """(stage, program, error) of one body, in its own units."""
    frame = Frame.of(body)
    seen = _look(frame.normalise(body), rng)
    program, error = None, np.inf
    if settings.method != "tree":
        for program, error in _searched(seen, clock, rng):
            yield "search", frame.undo(program), error
    if settings.method == "tree" or program is None or error > 0.2:
        grown = _tree(seen)
        if grown is not None and (program is None or _price(grown, seen) < _price(program, seen)):
            program, error = grown, _sampled_error(grown, seen.cells)
            yield "tree", frame.undo(program), error
    if program is None:
        raise InputError(f"{body.name}: no solid explains its {len(seen.patches)} surfaces; volume {seen.cells.volume:.3g} of the box")
    program = reduce_program(program)
    yield "simplify", frame.undo(program), _sampled_error(program, seen.cells)
    program = _solved(program, seen)
    snapped = _snapped(program, seen, frame)
    yield "solve", snapped, _sampled_error(program, seen.cells)


def _look(unit: Target, rng: np.random.Generator) -> _Seen:
    """Surfaces, cells and candidate families of a body in the unit frame."""
    patches, closing = _surfaces(unit, rng)
    if not patches:
        raise InputError(f"{unit.name}: no plane, sphere, cylinder, cone or torus found in {len(unit.points)} points")
    corners = unit.points if unit.mesh is None else unit.mesh.vertices
    bounds = np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])
    surfaces = [p.surface for p in patches] + closing
    areas = [p.area for p in patches] + [CLOSING_AREA] * len(closing)
    arrangement = arrange(surfaces, areas, bounds, ArrangementConfig())
    cells = sample_cells(arrangement, _labeller(unit, patches), 150_000, rng)
    if cells.volume <= 0:
        raise InputError(f"{unit.name}: no inside found, 0 of {len(cells.points)} sampled cells")
    return _Seen(unit, patches, Families(arrangement, cells))


def _surfaces(unit: Target, rng: np.random.Generator) -> tuple[list[Patch], list[Surface]]:
    """What the target shows, and for a cloud the planes that its faces only imply."""
    if unit.mesh is not None:
        return detect_patches(unit.mesh), []
    patches = detect_cloud(unit.points, unit.normals, rng)
    return patches, closing_planes(patches, measure_scale(unit.points, rng).spacing)


def _labeller(unit: Target, patches: list[Patch]) -> Callable[[np.ndarray], np.ndarray]:
    """The function that gives the probability of being inside [n] for points [n, 3]."""
    mesh = unit.mesh
    if mesh is not None:
        return lambda points: inside_mesh(mesh, points)
    from imdim.seeding.cloud_occupancy import inside_probability

    # single queries are right far more often than their votes are unanimous: a cell averages decisions, not doubts
    return lambda points: inside_probability(patches, unit.points, points) > 0.5


def _searched(seen: _Seen, clock: _Clock, rng: np.random.Generator) -> Iterator[tuple[Program, float]]:
    """Programs of the structure search in the unit frame, each better than the one before."""
    found = None
    for found in search_structure(seen.families, StructureConfig(), rng, clock.out_of_time):
        program = to_program(found.sequence, seen.families)
        yield program, _sampled_error(program, seen.cells)
    if found is not None:
        program = to_program(tidy(found.sequence, seen.families), seen.families)
        yield program, _sampled_error(program, seen.cells)


def _tree(seen: _Seen) -> Program | None:
    cells = seen.cells
    weights = cells.w_in + cells.w_out
    tree = grow(cells.points, cells.w_in > cells.w_out, [p.surface for p in seen.patches], weights)
    low, high = seen.families.arrangement.bounds
    return tree_to_program(tree, low, high)


def _sampled_error(program: Program, cells: Cells) -> float:
    """Volume in which program and target differ over the cells, relative to the target's."""
    inside = kernels.inside(program, cells.points)
    return float(np.where(inside, cells.w_out, cells.w_in).sum()) / cells.volume


def _price(program: Program, seen: _Seen) -> float:
    return _sampled_error(program, seen.cells) + StructureConfig().size_weight * count(program).primitives


def _solved(program: Program, seen: _Seen) -> Program:
    """The numbers fitted to a cloud; a mesh's carriers are exact already, and its facets would pull them inwards."""
    if seen.target.mesh is not None:
        return program
    points = seen.target.points
    chosen = points[:: max(1, len(points) // 8192)]
    fit = refine(program, chosen, config=RefineConfig(adam_steps=0, start_scale=0.01))
    return fit.program if _mean_distance(fit.program, chosen) < _mean_distance(program, chosen) else program


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def _snapped(program: Program, seen: _Seen, frame: Frame) -> Program:
    """The program in the target's units with the numbers that its designer may have typed.

    Snapping is judged by the distance of surface points, which is fast; the volume it changed decides whether it was too bold.
    """
    world = _surface_points(seen) / frame.scale + np.asarray(frame.center)
    exact = seen.target.mesh is not None
    limit = (2e-3 if exact else 1e-2) / frame.scale

    def distance(trial: Program) -> float:
        return float(np.minimum(np.abs(kernels.program_sdf(trial, world)), limit).mean())

    plain = map_leaves(frame.undo(program), lambda _, leaf: canonical(leaf))
    for boldness in (1.0, 0.1, 0.01) if exact else (1.0, 0.3):
        config = SnapConfig(max_move=(1e-3 if exact else 2e-3) * boldness, abs_tolerance=(2e-6 if exact else 2e-5) * boldness / frame.scale)
        snapped = snap(frame.undo(program), distance, config=config)
        if _changed_volume(plain, snapped) < (SNAP_CHANGE if exact else 10 * SNAP_CHANGE):
            return snapped
    return plain


def _changed_volume(before: Program, after: Program) -> float:
    """Volume in which two programs differ, relative to the first; by exact booleans."""
    return 1 - volume_iou(to_manifold(before), to_manifold(after))


def _surface_points(seen: _Seen) -> np.ndarray:
    """Points that lie on the true surface: the corners of a mesh's patches, or the cloud; some thousands, evenly picked."""
    if seen.target.mesh is None:
        points = seen.target.points
    else:
        per_patch = [p.points[:: max(1, len(p.points) // 60)] for p in seen.patches]
        points = np.concatenate(per_patch)
    return points[:: max(1, len(points) // 6000)]


def reconstruct_best(points_or_mesh: np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int = 0) -> Snapshot:
    """The last snapshot for points [n, 3], points with normals [n, 6], a trimesh or a `Target`; the Python way in."""
    target = points_or_mesh if isinstance(points_or_mesh, Target) else target_from(points_or_mesh)
    *_, last = reconstruct(target, settings or Settings(), np.random.default_rng(seed))
    return last
