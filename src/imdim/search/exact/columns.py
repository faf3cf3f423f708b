"""What candidates can tell apart: bit columns over pairs of cells, only the ones that no other column holds.

A candidate separates a pair of cells when it covers just one of them. All boxes of a frame are listed as products of ranges, ranges that
cover the same of the paired cells once. Columns are rows of words (see `bits`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numba import njit

from imdim.search.bits import pack_words
from imdim.search.candidate_families import Candidate, Families

MOST_BOXES = 20_000_000  # of one frame, listed in one go
MOST_DISTINCT = 1_000_000


class TooManyError(Exception):
    """There are more candidates than can be listed."""


@dataclass(frozen=True)
class Columns:
    """Maximal columns [n, words] uint64 and one candidate for each."""

    bits: np.ndarray
    candidates: list[Candidate]


def candidate_count(families: Families) -> int:
    """How many candidates the families have, listed or not."""
    arrangement = families.arrangement
    ranges = [len(d.offsets) * (len(d.offsets) - 1) // 2 for d in arrangement.directions]
    boxes = sum(ranges[a] * ranges[b] * ranges[c] for a, b, c in arrangement.frames)
    return boxes + sum(ranges[axis] if axis >= 0 else 1 for axis in arrangement.axis_of)


def maximal_columns(families: Families, left: np.ndarray, right: np.ndarray) -> Columns:
    """The columns over the pairs of cells (left[k], right[k]) that no other column holds; raises TooManyError."""
    tables = [_ranges(families, axis, left, right) for axis in range(len(families.arrangement.directions))]
    bits, candidates = _find_curved_columns(families, tables, left, right)
    for frame, axes in enumerate(families.arrangement.frames):
        a, b, c = (tables[axis] for axis in axes)
        if len(a.left) * len(b.left) * len(c.left) > MOST_BOXES:
            raise TooManyError(f"{len(a.left) * len(b.left) * len(c.left)} boxes in one frame, at most {MOST_BOXES} are listed")
        rows, places, full = distinct_boxes(a.left, a.right, b.left, b.right, c.left, c.right, MOST_DISTINCT)
        if full:
            raise TooManyError(f"more than {MOST_DISTINCT} distinct boxes")
        kept = _maximal(rows, np.arange(len(rows)))
        bits.append(rows[kept])
        candidates += [Candidate(("box", frame), (a.ranges[i], b.ranges[j], c.ranges[k])) for i, j, k in places[kept].tolist()]
    every = np.concatenate(bits)
    kept = _maximal(every, np.unique(every, axis=0, return_index=True)[1])
    return Columns(every[kept], [candidates[i] for i in kept])


@dataclass(frozen=True)
class _Ranges:
    """Distinct ranges along a direction: which of the left and right cells [r, words] they hold."""

    left: np.ndarray
    right: np.ndarray
    ranges: list[tuple[int, int]]


def _ranges(families: Families, axis: int, left: np.ndarray, right: np.ndarray) -> _Ranges:
    slabs = families.cells.slabs[:, axis]
    every = np.array(list(combinations(range(len(families.arrangement.directions[axis].offsets)), 2)))
    held = [(slabs[side] >= every[:, :1]) & (slabs[side] < every[:, 1:]) for side in (left, right)]
    words = [pack_words(h) for h in held]
    _, first = np.unique(np.concatenate(words, axis=1), axis=0, return_index=True)
    return _Ranges(words[0][first], words[1][first], [(int(lo), int(hi)) for lo, hi in every[first]])


def _find_curved_columns(
    families: Families, tables: list[_Ranges], left: np.ndarray, right: np.ndarray
) -> tuple[list[np.ndarray], list[Candidate]]:
    bits, candidates = [], []
    inside = families.cells.inside
    for i, axis in enumerate(families.arrangement.axis_of):
        at = [pack_words(inside[side, i][None]) for side in (left, right)]
        if axis < 0:
            bits.append(at[0] ^ at[1])
            candidates.append(Candidate(("curved", i), ((0, 1),)))
        else:
            bits.append((at[0] & tables[axis].left) ^ (at[1] & tables[axis].right))
            candidates += [Candidate(("curved", i), (r,)) for r in tables[axis].ranges]
    return bits, candidates


@njit(nogil=True, cache=True)
def _holds(row: np.ndarray, other: np.ndarray) -> bool:
    """Whether a row has all bits of another."""
    lacking = np.uint64(0)
    for w in range(len(row)):
        lacking |= other[w] & ~row[w]
    return lacking == 0


@njit(nogil=True, cache=True)
def distinct_boxes(
    al: np.ndarray, ar: np.ndarray, bl: np.ndarray, br: np.ndarray, cl: np.ndarray, cr: np.ndarray, most: int
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Distinct columns [n, words] of the products of three axes' ranges, with one place [n, 3] each; whether there were too many."""
    words = al.shape[1]
    size = 1
    while size < 2 * most:
        size *= 2
    table = np.full(size, -1, np.int32)
    rows = np.empty((most, words), np.uint64)
    places = np.empty((most, 3), np.int32)
    n = 0
    pl, pr, row = np.empty(words, np.uint64), np.empty(words, np.uint64), np.empty(words, np.uint64)
    for i in range(len(al)):
        for j in range(len(bl)):
            live = np.uint64(0)
            for w in range(words):
                pl[w], pr[w] = al[i, w] & bl[j, w], ar[i, w] & br[j, w]
                live |= pl[w] | pr[w]
            if live == 0:
                continue
            for k in range(len(cl)):
                key = np.uint64(1469598103934665603)
                some = np.uint64(0)
                for w in range(words):
                    row[w] = (pl[w] & cl[k, w]) ^ (pr[w] & cr[k, w])
                    some |= row[w]
                    key = (key ^ row[w]) * np.uint64(1099511628211)
                    key ^= key >> np.uint64(29)
                if some == 0:
                    continue
                at = np.int64(key % np.uint64(size))
                while table[at] >= 0 and not (_holds(rows[table[at]], row) and _holds(row, rows[table[at]])):
                    at = (at + 1) % size
                if table[at] < 0:
                    if n == most:
                        return rows[:n], places[:n], True
                    table[at] = n
                    for w in range(words):
                        rows[n, w] = row[w]
                    places[n, 0], places[n, 1], places[n, 2] = i, j, k
                    n += 1
    return rows[:n], places[:n], False


