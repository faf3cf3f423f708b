"""Snap a program's numbers to what a person would have typed, wherever the error does not grow.

Rotations become canonical and round, values that nearly agree become equal, and each takes the coarsest decimal grid that it bears;
outlines come last, each as a whole.
Proposals are tried all at once and halved where they fail, so that a program whose numbers are nearly round costs few evaluations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.numbers.design_values import (
    THIRD,
    Values,
    clusters,
    coarsest_widths,
    decimal,
    equal_groups,
    grids,
    round_to_grid,
    round_to_thirds,
    span,
    typed_widths,
)
from imdim.numbers.inches import are_inches
from imdim.numbers.outline_values import snap_leaf
from imdim.numbers.shared_rotations import round_together
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.tree import ANGLED, FULL_TURN, Primitive, Program, leaves, map_leaves

S = TypeVar("S")
C = TypeVar("C")

OUTLINE_SHARES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001)  # of the largest move, by which an outline is rounded
SAME_DEG = 0.05  # within which leaves have the same directions, and turn together
ANGLE_STEPS = (15.0, 5.0, 1.0, 0.1)  # degrees


@dataclass
class SnapConfig:
    """Lengths are shares of the program's span."""

    rel_tolerance: float = 0.03  # the error may grow by this share
    abs_tolerance: float = 0.0  # and by this much, in the error's own unit
    max_deg: float = 3.0  # a rotation turns by no more
    max_move: float = 3e-3  # a value moves by no more
    finest: float = 1e-5  # the last grid is about this wide
    reviews: int = 12  # bold roundings of one grid that are looked at singly
    tries: int = 32  # evaluations that one round of proposals may cost
    max_calls: int = 300  # evaluations in all
    equalise: bool = True  # whether values that nearly agree are made equal, on no other evidence
    precision: float = 0.0  # in the program's unit, by which a mesh's places are off at most: values that it keeps off a grid were typed


def snap(
    program: Program,
    error: Callable[[Program], float],
    *,
    config: SnapConfig | None = None,
    deadline: Deadline = NEVER,
) -> Program:
    """The program with rounder numbers whose `error` is at most that of `program` grown by the tolerances.

    Past the `deadline` (by default never) nothing more is rounded. Grids are 1 or 5 times a power of ten, and fractions of an inch where
    the numbers tell of these.
    """
    config = config or SnapConfig()
    program = map_leaves(program, lambda _, p: canonical(p))
    judge = _SnapJudge(program, error, config, deadline)
    parts = _snap_rotations(list(leaves(program)), judge, config)
    values = Values.of(parts)
    largest, inches = span(parts), are_inches(parts)
    # five times a power of ten may be as wide as the finest where that is not
    widths = [width for width in grids(largest, config.finest * largest / 2, inches) if width >= config.finest * largest]
    typed = frozenset[float]()
    if config.precision:
        values, typed = _settle_typed(values, judge, config, grids(largest, config.precision, inches))
    for share in (0.1, 0.3, 1.0) if config.equalise else ():
        changes = clusters(values, share * config.max_move * largest, typed)
        values = accept_changes(values, changes, Values.with_numbers, judge.bears, config.tries)
    values = _round(values, judge, config, widths, largest, typed)
    return _rebuilt(program, _snap_outlines(tuple(values.primitives()), judge, config, largest, inches))


class _SnapJudge:
    """Tells whether a candidate's error stays within the limit; a spent budget says no.

    What is accepted lowers the limit: error that one rounding saves is not there for the next to spend.
    """

    def __init__(self, program: Program, error: Callable[[Program], float], config: SnapConfig, deadline: Deadline) -> None:
        self.program, self.error, self.config, self.deadline = program, error, config, deadline
        self.left, self.limit = config.max_calls, float("inf")
        self.current = error(program)
        self.limit = self.error_limit(self.current)

    def error_limit(self, error: float) -> float:
        return min(self.limit, error * (1 + self.config.rel_tolerance) + self.config.abs_tolerance)

    def error_of(self, parts: Sequence[Primitive]) -> float:
        self.left -= 1
        if self.left >= 0 and self.deadline.has_passed():
            self.left = -1  # which is not to be asked again for each of many proposals
        return self.error(_rebuilt(self.program, parts)) if self.left >= 0 else float("inf")

    def bears(self, values: Values) -> bool:
        parts = values.primitives_or_none()
        return parts is not None and self.bears_parts(parts)

    def bears_parts(self, parts: Sequence[Primitive]) -> bool:
        error = self.error_of(parts)
        if error > self.limit:
            return False
        self.current, self.limit = error, self.error_limit(error)
        return True


def accept_changes(state: S, changes: Sequence[C], apply: Callable[[S, C], S], bears: Callable[[S], bool], tries: int) -> S:
    """`state` after those of `changes` that `bears` allows: all at once if possible, else by halves, in at most `tries` trials."""
    todo = [list(changes)] if changes else []
    while todo and tries > 0:
        batch = todo.pop()
        trial = state
        for change in batch:
            trial = apply(trial, change)
        tries -= 1
        if bears(trial):
            state = trial
        elif len(batch) > 1:
            half = len(batch) // 2
            todo += [batch[half:], batch[:half]]
    return state


def _snap_rotations(parts: list[Primitive], judge: _SnapJudge, config: SnapConfig) -> list[Primitive]:
    """Offer leaves of the same directions their rounder rotations, rank by rank; those that took one are done."""
    offers = round_together(parts, SAME_DEG, config.max_deg)
    current = tuple(parts)
    for rank in range(max(map(len, offers), default=0)):
        changes = [o[rank] for o in offers if rank < len(o) and all(current[i] == parts[i] for i in o[rank])]
        current = accept_changes(current, changes, _put_all, judge.bears_parts, config.tries)
    return list(current)


