"""From a target to a program: where detection, the methods of the search and the solver meet.

Per body: carriers and sample cells labelled inside or outside (`observation`), a program over them (`methods`), then its numbers
(`fitting`). A generator of snapshots, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock only
cuts a search that outruns its budget, and the last snapshot then says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.deadline import Deadline
from imdim.detection.blends import Chain
from imdim.detection.cloud_bodies import group_alike, split_cloud
from imdim.detection.noise import MeasuredNoise, measure_noise
from imdim.detection.toothed_rims import ToothedRim
from imdim.export.chance import end_together
from imdim.geometry.finish.closed_voids import close_voids
from imdim.geometry.finish.cut_ends import end_cuts_in_faces
from imdim.geometry.finish.cutter_walls import open_films
from imdim.geometry.finish.datum_ends import begin_at_datums
from imdim.geometry.finish.free_ends import draw_back
from imdim.geometry.finish.late_cuts import cut_last, group_cuts, lead_with_body
from imdim.geometry.finish.loose_bodies import join_bodies
from imdim.geometry.finish.overshoot import without_strays
from imdim.geometry.finish.parted import part_bodies
from imdim.geometry.finish.rails import part_at_posts
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.turned_feet import stand_on_faces
from imdim.geometry.solid import bounds_of, to_manifold
from imdim.geometry.surface import vec
from imdim.install import install_command
from imdim.program.constraints import WORLD, Constraint, scale_constraints
from imdim.program.cost import CURVE_PRICES, count, weigh
from imdim.program.edges import EdgeFeature
from imdim.program.front import Choice
from imdim.program.motions import move_program, step
from imdim.program.outline import regions
from imdim.program.paths import leaf_paths, without
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.rewrite.stacks import stack_turned_parts
from imdim.program.tree import Primitive, Program, combine_all, leaves, map_leaves
from imdim.reconstruction.budget import SHARES, Budget
from imdim.reconstruction.choices import choices_beside, thin_front, unite_fronts
from imdim.reconstruction.config import LEARNING, ConfigError, Settings, check_choices, lacking, require_extra
from imdim.reconstruction.edge_features import SetAside, describe_kept, find_edge_features, place_chain, set_edges_aside
from imdim.reconstruction.fitting import find_relations, fit_numbers, snap_measured
from imdim.reconstruction.hole_ends import complete_holes
from imdim.reconstruction.methods import CUT, FINELY, HIDDEN, METHODS, Method, MethodStep, PolicyOf, Run, evolve_from, time_to_propose
from imdim.reconstruction.observation import Observation, UnitBody, UnseenError, find_solid, observe
from imdim.reconstruction.own_frame import find_own_frame, is_placed, turn_back
from imdim.reconstruction.plain_program import is_hardly_longer
from imdim.reconstruction.policy_beam import has_time_for_beam, load, load_if_any
from imdim.reconstruction.polygon_sides import complete_polygons
from imdim.reconstruction.preserve import is_same, preserve
from imdim.reconstruction.rounding import settle_origin, snap_numbers
from imdim.reconstruction.stand_ins import take_off_stand_ins
from imdim.reconstruction.teeth_aside import Untoothed, put_teeth_on, set_teeth_aside
from imdim.reconstruction.threads_aside import Unthreaded, set_threads_aside
from imdim.search.evolve.population import EvolutionConfig
from imdim.target.target import Frame, InputError, Target, in_unit_frame, split_bodies, target_from

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

MOST_JOINT = 8  # bodies
SEED = 0  # of the noise that tells whether a cloud is looked at body by body
GUESSING = ("auto", "policy")  # methods that may answer from the points alone where detection sees no inside
UNKNOWN = 1.0  # error of a program whose body shows no inside
NO_EDGES = "fillets and chamfers are only looked for on closed meshes: here they are part of the shape, or left out"
NO_INSIDE = "not proved: the noisy cloud shows no inside, this is a guess from its points alone"
SCANNED = "not proved: the mesh is a scan, its program is the likeliest by points of its surface"
NO_TIME = "not proved: time ran out before the cloud showed its inside, this is a guess from its points alone"
FLAT = 1e-6  # of how far a body reaches, by which a scrap of one plane may leave it
NO_TIME_LEFT = "not proved: time ran out"
JOINT_ERROR = 2e-3  # of the volume, that a shorter program of all bodies at once may cost


@dataclass(frozen=True)
class Snapshot:
    """The state of a run: `program` in the target's units, `error` relative to the target's volume, `seconds` since the start.

    `stop` is None until the last snapshot, which says why the run ended: "finished" or "budget_spent", after an evolution also "exact" or
    "stagnation". That one has the `front`, programs from crude to exact, of which `program` is one, and the `constraints` that hold for it;
    an evolution shows its front as it goes. `proof` says whether the program was proved minimal, and why not; it is empty where the
    method does not ask. The last one's `notes` say, a sentence each, what was left out, and its `edges` are the target's fillets and
    chamfers, which were set aside: the program is that of the sharp part, and `error` is relative to it. `noisy` is whether its numbers are
    measured off a noisy cloud or a scan, `noise` what was measured of the target, None where nobody did.
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


