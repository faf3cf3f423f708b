"""From a target to a program: the only place that wires detection, search and solver together.

Per body: carriers (`seeding`), sample cells labelled inside or outside and the structure search over them (`search`), then the numbers
(`solve`). A generator of snapshots, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock
only cuts a search that outruns its budget, and the last snapshot then says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.config import ConfigError, Settings
from imdim.evolution import Ground, choices, evolved, few, logged, seeds_of, united
from imdim.geometry import kernels
from imdim.geometry.cloud import Frame, InputError, Target, split_bodies, target_from
from imdim.geometry.metrics import diagonal
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.geometry.surface import Patch, Surface
from imdim.geometry.winding import inside_mesh
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program, combine_all, map_leaves
from imdim.proposals import load, load_if_any, misfit, proposals
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.cells import Cells, Samples, compressed, label_samples
from imdim.search.evolve.population import EvolutionConfig, Generation
from imdim.search.families import Families
from imdim.search.sequence import to_program
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure
from imdim.search.tidy import tidy
from imdim.seeding.closing import closing_planes
from imdim.seeding.cloud_normals import measure_scale
from imdim.seeding.cloud_surfaces import detect_cloud
from imdim.seeding.mesh_surfaces import detect_patches
from imdim.solve.canonical import canonical
from imdim.solve.discover import DiscoverConfig, discover, exact_relations
from imdim.solve.pool import Cloud
from imdim.solve.refine import RefineConfig, refine
from imdim.solve.snap import SnapConfig, snap

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

    PolicyOf = Callable[[], Policy | None]

CLOSING_AREA = 1e-7  # of the squared diagonal; implied planes rank behind detected ones
MOST_JOINT = 8  # bodies
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost
POOR = 0.05  # of the volume; a search that leaves more is compared with the decision tree
SNAP_CHANGE = 5e-4  # of the volume, that rounder numbers may cost
SEARCH_SHARE = 0.4  # of the budget; detection, the solver and delivery need the rest
TOUCHED = 2e-3  # of the volume; a search that leaves more is followed by a short evolution
TOUCH = EvolutionConfig(generations=30, patience=12)
SEED_SHARE = 0.4  # of the search's time, that evolution gives to its seeds
MOST_RELATED = 120  # primitives; the time that relations take grows with the square
RELATE_ERROR, RELATE_MOVE, RELATE_VOLUME = 1e-2, 1e-5, 2.5e-3  # shares of mean distance, diagonal, volume that relations may cost
FAR_BETTER = 0.5  # of the misfit of the search's program
METHODS = ("auto", "evolve", "policy", "tree")


@dataclass(frozen=True)
class Snapshot:
    """The state of a run: `program` in the target's units, `error` relative to the target's volume, `seconds` since the start.

    `stop` is None until the last snapshot, which says why the run ended: "finished" or "budget_spent", after an evolution also "exact" or
    "stagnation". That one has the `front`, programs from crude to exact, of which `program` is one, and the `constraints` that hold for it.
    """

    stage: str
    program: Program
    error: float
    seconds: float
    stop: str | None = None
    front: tuple[Choice, ...] = ()
    constraints: tuple[Constraint, ...] = ()


@dataclass
class _Clock:
    """Seconds since the start, and whether the search's share of the budget is spent; `ending` is how an evolution ended."""

    budget_s: float
    now: Callable[[], float] = time.perf_counter
    start: float = field(init=False)
    cut: bool = False
    ending: str = "finished"

    def __post_init__(self) -> None:
        self.start = self.now()

    def seconds(self) -> float:
        return self.now() - self.start

    def out_of_time(self) -> bool:
        self.cut = self.cut or self.seconds() > SEARCH_SHARE * self.budget_s
        return self.cut

    def part(self, share: float) -> Callable[[], bool]:
        """Whether a share of the time that the search has left is spent."""
        end = self.seconds() + share * max(SEARCH_SHARE * self.budget_s - self.seconds(), 0.0)
        return lambda: self.seconds() > end


@dataclass(frozen=True)
class _Seen:
    """What detection and labelling know of one body: the body in its unit frame, and that frame."""

    target: Target
    frame: Frame
    patches: list[Patch]
    samples: Samples
    families: Families
    size_weight: float

    @cached_property
    def ground(self) -> Ground:
        """What evolution and the front need to know."""
        mesh = self.target.mesh
        area = sum(p.area for p in self.patches) if mesh is None else float(mesh.area)
        surfaces = [p.surface for p in self.patches]
        return Ground(surfaces, self.families, self.samples, self.target.points, area, self.size_weight, mesh is not None)

    @property
    def cells(self) -> Cells:
        return self.families.cells

    @property
    def volume(self) -> float:
        """Of the body, as sampled, in its own units."""
        return self.cells.volume / self.frame.scale**3

    def error(self, program: Program) -> float:
        """Volume in which the body and a program in its units differ over the samples, relative to the body's."""
        samples = self.samples
        inside = kernels.inside(program, samples.points / self.frame.scale + np.asarray(self.frame.center))
        return float(np.where(inside, samples.w_out, samples.w_in).sum()) / self.cells.volume

    def price(self, program: Program) -> float:
        """The search's objective, relative to the body's volume."""
        return self.error(program) + self.size_weight * count(program).primitives