def _snap_outlines(
    parts: tuple[Primitive, ...], judge: _SnapJudge, config: SnapConfig, largest: float, inches: bool
) -> tuple[Primitive, ...]:
    """Outlines rounded as boldly as they bear, and the angles that they turn by or that their walls lean at."""
    start = parts
    for share in OUTLINE_SHARES:
        # to a few digits: a bold small share and a timid large one are one question, which is answered once
        slack = float(f"{share * config.max_move * largest:.6g}")
        offers = [(i, snap_leaf(p, slack, inches, config.precision)) for i, p in enumerate(parts) if p is start[i] and p.outline]
        offers = [(i, leaf) for i, leaf in offers if leaf != parts[i]]
        parts = accept_changes(parts, offers, _put, judge.bears_parts, config.tries)
    for step in ANGLE_STEPS:
        angled = [(i, p.size[-1]) for i, p in enumerate(parts) if p.kind in ANGLED and p.size[-1] == start[i].size[-1]]
        round_ones = [(i, angle, decimal(round(angle / step) * step)) for i, angle in angled]
        close = [(i, new) for i, old, new in round_ones if 0 < abs(new - old) <= config.max_deg and 0 < new <= FULL_TURN]
        offers = [(i, leaf) for i, new in close if (leaf := _with_angle(parts[i], new)) is not None]
        parts = accept_changes(parts, offers, _put, judge.bears_parts, config.tries)
    return parts


def _with_angle(leaf: Primitive, angle: float) -> Primitive | None:
    """The leaf with another last size; None where walls that lean so would meet."""
    try:
        return replace(leaf, size=(*leaf.size[:-1], angle))
    except ValueError:
        return None


def _put(parts: tuple[Primitive, ...], change: tuple[int, Primitive]) -> tuple[Primitive, ...]:
    i, new = change
    return (*parts[:i], new, *parts[i + 1 :])


def _put_all(parts: tuple[Primitive, ...], change: Mapping[int, Primitive]) -> tuple[Primitive, ...]:
    return tuple(change.get(i, part) for i, part in enumerate(parts))


def _settle_typed(values: Values, judge: _SnapJudge, config: SnapConfig, widths: Sequence[float]) -> tuple[Values, frozenset[float]]:
    """The values with those that a mesh's precision keeps off a grid that is far wider, or the part's own, on it or on its thirds, and
    these: a mesh says so exactly where its faces are that a number next to it on a coarser grid is another one, and what was equal stays
    so."""
    groups = equal_groups(values)
    numbers = np.array([values.numbers[group[0]] for group in groups])
    typed = typed_widths(numbers, widths, config.precision)
    found = coarsest_widths(numbers, typed, config.precision)
    thirds = coarsest_widths(3 * numbers, [w for w in typed if w >= THIRD * typed[-1]], 3 * config.precision)
    moves = [(group, round_to_grid(float(v), w)) for group, v, w in zip(groups, numbers, found, strict=True) if w]
    moves += [(g, round_to_thirds(float(v), t)) for g, v, w, t in zip(groups, numbers, found, thirds, strict=True) if t and not w]
    values = accept_changes(values, moves, Values.with_numbers, judge.bears, config.tries)
    return values, frozenset(number for group, number in moves if values.numbers[group[0]] == number)


def _round(
    values: Values, judge: _SnapJudge, config: SnapConfig, widths: Sequence[float], largest: float, typed: frozenset[float]
) -> Values:
    """Coarsest grid first; values that took a grid are done, unless they turn out to have been carried by the others, and so are those that
    were `typed`."""
    start, pending = values, [group for group in equal_groups(values) if float(values.numbers[group[0]]) not in typed]
    for grid in widths:
        moves = [(group, round_to_grid(float(values.numbers[group[0]]), grid)) for group in pending]
        close = [m for m in moves if _move(values, m) <= config.max_move * largest]
        # the smallest moves stand first, so that halving parts them from the bold ones
        close.sort(key=lambda m: _move(values, m))
        values = accept_changes(values, close, Values.with_numbers, judge.bears, config.tries)
        taken = [m for m in close if values.numbers[m[0][0]] == m[1]]
        values, returned = _review_moves(values, start, taken, judge, config)
        done = {int(group[0]) for group, _ in taken} - returned
        pending = [group for group in pending if int(group[0]) not in done]
    return values


def _review_moves(
    values: Values, start: Values, taken: list[tuple[np.ndarray, float]], judge: _SnapJudge, config: SnapConfig
) -> tuple[Values, set[int]]:
    """Undo those of the boldest moves without which the error is clearly smaller; the others had paid for them."""
    returned: set[int] = set()
    if len(taken) < 2:
        return values, returned
    for group, _ in sorted(taken, key=lambda m: -_move(start, m))[: config.reviews]:
        undone = values.with_numbers((group, float(start.numbers[group[0]])))
        parts = undone.primitives_or_none()
        error = judge.error_of(parts) if parts is not None else float("inf")
        if error * (1 + config.rel_tolerance) + config.abs_tolerance < judge.current:
            values, judge.current, judge.limit = undone, error, judge.error_limit(error)
            returned.add(int(group[0]))
    return values, returned


def _move(values: Values, change: tuple[np.ndarray, float]) -> float:
    return abs(change[1] - float(values.numbers[change[0][0]]))


def _rebuilt(program: Program, parts: Sequence[Primitive]) -> Program:
    return map_leaves(program, lambda i, _: parts[i])
