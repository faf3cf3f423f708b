"""From a target to a program: where detection, the methods of the search and the solver meet.

Per body: carriers and sample cells labelled inside or outside (`body`), a program over them (`methods`), then its numbers (`fitting`).
A generator of snapshots, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock only cuts a
search that outruns its budget, and the last snapshot then says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice

import numpy as np
import trimesh

from imdim.body import Seen, look
from imdim.clock import CHOOSE_BY, DETECT_BY, FIT_BY, LABEL_BY, RELATE_BY, Clock
from imdim.config import ConfigError, Settings
from imdim.evolution import choices, few, united
from imdim.fitting import Related, related, snapped, solved
from imdim.geometry.cloud import InputError, Target, split_bodies, target_from
from imdim.geometry.solid import to_manifold
from imdim.geometry.strays import without_strays
from imdim.methods import METHODS, PolicyOf, Run, time_to_propose
from imdim.noisy import most_likely, unlabelled
from imdim.preserve import preserve
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.simplify import reduce_program
from imdim.program.tree import Program, combine_all, leaves, map_leaves
from imdim.proposals import load, load_if_any

MOST_JOINT = 8  # bodies
GUESSING = ("auto", "policy")  # methods that may answer from the points alone where detection sees no inside
UNKNOWN = 1.0  # error of a program whose body shows no inside
NO_INSIDE = "not proved: the noisy cloud shows no inside, this is a guess from its points alone"
NO_TIME = "not proved: time ran out before the cloud showed its inside, this is a guess from its points alone"
FRONT_BY = 0.92  # of the budget: later than that no other choices are looked for
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost


@dataclass(frozen=True)
class Snapshot:
    """The state of a run: `program` in the target's units, `error` relative to the target's volume, `seconds` since the start.

    `stop` is None until the last snapshot, which says why the run ended: "finished" or "budget_spent", after an evolution also "exact" or
    "stagnation". That one has the `front`, programs from crude to exact, of which `program` is one, and the `constraints` that hold for it.
    `proof` says whether the program was proved minimal, and why not; it is empty where the method does not ask. The last one's `notes`
    say, a sentence each, what was left out.
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


@dataclass(frozen=True)
class _State:
    """A program of one body in its own units, `error` relative to its `volume`, as `measure` gives it for any of its programs. `found` are
    the relations that its points bear out, None if they were not asked."""

    stage: str
    program: Program
    error: float
    volume: float
    measure: Callable[[Program], float]
    front: tuple[Choice, ...] = ()
    proof: str = ""
    found: tuple[Constraint, ...] | None = None


def reconstruct(target: Target, settings: Settings, rng: np.random.Generator) -> Iterator[Snapshot]:
    """Yield better and better programs for `target`; the last one is the result.

    Raises InputError where the target shows no surface or has no volume, ConfigError for an unknown method or an unusable checkpoint.
    """
    if settings.method not in METHODS:
        raise ConfigError(f"unknown method {settings.method!r}; known are {', '.join(METHODS)}")
    policy = _policy_of(settings)
    clock = Clock(settings.budget_s)
    last: Snapshot | None = None
    bodies: list[_State] = []
    left_out: list[InputError] = []
    for stage, bodies in _by_body(target, settings, policy, clock, rng, left_out):
        last = _together(stage, bodies, clock)
        yield last
    if last is None:
        raise next(iter(left_out), InputError(f"{target.name}: no program found"))
    program, constraints = last.program, ()
    if settings.solver:
        program, constraints = related(program, target, bodies[0].found, clock.near_end(RELATE_BY))
    front = tuple(replace(c, program=program) if c.program == last.program else c for c in few(last.front, last.program))
    stop = "budget_spent" if clock.cut or clock.late else clock.ending
    notes = tuple(f"{error}; left out" for error in left_out)
    yield Snapshot("finished", program, _error(program, bodies), clock.seconds(), stop, front, constraints, last.proof, notes)


def _policy_of(settings: Settings) -> PolicyOf:
    """Loads the policy when it is asked for. One that must be there, and is not, is told at once."""
    policy = cache(lambda: (load if settings.method == "policy" else load_if_any)(settings.checkpoint))
    if settings.method == "policy" or settings.checkpoint:
        policy()
    return policy


def _by_body(
    target: Target, settings: Settings, policy: PolicyOf, clock: Clock, rng: np.random.Generator, left_out: list[InputError]
) -> Iterator[tuple[str, list[_State]]]:
    """Stages with the bodies done so far; a few bodies are then tried as one, since one cut may have parted them.

    Scraps of surface beside a body are no reason to refuse it: why each was is added to `left_out`.
    """
    bodies = split_bodies(target)
    done: list[_State] = []
    for i, body in enumerate(bodies):
        state = None
        try:
            for state in _body(body, settings, policy, clock, rng, 1 / (len(bodies) - i)):
                yield state.stage, [*done, state]
        except InputError as error:
            left_out.append(error)
        done += [state] if state else []
    if left_out or not 1 < len(done) <= MOST_JOINT or clock.out_of_time():
        return
    apart = _together("joint", done, clock)
    try:
        *_, joint = _body(target, settings, policy, clock, rng)
    except InputError:  # all is told by the bodies
        return
    if count(joint.program).primitives < count(apart.program).primitives and joint.error < apart.error + JOINT_ERROR:
        yield "joint", [joint]


