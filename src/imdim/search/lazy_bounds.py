"""The best insertions into a sequence, without asking again what cannot have become the best.

What a family can win at a place changes only with the cells whose state changed there. So the best sum found at an earlier look, plus
all that the changed cells can add, bounds the sum now, and most families need no second look: lazy greedy selection (Minoux 1978,
"Accelerated greedy algorithms for maximizing submodular set functions"), with bounds that hold although the gain is not submodular.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterator
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np

from imdim.program.sequence import Step
from imdim.program.tree import Op
from imdim.search.candidate_families import Families
from imdim.search.group_sums import GroupSums
from imdim.search.kernels import changeable_cells, most_added
from imdim.search.sequence import Covered, Insertion, Price, Sequence, gaps, mask_of, shapes_of

NEIGHBOURS = 3  # places just asked that bound the next
Key = tuple[int, str]
PAIRS: Key = (0, "pairs")
MOST_BYTES = 64 * 2**20  # of flags; beyond them all is forgotten


@dataclass(frozen=True)
class _GroupBound:
    """A place as it was: the step behind it, the cells [m] that a term would change there, and what each group won at most."""

    step: Step[Covered] | None
    changeable: np.ndarray
    caps: np.ndarray


@dataclass(frozen=True)
class _Place:
    """A place and operation to be asked: the sum of `sign * gain` over a term's changeable cells, plus `total`, is what it wins."""

    position: int
    op: Op
    changeable: np.ndarray
    sign: float
    total: float
    caps: np.ndarray
    key: Key
    step: Step[Covered] | None


_Asked = tuple[int, int, _Place]  # its position, and how many places were asked before it


class GainBounds:
    """Bounds from earlier looks at the same families under one gain, and what was found for whole sequences. A `branch` sees them, and
    keeps its own bounds apart; both sum together, and know what either found."""

    def __init__(
        self,
        parent: dict[Key, _GroupBound] | None = None,
        sums: list[GroupSums] | None = None,
        found: dict[Any, list[Insertion]] | None = None,
    ) -> None:
        self._parent = parent if parent is not None else {}
        self._sums = sums if sums is not None else []
        self.found = found if found is not None else {}
        self._own: dict[Key, _GroupBound] = {}
        self._bytes = 0  # of the parent's flags, at most

    def branch(self) -> GainBounds:
        """For a trial: what it learns is kept apart until `adopt`, so that a rejected one leaves no looser bounds behind."""
        self._settle()
        return GainBounds(self._parent, self._sums, self.found)

    def sums_of(self, families: Families, price: Price) -> GroupSums:
        """The sums of the gain over the groups, as far as they are known."""
        if not self._sums:
            self._sums.append(GroupSums(families.cells.gain_under(price.weights)))
        return self._sums[0]

    def adopt(self, branch: GainBounds) -> None:
        """Take over what a trial that was accepted has learned."""
        self._own.update(branch._own)
        self._settle()

    def get(self, key: Key) -> _GroupBound | None:
        return self._own.get(key) or self._parent.get(key)

    def put(self, key: Key, look: _GroupBound) -> None:
        self._own[key] = look

    def no_pair(self, state: np.ndarray, gain: np.ndarray, least: float) -> bool:
        """Whether pairs won nothing when last asked, and what differs from then in the filled cells [m] is worth less than `least`."""
        look = self.get(PAIRS)
        return look is not None and float(np.abs(gain[look.changeable ^ state]).sum()) < least

    def put_no_pair(self, state: np.ndarray) -> None:
        """Pairs win nothing where these cells [m] are filled."""
        self.put(PAIRS, _GroupBound(None, state, np.zeros(0)))

    def _settle(self) -> None:
        if self._bytes > MOST_BYTES:
            self._bytes = _bytes(self._parent)
        if self._bytes > MOST_BYTES:
            self._parent.clear()
            self._bytes = 0
        self._bytes += _bytes(self._own)
        self._parent.update(self._own)
        self._own = {}


def _bytes(looks: dict[Key, _GroupBound]) -> int:
    return sum(look.changeable.nbytes for look in looks.values())


def best_insertions(sequence: Sequence, families: Families, price: Price, known: GainBounds, share: float = 1.0) -> list[Insertion]:
    """Insertions of single candidates that win more than a step costs and at least a `share` of the best, best first: one for each place
    and group that had to be asked.

    `known` must come from the same families and weights. A local search comes to the same sequences again and again.
    """
    asked = shapes_of(sequence), price, share
    if asked not in known.found:
        known.found[asked] = _look_for_insertions(sequence, families, price, known, share)
    return known.found[asked]


