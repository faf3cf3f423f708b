"""Diameters as names: a cylinder is measured across, and what is half of that in a program follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imdim.program.repeats import Folded, instances
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem


def add_diameters(system: LinearSystem, parts: Sequence[Primitive], folded: Folded | None) -> None:
    """A variable for the diameter of each cylinder; copies follow what they are copies of."""
    sources = list(range(len(parts))) if folded is None else [source for source, _ in instances(folded)]
    for leaf, (part, source) in enumerate(zip(parts, sources, strict=True)):
        if part.kind == "cylinder" and source == leaf:
            system.rows.append({6 * leaf: 1.0, system.new(leaf, "diameter", 2 * part.size[0]): -0.5})