@dataclass(frozen=True)
class _State:
    """A program of one body in its own units, `error` relative to its `volume`."""

    stage: str
    program: Program
    error: float
    volume: float
    front: tuple[Choice, ...] = ()


def reconstruct(target: Target, settings: Settings, rng: np.random.Generator) -> Iterator[Snapshot]:
    """Yield better and better programs for `target`; the last one is the result.

    Raises InputError where the target shows no surface or has no volume, ConfigError for an unknown method or an unusable checkpoint.
    """
    if settings.method not in METHODS:
        raise ConfigError(f"unknown method {settings.method!r}; known are {', '.join(METHODS)}")
    policy = _policy_of(settings)
    clock = _Clock(settings.budget_s)
    last: Snapshot | None = None
    for last in _by_body(target, settings, policy, clock, rng):
        yield last
    if last is None:
        raise InputError(f"{target.name}: no program found")
    program, constraints = _related(last.program, target)
    front = tuple(replace(c, program=program) if c.program == last.program else c for c in few(last.front, last.program))
    yield Snapshot("finished", program, last.error, clock.seconds(), "budget_spent" if clock.cut else clock.ending, front, constraints)


def _policy_of(settings: Settings) -> PolicyOf:
    """Loads the policy when it is asked for. One that must be there, and is not, is told at once."""
    policy = cache(lambda: (load if settings.method == "policy" else load_if_any)(settings.checkpoint))
    if settings.method == "policy" or settings.checkpoint:
        policy()
    return policy


def _by_body(target: Target, settings: Settings, policy: PolicyOf, clock: _Clock, rng: np.random.Generator) -> Iterator[Snapshot]:
    """Snapshots of the union of the bodies done so far; a few bodies are then tried as one, since one cut may have parted them."""
    bodies = split_bodies(target)
    done: list[_State] = []
    for i, body in enumerate(bodies):
        state = None
        for state in _body(body, settings, policy, clock, rng, 1 / (len(bodies) - i)):
            yield _together(state.stage, [*done, state], clock)
        done += [state] if state else []
    if not 1 < len(done) <= MOST_JOINT or clock.out_of_time():
        return
    apart = _together("joint", done, clock)
    *_, joint = _body(target, settings, policy, clock, rng)
    if count(joint.program).primitives < count(apart.program).primitives and joint.error < apart.error + JOINT_ERROR:
        yield _together("joint", [joint], clock)


def _together(stage: str, states: list[_State], clock: _Clock) -> Snapshot:
    """The union of several bodies' programs, with the error of all of them relative to their volume."""
    volume = sum(s.volume for s in states)
    error = sum(s.error * s.volume for s in states) / volume
    fronts = [s.front for s in states]
    front = united(fronts, [s.program for s in states], [s.volume for s in states]) if all(fronts) else []
    return Snapshot(stage, combine_all("union", [s.program for s in states]), error, clock.seconds(), front=tuple(front))


def _body(
    body: Target, settings: Settings, policy: PolicyOf, clock: _Clock, rng: np.random.Generator, share: float = 1.0
) -> Iterator[_State]:
    """Better and better programs of one body, which may take a share of the time left."""
    seen = _look(body, settings.size_weight, rng)

    def state(stage: str, program: Program) -> _State:
        return _State(stage, program, seen.error(program), seen.volume)

    program = None
    passed: list[Program] = []
    if settings.method == "evolve":
        for generation in _evolved(seen, _seeds(seen, policy(), clock.part(SEED_SHARE * share), rng), settings, clock.part(share), rng):
            clock.ending = generation.stop or clock.ending
            passed = [seen.frame.undo(i.program) for i in (*generation.front, generation.best)]
            program = passed[-1]
            yield _State("evolve", program, generation.best.score.volume, seen.volume)
    elif settings.method == "policy":
        program = _proposed(policy(), seen, [])
        yield state("policy", program)
    elif settings.method != "tree":
        for program in _searched(seen, clock, rng):
            passed.append(program)
            yield state("search", program)
        for program in _touched(seen, passed, settings, clock, rng):
            passed.append(program)
            yield state("evolve", program)
    if program is None or (settings.method in ("auto", "tree") and (clock.cut or seen.error(program) > POOR)):
        grown = _tree(seen)
        if grown is not None and (program is None or seen.price(grown) < seen.price(program)):
            program = grown
            yield state("tree", program)
    if settings.method == "auto" and body.mesh is None and (program is None or seen.error(program) > POOR):
        proposed = _proposed(policy(), seen, [] if program is None else [program])
        if program is None or _preferred(proposed, program, seen):
            program = proposed
            yield state("policy", program)
    if program is None:
        raise InputError(f"{body.name}: no solid explains its {len(seen.patches)} surfaces")
    program = reduce_program(program)
    yield state("simplify", program)
    solved = state("solve", _snapped(_solved(program, seen, body), seen, body))
    yield replace(solved, front=_front([*passed, solved.program], seen))


