"""Theories of well-known shapes."""

from __future__ import annotations

import math

from imdim.sketch.theory import SketchConstraint, Theory

RIGHT = math.pi / 2

# corner b of the box sits at (b & 1, b >> 1 & 1, b >> 2) times its edges
CUBE_EDGES = tuple((a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit)
CUBE_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def cube(edge: float = 1.0) -> Theory:
    """Eight corners and 18 constraints, as few as fix them, which only the cube and its mirror image meet.

    A corner of three edges at right angles; each further point is where three planes meet, each said by a right angle or a coplanarity.
    """
    return Theory(8, (*(SketchConstraint("distance", (0, a), edge) for a in (1, 2, 4)), *box().constraints))


def box() -> Theory:
    """The cube without its lengths: three degrees of freedom."""
    right = [(1, 0, 2), (1, 0, 4), (2, 0, 4), (0, 1, 3), (0, 2, 3), (0, 1, 5), (0, 4, 5), (0, 2, 6), (0, 4, 6)]
    right += [(1, 3, 7), (2, 3, 7), (1, 5, 7)]
    flat = [(0, 1, 2, 3), (0, 1, 4, 5), (0, 2, 4, 6)]
    return Theory(8, (*(SketchConstraint("angle", i, RIGHT) for i in right), *(SketchConstraint("plane_distance", i) for i in flat)))


def rectangle(width: float, height: float) -> Theory:
    """Four points in the plane, four distances and one angle (design, section 5.3)."""
    sides = [SketchConstraint("distance", (i, (i + 1) % 4), (width, height)[i % 2]) for i in range(4)]
    return Theory(4, (*sides, SketchConstraint("angle", (0, 1, 2), RIGHT)), dimension=2)
