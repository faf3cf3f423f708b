"""Ranges of a found sequence made as a person would have drawn them: solids no longer than they must be, cutters just through."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from imdim.program.sequence import Step
from imdim.search.arrangement import span_along
from imdim.search.candidate_families import Candidate, Families
from imdim.search.sequence import Covered, Pair, Sequence, apply, gaps, leave_unchanged, spell_out


def tidy(sequence: Sequence, families: Families) -> Sequence:
    """The same or a better fill of the cells, with a step for each copy of a pattern, each range shrunk from the far sentinels, and those
    of added solids as short as they can be.

    Better: a range may have been found on fewer cells than are known here, and then fills some that no sample of the search fell into.
    """
    sequence = spell_out(sequence, families)
    places = list(gaps(sequence, len(families.cells.points)))
    state = np.zeros(len(families.cells.points), bool)
    for i, (_, _, unchanged) in enumerate(places[-2::-1]):
        sequence = _tidy_step(sequence, i, state, unchanged, families)
        state = apply(state, sequence[i])
    places = list(gaps(sequence, len(families.cells.points)))
    unchanged = np.ones(len(families.cells.points), bool)
    for (_, _, free), (i, state, _) in pairwise(places):
        sequence = _widen_step(sequence, i, state, free, unchanged, families)
        unchanged &= leave_unchanged(sequence[i])
    return sequence


def _widen_step(sequence: Sequence, i: int, before: np.ndarray, free: np.ndarray, unchanged: np.ndarray, families: Families) -> Sequence:
    """An outline that is cut away or kept, wider where no cell matters, of those filled `before` [m] on which the later steps were
    `free` [m]; these are `unchanged` [m] by now."""
    op, term = sequence[i]
    if op == "union" or not isinstance(term.shape, Candidate) or term.shape.source[0] != "outline":
        return sequence
    plane, ranges, faces = term.shape.source[1], term.shape.ranges, term.shape.faces
    shape = replace(term.shape, faces=families.outlines.widen(plane, ranges, faces, free & before))
    trial = _with(sequence, i, [shape], families)
    return sequence if (unchanged & (apply(before, sequence[i]) != apply(before, trial[i]))).any() else trial


def _tidy_step(sequence: Sequence, i: int, before: np.ndarray, unchanged: np.ndarray, families: Families) -> Sequence:
    """One step with shorter ranges, where cells [m] are filled `before` it and all later steps leave some `unchanged` [m]."""
    halves, gain = list(sequence[i].term.halves), families.cells.gain
    state = apply(before, sequence[i])
    for h in range(len(halves)):
        for axis in range(len(halves[h].ranges)):
            for end in (0, 1):
                while True:
                    shorter = shorten_range(halves[h], axis, end, families, added=sequence[i].op == "union" and h == 0)
                    if shorter is None:
                        break
                    trial = _with(sequence, i, [shorter if k == h else c for k, c in enumerate(halves)], families)
                    tried = apply(before, trial[i])
                    # other filled cells that leave more volume wrong
                    if float(np.where(tried, -gain, gain)[unchanged & (tried != state)].sum()) > 0:
                        break
                    sequence, halves[h], state = trial, shorter, tried
    return sequence


def leave_air(candidate: Candidate, field: np.ndarray, families: Families) -> Candidate:
    """A candidate without slabs that end at a sentinel and in which none of its cells wins or loses of a `field` [m], so that equal ones
    have equal sizes."""
    for axis, end in np.ndindex(len(candidate.ranges), 2):
        while (shorter := shorten_range(candidate, axis, end, families, added=True)) is not None:
            idle = not field[families.mask(candidate) & ~families.mask(shorter)].any()
            if not idle or not _ends_at_sentinel(candidate, axis, end, families):
                break
            candidate = shorter
    return candidate


def _ends_at_sentinel(candidate: Candidate, axis: int, end: int, families: Families) -> bool:
    direction = families.arrangement.directions[_direction(candidate, axis, families)]
    low, high = span_along(families.arrangement.bounds, direction.vector)
    at, slack = direction.offsets[candidate.ranges[axis][end]], 1e-9 * (high - low)
    return not low + slack < at < high - slack


def shorten_range(candidate: Candidate, axis: int, end: int, families: Families, added: bool) -> Candidate | None:
    """One slab less at one end; a cutter is only taken back from the far sentinel to the near one."""
    lo, hi = candidate.ranges[axis]
    if hi - lo <= 1:
        return None
    direction, arrangement = _direction(candidate, axis, families), families.arrangement
    if direction < 0:
        return None
    offsets = arrangement.directions[direction].offsets
    low, high = span_along(arrangement.bounds, arrangement.directions[direction].vector)
    at, slack = offsets[lo if end == 0 else hi], 1e-9 * (high - low)
    if not added and low - slack <= at <= high + slack:
        return None
    moved = (lo + 1, hi) if end == 0 else (lo, hi - 1)
    return replace(candidate, ranges=tuple(moved if a == axis else r for a, r in enumerate(candidate.ranges)))


def _direction(candidate: Candidate, axis: int, families: Families) -> int:
    kind, index = candidate.source
    if kind == "outline":
        return families.outlines.planes[index].direction
    return families.arrangement.axis_of[index] if kind == "curved" else families.arrangement.frames[index][axis]


def _with(sequence: Sequence, i: int, halves: list[Candidate], families: Families) -> Sequence:
    op, old = sequence[i]
    shape = Pair(old.shape.op, halves[0], halves[1]) if isinstance(old.shape, Pair) else halves[0]
    return (*sequence[:i], Step(op, Covered.of(shape, families)), *sequence[i + 1 :])
