"""Pairs of parts, as mirror images or a step apart."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

from imdim.program.motions import mirror
from imdim.program.patterns.candidate import COSTS, NUMBERS, Bench, RepeatCandidate, classes, first_leaf
from imdim.program.patterns.congruence import Node, match
from imdim.program.repeats import Repeat
from imdim.program.rewrite.containment import dot
from imdim.program.tree import Vec3
from imdim.program.vectors import is_forward, minus


def pairs(bench: Bench, parts: list[Node], left: list[int]) -> list[RepeatCandidate]:
    """Pairs of parts that one plane or one step takes to each other, as long as two primitives or more are saved."""
    found: list[RepeatCandidate] = []
    for group in classes(parts, left, bench.tolerance):
        for i, j in combinations(group, 2):
            shift = minus(parts[j].anchor, parts[i].anchor)
            length = math.hypot(*shift)
            if length > 8 * bench.tolerance:
                found += [f for r in _pair_repeats(bench, parts[i], parts[j], shift, length) for f in bench.verify(parts, (i, j), r, 0.0)]
    out: list[RepeatCandidate] = []
    while True:
        best = max((_largest(bench, parts, found, p.repeat) for p in found), key=lambda c: c.saved, default=None)
        if best is None or sum(parts[row[0]].size for row in best.members) < 2:
            return out
        out.append(best)
        used = {i for row in best.members for i in row}
        found = [p for p in found if not used & set(p.members[0])]


def _pair_repeats(bench: Bench, a: Node, b: Node, shift: Vec3, length: float) -> Iterator[Repeat]:
    x, y, z = (round(s / length, 12) + 0.0 for s in shift)
    middle = tuple((p + q) / 2 for p, q in zip(a.anchor, b.anchor, strict=True))
    normal, sign = (x, y, z), 1.0 if is_forward((x, y, z)) else -1.0
    if match(a, b, mirror(middle, normal), bench.tolerance) is not None:  # type: ignore[arg-type]
        normal = (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
        along = dot(middle, normal)  # type: ignore[arg-type]
        point = bench.tidy((along * normal[0], along * normal[1], along * normal[2]))
        yield Repeat("mirror", first_leaf(a), (2,), point=point, axis=normal)
    if sign > 0:
        yield Repeat("linear", first_leaf(a), (2,), (bench.tidy(shift),))


def _largest(bench: Bench, parts: list[Node], pairs: list[RepeatCandidate], like: Repeat) -> RepeatCandidate:
    """All pairs with the motion of one, none twice."""
    used: set[int] = set()
    rows: list[RepeatCandidate] = []
    for pair in pairs:
        if not used & set(pair.members[0]) and bench.same_motions(pair.repeat, like):
            used |= set(pair.members[0])
            rows.append(_facing(parts, pair, rows[0].members[0][0]) if rows and like.kind == "mirror" else pair)
    saved = sum(parts[r.members[0][0]].size for r in rows) * NUMBERS - COSTS[like.kind]
    return RepeatCandidate(like, tuple(r.members[0] for r in rows), tuple(r.orders[0] for r in rows), saved + (like.kind == "mirror") * 2.5)


def _facing(parts: list[Node], pair: RepeatCandidate, first: int) -> RepeatCandidate:
    """A pair of mirror images with that one first which is on the side of part `first`, so that firsts may repeat in turn."""
    sides = [dot(minus(parts[i].anchor, pair.repeat.point), pair.repeat.axis) for i in (first, pair.members[0][0])]
    if sides[0] * sides[1] > 0:
        return pair
    (a, b), (of_a, of_b) = pair.members[0], pair.orders[0]
    return replace(pair, members=((b, a),), orders=((of_b, of_a),))
