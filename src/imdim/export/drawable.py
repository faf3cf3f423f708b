"""Which names, a tenth larger or smaller, leave a drawing that crosses itself, or arcs that cannot be as they are told.

Faces that pass each other along an axis are told by where they are. Lines aslant and arcs are not: of these the drawing is drawn with the
name at its other values.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, product
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from imdim.export.bends import Arc, polygon_across_flats, regular_polygon, to_loop
from imdim.export.drawn_vertex import (
    Bend,
    BendAngle,
    BendRadius,
    Center,
    DrawnEllipse,
    DrawnPolygon,
    DrawnRing,
    DrawnVertex,
    Touching,
    map_ring,
    numbers_of,
)
from imdim.export.outline_joints import Row, sum_rows
from imdim.export.outline_rows import Drawn, Sum
from imdim.program.outline import CrossingError, Loop, Outline, check_crossings, ellipse

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

TENTH = 0.1  # of a name's value
RADIUS_STEP = "radius_step"  # the word of how much larger one arc's radius is than another's
MOST_WORK = 5000  # corners of a drawing times the names that move it: half a second, and more are not looked at
SAME = 1e-9  # of the largest size, within which numbers are one

T = TypeVar("T")
_Corner = tuple[int, int]  # of a drawing: its loop, and which of that
_Solved = Mapping[int, Mapping[int, float]]


class Fault(NamedTuple):
    """Why a drawing cannot be: the `pairs` of corners that may be too near, and the starts of both `curves` where two cross."""

    pairs: tuple[tuple[_Corner, _Corner], ...] = ()
    curves: tuple[_Corner, ...] = ()


NONE = Fault()


class Undrawn(NamedTuple):
    """A drawing, of a `leaf`, that a name, which is a `variable`, spoils."""

    leaf: int
    variable: int
    fault: Fault


class Distance(NamedTuple):
    """What is a row of variables is `value`, and what to call that; one between radii `is_radial`."""

    row: Row
    value: float
    word: str
    is_radial: bool = False


class Drawings:
    """The drawings of a program, those of copies once."""

    def __init__(self, system: LinearSystem) -> None:
        self._system = system
        once = {id(drawn): leaf for leaf, drawn in reversed(system.drawn.items())}
        self._rings = {leaf: system.drawn[leaf] for leaf in sorted(once.values())}
        self._known: dict[tuple[int, bytes], Fault] = {}

    def find_undrawn(self, solved: _Solved, unseen: Collection[int]) -> list[Undrawn]:
        """What a tenth of a name spoils, each drawing and name once; counts are not looked at."""
        return [u for leaf, rings in self._rings.items() for u in self._find_in(leaf, rings, solved, unseen)]

    def _find_in(self, leaf: int, rings: Drawn, solved: _Solved, unseen: Collection[int]) -> Iterator[Undrawn]:
        numbers = [number for ring in rings for number in numbers_of(ring)]
        start, slack = np.array([n.value for n in numbers]), SAME * self._system.length
        moves = self._moves(numbers, solved)
        names = [v for v in np.flatnonzero(np.abs(moves).max(0) > slack).tolist() if v not in unseen and not self._is_count(v)]
        corners = sum(len(ring) if isinstance(ring, tuple) else 1 for ring in rings)
        # one that cannot be drawn now has corners whose own digits are put right by names
        if corners * len(names) > MOST_WORK or self._draw(leaf, rings, start).pairs:
            return
        for v in names:
            drawn = (self._draw(leaf, rings, start + way * moves[:, v]) for way in (1, -1))
            fault = next((fault for fault in drawn if fault.pairs), None)
            if fault is not None:
                yield Undrawn(leaf, v, fault)

    def _moves(self, numbers: Sequence[Sum], solved: _Solved) -> np.ndarray:
        """How far a tenth of each name moves each number, [n, m]."""
        moves = np.zeros((len(numbers), len(self._system.start)))
        for i, number in enumerate(numbers):
            for v, factor in number.row.items():
                for w, c in solved.get(v, {v: 1.0}).items():
                    moves[i, w] += factor * c
        return moves * TENTH * np.array(self._system.start)

    def _is_count(self, v: int) -> bool:
        return v >= self._system.extra and "sides" in self._system.extras[v - self._system.extra][1].split("_")

    def _draw(self, leaf: int, rings: Drawn, values: np.ndarray) -> Fault:
        key = (leaf, np.round(values / (SAME * self._system.length)).tobytes())
        if key not in self._known:
            self._known[key] = find_fault(rings, values.tolist())
        return self._known[key]

    def list_distances(self, undrawn: Undrawn, solved: _Solved) -> list[Distance]:
        """What the name changes and might stay as it is, the least first: by how much the radii of two arcs differ; then how far a line is
        from the centre of an arc that it ends on, and how far one corner is beyond another along an axis of the drawing."""
        leaf, variable, (pairs, curves) = undrawn
        found = [
            *self._between_radii(leaf, [*pairwise(curves), *pairs]),
            *self._to_centres(leaf, pairs),
            *self._between_corners(leaf, pairs),
        ]
        moved = (d for d in found if abs(sum(c * solved.get(v, {v: 1.0}).get(variable, 0.0) for v, c in d.row.items())) > SAME)
        return sorted(moved, key=lambda d: (not d.is_radial, abs(d.value)))

    def _between_radii(self, leaf: int, pairs: Iterable[tuple[_Corner, _Corner]]) -> Iterator[Distance]:
        for one, two in ((self._radius(leaf, a), self._radius(leaf, b)) for a, b in pairs):
            if one is not None and two is not None:
                yield Distance(sum_rows((two.row, 1.0), (one.row, -1.0)), two.value - one.value, RADIUS_STEP, is_radial=True)

    def _to_centres(self, leaf: int, pairs: Iterable[tuple[_Corner, _Corner]]) -> Iterator[Distance]:
        for i, k in dict.fromkeys(corner for pair in pairs for corner in pair):
            ring = self._rings[leaf][i]
            reach = ring[k].reach if isinstance(ring, tuple) else None
            if reach is not None:
                yield Distance(reach.off.row, reach.off.value, f"step_{'yx'[reach.axis]}")

    def _between_corners(self, leaf: int, pairs: Iterable[tuple[_Corner, _Corner]]) -> Iterator[Distance]:
        for (a, b), axis in product(pairs, range(2)):
            one, two = self._coordinate(leaf, a, axis), self._coordinate(leaf, b, axis)
            if one is not None and two is not None:
                yield Distance(sum_rows((two.row, 1.0), (one.row, -1.0)), two.value - one.value, f"step_{'xy'[axis]}")

    def _radius(self, leaf: int, corner: _Corner) -> Sum | None:
        """That of the arc from a corner, or of one that a line ends on there."""
        ring = self._rings[leaf][corner[0]]
        if not isinstance(ring, tuple):
            return None
        bend, reach = ring[corner[1]].bulge, ring[corner[1]].reach
        return bend.radius if isinstance(bend, BendRadius) else None if reach is None else reach.radius

    def _coordinate(self, leaf: int, corner: _Corner, axis: int) -> Sum | None:
        ring = self._rings[leaf][corner[0]]
        if not isinstance(ring, tuple):
            return (ring.x, ring.y)[axis]
        vertex = ring[corner[1]]
        return None if vertex.reach is not None and vertex.reach.axis == axis else (vertex.x, vertex.y)[axis]


def find_fault(rings: Sequence[DrawnRing[T]], values: Sequence[float]) -> Fault:
    """Why a drawing with these numbers cannot be; nothing where it can, or its curves are too short to tell."""
    rest, loops = iter(values), list[Loop]()
    for i, ring in enumerate(rings):
        try:
            loops.append(_loop_of(map_ring(ring, lambda _: next(rest))))
            Outline((loops[i],))
        except ValueError:
            corners = [(i, k) for k in range(len(ring))] if isinstance(ring, tuple) else [(i, 0)]
            return Fault(tuple(pairwise([*corners, corners[0]])))
    try:
        check_crossings(Outline(tuple(loops)))
    except CrossingError as error:
        ends = [[(i, k), (i, (k + 1) % len(ring))] if isinstance(ring := rings[i], tuple) else [(i, 0)] for i, k in error.curves]
        return Fault(tuple((a, b) for a, b in product(*ends) if a != b), error.curves)
    except ValueError:
        pass
    return NONE


def _loop_of(ring: DrawnRing[float]) -> Loop:
    """As the texts' own functions draw it. Raises ValueError where it cannot be."""
    if isinstance(ring, DrawnPolygon):
        draw = polygon_across_flats if ring.is_across_flats else regular_polygon
        return draw(*ring.numbers())
    if isinstance(ring, DrawnEllipse):
        return ellipse(*ring.numbers())
    return to_loop([(*_place(v), _arc(v.bulge)) for v in ring])


def _place(vertex: DrawnVertex[float]) -> tuple[float, float]:
    at, reach = [vertex.x, vertex.y], vertex.reach
    if reach is not None:
        at[reach.axis] += reach.sign * math.sqrt(reach.radius**2 - reach.off**2)  # ValueError where the circle misses the line
    return at[0], at[1]


def _arc(bend: Bend[float]) -> Arc:
    if isinstance(bend, Center):
        return bend.x, bend.y, bend.way
    if isinstance(bend, BendRadius):
        return (bend.radius, bend.way) if bend.way else (bend.radius,)
    if isinstance(bend, BendAngle):
        return bend.way * math.tan(math.radians(bend.angle) / 4)
    return bend.word if isinstance(bend, Touching) else bend
