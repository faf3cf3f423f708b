"""The best insertions into a sequence, without asking again what cannot have become the best.

What a family can win at a place changes only with the cells whose state changed there. So the best sum found at an earlier look, plus
all that the changed cells can add, bounds the sum now, and most families need no second look: lazy greedy selection (Minoux 1978,
"Accelerated greedy algorithms for maximizing submodular set functions"), with bounds that hold although the gain is not submodular.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from imdim.program.sequence import Step
from imdim.program.tree import Op
from imdim.search.bits import pack_words, unpack_words
from imdim.search.candidate_families import Families
from imdim.search.group_sums import make_tables
from imdim.search.look_kernels import ASKED, NOT_BEGUN, RANK, AskedPlaces, LookState, SumTables, ask_places, list_gaps, set_bounds
from imdim.search.outline_families import PAID
from imdim.search.sequence import Covered, Insertion, Price, Sequence, mask_of, shapes_of

CODED_OPS: tuple[Op, ...] = ("union", "difference", "intersection")  # as `look_kernels` numbers them
Key = tuple[int, str]
PAIRS: Key = (0, "pairs")
MOST_BYTES = 8 * 2**20  # of flags; beyond them all is forgotten


@dataclass(frozen=True)
class _GroupBound:
    """A place as it was: the step behind it, the cells that a term would change there, as bits [w], and what each group won at most."""

    step: Step[Covered] | None
    bits: np.ndarray
    caps: np.ndarray


class GainBounds:
    """Bounds from earlier looks at the same families under one gain, and what was found for whole sequences. A `branch` sees them, and
    keeps its own bounds apart; both sum together, and know what either found."""

    def __init__(
        self,
        parent: dict[Key, _GroupBound] | None = None,
        sums: list[tuple[np.ndarray, SumTables]] | None = None,
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

    def sums_of(self, families: Families, price: Price) -> tuple[np.ndarray, SumTables]:
        """The gain [m], and the sums of it over the groups, as far as they are known."""
        if not self._sums:
            gain = families.cells.gain_under(price.weights)
            self._sums.append((gain, make_tables([slots.size for slots in families.slots], len(gain))))
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
        return look is not None and float(np.abs(gain[unpack_words(look.bits, len(gain)) ^ state]).sum()) < least

    def put_no_pair(self, state: np.ndarray) -> None:
        """Pairs win nothing where these cells [m] are filled."""
        self.put(PAIRS, _GroupBound(None, pack_words(state), np.zeros(0)))

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
    return sum(look.bits.nbytes for look in looks.values())


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
    gain, tables = known.sums_of(families, price)
    places, keys = _places(sequence, gain, families.groups if price.boxes else 1, known)
    groups, paid = families.packed, (families.outlines.outlines.curve_price, PAID)
    progress = LookState(np.array([0, NOT_BEGUN, 0]), np.array([price.step]), np.zeros(places.caps.shape[1], bool))
    found: list[Insertion] = []
    while True:
        at, group, count, most, ranges, wins, faces = ask_places(places, groups, tables, gain, *paid, progress)
        if at < 0:
            break
        most, candidate = families.candidate_of(group, count, most, ranges.tolist(), wins, faces)
        places.caps[at, group] = min(places.caps[at, group], most)
        if candidate:
            insertion = Insertion(float(places.total[at]) + most, int(places.position[at]), CODED_OPS[places.op[at]], candidate)
            found.append(insertion)
            progress.least[0] = max(progress.least[0], share * insertion.gain)
    families.count_asked(int(progress.at[ASKED]))
    for place in places.order[: progress.at[RANK]].tolist():
        step, op = keys[place]
        known.put((id(step), op), _GroupBound(step, places.bits[place].copy(), places.caps[place].copy()))
    return sorted((i for i in found if i.gain >= progress.least[0]), key=lambda i: -i.gain)


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


def _places(
    sequence: Sequence, gain: np.ndarray, groups: int, known: GainBounds
) -> tuple[AskedPlaces, list[tuple[Step[Covered] | None, Op]]]:
    """Each place and operation with the bounds of its groups, and the step behind it; a place where nothing differs from the one behind it
    is left out."""
    words = -(-len(gain) // 64)
    terms = np.array([step.term.bits for step in sequence], np.uint64).reshape(-1, words)
    empty, held, differs, won = list_gaps(terms, np.array([CODED_OPS.index(step.op) for step in sequence], np.int64), gain)
    changes, lost, different = (empty, held, held), (-won).tolist(), differs.tolist()
    behind: list[_GroupBound | None] = [None, None, None]
    keys, bits, looks, rows = (
        list[tuple[Step[Covered] | None, Op]](),
        list[np.ndarray](),
        list[_GroupBound | None](),
        list[tuple[int, int, float]](),
    )
    for position in range(len(sequence), -1, -1):
        step = sequence[position] if position < len(sequence) else None
        for code, op in enumerate(CODED_OPS[: 3 if position else 1]):
            look = behind[code] = known.get((id(step), op)) or behind[code]
            if different[position][min(code, 1)]:
                keys.append((step, op))
                bits.append(changes[code][position])
                looks.append(look if look and len(look.caps) >= groups else None)
                rows.append((position, code, lost[position] if op == "intersection" else 0.0))
    position, code, total = (np.array(column) for column in zip(*rows, strict=True))
    nothing, none = np.zeros(words, np.uint64), np.zeros(groups)
    before = np.array([nothing if look is None else look.bits for look in looks])
    caps = np.array([none if look is None else look.caps[:groups] for look in looks])
    sign, now = np.where(code == CODED_OPS.index("difference"), -1.0, 1.0), np.array(bits)
    set_bounds(now, before, caps, sign, gain)
    hopes = total + caps.max(axis=1)
    return AskedPlaces(now, caps, sign, total.astype(float), position, code, hopes, np.argsort(-hopes, kind="stable")), keys