@dataclass(frozen=True)
class _BodyState:
    """A program of one body without its `chains` of fillets and chamfers, but with those `kept`, it and the `volume` in the body's units;
    `error` is relative to that, as `measure` gives it for any program of its structure. `found` are the relations that its points support,
    None if they were not asked. The leaves of the numbers `teeth` are those of toothed rims. `stop` is as a step's, `noisy` and `noise` as
    a snapshot's. `shows_edges` is whether its fillets and chamfers were looked for."""

    stage: str
    program: Program
    error: float
    volume: float
    measure: Callable[[Program], float]
    front: tuple[Choice, ...] = ()
    proof: str = ""
    stop: str = "finished"
    found: tuple[Constraint, ...] | None = None
    chains: tuple[Chain, ...] = ()
    kept: tuple[Chain, ...] = ()
    teeth: frozenset[int] = frozenset()
    noisy: bool = False
    noise: MeasuredNoise | None = None
    shows_edges: bool = True


@dataclass(frozen=True)
class _Work:
    """What all bodies of a run share. `guesses` is whether a body that shows no inside may be answered from its points alone; `alone` is
    whether no other stands beside it, whose places would have to move with its own. `notes` grow as the run does without something. `own`
    is the frame that the part is turned into, if it is."""

    settings: Settings
    method: Method
    guesses: bool
    policy: PolicyOf
    budget: Budget
    rng: np.random.Generator
    notes: list[str] = field(default_factory=list)
    alone: bool = True
    own: Frame | None = None


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
    work = _Work(settings, METHODS[settings.method], settings.method in GUESSING, _policy_of(settings, notes), budget, rng, notes)
    own = find_own_frame(target)
    if own is None:
        states = _by_body(target, work, left_out)
    else:
        states = _turn_back(_by_body(own.normalise(target), replace(work, own=own), left_out), own)
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
    work = _Work(settings, evolve_from(frame.apply(program), config), False, lambda: None, budget, rng)
    yield from _snapshots(_body(target, work), target, work)


def _snapshots(states: Iterable[_BodyState], target: Target, work: _Work, left_out: Sequence[InputError] = ()) -> Iterator[Snapshot]:
    """The states as snapshots, and the last one again with its relations; `left_out` grows while the states pass."""
    last: _BodyState | None = None
    for last in states:
        front = tuple(thin_front(last.front, last.program)) if last.front else ()
        yield Snapshot(last.stage, last.program, last.error, work.budget.seconds(), front=front, proof=last.proof)
    if last is None:
        raise next(iter(left_out), InputError(f"{target.name}: no program found"))
    last = _without_stand_ins(last, target, work)
    relate_by, solver = work.budget.end_of("relate"), work.settings.solver
    program, constraints = find_relations(last.program, target, last.found, relate_by) if solver else (last.program, ())
    constraints = end_together(program, constraints)
    error = last.error if program == last.program else last.measure(program)
    front = tuple(replace(c, program=program) if c.program == last.program else c for c in thin_front(last.front, last.program))
    edges = find_edge_features(program, last.chains, target)
    notes = (
        *work.notes,
        *(f"{error}; left out" for error in left_out),
        *edges.left_out,
        *([describe_kept(last.kept)] if last.kept else []),
        *([NO_EDGES] if work.settings.language == "cad" and not (last.shows_edges or edges.features) else []),
    )
    stop = CUT if solver and relate_by.has_passed() else last.stop
    spent, found = work.budget.seconds(), edges.features
    yield Snapshot("finished", program, error, spent, stop, front, constraints, last.proof, notes, found, last.noisy, last.noise)


