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
    beam: int = 4
    branch: int = 4
    beam_steps: int = 4  # steps searched with the whole beam; the best states are then completed greedily
    finalists: int = 2  # states that get the local search
    max_primitives: int = 120
    per_frame: int = 4
    pair_limit: int = 24
    local_rounds: int = 3


@dataclass(frozen=True)
class Found:
    """A sequence with its objective."""

    sequence: Sequence
    objective: float


def search(families: Families, config: StructureConfig, out_of_time: Callable[[], bool]) -> Iterator[Found]:
    """Yield better and better sequences; the last is the result. Yields at least one unless the target has no volume."""
    states = [Found((), _objective((), families, config))]
    best = states[0]
    for _ in range(config.beam_steps):
        states = _widen(states, families, config)
        if not states or out_of_time():
            break
        if states[0].objective < best.objective:
            best = states[0]
            yield best
    finalists = sorted([*states, best], key=lambda f: f.objective)[: config.beam]
    completed = []
    for start in finalists:
        done = _complete(start, families, config, out_of_time)
        completed.append(done)
        if done.objective < best.objective:
            best = done
            yield best
    for start in sorted(_distinct(completed, families), key=lambda f: f.objective)[: config.finalists]:
        for improved in _improve(start, families, config, out_of_time):
            if improved.objective < best.objective - 1e-12:
                best = improved
                yield best


def _objective(sequence: Sequence, families: Families, config: StructureConfig) -> float:
    return error(sequence, families) / families.cells.volume + config.size_weight * cost(sequence)


def _least(families: Families, config: StructureConfig) -> float:
    return config.size_weight * families.cells.volume


def _grown(found: Found, insertion: Insertion, families: Families, config: StructureConfig) -> Found:
    sequence = insert(found.sequence, insertion, families)
    return Found(sequence, _objective(sequence, families, config))


def _widen(states: list[Found], families: Families, config: StructureConfig) -> list[Found]:
    """The next beam: the best distinct states among the best insertions into each state."""
    grown = []
    for state in states:
        found = insertions(state.sequence, families, config.per_frame, _least(families, config))
        grown += [_grown(state, i, families, config) for i in _diverse(found, config.branch)]
    grown.sort(key=lambda f: f.objective)
    return _distinct(grown, families)[: config.beam]


def _diverse(found: list[Insertion], count: int) -> list[Insertion]:
    """The best insertion of each (operation, family) first, then the rest by gain."""
    seen, first, rest = set(), [], []
    for i in found[: 8 * count]:
        source = (i.op, getattr(i.term, "source", None))
        (rest if source in seen else first).append(i)
        seen.add(source)
    return sorted([*first[:count], *rest[: count // 2]], key=lambda i: -i.gain)[: count + count // 2]


def _distinct(states: list[Found], families: Families) -> list[Found]:
    seen, out = set(), []
    for state in states:
        key = np.packbits(run(state.sequence, len(families.cells.points))).tobytes()
        if key not in seen:
            seen.add(key)
            out.append(state)
    return out


def _complete(found: Found, families: Families, config: StructureConfig, out_of_time: Callable[[], bool]) -> Found:
    """Insert the best single step, or a pair where no single pays, until nothing pays."""
    least = _least(families, config)
    while cost(found.sequence) < config.max_primitives and not out_of_time():
        singles = insertions(found.sequence, families, 1, least)
        options = singles[:1] or pair_insertions(found.sequence, families, 2 * least, config.pair_limit)[:1]
        if not options:
            break
        grown = _grown(found, options[0], families, config)
        if grown.objective >= found.objective - 1e-12:
            break
        found = grown
    return found


def _improve(found: Found, families: Families, config: StructureConfig, out_of_time: Callable[[], bool]) -> Iterator[Found]:
    """Local search: drop each step, and each pair of steps, and refill greedily; keep what is better."""
    for _ in range(config.local_rounds):
        start = found
        for attempt in _attempts(start.sequence):
            if out_of_time():
                return
            shorter = tuple(s for i, s in enumerate(found.sequence) if i not in attempt)
            if max(attempt) >= len(found.sequence):
                continue
            trial = Found(shorter, _objective(shorter, families, config))
            refilled = _complete_to(trial, found.objective, len(attempt), families, config, out_of_time)
            if refilled.objective < found.objective - 1e-9:
                found = refilled
                yield found
        if found is start:
            return


def _attempts(sequence: Sequence) -> list[tuple[int, ...]]:
    n = len(sequence)
    singles = [(i,) for i in range(n)]
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if n <= 10 or bool((sequence[i].mask & sequence[j].mask).any())]
    return singles + pairs[:60]


def _complete_to(
    trial: Found, goal: float, removed: int, families: Families, config: StructureConfig, out_of_time: Callable[[], bool]
) -> Found:
    """Refill after a removal, with as many steps as were removed; more only while each still pays and the goal is in reach."""
    least = _least(families, config)
    for _ in range(removed):
        options = insertions(trial.sequence, families, 1, least)[:1]
        if trial.objective < goal - 1e-9 or not options or out_of_time():
            return trial
        trial = _grown(trial, options[0], families, config)
    return trial
