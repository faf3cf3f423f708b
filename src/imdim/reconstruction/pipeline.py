"""From a target to a program: the bodies of a target are fitted (`several_bodies`, `one_body`), then related, and their edges put back.

A generator of snapshots, so that progress, a time limit and tests work from outside.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from imdim.detection.noise import MeasuredNoise
from imdim.export.chance import end_together
from imdim.geometry.sampling import subsample
from imdim.install import install_command
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature
from imdim.program.front import Choice
from imdim.program.tree import Program
from imdim.reconstruction.body_state import BodyState, turn_back_states
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.choices import thin_front
from imdim.reconstruction.cloud_edges import find_cloud_edges
from imdim.reconstruction.config import LEARNING, ConfigError, Settings, check_choices, lacking, require_extra
from imdim.reconstruction.delivery_time import leave_time_for_files
from imdim.reconstruction.edge_features import EdgesFound, MeasuredSizes, describe_kept, find_edge_features
from imdim.reconstruction.fitting import find_relations
from imdim.reconstruction.methods import CUT, METHODS, evolve_from
from imdim.reconstruction.one_body import GUESSING, Work, fit_body, shows_edges
from imdim.reconstruction.own_frame import find_own_frame
from imdim.reconstruction.policy_beam import PolicyOf, load, load_if_any
from imdim.reconstruction.several_bodies import fit_bodies
from imdim.reconstruction.stand_ins import take_off_stand_ins
from imdim.search.evolve.population import EvolutionConfig
from imdim.target.target import Frame, InputError, Target, target_from

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

NO_EDGES = "fillets and chamfers are only looked for on closed meshes and on even clouds: here they are part of the shape, or left out"


MOST_POINTS = 20_000  # of a cloud, that tell of its edges


@dataclass(frozen=True)
class Snapshot:
    """The state of a run: `program` in the target's units, `error` relative to the target's volume, `seconds` since the start.

    `stop` is None until the last snapshot, which says why the run ended: "finished" or "budget_spent", after an evolution also "exact" or
    "stagnation". That one has the `front`, programs from crude to exact, of which `program` is one, and the `constraints` that hold for it;
    an evolution shows its front as it goes. `proof` says whether the program was proved minimal, and why not; it is empty where the
    method does not ask. The last one's `notes` say, a sentence each, what was left out, and its `edges` are the target's fillets and
    chamfers, which were set aside: the program is that of the sharp part, and `error` is relative to it. `noisy` is whether its numbers are
    measured off a noisy cloud or a scan, `noise` what was measured of the target, None where nobody did; `edge_sizes` are what the points
    of a cloud say of the sizes of each of the `edges`.
    """

    stage: str
    program: Program
    error: float
    seconds: float
    stop: str | None = None
    front: tuple[Choice, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    proof: str = ""
    notes: tuple[str, ...] = ()
    edges: tuple[EdgeFeature, ...] = ()
    noisy: bool = False
    noise: MeasuredNoise | None = None
    edge_sizes: tuple[MeasuredSizes, ...] = ()


def reconstruct(target: Target, settings: Settings, rng: np.random.Generator, now: Callable[[], float] | None = None) -> Iterator[Snapshot]:
    """Yield better and better programs for `target`; the last one is the result. `now` tells the time, by default the wall clock's.

    Raises InputError where the target shows no surface or has no volume, ConfigError for an unknown method, language or objective, or an
    unusable checkpoint.
    """
    check_choices(settings)
    if settings.method not in METHODS:
        raise ConfigError(f"unknown method {settings.method!r}; known are {', '.join(METHODS)}")
    if settings.method == "stump-net":
        require_extra("learn", "method=stump-net", *LEARNING)
    if settings.logdir:
        require_extra("learn", "logdir", "torch", "tensorboard")
    left_out: list[InputError] = []
    notes: list[str] = []
    budget = Budget(settings.budget_s, now or time.perf_counter)
    work = Work(settings, METHODS[settings.method], settings.method in GUESSING, _policy_of(settings, notes), budget, rng, notes)
    own = find_own_frame(target)
    if own is None:
        states = fit_bodies(target, work, left_out)
    else:
        states = turn_back_states(fit_bodies(own.normalise(target), replace(work, own=own), left_out), own)
    yield from _snapshots(states, target, work, left_out)


def resume(
    target: Target,
    program: Program,
    settings: Settings,
    config: EvolutionConfig,
    rng: np.random.Generator,
    now: Callable[[], float] | None = None,
) -> Iterator[Snapshot]:
    """Go on from `program`, in the target's units, by an evolution that starts from it alone; yields and raises as `reconstruct`."""
    frame, budget = Frame.of(target), Budget(settings.budget_s, now or time.perf_counter)
    work = Work(settings, evolve_from(frame.apply(program), config), False, lambda: None, budget, rng)
    yield from _snapshots(fit_body(target, work), target, work)


