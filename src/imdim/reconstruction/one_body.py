"""The program of one body of a target: what is set aside, what is observed, a method of the search over that, then the numbers.

A generator of states, so that progress, a time limit and tests work from outside. Work is bounded by counts; the clock only cuts a search
that outruns its budget, and the last state then says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from manifold3d import Manifold

from imdim.deadline import Deadline
from imdim.detection.noise import MeasuredNoise
from imdim.geometry.census import census_of
from imdim.geometry.finish.closed_voids import close_voids
from imdim.geometry.finish.cut_ends import end_cuts_in_faces
from imdim.geometry.finish.cutter_walls import open_films
from imdim.geometry.finish.datum_ends import begin_at_datums
from imdim.geometry.finish.free_ends import draw_back
from imdim.geometry.finish.idle_parts import drop_idle
from imdim.geometry.finish.late_cuts import cut_last, group_cuts, lead_with_body
from imdim.geometry.finish.loose_bodies import join_bodies
from imdim.geometry.finish.overshoot import without_strays
from imdim.geometry.finish.parted import part_bodies
from imdim.geometry.finish.plugs import bore_plugs, part_holes
from imdim.geometry.finish.rails import part_at_posts
from imdim.geometry.finish.round_feet import begin_in_round_walls
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.turned_feet import stand_on_faces
from imdim.geometry.finish.webs import draw_webs
from imdim.geometry.solid import bounds_of, to_manifold
from imdim.program.constraints import Constraint, scale_constraints
from imdim.program.cost import CURVE_PRICES
from imdim.program.front import Choice
from imdim.program.rewrite.part_turns import turn_part_way
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.rewrite.stacks import stack_turned_parts
from imdim.program.tree import Program
from imdim.reconstruction.body_state import UNKNOWN, BodyState, put_teeth_on_state
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.choices import choices_beside
from imdim.reconstruction.config import Settings
from imdim.reconstruction.delivery_time import ALLOWED_AFTER_S, leave_time_for_files, leave_time_to_deliver
from imdim.reconstruction.edge_features import SetAside, place_chain, set_edges_aside
from imdim.reconstruction.fitting import fit_numbers, snap_measured
from imdim.reconstruction.hole_ends import complete_holes
from imdim.reconstruction.methods import CUT, FINELY, HIDDEN, METHODS, Method, MethodStep, Run, has_outlines, time_to_propose
from imdim.reconstruction.observation import Observation, UnitBody, UnseenError, find_solid, observe
from imdim.reconstruction.own_frame import is_placed, turn_back
from imdim.reconstruction.plain_program import is_hardly_longer
from imdim.reconstruction.policy_beam import PolicyOf
from imdim.reconstruction.polygon_sides import complete_polygons
from imdim.reconstruction.preserve import is_same, preserve
from imdim.reconstruction.rounding import settle_origin, snap_numbers
from imdim.reconstruction.spare_parts import drop_spare
from imdim.reconstruction.teeth_aside import Untoothed, set_teeth_aside
from imdim.reconstruction.text_aside import Untexted, set_text_aside
from imdim.reconstruction.threads_aside import Unthreaded, set_threads_aside
from imdim.target.target import Frame, InputError, Target, in_unit_frame
from imdim.target.viewpoint import certainly_one_side, guess_camera

GUESSING = ("auto", "policy")  # methods that may answer from the points alone where detection sees no inside
NO_INSIDE = "not proved: the noisy cloud shows no inside, this is a guess from its points alone"
SCANNED = "not proved: the mesh is a scan, its program is the likeliest by points of its surface"
VIEWED = "not proved: a camera saw this from one side, its program is the likeliest by its points, and what lies behind is a guess"
FROM_ONE_SIDE = "all points can be seen from one side: what lies behind them is taken to be unseen"
NO_TIME = "not proved: time ran out before the cloud showed its inside, this is a guess from its points alone"


@dataclass(frozen=True)
class Work:
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


def fit_body(body: Target, work: Work, share: float = 1.0) -> Iterator[BodyState]:
    """Better and better programs of one body without its text, fillets and chamfers; it may take a share of the time left."""
    drawn = work.settings.language == "cad" and work.method in METHODS.values()  # a person's program has its teeth and its text
    plain = set_text_aside(body, work.own) if drawn else Untexted(body)
    work.notes.extend(note for note in plain.notes if note not in work.notes)
    bare = set_teeth_aside(plain.target) if drawn else Untoothed(plain.target)
    if bare.rims:
        yield from (put_teeth_on_state(state, bare.rims) for state in _bare_body(bare.target, work, share))
    else:
        yield from _bare_body(bare.target, work, share)


def _bare_body(body: Target, work: Work, share: float) -> Iterator[BodyState]:
    """As `fit_body`, of one whose text and teeth are set aside."""
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
        stop, shows = CUT if cut else state.stop, shows_edges(state, body)
        yield replace(state, chains=chains, kept=kept, stop=stop, noise=state.noise or noise, shows_edges=shows)


def _sharp_body(body: Target, observed: UnitBody, frame: Frame, work: Work, share: float, blended: bool = False) -> Iterator[BodyState]:
    """Programs of one body as it is `observed` in its unit frame; `blended` if edges other than rims were set aside."""
    budget, settings = work.budget, work.settings
    if observed.noise.bulges and work.guesses:
        scanned = _scanned_body(observed, frame, work, share)
    else:
        scanned = _seen_from_one_side(observed, frame, work, share, certainly=True)
    if scanned is not None:
        yield scanned
        return
    try:
        detect_by, label_by = budget.part_of("detect", share), budget.part_of("label", share)
        outlines, curve = settings.language == "cad", CURVE_PRICES[settings.counted]
        seen = observe(observed, settings.size_weight, work.rng, detect_by, label_by, outlines, curve)
    except UnseenError as error:
        guess = _guess(observed, work, share, error.cut) if work.method in METHODS.values() else None  # a person's program is not dropped
        if guess is None and (aside := _seen_from_one_side(observed, frame, work, share)) is not None:
            yield aside
            return
        if guess is None:
            raise
        step, found = guess
        state = replace(_guessed_state(step.program, frame, step.stage, step.proof), stop=step.stop)
        yield replace(state, found=scale_constraints(found, 1 / frame.scale), noisy=observed.noise.blurs)
        return
    step = None
    for step in work.method(Run(seen, settings, work.policy, budget, work.rng, share, blended, 1 / frame.scale)):
        yield _state(step, seen, frame)
    if step is None:
        raise InputError(f"{body.name}: no solid explains its {len(seen.patches)} surfaces")
    fit_by = leave_time_for_files(step.program, budget.part_of("fit", share), budget.end)
    home = step.program if seen.solid is None else without_strays(step.program, seen.solid, fit_by)
    short = preserve(home, reduce_program(home, deadline=fit_by))
    if settings.language == "cad" and seen.solid is not None and not fit_by.has_passed():
        short = complete_polygons(complete_holes(short, seen.patches, seen.iou, seen.exact_price), seen.iou)
        short = part_holes(bore_plugs(draw_webs(short, seen.solid, fit_by), seen.solid, fit_by), seen.solid, fit_by)
    opened = _open_films(frame.undo(short), seen, frame, fit_by)
    short = short if opened is None else frame.apply(opened)
    simple = replace(step, stage="simplify", program=short, error=None, front=())
    last = _state(simple, seen, frame)
    yield last
    if settings.solver:
        choose_by, likely_by = _noisy_times(budget, share)
        fitted, found = _solve(simple, seen, choose_by, likely_by if seen.noisy else fit_by, settings, work.policy)
        if work.alone and found is None and not fit_by.has_passed():
            frame = settle_origin(frame.undo(fitted.program), seen, frame)
        last = _state(fitted, seen, frame)
        found = None if found is None else scale_constraints(found, 1 / frame.scale)
        if found is None:
            rounded = _round(last.program, seen, frame, fit_by, work.own)
            last = replace(last, program=_arrange(rounded, fit_by, settings.language == "cad"))
        else:
            fit_by = leave_time_to_deliver(last.program, budget.part_of("measure", share), ALLOWED_AFTER_S)
            measured = snap_measured(last.program, found, frame.to_world(seen.target.points), fit_by)
            last = replace(last, program=measured, found=found, noisy=True)
        # rounding may part what met; where time was short it is worth more than relations to mend that
        last = replace(last, program=_mend_kind(last.program, seen, frame, budget.end_of("relate")))
        if last.found is None:  # relations that were found are of all its parts
            last = replace(last, program=_drop_spare(drop_idle(last.program, fit_by), seen, frame, body, fit_by))
    cut = seen.cut or fit_by.has_passed()
    yield _finish_state(replace(last, stop=CUT) if cut else last, step.others, seen, frame, budget)


def _drop_spare(program: Program, seen: Observation, frame: Frame, body: Target, deadline: Deadline) -> Program:
    """A mesh's program with drawings, in the body's units, without what costs more than it is worth. Of other programs it may be
    proved that nothing less will do."""
    if seen.solid is None or not seen.evidence.exact or not has_outlines(program):
        return program

    def estimate(fewer: Program) -> float:
        return seen.price(frame.apply(fewer))

    def join(fewer: Program) -> Program | None:
        most = _count_bodies(program)
        if _count_bodies(fewer) <= most:
            return fewer
        # a crumb may lie in the target, whose edges are sharp, and not in the body
        solid = find_solid(body)
        joined = fewer if solid is None else join_bodies(fewer, solid, deadline)
        return joined if _count_bodies(joined) <= most else None

    return drop_spare(program, estimate, lambda fewer: seen.exact_price(frame.apply(fewer)), seen.size_weight, deadline, join)


def _count_bodies(program: Program) -> int:
    return census_of(to_manifold(program)).bodies


def _guessed_state(program: Program, frame: Frame, stage: str, proof: str) -> BodyState:
    """The state of a program in the unit frame whose body shows no inside."""
    own = frame.undo(program)
    volume = to_manifold(program).volume() / frame.scale**3
    return BodyState(stage, own, UNKNOWN, volume, lambda _: UNKNOWN, (Choice(own, UNKNOWN),), proof)


def _scanned_body(observed: UnitBody, frame: Frame, work: Work, share: float) -> BodyState | None:
    """The program of a scanned body, judged by the points of its surface; its error is the volume in which it differs from the solid, which
    what a camera saw from one side does not have. None for a mesh that bounds no solid."""
    solid = find_solid(observed.target)
    if solid is None and observed.target.mesh is not None:
        return None
    from imdim.reconstruction.mdl import reconstruct_scan  # of clouds and scans: most meshes need not wait for it

    # few numbers are left to be fitted, and rounding is quick: the search may take longer than a cloud's
    times = work.budget.part_of("fit", share), work.budget.part_of("likely", share)
    likely = reconstruct_scan(observed, work.rng, *times, work.settings.language == "cad")
    if likely is None:
        return None
    found = scale_constraints(likely.constraints, 1 / frame.scale)
    ended = {"stop": CUT if likely.cut else "finished", "found": found, "noisy": True}
    if solid is None:
        return replace(_guessed_state(likely.program, frame, "solve", VIEWED), **ended)

    def measure(program: Program) -> float:
        made = to_manifold(frame.apply(program))
        return ((made - solid).volume() + (solid - made).volume()) / solid.volume()

    program = frame.undo(likely.program)
    error = measure(program)
    state = BodyState("solve", program, error, solid.volume() / frame.scale**3, measure, (Choice(program, error),), SCANNED)
    return replace(state, **ended)


def _seen_from_one_side(observed: UnitBody, frame: Frame, work: Work, share: float, certainly: bool = False) -> BodyState | None:
    """The program of a cloud as what a camera saw, the known one or a guessed one; None where there were several, where no place shows all
    of it, or it is not `certainly` of one side."""
    if observed.target.mesh is not None or not work.guesses or work.method not in METHODS.values():
        return None
    known = observed.target.scanners
    camera = guess_camera(observed.target.points) if known is None else known if len(known) == 1 else None
    if camera is None or (certainly and not certainly_one_side(observed.target.points, camera)):
        return None
    body = UnitBody.of(replace(observed.target, scanners=camera), work.rng)
    state = _scanned_body(body, frame, work, share)
    if state is None:
        return None
    if known is None:
        work.notes.append(f"{observed.target.name}: {FROM_ONE_SIDE}")
    return replace(state, noise=MeasuredNoise(body.noise.scale(1 / frame.scale), observed.kept))


def _guess(body: UnitBody, work: Work, share: float, cut: bool) -> tuple[MethodStep, tuple[Constraint, ...]] | None:
    """A program of a cloud from its points alone, and its relations; of a calm one only where time `cut` its detection short. None of a
    mesh, for which the policy need not be loaded."""
    if body.target.mesh is not None or not (cut or work.guesses):
        return None
    from imdim.reconstruction.mdl import reconstruct_unlabelled

    insists = work.settings.method == "policy"
    asked = work.guesses and (insists or time_to_propose(work.budget))
    drawn, times = work.settings.language == "cad", _noisy_times(work.budget, share)
    likely = reconstruct_unlabelled(body, work.policy if asked else None, *times, calm=cut, drawn=drawn, written=insists)
    if likely is None:
        return None
    step = MethodStep("policy", likely.program, UNKNOWN, proof=NO_TIME if cut else NO_INSIDE)
    return step.cut_if(cut or likely.cut or not asked), likely.constraints


def _noisy_times(budget: Budget, share: float) -> tuple[Deadline, Deadline]:
    """When the program of a noisy cloud must be chosen, and its numbers fitted; each may take a share of the time left."""
    return budget.part_of("choose", share), budget.part_of("likely", share)


def _solve(
    step: MethodStep, seen: Observation, choose_by: Deadline, fit_by: Deadline, settings: Settings, policy: PolicyOf
) -> tuple[MethodStep, tuple[Constraint, ...] | None]:
    """The step with fitted numbers; of a noisy cloud with a program of other primitives perhaps, which no proof is of, and with the
    relations that its points support."""
    if not seen.noisy:
        return replace(step, stage="solve", program=fit_numbers(step.program, seen, fit_by)), None
    from imdim.reconstruction.mdl import most_likely

    drawn = settings.language == "cad"
    likely = most_likely([*step.others, step.program], seen, choose_by, fit_by, drawn, policy, settings.evolution)
    return replace(step, stage="solve", program=likely.program, proof="").cut_if(likely.cut), likely.constraints


def _finish_state(last: BodyState, others: Sequence[Program], seen: Observation, frame: Frame, budget: Budget) -> BodyState:
    """The last state, its error measured, with its front, of which it alone is where time is short; `others` are in the unit frame."""
    unit = frame.apply(last.program)
    error = seen.error(unit)
    if budget.end_of("front").has_passed():
        return replace(last, error=error, front=(Choice(last.program, error),), stop=CUT)
    return replace(last, error=error, front=tuple(choices_beside(last.program, unit, others, seen.evidence, frame)))


def _state(step: MethodStep, seen: Observation, frame: Frame) -> BodyState:
    """A step in the body's units."""
    error = seen.error(step.program) if step.error is None else step.error
    volume = seen.cells.volume / frame.scale**3

    def measure(program: Program) -> float:
        return seen.error(frame.apply(program))

    front = tuple(replace(c, program=frame.undo(c.program)) for c in step.front)
    return BodyState(step.stage, frame.undo(step.program), error, volume, measure, front, step.proof, step.stop)


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
    stood = begin_in_round_walls(stood, deadline)
    return rounded if stood == flat else _snap(stood, seen, frame, deadline, placed)


