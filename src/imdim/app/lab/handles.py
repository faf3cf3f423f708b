"""Handles on the selected primitive: arrows that move it, and knobs on its faces that make it larger or smaller.

A handle drags one number. While it is dragged the program follows as with any other edit of that number, so that relations and locks hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.constraints import AXES
from imdim.program.tree import SIZE_NAMES, Primitive

SIDEWAYS = 0.15  # sine between a handle's direction and the view, below which it is not dragged: a pixel would be a mile


@dataclass(frozen=True, eq=False)
class Handle:
    """Drags the number `name` of a primitive along `direction` [3] from `point` [3], both in the target's units; `value` is what it is."""

    name: str
    point: np.ndarray
    direction: np.ndarray
    value: float
    axis: int | None  # of the frame, for an arrow


def find_handles(part: Primitive, gap: float) -> list[Handle]:
    """Three arrows, `gap` away from the primitive, and a knob for each size that a face shows."""
    rotation, center = matrix_from_euler(part.rotation), np.array(part.center)
    reach = np.abs(rotation) @ PosedPrimitive(part).half
    top = center + np.array([0.0, 0.0, reach[2]])
    out = []
    for axis, letter in enumerate(AXES):
        along = np.eye(3)[axis]
        start = top + along * (gap if axis == 2 else reach[axis] + gap)
        out.append(Handle(letter, start, along, part.center[axis], axis))
    for name, local, way in _knobs(part):
        out.append(Handle(name, center + rotation @ local, rotation @ way, _size(part, name), None))
    return out


def _size(part: Primitive, name: str) -> float:
    return part.size[SIZE_NAMES[part.kind].index(name)]


def _knobs(part: Primitive) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Names of sizes, with a point [3] of a face and the direction [3] in which it goes, in the primitive's own frame."""
    x, y, z = np.eye(3)
    size = part.size
    match part.kind:
        case "box" | "ellipsoid":
            half = np.array(size) / (2 if part.kind == "box" else 1)
            names = ("sx", "sy", "sz") if part.kind == "box" else ("rx", "ry", "rz")
            yield from ((name, half[i] * way, way) for i, (name, way) in enumerate(zip(names, (x, y, z), strict=True)))
        case "sphere":
            yield "r", size[0] * x, x
        case "cylinder":
            yield "r", size[0] * x + size[1] / 2 * z, x
            yield "h", size[1] / 2 * z, z
        case "cone":
            yield "r_bottom", size[0] * x - size[2] / 2 * z, x
            yield "r_top", size[1] * x + size[2] / 2 * z, x
            yield "h", size[2] / 2 * z, z
        case "torus":
            yield "r_major", size[0] * x + size[1] * z, x
            yield "r_minor", (size[0] + size[1]) * x, x
        case "extrude" | "drafted":
            yield "h", size[0] / 2 * z, z
        case _:
            return


def nice_step(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `length`."""
    ten = 10.0 ** math.floor(math.log10(length))
    return next(times * ten for times in (5, 2, 1) if times * ten <= length * (1 + 1e-9))


def measure_drag(start: np.ndarray, now: np.ndarray, direction: np.ndarray, eye: np.ndarray) -> float:
    """How far along `direction` [3] a handle goes that was grabbed at `start` [3], where the pointer is seen at `now` [3] from `eye` [3]:
    to where the line that it moves on comes nearest to the pointer's ray. 0 where it is looked at from its end."""
    ray = (now - eye) / np.linalg.norm(now - eye)
    slant = float(ray @ direction)
    if 1 - slant**2 < SIDEWAYS**2:
        return 0.0
    off = eye - start
    return float(off @ direction - slant * (off @ ray)) / (1 - slant**2)
