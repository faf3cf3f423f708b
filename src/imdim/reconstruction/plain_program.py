"""Whether a part is told by drawings or by primitives alone.

One outline may stand for a dozen primitives, and a search that counts features always draws. But a plate with two holes is a box and two
cylinders to those who edit it: each has its own numbers, and moves by itself. So a short program of primitives is taken where there is
hardly more to read in it, and the part is the same. What is to read is counted as in a minimum description length (Rissanen 1978), with
one for each feature and number and half of one for the kind of a curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from imdim.geometry.lowering import lower
from imdim.program.cost import count
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.observation import Observation

MOST_CURVES = 24  # of drawings: what has more is no dozen primitives
MOST_PRIMITIVES = 12  # of a program that is read primitive by primitive
MORE = 1.25  # times as much to read as in the drawings, that primitives may be
SAME = 0.8  # of a primitive's price: by how much less of the part they may be
CURVE_KIND = 0.5  # of a number: that a curve is a line or an arc
AXES_OF = {"box": (0, 1, 2), "extrude": (0, 1, 2), "ellipsoid": (0, 1, 2), "sphere": ()}  # of others the third
ONE_WAY = 1e-6  # of the cosine between two directions, from which they are two
ONE_NUMBER = 1e-4  # of the part's size, within which two numbers are one
OUTSIDE = 1e-3  # of the part's size, beyond it: where a cutter ends there nothing is to be read


def may_be_plain(drawn: Program) -> bool:
    """Whether a program has outlines, and so few curves that primitives may tell the part."""
    return 0 < count(drawn).curves <= MOST_CURVES


def is_plainer(plain: Program, drawn: Program, seen: Observation) -> bool:
    """Whether primitives are to be preferred to drawings."""
    counts = count(plain)
    if counts.curves or counts.primitives > MOST_PRIMITIVES:
        return False
    low, high = seen.families.arrangement.bounds
    if reading_length(plain, low, high) > MORE * reading_length(drawn, low, high):
        return False
    have, before = seen.iou(plain), seen.iou(drawn)
    return have is not None and before is not None and have >= before - SAME * seen.size_weight


def reading_length(program: Program, low: np.ndarray, high: np.ndarray) -> float:
    """How much there is to read in the program of a part that fills a box from `low` [3] to `high` [3], in numbers: its leaves, their
    numbers and their directions, and the kind of each curve."""
    counts = count(program)
    return counts.primitives + count_numbers(program, low, high) + count_directions(program) + CURVE_KIND * counts.curves


def count_directions(program: Program) -> int:
    """How many different directions, of either sense, the axes of a program's leaves have: three of what has corners, one of what is round,
    none of a ball. Slanted walls are lines of a drawing, but tilted boxes without one."""
    turns = lower(program).rotations
    axes = [turn[:, k] for turn, leaf in zip(turns, leaves(program), strict=True) for k in AXES_OF.get(leaf.kind, (2,))]
    known: list[np.ndarray] = []
    for axis in axes:
        if all(abs(float(axis @ other)) < 1 - ONE_WAY for other in known):
            known.append(axis)
    return len(known)


def count_numbers(program: Program, low: np.ndarray, high: np.ndarray) -> int:
    """How many different numbers say where the faces of a program are: radii, levels and vertices, from the middle of the box that its part
    fills, whatever their sign, but for zeros and for levels outside of the part."""
    size = float(np.linalg.norm(high - low))
    told = sorted(abs(v) for v in _numbers(program, (low + high) / 2, (high - low) / 2, OUTSIDE * size) if abs(v) > ONE_NUMBER * size)
    return sum(b - a > ONE_NUMBER * size for a, b in pairwise([0.0, *told]))


def _numbers(program: Program, middle: np.ndarray, half: np.ndarray, slack: float) -> Iterator[float]:
    solid = lower(program)
    for i, leaf in enumerate(leaves(program)):
        turn = solid.rotations[i]
        at, reach = turn.T @ (solid.centers[i] - middle), np.abs(turn.T) @ half + slack
        yield from (v for axis, v in _levels(leaf, at) if abs(v) < reach[axis])
        yield from _others(leaf, at)


def _levels(leaf: Primitive, at: np.ndarray) -> Iterator[tuple[int, float]]:
    """The axes of a leaf's plane faces, and where these are on them."""
    axes = range(3) if leaf.kind == "box" else (2,) if leaf.kind in ("cylinder", "cone", "extrude") else ()
    for axis in axes:
        size = leaf.size[axis] if leaf.kind == "box" else leaf.size[-1]
        yield from ((axis, float(at[axis]) + side * size / 2) for side in (-1, 1))


def _others(leaf: Primitive, at: np.ndarray) -> Iterator[float]:
    """Radii, vertices, and where a leaf's axis or middle is."""
    x, y, z = map(float, at)
    if leaf.kind == "extrude":
        assert leaf.outline is not None
        yield from (v for loop in leaf.outline.loops for u, w, _ in loop for v in (x + u, y + w))
    elif leaf.kind == "revolve":
        assert leaf.outline is not None
        yield from (x, y, *(v for loop in leaf.outline.loops for r, h, _ in loop for v in (r, z + h)))
    elif leaf.kind in ("cylinder", "cone"):
        yield from (x, y, *leaf.size[:-1])
    elif leaf.kind != "box":
        yield from (x, y, z, *leaf.size)
