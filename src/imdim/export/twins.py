"""Which features of a program are twins: equal all over, by relations that say so."""

from __future__ import annotations

from collections.abc import Sequence

from imdim.program.constraints import Constraint
from imdim.program.tree import Primitive


def find_twins(constraints: Sequence[Constraint], parts: Sequence[Primitive], slack: float) -> dict[int, int]:
    """For each leaf that is tied to others by a size, and as large as they are along all its axes, the number of the first of them."""
    found: dict[int, int] = {}
    for constraint in (c for c in constraints if c.kind == "equal"):
        for ref in constraint.of:
            alike = (other.leaf for other in constraint.of if _are_congruent(parts[other.leaf], parts[ref.leaf], slack))
            first = min((found.get(leaf, leaf) for leaf in alike), default=ref.leaf)
            found[ref.leaf] = min(first, found.get(ref.leaf, first))
    return found


def _are_congruent(a: Primitive, b: Primitive, slack: float) -> bool:
    """Whether two primitives without outlines have the same sizes."""
    same = a.kind == b.kind and a.outline is None and b.outline is None
    return same and all(abs(s - t) <= slack for s, t in zip(a.size, b.size, strict=True))