def _shows_edges(state: _BodyState, target: Target) -> bool:
    """Whether fillets and chamfers of a target are looked for, whose faces points, open meshes and scans do not show."""
    return target.mesh is not None and target.is_solid and not state.noisy


def _turn_back(states: Iterable[_BodyState], own: Frame) -> Iterator[_BodyState]:
    """The states of a part in its own frame, in the world; relations to the axes of that frame are none to the world's."""
    for state in states:
        # relations tell of the leaves' own axes
        undo = own.undo if state.found is not None else partial(turn_back, own=own)
        found = None if state.found is None else tuple(c for c in state.found if all(ref.leaf != WORLD for ref in (*c.of, c.about) if ref))
        chains, kept = (tuple(place_chain(chain, own) for chain in each) for each in (state.chains, state.kept))
        front = tuple(replace(choice, program=undo(choice.program)) for choice in state.front)
        measure = partial(_measure_own, state.measure, own)
        yield replace(state, program=undo(state.program), front=front, measure=measure, found=found, chains=chains, kept=kept)


def _measure_own(measure: Callable[[Program], float], own: Frame, program: Program) -> float:
    return measure(own.apply(program))


def _without_stand_ins(last: _BodyState, target: Target, work: _Work) -> _BodyState:
    """The state of a mesh without primitives that stand for chamfers, which are chains then; its error stays that with them."""
    fit_by = work.budget.end_of("fit")
    if work.settings.language != "cad" or not _shows_edges(last, target) or fit_by.has_passed():
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


def _by_body(target: Target, work: _Work, left_out: list[InputError]) -> Iterator[_BodyState]:
    """States of the union of the bodies done so far; a few bodies are then tried as one, since one cut may have parted them.

    Scraps of surface beside a body are no reason to refuse it: why each was is added to `left_out`.
    """
    bodies = split_bodies(target)
    if len(parts := _parts_of_noisy_cloud(target)) > 1:
        yield from _by_noisy_body(target, parts, work)
        return
    facets = [_count_facets(body) for body in bodies]
    done: list[_BodyState] = []
    for i, body in enumerate(bodies):
        if done and work.budget.end_of("search").has_passed():
            flat = [rest.name for rest in bodies[i:] if _is_flat(rest)]
            left_out += [InputError(f"{name}: flat, it has no inside") for name in flat]
            done += [_box_state(rest) for rest in bodies[i:] if rest.name not in flat]
            if boxes := len(bodies) - i - len(flat):
                work.notes.append(f"no time was left for {boxes} of {len(bodies)} bodies: they are boxes")
            yield _together("boxes", done)
            break
        state = None
        try:
            # many facets may be one ball: no body has less than an equal part of the time that is left
            share = max(facets[i] / sum(facets[i:]), 1 / (len(bodies) - i))
            for state in _body(body, replace(work, alone=len(bodies) == 1), share):
                yield _together(state.stage, [*done, state])
        except InputError as error:
            left_out.append(error)
        done += [state] if state else []
    if not left_out and 1 < len(done) <= MOST_JOINT:
        yield from _jointly(target, work, _together(done[-1].stage, done))


def _parts_of_noisy_cloud(target: Target) -> list[np.ndarray]:
    """Indices of the points of each body of a noisy cloud where several stand clearly apart; none of other targets. Known scanners see past
    all bodies, so that their cloud stays whole, and so does a calm one, whose cells tell bodies apart."""
    if target.mesh is not None or target.scanners is not None or len(split_cloud(target.points, 0.0)) == 1:
        return []
    noise = measure_noise(target.points, np.random.default_rng(SEED))[0]
    return split_cloud(target.points, noise.sigma) if noise.blurs else []


