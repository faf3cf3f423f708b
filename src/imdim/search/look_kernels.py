"""Compiled: the places of a sequence, what bounds each, and a look at those that may win most.

Cells are flagged by the bits of words of 64 (`bits.pack_words`). Sums of gains are exact in any order (`Cells.gain_under`), so those over a
group's slots are carried over from a look at nearly the same cells: what differs is all that need be added. Those of `kernels` and
`outline_kernels` are compiled into these; numba's on-disk cache does not notice when they change, so this file has to change, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from imdim.search.kernels import best_box, best_interval
from imdim.search.outline_kernels import Graph, offer_outlines

UNION, DIFFERENCE, INTERSECTION = range(3)
NEIGHBOURS = 3  # places just asked that bound the next
COPY = 0.1  # of a slot: what it takes to copy one, in cells added
RANK, ROW, ASKED = range(3)  # of `LookState.at`
NOT_BEGUN, NO_ROW, OVER = -1, -2, -3


class Groups(NamedTuple):
    """The groups of families: all curved ones, each box frame, each plane of outlines.

    `slots` [g - 1, m] has the slot of each cell in all but the first, of whose cells c those are `listed[starts[c]:starts[c + 1]]`; in a
    row of the slots of all groups theirs begin at `firsts` [g + 1]. `ends` [f + 1] of the slabs of each curved family. The `places` [s, 3]
    of all slots of box frames, and the `shapes` [b, 3] of their grids. The numbers of faces and levels of each plane, `sizes` [p, 2], and
    their segments one plane after the other, each of its arrays in `graph` beginning at `graph_firsts` [p + 1, 9].
    """

    slots: np.ndarray
    starts: np.ndarray
    listed: np.ndarray
    firsts: np.ndarray
    ends: np.ndarray
    places: np.ndarray
    shapes: np.ndarray
    sizes: np.ndarray
    graph: Graph
    graph_firsts: np.ndarray


class AskedPlaces(NamedTuple):
    """Places and operations to be asked: the cells that a term can change there, as `bits` [p, w]; the bounds `caps` [p, g] of the sums of
    `sign * gain` over those of any term of a group, and the `total` that is added to them; the `position` and `op` of each; and their
    `order` by what they may win, `hopes`, best first."""

    bits: np.ndarray
    caps: np.ndarray
    sign: np.ndarray
    total: np.ndarray
    position: np.ndarray
    op: np.ndarray
    hopes: np.ndarray
    order: np.ndarray


class SumTables(NamedTuple):
    """Sums of one gain that were looked for last: of each look its cells as `bits` [l, w], when it was last asked for, `stamps` [l], and in
    which row of a group's table [r, size] its sums are, `rows` [l, g], -1 where in none; the look of each such row, `owners` [g, r]; the
    tables one after the other. `apart` [l] is how many cells the look that is asked for differs from each."""

    bits: np.ndarray
    stamps: np.ndarray
    rows: np.ndarray
    owners: np.ndarray
    sums: np.ndarray
    apart: np.ndarray


class LookState(NamedTuple):
    """Where a look stands: `at` [3] the rank of the place, the row of its sums and how many groups were asked; the `least` [1] that an
    insertion has to win, and which groups of the place are `done` [g]."""

    at: np.ndarray
    least: np.ndarray
    done: np.ndarray


@njit(nogil=True, cache=True)
def list_gaps(terms: np.ndarray, ops: np.ndarray, gain: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each position [n + 1] in a sequence of `terms` [n, w] the cells that every later step leaves as they are: those that are empty
    before it, and those that are filled, [n + 1, w]; whether either differ from the ones at the next position, [n + 1, 2]; and the sum
    [n + 1] of the `gain` [m] of those that are filled."""
    n, words = terms.shape
    empty, held = np.zeros((n + 1, words), np.uint64), np.zeros((n + 1, words), np.uint64)
    differs, won = np.zeros((n + 1, 2), np.bool_), np.zeros(n + 1)
    free = np.zeros(words, np.uint64)
    for c in range(len(gain)):
        free[c // 64] |= np.uint64(1) << np.uint64(c % 64)
    for k in range(n):
        for w in range(words):
            before, term = held[k, w], terms[k, w]
            held[k + 1, w] = before | term if ops[k] == UNION else before & term if ops[k] == INTERSECTION else before & ~term
    for k in range(n, -1, -1):
        for w in range(words):
            state = held[k, w]
            empty[k, w], held[k, w] = free[w] & ~state, free[w] & state
            differs[k, 0] |= k == n or empty[k, w] != empty[k + 1, w]
            differs[k, 1] |= k == n or held[k, w] != held[k + 1, w]
            if k:
                free[w] &= terms[k - 1, w] if ops[k - 1] == INTERSECTION else ~terms[k - 1, w]
        won[k] = _sum_of(held[k], gain)
    return empty, held, differs, won


@njit(nogil=True, cache=True)
def set_bounds(now: np.ndarray, before: np.ndarray, caps: np.ndarray, sign: np.ndarray, gain: np.ndarray) -> None:
    """Make of the bounds `caps` [p, g] of sums over cells `before` [p, w] those of sums over cells `now` [p, w]; over none they are 0."""
    for p in range(len(now)):
        added = _most_added(before[p], now[p], sign[p], gain)
        for group in range(caps.shape[1]):
            caps[p, group] += added


@njit(nogil=True, cache=True)
def ask_places(places, groups, tables, gain, price, paid, progress):
    """Ask groups for their best candidates, those of the place that may win most first, until one wins more than the least: (number of the
    place, -1 for none, group, how many there are, what it wins, its ranges [6], and of outlines what each wins [2] and its faces [2, f]).

    Of the curved group the first of the ranges is the family; of outlines what is said to be won holds where none of them can be drawn.
    """
    at, least, done = progress
    ranges, wins, faces = np.zeros(6, np.int64), np.zeros(2), np.zeros((2, 0), np.bool_)
    box = np.empty(7)
    while at[RANK] < len(places.order):
        p = places.order[at[RANK]]
        if at[ROW] == NOT_BEGUN:
            if places.hopes[p] <= least[0]:
                break
            _tighten(places, at[RANK], gain)
            for group in range(len(done)):
                done[group] = False
            at[ROW] = NO_ROW
        while True:
            group = _most_promising(places.caps[p], done)
            floor = least[0] - places.total[p]
            if group < 0 or places.caps[p, group] <= floor:
                break
            if at[ROW] == NO_ROW:
                at[ROW] = find_look(places.bits[p], tables)
            sums = sums_of(group, groups, tables, at[ROW], gain)
            done[group] = True
            at[ASKED] += 1
            floor = max(floor, 0.0)
            if group == 0:
                most = _best_curved(sums, groups.ends, places.sign[p], ranges)
                count = 1 if most > floor else 0
                most = max(most, floor)
            elif group <= len(groups.shapes):
                first, shape = groups.firsts[group] - groups.firsts[1], groups.shapes[group - 1]
                held = groups.places[first : first + len(sums)]
                most = best_box(sums, held, (shape[0], shape[1], shape[2]), places.sign[p], floor, box)
                count = 0 if box[0] == -np.inf else 1
                for k in range(6 if count else 0):
                    ranges[k] = int(box[1 + k])
            else:
                plane = group - 1 - len(groups.shapes)
                size = groups.sizes[plane]
                most, count, ranges[0], ranges[1], wins, faces = offer_outlines(
                    _graph_of(groups, plane), sums, size[0], size[1], places.sign[p], floor, price, paid
                )
                most = floor if count else most
            if count:
                return p, group, count, most, ranges, wins, faces
            places.caps[p, group] = min(places.caps[p, group], most)
        at[RANK] += 1
        at[ROW] = NOT_BEGUN
    return -1, 0, 0, 0.0, ranges, wins, faces


@njit(nogil=True, cache=True)
def _most_promising(caps, done):
    """The group with the largest bound of those that are not `done`, the first of equal ones, -1 where all are."""
    best = -1
    for group in range(len(caps)):
        if not done[group] and (best < 0 or caps[group] > caps[best]):
            best = group
    return best


@njit(nogil=True, cache=True)
def _tighten(places, rank, gain):
    """Bound a place by the nearest of those asked before it for the same operation, by position: one step apart, little differs. Of two as
    near, the one that was asked first was the more promising."""
    p = places.order[rank]
    near, away, count = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS, np.int64), 0
    for k in range(rank):
        other = places.order[k]
        if places.op[other] != places.op[p]:
            continue
        distance, place = abs(places.position[other] - places.position[p]), count
        while place > 0 and distance < away[place - 1]:
            if place < NEIGHBOURS:
                near[place], away[place] = near[place - 1], away[place - 1]
            place -= 1
        if place < NEIGHBOURS:
            near[place], away[place] = other, distance
            count = min(count + 1, NEIGHBOURS)
    for k in range(count):
        added = _most_added(places.bits[near[k]], places.bits[p], places.sign[p], gain)
        for group in range(places.caps.shape[1]):
            places.caps[p, group] = min(places.caps[p, group], places.caps[near[k], group] + added)


