"""Diameters as names: cylinders and cones are measured across, and what is half of that in a program follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imdim.program.repeats import Folded, instances
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem


def add_diameters(system: LinearSystem, parts: Sequence[Primitive], folded: Folded | None) -> Sequence[int]:
    """A variable for each diameter of cylinders and cones, a point left out; copies follow what they are copies of, their sources, which
    are returned."""
    sources = list(range(len(parts))) if folded is None else [source for source, _ in instances(folded)]
    for leaf, (part, source) in enumerate(zip(parts, sources, strict=True)):
        if part.kind not in ("cylinder", "cone") or source != leaf:
            continue
        radii = part.size[:-1]
        for column in (c for c, radius in enumerate(radii) if radius > 0):
            word = "diameter" if column == radii.index(max(radii)) else "narrow_diameter"
            system.rows.append({6 * leaf + column: 1.0, system.new(leaf, word, 2 * radii[column]): -0.5})
    return sources
