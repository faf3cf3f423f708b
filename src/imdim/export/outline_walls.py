"""Round walls of outlines and of other leaves that have one axis: what keeps them there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from imdim.export.outline_joints import Row, sum_rows
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import Primitive

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

EXACT = 1e-7  # of the largest size, within which written numbers touch


@dataclass
class RoundWall:
    """A round wall along a world axis: the places of its axis, what they are the sum of, and its radius."""

    leaf: int
    axis: int
    places: Sequence[float]
    rows: Sequence[Row]
    radius: float
    size: Row


def bind_coaxial(system: LinearSystem, circles: Sequence[RoundWall], parts: Sequence[Primitive], sources: Sequence[int]) -> Iterator[Row]:
    """Circles of outlines on the axis of another round wall stay there; radii that are equal on one axis stay equal."""
    slack = EXACT * system.length
    others = [r for i, p in enumerate(parts) if sources[i] == i for r in _round_walls(i, p)]
    for i, circle in enumerate(circles):
        for other in (*circles[:i], *others):
            across = [a for a in range(3) if a != circle.axis]
            if other.axis != circle.axis or any(abs(circle.places[a] - other.places[a]) > slack for a in across):
                continue
            if other.leaf != circle.leaf:
                yield from (sum_rows((circle.rows[a], 1.0), (other.rows[a], -1.0)) for a in across)
                if abs(circle.radius - other.radius) <= slack:
                    yield sum_rows((circle.size, 1.0), (other.size, -1.0))


def _round_walls(leaf: int, p: Primitive) -> Iterator[RoundWall]:
    """The round walls of a cylinder or cone along a world axis; of what is turned about one the axis alone."""
    if p.kind not in ("cylinder", "cone", "revolve"):
        return
    direction = matrix_from_euler(p.rotation)[:, 2]
    axis = next((a for a in range(3) if abs(direction[a]) > 1 - 1e-12), None)
    rows: list[Row] = [{6 * leaf + 3 + a: 1.0} for a in range(3)]
    if p.kind == "revolve" and axis is not None:
        yield RoundWall(leaf, axis, p.center, rows, -1.0, {})
        return
    for column in range(len(p.size) - 1 if axis is not None else 0):
        yield RoundWall(leaf, axis or 0, p.center, rows, p.size[column], {6 * leaf + column: 1.0})