@njit(nogil=True, cache=True)
def find_look(bits, tables):
    """The row of the look at the cells that are flagged by `bits` [w], and in `tables` how many cells it is `apart` from each; a new one
    takes the place of the look that was not asked for longest."""
    row, newest = 0, 0
    for k in range(len(tables.stamps)):
        newest = max(newest, tables.stamps[k])
        if tables.stamps[k] < tables.stamps[row]:
            row = k
        count = 0
        for w in range(len(bits)):
            count += _count_bits(bits[w] ^ tables.bits[k, w])
        tables.apart[k] = count
    for k in range(len(tables.stamps)):
        if tables.stamps[k] and tables.apart[k] == 0:
            tables.stamps[k] = newest + 1
            return k
    for group in range(tables.rows.shape[1]):
        if tables.rows[row, group] >= 0:
            tables.owners[group, tables.rows[row, group]] = -1
            tables.rows[row, group] = -1
    for w in range(len(bits)):
        tables.bits[row, w] = bits[w]
    tables.stamps[row] = newest + 1
    return row


@njit(nogil=True, cache=True)
def sums_of(group, groups, tables, look, gain):
    """The sums over the slots of a group: known, carried over from the nearest look that knows them, or summed from all cells."""
    first, size, height = groups.firsts[group], groups.firsts[group + 1] - groups.firsts[group], tables.owners.shape[1]
    row, near, oldest = tables.rows[look, group], -1, -1
    if row < 0:
        for k in range(height):
            other = tables.owners[group, k]
            if other >= 0 and (near < 0 or tables.apart[other] < tables.apart[near]):
                near = other
        for k in range(height):
            other = tables.owners[group, k]
            if other < 0:
                row = k
            elif other != near and (oldest < 0 or tables.stamps[other] < tables.stamps[tables.owners[group, oldest]]):
                oldest = k
        if row < 0:
            row = oldest
            tables.rows[tables.owners[group, row], group] = -1
        tables.owners[group, row], tables.rows[look, group] = look, row
        begin = height * first + row * size
        sums, bits = tables.sums[begin : begin + size], tables.bits[look]
        every = 0
        for w in range(len(bits)):
            every += _count_bits(bits[w])
        if near >= 0 and tables.apart[near] + COPY * size < every:
            begin = height * first + tables.rows[near, group] * size
            for k in range(size):
                sums[k] = tables.sums[begin + k]
            _add_changes(sums, group, groups, tables.bits[near], bits, gain)
        else:
            for k in range(size):
                sums[k] = 0.0
            _add_changes(sums, group, groups, np.zeros(len(bits), np.uint64), bits, gain)
    begin = height * first + row * size
    return tables.sums[begin : begin + size]