def _by_noisy_body(target: Target, parts: Sequence[np.ndarray], work: _Work) -> Iterator[_BodyState]:
    """States of the union of the bodies of a noisy cloud done so far, of which `parts` are the indices of their points, and then with its
    numbers fitted to all points. Bodies that are alike are looked at as one, with the points of all.

    Each has its share of the time until a program must be chosen, and of that its own stages.
    """
    from imdim.reconstruction.mdl import settle_together

    noise = MeasuredNoise(*measure_noise(target.points, np.random.default_rng(SEED)))
    done, sigma = list[_BodyState](), noise.model.sigma
    groups = group_alike([target.points[own] for own in parts], sigma)
    bodies = [_gather(target, [(parts[i], way) for i, way in group], f"{target.name} body {group[0][0] + 1}") for group in groups]
    for number, (group, body) in enumerate(zip(groups, bodies, strict=True)):
        share = len(body.points) / sum(len(rest.points) for rest in bodies[number:])
        own = Budget(share * work.budget.end_of("choose").left() / SHARES["fit"].by, work.budget.now)
        if own.whole_s <= 0:
            work.notes.append(f"no time was left for {len(bodies) - number} of {len(bodies)} bodies: they are boxes")
            done += [_moved(_box_state(rest), way) for rest, ways in zip(bodies[number:], groups[number:], strict=True) for _, way in ways]
            break
        try:
            for state in _body(body, replace(work, budget=own, alone=False)):
                alike = [_moved(state, way) for _, way in group]
                yield _together(state.stage, [*done, *alike])
        except InputError as error:
            work.notes.append(f"{error}; left out")
            continue
        done += alike
    if not done:
        raise InputError(f"{target.name}: no solid explains any of its {len(parts)} bodies")
    (unit, frame), last = in_unit_frame(target), _together("joint", done)
    likely = settle_together(frame.apply(last.program), unit.points, sigma * frame.scale, work.budget.end_of("likely"))
    found = scale_constraints(likely.constraints, 1 / frame.scale)
    program = snap_measured(frame.undo(likely.program), found, target.points, work.budget.end_of("fit"))
    error, stop = last.measure(program), CUT if likely.cut else last.stop
    front = (Choice(program, error),)
    yield replace(last, program=program, error=error, front=front, found=found, noisy=True, noise=noise, stop=stop)


def _gather(target: Target, alike: Sequence[tuple[np.ndarray, np.ndarray]], name: str) -> Target:
    """The points of bodies that are alike in the place of the first, by their indices and the ways [3] from it."""
    every = np.concatenate([own for own, _ in alike])
    points = np.concatenate([target.points[own] - way for own, way in alike])
    return replace(target, name=name, points=points, normals=None if target.normals is None else target.normals[every])


def _moved(state: _BodyState, way: np.ndarray) -> _BodyState:
    """The state of a body as that of one like it, which stands elsewhere."""
    if not way.any():
        return state
    there, back = step(vec(way)), step(vec(-way))
    front = tuple(replace(choice, program=move_program(choice.program, there)) for choice in state.front)
    measure = state.measure
    return replace(
        state, program=move_program(state.program, there), front=front, measure=lambda program: measure(move_program(program, back))
    )


def _count_facets(body: Target) -> int:
    """Facets of a body, or points of a cloud's: a dozen scraps beside a part take none of its time."""
    return max(1, len(body.points) if body.mesh is None else len(body.mesh.faces))


def _is_flat(body: Target) -> bool:
    """Whether a body is a scrap of one plane, whose box would hold nothing."""
    points = np.asarray(body.points if body.mesh is None else body.mesh.vertices)
    spans = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spans[-1] <= FLAT * spans[0])


def _box_state(body: Target) -> _BodyState:
    """The box of a body that no time is left for. It holds the body, so that its error is what it has beyond that."""
    low, high = np.min(body.points, axis=0), np.max(body.points, axis=0)
    if body.mesh is not None:
        low, high = np.min(body.mesh.vertices, axis=0), np.max(body.mesh.vertices, axis=0)
    x, y, z = (float(v) for v in (low + high) / 2)
    box, whole = Primitive("box", (*(float(v) for v in high - low),), (x, y, z)), float(np.prod(high - low))
    volume = float(body.mesh.volume) if body.mesh is not None and body.is_solid else whole
    error = abs(whole - volume) / volume
    return _BodyState("boxes", box, error, volume, lambda _: error, (Choice(box, error),), NO_TIME_LEFT, CUT)


