"""A vertex of an outline whose numbers are sums: of variables while relations are solved, of names once they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")
U = TypeVar("U")


@dataclass(frozen=True)
class Center(Generic[T]):
    """The centre of an arc, which runs counter-clockwise where `way` is 1, else -1."""

    x: T
    y: T
    way: int


@dataclass(frozen=True)
class Reach(Generic[T]):
    """How far from a centre a circle reaches along one axis (0 for x), to the side `sign`, `off` from the centre along the other one."""

    axis: int
    sign: int
    radius: T
    off: T


@dataclass(frozen=True)
class DrawnVertex(Generic[T]):
    """The coordinates of a vertex, and the bulge of the arc from it or the centre that it runs about.

    With a `reach` the coordinate along its axis is only the centre's.
    """

    x: T
    y: T
    bulge: float | Center[T]
    reach: Reach[T] | None = None

    def map(self, change: Callable[[T], U]) -> DrawnVertex[U]:
        """With all numbers changed."""
        bulge, reach = self.bulge, self.reach
        return DrawnVertex(
            change(self.x),
            change(self.y),
            Center(change(bulge.x), change(bulge.y), bulge.way) if isinstance(bulge, Center) else bulge,
            None if reach is None else Reach(reach.axis, reach.sign, change(reach.radius), change(reach.off)),
        )

    def numbers(self) -> Iterator[T]:
        """All numbers but the bulge."""
        yield from (self.x, self.y)
        if isinstance(self.bulge, Center):
            yield from (self.bulge.x, self.bulge.y)
        if self.reach is not None:
            yield from (self.reach.radius, self.reach.off)
