"""The methods by which one body's program is found: each a generator of better and better programs, all in the body's unit frame.

A method knows a `Run` and yields `Step`s; its last step is its answer, and no step at all means that it found nothing. Simplifying, fitting
and rounding come after it and are the same for all (`pipeline`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from imdim import stump_net as stump_nets
from imdim.body import SAMPLES, Seen
from imdim.clock import CHOOSE_BY, FIT_BY, Clock
from imdim.config import Settings
from imdim.evolution import evolved, logged, seeds_of
from imdim.fitting import POOR
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.proof import Proofs
from imdim.proposals import misfit, proposals
from imdim.search.counterexamples import Sharpener, seen_by
from imdim.search.evolve.population import EvolutionConfig, Generation
from imdim.search.sequence import to_program
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure
from imdim.search.tidy import tidy
from imdim.solve.pool import Cloud
from imdim.stump import stumps

if TYPE_CHECKING:
    from imdim.learn.policy import Policy

PolicyOf = Callable[[], "Policy | None"]

TOUCHED = 1e-2  # of the volume; a search that leaves more is followed by a short evolution, which mends little that is smaller
LONG = 40  # primitives; so is one whose program is this long, which evolution shortens
POOR_IF_CUT = 0.01  # of the volume; a search that was cut short and leaves more is compared with the decision tree
TOUCH = EvolutionConfig(generations=60, patience=10)
START_SHARE = 0.4  # of the search's time, after which its best starts get the rest
SEED_SHARE = 0.4  # of the search's time, that evolution gives to its seeds
WORTH_MORE = 0.5  # of a primitive's price; error that a search goes on for although no fewer primitives can do
NOISY_SHARE = 0.15  # of the time that the search has left: what the cells of a noisy cloud say is not worth more
PROPOSED_SHARE = 0.5  # of the time until numbers must be fitted, that the policy's programs may take
PROPOSE_S = 6.0  # what loading torch and writing a beam take of the processor; the solver works without it where less is left
FAR_BETTER = 0.5  # of the misfit of the search's program


@dataclass(frozen=True)
class Run:
    """One body to be explained: what is seen of it, and what the method may use. `share` is its part of the time left to the search."""

    seen: Seen
    settings: Settings
    policy: PolicyOf
    clock: Clock
    rng: np.random.Generator
    share: float = 1.0


@dataclass(frozen=True)
class Step:
    """A program. `error` is relative to the body's volume, None where the method does not know it.

    `others` are cruder and finer programs that a user may choose instead. `proof` says whether it is proved minimal, empty if nobody asked.
    """

    stage: str
    program: Program
    error: float | None = None
    others: tuple[Program, ...] = ()
    proof: str = ""


Method = Callable[[Run], Iterator[Step]]


def auto(run: Run) -> Iterator[Step]:
    """The structure search and a short evolution; the decision tree and the policy where these leave much; proofs, which end it early."""
    best: Step | None = None
    proofs = Proofs(run.seen, run.clock, run.share)
    for best in _searched_and_touched(run, proofs):
        yield best
    for source in (_grown_if_poor, _proposed_if_poor):
        better = source(run, best)
        if better is not None:
            best = better
            yield best
    if best is not None and run.settings.synthesis and not run.seen.noisy:
        yield _proved(best, proofs)


def tree(run: Run) -> Iterator[Step]:
    """The decision tree alone."""
    program = grown(run)
    if program is not None:
        yield Step("tree", program)


def policy(run: Run) -> Iterator[Step]:
    """The policy's beam and the solver alone."""
    yield Step("policy", _proposed(run, []))


def evolve(run: Run) -> Iterator[Step]:
    """Evolution from the programs of the policy, the tree, the surfaces and the search."""
    seen, written = run.seen, run.policy()
    beam = [] if written is None else [p.program for p in proposals(written, seen.target.points, seen.noise.sigma)]
    seeds = seeds_of(seen.evidence, run.rng, run.clock.part(SEED_SHARE * run.share), beam)
    for generation in _generations(run, seeds, run.clock.part(run.share)):
        run.clock.ending = generation.stop or run.clock.ending
        others = tuple(i.program for i in (*generation.front, generation.best))
        yield Step("evolve", generation.best.program, generation.best.score.volume, others)


def stump_net(run: Run) -> Iterator[Step]:
    """CSG-Stump Net's prediction, fitted to the body's samples, alone."""
    net = stump_nets.load(run.settings.stump_checkpoint)
    yield Step("stump-net", stump_nets.proposed(run.seen, net, run.settings.seed, run.clock.out_of_time))


def stump(run: Run) -> Iterator[Step]:
    """CSG-Stump's matrices by binary programming over detected primitives; the decision tree where none was detected."""
    passed: list[Program] = []
    for program in stumps(run.seen, run.clock.out_of_time):
        passed.append(program)
        yield Step("stump", program, others=tuple(passed))
    if not passed:
        yield from tree(run)


METHODS: dict[str, Method] = {
    "auto": auto,
    "evolve": evolve,
    "policy": policy,
    "stump": stump,
    "stump-net": stump_net,
    "tree": tree,
}


def _searched_and_touched(run: Run, proofs: Proofs) -> Iterator[Step]:
    passed: list[Program] = []
    for stage, program in _searched(run, proofs):
        passed.append(program)
        yield Step(stage, program, others=tuple(passed))
    for program in _touched(run, passed):
        passed.append(program)
        yield Step("evolve", program, others=tuple(passed))


