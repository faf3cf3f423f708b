"""Which number of a program gives way where two faces are to stay as far apart as they are.

What the name itself says of the later leaf does, if that is what moves one past the other; then where that leaf lies, how deep or how far
off something it is, and the lines of its drawing; then where the earlier one lies, and its lines. Of one drawing the lines come first.
Sizes come last: they are what people know best. Radii, diameters, angles and counts never follow from a distance.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from imdim.export.contacts import ROUND

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

GAP, WALL = "gap", "wall_thickness"  # words of a distance between what is measured to, and of what is left between faces
FROM_EDGE, BETWEEN_AXES = "edge_distance", "axis_distance"  # of one from something round, which is measured to its axis, and between two
OFFSET = "offset"  # of one from the middle of something, or between two faces that look one way
SHOULDER = "shoulder"  # of one between two walls of what is turned
PLACE, END, LINE, EXTENT = range(4)
EXTENTS = frozenset(("length", "width", "height", "spacing", "thickness", "circle"))  # words of sizes
ENDS = frozenset(("depth", "from", "floor", "x", "y", "z"))  # first words of where an end or a middle is


def rank_followers(system: LinearSystem, among: Iterable[int], second: int, first: int, mover: int, radial: bool) -> list[int]:
    """Those of variables `among` that may follow from how far a face of the leaf `second` is from one of `first`, the best first; `mover`
    moves one past the other. A `radial` distance is one between two diameters or radii, of which one follows."""
    order = (LINE, PLACE, END) if first == second else (PLACE, END, LINE)
    ranks: dict[int, int] = {}
    for v in among:
        leaf, kind = system.leaf_of(v), LINE if radial and _is_across(system, v) else _kind_of(system, v)
        if leaf == second and kind in order:
            ranks[v] = 0 if v == mover else 1 + order.index(kind)
        elif leaf == first and kind in (PLACE, LINE):
            ranks[v] = 4 + order.index(kind)
        elif leaf == second and kind == EXTENT:
            ranks[v] = 7
        elif v == mover and kind in order:
            ranks[v] = 8
    return sorted(ranks, key=lambda v: (ranks[v], -v))


def may_give_way(system: LinearSystem, v: int, leaf: int) -> bool:
    """Whether a variable says where a leaf, an end of it or a line of its drawing is."""
    return system.leaf_of(v) == leaf and _kind_of(system, v) in (PLACE, END, LINE)


def _is_across(system: LinearSystem, v: int) -> bool:
    """Whether a variable says how wide something round is."""
    return v >= system.extra and system.extras[v - system.extra][1].endswith(("diameter", "arc_radius"))


def _kind_of(system: LinearSystem, v: int) -> int | None:
    """Whether a variable is the place of a leaf, says where an end of it or a line of its drawing is, or how large either is; None of what
    is round."""
    if v < system.extra:
        return EXTENT if v % 6 < 3 else PLACE
    word = system.extras[v - system.extra][1]
    words = word.split("_")
    if word == WALL or not ROUND.isdisjoint(words):
        return None
    if not EXTENTS.isdisjoint(words):
        return EXTENT
    return END if words[0] in ENDS else LINE
