"""Cuts through parts that lie aslant: as long as what they go through is thick, in its own direction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from imdim.export.seats import TOUCH, world_axis
from imdim.geometry.lowering import lower
from imdim.program.roles import cuts_of_each, signs
from imdim.program.tree import FLAT_ENDS, PRISMS, Primitive, Program, envelope, leaves, longest

PARALLEL = 1e-9


class _LeafSpan(NamedTuple):
    """From where to where a leaf reaches along one of its axes, a unit vector [3]; `column` is that size."""

    leaf: int
    column: int
    along: np.ndarray
    low: float
    high: float


def pass_aslant(program: Program) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Leaf and column of the length of each cut that leaves a tilted part at both ends, and those of the size that it passes."""
    parts, sign, cuts, turns = list(leaves(program)), signs(program), cuts_of_each(program), lower(program).rotations
    spans = [span for i, p in enumerate(parts) for span in _spans(i, p, turns[i])]
    slack = TOUCH * longest(parts)
    for own in (s for s in spans if sign[s.leaf] < 0 and world_axis(s.along) is None):
        met = [s for s in spans if sign[s.leaf] > 0 and own.leaf in cuts[s.leaf] and abs(s.along @ own.along) > 1 - PARALLEL]
        met = [s for s in met if _meets(parts, turns, own, s)]
        # through several, which of them it follows is not known
        if len(met) == 1 and _is_within(met[0], own, slack):
            yield (own.leaf, own.column), (met[0].leaf, met[0].column)


def _spans(leaf: int, p: Primitive, turn: np.ndarray) -> Iterator[_LeafSpan]:
    for axis, column in FLAT_ENDS[p.kind].items() if p.kind in PRISMS else ():
        along, half = turn[:, axis], p.size[column] / 2
        yield _LeafSpan(leaf, column, along, float(along @ p.center) - half, float(along @ p.center) + half)


def _meets(parts: Sequence[Primitive], turns: np.ndarray, own: _LeafSpan, other: _LeafSpan) -> bool:
    """Whether the middle line of a cut passes the box of another leaf across its axis."""
    box, turn = envelope(parts[other.leaf]), turns[other.leaf]
    half = np.array(box.size if box.kind == "box" else (2 * box.size[0], 2 * box.size[0], box.size[-1])) / 2
    off = np.abs(turn.T @ np.subtract(parts[own.leaf].center, box.center))
    return bool((off <= half)[np.abs(turn.T @ own.along) < 0.5].all())


def _is_within(inner: _LeafSpan, outer: _LeafSpan, slack: float) -> bool:
    """Whether a leaf's span, by its middle and half length, lies within another one's."""
    way = 1 if inner.along @ outer.along > 0 else -1
    low, high = sorted((way * inner.low, way * inner.high))
    return outer.low <= low + slack and high - slack <= outer.high
