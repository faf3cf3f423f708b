"""The methods by which one body's program is found: each a generator of better and better programs, all in the body's unit frame.

A method knows a `Run` and yields `MethodStep`s; its last step is its answer, and no step at all means that it found nothing. Simplifying,
fitting and rounding come after it and are the same for all (`pipeline`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from imdim.baselines import stump_net as stump_nets
from imdim.baselines.stump import stumps
from imdim.deadline import Deadline
from imdim.geometry.finish.rounded import draw_rounded
from imdim.geometry.solid import SEGMENTS, to_manifold
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.rewrite.bores import separate_bores, stack_drawings
from imdim.program.rewrite.cells import end_cuts_with_the_solid, propose_cells
from imdim.program.rewrite.rims import separate_rims
from imdim.program.rewrite.separation import separate_loops
from imdim.program.tree import Program, leaves
from imdim.reconstruction.bare_features import HIDDEN, lay_bare, tidy_cuts
from imdim.reconstruction.budget import Budget, Stage
from imdim.reconstruction.config import Settings
from imdim.reconstruction.delivery_time import leave_time_to_fit
from imdim.reconstruction.description import describe_bits
from imdim.reconstruction.design_events import PartBox
from imdim.reconstruction.evolution import evolve_observation, log_generations, seeds_of
from imdim.reconstruction.fitting import POOR
from imdim.reconstruction.observation import SAMPLES, Observation
from imdim.reconstruction.plain_program import MORE, SAME, has_drawings, is_hardly_longer, is_plainer, may_be_plain, repeats_plainly
from imdim.reconstruction.policy_beam import PolicyOf, has_time_for_beam, misfit, proposals
from imdim.reconstruction.preserve import is_same
from imdim.reconstruction.proof import DEARER, Proofs
from imdim.search.counterexamples import Sharpener, transfer
from imdim.search.decision_tree import DecisionTreeConfig
from imdim.search.evolve.population import EvolutionConfig, Generation
from imdim.search.layers import draw_layers, find_layers
from imdim.search.lns import LocalConfig, RatedSequence
from imdim.search.mdl.primitive_selection import Cloud
from imdim.search.minimal_ranges import tidy
from imdim.search.outline_areas import draw_area
from imdim.search.outline_families import area_of_walls
from imdim.search.sequence import to_program
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure

CUT = "budget_spent"  # how a method ended that time has cut short
TOUCHED = 1e-2  # of the volume; a search that leaves more is followed by a short evolution, which mends little that is smaller
LONG = 40  # primitives; so is one whose program is this long, which evolution shortens
POOR_IF_CUT = 0.01  # of the volume; a search that was cut short and leaves more is compared with the decision tree
# a tree has hundreds of primitives: so many are written and drawn in the time that is kept for any program, each more takes so long
WRITTEN, WRITTEN_S = 25, 0.05
LEAST_GROWTH = 0.1  # of the budget, that a tree may take however late it is
WRITABLE = 0.8  # cells, of which a tree grows for each primitive that there is time to write: some are two
TOUCH = EvolutionConfig(generations=60, patience=10)
WORTH_MORE = 0.5  # of a primitive's price; error that a search goes on for although no fewer primitives can do
BEYOND_DOUBT = 0.9  # times the bits, that a description has at most that is chosen: prices are counted in a few hundred designs
FITS_AS_WELL = 1e-5  # of IoU
FINELY = (SEGMENTS, 8 * SEGMENTS)  # of a circle, by which forms of one program are compared: arcs that end elsewhere have other corners
LEFT_OUT = 0.01  # of a body's surface: walls that are in no plane arrangement, from which on the body is drawn layer by layer
DRAWN_WITHIN = (2e-4, 4e-4, 8e-4, 1.6e-3)  # of the unit frame: how far the corners of layers may lie off their curves
FAR_BETTER = 0.5  # of the misfit of the search's program


@dataclass(frozen=True)
class Run:
    """One body to be explained: what is seen of it, and what the method may use. `share` is its part of the time that a stage has left.
    `blended` if fillets and chamfers other than those of round rims were set aside. `unit` is the length of the unit frame's unit in
    millimetres."""

    seen: Observation
    settings: Settings
    policy: PolicyOf
    budget: Budget
    rng: np.random.Generator
    share: float = 1.0
    blended: bool = False
    unit: float = 1.0

    def part_of(self, stage: Stage) -> Deadline:
        """When this body's part of the time is spent that the stage may take from now on."""
        return self.budget.part_of(stage, self.share)


