"""Which faces of cutters stick out of what they cut, so that an edit may carry them along.

A hole through a plate ends anywhere above and below it. Read as numbers, it would not go through a thicker plate; read as so much beyond
the plate's faces, it does.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from imdim.geometry.lowering import Lowered, lower
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, envelope, leaves, longest

ALIGNED = 1e-7  # how far a direction may be off the world's axes
TOUCH = 1e-9  # of the largest size


class End(NamedTuple):
    """The plane face of a leaf that looks along a world axis to `side`; `column` is the size across it, `local` its own axis."""

    leaf: int
    axis: int
    side: int
    column: int
    local: str


def overhangs(program: Program) -> Iterator[tuple[End, End]]:
    """Pairs of a cutter's end and the end of the adding leaf next behind it, which it passes or meets."""
    parts, numbers, sign = list(leaves(program)), lower(program), signs(program)
    ends = [e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers)]
    boxes = [_reach(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    slack = TOUCH * longest(parts)
    for cutter in (e for e in ends if sign[e.leaf] < 0):
        place = cutter.side * _place(cutter, parts)
        passed = [
            e
            for e in ends
            if sign[e.leaf] > 0 and (e.axis, e.side) == (cutter.axis, cutter.side) and e.side * _place(e, parts) <= place + slack
        ]
        passed = [e for e in passed if _meet(boxes[e.leaf], boxes[cutter.leaf], cutter.axis)]
        if passed:
            yield cutter, max(passed, key=lambda e: e.side * _place(e, parts))


def ends_of(leaf: int, p: Primitive, numbers: Lowered) -> Iterator[End]:
    """The plane faces of a leaf that look along the world's axes."""
    for axis in {"box": (0, 1, 2), "cylinder": (2,), "cone": (2,), "extrude": (2,)}.get(p.kind, ()):
        direction = numbers.rotations[leaf][:, axis]
        along = world_axis(direction)
        if along is not None:
            for side in (-1, 1):
                own = side if direction[along] > 0 else -side
                yield End(leaf, along, side, axis if p.kind == "box" else len(p.size) - 1, ("+" if own > 0 else "-") + "xyz"[axis])


def world_axis(direction: np.ndarray) -> int | None:
    """The world's axis that a unit vector lies along, either way."""
    axis = int(np.abs(direction).argmax())
    return axis if abs(direction[axis]) > 1 - ALIGNED**2 else None


def _place(end: End, parts: list[Primitive]) -> float:
    return parts[end.leaf].center[end.axis] + end.side * parts[end.leaf].size[end.column] / 2


def _reach(p: Primitive, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner [3] of a box around a leaf."""
    p = envelope(p)
    radius = sum(p.size) if p.kind == "torus" else max(p.size)
    half = [radius] * 3
    if p.kind == "box":
        half = [s / 2 for s in p.size]
    elif p.kind in ("cylinder", "cone"):
        half = [max(p.size[:-1])] * 2 + [p.size[-1] / 2]
    reach = np.abs(rotation) @ np.array(half)
    return p.center - reach, p.center + reach


def _meet(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray], axis: int) -> bool:
    """Whether two boxes share area as seen along an axis."""
    across = [i for i in range(3) if i != axis]
    return bool((np.minimum(a[1], b[1]) > np.maximum(a[0], b[0]))[across].all())
