"""Parts of a program that change nothing are left out: what the others add or cut does all that they do."""

from __future__ import annotations

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import matters, zone_within
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.solid import to_manifold
from imdim.program.paths import leaf_paths, without
from imdim.program.tree import Program, leaves

PROBED = ("box", "cylinder", "cone", "extrude", "revolve")  # kinds that a few points may show to matter


def drop_idle(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid without the primitives that it does not depend on, the last ones first: of two that do the same the first stays.

    Past the `deadline` (by default never) the others stay.
    """
    least, placed = NOTHING * to_manifold(program).volume(), [PosedPrimitive(leaf) for leaf in leaves(program)]
    for i in reversed(range(len(leaf_paths(program)))):
        if deadline.has_passed():
            break
        if _is_idle(program, placed, i, least) and (fewer := without(program, [leaf_paths(program)[i][0]])) is not None:
            program, placed = fewer, [PosedPrimitive(leaf) for leaf in leaves(fewer)]
    return program


def _is_idle(program: Program, placed: list[PosedPrimitive], i: int, least: float) -> bool:
    """Whether the solid depends on primitive `i` in less than a volume."""
    own = placed[i]
    if own.leaf.kind in PROBED and matters(program, placed, i, own.leaf):
        return False
    least = min(least, NOTHING * own.solid.volume())
    return zone_within(program, placed, i, own, own.solid, least).volume() <= least