def _searched(run: Run, proofs: Proofs) -> Iterator[tuple[str, Program]]:
    """Programs of the structure search, each better than the one before, until one is proved minimal."""
    seen, found, shortest = run.seen, None, None
    if not run.settings.synthesis:
        program = grown(run)
        if program is not None:
            yield "tree", program
        return
    out_of_time = run.clock.ending_at(NOISY_SHARE * run.share) if seen.noisy else run.clock.out_of_time
    price = seen.size_weight * seen.cells.volume
    sharpener = Sharpener(seen.families, seen.label, SAMPLES, price, run.rng) if seen.evidence.exact else None
    config, started = StructureConfig(size_weight=seen.size_weight), run.clock.part(START_SHARE * run.share)
    for found in search_structure(seen.families, config, run.rng, out_of_time, sharpener, started):
        program = to_program(found.sequence, found.families)
        yield "search", program
        # what the labels of a noisy cloud prove is not worth the time
        program, proof = (None if seen.noisy else proofs.early(program)) or (program, None)
        if proof and proof.program and (shortest is None or seen.price(program) < seen.price(shortest)):
            shortest = program
        if (proof and proof.minimal and proof.extra < WORTH_MORE) or (seen.noisy and out_of_time()):
            break
    if found is None:
        return
    # a range is as short as all cells that were ever seen allow
    every = sharpener.every if sharpener else found.families
    tidied = to_program(tidy(seen_by(found.sequence, every), every), every)
    if shortest is not None and seen.exact_price(shortest) < seen.exact_price(tidied):
        yield "proof", shortest
    else:
        yield "search", tidied


def _touched(run: Run, found: list[Program]) -> Iterator[Program]:
    """Fitter programs of a few generations that start from those the search passed through: what no signed sequence of candidates is.

    For a mesh, where the search left something or its program is long; in a cloud the doubts about what is inside outweigh it.
    """
    seen = run.seen
    if not (run.settings.evolution and found and seen.evidence.exact) or run.clock.out_of_time():
        return
    if seen.error(found[-1]) < TOUCHED and count(found[-1]).primitives < LONG:
        return
    best, least = seen.evidence.scorer.score(found[-1:])[0].fitness, seen.exact_price(found[-1])
    for generation in _generations(run, {"search": found}, run.clock.out_of_time, TOUCH):
        # what is not worth half a primitive is not worth another way to draw it
        if generation.best.score.fitness < best - 0.5 * seen.size_weight:
            best = generation.best.score.fitness
            price = seen.exact_price(generation.best.program)
            if price < least - 0.5 * seen.size_weight:
                least = price
                yield generation.best.program


def _generations(
    run: Run, seeds: dict[str, list[Program]], out_of_time: Callable[[], bool], config: EvolutionConfig | None = None
) -> Iterator[Generation]:
    generations = evolved(run.seen.evidence, seeds, run.rng, out_of_time, config, run.settings.solver)
    yield from logged(generations, run.settings.logdir, run.seen.target.name) if run.settings.logdir else generations


def _grown_if_poor(run: Run, best: Step | None) -> Step | None:
    """The decision tree's program, where there is nothing or much is left and it costs less.

    A noisy cloud's time is better spent on its points: the cells' doubts make the tree long.
    """
    seen = run.seen
    if best is not None and (seen.noisy or seen.error(best.program) <= (POOR_IF_CUT if run.clock.cut else POOR)):
        return None
    program = grown(run)
    if program is None or (best is not None and seen.price(program) >= seen.price(best.program)):
        return None
    return Step("tree", program) if best is None else replace(best, stage="tree", program=program)


def grown(run: Run) -> Program | None:
    """The decision tree's program."""
    return run.seen.evidence.tree(run.clock.ending_at(run.share, FIT_BY))


def _proposed_if_poor(run: Run, best: Step | None) -> Step | None:
    """The policy's program for a cloud, where there is nothing or much is left and it fits far better.

    The cells of a noisy cloud miss what detection missed: there it is always asked, and the points judge later (`noisy`).
    """
    seen = run.seen
    if seen.target.mesh is not None or (best is not None and not seen.noisy and seen.error(best.program) <= POOR):
        return None
    program = _proposed(run, [] if best is None else [best.program])
    if best is None:
        return Step("policy", program)
    if seen.noisy:
        return replace(best, others=(*best.others, program))
    return replace(best, stage="policy", program=program) if preferred(program, best.program, seen) else None


def _proved(best: Step, proofs: Proofs) -> Step:
    """The best with its proof, or a shorter program that the search for one met."""
    program, proof = proofs.of(best.program)
    others = (*best.others, best.program) if proof.program else best.others
    return replace(best, stage="proof", program=program, error=None, others=others, proof=str(proof))


def _proposed(run: Run, starts: list[Program]) -> Program:
    """The best that the solver makes of a policy's beam and of other programs."""
    seen, late = run.seen, run.clock.ending_at(PROPOSED_SHARE * run.share, FIT_BY)
    written = run.policy() if run.settings.method == "policy" or time_to_propose(run.clock) else None
    best, *_ = proposals(written, seen.target.points, seen.noise.sigma, starts, out_of_time=late)
    return best.program


def time_to_propose(clock: Clock) -> bool:
    """Whether there is time for a policy; that there was none stays known."""
    short = clock.left(CHOOSE_BY) < PROPOSE_S
    clock.late = clock.late or short
    return not short


def preferred(proposed: Program, program: Program, seen: Seen) -> bool:
    """Cells of a cloud know no surface that detection missed: what fits the points far better is taken, whatever its cells say."""
    cloud = Cloud.of(seen.target.points, seen.noise.sigma)
    return misfit(proposed, cloud) < FAR_BETTER * misfit(program, cloud)
