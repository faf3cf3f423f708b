"""The directions that a program is drawn along, where these are not the world's: names say what lies along them.

A clamp that is turned by 27 degrees has no number along x that anyone would change. Its places are named along its own walls, and what they
are in the world is a sum of these times sines and cosines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from imdim.export.loops import Loop
from imdim.export.numbers import Expression, Rounding, simple_fraction, weighted_sum
from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.lowering import lower
from imdim.geometry.rotations import euler_from_matrix, shortest_turn
from imdim.program.constraints import WORLD, Constraint
from imdim.program.motions import Matrix, Motion, is_round, move_leaf
from imdim.program.repeats import Folded, Group
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Program, Vec3, leaves, map_leaves
from imdim.program.vectors import round_vector
from imdim.relations.residuals import holding

SPREAD = ("box", "extrude", "ellipsoid")  # kinds with three directions; a sphere has none, the others have their axis
ALIGNED = 1e-7  # of a unit vector, by which it may be off a direction
QUARTER = 1e-6  # degrees, by which an angle may be off a quarter of a turn
EXACT, UNIT = 12, 9  # decimals of sines and cosines, and of a direction by angles as files keep them
TURNED = 3  # units of the last digit, by which a place is off that was rounded in the world


@dataclass(frozen=True)
class OwnPlaces:
    """The centres of a program's leaves and its loops along its own `directions`."""

    directions: OwnDirections
    centers: tuple[tuple[Expression, ...], ...]
    loops: tuple[Loop, ...]


@dataclass(frozen=True)
class OwnDirections:
    """`turn` leads from the program's own directions to the world's, in which places have so many `decimals`."""

    turn: Matrix
    decimals: int

    def turn_program(self, program: Program) -> Program:
        """The program with its own directions as the world's."""
        return map_leaves(program, lambda _, leaf: self._leaf(leaf))

    def turn_folded(self, folded: Folded) -> Folded:
        """The same of a program with repeats."""
        if isinstance(folded, Primitive):
            return self._leaf(folded)
        if isinstance(folded, Group):
            return replace(folded, parts=tuple(map(self.turn_folded, folded.parts)))
        steps, point = tuple(map(self._place, folded.steps)), self._place(folded.point)
        axis = round_vector(self._back.direction(folded.axis), UNIT)
        return replace(folded, part=self.turn_folded(folded.part), steps=steps, point=point, axis=axis)

    def keep_constraints(self, constraints: Sequence[Constraint], program: Program) -> tuple[Constraint, ...]:
        """Those of the constraints that hold for a `program` in its own directions: of the world's axes it may have kept one."""
        worldly = [c for c in constraints if any(ref.leaf == WORLD for ref in (*c.of, c.about) if ref)]
        kept = {id(c) for c in holding(program, worldly)}
        return tuple(c for c in constraints if id(c) in kept or c not in worldly)

    @property
    def rotation(self) -> Vec3:
        """Euler degrees of the turn."""
        return euler_from_matrix(np.array(self.turn))

    def in_world(self, vector: Sequence[Expression]) -> tuple[Expression, ...]:
        """What three lengths along the own directions are along the world's; nothing of nothing."""
        return tuple(weighted_sum(*_weigh(vector, row)) for row in self.turn) if vector else ()

    def turn_loop(self, loop: Loop) -> Loop:
        """A loop over copies as the world sees it."""
        steps = tuple(map(self.in_world, loop.steps))
        return replace(loop, steps=steps, center=self.in_world(loop.center), shift=self.in_world(loop.shift))

    @property
    def _back(self) -> Motion:
        x, y, z = zip(*self.turn, strict=True)
        return Motion((x, y, z), (0.0, 0.0, 0.0))

    def _place(self, place: Vec3) -> Vec3:
        x, y, z = map(self._settle, self._back.point(place))
        return x, y, z

    def _settle(self, value: float) -> float:
        """A place as it was before it was turned and rounded, if it has fewer digits than were kept."""
        plain = round(value, self.decimals - TURNED) + 0.0
        return plain if abs(value - plain) < TURNED * 10.0**-self.decimals else value

    def _leaf(self, leaf: Primitive) -> Primitive:
        turned = move_leaf(leaf, self._back)
        x, y, z = map(_quarter, _without_spin(turned) if is_round(turned) else turned.rotation)
        return replace(turned, center=self._place(leaf.center), rotation=(x, y, z))


def find_own_directions(program: Program) -> OwnDirections | None:
    """The directions of a program's first part, if more leaves lie along them than along the world's; else None."""
    parts = list(leaves(program))
    if not any(any(leaf.rotation) for leaf in parts):
        return None
    turns = lower(program).rotations
    along_world = _count_along(parts, turns, np.eye(3))
    best, most = None, along_world
    for frame in _frames(parts, turns):
        if _is_along(parts[0], turns[0], frame) and (count := _count_along(parts, turns, frame)) > most:
            best, most = frame, count
    if best is None:
        return None
    x, y, z = (tuple(round(float(v), EXACT) + 0.0 for v in row) for row in best)
    return OwnDirections((x, y, z), Rounding.of(program).decimals)  # type: ignore[arg-type]


def _frames(parts: Sequence[Primitive], turns: np.ndarray) -> Iterator[np.ndarray]:
    """The directions of each leaf that has three, numbered and pointed so that they are nearest to the world's."""
    for leaf, turn in zip(parts, turns, strict=True):
        if leaf.kind in SPREAD:
            yield max((turn @ way for way in SYMMETRIES), key=np.trace)


def _count_along(parts: Sequence[Primitive], turns: np.ndarray, frame: np.ndarray) -> int:
    return sum(_is_along(leaf, turn, frame) for leaf, turn in zip(parts, turns, strict=True))


def _is_along(leaf: Primitive, turn: np.ndarray, frame: np.ndarray) -> bool:
    axes = turn if leaf.kind in SPREAD else turn[:, 2:]
    return leaf.kind == "sphere" or bool((np.abs(axes.T @ frame).max(axis=1) > 1 - ALIGNED).all())


def _without_spin(leaf: Primitive) -> Vec3:
    """Euler degrees of the least turn that has the axis of what is round."""
    axis = np.array(axes(leaf)[2])
    return (180.0, 0.0, 0.0) if axis[2] < ALIGNED - 1 else euler_from_matrix(shortest_turn(np.array([0.0, 0.0, 1.0]), axis))


def _quarter(degrees: float) -> float:
    nearest = 90.0 * round(degrees / 90)
    return nearest if abs(degrees - nearest) < QUARTER else degrees


def _weigh(vector: Sequence[Expression], row: Vec3) -> Iterator[tuple[Expression, Fraction | float]]:
    yield from ((e, simple_fraction(factor)) for e, factor in zip(vector, row, strict=True) if factor)
