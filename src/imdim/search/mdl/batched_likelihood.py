"""The likelihood of a noisy cloud under many choices among the same parts: what depends on one part alone is computed once.

The density is that of `likelihood`, over coarser samples. Which parts hold the places beside a sample is kept in bits, and to which points
it lends how much of density in lists (`part_tables`). A choice changes little of the sequence that it is a change of, so that it costs a
pass over the bits and the lists of those samples that come to the surface or leave it: ten thousand choices take less than a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.geometry import kernels
from imdim.numbers.likelihood import Noise
from imdim.program.tree import Program
from imdim.search.mdl.description_length import SKIN, count_each
from imdim.search.mdl.local_search import Choice, pack_choices
from imdim.search.mdl.part_tables import PartSamples, PartTableCache, count_ends, in_batches

MOST_SETTLED = 62  # parts, of which each has a bit
FACTORS = 4  # densities that are multiplied before their logarithm is taken
SMALLEST = 1e-250  # such a product that is no denormal number


class PointScene:
    """The points [n, 3] of `draws` that parts are judged by. They may stand for a cloud of `count` points: the more, the less a number of a
    program weighs."""

    def __init__(self, draws: PartTableCache, noise: Noise, count: int | None = None):
        points = self.points = draws.points
        self.drawn, self.count = draws.at(noise.sigma), count or len(points)
        self.clutter = noise.clutter
        self.number = 0.5 * math.log(self.count) / self.count  # nats per point that a number costs
        self.box = float(np.prod(np.maximum(np.ptp(points, axis=0), self.drawn.sigma)))


@dataclass(frozen=True)
class BatchedLikelihood:
    """Tables over `parts` (p) for the points of a scene: samples of part i are `starts[i]` to `starts[i + 1]`, `own` [p] and `ways`
    [p, f + 1] are how many numbers a part has (`count_each`). Only the first parts, the settled ones, may stand together, in their order,
    but for one of them; of the others a choice has one at most.

    Which of the settled parts hold the places just behind and ahead of a sample, and those a gap away, is in `held` int64 [s, 4], the last
    part in the lowest bit; whether others hold those of the settled parts' samples is in the lowest bits of `over` uint8 [others, s of the
    settled], and whether they hold their own in `selves` uint8 [s of the others]. What a sample lends to points is listed as in
    `PartSamples`, one after another: `first` [s + 1], `lent` and `density`; so is from where they can be seen, `faces` [s].
    """

    scene: PointScene
    parts: tuple[Program, ...]
    settled: int
    starts: np.ndarray
    held: np.ndarray
    over: np.ndarray
    selves: np.ndarray
    first: np.ndarray
    lent: np.ndarray
    density: np.ndarray
    own: np.ndarray
    ways: np.ndarray
    ends: np.ndarray
    end: np.ndarray
    faces: np.ndarray

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corners [p, 3] of the parts, by their samples; those of a part without any are infinite, the low one above."""
        drawn = [d.points for d in self.scene.drawn.parts(self.parts)]
        low, high = np.full((len(drawn), 3), np.inf), np.full((len(drawn), 3), -np.inf)
        there = [i for i, points in enumerate(drawn) if len(points)]
        points, firsts = np.concatenate([drawn[i] for i in there]), np.cumsum([0, *(len(drawn[i]) for i in there)])[:-1]
        low[there], high[there] = np.minimum.reduceat(points, firsts), np.maximum.reduceat(points, firsts)
        return low, high

    @staticmethod
    def of(scene: PointScene, settled: Sequence[Program], others: Sequence[Program]) -> BatchedLikelihood:
        """Raises ValueError for more than MOST_SETTLED settled parts."""
        if len(settled) > MOST_SETTLED:
            raise ValueError(f"{len(settled)} settled parts, at most {MOST_SETTLED} are possible")
        parts = (*settled, *others)
        drawn = scene.drawn.parts(parts)
        starts = np.cumsum([0, *(len(d.points) for d in drawn)])
        # some parts at a time: all places at once are a hundred megabytes
        held = np.concatenate([_find_holders(settled, _probes_of(scene, some)) for some in in_batches(drawn)])
        over = _pack_flags(kernels.inside_each(others, _probes_of(scene, drawn[: len(settled)])).ravel())
        over = over.reshape(len(others), starts[len(settled)])
        selves = _pack_flags(np.concatenate([np.empty((0, 4), bool), *(d.selves for d in drawn[len(settled) :])]).ravel())
        counts = np.cumsum([0, *(len(d.lent) for d in drawn)])
        first = np.concatenate([*(d.first[:-1] + count for d, count in zip(drawn, counts, strict=False)), counts[-1:]])
        lent, density = (np.concatenate(c) for c in ([d.lent for d in drawn], [d.density for d in drawn]))
        own, ways, copies = count_each(settled, others)
        ends = np.where(copies, 0, [count_ends(part) for part in parts]).astype(np.int64)
        tables = starts, held, over, selves, first, lent, density
        end, faces = (np.concatenate(c) for c in ([d.ends for d in drawn], [d.faces for d in drawn]))
        return BatchedLikelihood(scene, parts, len(settled), *tables, own, ways, ends, end, faces)

    def lengths(self, choices: Sequence[Choice]) -> np.ndarray:
        """Description length of the points under each choice, in nats per point (see `description_length`); infinite where nothing is left.

        Raises ValueError for a choice that is more than the settled parts without some of them, turned, and with one part in some place.
        """
        explained, numbers = self.explain(choices)
        return explained + numbers * self.scene.number

    def explain(self, choices: Sequence[Choice]) -> tuple[np.ndarray, np.ndarray]:
        """What the points take under each choice, in nats per point, without what its numbers do, and how many of these there are; raises
        as `lengths` does."""
        scene, drawn, clutter = self.scene, self.scene.drawn, self.scene.clutter
        lattice = 1.5 * math.log(2 * math.pi) + math.log(drawn.sigma) + 2 * math.log(drawn.wide)
        packed = pack_choices(choices)
        changes = _read_changes(*packed, self.settled)
        if (changes[:, 0] < -1).any():
            raise ValueError(f"{choices[int((changes[:, 0] < -1).argmax())]} is no change of {self.settled} parts in their order")
        arrays = self.starts, self.held, self.over, self.selves, self.first, self.lent, self.density
        scale = clutter / scene.box, math.log1p(-clutter) - lattice
        nll, skin, hidden = _lengths(changes, self.settled, *arrays, self.ends, self.end, self.faces, len(scene.points), *scale)
        # places behind the end of a choice have the index -1, and nothing
        own = np.append(self.own, 0)[packed[1]].sum(1) + np.append(self.ways, 0 * self.ways[:1], axis=0)[packed[1]].max(1).sum(1)
        return nll + SKIN * skin, own - hidden


