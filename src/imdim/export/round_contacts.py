"""Round leaves that touch about one axis, such as a plug in its hole, or what is stacked end on end: an edit keeps that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from imdim.export.outline_joints import Row
from imdim.export.outline_walls import EXACT
from imdim.export.seats import ALIGNED, End, ends_of, place_of
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, longest

HAIR = 1e-3  # of the largest size, by which people let stacked parts overlap


def bind_plugs(parts: Sequence[Primitive], sources: Sequence[int]) -> Iterator[Row]:
    """Equal radii of cylinders that have one wall and meet in it, and equal places along the world's axes across theirs; copies follow
    their `sources`."""
    slack = EXACT * longest(parts)
    rounds = [(i, exact_rotation(p)[:, 2]) for i, p in enumerate(parts) if p.kind == "cylinder" and sources[i] == i]
    for (a, along), (b, other) in combinations(rounds, 2):
        if abs(along @ other) > 1 - ALIGNED**2 and _meet(parts[a], parts[b], along, slack):
            yield {6 * a: 1.0, 6 * b: -1.0}
            yield from ({6 * a + 3 + i: 1.0, 6 * b + 3 + i: -1.0} for i in range(3) if abs(along[i]) <= ALIGNED)


def _meet(a: Primitive, b: Primitive, along: np.ndarray, slack: float) -> bool:
    """Whether two cylinders along a unit vector [3] share a wall."""
    apart = np.subtract(a.center, b.center)
    off = float(apart @ along)
    aside = np.abs(apart - off * along).max()
    return bool(abs(a.size[0] - b.size[0]) <= slack and aside <= slack and abs(off) <= (a.size[1] + b.size[1]) / 2 + slack)


def find_stacked(program: Program, sources: Sequence[int]) -> Iterator[tuple[End, End]]:
    """The ends of round leaves of one sign about one axis that meet, or overlap by a hair, and look at each other, that of the later leaf
    first."""
    parts, sign = list(leaves(program)), signs(program)
    slack, hair = EXACT * longest(parts), HAIR * longest(parts)
    numbers = lower(program)
    ends = {i: list(ends_of(i, p, numbers)) for i, p in enumerate(parts) if p.kind in ("cylinder", "cone") and sources[i] == i}
    for a, b in combinations((i for i in ends if ends[i]), 2):
        if sign[a] == sign[b] and ends[a][0].axis == ends[b][0].axis and _apart_across(parts[a], parts[b], ends[a][0].axis) <= slack:
            pairs = ((e, f) for e in ends[a] for f in ends[b] if e.side != f.side)
            yield from ((f, e) for e, f in pairs if -hair <= e.side * (place_of(f, parts) - place_of(e, parts)) <= slack)


def _apart_across(a: Primitive, b: Primitive, axis: int) -> float:
    """How far the middles of two leaves are apart across an axis."""
    apart = np.abs(np.subtract(a.center, b.center))
    apart[axis] = 0.0
    return float(apart.max())
