"""Tubes and rods that plug a hole: what a person draws in their place.

A search may find that a boss with a bore, such as one that bridges a groove, is a hole as wide as the boss with a tube in it: its wall is
then drawn twice, and wherever one of the two moves, slits open between them. As a boss, with its bore cut last, it has one wall. And two
holes that meet head on, with a wall between their ends, may be one hole with a rod in it: each hole then has a depth of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.webs import is_as_near
from imdim.program.outline import Outline, Vertex
from imdim.program.paths import Path, leaf_paths, polarity, without
from imdim.program.rewrite.bores import sides_of
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Program, combine_all, leaves, longest, replace_leaves

NEAR = 1e-3  # of the largest size, by which radii, and axes, of a tube and its hole may differ
TOUCH = 1e-6  # of it: two places are one
PARALLEL = 1e-4  # of a sine


def bore_plugs(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` with a boss and a bore in place of each tube that plugs a hole, where the target `solid` allows it: all at once, or else
    one after the other.

    Both are in one frame. No body, hole or void comes or goes that the target has not, and the IoU with it stays. Past the `deadline` (by
    default never) the others stay.
    """
    for together in (True, False):
        while trial := next((t for t in _trials(program, together) if not deadline.has_passed() and is_as_near(t, program, solid)), None):
            program = trial
    return program


def part_holes(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` with two holes in place of each that a rod of its width plugs somewhere between its ends, where the target `solid` allows
    it. Both are in one frame, and time is as for `bore_plugs`."""
    while trial := next((t for t in _parted(program) if not deadline.has_passed() and is_as_near(t, program, solid)), None):
        program = trial
    return program


def _parted(program: Program) -> Iterator[Program]:
    """The program with one of its holes that have a rod in them parted by it."""
    found, size = leaf_paths(program), longest(leaves(program))
    rods = [(path, leaf) for path, leaf in found if leaf.kind == "cylinder" and polarity(program, path) > 0]
    holes = [(path, leaf) for path, leaf in found if leaf.kind == "cylinder" and polarity(program, path) < 0]
    for at, rod in rods:
        for place, hole in holes:
            if not _is_plugged(hole, rod, NEAR * size):
                continue
            along = np.asarray(axes(hole)[2])
            middle, reach = float(np.subtract(rod.center, hole.center) @ along), hole.size[1] / 2
            low, high = middle - rod.size[1] / 2, middle + rod.size[1] / 2
            rest = without(program, {at, place})
            if rest is None or low <= -reach + TOUCH * size or high >= reach - TOUCH * size:
                continue
            ends = (_piece(hole, along, -reach, low), _piece(hole, along, high, reach))
            yield combine_all("difference", [rest, *ends])


def _piece(hole: Primitive, along: np.ndarray, low: float, high: float) -> Primitive:
    """A hole between two levels of its axis, from its middle."""
    middle = np.asarray(hole.center) + (low + high) / 2 * along
    return replace(hole, size=(hole.size[0], high - low), center=tuple(middle.tolist()))


class _Plug(NamedTuple):
    """A leaf that is a `boss` less a `bore`, and the paths of the holes that it plugs."""

    number: int
    boss: Primitive
    bore: Primitive
    holes: set[Path]


def _trials(program: Program, together: bool) -> Iterator[Program]:
    """The program with its plugs as bosses with bores, all `together` or each alone."""
    found, size = leaf_paths(program), longest(leaves(program))
    plugs: list[_Plug] = []
    for number, (path, leaf) in enumerate(found):
        drawn = _boss_and_bore(leaf, TOUCH * size) if polarity(program, path) > 0 else None
        holes = {p for p, other in found if drawn and polarity(program, p) < 0 and _is_plugged(other, drawn[0], NEAR * size)}
        if drawn is not None and holes:
            plugs.append(_Plug(number, *drawn, holes))
    groups = [plugs] if together and plugs else [[plug] for plug in plugs]
    for group in groups:
        if (trial := _bored(program, group)) is not None:
            yield trial


def _bored(program: Program, plugs: list[_Plug]) -> Program | None:
    bosses = replace_leaves(program, {plug.number: plug.boss for plug in plugs})
    filled = without(bosses, set().union(*(plug.holes for plug in plugs)))
    return None if filled is None else combine_all("difference", [filled, *(plug.bore for plug in plugs)])


def _boss_and_bore(leaf: Primitive, slack: float) -> tuple[Primitive, Primitive] | None:
    """A cylinder and what is turned out of it, of which a turned drawing is the difference; None for others."""
    sides = sides_of(leaf, slack)
    if sides is None:
        return None
    outer, inner = sides
    radius = max(x for x, _, _ in outer)
    lines = ((a, b) for a, b in pairwise(outer) if not a[2])
    wall = [(a[1], b[1]) for a, b in lines if max(abs(a[0] - radius), abs(b[0] - radius)) <= slack]
    low, high = (end(y for _, y, _ in outer) for end in (min, max))
    if len(wall) != 1 or max(abs(wall[0][0] - low), abs(wall[0][1] - high)) > slack or min(x for x, _, _ in inner) <= slack:
        return None
    first, last = inner[0], inner[-1]
    around: list[Vertex] = [(0.0, first[1], 0.0), *inner[:-1], (last[0], last[1], 0.0), (0.0, last[1], 0.0)]
    middle = np.asarray(leaf.center) + (low + high) / 2 * np.asarray(axes(leaf)[2])
    boss = Primitive("cylinder", (radius, high - low), tuple(middle.tolist()), leaf.rotation)
    return boss, replace(leaf, outline=Outline((tuple(around),)))


def _is_plugged(hole: Primitive, boss: Primitive, slack: float) -> bool:
    """Whether a hole is as wide as a boss about the same axis that reaches into it."""
    if hole.kind != "cylinder" or abs(hole.size[0] - boss.size[0]) > slack:
        return False
    along, apart = np.asarray(axes(boss)[2]), np.subtract(hole.center, boss.center)
    off = float(apart @ along)
    lean = np.linalg.norm(np.cross(along, axes(hole)[2]))
    return bool(lean < PARALLEL and np.linalg.norm(apart - off * along) < slack and abs(off) < (hole.size[1] + boss.size[1]) / 2)
