"""Local search for the program of a noisy cloud that has the shortest description of its points (MDL).

Detection sees what noise leaves of edges and small faces, and the search believes it. Here parts are put in, left out, exchanged, turned
from part to cut and moved in the order, by description length (`description_length`). What could be put in comes from outside
(`candidates`), from the places that the program does not explain (`candidates.residual`) and from its own parts. All single changes are
scored by one `batched_likelihood`; the numbers of the most promising are fitted, and the first that shortens the description is kept
(`local_search`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.sampling import subsample
from imdim.geometry.shadows import Shadows
from imdim.numbers.em import EMConfig, FittedProgram, maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.ties import have_same_shape
from imdim.program.cost import count
from imdim.program.paths import leaf_paths, without
from imdim.program.sequence import SignedSequence, Step, map_terms, to_program, to_sequence
from imdim.program.tree import Combine, Op, Primitive, Program, leaves, map_leaves
from imdim.search.mdl.batched_likelihood import BatchedLikelihood, PointScene
from imdim.search.mdl.candidates.blind_hole import blind_holes
from imdim.search.mdl.candidates.copies import CopyPlaces
from imdim.search.mdl.candidates.drawn import redraw, retrace
from imdim.search.mdl.candidates.half_round import half_rounds
from imdim.search.mdl.candidates.outline_step import step_lines
from imdim.search.mdl.candidates.residual import alternatives, hollows, missing, trim
from imdim.search.mdl.candidates.rim import rims
from imdim.search.mdl.candidates.shell_slot import shells, stadiums
from imdim.search.mdl.candidates.shortened import end_at_cuts
from imdim.search.mdl.candidates.span import layers, prolong, slots, span
from imdim.search.mdl.candidates.step import stepped
from imdim.search.mdl.candidates.tip import tips
from imdim.search.mdl.copying import Copying, CopySource, put_in
from imdim.search.mdl.description_length import PARALLEL_DEG, count_told, length_of
from imdim.search.mdl.local_search import Choice, FittingStage, improvements, merge
from imdim.search.mdl.moves import (
    TWIN,
    best_in_place,
    few_of_each,
    in_place_of,
    in_place_of_two,
    is_near,
    leave_twins,
    order_by_length,
    single_moves,
)
from imdim.search.mdl.part_tables import PartTableCache
from imdim.search.mdl.primitive_selection import Cloud, distinct
from imdim.side_process import map_beside

ROUNDS = 40
SEEN = 2048  # points that changes are looked at with
TRIED = 16  # changes whose numbers get a first step
FEWER = 2  # each so-manieth point for that
MEETING = 0.25  # of the smaller box
ASKED = 256  # badly explained points
FILLINGS, FILLED = 150, 0.04  # parts that may fill a hole, and the share of its points that they have at least
STILL, FEW = 0.5, 0.1  # deviations of the noise, and share of its points, by which a part may change and suggest the same
MOST_SOURCES = 12  # new parts that copies are made of
COPIES_S = 4.0  # that a first look at their places may take of the processor
COPIED = 8  # changes with copies whose numbers get a first step
# of the parts that were looked at: of seven that won a later round six were in the best tenth of the one before, one in the best fifth
BUSY = 0.25
STEPPED = 4  # parts in two steps whose numbers get a first step in any case
REFITTED = 4  # of them, whose numbers are fitted
LONGEST = 40  # steps of a sequence
SLACK = 0.05  # nats per point that a change may cost before its numbers are fitted
WORTH = 2e-3  # nats per point, what the samples of the surface leave in doubt; a change for fewer numbers need not be worth it
UNEXPLAINED = (3.0, 2.2)  # deviations of the noise
OWN = 3.0  # deviations of the noise, within which a primitive explains a point
BLURRED = 0.3  # deviations of the noise by which both skins of a wall must lie off their middle to be told from one
ALIKE = 4.0  # deviations of the noise by which sections of parts may differ that one part spans
TAPER = 0.05  # of a radius
FIRST = EMConfig(rounds=2, through=0.0, samples=4000)
REFIT = EMConfig(rounds=4, through=0.0)


def shorten(
    likely: FittedProgram,
    points: np.ndarray,
    candidates: Sequence[Program],
    axes: np.ndarray,
    deadline: Deadline,
    draws: PartTableCache | None = None,
    stand_for: int | None = None,
    sigma: float | None = None,
    steps: bool = True,
    filling: bool = False,
    copies: bool = False,
) -> Iterator[tuple[FittedProgram, float]]:
    """Programs that describe `points` [n, 3] in ever shorter ways, each after the best changes of a round, and how long they take.

    `axes` [3, 3] has the part's directions as columns. Sequences of more than LONGEST steps stay as they are. `draws` of the
    `tables_of_subsample` points keep for other calls what was computed for single parts. The points may `stand_for` a larger cloud.
    `sigma` is the deviation of their noise where the cloud itself has told it: in that of a program that runs between the skins of a thin
    wall is the wall. Parts may have `steps` that no single point shows. For `filling` a hole only the parts are put in whose surface has
    the most of the points that are badly explained: these are few, and a round is quick. With `copies` parts are put in with copies of
    them, too: for a program that has its large parts, since where these are missing small ones win by what they do not explain.
    """
    if deadline.has_passed():
        return
    draws = draws or tables_of_subsample(points, likely.noise.shadows)
    told = sigma or likely.noise.sigma
    changes = _Changes(Cloud.of(points, told), draws, candidates, axes, stand_for or len(points), steps, filling, copies, deadline)

    def fit(points: np.ndarray, config: EMConfig, most: float = math.inf) -> Callable[[_Trial], list[_Trial]]:
        return lambda trial: [trial.fitted(lambda p: maximise_likelihood(p, points, _limit(trial.likely.noise, most), config, deadline))]

    def lengths(tried: Sequence[_Trial]) -> list[float]:
        return [length_of(t.likely, stand_for or len(points)) for t in tried]

    start = _Trial(likely, (), (), ())
    tried = 1 + TRIED + STEPPED + copies * COPIED
    each = partial(map_beside, known=[likely.noise.shadows])
    stages = FittingStage(fit(points[::FEWER], FIRST, told), tried, each), FittingStage(fit(points, REFIT), 1 + REFITTED, each)
    best = start, lengths([start])[0]
    while changes.has_more_to_look_at() and not deadline.has_passed():
        for trial, length in improvements(best, changes.promising, stages, lengths, _worth, ROUNDS, deadline, _join, _are_alike):
            best = trial, length
            yield trial.likely, length


@dataclass(frozen=True)
class _Trial:
    """A program that one round of the search has tried: the sequence `choice` of `parts`, which have their fitted numbers in the `likely`
    program, and the choice `before` that it is a change of."""

    likely: FittedProgram
    choice: Choice
    parts: tuple[Program, ...]
    before: Choice

    def fitted(self, fit: Callable[[Program], FittedProgram]) -> _Trial:
        likely = fit(self.likely.program)
        new = leaves(likely.program)
        parts = tuple(map_leaves(part, lambda _, leaf: next(new)) for part in self.parts)
        return replace(self, likely=likely, parts=parts)


def _join(best: _Trial, other: _Trial) -> _Trial | None:
    """The best with the change that makes the other out of the sequence before."""
    choice = merge(best.choice, other.choice, best.before)
    if choice is None:
        return None
    part = {step.term: p for trial in (other, best) for step, p in zip(trial.choice, trial.parts, strict=True)}
    parts = tuple(part[step.term] for step in choice)
    program = to_program(tuple(Step(step.op, p) for step, p in zip(choice, parts, strict=True)))
    return _Trial(replace(best.likely, program=program), choice, parts, best.before)


def _are_alike(one: _Trial, other: _Trial) -> bool:
    """Whether two changes of one sequence put in parts that hardly differ, to the same end."""
    known = {step.term for step in one.before}
    (mine, its) = ([(s.op, p) for s, p in zip(t.choice, t.parts, strict=True) if s.term not in known] for t in (one, other))
    if len(mine) != 1 or len(its) != 1 or len(one.choice) != len(other.choice):
        return False
    (op, part), (did, twin) = mine[0], its[0]
    if op != did or not isinstance(part, Primitive) or not isinstance(twin, Primitive):
        return False
    return is_near(part, twin, TWIN * one.likely.noise.sigma)


def _limit(noise: Noise, most: float) -> Noise:
    """The noise, of a deviation of `most` at most."""
    return replace(noise, sigma=min(noise.sigma, most))


def _worth(best: _Trial, trial: _Trial) -> float:
    return 0.0 if count_told(trial.likely) < count_told(best.likely) else WORTH


def tables_of_subsample(points: np.ndarray, shadows: Shadows | None = None) -> PartTableCache:
    """The tables over a subsample of points [n, 3], with which changes are scored."""
    return PartTableCache(subsample(points, SEEN), shadows)


def best_by_mdl(programs: Sequence[Program], draws: PartTableCache, noise: Noise, most: int) -> list[Program]:
    """The `most` of `programs`, as they are, with the shortest descriptions of the points of `draws` in such noise."""
    scene = PointScene(draws, noise)
    lengths = BatchedLikelihood.of(scene, [], programs).lengths([(Step("union", i),) for i in range(len(programs))])
    return [programs[i] for i in np.argsort(lengths, kind="stable")[:most]]


@dataclass(frozen=True)
class _Guesses:
    """What was guessed from parts, with these, what they did and how many points they had: a part that hardly moved suggests the same, and
    the tables know it."""

    made: list[tuple[Primitive, Op, int, list[Program]]]

    def recall(self, part: Primitive, op: Op, count: int, sigma: float) -> list[Program]:
        """What was guessed from a part like this one, empty where there was none."""
        alike = (
            out for old, did, had, out in self.made if did == op and abs(had - count) <= FEW * count and is_near(old, part, STILL * sigma)
        )
        return next(alike, [])

    def keep(self, part: Primitive, op: Op, count: int, guesses: list[Program]) -> list[Program]:
        """The guesses, which are now known."""
        self.made.append((part, op, count, guesses))
        return guesses


@dataclass
class _Look:
    """The last look at what a program could become: by how much each part had `gained` at best, and whether it `is_partial`, without those
    that had done little; before the first one none was looked at."""

    gained: dict[Program, float] = field(default_factory=dict)
    is_partial: bool = True

    def leave_idle(self, parts: list[Program]) -> list[Program]:
        """The parts that are new, would hardly have lengthened the description before, or were among the BUSY share of those known."""
        known = [self.gained[part] for part in parts if part in self.gained]
        least = min(-SLACK, float(np.quantile(known, 1 - BUSY, method="lower"))) if known else -math.inf
        busy = [part for part in parts if self.gained.get(part, math.inf) >= least]
        self.is_partial = len(busy) < len(parts)
        return busy

    def note_gains(self, parts: Sequence[Program], own: Mapping[int, range], lengths: np.ndarray) -> None:
        """Note by how much each part shortens the description at best in its `own` moves, by the `lengths` of start and moves."""
        for term, its in own.items():
            self.gained[parts[term]] = float(lengths[0] - lengths[its.start + 1 : its.stop + 1].min(initial=np.inf))


@dataclass(frozen=True)
class _Changes:
    """What a program of a `cloud` could become: its parts, the `candidates` and guesses along `axes`, judged by the points of `draws`,
    which stand for so many as `count`; `steps` that no single point shows are looked for or not, for `filling` a hole only what has
    points of it, and parts are put in with their `copies` or not."""

    cloud: Cloud
    draws: PartTableCache
    candidates: Sequence[Program]
    axes: np.ndarray
    count: int
    steps: bool
    filling: bool = False
    copies: bool = False
    deadline: Deadline = NEVER
    _known: _Guesses = field(default_factory=lambda: _Guesses([]))
    _drawn_anew: list[tuple[Primitive, int]] = field(default_factory=list)
    _lined: list[tuple[Op, Primitive]] = field(default_factory=list)
    _took: list[float] = field(default_factory=list)
    _stepped: set[Program] = field(default_factory=set)
    _last: _Look = field(default_factory=_Look)

    def has_more_to_look_at(self) -> bool:
        """Whether parts were left out of the last look at all, or there was none: the next look is at all of them."""
        self._last.gained.clear()
        return self._last.is_partial

    def promising(self, found: _Trial) -> list[_Trial]:
        """The program itself and changed ones, not fitted, the shortest description first; none of sequences of more than LONGEST steps.

        The program competes with its changes, fitted as far as they are, so that none wins by what further fitting is worth alone.
        Parts that did little in the last look are left out of the next ones, until none of the others shortens it.
        """
        best = found.likely
        steps = to_sequence(best.program, apart=True)
        self._last.is_partial = False
        if len(steps) > LONGEST:
            return []
        spans, retraced = self._spans(best, steps), self._retraced(best, steps)
        offered = [*self._guesses(best, steps), *self.candidates]
        offered = self._last.leave_idle(self._fillings(best, offered) if self.filling else offered)
        compound = [p for p in offered if isinstance(p, Combine)]
        others = [
            *distinct([p for p in offered if isinstance(p, Primitive)], self.cloud),
            *compound,
            *_drop_leaves(steps),
            *retraced,
            *spans,
        ]
        scene = PointScene(self.draws, _limit(best.noise, self.cloud.noise), self.count)
        mixture = BatchedLikelihood.of(scene, [part for _, part in steps], others)
        start: Choice = tuple(Step(op, i) for i, (op, _) in enumerate(steps))
        begin = len(mixture.parts) - len(spans) - len(retraced)
        meet = [{*np.flatnonzero(row).tolist()} for row in self._meet(mixture)]
        moves, own = single_moves(mixture, start, meet)
        moves += [c for at, part in enumerate(spans, len(mixture.parts) - len(spans)) for c in in_place_of(spans[part], at, start)]
        anew = [(*start[:at], Step(start[at].op, term), *start[at + 1 :]) for term, at in enumerate(retraced.values(), begin)]
        explained, numbers = mixture.explain([start, *moves])
        lengths = explained + numbers * scene.number
        self._last.note_gains(mixture.parts, own, lengths)
        if pairs := [c for term in own if term < begin for c in in_place_of_two(term, mixture.parts, moves, own[term], lengths, start)]:
            more, counts = mixture.explain([start, *pairs])
            explained, lengths = np.append(explained, more[1:]), np.append(lengths, (more + counts * scene.number)[1:])
            moves += pairs
        better = [moves[i - 1] for i in order_by_length(lengths) if lengths[i] < lengths[0] + SLACK]
        kept = [*itertools.islice(few_of_each(leave_twins(better, mixture.parts, start, best.noise.sigma), len(start)), TRIED)]
        # how far sides lie apart is told too small by points that lie nearer to the other side
        in_steps = (best_in_place(moves, own[term], lengths, start) for term in own if mixture.parts[term] in self._stepped)
        kept += itertools.islice((choice for choice in in_steps if choice is not None and choice not in kept), STEPPED)
        # what is drawn anew may lie a little off everywhere: only fits tell its worth
        drawn_anew, fit = [self._trial(best, choice, mixture.parts, start) for choice in anew], self._fit(best.noise)
        fitted = map_beside(lambda trial: trial.fitted(fit), drawn_anew, [best.noise.shadows])
        copied = self._copied(best, steps, mixture, (moves, explained)) if self.copies and self._has_time_for_copies() else []
        itself = self._trial(best, start, mixture.parts, start)
        return [itself, *fitted, *copied, *(self._trial(best, choice, mixture.parts, start) for choice in kept)]

    def _copied(
        self, best: FittedProgram, steps: SignedSequence[Program], mixture: BatchedLikelihood, moves: tuple[Sequence[Choice], np.ndarray]
    ) -> list[_Trial]:
        """The program with parts and their copies, the most promising first; `moves` are those by single parts, with what the points take
        before them all and after each."""
        start: Choice = tuple(Step(op, i) for i, (op, _) in enumerate(steps))
        shapes: list[tuple[Op, Primitive]] = []
        for op, part in steps:
            if isinstance(part, Primitive) and not any(op == did and have_same_shape(part, old, best.noise.sigma) for did, old in shapes):
                shapes.append((op, part))
        sources = [CopySource(part, op, len(steps), frozenset(), True, self._is_new(part, op)) for op, part in shapes]
        sources += itertools.islice(self._new_sources(mixture, len(start), *moves), MOST_SOURCES)
        places = CopyPlaces.of(best.program, self.cloud.points, self.axes, best.noise.sigma, PARALLEL_DEG)
        length, out, begun = mixture.lengths([start])[0], [], self.deadline.now()
        copied = Copying(mixture.scene, steps, places, self.deadline).find(sources, COPIED)
        self._took.append(self.deadline.now() - begun)
        for number, found in enumerate(copied, len(mixture.parts)):
            if found.length < length + SLACK:
                choice = put_in(start, number, found.op, found.at, found.gone)
                parts = tuple(found.parts if term == number else mixture.parts[term] for _, term in choice)
                program = to_program(tuple(Step(op, part) for (op, _), part in zip(choice, parts, strict=True)))
                out.append(_Trial(replace(best, program=program), choice, parts, start))
        return out

    def _has_time_for_copies(self) -> bool:
        """Whether there is time for the look at all places of copies, which is not cut short: the first takes the longest."""
        return self.deadline.left() > max(self._took, default=COPIES_S)

    def _new_sources(
        self, mixture: BatchedLikelihood, settled: int, moves: Sequence[Choice], explained: np.ndarray
    ) -> Iterator[CopySource]:
        """New parts of single moves that explain something, whatever they cost, the most first; each once."""
        twins, worth = list[Primitive](), explained[0] - explained[1:]
        for k in np.argsort(-worth, kind="stable")[: np.count_nonzero(worth > 0)]:
            choice = moves[k]
            place = next((i for i, step in enumerate(choice) if step.term >= settled), None)
            if place is None or not isinstance(part := mixture.parts[choice[place].term], Primitive):
                continue
            if any(is_near(part, old, self.cloud.noise) for old in twins):
                continue
            twins.append(part)
            at = choice[place + 1].term if place + 1 < len(choice) else settled
            op, gone = choice[place].op, frozenset(range(settled)) - {s.term for s in choice}
            yield CopySource(part, op, at, gone, False, self._is_new(part, op))

    def _is_new(self, part: Primitive, op: Op) -> bool:
        """Whether rows of a part like this were not looked for; they are from now on."""
        if any(op == did and is_near(part, old, self.cloud.noise) for did, old in self._lined):
            return False
        self._lined.append((op, part))
        return True

    def _fit(self, noise: Noise) -> Callable[[Program], FittedProgram]:
        return lambda program: maximise_likelihood(program, self.cloud.points, noise, REFIT, self.deadline)

    def _fillings(self, best: FittedProgram, parts: list[Program]) -> list[Program]:
        """The parts by whose surfaces the most of the points lie that are badly explained."""
        far = OWN * best.noise.sigma
        hole = subsample(self.cloud.points[np.abs(kernels.program_sdf(best.program, self.cloud.points)) > far], ASKED)
        filled = np.array([np.count_nonzero(np.abs(kernels.program_sdf(p, hole)) < far) for p in parts])
        most = np.argsort(-filled, kind="stable")[:FILLINGS]
        return [parts[i] for i in sorted(most) if filled[i] >= FILLED * len(hole)]

    def _meet(self, mixture: BatchedLikelihood) -> np.ndarray:
        """Whether a good part of the box of each part, or of that of a settled one, is in the other, bool [p, settled]: what lies elsewhere
        does no work of it."""
        low, high = mixture.bounds
        low, high, settled = low - self.cloud.noise, high + self.cloud.noise, mixture.settled
        shared = np.minimum(high[:, None], high[:settled]) - np.maximum(low[:, None], low[:settled])
        volumes = (high - low).prod(1)
        return np.maximum(shared, 0.0).prod(2) > MEETING * np.minimum(volumes[:, None], volumes[:settled])

    def _trial(self, best: FittedProgram, choice: Choice, parts: Sequence[Program], before: Choice) -> _Trial:
        chosen = map_terms(choice, parts.__getitem__)
        return _Trial(replace(best, program=to_program(chosen)), choice, tuple(part for _, part in chosen), before)

    def _spans(self, best: FittedProgram, steps: SignedSequence[Program]) -> dict[Primitive, list[tuple[int, ...]]]:
        """Parts that could do the work of several steps, with these; the first of them is the one that each is made of."""
        out: dict[Primitive, list[tuple[int, ...]]] = {}
        for wanted in ("union", "difference"):
            boxes = {i: p for i, (op, p) in enumerate(steps) if op == wanted and isinstance(p, Primitive) and p.kind == "box"}
            for box, those in layers(boxes, ALIKE * best.noise.sigma):
                out.setdefault(box, []).append(those)
        for i, (op, part) in enumerate(steps):
            others = [j for j, other in enumerate(steps) if j != i and other.op == op]
            if not isinstance(part, Primitive):
                continue
            if op == "union":
                cuts = {j: p for j, (did, p) in enumerate(steps) if j > i and did == "difference" and isinstance(p, Primitive)}
                for short, gone in end_at_cuts(part, cuts, best.noise.sigma):
                    out.setdefault(short, []).append((i, *gone))
            for long in prolong(part, self.cloud) if op == "difference" else ():
                out.setdefault(long, []).extend((i, j) for j in others)
            for j in others:
                other = steps[j].term
                if isinstance(other, Primitive) and (both := span(part, other, ALIKE * best.noise.sigma)) is not None:
                    out.setdefault(both, []).append((i, j))
        return out

    def _retraced(self, best: FittedProgram, steps: SignedSequence[Program]) -> dict[Primitive, int]:
        """Steps with outlines drawn anew through the points that they explain, and where they stand; none of an outline that has hardly
        moved since it was tried, and explains as many points."""
        points, sigma = self.cloud.points, best.noise.sigma
        outlines = [(i, part) for i, (_, part) in enumerate(steps) if isinstance(part, Primitive) and part.outline is not None]
        if not outlines:
            return {}
        leaf, value, _, _ = kernels.program_tangent(best.program, points)
        firsts = np.cumsum([0, *(count(part).primitives for _, part in steps)])
        near = np.abs(value) < OWN * sigma
        out: dict[Primitive, int] = {}
        for i, part in outlines:
            own = near & (leaf == firsts[i])
            number = int(own.sum())
            if any(abs(had - number) <= FEW * number and is_near(part, old, STILL * sigma) for old, had in self._drawn_anew):
                continue
            self._drawn_anew.append((part, number))
            out |= dict.fromkeys(retrace(part, points[own], sigma), i)
        return out

    def _guesses(self, best: FittedProgram, steps: SignedSequence[Program]) -> list[Program]:
        """What might be missing, and other shapes for the points of each primitive of the sequence."""
        cloud, axes, sigma = self.cloud, self.axes, best.noise.sigma
        # deep in a thin plate nothing is far from its surface
        out: list[Program] = [p for far in UNEXPLAINED for p in missing(best.program, cloud, axes, far * sigma)]
        leaf, value, _, _ = kernels.program_tangent(best.program, cloud.points)
        near, first = np.abs(value) < OWN * sigma, 0
        for op, part in steps:
            own = near & (leaf == first)
            first += count(part).primitives
            if isinstance(part, Primitive):
                out += self._known.recall(part, op, int(own.sum()), sigma) or self._known.keep(
                    part, op, int(own.sum()), self._guesses_from(part, op, own, value, sigma)
                )
        return out

    def _guesses_from(self, part: Primitive, op: Op, own: np.ndarray, value: np.ndarray, sigma: float) -> list[Program]:
        """Other shapes for the `own` points, by mask [n], of a part, and what might be missing in it; all points have distances `value` [n]
        from the program."""
        cloud, own_points, out = self.cloud, self.cloud.points[own], list[Program]()
        others = alternatives(own_points, self.axes, cloud)
        out += [*trim(part, own_points), *others, *_taper(part)]
        out += [*stadiums(part, sigma), *redraw(part), *blind_holes(part, cloud.points, sigma), *tips(part, cloud, sigma)]
        two = [*stepped(part, own_points, sigma), *step_lines(part, own_points, sigma)] if self.steps else []
        self._stepped.update(two)
        out += two
        if op == "difference":
            out += slots(part, cloud)
        if op == "union" and own.any():
            out += [cut for round_part in (part, *others) for cut in half_rounds(round_part, own_points, self.axes, sigma)]
            out += [*_hollow(part, value[own], cloud, min(cloud.noise, sigma)), *rims(part, cloud.points, sigma)]
        return out


def _hollow(part: Primitive, value: np.ndarray, cloud: Cloud, sigma: float) -> list[Program]:
    """The part's cavities, and walls about its skin where the distances `value` [m] of its points from it are more than noise."""
    half = float(np.sqrt(max(np.mean(value**2) - sigma**2, 0.0)))
    walls = shells(part, 2 * half, cloud, sigma) if half > BLURRED * sigma else ()
    return [*walls, *hollows(part, float(np.median(np.abs(value))), cloud)]


def _taper(part: Primitive) -> Iterator[Primitive]:
    """Cones in the place of a cylinder, a little wider at either end."""
    if part.kind == "cylinder":
        radius, height = part.size
        for by in (TAPER, -TAPER):
            yield Primitive("cone", (radius * (1 - by), radius * (1 + by), height), part.center, part.rotation)


def _drop_leaves(steps: SignedSequence[Program]) -> Iterator[Program]:
    """Parts that are no primitives, each without one of their leaves."""
    for _, part in steps:
        if isinstance(part, Combine):
            yield from (less for path, _ in leaf_paths(part) if (less := without(part, [path])) is not None)
