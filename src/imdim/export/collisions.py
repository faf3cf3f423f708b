"""Which curves of one drawing a name would move past each other when it changes by a tenth, and equations that keep them apart.

A place that is measured from far off moves far: a tenth of half a plate's length takes a hole near the plate's end out of it. Who draws
such a hole measures it from that end. So where a tenth of a name moves one of two curves past the other, the later one is measured from the
earlier, as far as nothing else says where it is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.export.outline_joints import Row, sum_rows
from imdim.export.seen import SHORTEST, find_unseen
from imdim.export.spans import Span, list_spans
from imdim.program.tree import Program

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

TENTH = 0.1  # of a name's value
SLACK = 1e-6  # of the largest size, by which boxes that touch may miss each other
TRIES = 40  # of equations, all at once and one by one
MOST_SPANS = 3000  # of a program: their pairs are looked at

Solved = Mapping[int, Mapping[int, float]]


def solve_apart(system: LinearSystem, program: Program) -> tuple[dict[int, dict[int, float]], set[int]]:
    """What follows from what, as `LinearSystem.solve` has it, and the variables that move only what is not seen; `program` is the one
    delivered. Equations that keep faces apart are added to the system where fewer names move faces past each other then."""
    solved = system.solve()
    unseen = find_unseen(system, solved, program)
    spans = list(list_spans(system, program))
    if not 1 < len(spans) <= MOST_SPANS:
        return solved, unseen
    found = _Spans(system, sorted(spans, key=lambda s: s.leaf))
    state = _Solution(solved, unseen, found.find_hazards(solved, unseen))
    tried, budget = set[tuple[int, int]](), TRIES
    while budget > 0:
        pairs = [h for h in found.nearest(state.hazards) if (h.first, h.second) not in tried]
        better = None
        for some in (pairs, *([h] for h in pairs)) if pairs else ():
            better, budget = _try(system, program, found, some, state), budget - 1
            if len(some) == 1:
                tried.add((some[0].first, some[0].second))
            if better is not None or budget <= 0:
                break
        if better is None:
            break
        state = better
    return state.solved, state.unseen


class Hazard(NamedTuple):
    """Two spans, the second above the first by a `gap`, or below it by a negative one, that a name, which is a variable, moves past each
    other."""

    first: int
    second: int
    variable: int
    gap: float


class _Solution(NamedTuple):
    """What follows from what, which variables move nothing that is seen, and what the others move past each other."""

    solved: dict[int, dict[int, float]]
    unseen: set[int]
    hazards: list[Hazard]

    def is_safer(self, other: _Solution) -> bool:
        """Whether fewer names move fewer pairs past each other than by another one."""
        (names, pairs), (more, most) = ((len({h.variable for h in s.hazards}), len(s.hazards)) for s in (self, other))
        return names <= more and pairs <= most and (names, pairs) != (more, most)


def _try(system: LinearSystem, program: Program, found: _Spans, some: Sequence[Hazard], before: _Solution) -> _Solution | None:
    """The solution with equations that keep some pairs apart, if it is safer than that `before`; else the system stays as it is."""
    kept, known = len(system.apart), len(system.start)
    system.apart += [found.keep_apart(h) for h in some]
    solved = system.solve()
    unseen = find_unseen(system, solved, program)
    after = _Solution(solved, unseen, found.find_hazards(solved, unseen))
    if after.is_safer(before):
        return after
    del system.apart[kept:], system.start[known:], system.extras[known - system.extra :]
    return None


class _Spans:
    """The spans of a program as arrays."""

    def __init__(self, system: LinearSystem, spans: Sequence[Span]) -> None:
        self._system, self._spans = system, spans
        self._leaves, self._axes = (np.array([getattr(s, name) for s in spans]) for name in ("leaf", "axis"))
        self._boxes = np.array([(s.low, s.high) for s in spans])  # [n, 2, 3]
        self._ends = self._boxes[np.arange(len(spans)), :, self._axes]  # [n, 2]
        self._slack = SLACK * system.length

    def find_hazards(self, solved: Solved, unseen: Collection[int]) -> list[Hazard]:
        """The pairs of spans that a tenth of a name moves past each other, the nearest first."""
        moves, used = self._moves(solved, unseen)
        found: list[Hazard] = []
        for j in range(1, len(self._spans)):
            near = self._near(j)
            for low, high, way in ((j, near, 1), (near, j, -1)):  # which lies above which
                gaps = self._ends[low, 0] - self._ends[high, 1]
                apart = np.abs(moves[low, 0] - moves[high, 1])
                crossed = (apart > self._slack) & (apart >= gaps[:, None]) & (gaps >= -self._slack)[:, None]
                crossed &= ((gaps > self._slack) | self._is_flat(j, near))[:, None]
                pairs, names = np.nonzero(crossed)
                found += [Hazard(int(near[i]), j, int(used[w]), way * float(gaps[i])) for i, w in zip(pairs, names, strict=True)]
        return sorted(found, key=lambda h: (abs(h.gap), h.second, h.first))

    def _moves(self, solved: Solved, unseen: Collection[int]) -> tuple[np.ndarray, np.ndarray]:
        """How far a tenth of each name moves both sides of each span, [n, 2, m], and which variables these names are [m]."""
        moves = np.zeros((len(self._spans), 2, len(self._system.start)))
        for i, span in enumerate(self._spans):
            for side, row in enumerate(span.sides):
                for v, factor in row.items():
                    for w, c in solved.get(v, {v: 1.0}).items():
                        moves[i, side, w] += factor * c
        moves *= TENTH * np.array(self._system.start)
        moves[:, :, sorted(unseen)] = 0.0
        used = np.flatnonzero(np.abs(moves).max((0, 1)) > self._slack)
        return moves[:, :, used], used

    def _near(self, j: int) -> np.ndarray:
        """The earlier spans of the same drawing along the same axis that touch span `j` as seen along that."""
        across = [a for a in range(3) if a != self._axes[j]]
        low, high = self._boxes[:j, 0], self._boxes[:j, 1]
        meet = np.minimum(high, self._boxes[j, 1]) >= np.maximum(low, self._boxes[j, 0]) - self._slack
        return np.flatnonzero((self._leaves[:j] == self._leaves[j]) & (self._axes[:j] == self._axes[j]) & meet[:, across].all(1))

    def _is_flat(self, j: int, near: np.ndarray) -> np.ndarray:
        flat = self._ends[:, 1] - self._ends[:, 0] <= self._slack
        return flat[near] & flat[j]

    def nearest(self, hazards: Sequence[Hazard]) -> list[Hazard]:
        """The nearest pairs, each span of which is once the second."""
        return list({h.second: h for h in reversed(hazards)}.values())

    def keep_apart(self, h: Hazard) -> tuple[int, Row]:
        """The leaf, and the equation by which the second is so far from the first, which has a name where it is no hair."""
        one, two = self._spans[h.first], self._spans[h.second]
        up = h.gap > 0 or (h.gap == 0 and self._ends[h.second, 0] >= self._ends[h.first, 1])
        (at, row), (other, its) = two.datums[0 if up else 1], one.datums[1 if up else 0]
        gap, equation = at - other, sum_rows((row, 1.0), (its, -1.0))
        if abs(gap) > SHORTEST * self._system.length:
            equation = sum_rows((equation, 1.0), ({self._system.new(two.leaf, "gap", abs(gap)): 1.0}, -1.0 if gap > 0 else 1.0))
        return two.leaf, equation