def _jointly(target: Target, work: _Work, apart: _BodyState) -> Iterator[_BodyState]:
    """The bodies as one where that is shorter, or `apart` where time has cut the attempt. Two bodies in one drawing are not shorter."""
    if work.budget.end_of("search").has_passed():
        yield replace(apart, stop=CUT)
        return
    try:
        *_, joint = _body(target, work)
    except InputError:  # all is told by the bodies
        return
    curve = CURVE_PRICES[work.settings.counted]
    shorter = weigh(joint.program, curve) < weigh(apart.program, curve) and not any(_is_in_pieces(leaf) for leaf in leaves(joint.program))
    if shorter and joint.error < apart.error + JOINT_ERROR:
        yield replace(joint, stage="joint", stop=_stop([apart.stop, joint.stop]))
    elif joint.stop == CUT:
        yield replace(apart, stop=CUT)


def _is_in_pieces(leaf: Primitive) -> bool:
    """Whether an outline has several separate areas."""
    return leaf.outline is not None and len(regions(leaf.outline)) > 1


def _together(stage: str, states: list[_BodyState]) -> _BodyState:
    """The union of several bodies' programs, with the error of all of them relative to their volume."""
    fronts = [s.front for s in states]
    front = unite_fronts(fronts, [s.program for s in states], [s.volume for s in states]) if all(fronts) else []
    program = combine_all("union", [s.program for s in states])
    stop, proof = _stop([s.stop for s in states]), _proof([s.proof for s in states])
    error, volume = _mean_error([s.error for s in states], states), sum(s.volume for s in states)
    chains, kept = (tuple(chain for found in each for chain in found) for each in zip(*((s.chains, s.kept) for s in states), strict=True))
    state = _BodyState(stage, program, error, volume, lambda p: _error(p, states), tuple(front), proof, stop, states[0].found, chains, kept)
    before = np.cumsum([0, *(count(s.program).primitives for s in states)]).tolist()
    teeth = frozenset(first + number for s, first in zip(states, before, strict=False) for number in s.teeth)
    noises = [s.noise for s in states if s.noise is not None]
    noise = max(noises, key=lambda noise: noise.model.sigma, default=None)
    shows = all(s.shows_edges for s in states)
    return replace(state, teeth=teeth, noisy=any(s.noisy for s in states), noise=noise, shows_edges=shows)


def _error(program: Program, states: Sequence[_BodyState]) -> float:
    """Error of the union of several bodies' programs with other numbers than theirs, relative to the volume of all."""
    parts, errors = leaves(program), []
    for state in states:
        new = list(islice(parts, count(state.program).primitives))
        errors.append(state.measure(map_leaves(state.program, lambda i, _, new=new: new[i])))
    return _mean_error(errors, states)


def _mean_error(errors: Sequence[float], states: Sequence[_BodyState]) -> float:
    """Of all bodies relative to their volume; programs of nothing have none to measure by."""
    volume = sum(s.volume for s in states)
    return sum(e * s.volume for e, s in zip(errors, states, strict=True)) / volume if volume else max(errors)


def _stop(stops: list[str]) -> str:
    """How work on several bodies ended: cut if any was, else as the last one that tells more than that it ended."""
    telling = [stop for stop in stops if stop != "finished"]
    return CUT if CUT in telling else next(reversed(telling), "finished")


def _proof(proofs: list[str]) -> str:
    """Of several bodies: the first that is lacking, or what holds for each."""
    if len(set(proofs)) == 1:
        return proofs[0] + (f", each of {len(proofs)} bodies" if proofs[0] and len(proofs) > 1 else "")
    return next((p for p in proofs if p.startswith("not")), "")


def _body(body: Target, work: _Work, share: float = 1.0) -> Iterator[_BodyState]:
    """Better and better programs of one body without its fillets and chamfers; it may take a share of the time left."""
    drawn = work.settings.language == "cad" and work.method in METHODS.values()  # a person's program has its teeth
    bare = set_teeth_aside(body) if drawn else Untoothed(body)
    if bare.rims:
        yield from (_put_teeth_on(state, bare.rims) for state in _bare_body(bare.target, work, share))
    else:
        yield from _bare_body(body, work, share)