def ground_of(body: Target, settings: Settings, rng: np.random.Generator) -> tuple[Ground, Frame]:
    """What evolution needs to know of a body, and the frame in which it knows it; raises InputError as `reconstruct` does."""
    seen = _look(body, settings.size_weight, rng)
    return seen.ground, seen.frame


def _look(body: Target, size_weight: float, rng: np.random.Generator) -> _Seen:
    """Surfaces, cells and candidate families of a body, in its unit frame."""
    frame = Frame.of(body)
    unit = frame.normalise(body)
    patches, closing = _surfaces(unit, rng)
    if not patches:
        raise InputError(f"{unit.name}: no plane, sphere, cylinder, cone or torus found in {len(unit.points)} points")
    corners = unit.points if unit.mesh is None else unit.mesh.vertices
    bounds = np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])
    surfaces = [p.surface for p in patches] + closing
    areas = [p.area for p in patches] + [CLOSING_AREA] * len(closing)
    arrangement = arrange(surfaces, areas, bounds, ArrangementConfig())
    samples = label_samples(arrangement, _labeller(unit, patches), 150_000, rng)
    cells = compressed(arrangement, samples)
    if cells.volume <= 0:
        raise InputError(f"{unit.name}: no inside found, 0 of {len(cells.points)} sampled cells")
    return _Seen(unit, frame, patches, samples, Families(arrangement, cells), size_weight)


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


def _searched(seen: _Seen, clock: _Clock, rng: np.random.Generator) -> Iterator[Program]:
    """Programs of the structure search, each better than the one before."""
    found = None
    for found in search_structure(seen.families, StructureConfig(size_weight=seen.size_weight), rng, clock.out_of_time):
        yield seen.frame.undo(to_program(found.sequence, seen.families))
    if found is not None:
        yield seen.frame.undo(to_program(tidy(found.sequence, seen.families), seen.families))


def _seeds(seen: _Seen, policy: Policy | None, out_of_time: Callable[[], bool], rng: np.random.Generator) -> dict[str, list[Program]]:
    """What an evolution starts from: the policy's programs, where there is one, the tree, the surfaces and the search."""
    beam = [] if policy is None else [p.program for p in proposals(policy, seen.target.points)]
    return seeds_of(seen.ground, rng, out_of_time, beam)


def _evolved(
    seen: _Seen,
    seeds: dict[str, list[Program]],
    settings: Settings,
    out_of_time: Callable[[], bool],
    rng: np.random.Generator,
    config: EvolutionConfig | None = None,
) -> Iterator[Generation]:
    generations = evolved(seen.ground, seeds, rng, out_of_time, config)
    yield from logged(generations, settings.logdir, seen.target.name) if settings.logdir else generations


def _touched(seen: _Seen, found: list[Program], settings: Settings, clock: _Clock, rng: np.random.Generator) -> Iterator[Program]:
    """Fitter programs of a few generations that start from those the search passed through: what no signed sequence of candidates is.

    For a mesh, where the search left something; in a cloud the doubts about what is inside outweigh it.
    """
    if not found or clock.out_of_time() or not seen.ground.exact or seen.error(found[-1]) < TOUCHED:
        return
    seeds = {"search": [seen.frame.apply(p) for p in found]}
    best = seen.ground.scorer.score(seeds["search"][-1:])[0].fitness
    for generation in _evolved(seen, seeds, settings, clock.out_of_time, rng, TOUCH):
        # what is not worth half a primitive is not worth another way to draw it
        if generation.best.score.fitness < best - 0.5 * seen.size_weight:
            best = generation.best.score.fitness
            yield seen.frame.undo(generation.best.program)


def _proposed(policy: Policy | None, seen: _Seen, starts: list[Program]) -> Program:
    """The best that the solver makes of a policy's beam and of programs in the body's units."""
    best, *_ = proposals(policy, seen.target.points, [seen.frame.apply(p) for p in starts])
    return seen.frame.undo(best.program)


