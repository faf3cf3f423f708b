"""Changes that put in a part with its copies, or the copies of a part that is there: each must explain points, all share their numbers.

Each place where a copy could be (`candidates.copies`) is judged alone, beside the program as it is; those that explain something are put
in together, and what comes of that is judged again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.sequence import SignedSequence, Step
from imdim.program.tree import Op, Primitive, Program, combine_all
from imdim.search.mdl.batched_likelihood import BatchedLikelihood, PointScene
from imdim.search.mdl.candidates.copies import CLOSE, CopyPlaces, find_rows
from imdim.search.mdl.description_length import FEATURE, count_own
from imdim.search.mdl.local_search import Choice

GRIDS = 4  # rows that are looked at for rows of them
MOST_COPIES = 40  # leaves of one change
ENOUGH = 1.0  # numbers' worth that a copy must explain
OVER = 0.5  # of the smaller radius, by which middles are apart of parts of which one stands for the other


class CopySource(NamedTuple):
    """A `part` with its operation before the settled step of index `at`, in the place of those that are `gone`; `there` where it is one of
    the settled parts itself, and `lined` where rows of it are looked for."""

    part: Primitive
    op: Op
    at: int
    gone: frozenset[int]
    there: bool
    lined: bool


class Copied(NamedTuple):
    """What is put in by an operation before the settled step of index `at`, in place of those that are `gone`, and the length of the
    description then."""

    length: float
    parts: Program
    op: Op
    at: int
    gone: frozenset[int]


@dataclass(frozen=True)
class Copying:
    """Copies in a program of these `steps`, judged by the points of a `scene`."""

    scene: PointScene
    steps: SignedSequence[Program]
    places: CopyPlaces
    deadline: Deadline = NEVER

    def find(self, sources: Sequence[CopySource], most: int) -> list[Copied]:
        """The `most` that lead to the shortest descriptions, the shortest first; none where there is no time for it."""
        asked = [(source, found) for source in sources for found in self._offers(source)]
        together = self._complete(asked)
        rows = [(source, found) for source, found, lined in together if lined]
        grids = self._complete([(source, found) for source, row in rows[:GRIDS] for found in self._lines(source, row)])
        whole = ((source, [*([] if source.there else [source.part]), *copies]) for source, copies, _ in (*together, *grids))
        every = list(dict.fromkeys((source, tuple(parts)) for source, parts in whole if len(parts) <= MOST_COPIES))
        return sorted(self._judge(every), key=lambda copied: copied.length)[:most]

    @cached_property
    def _start(self) -> Choice:
        return tuple(Step(op, i) for i, (op, _) in enumerate(self.steps))

    @cached_property
    def _settled(self) -> list[Program]:
        return [part for _, part in self.steps]

    def _offers(self, source: CopySource) -> Iterator[_Offer]:
        others = [old.center for op, old in self.steps if op == source.op and isinstance(old, Primitive) and old != source.part]
        instead = [[replace(source.part, center=center)] for center in others]
        yield _Offer(instead, [], _all_that_gain, False)
        for parts in self.places.sets(source.part):
            yield _Offer([[p] for p in parts], [], _all_that_gain, False)
        if source.lined:
            yield from self._lines(source, [])

    def _lines(self, source: CopySource, copies: list[Primitive]) -> Iterator[_Offer]:
        """The source, with its `copies` that are put in, shifted along each axis."""
        row = [source.part, *copies]
        for axis in range(3):
            lengths = [self.places.length(p, axis) for p in row]
            fine, steps = self.places.line(row, axis, min(lengths))
            low, high = (f(float(np.dot(p.center, self.places.axes[:, axis])) for p in row) for f in (min, max))
            least = math.ceil((high - low + CLOSE * max(lengths)) / fine)
            if len(steps) <= least:
                continue
            shift = partial(self._shift, row, axis, fine)
            yield _Offer([shift(k) for k in steps], copies, _rows_among(steps.index(0), least, shift), True)

    def _shift(self, row: Sequence[Primitive], axis: int, fine: float, by: float) -> list[Primitive]:
        return [self.places.shift(part, axis, fine * by) for part in row]

    def _complete(self, asked: Sequence[tuple[CopySource, _Offer]]) -> list[tuple[CopySource, list[Primitive], bool]]:
        """Each source with copies that explain something, and whether they are in a row; those that explain the most first."""
        every = list(dict.fromkeys((source, tuple(parts)) for source, offer in asked for parts in offer.copies))
        if not every or self.deadline.has_passed():
            return []
        _, explained, numbers = self._explain(every, alone=True)
        # beside the first of its kind a copy costs next to nothing, and what it stands for is gone
        price = numbers - [sum(count_own(part) + FEATURE for part in own) for _, own in every]
        gain = dict(zip(every, self._base - explained - price * self.scene.number, strict=True))
        out: list[tuple[float, CopySource, list[Primitive], bool]] = []
        for source, offer in asked:
            gains = np.array([gain[source, tuple(parts)] for parts in offer.copies])
            for total, parts in offer.choose(offer.copies, gains, ENOUGH * self.scene.number):
                out.append((total, source, [*offer.stay, *parts], offer.lined))
        out.sort(key=lambda found: -found[0])
        return [(source, parts, lined) for _, source, parts, lined in out]

    @cached_property
    def _base(self) -> float:
        return float(BatchedLikelihood.of(self.scene, self._settled, []).lengths([self._start])[0])

    def _judge(self, every: Sequence[tuple[CopySource, tuple[Primitive, ...]]]) -> list[Copied]:
        """What comes of the parts of each."""
        if not every or self.deadline.has_passed():
            return []
        gone, explained, numbers = self._explain(every)
        lengths = explained + numbers * self.scene.number
        return [
            Copied(float(length), combine_all("union", list(own)), source.op, source.at, left_out)
            for length, (source, own), left_out in zip(lengths, every, gone, strict=True)
        ]

    def _explain(
        self, every: Sequence[tuple[CopySource, tuple[Primitive, ...]]], alone: bool = False
    ) -> tuple[list[frozenset[int]], np.ndarray, np.ndarray]:
        """The settled parts that the parts of each take the place of, and what the points and the numbers are then; `alone` without what
        the source is in the place of."""
        mixture = BatchedLikelihood.of(self.scene, self._settled, [combine_all("union", list(own)) for _, own in every])
        if alone:  # how few numbers tell of a copy is of no account: it has those of the first
            mixture = replace(mixture, ends=np.where(np.arange(len(mixture.ends)) < len(self.steps), mixture.ends, 0))
        gone = [frozenset(self._in_the_way(*each)) | (frozenset() if alone else each[0].gone) for each in every]
        choices = [
            put_in(self._start, len(self.steps) + k, source.op, source.at, left_out)
            for k, ((source, _), left_out) in enumerate(zip(every, gone, strict=True))
        ]
        usable = [k for k, choice in enumerate(choices) if choice[0].positive]
        explained, numbers = np.full(len(every), np.inf), np.zeros(len(every))
        both = mixture.explain([self._start, *(choices[k] for k in usable)])
        explained[usable], numbers[usable] = both[0][1:], both[1][1:]
        return gone, explained, numbers

    def _in_the_way(self, source: CopySource, parts: Sequence[Primitive]) -> Iterator[int]:
        """Settled parts of the same operation that do what the parts do, but for the source itself."""
        centers, radii = self._balls
        mine = np.array([p.center for p in parts]), np.array([bounding_radius(p) for p in parts])
        apart = np.linalg.norm(mine[0][:, None] - centers, axis=2) / np.minimum(mine[1][:, None], radii)
        for i in np.flatnonzero((apart < OVER).any(0)).tolist():
            op, old = self.steps[i]
            if op == source.op and old != source.part:
                yield i

    @cached_property
    def _balls(self) -> tuple[np.ndarray, np.ndarray]:
        """Middles [k, 3] and radii [k] about settled primitives; what is no primitive is nowhere."""
        balls = [(p.center, bounding_radius(p)) if isinstance(p, Primitive) else ((np.inf,) * 3, 1.0) for p in self._settled]
        return np.array([center for center, _ in balls]), np.array([radius for _, radius in balls])


class _Offer(NamedTuple):
    """`copies`, each of one part or more, of which `choose` takes those that belong together by what each gains, with what they gain,
    beside those that `stay`; whether they are in a row."""

    copies: list[list[Primitive]]
    stay: list[Primitive]
    choose: Callable[[list[list[Primitive]], np.ndarray, float], list[tuple[float, list[Primitive]]]]
    lined: bool


def _all_that_gain(copies: list[list[Primitive]], gains: np.ndarray, enough: float) -> list[tuple[float, list[Primitive]]]:
    good = np.flatnonzero(gains > enough)
    return [(float(gains[good].sum()), [p for i in good for p in copies[i]])] if len(good) else []


def _rows_among(at: int, least: int, shift: Callable[[float], list[Primitive]]):
    def choose(copies: list[list[Primitive]], gains: np.ndarray, enough: float) -> list[tuple[float, list[Primitive]]]:
        out = []
        for pitch, before, behind in find_rows(gains, at, least, enough):
            steps = [k for k in range(-before, behind + 1) if k]
            total = sum(float(gains[min(max(round(at + k * pitch), 0), len(gains) - 1)]) for k in steps)
            out.append((total, [p for k in steps for p in shift(k * pitch)]))
        return out

    return choose


def put_in(start: Choice, term: int, op: Op, at: int, gone: frozenset[int]) -> Choice:
    """The choice with a term more before the settled step of index `at`, without those that are `gone`."""
    before = [s for s in start[:at] if s.term not in gone]
    return (*before, Step(op, term), *(s for s in start[at:] if s.term not in gone))
