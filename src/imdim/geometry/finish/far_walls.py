"""Walls of drawings of which nothing is seen lie far out: an edit that moves what covers them does not bring them in sight.

A wall that the next part covers, or that a cut has in the air, may lie level with that part, or a hair beyond what it cuts off. Where both
lie aslant, no number keeps them together: change one, and a slit opens. How far such a wall goes on is of no matter to the solid, so the
lines beside it are prolonged, by a round number up to a tenth of the part, where there is as much room again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import matters
from imdim.geometry.finish.cutter_walls import LEANING
from imdim.geometry.finish.extend import SHRINK
from imdim.geometry.finish.far_ends import round_numbers
from imdim.geometry.finish.posed import PosedPrimitive, diagonal
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, Ring, check_crossings, orient_loops, ring_curves
from imdim.program.repeats import Folded, copies_of
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, leaves, map_leaves

REACH = 0.1  # of the diagonal: further out no wall has to lie
SHORTEST = 1e-3  # of a wall's length, that it keeps


def reach_walls_far(program: Program, folded: Folded | None = None, deadline: Deadline = NEVER) -> Program:
    """The same solid whose drawings' straight walls lie far out where nothing is seen of them.

    `folded`, which `program` is the expansion of, says which leaves have copies: these stay as they are. Past the `deadline` (by default
    never) the others stay.
    """
    placed = [PosedPrimitive(leaf) for leaf in leaves(program)]
    size = diagonal([part for part, s in zip(placed, signs(program), strict=True) if s > 0])
    copies = {} if folded is None else copies_of(folded)
    for i, part in enumerate(placed):
        if part.leaf.kind in ("extrude", "revolve") and len(copies.get(i, (i,))) == 1 and (folded is None or i in copies):
            for loop, curve in _straight_walls(part.leaf):
                placed = placed if deadline.has_passed() else _move_out(program, placed, i, loop, curve, size)
    return map_leaves(program, lambda i, _: placed[i].leaf)


def _straight_walls(leaf: Primitive) -> Iterator[tuple[int, int]]:
    """The loops and curves of walls between two other lines."""
    assert leaf.outline is not None
    for n, ring in enumerate(leaf.outline.loops):
        if not isinstance(ring, Ellipse):
            bent = [bool(curve[4]) for curve in ring_curves(ring)]
            count = len(bent)
            yield from ((n, k) for k in range(count) if count > 2 and not (bent[k - 1] or bent[k] or bent[(k + 1) % count]))


def _move_out(program: Program, placed: list[PosedPrimitive], i: int, loop: int, curve: int, size: float) -> list[PosedPrimitive]:
    """The primitives with one wall further out, furthest first; as they are where something is seen of it, or it lies so far out."""
    leaf = placed[i].leaf
    for step in round_numbers(REACH * size):
        skin = _skin(leaf, loop, curve)
        behind, beyond = _between(leaf, loop, curve, -step, -skin), _between(leaf, loop, curve, skin, 2 * step)
        if behind is not None and not matters(program, placed, i, behind):
            return placed
        moved = None if beyond is None or matters(program, placed, i, beyond) else _with_wall(leaf, loop, curve, step)
        if moved is not None:
            return [*placed[:i], PosedPrimitive(moved), *placed[i + 1 :]]
    return placed


def _skin(leaf: Primitive, loop: int, curve: int) -> float:
    """How thick a gap is that facets leave between a turned wall and what has the same round surface; 0 where that is a plane."""
    assert leaf.outline is not None
    ring = leaf.outline.loops[loop]
    if leaf.kind != "revolve" or isinstance(ring, Ellipse):
        return 0.0
    x, y, u, v, _ = ring_curves(ring)[curve]
    return SHRINK * max(x, u) if y != v else 0.0


def _ends_at(leaf: Primitive, loop: int, curve: int, away: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Where a wall that is so far `away`, outwards, ends on the lines beside it; None where these hardly lead there, or do not part."""
    assert leaf.outline is not None
    ring, mirrored = leaf.outline.loops[loop], orient_loops(leaf.outline.loops)[loop]
    assert not isinstance(ring, Ellipse)
    curves = ring_curves(ring)
    before, own, after = (np.array(curves[k % len(curves)][:4]) for k in (curve - 1, curve, curve + 1))
    along = (own[2:] - own[:2]) / np.linalg.norm(own[2:] - own[:2])
    out = np.array([along[1], -along[0]]) * (1 if mirrored == ring else -1)
    ways = before[2:] - before[:2], after[:2] - after[2:]
    leads = [way / np.linalg.norm(way) for way in ways]
    if any(lead @ out < LEANING for lead in leads):
        return None
    start, end = own[:2] + away * leads[0] / (leads[0] @ out), own[2:] + away * leads[1] / (leads[1] @ out)
    return (start, end) if (end - start) @ along > SHORTEST * np.linalg.norm(own[2:] - own[:2]) else None


def _between(leaf: Primitive, loop: int, curve: int, low: float, high: float) -> Primitive | None:
    """What lies over a wall from so far out to so far out."""
    ends = [_ends_at(leaf, loop, curve, away) for away in (low, high)]
    if ends[0] is None or ends[1] is None:
        return None
    corners = (*ends[0], *ends[1][::-1])
    if leaf.kind == "revolve" and min(x for x, _ in corners) < 0:
        return None
    return replace(leaf, outline=Outline((tuple((float(x), float(y), 0.0) for x, y in corners),)))


def _with_wall(leaf: Primitive, loop: int, curve: int, away: float) -> Primitive | None:
    """The leaf with a wall further out; None where it would meet another one."""
    ends = _ends_at(leaf, loop, curve, away)
    assert leaf.outline is not None
    if ends is None:
        return None
    ring: Ring = leaf.outline.loops[loop]  # type: ignore[assignment]
    corners = list(ring)
    for k, (x, y) in zip((curve, (curve + 1) % len(ring)), ends, strict=True):
        corners[k] = (float(x), float(y), corners[k][2])
    outline = Outline(tuple(tuple(corners) if n == loop else other for n, other in enumerate(leaf.outline.loops)))
    if leaf.kind == "revolve" and outline.bounds[0][0] < 0:
        return None
    try:
        check_crossings(outline)
    except ValueError:
        return None
    return replace(leaf, outline=outline)
