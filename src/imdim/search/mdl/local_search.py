"""One local search for any objective: propose changes by a quick score, fit the numbers of the best, keep the first that pays.

What is proposed are mostly single changes of a signed sequence, and the quick score is a pass over tables of what depends on one part
alone. A sequence then has the indices of parts as its terms: a choice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from imdim.deadline import Deadline
from imdim.program.sequence import SignedSequence, Step
from imdim.program.tree import Op

S = TypeVar("S")
T = TypeVar("T")

Choice = SignedSequence[int]
Objective = Callable[[Sequence[S]], Sequence[float]]  # of several states at once: they may be judged by common samples
TURNED: Mapping[Op, Op] = {"union": "difference", "difference": "union"}


class FittingStage(NamedTuple, Generic[S]):
    """The `most` foremost trials are fitted; `fit` gives what becomes of one, itself included where it may stay as it is. As `map` does,
    `each` gives what a function does for each of several trials."""

    fit: Callable[[S], Sequence[S]]
    most: int
    each: Callable[[Callable[[S], Sequence[S] | None], Sequence[S]], Iterable[Sequence[S] | None]] = map


def search_locally(
    start: tuple[S, float],
    propose: Callable[[S], Sequence[S]],
    stages: Sequence[FittingStage[S]],
    objective: Objective[S],
    worth: Callable[[S, S], float],
    rounds: int,
    deadline: Deadline,
) -> tuple[S, float]:
    """The last state of `improvements`: one that nothing proposed improves, and its objective."""
    return deque([start, *improvements(start, propose, stages, objective, worth, rounds, deadline)], maxlen=1).pop()


def improvements(
    start: tuple[S, float],
    propose: Callable[[S], Sequence[S]],
    stages: Sequence[FittingStage[S]],
    objective: Objective[S],
    worth: Callable[[S, S], float],
    rounds: int,
    deadline: Deadline,
    join: Callable[[S, S], S | None] | None = None,
    alike: Callable[[S, S], bool] | None = None,
) -> Iterator[tuple[S, float]]:
    """States, each better than the one before, with their objectives, until nothing proposed improves; `start` has both.

    `propose` gives changed states, the most promising first. Each of the `stages` fits the foremost and ranks them anew. The first whose
    objective is lower than the best's by more than `worth(best, trial)` takes its place. Of a round that time cuts short in its last stage
    what is fitted by then may do so; one that is cut before changes nothing. What else improved the state before is tried on top:
    `join(best, trial)` gives the best with the trial's change too, None where there is no such state, and the last of the stages fits it.
    Of states that a stage makes `alike` the next fits the best alone.
    """
    best, cost = start
    for _ in range(rounds):
        if deadline.has_passed():
            return
        trials = [(trial, np.inf) for trial in propose(best)]
        for stage in stages[:-1]:
            trials = _rank([trial for trial, _ in trials], stage, objective, deadline)
            trials = _leave_apart(trials, alike) if alike else trials
        trials = _rank([trial for trial, _ in trials], stages[-1], objective, deadline, some=True)
        better = [(trial, after) for trial, after in trials if after < cost - worth(best, trial)]
        if not better:
            return
        (best, cost), *others = better
        for other, _ in others:
            joined = join(best, other) if join else None
            both = _rank([joined], stages[-1], objective, deadline) if joined else []
            best, cost = next(((trial, after) for trial, after in both if after < cost - worth(best, trial)), (best, cost))
        yield best, cost


def _leave_apart(trials: Sequence[tuple[S, float]], alike: Callable[[S, S], bool]) -> list[tuple[S, float]]:
    """The trials that are like none of those before them that are left."""
    left: list[tuple[S, float]] = []
    for trial, cost in trials:
        if not any(alike(other, trial) for other, _ in left):
            left.append((trial, cost))
    return left


def _rank(
    trials: Sequence[S], stage: FittingStage[S], objective: Objective[S], deadline: Deadline, some: bool = False
) -> list[tuple[S, float]]:
    """What becomes of the foremost trials, the best first; where there is no time to fit them all, of those that are fitted if `some` are
    enough, and nothing otherwise."""
    fitted, late = list[S](), False

    def fit(trial: S) -> Sequence[S] | None:
        nonlocal late
        late = late or deadline.has_passed()  # a deadline that has passed is not asked again
        return None if late else stage.fit(trial)

    for found in stage.each(fit, trials[: stage.most]):
        if found is None:
            if not some:
                return []
            break
        fitted += found
    return sorted(zip(fitted, objective(fitted), strict=True), key=itemgetter(1)) if fitted else []


def own_moves(sequence: SignedSequence[T]) -> Iterator[SignedSequence[T]]:
    """Leave one step out, turn a union into a cut or a cut into a union, move a step to another place."""
    for i, step in enumerate(sequence):
        rest = sequence[:i] + sequence[i + 1 :]
        if _proper(rest):
            yield rest
        turned = (*sequence[:i], Step(TURNED[step.op], step.term), *sequence[i + 1 :])
        if _proper(turned):
            yield turned
        for j in range(len(sequence)):
            moved = (*rest[:j], step, *rest[j:])
            if j != i and _proper(moved):
                yield moved


def uses(term: T, sequence: SignedSequence[T], instead: Collection[int] | None = None) -> Iterator[SignedSequence[T]]:
    """Put a term that is not there yet in at the end or before the closing run of cuts, or in the place of another, by default of any, of
    those steps that it may stand `instead` of."""
    if any(step.term == term for step in sequence):
        return
    closing = len(sequence)
    while closing and not sequence[closing - 1].positive:
        closing -= 1
    for at in sorted({closing, len(sequence)}):
        for op in TURNED:
            yield (*sequence[:at], Step(op, term), *sequence[at:])
    for i, step in enumerate(sequence):
        if instead is None or i in instead:
            yield (*sequence[:i], Step(step.op, term), *sequence[i + 1 :])


def merge(ours: SignedSequence[T], theirs: SignedSequence[T], before: SignedSequence[T]) -> SignedSequence[T] | None:
    """`ours` with what `theirs` puts in, leaves out and turns, both being changes of the sequence `before`; None where that changes
    nothing or begins with a cut. Terms stand in a sequence once; changes of their order are left out."""
    was, has = {step.term: step for step in before}, {step.term: step for step in theirs}
    turned = {term: step for term, step in has.items() if term in was and was[term] != step}
    out = [turned.get(step.term, step) for step in ours if step.term in has or step.term not in was]
    for i, step in enumerate(theirs):
        terms = [s.term for s in out]
        if step.term not in was and step.term not in terms:
            behind = next((terms.index(s.term) + 1 for s in reversed(theirs[:i]) if s.term in terms), 0)
            out.insert(behind, step)
    merged = tuple(out)
    return merged if _proper(merged) and merged != ours else None


def _proper(sequence: SignedSequence[T]) -> bool:
    return bool(sequence) and sequence[0].positive


def pack_choices(choices: Sequence[Choice]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths int64 [c], indices int64 [c, w], -1 behind the end of a choice, and whether each is united, bool [c, w]."""
    lengths = np.array([len(choice) for choice in choices], np.int64)
    there = np.arange(lengths.max(initial=0)) < lengths[:, None]
    index, united = np.full(there.shape, -1, np.int64), np.zeros(there.shape, bool)
    index[there] = [step.term for choice in choices for step in choice]
    united[there] = [step.op == "union" for choice in choices for step in choice]
    return lengths, index, united