@dataclass(frozen=True)
class MethodStep:
    """A program. `error` is relative to the body's volume, None where the method does not know it.

    `others` are cruder and finer programs that a user may choose instead, the `front` what is known of them so far. `proof` says
    whether it is proved minimal, empty if nobody asked. `stop` of the last step says how the method ended: "finished", CUT, and after an
    evolution "exact" or "stagnation".
    """

    stage: str
    program: Program
    error: float | None = None
    others: tuple[Program, ...] = ()
    proof: str = ""
    stop: str = "finished"
    front: tuple[Choice, ...] = ()

    def cut_if(self, cut: bool) -> MethodStep:
        """The step; where time has `cut` what would have bettered it, one that says so."""
        return replace(self, stop=CUT) if cut else self


Method = Callable[[Run], Iterator[MethodStep]]


def auto(run: Run) -> Iterator[MethodStep]:
    """The structure search and a short evolution; the decision tree and the policy where these leave much; proofs, which end it early.
    A body in layers that has more walls than a plane arrangement holds is drawn layer by layer instead.

    What the search draws is taken apart, and primitives alone are looked for, where that leaves hardly more to read; walls and bars become
    the pockets and windows between them, where these repeat.
    """
    best: MethodStep | None = None
    layered = _draw_layers(run)
    for best in _search_all(run) if layered is None else [layered]:
        yield best
    if best is not None and run.seen.noisy and run.settings.synthesis and run.settings.language == "cad":
        yield _with_primitives(run, best)
    # what has blends stays drawn: their edges lie between the walls of one drawing, and not between faces of many features
    if best is None or run.blended or not run.seen.evidence.exact:
        return
    if run.settings.counted == "primitives":
        fewer = _repeat_cells(run, best, lambda new, old: count(new).primitives < count(old).primitives)
        if fewer is not None:
            yield fewer
        return
    drawn = best

    def search_primitives(run: Run, best: MethodStep) -> MethodStep | None:
        return _search_primitives(run, drawn if has_drawings(best.program) else best, best)

    for source in (_separate, _separate_rims, search_primitives, _stack_drawings, _separate_bores):
        plain = source(run, best)
        if plain is not None and is_plainer(plain.program, best.program, run.seen):
            best = replace(plain, others=(*best.others, best.program, *plain.others))
            yield best
    bounds = run.seen.families.arrangement.bounds
    repeated = _repeat_cells(run, best, lambda new, old: repeats_plainly(new, old, *bounds))
    if repeated is not None:
        best = repeated
        yield best
    chosen = _choose_described(run, best)
    if chosen is not None:
        best = chosen
        yield best
    rounded = _draw_rounded(run, best)
    if rounded is not None:
        yield rounded


def _draw_layers(run: Run) -> MethodStep | None:
    """The sections of a body in layers, where their plane arrangement has not all of the walls, drawn as finely as is worth it."""
    seen, mesh = run.seen, run.seen.target.mesh
    if run.settings.language != "cad" or not run.settings.synthesis or mesh is None or seen.solid is None:
        return None
    layers = find_layers(np.asarray(mesh.face_normals), np.asarray(mesh.area_faces), seen.solid)
    if layers is None or layers.walls - area_of_walls(seen.families.arrangement, layers.axis) < LEFT_OUT * float(mesh.area):
        return None
    price = seen.size_weight * seen.solid.volume()
    drawn = [program for off in DRAWN_WITHIN if (program := draw_layers(layers, off, price, seen.curve * price)) is not None]
    best = min(drawn, key=seen.exact_price, default=None)
    if best is None or 1 - (seen.iou(best) or 0.0) > TOUCHED:
        return None
    return MethodStep("layers", best, others=tuple(program for program in drawn if program != best))


