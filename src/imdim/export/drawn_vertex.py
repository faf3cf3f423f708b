"""Loops of outlines whose numbers are sums: of variables while relations are solved, of names once they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
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
class BendRadius(Generic[T]):
    """The radius of an arc of less than half a turn to the next vertex, counter-clockwise where `way` is 1, else -1.

    0 is an arc that rounds a corner: this vertex and the next one are both where the lines before and after it would meet. Where both are
    at one place and `way` is not 0, that is the centre of an arc that both these lines touch.
    """

    radius: T
    way: int


@dataclass(frozen=True)
class BendAngle(Generic[T]):
    """The degrees by which an arc turns, counter-clockwise where `way` is 1, else -1."""

    angle: T
    way: int


@dataclass(frozen=True)
class Touching:
    """An arc that begins as the curve before it ends (`side` -1), or ends as the one after it begins (1); in a cusp it does so the other
    way, back along that curve."""

    side: int
    is_cusp: bool = False

    @property
    def word(self) -> str:
        """What the texts write."""
        return ("cusp " if self.is_cusp else "") + ("before" if self.side < 0 else "after")


@dataclass(frozen=True)
class Reach(Generic[T]):
    """How far from a centre a circle reaches along one axis (0 for x), to the side `sign`, `off` from the centre along the other one."""

    axis: int
    sign: int
    radius: T
    off: T


Bend = float | Center[T] | BendRadius[T] | BendAngle[T] | Touching


@dataclass(frozen=True)
class DrawnVertex(Generic[T]):
    """The coordinates of a vertex, and the bulge of the arc from it, or what else says how it bends.

    With a `reach` the coordinate along its axis is only the centre's.
    """

    x: T
    y: T
    bulge: Bend[T]
    reach: Reach[T] | None = None

    def map(self, change: Callable[[T], U]) -> DrawnVertex[U]:
        """With all numbers changed."""
        reach = self.reach
        return DrawnVertex(
            change(self.x),
            change(self.y),
            _map_bend(self.bulge, change),
            None if reach is None else Reach(reach.axis, reach.sign, change(reach.radius), change(reach.off)),
        )

    def numbers(self) -> Iterator[T]:
        """All numbers but the bulge."""
        yield from (self.x, self.y, *numbers_of_bend(self.bulge))
        if self.reach is not None:
            yield from (self.reach.radius, self.reach.off)


@dataclass(frozen=True)
class DrawnPolygon(Generic[T]):
    """A regular polygon: how many sides, how large, the centre, and the degrees from the x axis to a corner.

    Its size is the radius of the circle through its corners or, `is_across_flats`, twice that of the circle that its sides touch.
    """

    sides: T
    size: T
    x: T
    y: T
    angle: T
    is_across_flats: bool = False

    @property
    def function(self) -> str:
        """What draws it in the texts."""
        return "across_flats" if self.is_across_flats else "ngon"

    def map(self, change: Callable[[T], U]) -> DrawnPolygon[U]:
        """With all numbers changed."""
        return DrawnPolygon(*map(change, self.numbers()), is_across_flats=self.is_across_flats)

    def numbers(self) -> Iterator[T]:
        """All numbers."""
        yield from (self.sides, self.size, self.x, self.y, self.angle)


@dataclass(frozen=True)
class DrawnEllipse(Generic[T]):
    """An ellipse: both semi-axes, the centre, and the degrees from the x axis to the first semi-axis."""

    rx: T
    ry: T
    x: T
    y: T
    angle: T

    def map(self, change: Callable[[T], U]) -> DrawnEllipse[U]:
        """With all numbers changed."""
        return DrawnEllipse(*map(change, self.numbers()))

    def numbers(self) -> Iterator[T]:
        """All numbers."""
        yield from (self.rx, self.ry, self.x, self.y, self.angle)


DrawnRing = tuple[DrawnVertex[T], ...] | DrawnPolygon[T] | DrawnEllipse[T]


def map_ring(ring: DrawnRing[T], change: Callable[[T], U]) -> DrawnRing[U]:
    """A loop with all numbers changed."""
    return tuple(v.map(change) for v in ring) if isinstance(ring, tuple) else ring.map(change)


def numbers_of(ring: DrawnRing[T]) -> Iterator[T]:
    """All numbers of a loop but bulges."""
    yield from (number for v in ring for number in v.numbers()) if isinstance(ring, tuple) else ring.numbers()


def numbers_of_bend(bend: Bend[T]) -> Iterator[T]:
    """All numbers that an arc is told by, but for a bulge."""
    if isinstance(bend, Center):
        yield from (bend.x, bend.y)
    if isinstance(bend, BendRadius):
        yield bend.radius
    if isinstance(bend, BendAngle):
        yield bend.angle


def turn_round(bend: Bend[T]) -> Bend[T]:
    """The bend of the same arc run from its other end."""
    if isinstance(bend, int | float):
        return -bend
    return replace(bend, side=-bend.side) if isinstance(bend, Touching) else replace(bend, way=-bend.way)


def _map_bend(bend: Bend[T], change: Callable[[T], U]) -> Bend[U]:
    if isinstance(bend, Center):
        return Center(change(bend.x), change(bend.y), bend.way)
    if isinstance(bend, BendRadius):
        return BendRadius(change(bend.radius), bend.way)
    return BendAngle(change(bend.angle), bend.way) if isinstance(bend, BendAngle) else bend