def _put_teeth_on(state: _BodyState, rims: tuple[ToothedRim, ...]) -> _BodyState:
    """The state of a body without the teeth of its rims as one with them; its error is that of the rest."""
    program, first = put_teeth_on(state.program, rims), count(state.program).primitives

    def measure(program: Program) -> float:
        return state.measure(without(program, [path for path, _ in leaf_paths(program)[first:]]) or program)

    front = tuple(replace(choice, program=put_teeth_on(choice.program, rims)) for choice in state.front)
    teeth = frozenset(range(first, count(program).primitives))
    return replace(state, program=program, measure=measure, front=front, teeth=teeth)


def _bare_body(body: Target, work: _Work, share: float) -> Iterator[_BodyState]:
    """As `_body`, of one whose teeth are set aside."""
    unit, frame = in_unit_frame(body)
    detect_by = work.budget.part_of("detect", share)
    plain = set_threads_aside(unit, 1 / frame.scale) if work.settings.language == "cad" else Unthreaded(unit)
    work.notes.extend(note for note in plain.notes if note not in work.notes)
    aside = set_edges_aside(plain.target, detect_by) if work.settings.language == "cad" else SetAside(unit)
    cut = body.mesh is not None and detect_by.has_passed()
    chains, kept = (tuple(place_chain(chain, frame) for chain in found) for found in (aside.chains, aside.kept))
    observed = UnitBody.of(aside.target, work.rng, aside.patches, detect_by, work.settings.language == "cad")
    # rims lie between whole features, whether these are drawn or not
    blended = not all(chain.is_rim for chain in chains)
    noise = MeasuredNoise(observed.noise.scale(1 / frame.scale), observed.kept)
    for state in _sharp_body(body, observed, frame, work, share, blended):
        stop, shows = CUT if cut else state.stop, _shows_edges(state, body)
        yield replace(state, chains=chains, kept=kept, stop=stop, noise=noise, shows_edges=shows)


def _sharp_body(body: Target, observed: UnitBody, frame: Frame, work: _Work, share: float, blended: bool = False) -> Iterator[_BodyState]:
    """Programs of one body as it is `observed` in its unit frame; `blended` if edges other than rims were set aside."""
    budget, settings = work.budget, work.settings
    solid = find_solid(observed.target) if observed.scanned and work.guesses else None
    if solid is not None and (state := _scanned_body(observed, solid, frame, work, share)) is not None:
        yield state
        return
    try:
        detect_by, label_by = budget.part_of("detect", share), budget.part_of("label", share)
        outlines, curve = settings.language == "cad", CURVE_PRICES[settings.counted]
        seen = observe(observed, settings.size_weight, work.rng, detect_by, label_by, outlines, curve)
    except UnseenError as error:
        guess = _guess(observed, work, share, error.cut) if work.method in METHODS.values() else None  # a person's program is not dropped
        if guess is None:
            raise
        step, found = guess
        volume = to_manifold(step.program).volume()
        state = _BodyState(
            step.stage, frame.undo(step.program), UNKNOWN, volume / frame.scale**3, lambda _: UNKNOWN, (), step.proof, step.stop
        )
        front, found = (Choice(state.program, UNKNOWN),), scale_constraints(found, 1 / frame.scale)
        yield replace(state, front=front, found=found, noisy=observed.noise.blurs)
        return
    step = None
    for step in work.method(Run(seen, settings, work.policy, budget, work.rng, share, blended, 1 / frame.scale)):
        yield _state(step, seen, frame)
    if step is None:
        raise InputError(f"{body.name}: no solid explains its {len(seen.patches)} surfaces")
    choose_by, fit_by = _times(budget, share)
    home = step.program if seen.solid is None else without_strays(step.program, seen.solid, fit_by)
    short = preserve(home, reduce_program(home, deadline=fit_by))
    if settings.language == "cad" and seen.solid is not None and not fit_by.has_passed():
        short = complete_polygons(complete_holes(short, seen.patches, seen.iou, seen.exact_price), seen.iou)
    opened = _open_films(frame.undo(short), seen, frame, fit_by)
    short = short if opened is None else frame.apply(opened)
    simple = replace(step, stage="simplify", program=short, error=None, front=())
    last = _state(simple, seen, frame)
    yield last
    if settings.solver:
        solve_by = budget.part_of("likely", share) if seen.noisy else fit_by
        fitted, found = _solve(simple, seen, choose_by, solve_by, settings, work.policy)
        if work.alone and found is None and not fit_by.has_passed():
            frame = settle_origin(frame.undo(fitted.program), seen, frame)
        last = _state(fitted, seen, frame)
        found = None if found is None else scale_constraints(found, 1 / frame.scale)
        if found is None:
            last = replace(last, program=_arrange(_round(last.program, seen, frame, fit_by, work.own), fit_by))
        else:
            measured = snap_measured(last.program, found, frame.to_world(seen.target.points), fit_by)
            last = replace(last, program=measured, found=found, noisy=True)
        # rounding may part what met; where time was short it is worth more than relations to open what should be open
        last = replace(last, program=_open_films(last.program, seen, frame, budget.end_of("relate")) or last.program)
        if (bounded := _solid_in(seen, frame)) is not None and not fit_by.has_passed():
            last = replace(last, program=close_voids(join_bodies(last.program, bounded, fit_by), bounded, fit_by))
    cut = seen.cut or fit_by.has_passed()
    yield _finish_state(replace(last, stop=CUT) if cut else last, step.others, seen, frame, budget)


