"""The structure search: from cells to the shortest signed sequence within tolerance.

Beam over best insertions, then local search that removes, replaces and re-inserts steps, with the objective
error / volume + size_weight * primitives. All work is bounded by counts; a deadline only cuts it short.
Architects of this search: Du et al. 2018 (cells as specification), Friedrich et al. 2019 (objective with a size term).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from imdim.search.families import Families
from imdim.search.sequence import Insertion, Sequence, cost, error, insert, insertions, pair_insertions, run


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
    finalists: int = 3  # states that get the local search
    abandon: float = 1.5  # a completion whose steps alone cost this many times the best objective is given up
    max_primitives: int = 120
    per_frame: int = 4
    pair_limit: int = 24
    local_rounds: int = 3


@dataclass(frozen=True)
class Found:
    """A sequence with its objective."""

    sequence: Sequence
    objective: float


@dataclass(frozen=True)
class _Price:
    """The objective of a phase: the price of a primitive in volume, and the weights of excess and lacking volume."""

    step: float
    weights: tuple[float, float] = (1.0, 1.0)
    boxes: bool = True


def search(families: Families, config: StructureConfig, out_of_time: Callable[[], bool]) -> Iterator[Found]:
    """Yield better and better sequences; the last is the result. Yields at least one unless the target has no volume."""
    exact = _Price(config.size_weight * families.cells.volume)
    best: Found | None = None
    completed: list[Found] = []
    for start in _starts(families, config, exact, out_of_time):
        limit = config.abandon * best.objective if best else np.inf
        done = _pruned(_complete(start, families, config, exact, out_of_time, limit), families, exact)
        completed.append(done)
        if done.sequence and (best is None or done.objective < best.objective):
            best = done
            yield best
        if out_of_time():
            return
    for start in sorted(_distinct(completed), key=lambda f: f.objective)[: config.finalists]:
        for improved in _improve(start, families, config, exact, out_of_time):
            if best is None or improved.objective < best.objective - 1e-12:
                best = improved
                yield best


def _starts(families: Families, config: StructureConfig, exact: _Price, out_of_time: Callable[[], bool]) -> Iterator[Found]:
    """The beams of each schedule's first phase, carried through its phases."""
    seen: list[Found] = []
    for schedule in config.schedules:
        phases = [_Price(step * exact.step, (excess, lack), kinds == "all") for excess, lack, step, kinds in schedule]
        for state in _beam(families, config, [*phases, exact][0], out_of_time):
            for phase in phases:
                state = _complete(_found(state.sequence, families, phase), families, config, phase, out_of_time)
            start = _pruned(_found(state.sequence, families, exact), families, exact)
            if len(_distinct([*seen, start])) > len(seen):
                seen.append(start)
                yield start


def _pruned(found: Found, families: Families, price: _Price) -> Found:
    """Without the steps that do not earn their price; later steps often make earlier ones idle."""
    i = len(found.sequence) - 1
    while i >= 0:
        shorter = _found(found.sequence[:i] + found.sequence[i + 1 :], families, price)
        if shorter.objective <= found.objective:
            found = shorter
            i = len(found.sequence)
        i -= 1
    return found


def _beam(families: Families, config: StructureConfig, price: _Price, out_of_time: Callable[[], bool]) -> list[Found]:
    states = [_found((), families, price)]
    for _ in range(config.beam_steps):
        wider = _widen(states, families, config, price)
        if not wider or out_of_time():
            break
        states = wider
    return states


def _found(sequence: Sequence, families: Families, price: _Price) -> Found:
    return Found(sequence, error(sequence, families, price.weights) + price.step * cost(sequence))


def _grown(found: Found, insertion: Insertion, families: Families, price: _Price) -> Found:
    return _found(insert(found.sequence, insertion, families), families, price)


def _widen(states: list[Found], families: Families, config: StructureConfig, price: _Price) -> list[Found]:
    """The next beam: the best distinct states among the best insertions into each state, and the states that nothing improves."""
    grown = list(states)
    for state in states:
        found = insertions(state.sequence, families, config.per_frame if price.boxes else 0, price.step, price.weights)
        grown += [_grown(state, i, families, price) for i in _diverse(found, config.branch)]
    grown.sort(key=lambda f: f.objective)
    kept = _distinct(grown)[: config.beam]
    return [] if kept == states else kept


def _diverse(found: list[Insertion], count: int) -> list[Insertion]:
    """The best insertion of each (operation, family) first, then the rest by gain."""
    seen, first, rest = set(), [], []
    for i in found[: 8 * count]:
        source = (i.op, getattr(i.term, "source", None))
        (rest if source in seen else first).append(i)
        seen.add(source)
    return sorted([*first[:count], *rest[: count // 2]], key=lambda i: -i.gain)[: count + count // 2]


def _distinct(states: list[Found]) -> list[Found]:
    """One state for each set of filled cells and size, in the order given."""
    seen, out = set(), []
    for state in states:
        key = (cost(state.sequence), np.packbits(run(state.sequence, len(state.sequence[0].mask))).tobytes() if state.sequence else b"")
        if key not in seen:
            seen.add(key)
            out.append(state)
    return out


def _complete(
    found: Found, families: Families, config: StructureConfig, price: _Price, out_of_time: Callable[[], bool], limit: float = np.inf
) -> Found:
    """Insert the best single step, or a pair where no single pays, until nothing pays or the steps alone cost more than `limit`."""
    while cost(found.sequence) < config.max_primitives and price.step * cost(found.sequence) < limit and not out_of_time():
        options = insertions(found.sequence, families, int(price.boxes), price.step, price.weights)[:1]
        if not options and price.weights == (1.0, 1.0):
            options = pair_insertions(found.sequence, families, 2 * price.step, config.pair_limit)[:1]
        if not options:
            break
        grown = _grown(found, options[0], families, price)
        if grown.objective >= found.objective * (1 - 1e-12):
            break
        found = grown
    return found


def _improve(
    found: Found, families: Families, config: StructureConfig, price: _Price, out_of_time: Callable[[], bool]
) -> Iterator[Found]:
    """Local search: drop each step, and pairs of steps, and refill greedily; keep what is better."""
    for _ in range(config.local_rounds):
        start = found
        for attempt in _attempts(start.sequence):
            if out_of_time():
                return
            if max(attempt) >= len(found.sequence):
                continue
            shorter = tuple(s for i, s in enumerate(found.sequence) if i not in attempt)
            refilled = _pruned(_refill(_found(shorter, families, price), found.objective, len(attempt), families, price), families, price)
            if refilled.objective < found.objective * (1 - 1e-9):
                found = refilled
                yield found
        if found is start:
            return


def _attempts(sequence: Sequence) -> list[tuple[int, ...]]:
    n = len(sequence)
    singles = [(i,) for i in range(n)]
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if n <= 10 or bool((sequence[i].mask & sequence[j].mask).any())]
    return singles + pairs[:60]


def _refill(trial: Found, goal: float, removed: int, families: Families, price: _Price) -> Found:
    """Put back at most as many steps as were removed, stopping as soon as the goal is beaten."""
    for _ in range(removed):
        if trial.objective < goal * (1 - 1e-9):
            break
        options = insertions(trial.sequence, families, 1, price.step)[:1]
        if not options:
            break
        trial = _grown(trial, options[0], families, price)
    return trial