def _with_primitives(run: Run, best: MethodStep) -> MethodStep:
    """The best of a noisy cloud with, beside it, what primitives alone tell of its cells: which of them is likelier the points say later,
    and each search of theirs needs parts of its kind to begin with."""
    seen = run.seen.without_outlines
    alone = replace(run, seen=seen, rng=run.rng.spawn(1)[0])
    plain = _last(_search_and_touch_up(alone, Proofs(seen, run.budget, run.share)))
    return best if plain is None else replace(best, others=(*best.others, *plain.others, plain.program))


def _choose_described(run: Run, best: MethodStep) -> MethodStep | None:
    """Of programs without drawings that fit as well and have other features, the one with the shortest description, where it is shorter
    beyond doubt: of several short programs that the search met, what a designer would write."""
    deadline = run.budget.end_of("search")
    # the language of primitives alone is for comparisons by their count
    if run.settings.language != "cad" or has_outlines(best.program) or deadline.has_passed():
        return None
    fit = run.seen.iou(best.program)
    if fit is None:
        return None
    low, high = run.seen.families.arrangement.part
    part = PartBox(low, high, run.unit)
    least, chosen = BEYOND_DOUBT * describe_bits(best.program, part), None
    # ranges of one structure are settled by other rules
    of_its_own = (other for other in dict.fromkeys(best.others) if count(other).kinds != count(best.program).kinds)
    for other in of_its_own:
        if has_outlines(other) or deadline.has_passed() or (run.seen.iou(other) or 0.0) < fit - FITS_AS_WELL:
            continue
        if (bits := describe_bits(other, part)) < least:
            least, chosen = bits, other
    return None if chosen is None else replace(best, stage="search", program=chosen, others=(*best.others, best.program), proof="")


def _draw_rounded(run: Run, best: MethodStep) -> MethodStep | None:
    """The same with rounded rectangles and slots drawn, where it is the same."""
    if run.settings.language != "cad" or run.budget.end_of("search").has_passed():
        return None
    drawn = draw_rounded(best.program)
    if drawn == best.program or not is_same(best.program, drawn, HIDDEN, FINELY):
        return None
    return replace(best, stage="search", program=drawn, others=(*best.others, best.program), proof="")


def _repeat_cells(run: Run, best: MethodStep, is_better: Callable[[Program, Program], bool]) -> MethodStep | None:
    """The same with cavities in place of the walls between them, and plates with windows in place of bars, where this `is_better` than what
    it stands for: where it repeats and so there is less to read, or where it is fewer primitives."""
    drawn, deadline, solid = run.settings.language == "cad", run.budget.end_of("search"), None
    start = program = end_cuts_with_the_solid(best.program)
    found = True
    while found:
        found = False
        for proposal in propose_cells(program, draw_area):
            if deadline.has_passed():
                break
            if (has_outlines(proposal) and not drawn) or not is_better(proposal, program):
                continue
            if not is_same(start, proposal, HIDDEN, FINELY):
                continue
            solid = to_manifold(start) if solid is None else solid
            tidied = tidy_cuts(proposal, solid, deadline)
            if is_better(tidied, program):
                program, found = tidied, True
                break
    if program == start:
        return None
    return replace(best, program=program, others=(*best.others, best.program), proof="")


