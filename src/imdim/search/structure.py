"""The structure search: from cells to the shortest signed sequence within tolerance.

Beams over best insertions under several prices, each completed greedily, then local search (`lns.py`), with the objective
error + size_weight * volume * primitives. All work is bounded by counts; a deadline only cuts it short.
Architects of this search: Du et al. 2018 (cells as specification), Friedrich et al. 2019 (objective with a size term).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.search.candidate_families import Families
from imdim.search.counterexamples import Sharpener, transfer
from imdim.search.lazy_bounds import GainBounds
from imdim.search.lns import LocalConfig, RatedSequence, complete, grow, improve, prune, rate_sequence
from imdim.search.pattern_steps import insert_patterns
from imdim.search.sequence import Insertion, Price, Sequence, cost, insertions, run
from imdim.side_process import SideProcess

_Finalist = tuple[RatedSequence, GainBounds]
_Sent = tuple[Sequence, float]  # a sequence and its objective, over families that who receives it has


@dataclass
class StructureConfig:
    """Limits and the price of a primitive, relative to the target's volume."""

    size_weight: float = 2.5e-4
    # Each schedule is a row of phases (weight of excess, weight of lack, price of a step in units of size_weight, kinds of candidates).
    # The true objective over all candidates ends each schedule.
    # Discounted excess covers the target first: hollow parts are a hull minus cavities. Dear lack then makes cuts pure: a row of holes
    # is not a slot with walls put back. Dear excess adds pure pieces only.
    schedules: tuple[tuple[tuple[float, float, float, str], ...], ...] = (
        (),
        ((0.3, 1.0, 40.0, "all"),),
        ((0.1, 1.0, 40.0, "all"), (1.0, 5.0, 1.0, "all")),
        ((0.02, 1.0, 40.0, "all"), (1.0, 20.0, 1.0, "all")),
        ((0.1, 1.0, 40.0, "curved"), (1.0, 5.0, 1.0, "all")),
        ((0.01, 1.0, 40.0, "curved"), (1.0, 20.0, 1.0, "all")),
        ((20.0, 1.0, 1.0, "all"),),
    )
    beam: int = 3
    branch: int = 3
    beam_steps: int = 3  # steps searched with the whole beam; the best states are then completed greedily
    finalists: int = 2  # states that get the local search
    start_work: float = 1e9  # cells summed, after which one more start is completed, of another schedule
    abandon: float = 1.2  # a completion whose steps alone cost this many times the best objective is given up
    per_frame: int = 4
    sharpened: int = 4  # times in a row that counterexamples are looked for, at most
    patterns: bool = True  # whether copies of a candidate are one step, at the price of one and its counts
    local_searches: int = 3  # each followed by a look for counterexamples
    local: LocalConfig = field(default_factory=LocalConfig)


def search(
    families: Families,
    config: StructureConfig,
    rng: np.random.Generator,
    deadline: Deadline,
    sharpener: Sharpener | None = None,
    start_by: Deadline | None = None,
    better_by: Callable[[RatedSequence], Deadline] = lambda _: NEVER,
) -> Iterator[RatedSequence]:
    """Yield better and better sequences; the last is the result. Yields at least one unless the target has no volume. What is independent
    is computed side by side where there is a second core, with the same result.

    Past `start_by` (by default the `deadline`) there is no further start, the foremost get the rest of the time, until `better_by` of the
    best at the latest. With a sharpener the cells are added on which these are wrong unseen, and what is found from then on is judged on
    them too.
    """
    exact = Price(config.size_weight * families.cells.volume)
    best: RatedSequence | None = None
    finalists: list[_Finalist] = []
    for done in _complete_starts(families, config, exact, deadline, start_by or deadline):
        finalists = _foremost([*finalists, done], config.finalists)
        if done[0].sequence and (best is None or done[0].objective < best.objective):
            best = done[0]
            yield best
    deadline = deadline if best is None else deadline.earlier(better_by(best))
    for again in range(config.local_searches if sharpener else 1):
        judged = _sharpen_finalists(finalists, sharpener, config, exact, deadline)
        if judged:
            finalists = judged
            best = min((found for found, _ in finalists), key=lambda f: f.objective)
            yield best
        elif again:
            return
        finalists = [_insert_patterns(done, config, exact, deadline) for done in finalists]
        for done, _ in finalists:
            if best is None or done.objective < best.objective * (1 - 1e-9):
                best = done
                yield best
        for i, found in _improve_each(finalists, config, exact, rng, deadline):
            finalists[i] = found, finalists[i][1]
            if best is None or found.objective < best.objective * (1 - 1e-9):
                best = found
                yield best
        finalists = _foremost(finalists, 1)


