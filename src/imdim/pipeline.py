"""From a target to a program: the only place that wires detection, search and solver together.

Per body: carriers (`seeding`), sample cells labelled inside or outside and the structure search over them (`search`), then the numbers
(`solve`). A generator of snapshots, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock
only cuts a search that outruns its budget, and the last snapshot then says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.body import Seen, look
from imdim.config import ConfigError, Settings
from imdim.evolution import choices, evolved, few, logged, seeds_of, united
from imdim.fitting import POOR, related, snapped, solved
from imdim.geometry.cloud import InputError, Target, split_bodies, target_from
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program, combine_all
from imdim.proposals import load, load_if_any, misfit, proposals
from imdim.search.evolve.population import EvolutionConfig, Generation
from imdim.search.sequence import to_program
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure
from imdim.search.tidy import tidy
from imdim.solve.pool import Cloud

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

    PolicyOf = Callable[[], Policy | None]

MOST_JOINT = 8  # bodies
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost
SEARCH_SHARE = 0.4  # of the budget; detection, the solver and delivery need the rest
TOUCHED = 2e-3  # of the volume; a search that leaves more is followed by a short evolution
TOUCH = EvolutionConfig(generations=30, patience=12)
SEED_SHARE = 0.4  # of the search's time, that evolution gives to its seeds
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
    program, constraints = related(last.program, target)
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
    seen = look(body, settings.size_weight, rng)

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
    last = state("solve", snapped(solved(program, seen, body), seen, body))
    yield replace(last, front=_front([*passed, last.program], seen))


def _searched(seen: Seen, clock: _Clock, rng: np.random.Generator) -> Iterator[Program]:
    """Programs of the structure search, each better than the one before."""
    found = None
    for found in search_structure(seen.families, StructureConfig(size_weight=seen.size_weight), rng, clock.out_of_time):
        yield seen.frame.undo(to_program(found.sequence, seen.families))
    if found is not None:
        yield seen.frame.undo(to_program(tidy(found.sequence, seen.families), seen.families))


def _seeds(seen: Seen, policy: Policy | None, out_of_time: Callable[[], bool], rng: np.random.Generator) -> dict[str, list[Program]]:
    """What an evolution starts from: the policy's programs, where there is one, the tree, the surfaces and the search."""
    beam = [] if policy is None else [p.program for p in proposals(policy, seen.target.points)]
    return seeds_of(seen.ground, rng, out_of_time, beam)


def _evolved(
    seen: Seen,
    seeds: dict[str, list[Program]],
    settings: Settings,
    out_of_time: Callable[[], bool],
    rng: np.random.Generator,
    config: EvolutionConfig | None = None,
) -> Iterator[Generation]:
    generations = evolved(seen.ground, seeds, rng, out_of_time, config)
    yield from logged(generations, settings.logdir, seen.target.name) if settings.logdir else generations


def _touched(seen: Seen, found: list[Program], settings: Settings, clock: _Clock, rng: np.random.Generator) -> Iterator[Program]:
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


def _proposed(policy: Policy | None, seen: Seen, starts: list[Program]) -> Program:
    """The best that the solver makes of a policy's beam and of programs in the body's units."""
    best, *_ = proposals(policy, seen.target.points, [seen.frame.apply(p) for p in starts])
    return seen.frame.undo(best.program)


def _preferred(proposed: Program, program: Program, seen: Seen) -> bool:
    """Cells of a cloud know no surface that detection missed: what fits the points far better is taken, whatever its cells say."""
    cloud = Cloud.of(seen.target.points)
    return misfit(seen.frame.apply(proposed), cloud) < FAR_BETTER * misfit(seen.frame.apply(program), cloud)


def _tree(seen: Seen) -> Program | None:
    program = seen.ground.tree()
    return None if program is None else seen.frame.undo(program)


def _front(programs: list[Program], seen: Seen) -> tuple[Choice, ...]:
    """The front of programs in the body's units, the last one always among them."""
    front = choices(seen.ground, [seen.frame.apply(p) for p in programs])
    size = count(programs[-1]).primitives
    # what is delivered stays as it is, to the last digit
    return tuple(Choice(programs[-1] if count(c.program).primitives == size else seen.frame.undo(c.program), c.error) for c in front)


def reconstruct_best(points_or_mesh: np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int = 0) -> Snapshot:
    """The last snapshot for points [n, 3], points with normals [n, 6], a trimesh or a `Target`; the Python way in."""
    target = points_or_mesh if isinstance(points_or_mesh, Target) else target_from(points_or_mesh)
    *_, last = reconstruct(target, settings or Settings(), np.random.default_rng(seed))
    return last