def _separate(run: Run, drawn: MethodStep) -> MethodStep | None:
    """The same with holes and islands of drawings as features of their own, and boxes for what looks like one from outside."""
    if not has_outlines(drawn.program):
        return None
    return replace(drawn, program=_lay_bare(run, drawn.program, drawn.program))


def _lay_bare(run: Run, apart: Program, drawn: Program) -> Program:
    return lay_bare(apart, drawn, run.seen.solid, run.budget.end_of("search"))


def _stack_drawings(run: Run, best: MethodStep) -> MethodStep | None:
    """The same with cylinders and cones in place of turned drawings."""
    return _change_drawings(run, best, stack_drawings)


def _separate_bores(run: Run, best: MethodStep) -> MethodStep | None:
    """The same with the bores of turned drawings as features of their own."""
    return _change_drawings(run, best, separate_bores)


def _change_drawings(run: Run, best: MethodStep, change: Callable[[Program], Program]) -> MethodStep | None:
    apart = change(best.program)
    return None if apart == best.program else replace(best, program=_lay_bare(run, apart, best.program))


def _separate_rims(run: Run, best: MethodStep) -> MethodStep | None:
    """The same with notches, teeth and lobes of rims as features of their own, and its loops too."""
    deadline, mesh, slack = run.budget.end_of("search"), run.seen.target.mesh, SAME * run.seen.size_weight
    if not has_outlines(best.program) or mesh is None or run.seen.solid is None:
        return None
    apart = separate_loops(best.program)

    def misfit(program: Program) -> float:
        if deadline.has_passed():
            return math.inf
        lost = (run.seen.iou(best.program) or 0.0) - (run.seen.iou(program) or 0.0)
        return min(lost, slack) if lost > slack and is_same(apart, program, slack) else lost

    parted = separate_rims(apart, misfit, slack, np.asarray(mesh.vertices))
    return None if parted == apart else replace(best, program=_lay_bare(run, parted, best.program))


def _search_primitives(run: Run, drawn: MethodStep, best: MethodStep) -> MethodStep | None:
    """What primitives alone tell, where they may instead of what is `drawn` and there is time to look for them. Where the best is the
    drawings taken apart, its features are plain, and more to read than there is in these is too much. Nothing is proved of what is too
    long to be taken for the `best`."""
    low, high = run.seen.families.arrangement.bounds
    if not (run.settings.synthesis and may_be_plain(drawn.program, low, high)) or run.part_of("starts").has_passed():
        return None
    # evolution shortens what is long, and a long program is not taken
    settings = replace(run.settings, evolution=False)
    alone = replace(run, seen=run.seen.without_outlines, settings=settings, rng=run.rng.spawn(1)[0])
    is_apart = best.program != drawn.program
    more = 1.0 if is_apart else MORE

    def is_wanted(program: Program) -> bool:
        return is_hardly_longer(program, best.program, low, high, more)

    found = _last(_search_all(alone, is_wanted, is_wanted if is_apart else _want_any))
    return found if found is not None and is_wanted(found.program) else None


def _last(steps: Iterator[MethodStep]) -> MethodStep | None:
    left = deque(steps, maxlen=1)
    return left.pop() if left else None


def _want_any(program: Program) -> bool:
    return True


def _search_all(
    run: Run, is_wanted: Callable[[Program], bool] = _want_any, is_promising: Callable[[Program], bool] = _want_any
) -> Iterator[MethodStep]:
    """What `auto` does with one set of candidates; a proof is looked for in the end where a program `is_wanted`, before that where one
    `is_promising`: it may find a shorter one."""
    best: MethodStep | None = None
    proofs = Proofs(run.seen, run.budget, run.share)
    for best in _search_and_touch_up(run, proofs, is_promising):
        yield best
    for source in (_grow_if_poor, _propose_if_poor):
        before, best = best, source(run, best)
        if best is not None and best != before:
            yield best
    if best is not None and run.settings.synthesis and not run.seen.noisy and not has_outlines(best.program) and is_wanted(best.program):
        yield _prove(best, proofs)