def _preferred(proposed: Program, program: Program, seen: _Seen) -> bool:
    """Cells of a cloud know no surface that detection missed: what fits the points far better is taken, whatever its cells say."""
    cloud = Cloud.of(seen.target.points)
    return misfit(seen.frame.apply(proposed), cloud) < FAR_BETTER * misfit(seen.frame.apply(program), cloud)


def _tree(seen: _Seen) -> Program | None:
    program = seen.ground.tree()
    return None if program is None else seen.frame.undo(program)


def _front(programs: list[Program], seen: _Seen) -> tuple[Choice, ...]:
    """The front of programs in the body's units, the last one always among them."""
    front = choices(seen.ground, [seen.frame.apply(p) for p in programs])
    size = count(programs[-1]).primitives
    # what is delivered stays as it is, to the last digit
    return tuple(Choice(programs[-1] if count(c.program).primitives == size else seen.frame.undo(c.program), c.error) for c in front)


def _solved(program: Program, seen: _Seen, body: Target) -> Program:
    """The numbers fitted to a cloud; a mesh's carriers are exact already, and its facets would pull them inwards."""
    if body.mesh is not None:
        return program
    chosen = body.points[:: max(1, len(body.points) // 8192)]
    fit = refine(program, chosen, config=RefineConfig(adam_steps=0, start_scale=0.01))
    fitted = _constrained(fit.program, chosen, seen)
    nearer = _mean_distance(fitted, chosen) < _mean_distance(program, chosen)
    return fitted if nearer and seen.error(fitted) < seen.error(program) + POOR else program


def _constrained(program: Program, points: np.ndarray, seen: _Seen) -> Program:
    """The relations that a cloud bears out made exact, unless that explains its points or its volume worse."""
    found = discover(program, points, config=DiscoverConfig(fit=False)).program
    nearer = _mean_distance(found, points) <= (1 + RELATE_ERROR) * _mean_distance(program, points)
    return found if nearer and seen.error(found) <= seen.error(program) + RELATE_VOLUME else program


def _related(program: Program, target: Target) -> tuple[Program, tuple[Constraint, ...]]:
    """The relations that hold for a finished program; its numbers move by rounding alone, or not at all if the target is then missed."""
    if count(program).primitives > MOST_RELATED:
        return program, ()
    found = exact_relations(program)
    shown = target.points[:: max(1, len(target.points) // 8192)]
    limit = (1 + RELATE_ERROR) * _mean_distance(program, shown) + RELATE_MOVE * diagonal(shown)
    return (found.program, found.constraints) if _mean_distance(found.program, shown) <= limit else (program, ())


def _mean_distance(program: Program, points: np.ndarray) -> float:
    return float(np.abs(kernels.program_sdf(program, points)).mean())


def _snapped(program: Program, seen: _Seen, body: Target) -> Program:
    """The program with the numbers that its designer may have typed.

    Snapping is judged by the distance of surface points, which is fast; the volume it changed decides whether it was too bold.
    """
    exact, diagonal = body.mesh is not None, 1 / seen.frame.scale
    points = _surface_points(seen)
    limit = (2e-3 if exact else 1e-2) * diagonal

    def distance(trial: Program) -> float:
        return float(np.minimum(np.abs(kernels.program_sdf(trial, points)), limit).mean())

    plain = map_leaves(program, lambda _, leaf: canonical(leaf))
    for boldness in (1.0, 0.1, 0.01) if exact else (1.0, 0.3):
        config = SnapConfig(max_move=(1e-3 if exact else 2e-3) * boldness, abs_tolerance=(2e-6 if exact else 2e-5) * boldness * diagonal)
        snapped = snap(program, distance, config=config)
        if _changed_volume(plain, snapped) < (SNAP_CHANGE if exact else 10 * SNAP_CHANGE):
            return snapped
    return plain


def _changed_volume(before: Program, after: Program) -> float:
    """Volume in which two programs differ, relative to the first; by exact booleans."""
    return 1 - volume_iou(to_manifold(before), to_manifold(after))


def _surface_points(seen: _Seen) -> np.ndarray:
    """Points of the true surface in the body's units: corners of a mesh's patches, or the cloud; some thousands, evenly picked."""
    if seen.target.mesh is None:
        points = seen.target.points
    else:
        points = np.concatenate([p.points[:: max(1, len(p.points) // 60)] for p in seen.patches])
    return points[:: max(1, len(points) // 6000)] / seen.frame.scale + np.asarray(seen.frame.center)


def reconstruct_best(points_or_mesh: np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int = 0) -> Snapshot:
    """The last snapshot for points [n, 3], points with normals [n, 6], a trimesh or a `Target`; the Python way in."""
    target = points_or_mesh if isinstance(points_or_mesh, Target) else target_from(points_or_mesh)
    *_, last = reconstruct(target, settings or Settings(), np.random.default_rng(seed))
    return last
