"""Which faces a name would move past each other when it changes by a tenth, and equations that keep them apart.

A place that is measured from far off moves far: a tenth of half a plate's length takes a hole near the plate's end out of it, and a tenth
of a deep pocket breaks through the wall before the next one. Who draws such a hole measures it from that end, and such a pocket by the wall
that it leaves. So where a tenth of a name moves one of two faces past the other, of one leaf or of two, the later one is measured from the
earlier, as far as nothing else says where it is. So are corners of a drawing that crosses itself once a name is a tenth more or less.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.export.drawable import RADIUS_STEP, Drawings, Undrawn
from imdim.export.followers import BETWEEN_AXES, FROM_EDGE, GAP, OFFSET, SHOULDER, WALL, may_give_way, rank_followers
from imdim.export.outline_joints import Row, sum_rows
from imdim.export.reduction import Reduced
from imdim.export.seen import find_unseen
from imdim.export.spans import Span, list_spans
from imdim.export.turned_spans import list_turned_spans
from imdim.program.roles import signs
from imdim.program.tree import Program

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

TENTH = 0.1  # of a name's value
SLACK = 1e-6  # of the largest size, by which boxes that touch may miss each other
UNNAMED = 1e-3  # of it: a gap that is no wider stays as it is, and has no name: by so much people let parts overlap
TRIES = 120  # of equations
DRAWN_TRIES = 40  # of equations for drawings,
DISTANCES_TRIED = 6  # so many for each
FOLLOWERS_TRIED = 3  # numbers that may follow from one equation
DISTANCES = (GAP, FROM_EDGE, BETWEEN_AXES, OFFSET)
MOST_WORK = 20_000_000  # tries times spans times variables, which take some seconds
MOST_SPANS = 3000  # of a program: their pairs are looked at,
MOST_PAIRS = 10_000  # so many at a time

Solved = Mapping[int, Mapping[int, float]]


def solve_apart(system: LinearSystem, program: Program, deadline: Deadline = NEVER) -> tuple[dict[int, dict[int, float]], set[int]]:
    """What follows from what, as `LinearSystem.solve` has it, and the variables that move only what is not seen; `program` is the one
    delivered. Faces are kept apart, the nearest first, where fewer names move faces past each other then, until the `deadline`."""
    reduced = system.reduce()
    solved = system.solve(reduced)
    unseen = find_unseen(system, solved, program)
    spans = [*list_spans(system, program), *list_turned_spans(system, program)]
    if not 1 < len(spans) <= MOST_SPANS or deadline.has_passed():
        return solved, unseen
    found = _Spans(system, sorted(spans, key=lambda s: s.leaf), signs(program))
    state = _Solution(solved, unseen, found.find_hazards(solved, unseen), reduced)
    tried = set[tuple[int, int]]()
    for _ in range(min(TRIES, MOST_WORK // (len(spans) * len(system.start)))):
        hazard = next((h for h in state.hazards if (h.first, h.second) not in tried), None)
        if hazard is None or deadline.has_passed():
            break
        tried.add((hazard.first, hazard.second))
        state = _keep_apart(system, program, found, hazard, state) or state
    if not deadline.has_passed():
        state = _keep_drawn(system, program, found, state, deadline)
    return state.solved, state.unseen


def _keep_drawn(system: LinearSystem, program: Program, found: _Spans, state: _Solution, deadline: Deadline) -> _Solution:
    """The solution with equations by which corners and radii of drawings stay as far apart as they are, where fewer names spoil drawings
    then, and no more move faces past each other."""
    drawings, tried = Drawings(system), set[tuple[int, int]]()
    undrawn = drawings.find_undrawn(state.solved, state.unseen)
    for _ in range(DRAWN_TRIES):
        spoiled = next((u for u in undrawn if u[:2] not in tried), None)
        if spoiled is None or deadline.has_passed():
            break
        tried.add(spoiled[:2])
        for row, value, word, is_radial in drawings.list_distances(spoiled, state.solved)[:DISTANCES_TRIED]:
            known, place = len(system.start), _Place(spoiled.leaf, spoiled.leaf, spoiled.variable, is_radial)
            trials = _list_solutions(system, program, found, state, _Distance(row, value, word), place)
            drawn = ((t, drawings.find_undrawn(t.solved, t.unseen)) for t in trials if not state.is_safer(t))
            better = next((d for d in drawn if _count_spoiled(d[1]) < _count_spoiled(undrawn)), None)
            if better is not None:
                state, undrawn = better
                break
            del system.start[known:], system.extras[known - system.extra :]
    return state


def _count_spoiled(undrawn: Sequence[Undrawn]) -> tuple[int, int]:
    """How many names spoil drawings, and how many drawings each, in all."""
    return len({u.variable for u in undrawn}), len(undrawn)


class Hazard(NamedTuple):
    """Two spans, the second above the first by a `gap`, or below it by a negative one, that a name, which is a variable, moves past each
    other."""

    first: int
    second: int
    variable: int
    gap: float


class _Solution(NamedTuple):
    """What follows from what, which variables move nothing that is seen, what the others move past each other, and the equations but for
    those of places."""

    solved: dict[int, dict[int, float]]
    unseen: set[int]
    hazards: list[Hazard]
    reduced: Reduced

    def is_safer(self, other: _Solution) -> bool:
        """Whether fewer names move fewer pairs past each other than by another one."""
        (names, pairs), (more, most) = ((len({h.variable for h in s.hazards}), len(s.hazards)) for s in (self, other))
        return names <= more and pairs <= most and (names, pairs) != (more, most)


def _keep_apart(system: LinearSystem, program: Program, found: _Spans, hazard: Hazard, before: _Solution) -> _Solution | None:
    """The solution with an equation by which a pair stays apart, if it is safer than that `before`; else the system stays as it is."""
    known = len(system.start)
    for equation in found.keep_apart(hazard):
        after = _add_equation(system, program, found, hazard, before, equation)
        if after is not None:
            return after
        del system.start[known:], system.extras[known - system.extra :]
    return None


def _add_equation(
    system: LinearSystem, program: Program, found: _Spans, hazard: Hazard, before: _Solution, equation: _Distance
) -> _Solution | None:
    """The solution with a distance that stays, if something plain may follow from it and it is safer than that `before`."""
    place = _Place(*found.leaves_of(hazard), hazard.variable, found.is_radial(hazard))
    trials = _list_solutions(system, program, found, before, equation, place, found.leaves_of(hazard)[1])
    return next((after for after in trials if after.is_safer(before)), None)


class _Place(NamedTuple):
    """Between what leaves a distance is, the second of which is to follow, which variable moves it, and whether it is one from an axis."""

    first: int
    second: int
    mover: int
    is_radial: bool = False


def _list_solutions(
    system: LinearSystem, program: Program, found: _Spans, before: _Solution, equation: _Distance, place: _Place, only: int | None = None
) -> Iterator[_Solution]:
    """The solutions with a distance that stays, one for each number that may follow from that by something plain, the best first; the
    others are those of one leaf that are no sizes where `only` says so."""
    first, second, mover, is_radial = place
    row = equation.with_name(system, first, second)
    named = row.keys() - equation.row.keys()  # what says how far apart they are follows nothing
    whole = before.reduced.add([row], len(system.start))
    left = whole.matrix[-1].copy()
    held = (v for v in np.flatnonzero(left).tolist() if v not in named)
    ranked = rank_followers(system, held, second, first, mover, is_radial)
    plain = [v for v in ranked if system.is_plain(left / left[v])]
    others = (v for v in plain[1:] if only is None or may_give_way(system, v, only))
    for follower in [*plain[:1], *others][:FOLLOWERS_TRIED]:
        reduced = Reduced(whole.matrix.copy(), dict(whole.pivots))
        reduced.solve_for(follower, len(reduced.matrix) - 1)
        solved = system.solve(reduced)
        unseen = find_unseen(system, solved, program)
        yield _Solution(solved, unseen, found.find_hazards(solved, unseen), reduced)


class _Distance(NamedTuple):
    """What is a row of variables is `value`, which has a name where it is no hair."""

    row: Row
    value: float
    word: str

    def with_name(self, system: LinearSystem, first: int, leaf: int) -> Row:
        """The equation; its name is one of a leaf, whose walls that are as thick share it, and so do gaps beside the `first` leaf."""
        if abs(self.value) <= UNNAMED * system.length:
            return self.row
        alike = (v for v, said in enumerate(system.extras, system.extra) if said == (leaf, self.word))
        if self.word in DISTANCES:
            alike = (v for v in alike if system.gaps.get(v) == first)
        same = (
            v
            for v in alike
            if self.word in (*DISTANCES, WALL, RADIUS_STEP) and abs(system.start[v] - abs(self.value)) <= SLACK * system.length
        )
        name = next(same, None) or system.new(leaf, self.word, abs(self.value))
        if self.word in DISTANCES:
            system.gaps[name] = first
        return sum_rows((self.row, 1.0), ({name: 1.0}, -1.0 if self.value > 0 else 1.0))


class _Pairs(NamedTuple):
    """Pairs of spans [p] that touch as seen along their axis, the `first` of them before the `second`: which lies above which by what
    `gaps`, and whether the second does (`way` 1) or the first (-1)."""

    first: np.ndarray
    second: np.ndarray
    low: np.ndarray
    high: np.ndarray
    gaps: np.ndarray
    way: int


class _Spans:
    """The spans of a program as arrays; `sign` is -1 of leaves that cut."""

    def __init__(self, system: LinearSystem, spans: Sequence[Span], sign: Sequence[int]) -> None:
        self._system, self._spans, self._sign = system, spans, sign
        self._leaves, self._axes = (np.array([getattr(s, name) for s in spans]) for name in ("leaf", "axis"))
        self._boxes = np.array([(s.low, s.high) for s in spans])  # [n, 2, 3]
        self._ends = self._boxes[np.arange(len(spans)), :, self._axes]  # [n, 2]
        self._slack = SLACK * system.length
        groups = {only: number for number, only in enumerate(dict.fromkeys(s.only for s in spans))}
        self._groups = np.array([groups[s.only] for s in spans])
        self._pairs = self._list_pairs()

    def find_hazards(self, solved: Solved, unseen: Collection[int]) -> list[Hazard]:
        """The pairs of spans that a tenth of a name moves past each other, the nearest first."""
        moves, used = self._moves(solved, unseen)
        found: list[Hazard] = []
        for first, second, low, high, gaps, way in self._pairs:
            apart = np.abs(moves[low, 0] - moves[high, 1])
            pairs, names = np.nonzero((apart > self._slack) & (apart >= gaps[:, None]))
            lists = first[pairs], second[pairs], used[names], way * gaps[pairs]
            found += map(Hazard, *(values.tolist() for values in lists))
        return sorted(found, key=lambda h: (abs(h.gap), h.second, h.first))

    def _list_pairs(self) -> list[_Pairs]:
        """Those that may be moved past each other: the later one above the earlier first, then below it, some at a time."""
        flat = self._ends[:, 1] - self._ends[:, 0] <= self._slack
        near = [self._near(j) for j in range(len(self._spans))]
        second = np.repeat(np.arange(len(near)), [len(each) for each in near])
        first = np.concatenate(near)
        found: list[_Pairs] = []
        for start in range(0, len(first), MOST_PAIRS):
            one, two = first[start : start + MOST_PAIRS], second[start : start + MOST_PAIRS]
            for low, high, way in ((two, one, 1), (one, two, -1)):
                gaps = self._ends[low, 0] - self._ends[high, 1]
                some = (gaps > self._slack) | ((gaps >= -self._slack) & flat[one] & flat[two])
                found.append(_Pairs(one[some], two[some], low[some], high[some], gaps[some], way))
        return found

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
        """The earlier spans along the same axis that touch span `j` as seen along that; those of other leaves share area with it."""
        across = [a for a in range(3) if a != self._axes[j]]
        shared = np.minimum(self._boxes[:j, 1], self._boxes[j, 1]) - np.maximum(self._boxes[:j, 0], self._boxes[j, 0])
        same = self._leaves[:j] == self._leaves[j]
        along = (self._axes[:j] == self._axes[j]) & (self._groups[:j] == self._groups[j])
        meet = np.where(same[:, None], shared >= -self._slack, shared > self._slack)
        return np.flatnonzero(along & meet[:, across].all(1))

    def leaves_of(self, h: Hazard) -> tuple[int, int]:
        """The leaves of both."""
        return self._spans[h.first].leaf, self._spans[h.second].leaf

    def is_radial(self, h: Hazard) -> bool:
        """Whether both are distances from an axis."""
        return self._spans[h.second].is_radial

    def keep_apart(self, h: Hazard) -> Iterator[_Distance]:
        """Distances by which the second stays so far from the first: those that a person would measure, and else what is between them,
        where a tenth of the former is more."""
        one, two = self._spans[h.first], self._spans[h.second]
        up = h.gap > 0 or (h.gap == 0 and self._ends[h.second, 0] >= self._ends[h.first, 1])
        left = sum_rows((two.sides[0 if up else 1], 1.0), (one.sides[1 if up else 0], -1.0))
        if two.is_radial:
            yield _Distance(left, h.gap, SHOULDER if one.leaf == two.leaf else WALL)
            return
        (at, row), (other, its) = two.datums[0 if up else 1], one.datums[1 if up else 0]
        # a bar on an edge lies about that, and one that ends in another ends in the middle of it
        if two.middle is not None and abs(two.middle[0] - other) < abs(at - other):
            at, row = two.middle
        if one.middle is not None and abs(one.middle[0] - at) < abs(at - other):
            other, its = one.middle
        is_middle = any(s.middle is not None and r is s.middle[1] for s, r in ((two, row), (one, its)))
        word = OFFSET if is_middle else _word_between(one, two) if up else _word_between(two, one)
        yield _Distance(sum_rows((row, 1.0), (its, -1.0)), at - other, word)
        if TENTH * abs(at - other) >= abs(h.gap):
            yield _Distance(left, h.gap, WALL)
        elif abs(at - other) <= UNNAMED * self._system.length:
            # of what lies about one middle the sizes say how far the sides are apart
            yield _Distance(left, h.gap, OFFSET if self._sign[one.leaf] == self._sign[two.leaf] else WALL)


def _word_between(low: Span, high: Span) -> str:
    """What one calls the distance between two places: by whether either is an axis, and of two flat faces by whether material is between
    them, air, or both look one way."""
    if low.is_round or high.is_round:
        return BETWEEN_AXES if low.is_round and high.is_round else FROM_EDGE
    if not low.looks or not high.looks:
        return GAP
    return OFFSET if low.looks == high.looks else WALL if high.looks > 0 else GAP