def _probes_of(scene: PointScene, drawn: Sequence[PartSamples]) -> np.ndarray:
    points, normals = (np.concatenate([np.empty((0, 3)), *column]) for column in ([d.points for d in drawn], [d.normals for d in drawn]))
    return scene.drawn.probes(points, normals)


def _find_holders(settled: Sequence[Program], probes: np.ndarray) -> np.ndarray:
    """Which of the settled parts hold the probes, four of each sample, as bits int64 [s, 4]."""
    out = np.zeros(len(probes), np.int64)
    for place, holds in enumerate(kernels.inside_each(settled, probes)):
        out |= holds.astype(np.int64) << (len(settled) - 1 - place)
    return out.reshape(-1, 4)


@njit(nogil=True, cache=True)
def _pack_flags(flags):  # pragma: no cover - compiled
    """Flags [4 s] as the lowest four bits of uint8 [s]."""
    out = np.empty(len(flags) // 4, np.uint8)
    for s in range(len(out)):
        q = 4 * s
        out[s] = flags[q] | flags[q + 1] << 1 | flags[q + 2] << 2 | flags[q + 3] << 3
    return out


@njit(nogil=True, cache=True)
def _read_changes(lengths, index, sign, settled):  # pragma: no cover - compiled
    """Of each choice int64 [c, 5]: the part that is put in (-1 for none; -2 where it is no single change), before which settled part, its
    sign, and as bits the settled parts that stay and those that are united."""
    out = np.zeros((len(lengths), 5), np.int64)
    for c in range(len(lengths)):
        k, put = lengths[c], -1
        for t in range(k):
            put = t if index[c, t] >= settled else put
        if put < 0:
            moved = 0
            while moved < k and not _is_sorted(index[c], k, moved):
                moved += 1
            put = moved if moved < k and not _is_sorted(index[c], k, -1) else -1
        stay, united, last, before = 0, 0, -1, settled
        if 0 <= put < k - 1:
            before = index[c, put + 1]
        for t in range(k):
            if t == put:
                continue
            i = index[c, t]
            if i <= last or i >= settled:
                out[c, 0] = -2
            last = i
            bit = 1 << (settled - 1 - i)
            stay |= bit
            united |= bit if sign[c, t] else 0
        out[c, 0] = -2 if out[c, 0] == -2 else (index[c, put] if put >= 0 else -1)
        out[c, 1], out[c, 2], out[c, 3], out[c, 4] = before, put >= 0 and sign[c, put], stay, united
    return out


@njit(nogil=True, cache=True)
def _is_sorted(row, k, without):  # pragma: no cover - compiled
    """Whether the first `k` entries of a row rise but for the one at `without`."""
    last = -1
    for t in range(k):
        if t != without:
            if row[t] <= last:
                return False
            last = row[t]
    return True


@njit(nogil=True, cache=True)
def _is_in(bits, part_holds, part_united, after, united):  # pragma: no cover - compiled
    """Whether a place is in the solid: the last part that holds it says so. Settled parts are in `bits`, the last in the lowest; a part
    more comes before those in `after`."""
    later = bits & after
    if later:
        return (later & (~later + 1)) & united != 0
    if part_holds:
        return part_united
    return (bits & (~bits + 1)) & united != 0


@njit(nogil=True, cache=True)
def _tell_side(m0, m1, m2, m3, holds, part_united, after, united, faces):  # pragma: no cover - compiled
    """0 where a sample is not on the surface, faces it across a gap, or cannot be seen from its outside (`faces`), 1 where it is, 2 where
    its wall is thin."""
    behind = _is_in(m0, holds & 1, part_united, after, united)
    ahead = _is_in(m1, holds & 2, part_united, after, united)
    if behind == ahead or not faces & (2 if ahead else 1):
        return 0
    deep = _is_in(m2, holds & 4, part_united, after, united)
    far = _is_in(m3, holds & 8, part_united, after, united)
    if ahead:
        deep, far = far, deep
    return 0 if far else 1 if deep else 2


@njit(nogil=True, cache=True)
def _lengths(
    changes, settled, starts, held, over, selves, first, lent, density, ends, at_end, faces, n, strewn, peak_of_one
):  # pragma: no cover - compiled
    count, end = len(changes), starts[settled]
    nll, skin, hidden = np.full(count, np.inf), np.zeros(count), np.zeros(count, np.int64)
    base, base_total = np.zeros(end, np.int8), np.zeros(n)
    whole, united = np.int64((1 << settled) - 1), changes[0, 4]
    for s in range(end):
        base[s] = _tell_side(held[s, 0], held[s, 1], held[s, 2], held[s, 3], 0, False, 0, united, faces[s])
        if base[s]:
            for q in range(first[s], first[s + 1]):
                base_total[lent[q]] += density[q]
    total = np.empty(n)
    for c in range(count):
        put, before, its, stay, now = changes[c]
        after, shown, thin = (1 << (settled - before)) - 1, 0, 0
        gone = whole & ~stay
        own = 0 if put < 0 or put >= settled else 1 << (settled - 1 - put)
        alike = now == united & stay
        for i in range(n):
            total[i] = base_total[i]
        for a in range(settled):
            stays = (stay >> (settled - 1 - a)) & 1 or a == put
            seen = 0
            for s in range(starts[a], starts[a + 1]):
                side = 0
                if stays:
                    m0, m1, m2, m3 = held[s, 0], held[s, 1], held[s, 2], held[s, 3]
                    holds = 0
                    if put >= settled:
                        holds = over[put - settled, s]
                    elif own:
                        holds = (m0 & own != 0) | (m1 & own != 0) << 1 | (m2 & own != 0) << 2 | (m3 & own != 0) << 3
                    if alike and not holds and not (m0 | m1 | m2 | m3) & gone:
                        side = base[s]
                    else:
                        side = _tell_side(m0 & stay, m1 & stay, m2 & stay, m3 & stay, holds, its != 0, after & stay, now, faces[s])
                if side:
                    shown += 1
                    thin += side == 2
                    seen |= 1 << at_end[s]
                if (side > 0) != (base[s] > 0):
                    for q in range(first[s], first[s + 1]):
                        total[lent[q]] += density[q] if side else -density[q]
            if stays:
                hidden[c] += _count_unseen(ends[a], seen)
        if put >= settled:
            seen = 0
            for s in range(starts[put], starts[put + 1]):
                m0, m1, m2, m3 = held[s, 0] & stay, held[s, 1] & stay, held[s, 2] & stay, held[s, 3] & stay
                side = _tell_side(m0, m1, m2, m3, selves[s - end], its != 0, after & stay, now, faces[s])
                if side:
                    shown += 1
                    thin += side == 2
                    seen |= 1 << at_end[s]
                    for q in range(first[s], first[s + 1]):
                        total[lent[q]] += density[q]
            hidden[c] += _count_unseen(ends[put], seen)
        if shown == 0:
            continue
        peak = peak_of_one - math.log(shown)
        clutter, log, i = strewn / math.exp(peak), 0.0, 0
        while i < n:
            product = 1.0
            for j in range(i, min(i + FACTORS, n)):
                product *= clutter + max(total[j], 0.0)
            if product > SMALLEST:
                log += math.log(product)
            else:
                for j in range(i, min(i + FACTORS, n)):
                    log += math.log(clutter + max(total[j], 0.0))
            i += FACTORS
        nll[c] = -(log / n + peak)
        skin[c] = thin / shown
    return nll, skin, hidden


@njit(nogil=True, cache=True)
def _count_unseen(ends, seen):  # pragma: no cover - compiled
    """How many of so many ends, whose bits begin at the second, are not seen; none of a part of which nothing is."""
    unseen = 0
    for k in range(1, ends + 1 if seen else 0):
        unseen += (seen >> k) & 1 == 0
    return unseen