def _improve_each(
    finalists: list[_Finalist], config: StructureConfig, exact: Price, rng: np.random.Generator, deadline: Deadline
) -> Iterator[tuple[int, RatedSequence]]:
    """What local search makes of each, better and better, with its number: of the first here, of the others beside it."""
    given, streams = list(finalists), rng.spawn(len(finalists))

    def improved(numbers: Iterable[int]) -> Iterator[tuple[int, RatedSequence]]:
        return ((i, found) for i in numbers for found in improve(given[i][0], config.local, exact, streams[i], deadline, given[i][1]))

    def of_others(_: bool) -> Iterator[tuple[int, _Sent]]:
        return ((i, _send(found)) for i, found in improved(range(1, len(given))))

    if len(given) < 2:
        yield from improved(range(len(given)))
        return
    with SideProcess(of_others) as beside:
        yield from improved([0])
        for i, sent in beside:
            yield i, _receive(sent, given[i][0].families)


def _insert_patterns(done: _Finalist, config: StructureConfig, exact: Price, deadline: Deadline) -> _Finalist:
    """A completed sequence with what repeats as single steps, where these are asked for and pay."""
    found = insert_patterns(done[0], config.local, exact, deadline) if config.patterns and done[0].sequence else done[0]
    return (found, GainBounds()) if found.objective < done[0].objective else done


def _sharpen_finalists(
    finalists: list[_Finalist], sharpener: Sharpener | None, config: StructureConfig, exact: Price, deadline: Deadline
) -> list[_Finalist]:
    """The finalists completed over cells with counterexamples to them, again and again; none if no counterexample changes one."""
    changed, now = False, finalists
    for _ in range(config.sharpened if sharpener else 0):
        sharper = sharpener.sharpen([found for found, _ in now]) if sharpener and not deadline.has_passed() else None
        if sharper is None:
            break
        before, now = now, [_resume(found, sharper, config, exact, deadline) for found, _ in now]
        if all(a.sequence == b.sequence for (a, _), (b, _) in zip(before, now, strict=True)):
            break
        changed = True
    return now if changed else []


def _complete_starts(
    families: Families, config: StructureConfig, exact: Price, deadline: Deadline, start_by: Deadline
) -> Iterator[_Finalist]:
    """Each start completed and pruned, until that has been enough work or time; then one more, of another schedule."""
    least, end, enough = np.inf, deadline, False
    most = families.work + config.start_work
    for start in _starts(families, config, exact, start_by, lambda: families.work > most):
        known = GainBounds()
        done = prune(complete(start, config.local, exact, end, config.abandon * least, known), exact)
        yield done, known
        least, end = min(least, done.objective) if done.sequence else least, start_by
        if start_by.has_passed() or enough:
            return
        enough = families.work > most


def _resume(found: RatedSequence, families: Families, config: StructureConfig, exact: Price, deadline: Deadline) -> _Finalist:
    """A sequence judged, pruned and completed over other cells."""
    known = GainBounds()
    start = prune(rate_sequence(transfer(found.sequence, families), families, exact), exact)
    return prune(complete(start, config.local, exact, deadline, known=known), exact), known