def _snap(program: Program, seen: Observation, frame: Frame, deadline: Deadline, placed: Frame | None) -> Program:
    """The program with typed numbers: those of the world where the parts of a body that lies aslant were `placed` there."""
    if placed is None:
        return snap_numbers(program, seen, frame, deadline)
    return placed.apply(snap_numbers(turn_back(program, placed), seen, frame.within(placed), deadline))


def _arrange(program: Program, deadline: Deadline, drawn: bool) -> Program:
    """The same solid as a person writes it: cutters that end where they leave the part, turned parts as stacks and, where outlines may be
    `drawn`, by less than a whole turn in place of what a box cuts off, the body first and its cuts last, bodies that are cut in two as two,
    bosses that begin at the base, rails between posts, and cuts that end with what they cut, in the order of what they serve; as far as
    time allows."""
    if deadline.has_passed():
        return program
    # numbers that have become equal make one bore of two
    program = preserve(program, reduce_program(program, deadline=deadline), deadline=deadline)
    program = preserve(program, draw_back(program, deadline), deadline=deadline)
    program = preserve(program, turn_part_way(program), deadline=deadline) if drawn else program
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


def _mend_kind(program: Program, seen: Observation, frame: Frame, deadline: Deadline) -> Program:
    """The program, in the body's units, with what is open in its mesh open, and with no more bodies and voids than that, as far as time and
    moves of single faces allow."""
    opened = _open_films(program, seen, frame, deadline) or program
    solid = _solid_in(seen, frame)
    if solid is None or deadline.has_passed():
        return opened
    return close_voids(join_bodies(opened, solid, deadline), solid, deadline)


def _solid_in(seen: Observation, frame: Frame) -> Manifold | None:
    """The solid that the body's mesh bounds, in the body's units."""
    factor = 1 / frame.scale
    return None if seen.solid is None else seen.solid.scale((factor, factor, factor)).translate(frame.center)


def shows_edges(state: BodyState, target: Target) -> bool:
    """Whether fillets and chamfers of a target are looked for, whose faces points, open meshes and scans do not show."""
    return target.mesh is not None and target.is_solid and not state.noisy