def _maximal(rows: np.ndarray, distinct: np.ndarray) -> np.ndarray:
    """Indices, out of those of the `distinct` rows, of the rows that no other row holds, the fullest first."""
    counts = np.bitwise_count(rows[distinct]).sum(1)
    order = distinct[np.argsort(-counts.astype(np.int64), kind="stable")]
    return order[keep_maximal(np.ascontiguousarray(rows[order]))]


@njit(nogil=True, cache=True)
def keep_maximal(rows: np.ndarray) -> np.ndarray:
    """Which rows, fullest first, no row before them holds. Only kept rows that hold the rarest of a row's bits are looked at."""
    n, words = rows.shape
    keep = np.zeros(n, np.bool_)
    kept = np.empty((n, words), np.uint64)
    owners = np.full((64 * words, 16), -1, np.int32)
    owned = np.zeros(64 * words, np.int64)
    total = 0
    for r in range(n):
        rarest, fewest = -1, 1 << 60
        for w in range(words):
            v = rows[r, w]
            for b in range(64):
                if (v >> np.uint64(b)) & np.uint64(1) and owned[64 * w + b] < fewest:
                    rarest, fewest = 64 * w + b, owned[64 * w + b]
        if rarest < 0:
            continue
        held = False
        for o in range(fewest):
            held = held or _holds(kept[owners[rarest, o]], rows[r])
        if held:
            continue
        keep[r] = True
        for w in range(words):
            kept[total, w] = rows[r, w]
        for w in range(words):
            v = rows[r, w]
            for b in range(64):
                if (v >> np.uint64(b)) & np.uint64(1):
                    place = 64 * w + b
                    if owned[place] == owners.shape[1]:
                        wider = np.full((64 * words, 2 * owners.shape[1]), -1, np.int32)
                        for i in range(len(owners)):
                            for o in range(owners.shape[1]):
                                wider[i, o] = owners[i, o]
                        owners = wider
                    owners[place, owned[place]] = total
                    owned[place] += 1
        total += 1
    return keep