def _foremost(completed: list[_Finalist], count: int) -> list[_Finalist]:
    """The best distinct ones."""
    ranked = sorted(completed, key=lambda c: c[0].objective)
    kept = _distinct([found for found, _ in ranked])[:count]
    return [c for c in ranked if any(c[0] is found for found in kept)]


def _starts(
    families: Families, config: StructureConfig, exact: Price, deadline: Deadline, hurried: Callable[[], bool]
) -> Iterator[RatedSequence]:
    """The beams of each schedule's first phase, carried through its phases; once `hurried`, only the first of each.

    Those of the first schedule are made here, and meanwhile those of the others beside it. Only of starts that are taken the work counts.
    """
    schedules = [[Price(step * exact.step, (excess, lack), kinds == "all") for excess, lack, step, kinds in s] for s in config.schedules]

    def starts_of(number: int, apart: bool) -> Iterator[tuple[int, int, RatedSequence, float]]:
        phases, before = schedules[number], families.work
        for place, state in enumerate(_beam(families, config, [*phases, exact][0], deadline)):
            if place and hurried():
                break
            for phase in phases:
                state = complete(rate_sequence(state.sequence, families, phase), config.local, phase, deadline)
            start, work = prune(rate_sequence(state.sequence, families, exact), exact), families.work - before
            if not apart:
                families.work = before
            yield number, place, start, work
            before = families.work

    def of_others(apart: bool) -> Iterator[tuple[int, int, float, _Sent]]:
        for number in range(1, len(schedules)):
            for _, place, start, work in starts_of(number, apart):
                yield number, place, work, _send(start)

    with SideProcess(of_others) as beside:
        received = ((number, place, _receive(sent, families), work) for number, place, work, sent in beside)
        seen: list[RatedSequence] = []
        left_out = -1
        for number, place, start, work in chain(starts_of(0, False), received):
            if number == left_out or (place and hurried()):
                left_out = number
                continue
            families.work += work
            if len(_distinct([*seen, start])) > len(seen):
                seen.append(start)
                yield start


def _send(found: RatedSequence) -> _Sent:
    """What of it another process does not have."""
    return found.sequence, found.objective


def _receive(sent: _Sent, families: Families) -> RatedSequence:
    return RatedSequence(*sent, families)


def _beam(families: Families, config: StructureConfig, price: Price, deadline: Deadline) -> list[RatedSequence]:
    states = [rate_sequence((), families, price)]
    for _ in range(config.beam_steps):
        wider = _widen(states, config, price)
        states = wider or states
        if not wider or deadline.has_passed():
            break
    return states


def _widen(states: list[RatedSequence], config: StructureConfig, price: Price) -> list[RatedSequence]:
    """The next beam: the best distinct states among the best insertions into each state, and the states that nothing improves."""
    wider = list(states)
    for state in states:
        found = insertions(state.sequence, state.families, config.per_frame if price.boxes else 0, price.step, price.weights)
        wider += [grow(state, i, price) for i in _diverse(found, config.branch)]
    wider.sort(key=lambda f: f.objective)
    kept = _distinct(wider)[: config.beam]
    return [] if kept == states else kept


def _diverse(found: list[Insertion], count: int) -> list[Insertion]:
    """The best insertion of each (operation, family) first, then the rest by gain."""
    seen, first, rest = set(), [], []
    for i in found[: 8 * count]:
        source = (i.op, getattr(i.shape, "source", None))
        (rest if source in seen else first).append(i)
        seen.add(source)
    return sorted([*first[:count], *rest[: count // 2]], key=lambda i: -i.gain)[: count + count // 2]


def _distinct(states: list[RatedSequence]) -> list[RatedSequence]:
    """One state for each set of filled cells and size, in the order given."""
    seen, out = set(), []
    for state in states:
        filled = run(state.sequence, len(state.families.cells.points))
        key = cost(state.sequence), np.packbits(filled).tobytes()
        if key not in seen:
            seen.add(key)
            out.append(state)
    return out
