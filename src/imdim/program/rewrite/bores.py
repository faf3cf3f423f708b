"""Bores of turned drawings as features of their own: a hub is a turned body, and what is drilled into it.

The drawing of half a section has its bore as one more line, which ends where the drawing does. Who edits the part wants a hole with a
diameter of its own, which goes on through the plate that the hub stands on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, Vertex, orient_loops
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.turned_walls import Axis, TurnedWall, decimals_for, join_walls, wall_leaf
from imdim.program.tree import FULL_TURN, OPS, Combine, Primitive, Program, combine_all, fold, leaves, longest

TOUCH = 1e-6  # of the largest size: two places, or two radii, are one
Chain = Sequence[Vertex]


def separate_bores(program: Program) -> Program:
    """The same solid, with the straight and conical walls that look to the axis of a turned drawing as cylinders and cones that are cut."""
    return _change_drawings(program, _bore)


def stack_drawings(program: Program) -> Program:
    """As `separate_bores`, and the walls that look away from the axis as a stack of cylinders and cones."""
    return _change_drawings(program, _stack)


def _change_drawings(program: Program, change: Callable[[Primitive, Chain, Chain, float], Program | None]) -> Program:
    slack = TOUCH * longest(leaves(program))

    def changed(_: int, leaf: Primitive) -> Program:
        sides = sides_of(leaf, slack)
        return leaf if sides is None else change(leaf, *sides, slack) or leaf

    return fold(program, changed, {op: partial(Combine, op) for op in OPS})


def _bore(leaf: Primitive, outer: Chain, inner: Chain, slack: float) -> Program | None:
    bores = _parts(leaf, inner, slack)
    if not bores:
        return None
    body = replace(leaf, outline=Outline((_close(outer, slack),)))
    return combine_all("difference", [to_simple(body) or body, *bores])


def _stack(leaf: Primitive, outer: Chain, inner: Chain, slack: float) -> Program | None:
    bores, bodies = _parts(leaf, inner, slack), _parts(leaf, outer, slack)
    return combine_all("difference", [combine_all("union", [*bodies]), *bores]) if bodies and bores is not None else None


def sides_of(leaf: Primitive, slack: float) -> tuple[Chain, Chain] | None:
    """The vertices of a turned ring that look away from the axis and to it, either from the bottom to the top; None for other leaves."""
    if leaf.kind != "revolve" or leaf.size[0] != FULL_TURN or leaf.outline is None or len(leaf.outline.loops) > 1:
        return None
    (ring,) = orient_loops(leaf.outline.loops)
    if isinstance(ring, Ellipse):
        return None
    bottom, top = (_innermost(ring, end, slack) for end in (-1, 1))
    around = [*ring[bottom:], *ring[:bottom]]
    turn = (top - bottom) % len(ring)
    down = [*around[turn:], around[0]]
    # a curve's bulge stands at its start, which is its end on the way back
    up = [(x, y, -down[k - 1][2] if k else 0.0) for k, (x, y, _) in enumerate(down)][::-1]
    return [*around[:turn], (*around[turn][:2], 0.0)], up


def _innermost(ring: Chain, end: int, slack: float) -> int:
    """The number of the vertex at the top (`end` 1) or bottom (-1) that is nearest to the axis."""
    last = max(end * y for _, y, _ in ring)
    return min((k for k, v in enumerate(ring) if end * v[1] >= last - slack), key=lambda k: ring[k][0])


def _close(outer: Chain, slack: float) -> tuple[Vertex, ...]:
    """The loop of a side and the axis, without the vertices that lie on level lines to the axis."""
    (foot, *ring, head) = outer
    if foot[0] > slack:
        if foot[2] or abs(outer[1][1] - foot[1]) > slack:
            ring.insert(0, foot)
        foot = (0.0, foot[1], 0.0)
    if head[0] > slack:
        if outer[-2][2] or abs(outer[-2][1] - head[1]) > slack:
            ring.append(head)
        head = (0.0, head[1], 0.0)
    return (foot, *ring, head)


def _parts(leaf: Primitive, side: Chain, slack: float) -> list[Primitive] | None:
    """Cylinders and cones, from the bottom to the top, of one side of a drawing; None where it has arcs or goes back down."""
    walls: list[TurnedWall] = []
    for (r, low, bulge), (s, high, _) in pairwise(side):
        if bulge or high < low - slack:
            return None
        if high - low > slack and max(r, s) > slack:
            slope = (s - r) / (high - low) if abs(s - r) > slack else 0.0
            walls.append(TurnedWall(low, high, r - slope * low, slope))
    axis, digits = Axis(leaf.center, axes(leaf)[2], leaf.rotation), decimals_for(longest([leaf]))
    return [wall_leaf(wall, axis, digits) for wall in join_walls(walls, slack)]