def _look_for_insertions(sequence: Sequence, families: Families, price: Price, known: GainBounds, share: float) -> list[Insertion]:
    sums = known.sums_of(families, price)
    gain = sums.gain
    hopes = ((p.total + float(p.caps.max()), p) for p in _places(sequence, gain, families.groups if price.boxes else 1, known))
    least = price.step
    found: list[Insertion] = []
    asked: dict[Op, list[_Asked]] = {}
    for order, (hope, place) in enumerate(sorted(hopes, key=lambda hoped: -hoped[0])):
        if hope <= least:
            break
        near = asked.setdefault(place.op, [])
        _tighten(place, near, gain)
        for insertion in _ask_groups(place, sums, families, least, share):
            found.append(insertion)
            least = max(least, share * insertion.gain)
        insort(near, (place.position, order, place))
        known.put(place.key, _GroupBound(place.step, place.changeable, place.caps))
    return sorted((i for i in found if i.gain >= least), key=lambda i: -i.gain)


def apart(insertions: list[Insertion], families: Families) -> list[tuple[Insertion, np.ndarray]]:
    """Of insertions in one sequence, best first, those that are about disjoint sets of cells, with their cells [m].

    Each wins the same whether or not the others are made, and wherever they are.
    """
    taken = np.zeros(len(families.cells.points), bool)
    out: list[tuple[Insertion, np.ndarray]] = []
    for insertion in insertions:
        mask = mask_of(insertion.shape, families)
        speaks = ~mask if insertion.op == "intersection" else mask
        if not (taken & speaks).any():
            taken |= speaks
            out.append((insertion, mask))
    return out


def insert_all(sequence: Sequence, insertions: list[tuple[Insertion, np.ndarray]]) -> Sequence:
    """The sequence with insertions, all at positions of the given one."""
    out = list(sequence)
    for insertion, mask in sorted(insertions, key=lambda i: -i[0].position):
        out.insert(insertion.position, Step(insertion.op, Covered(insertion.shape, mask)))
    return tuple(out)


def _tighten(place: _Place, asked: list[_Asked], gain: np.ndarray) -> None:
    """Bound a place by the nearest of those `asked` for the same operation, by position: one step apart, little differs."""
    at = bisect_left(asked, place.position, key=itemgetter(0))
    near = asked[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS]
    # of two as near, the one that was asked first was the more promising
    for _, _, other in sorted(near, key=lambda a: (abs(a[0] - place.position), a[1]))[:NEIGHBOURS]:
        np.minimum(place.caps, other.caps + most_added(other.changeable, place.changeable, place.sign, gain), out=place.caps)


def _ask_groups(place: _Place, sums: GroupSums, families: Families, least: float, share: float) -> Iterator[Insertion]:
    """What the groups of one place win; their bounds become what was found."""
    caps, look = place.caps.tolist(), None
    for group in np.argsort(-place.caps, kind="stable").tolist():
        floor = least - place.total
        if caps[group] <= floor:
            break
        look = look or sums.look(place.changeable)
        most, found = families.best_of(group, look.of(group, families.slots[group]), place.sign, max(floor, 0.0))
        place.caps[group] = min(caps[group], most)
        if found and most > floor:
            least = max(least, share * (place.total + most))
            yield Insertion(place.total + most, place.position, place.op, found)


def _places(sequence: Sequence, gain: np.ndarray, groups: int, known: GainBounds) -> Iterator[_Place]:
    """Each place and operation with the bounds of its groups; a place where nothing differs from the one behind it is left out."""
    behind: dict[Op, _GroupBound | None] = {}
    empty = held = np.zeros(0, bool)  # those of the place behind, which has none at the end
    for position, state, free in gaps(sequence, len(gain)):
        step = sequence[position] if position < len(sequence) else None
        empty, held, differs, won = changeable_cells(free, state, gain, empty, held)
        for op, changeable, sign in _kinds(empty, held, position > 0):
            key = (id(step), op)
            look = behind[op] = known.get(key) or behind.get(op)
            if differs[0 if op == "union" else 1]:
                total = -won if op == "intersection" else 0.0
                yield _Place(position, op, changeable, sign, total, _caps(look, changeable, sign, gain, groups), key, step)


def _kinds(empty: np.ndarray, held: np.ndarray, filled: bool) -> Iterator[tuple[Op, np.ndarray, float]]:
    """(operation, cells [m] that it can change, sign of the gain that a term's cells count with)."""
    yield "union", empty, 1.0
    if filled:
        yield "difference", held, -1.0
        # keeping only a term wins what emptying all would win less what emptying the term would
        yield "intersection", held, 1.0


def _caps(look: _GroupBound | None, changeable: np.ndarray, sign: float, gain: np.ndarray, groups: int) -> np.ndarray:
    """Upper bounds [groups] of the sums."""
    if look is None or len(look.caps) < groups:
        return np.full(groups, float(np.maximum(sign * gain[changeable], 0.0).sum()))
    return look.caps[:groups] + most_added(look.changeable, changeable, sign, gain)