def _together(stage: str, states: list[_State], clock: Clock) -> Snapshot:
    """The union of several bodies' programs, with the error of all of them relative to their volume."""
    fronts = [s.front for s in states]
    front = united(fronts, [s.program for s in states], [s.volume for s in states]) if all(fronts) else []
    program, proof = combine_all("union", [s.program for s in states]), _proof([s.proof for s in states])
    return Snapshot(stage, program, _error(program, states), clock.seconds(), front=tuple(front), proof=proof)


def _error(program: Program, states: list[_State]) -> float:
    """Error of the union of several bodies' programs, perhaps with other numbers than theirs, relative to the volume of all."""
    parts = leaves(program)
    errors = []
    for state in states:
        old = list(leaves(state.program))
        new = list(islice(parts, len(old)))
        errors.append(state.error if new == old else state.measure(map_leaves(state.program, lambda i, _, new=new: new[i])))
    volume = sum(s.volume for s in states)
    # programs of nothing have no volume to measure by
    return sum(e * s.volume for e, s in zip(errors, states, strict=True)) / volume if volume else max(errors)


def _proof(proofs: list[str]) -> str:
    """Of several bodies: the first that is lacking, or what holds for each."""
    if len(set(proofs)) == 1:
        return proofs[0] + (f", each of {len(proofs)} bodies" if proofs[0] and len(proofs) > 1 else "")
    return next((p for p in proofs if p.startswith("not")), "")


def _body(
    body: Target, settings: Settings, policy: PolicyOf, clock: Clock, rng: np.random.Generator, share: float = 1.0
) -> Iterator[_State]:
    """Better and better programs of one body, which may take a share of the time left."""
    try:
        seen = look(body, settings.size_weight, rng, clock.ending_at(share, DETECT_BY), clock.ending_at(share, LABEL_BY))
    except InputError:
        cut = clock.late
        guess = _guess(body, settings, policy, clock, share, cut) if cut or settings.method in GUESSING else None
        if guess is None:
            raise
        program, found = guess
        proof = NO_TIME if cut else NO_INSIDE
        volume, front = to_manifold(program).volume(), (Choice(program, UNKNOWN),)
        yield _State("policy", program, UNKNOWN, volume, lambda _: UNKNOWN, front, proof, found)
        return
    step = None

    def state(stage: str, program: Program, error: float | None = None) -> _State:
        proof = step.proof if step else ""
        return _State(stage, program, seen.error(program) if error is None else error, seen.volume, seen.error, proof=proof)

    for step in METHODS[settings.method](Run(seen, settings, policy, clock, rng, share)):
        yield state(step.stage, step.program, step.error)
    if step is None:
        raise InputError(f"{body.name}: no solid explains its {len(seen.patches)} surfaces")
    no_time_to_choose, late = _times(clock, share)
    home = _at_home(step.program, seen, late)
    program = preserve(home, reduce_program(home, out_of_time=late))
    yield state("simplify", program)
    if not settings.solver:
        yield replace(state("simplify", program), front=_front([*step.others, program], seen, clock))
        return
    if seen.noisy:
        program, found = most_likely([*step.others, program], seen, no_time_to_choose, late)
        step = replace(step, proof="")  # it was of other primitives perhaps
    else:
        program, found = solved(program, seen, body, late), None
    last = state("solve", snapped(program, seen, body, late))
    yield replace(last, front=_front([*step.others, last.program], seen, clock), found=found)


def _at_home(program: Program, seen: Seen, out_of_time: Callable[[], bool]) -> Program:
    """A mesh's program without ends that lie where no sample was."""
    if seen.solid is None:
        return program
    unit = seen.frame.apply(program)
    home = without_strays(unit, seen.solid, out_of_time)
    return program if home is unit else seen.frame.undo(home)


def _guess(body: Target, settings: Settings, policy: PolicyOf, clock: Clock, share: float, cut: bool) -> Related | None:
    """A program of a cloud from its points alone; of a calm one only where time `cut` its detection short."""
    asked = settings.method == "policy" or (settings.method in GUESSING and time_to_propose(clock))
    return unlabelled(body, policy() if asked else None, *_times(clock, share), calm=cut)


def _times(clock: Clock, share: float) -> tuple[Callable[[], bool], Callable[[], bool]]:
    """Whether a body's program must be chosen, and its numbers fitted; each may take a share of the time left."""
    return clock.ending_at(share, CHOOSE_BY), clock.ending_at(share, FIT_BY)


def _front(programs: list[Program], seen: Seen, clock: Clock) -> tuple[Choice, ...]:
    """The front of programs in the body's units, the last one always among them, and alone where time is short."""
    if clock.near_end(FRONT_BY)():
        return (Choice(programs[-1], seen.error(programs[-1])),)
    front = choices(seen.ground, [seen.frame.apply(p) for p in programs])
    size = count(programs[-1]).primitives
    # what is delivered stays as it is, to the last digit
    return tuple(Choice(programs[-1] if count(c.program).primitives == size else seen.frame.undo(c.program), c.error) for c in front)


def reconstruct_best(points_or_mesh: np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int = 0) -> Snapshot:
    """The last snapshot for points [n, 3], points with normals [n, 6], a trimesh or a `Target`; the Python way in."""
    target = points_or_mesh if isinstance(points_or_mesh, Target) else target_from(points_or_mesh)
    *_, last = reconstruct(target, settings or Settings(), np.random.default_rng(seed))
    return last