def tree(run: Run) -> Iterator[MethodStep]:
    """The decision tree alone."""
    deadline = run.part_of("fit")
    program = run.seen.evidence.tree(deadline)
    if program is not None:
        yield MethodStep("tree", program).cut_if(deadline.has_passed())


def policy(run: Run) -> Iterator[MethodStep]:
    """The policy's beam and the solver alone."""
    yield _propose(run, [])


def evolve(run: Run) -> Iterator[MethodStep]:
    """Evolution from the programs of the policy, the tree, the surfaces and the search."""
    seen, written = run.seen, run.policy()
    beam = [] if written is None else [p.program for p in proposals(written, seen.target.points, seen.noise.sigma)]
    seeds = seeds_of(seen.evidence, run.rng, run.part_of("seeds"), beam)
    yield from map(_step_of, _generations(run, seeds, run.part_of("search")))


def evolve_from(start: Program, config: EvolutionConfig) -> Method:
    """The method that evolves `start`, a program in the unit frame, alone."""
    return lambda run: map(_step_of, _generations(run, {"edited": [start]}, run.part_of("resume"), config))


def _step_of(generation: Generation) -> MethodStep:
    """The fittest of a generation, which need not be on its front."""
    best, others = generation.best, [i for i in generation.front if i.program != generation.best.program]
    front = tuple(Choice(i.program, i.score.volume) for i in sorted([*others, best], key=lambda i: i.score.primitives))
    programs = tuple(i.program for i in (*others, best))
    return MethodStep("evolve", best.program, best.score.volume, programs, stop=generation.stop or "finished", front=front)


def stump_net(run: Run) -> Iterator[MethodStep]:
    """CSG-Stump Net's prediction, fitted to the body's samples, alone."""
    net, deadline = stump_nets.load(run.settings.stump_checkpoint), run.budget.end_of("search")
    yield MethodStep("stump-net", stump_nets.propose_program(run.seen, net, run.settings.seed, deadline)).cut_if(deadline.has_passed())


def stump(run: Run) -> Iterator[MethodStep]:
    """CSG-Stump's matrices by binary programming over detected primitives; the decision tree where none was detected."""
    passed, deadline = list[Program](), run.budget.end_of("search")
    for program in stumps(run.seen, deadline):
        passed.append(program)
        yield MethodStep("stump", program, others=tuple(passed))
    if not passed:
        yield from tree(run)
    elif deadline.has_passed():
        yield MethodStep("stump", passed[-1], others=tuple(passed), stop=CUT)


METHODS: dict[str, Method] = {
    "auto": auto,
    "evolve": evolve,
    "policy": policy,
    "stump": stump,
    "stump-net": stump_net,
    "tree": tree,
}


def _search_and_touch_up(run: Run, proofs: Proofs, is_promising: Callable[[Program], bool] = _want_any) -> Iterator[MethodStep]:
    passed: list[Program] = []
    step: MethodStep | None = None
    for step in _search_structure(run, proofs, is_promising):
        passed.append(step.program)
        yield replace(step, others=tuple(passed))
    if step is not None:
        yield from _touch_up(run, replace(step, others=tuple(passed)))


