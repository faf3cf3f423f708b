"""From where features are measured: walls of pockets, distances from edges and middles of what carries them, spacings of pairs.

A designer places what lies near an edge from that edge, what lies in the middle by the middle, heights from the bottom of what carries
it, and the rest from the face or middle that is the origin. A pocket that leaves thin walls of one thickness all about is as large as
these allow; two features that mirror each other, and two equal holes side by side, have a spacing. Each of these is a soft equation
(`Tie`): it says what is free, and gives way to all relations that were found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from imdim.export.seats import TOUCH, End, ends_of, place_of, reach_of
from imdim.geometry.lowering import lower
from imdim.program.constraints import WORLD, Constraint
from imdim.program.roles import cuts_of_each, signs
from imdim.program.tree import Primitive, Program, leaves, longest

THIN = 0.2  # of a pocket's size: a thicker wall is what the pocket leaves, and no size of its own
AT_CORNER = 1.5  # of the width of an added feature: so near an edge a row or grid follows that edge; the spacing of holes is another part's
AT_EDGE = 1 / 3  # of a carrier's size, within which an edge is what something is measured from
UP = 2
ROUND_ABOUT = ("sphere", "torus", "ellipsoid")  # which have a middle, and no plane ends
FACES = {(0, -1): "left", (0, 1): "right", (1, -1): "front", (1, 1): "back", (2, -1): "bottom", (2, 1): "top"}


class Datum(NamedTuple):
    """What a distance along a world axis is measured between: an end of a leaf, or its middle."""

    leaf: int
    axis: int
    end: End | None = None


@dataclass(frozen=True)
class Tie:
    """`own` lies `value` beyond `datum` along the axis: a dimension of leaf `named` if it has a `word`, one for all ties of one `key`.
    Without a `datum` it stays where it is, unless something else moves it.

    What stays `at_corner` does so where the middle of its row or grid is known, too. A tie that `sizes` may settle a size as well as a
    place.
    """

    own: Datum
    datum: Datum | None
    value: float
    named: int = 0
    word: str = ""
    key: tuple[int, float] | None = None
    at_corner: bool = False
    sizes: bool = False


def ties(program: Program, constraints: Sequence[Constraint], hidden: Collection[tuple[int, int, int]] = ()) -> Iterator[Tie]:
    """Walls, spacings and places, those that are meant most first. No place is that of a `hidden` end, by leaf, axis and side."""
    parts, numbers, sign = list(leaves(program)), lower(program), signs(program)
    every = {(e.leaf, e.axis, e.side): e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers)}
    ends = {where: e for where, e in every.items() if e.column >= 0}
    boxes = [reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    slack = TOUCH * longest(parts)
    only = {(leaf, axis): ends[leaf, axis, -side] for leaf, axis, side in sorted(hidden) if (leaf, axis, -side) not in hidden}
    carriers = list(_carriers(program, parts, sign, boxes, slack, only))
    yield from _walls(parts, sign, ends, carriers, slack)
    straight = {leaf for leaf, _, _ in ends}
    placed = []
    for leaf, axis in product(range(1, len(parts)), range(3)):
        drawn = any(parts[i].kind == "extrude" and (i, axis, 1) not in ends for i in (leaf, *carriers[leaf][:1]))
        # the middle of a drawing is anywhere, and nobody measures to that of what lies aslant
        if carriers[leaf] and not drawn and (parts[leaf].kind in ROUND_ABOUT or leaf in straight):
            tie = _place(leaf, carriers[leaf][0], axis, parts, boxes, every, slack, only.get((leaf, axis)))
            placed.append(replace(tie, at_corner=tie.at_corner and sign[leaf] > 0))
    yield from _share_insets([tie for tie in placed if tie.at_corner], slack)
    yield from _spacings(parts, constraints, carriers, slack)
    yield from _pitches(parts, sign, boxes, carriers, {(t.own.leaf, t.own.axis): abs(t.value) for t in placed}, slack)
    yield from (tie for tie in placed if not tie.at_corner)
    yield from (Tie(Datum(end.leaf, end.axis, end), None, 0.0) for end in only.values())


_Ends = Mapping[tuple[int, int, int], End]  # by leaf, axis and side
_Boxes = Sequence[tuple[np.ndarray, np.ndarray]]  # low and high corner [3] of each leaf


def _carriers(
    program: Program, parts: Sequence[Primitive], sign: Sequence[int], boxes: _Boxes, slack: float, only: Mapping[tuple[int, int], End]
) -> Iterator[list[int]]:
    """For each leaf the added ones that its middle lies in, the smallest first; what is added is carried by what comes before it, and by
    the pocket that it stands in. Along an axis on which nothing is seen of one end the `only` other one counts, not the middle; of what is
    added and lies in nothing by that, it is the end that is not seen: that lies in what it sticks out of."""
    cuts, bounds = cuts_of_each(program), np.array(boxes)  # [n, 2, 3]
    volumes, middles = np.prod(bounds[:, 1] - bounds[:, 0], axis=1), bounds.mean(1)
    buried = middles.copy()
    for (leaf, axis), end in only.items():
        middles[leaf, axis] = place_of(end, parts)
        # what stands on something has seats, and is placed in the plane by itself
        buried[leaf, axis] = middles[leaf, axis] if axis == UP else 2 * buried[leaf, axis] - middles[leaf, axis]
    added = np.array(sign) > 0
    pockets = np.array([not a and p.kind == "box" for a, p in zip(added, parts, strict=True)])
    for leaf, middle in enumerate(middles):
        before = np.arange(len(parts)) < leaf
        stands_in = pockets & before
        stands_in[cuts[leaf]] = False
        may = (added & before) | stands_in if added[leaf] else added
        held = [
            np.flatnonzero(may & (bounds[:, 0] - slack <= place).all(1) & (place <= bounds[:, 1] + slack).all(1))
            for place in ((middle, buried[leaf]) if added[leaf] else (middle,))
        ]
        within = next(filter(len, held), held[0])
        yield within[np.argsort(volumes[within], kind="stable")].tolist()


def _walls(parts: Sequence[Primitive], sign: Sequence[int], ends: _Ends, carriers: Sequence[list[int]], slack: float) -> Iterator[Tie]:
    for leaf, part in enumerate(parts):
        carrier = next((c for c in carriers[leaf] if parts[c].kind == "box"), None)
        if sign[leaf] > 0 or part.kind != "box" or carrier is None:
            continue
        shell: list[tuple[int, int, float, str]] = []
        floors: list[tuple[int, int, float, str]] = []
        for axis in range(3):
            if (carrier, axis, 1) not in ends or (leaf, axis, 1) not in ends:
                continue
            low, high = (side * (place_of(ends[carrier, axis, side], parts) - place_of(ends[leaf, axis, side], parts)) for side in (-1, 1))
            size = part.size[ends[leaf, axis, 1].column]
            thin = [(side, gap) for side, gap in ((-1, low), (1, high)) if slack < gap <= THIN * size]
            if len(thin) == 2 and abs(low - high) <= slack:
                shell += [(axis, side, low, "wall") for side, _ in thin]
            elif len(thin) == 1 and min(low, high) <= slack:
                floors += [(axis, *thin[0], "floor")]
        # what is open on one side has a depth, unless thin walls all about it make it a shell
        for axis, side, gap, word in shell + (floors if len(shell) == 4 else []):
            own, face = ends[leaf, axis, side], ends[carrier, axis, side]
            key = (carrier, round(gap / slack / 2))
            yield Tie(Datum(leaf, axis, own), Datum(carrier, axis, face), -side * gap, carrier, word, key, sizes=True)


def _spacings(parts: Sequence[Primitive], constraints: Sequence[Constraint], carriers: Sequence[list[int]], slack: float) -> Iterator[Tie]:
    """Of two leaves on one carrier that have a third midway how far they are apart along the axis across."""
    for c in constraints:
        opposite = (c.kind == "symmetric" and len(c.of) == 3) or (c.kind == "circular" and len(c.of) == 2)
        a, b = (ref.leaf for ref in c.of[:2]) if opposite else (WORLD, WORLD)
        if min(a, b) < 0 or carriers[a][:1] != carriers[b][:1]:
            continue
        apart = np.subtract(parts[b].center, parts[a].center)
        along = np.flatnonzero(np.abs(apart) > slack).tolist()
        for axis in along:
            word = "spacing" if len(along) == 1 else f"spacing_{'xyz'[axis]}"
            for own, other, way in ((b, a, 1.0), (a, b, -1.0)):
                yield Tie(Datum(own, axis), Datum(other, axis), way * float(apart[axis]), min(a, b), word, (-1 - min(a, b), axis))


def _pitches(
    parts: Sequence[Primitive],
    sign: Sequence[int],
    boxes: _Boxes,
    carriers: Sequence[list[int]],
    away: Mapping[tuple[int, int], float],
    slack: float,
) -> Iterator[Tie]:
    """Of two equal round cuts side by side, where no third is, how far they are apart, if the further one is nearer to the other than to
    what it would be measured from: each is so far `away` from that, by leaf and axis."""
    twins: dict[object, list[int]] = {}
    for leaf, (part, s) in enumerate(zip(parts, sign, strict=True)):
        if s < 0 and part.kind == "cylinder" and carriers[leaf]:
            key = (carriers[leaf][0], part.size[0], *np.round((boxes[leaf][1] - boxes[leaf][0]) / slack / 2))
            twins.setdefault(key, []).append(leaf)
    for a, b in (pair for pair in twins.values() if len(pair) == 2):
        apart = np.subtract(parts[b].center, parts[a].center)
        along = np.flatnonzero(np.abs(apart) > slack).tolist()
        if len(along) != 1:
            continue
        axis = along[0]
        first, last = (a, b) if away.get((a, axis), 0.0) <= away.get((b, axis), 0.0) else (b, a)
        step = float(apart[axis]) * (1 if last == b else -1)
        if abs(step) < away.get((last, axis), 0.0):
            yield Tie(Datum(last, axis), Datum(first, axis), step, min(a, b), "spacing")


def _share_insets(corners: Sequence[Tie], slack: float) -> Iterator[Tie]:
    """Ties at corners; a leaf that is as far from two edges has one inset."""
    keys = [(tie.own.leaf, round(abs(tie.value) / slack / 2)) for tie in corners]
    often = Counter(keys)
    yield from (replace(tie, word="inset", key=key) if often[key] == 2 else tie for tie, key in zip(corners, keys, strict=True))


def _place(
    leaf: int, carrier: int, axis: int, parts: Sequence[Primitive], boxes: _Boxes, ends: _Ends, slack: float, only: End | None
) -> Tie:
    """Where a leaf lies in its carrier: in the middle, so far from an edge, or from the middle. It is the `only` end that is seen which is
    measured to, if there is one."""
    at_middle = parts[leaf].center[axis] if only is None else place_of(only, parts)
    middle = at_middle - parts[carrier].center[axis]
    turned = parts[carrier].kind == "revolve" and (carrier, axis, 1) in ends  # whose middle is anywhere, along its axis
    if abs(middle) <= slack and not turned:
        return Tie(Datum(leaf, axis, only), Datum(carrier, axis), 0.0)
    from_middle = Tie(Datum(leaf, axis, only), Datum(carrier, axis), float(middle), leaf, "xyz"[axis])
    if (carrier, axis, 1) not in ends:
        return from_middle
    faces = {side: ends[carrier, axis, side] for side in (-1, 1)}
    owns = {side: only or ends.get((leaf, axis, side)) for side in (-1, 1)}

    def inset(side: int) -> float:
        own = owns[side]
        at = parts[leaf].center[axis] if own is None else place_of(own, parts)
        return side * (place_of(faces[side], parts) - at)

    room = place_of(faces[1], parts) - place_of(faces[-1], parts)
    near = min((-1, 1), key=lambda side: (abs(inset(side)), side))
    grounded = [side for side in (-1, 1) if abs(place_of(faces[side], parts)) <= slack]
    if axis == UP:
        # heights are above what something is on, but what lies in the top stays there
        near = 1 if abs(inset(1)) <= slack < abs(inset(-1)) else -1
    elif abs(inset(near)) > AT_EDGE * room:
        if abs(parts[carrier].center[axis]) <= slack and not turned:
            return from_middle
        near = grounded[0] if grounded else near
    far = inset(near)
    own = Datum(leaf, axis, owns[near])
    if abs(far) <= slack:
        return Tie(own, Datum(carrier, axis, faces[near]), 0.0)
    to_middle = near * (place_of(faces[near], parts) - parts[leaf].center[axis])
    at_corner = 0 < to_middle <= AT_CORNER * (boxes[leaf][1] - boxes[leaf][0])[axis]
    return Tie(own, Datum(carrier, axis, faces[near]), -near * far, leaf, f"from_{FACES[axis, near]}", at_corner=at_corner)