def _round(program: Program, seen: Observation, frame: Frame, deadline: Deadline, own: Frame | None) -> Program:
    """The program in the body's units with round numbers, and with those of the cylinders and cones that its turned parts are stacks of."""
    placed = own if own is not None and is_placed(program, own) else None
    rounded = _snap(program, seen, frame, deadline, placed)
    if deadline.has_passed():
        return rounded
    # where walls are stacked and parts stand is known once they are round, and then the ends that they get are to be rounded
    flat = cut_last(rounded, deadline)
    stood = preserve(flat, stack_turned_parts(flat), deadline=deadline)
    if (solid := _solid_in(seen, frame)) is not None:
        stood = stand_on_faces(stood, solid, deadline)
    return rounded if stood == flat else _snap(stood, seen, frame, deadline, placed)


def _snap(program: Program, seen: Observation, frame: Frame, deadline: Deadline, placed: Frame | None) -> Program:
    """The program with typed numbers: those of the world where the parts of a body that lies aslant were `placed` there."""
    if placed is None:
        return snap_numbers(program, seen, frame, deadline)
    return placed.apply(snap_numbers(turn_back(program, placed), seen, frame.within(placed), deadline))


def _arrange(program: Program, deadline: Deadline) -> Program:
    """The same solid as a person writes it: cutters that end where they leave the part, turned parts as stacks, the body first and its
    cuts last, bodies that are cut in two as two, bosses that begin at the base, rails between posts, and cuts that end with what they cut,
    in the order of what they serve; as far as time allows."""
    if deadline.has_passed():
        return program
    program = preserve(program, draw_back(program, deadline), deadline=deadline)
    bounds = bounds_of(to_manifold(program, CHECK_SEGMENTS))

    def is_plainer(new: Program, old: Program) -> bool:
        return is_hardly_longer(new, old, *bounds) and is_same(old, new, HIDDEN, FINELY)

    flat = cut_last(preserve(program, stack_turned_parts(program), deadline=deadline), deadline)
    apart = part_bodies(flat, is_plainer, deadline)
    flat = flat if apart == flat else cut_last(apart, deadline)
    if not deadline.has_passed():
        flat = preserve(flat, begin_at_datums(flat, deadline), deadline=deadline)
    # posts have come down to the base
    railed = part_at_posts(flat, is_plainer, deadline)
    return group_cuts(lead_with_body(preserve(railed, end_cuts_in_faces(railed, deadline), deadline=deadline)))


def _open_films(program: Program, seen: Observation, frame: Frame, deadline: Deadline) -> Program | None:
    """The program, in the body's units, whose cutters go on past films that are not the body's; None where it has none, or nobody knows."""
    solid = _solid_in(seen, frame)
    if solid is None:
        return None
    opened = open_films(program, solid, deadline)
    return None if opened is program else opened


def _solid_in(seen: Observation, frame: Frame) -> Manifold | None:
    """The solid that the body's mesh bounds, in the body's units."""
    factor = 1 / frame.scale
    return None if seen.solid is None else seen.solid.scale((factor, factor, factor)).translate(frame.center)