def _search_structure(run: Run, proofs: Proofs, is_promising: Callable[[Program], bool] = _want_any) -> Iterator[MethodStep]:
    """Programs of the structure search, each better than the one before, until one that `is_promising` is proved minimal."""
    seen, found, shortest, enough = run.seen, None, None, False
    if not run.settings.synthesis:
        yield from tree(run)
        return
    deadline = run.part_of("noisy_search") if seen.noisy else run.budget.end_of("search")
    price = seen.size_weight * seen.cells.volume
    sharpener = Sharpener(seen.families, seen.label, SAMPLES, price, run.rng) if seen.evidence.exact else None
    patterns = seen.copies_once and seen.evidence.exact
    local = LocalConfig(kinds=not seen.copies_once)
    config, start_by = StructureConfig(size_weight=seen.size_weight, patterns=patterns, local=local), run.part_of("starts")

    end = deadline

    def better_by(found: RatedSequence) -> Deadline:
        nonlocal end
        if not seen.noisy and deadline.at < math.inf:
            end = leave_time_to_fit(to_program(found.sequence, found.families), deadline, run.part_of("fit"), run.budget.end)
        return end

    for found in search_structure(seen.families, config, run.rng, deadline, sharpener, start_by, better_by):
        if not found.sequence:  # in noise no cell of a thin part need be inside
            continue
        program = to_program(found.sequence, found.families)
        yield MethodStep("search", program)
        # what the labels of a noisy cloud prove is not worth the time
        is_asked = not (seen.noisy or has_outlines(program)) and is_promising(program)
        program, proof = (proofs.early(program) if is_asked else None) or (program, None)
        if proof and proof.program and (shortest is None or seen.price(program) < seen.price(shortest)):
            shortest = program
        enough = bool(proof and proof.minimal and proof.extra < WORTH_MORE)
        if enough or (seen.noisy and deadline.has_passed()):
            break
    if found is None or not found.sequence:
        return
    # of a noisy cloud the points are searched by in the end (`mdl`), and that search tells whether it was cut
    cut = end.has_passed() and not enough and not seen.noisy
    # a range is as short as all cells that were ever seen allow
    every = sharpener.every if sharpener else found.families
    tidied = to_program(tidy(transfer(found.sequence, every), every), every)
    if shortest is not None and seen.exact_price(shortest) < seen.exact_price(tidied):
        yield MethodStep("proof", shortest).cut_if(cut)
    else:
        yield MethodStep("search", tidied).cut_if(cut)


def _touch_up(run: Run, last: MethodStep) -> Iterator[MethodStep]:
    """Fitter programs of a few generations that start from those the search passed through, `last.others`: what no signed sequence of
    candidates is.

    For a mesh, where the search left something or its program is long; in a cloud the doubts about what is inside outweigh it. What is
    drawn stays: evolution makes many tilted primitives of a few curves.
    """
    seen, deadline = run.seen, run.budget.end_of("search")
    if not (run.settings.evolution and seen.evidence.exact) or has_outlines(last.program):
        return
    # what facets leave of curved surfaces, a program that is fitted to them only hides
    if seen.error(last.program) - seen.faceting < TOUCHED and count(last.program).primitives < LONG:
        return
    if deadline.has_passed():  # to score what cannot be bettered takes seconds where it is long
        yield last.cut_if(True)
        return
    best, least = seen.evidence.scorer.score([last.program])[0].fitness, seen.exact_price(last.program)
    for generation in _generations(run, {"search": list(last.others)}, deadline, TOUCH):
        # what is not worth half a primitive is not worth another way to draw it
        if generation.best.score.fitness < best - 0.5 * seen.size_weight:
            best = generation.best.score.fitness
            price = seen.exact_price(generation.best.program)
            if price < least - 0.5 * seen.size_weight:
                least = price
                last = replace(last, stage="evolve", program=generation.best.program, others=(*last.others, generation.best.program))
                yield last
    if deadline.has_passed():
        yield last.cut_if(True)


def _generations(
    run: Run, seeds: dict[str, list[Program]], deadline: Deadline, config: EvolutionConfig | None = None
) -> Iterator[Generation]:
    generations = evolve_observation(run.seen.evidence, seeds, run.rng, deadline, config, run.settings.solver)
    yield from log_generations(generations, run.settings.logdir, run.seen.target.name) if run.settings.logdir else generations