@njit(nogil=True, cache=True)
def _add_changes(sums, group, groups, before, now, gain):
    """Add to the `sums` of a group over the cells `before` [w] what makes them those over the cells `now` [w]."""
    for w in range(len(now)):
        word = before[w] ^ now[w]
        while word:
            c = 64 * w + _lowest_bit(word)
            change = gain[c] if now[w] & word & (~word + np.uint64(1)) else -gain[c]
            word &= word - np.uint64(1)
            if group:
                sums[groups.slots[group - 1, c]] += change
            else:
                for k in range(groups.starts[c], groups.starts[c + 1]):
                    sums[groups.listed[k]] += change


@njit(nogil=True, cache=True)
def _best_curved(sums, ends, sign, ranges):
    """What the best curved family wins, and into `ranges` its number and where it begins and ends."""
    best = -np.inf
    for family in range(len(ends) - 1):
        won, lo, hi = best_interval(sign * sums[ends[family] : ends[family + 1]])
        if won > best:
            best = won
            ranges[0], ranges[1], ranges[2] = family, lo, hi
    return best


@njit(nogil=True, cache=True)
def _graph_of(groups, plane):
    """The segments of one plane."""
    graph, a, b = groups.graph, groups.graph_firsts[plane], groups.graph_firsts[plane + 1]
    return Graph(
        graph.starts[a[0] : b[0]],
        graph.free[a[1] : b[1]],
        graph.wall[a[2] : b[2]],
        graph.nodes[a[3] : b[3]],
        graph.faces[a[4] : b[4]],
        graph.length[a[5] : b[5]],
        graph.ends[a[6] : b[6]],
        graph.segments[a[7] : b[7]],
        graph.sides[a[8] : b[8]],
    )


@njit(nogil=True, cache=True)
def _most_added(before, now, sign, gain):
    """The most by which any sum of `sign * gain` over flagged cells can have grown since those were flagged that were `before` [w]."""
    total = 0.0
    for w in range(len(now)):
        word = before[w] ^ now[w]
        while word:
            value = sign * gain[64 * w + _lowest_bit(word)]
            total += max(value if now[w] & word & (~word + np.uint64(1)) else -value, 0.0)
            word &= word - np.uint64(1)
    return total


@njit(nogil=True, cache=True)
def _sum_of(bits, gain):
    """The sum of the gain [m] of flagged cells."""
    total = 0.0
    for w in range(len(bits)):
        word = bits[w]
        while word:
            total += gain[64 * w + _lowest_bit(word)]
            word &= word - np.uint64(1)
    return total


@njit(nogil=True, cache=True)
def _lowest_bit(word):
    """The number of the lowest bit of a word that is set."""
    return _count_bits((word & (~word + np.uint64(1))) - np.uint64(1))


@njit(nogil=True, cache=True)
def _count_bits(word):
    """How many bits of a word are set (Warren 2013, section 5-1)."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