def _scanned_body(observed: UnitBody, solid: Manifold, frame: Frame, work: _Work, share: float) -> _BodyState | None:
    """The program of a scanned body, judged by the points of its surface; its error is the volume in which it differs from the solid."""
    from imdim.reconstruction.mdl import reconstruct_scan  # of clouds and scans: most meshes need not wait for it

    # few numbers are left to be fitted, and rounding is quick: the search may take longer than a cloud's
    times = work.budget.part_of("likely", share), work.budget.part_of("fit", share)
    likely = reconstruct_scan(observed, work.rng, *times, work.settings.language == "cad")
    if likely is None:
        return None

    def measure(program: Program) -> float:
        made = to_manifold(frame.apply(program))
        return ((made - solid).volume() + (solid - made).volume()) / solid.volume()

    program = frame.undo(likely.program)
    error = measure(program)
    state = _BodyState("solve", program, error, solid.volume() / frame.scale**3, measure, (Choice(program, error),), SCANNED)
    found = scale_constraints(likely.constraints, 1 / frame.scale)
    return replace(state, stop=CUT if likely.cut else "finished", found=found, noisy=True)


def _state(step: MethodStep, seen: Observation, frame: Frame) -> _BodyState:
    """A step in the body's units."""
    error = seen.error(step.program) if step.error is None else step.error
    volume = seen.cells.volume / frame.scale**3

    def measure(program: Program) -> float:
        return seen.error(frame.apply(program))

    front = tuple(replace(c, program=frame.undo(c.program)) for c in step.front)
    return _BodyState(step.stage, frame.undo(step.program), error, volume, measure, front, step.proof, step.stop)


def _solve(
    step: MethodStep, seen: Observation, choose_by: Deadline, fit_by: Deadline, settings: Settings, policy: PolicyOf
) -> tuple[MethodStep, tuple[Constraint, ...] | None]:
    """The step with fitted numbers; of a noisy cloud with a program of other primitives perhaps, which no proof is of, and with the
    relations that its points support."""
    if not seen.noisy:
        return replace(step, stage="solve", program=fit_numbers(step.program, seen, fit_by)), None
    from imdim.reconstruction.mdl import most_likely

    drawn = settings.language == "cad"
    # torch takes seconds to load
    asked = has_time_for_beam(choose_by)
    likely = most_likely([*step.others, step.program], seen, choose_by, fit_by, drawn, policy() if asked else None, settings.evolution)
    return replace(step, stage="solve", program=likely.program, proof="").cut_if(likely.cut or not asked), likely.constraints


def _finish_state(last: _BodyState, others: Sequence[Program], seen: Observation, frame: Frame, budget: Budget) -> _BodyState:
    """The last state, its error measured, with its front, of which it alone is where time is short; `others` are in the unit frame."""
    unit = frame.apply(last.program)
    error = seen.error(unit)
    if budget.end_of("front").has_passed():
        return replace(last, error=error, front=(Choice(last.program, error),), stop=CUT)
    return replace(last, error=error, front=tuple(choices_beside(last.program, unit, others, seen.evidence, frame)))


def _guess(body: UnitBody, work: _Work, share: float, cut: bool) -> tuple[MethodStep, tuple[Constraint, ...]] | None:
    """A program of a cloud from its points alone, and its relations; of a calm one only where time `cut` its detection short. None of a
    mesh, for which the policy need not be loaded."""
    if body.target.mesh is not None or not (cut or work.guesses):
        return None
    from imdim.reconstruction.mdl import reconstruct_unlabelled

    asked = work.guesses and (work.settings.method == "policy" or time_to_propose(work.budget))
    likely = reconstruct_unlabelled(
        body, work.policy() if asked else None, *_times(work.budget, share), calm=cut, drawn=work.settings.language == "cad"
    )
    if likely is None:
        return None
    step = MethodStep("policy", likely.program, UNKNOWN, proof=NO_TIME if cut else NO_INSIDE)
    return step.cut_if(cut or likely.cut or not asked), likely.constraints


def _times(budget: Budget, share: float) -> tuple[Deadline, Deadline]:
    """When a body's program must be chosen, and its numbers fitted; each may take a share of the time left."""
    return budget.part_of("choose", share), budget.part_of("fit", share)


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