def _grow_if_poor(run: Run, best: MethodStep | None) -> MethodStep | None:
    """The best, or the decision tree's program, where there is nothing or much is left and it costs less.

    A noisy cloud's time is better spent on its points: the cells' doubts make the tree long.
    """
    seen = run.seen
    if best is not None and (seen.noisy or seen.error(best.program) <= (POOR_IF_CUT if best.stop == CUT else POOR) + seen.faceting):
        return best
    # where the search had no time the tree is all that is left, and a small one is grown in a moment
    fit_by, config = run.part_of("fit"), DecisionTreeConfig()
    deadline = fit_by.later(run.budget.within(LEAST_GROWTH * run.budget.whole_s))
    most = WRITABLE * (WRITTEN + max(run.budget.end.at - deadline.at, 0.0) / WRITTEN_S)
    program = seen.evidence.tree(deadline, replace(config, max_leaves=int(min(most, config.max_leaves))), of_some=True)
    # what time made smaller is another program at another hour
    cut = fit_by.has_passed() or most < config.max_leaves or not seen.evidence.has_time_for_all_cells(deadline)
    if best is None:
        return None if program is None else MethodStep("tree", program).cut_if(cut)
    if program is not None and WRITTEN_S * (count(program).primitives - WRITTEN) > run.budget.end.left():
        return best.cut_if(True)
    if program is None or seen.price(program) >= seen.price(best.program):
        return best.cut_if(cut)
    return replace(best, stage="tree", program=program).cut_if(cut)


def _propose_if_poor(run: Run, best: MethodStep | None) -> MethodStep | None:
    """The best, or the policy's program for a cloud, where there is nothing or much is left and it fits far better.

    Of a noisy cloud it is asked later, where the points judge (`mdl`).
    """
    seen = run.seen
    if seen.target.mesh is not None or (best is not None and (seen.noisy or seen.error(best.program) <= POOR)):
        return best
    proposed = _propose(run, [] if best is None else [best.program])
    if best is None:
        return proposed
    if prefers_proposal(proposed.program, best.program, seen):
        best = replace(best, stage="policy", program=proposed.program)
    return best.cut_if(proposed.stop == CUT)


def _prove(best: MethodStep, proofs: Proofs) -> MethodStep:
    """The best with its proof, or a shorter program that the search for one met; where copies that repeat stand in the way of either, the
    proof is about what is beside them."""
    program, proof = proofs.of(best.program)
    is_cheaper = proof.program is not None and proofs.seen.exact_price(program) <= proofs.seen.exact_price(best.program)
    if is_cheaper:
        best = replace(best, program=program, error=None, others=(*best.others, best.program))
    is_about_best = is_cheaper or proof.program is None
    if proof.minimal and is_about_best:
        return replace(best, stage="proof", proof=str(proof))
    said = proofs.beside_repeats(best.program) or (str(proof) if is_about_best else DEARER)
    return replace(best, stage="proof", proof=said)


def _propose(run: Run, starts: list[Program]) -> MethodStep:
    """The best that the solver makes of a policy's beam and of other programs."""
    deadline, asked = run.part_of("propose"), run.settings.method == "policy" or time_to_propose(run.budget)
    written = run.policy() if asked else None
    best, *_ = proposals(written, run.seen.target.points, run.seen.noise.sigma, starts, deadline=deadline)
    return MethodStep("policy", best.program).cut_if(deadline.has_passed() or not asked)


def has_outlines(program: Program) -> bool:
    """Whether there are outlines among the leaves, of which proofs know nothing."""
    return any(leaf.outline for leaf in leaves(program))


def time_to_propose(budget: Budget) -> bool:
    """Whether there is time for a policy."""
    return has_time_for_beam(budget.end_of("choose"))


def prefers_proposal(proposed: Program, program: Program, seen: Observation) -> bool:
    """Cells of a cloud know no surface that detection missed: what fits the points far better is taken, whatever its cells say."""
    cloud = Cloud.of(seen.target.points, seen.noise.sigma)
    return misfit(proposed, cloud) < FAR_BETTER * misfit(program, cloud)