def _snapshots(states: Iterable[BodyState], target: Target, work: Work, left_out: Sequence[InputError] = ()) -> Iterator[Snapshot]:
    """The states as snapshots, and the last one again with its relations; `left_out` grows while the states pass."""
    last: BodyState | None = None
    for last in states:
        front = tuple(thin_front(last.front, last.program)) if last.front else ()
        yield Snapshot(last.stage, last.program, last.error, work.budget.seconds(), front=front, proof=last.proof)
    if last is None:
        raise next(iter(left_out), InputError(f"{target.name}: no program found"))
    last = _without_stand_ins(last, target, work)
    relate_by, solver = work.budget.end_of("relate"), work.settings.solver
    if last.found is None:  # else they are found already
        relate_by = leave_time_for_files(last.program, relate_by, work.budget.end)
    program, constraints = find_relations(last.program, target, last.found, relate_by) if solver else (last.program, ())
    constraints = end_together(program, constraints)
    error = last.error if program == last.program else last.measure(program)
    front = tuple(replace(c, program=program) if c.program == last.program else c for c in thin_front(last.front, last.program))
    edges = _find_edges(program, last, target, work)
    bulges = last.noise is not None and last.noise.model.bulges
    without_edges = (target.mesh is not None or bulges) and not (last.shows_edges or edges.features)
    notes = (
        *work.notes,
        *(f"{error}; left out" for error in left_out),
        *edges.left_out,
        *([describe_kept(last.kept)] if last.kept else []),
        *([NO_EDGES] if without_edges and work.settings.language == "cad" else []),
    )
    stop = CUT if solver and relate_by.has_passed() else last.stop
    spent, found = work.budget.seconds(), edges.features
    yield Snapshot(
        "finished", program, error, spent, stop, front, constraints, last.proof, notes, found, last.noisy, last.noise, edges.measured
    )


def _find_edges(program: Program, last: BodyState, target: Target, work: Work) -> EdgesFound:
    """The fillets and chamfers of a program: of a mesh those that were set aside, of a cloud those that its points show."""
    if target.mesh is not None or work.settings.language != "cad" or last.noise is None or last.noise.model.bulges:
        return find_edge_features(program, last.chains, target)
    return find_cloud_edges(program, subsample(target.points, MOST_POINTS), last.noise.model, work.budget.end_of("relate"))


def _without_stand_ins(last: BodyState, target: Target, work: Work) -> BodyState:
    """The state of a mesh without primitives that stand for chamfers, which are chains then; its error stays that with them."""
    fit_by = work.budget.end_of("fit")
    if work.settings.language != "cad" or not shows_edges(last, target) or fit_by.has_passed():
        return last
    program, chains = take_off_stand_ins(last.program, target, fit_by, last.teeth)
    if not chains:
        return last
    front = tuple(replace(c, program=program) if c.program == last.program else c for c in last.front)
    return replace(last, program=program, front=front, measure=lambda _: last.error, chains=(*last.chains, *chains))


def _policy_of(settings: Settings, notes: list[str]) -> PolicyOf:
    """Loads the policy when it is asked for. One that must be there, and is not, is told at once; one that lacks torch alone is noted."""

    @cache
    def policy() -> Policy | None:
        if settings.method == "policy":
            return load(settings.checkpoint)
        if not settings.checkpoint and lacking(*LEARNING):
            notes.append(f"the policy was not asked, for lack of torch: {install_command('learn')}")
        return load_if_any(settings.checkpoint)

    if settings.method == "policy" or settings.checkpoint:
        policy()
    return policy


def exhaust(snapshots: Iterable[Snapshot], stages: dict[str, float]) -> Snapshot:
    """The last snapshot; the time since the one before counts, in `stages`, for its stage."""
    last = None
    for snapshot in snapshots:
        since = 0.0 if last is None else last.seconds
        stages[snapshot.stage] = stages.get(snapshot.stage, 0.0) + snapshot.seconds - since
        last = snapshot
    if last is None:
        raise RuntimeError("the reconstruction yielded no program")
    return last


def reconstruct_best(points_or_mesh: np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int = 0) -> Snapshot:
    """The last snapshot for points [n, 3], points with normals [n, 6], a trimesh or a `Target`."""
    target = points_or_mesh if isinstance(points_or_mesh, Target) else target_from(points_or_mesh)
    *_, last = reconstruct(target, settings or Settings(), np.random.default_rng(seed))
    return last
