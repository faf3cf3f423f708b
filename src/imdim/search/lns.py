"""Moves on one sequence: greedy completion, pruning, and a local search that removes related steps and refills the hole.

The local search is a large neighbourhood search (Shaw 1998): a step and some that touch it are removed, the hole is refilled under
a price drawn at random (pure cuts first, pure pieces first, or the true one), and the result stays if it is no worse. Where each copy is
paid for, all steps of one kind are removed at once, too: twelve windows are fewer steps as a cavity with five bars, and four corners that
are rounded off one by one may be as a plate that is drawn round.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imdim.deadline import Deadline
from imdim.search.candidate_families import Candidate, Families
from imdim.search.cells import CUTS, HULLS, PIECES, TRUE, Weights
from imdim.search.lazy_bounds import GainBounds, apart, best_insertions, insert_all
from imdim.search.sequence import (
    Insertion,
    Pair,
    Price,
    Sequence,
    Shape,
    Shaped,
    cost,
    error,
    error_of,
    expense,
    insert,
    pair_insertions,
    run,
    shapes_of,
    without_one,
)

WEIGHTS = (TRUE, CUTS, PIECES, HULLS)  # under which holes are refilled
PURE = (20.0, 1.0)  # and those of all steps of a kind: many pieces that are a little too large are much too large together
MANY = 3  # steps of one kind, from which they are removed at once
_Removal = tuple[tuple[int, ...], Weights | None]  # numbers of steps; the weights to refill under, None for any


@dataclass
class LocalConfig:
    """Limits of completion and local search."""

    max_primitives: int = 120
    pair_limit: int = 24
    large: float = 3e5  # cells times groups of families, from which several steps are inserted at once: faster, and a little longer
    alike: float = 0.7  # of the best gain, from which steps that do not touch it are then inserted with it
    rounds: int = 600  # of removal and refill, at most
    work: float = 3e7  # cells times steps times rounds; large parts get fewer rounds
    least_rounds: int = 40
    patience: float = 0.3  # of the rounds, without an improvement, before it ends
    most_removed: int = 4
    kinds: bool = False  # whether all steps of one kind are removed at once, too: not where copies are paid for once


@dataclass(frozen=True)
class RatedSequence:
    """A sequence over the cells of families, with its objective there."""

    sequence: Sequence
    objective: float
    families: Families


def rate_sequence(sequence: Sequence, families: Families, price: Price) -> RatedSequence:
    """The sequence with its objective under `price`."""
    return RatedSequence(sequence, error(sequence, families, price.weights) + expense(sequence, families, price), families)


def grow(found: RatedSequence, insertion: Insertion, price: Price) -> RatedSequence:
    """One step more."""
    return rate_sequence(insert(found.sequence, insertion, found.families), found.families, price)


def complete(
    found: RatedSequence, config: LocalConfig, price: Price, deadline: Deadline, limit: float = np.inf, known: GainBounds | None = None
) -> RatedSequence:
    """Insert the best single step, or a pair where no single pays, until nothing pays or the steps alone cost more than `limit`."""
    known, families = known or GainBounds(), found.families
    share = config.alike if len(families.cells.points) * families.groups > config.large else 1.0
    while (primitives := cost(found.sequence)) < config.max_primitives and price.step * primitives < limit and not deadline.has_passed():
        options = best_insertions(found.sequence, families, price, known, share)
        if not options and price.weights == TRUE:
            options = _pairs(found.sequence, families, config, price, known, share)
        longer = rate_sequence(insert_all(found.sequence, apart(options, families)), families, price)
        if longer.objective >= found.objective * (1 - 1e-12):
            break
        found = longer
    return found


def _pairs(sequence: Sequence, families: Families, config: LocalConfig, price: Price, known: GainBounds, share: float) -> list[Insertion]:
    """The best pairs at the end of the sequence, as far as it is worth to ask again."""
    state = run(sequence, len(families.cells.points))
    if known.no_pair(state, known.sums_of(families, price)[0], 0.5 * price.step):
        return []
    pairs = pair_insertions(sequence, families, 2 * price.step, config.pair_limit, share)
    if not pairs:
        known.put_no_pair(state)
    return pairs


def prune(found: RatedSequence, price: Price) -> RatedSequence:
    """Without the steps that do not earn their price; later steps often make earlier ones idle."""
    while (shorter := _without_idle(found, price)) is not None:
        found = shorter
    return found


def _without_idle(found: RatedSequence, price: Price) -> RatedSequence | None:
    """Without the last step that does not earn its price, None where all do."""
    steps, families = found.sequence, found.families
    whole = expense(steps, families, price)
    for i, filled in without_one(steps, len(families.cells.points)):
        objective = error_of(filled, families, price.weights) + whole - expense(steps[i : i + 1], families, price)
        if objective <= found.objective:
            return RatedSequence(steps[:i] + steps[i + 1 :], objective, families)
    return None


def improve(
    found: RatedSequence, config: LocalConfig, price: Price, rng: np.random.Generator, deadline: Deadline, completed: GainBounds
) -> Iterator[RatedSequence]:
    """Yield better and better sequences; `completed` is what their completion learned."""
    idle = 0
    known = {weights: GainBounds() for weights in (*WEIGHTS, PURE)} | {price.weights: completed}
    attempts = _first_removals(found.sequence, config)
    size = max(1, len(found.sequence) * len(found.families.cells.points))
    rounds = int(np.clip(config.work / size, config.least_rounds, config.rounds))
    worse: set[tuple[tuple[int, ...], Weights]] = set()  # moves of the sequence as it is
    # of sequences that are as good each leads to others and back again, by moves that were tried; None is what was worse
    tried: dict[tuple[tuple[Shaped, ...], tuple[int, ...], Weights], RatedSequence | None] = {}
    for _ in range(rounds):
        if deadline.has_passed() or not found.sequence or idle >= config.patience * rounds + len(attempts):
            return
        removed, said = attempts.pop(0) if attempts else (_choose_related(found.sequence, config, rng), None)
        weights = said or (WEIGHTS[int(rng.integers(len(WEIGHTS)))] if len(removed) > 1 else price.weights)
        if (removed, weights) in worse:  # few steps are soon chosen again, and end as they did
            idle += 1
            continue
        move, branches = (shapes_of(found.sequence), removed, weights), {}
        if move not in tried:
            branches = {under: bounds.branch() for under, bounds in known.items()}
            trial = _refill(found, removed, weights, config, price, deadline, branches)
            trial = found if shapes_of(trial.sequence) == move[0] else trial
            tried[move] = trial if trial.objective <= found.objective else None
        trial = tried[move]
        better = trial is not None and trial.objective < found.objective * (1 - 1e-9)
        idle = 0 if better else idle + 1
        # the numbers of all of a kind, which come first, are those in this sequence and in no other that is as good
        if trial is None or (said and not better):
            worse.add((removed, weights))
        else:
            found, worse = trial, set()
            for under, branch in branches.items():
                known[under].adopt(branch)
            attempts = attempts if not better else _first_removals(found.sequence, config)
        if better:
            yield found


def _first_removals(sequence: Sequence, config: LocalConfig) -> list[_Removal]:
    """What is removed of a new sequence first: all steps of a kind, under each weighting, and then each step alone."""
    singles: list[_Removal] = [((i,), None) for i in range(len(sequence))] if len(sequence) <= 40 else []
    kinds = _removals_by_kind(sequence) if config.kinds else []
    return [*((removed, weights) for removed in kinds for weights in (*WEIGHTS, PURE)), *singles]


def _removals_by_kind(sequence: Sequence) -> list[tuple[int, ...]]:
    """The numbers of all steps of each kind of which there are many, alone and with the step of another operation that shares most cells
    with them: what they are cut from, or go into."""
    kinds: defaultdict[tuple[str, ...], list[int]] = defaultdict(list)
    for i, step in enumerate(sequence):
        kinds[step.op, *_kind(step.term.shape)].append(i)
    out: list[tuple[int, ...]] = []
    for (op, *_), members in kinds.items():
        if len(members) >= MANY:
            covered = np.logical_or.reduce([sequence[i].term.mask for i in members])
            shared = {i: int((step.term.mask & covered).sum()) for i, step in enumerate(sequence) if step.op != op}
            host = max(shared, key=lambda i: (shared[i], -i), default=None)
            out += [tuple(members), *([] if host is None else [tuple(sorted([*members, host]))])]
    return out


def _kind(shape: Shape) -> tuple[str, ...]:
    if isinstance(shape, Candidate):
        return (shape.source[0],)
    return (shape.op, shape.left.source[0], shape.right.source[0]) if isinstance(shape, Pair) else ("pattern",)


def _choose_related(sequence: Sequence, config: LocalConfig, rng: np.random.Generator) -> tuple[int, ...]:
    """A random step with up to `most_removed` - 1 others, those that share cells with it first."""
    n = len(sequence)
    seed = int(rng.integers(n))
    count = min(n, int(rng.integers(2, config.most_removed + 1)))
    shared = np.array([float((s.term.mask & sequence[seed].term.mask).sum()) for s in sequence]) * rng.random(n) + 1e-3 * rng.random(n)
    shared[seed] = np.inf
    return tuple(sorted(int(i) for i in np.argsort(-shared, kind="stable")[:count]))


def _refill(
    found: RatedSequence,
    removed: tuple[int, ...],
    weights: Weights,
    config: LocalConfig,
    price: Price,
    deadline: Deadline,
    known: dict[Weights, GainBounds],
) -> RatedSequence:
    """The sequence with some steps taken out and the hole filled again, under `weights` first where it is large, pruned."""
    shorter, families = tuple(s for i, s in enumerate(found.sequence) if i not in removed), found.families
    if len(removed) > 1:
        phase = Price(price.step * (10.0 if weights[0] < 1 else 1.0), weights)
        start = rate_sequence(shorter, families, phase)
        shorter = _steps(start, len(removed) - 1, phase, known[phase.weights]).sequence
    filled = _steps(rate_sequence(shorter, families, price), len(removed) + 1, price, known[price.weights])
    trial = prune(filled, price)
    if trial.objective < found.objective * 1.2:
        trial = prune(complete(trial, config, price, deadline, 1.2 * found.objective, known[price.weights]), price)
    return trial


def _steps(found: RatedSequence, count: int, price: Price, known: GainBounds) -> RatedSequence:
    """Up to `count` best single insertions that pay."""
    for _ in range(count):
        options = best_insertions(found.sequence, found.families, price, known)
        if not options:
            break
        found = grow(found, options[0], price)
    return found
