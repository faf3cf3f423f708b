"""One part in the place of others: a cut that goes through, what spans two parts of one section, the box about boxes of one layer.

A search that changes one part at a time does not get there: two short cuts from either side do what one does that goes through, and
neither can be left out before the other is long. So it is with a floor of which each compartment has a piece.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import FLAT_ENDS, PRISMS, Primitive
from imdim.search.mdl.candidates.residual import LOOK, resize
from imdim.search.mdl.primitive_selection import Cloud

LEVEL = math.cos(math.radians(3.0))  # of directions that are one
OUTERMOST = (0.01, 0.99)  # quantiles of coordinates, beyond which points may be strays


def prolong(cut: Primitive, cloud: Cloud) -> Iterator[Primitive]:
    """The cut with its ends out of the cloud, along each axis along which its walls are straight, at one end and at both."""
    rotation = matrix_from_euler(cut.rotation)
    out = LOOK * cloud.diagonal
    beyond = np.quantile((cloud.points - cut.center) @ rotation, OUTERMOST, axis=0) + out * np.array([[-1.0], [1.0]])
    for k, slot in FLAT_ENDS[cut.kind].items() if cut.kind in PRISMS else ():
        half = cut.size[slot] / 2
        bottom, top = min(-half, float(beyond[0, k])), max(half, float(beyond[1, k]))
        for low, high in dict.fromkeys([(bottom, half), (-half, top), (bottom, top)]):
            if high - low > cut.size[slot] + out:
                yield with_ends(cut, rotation, k, slot, low, high)


def slots(hole: Primitive, cloud: Cloud) -> Iterator[Primitive]:
    """Boxes about as wide as a round hole, which go through the part: what lies along a narrow slot is first found as a hole."""
    if hole.kind == "cylinder":
        radius, height = hole.size
        side = math.sqrt(math.pi) * radius
        yield from prolong(Primitive("box", (side, side, height), hole.center, hole.rotation), cloud)


def span(a: Primitive, b: Primitive, near: float) -> Primitive | None:
    """`a` made so long that it reaches over `b`, where that is of its kind and section, to within `near`; None where it is not."""
    if a.kind != b.kind or a.kind not in PRISMS or a.outline is not None:
        return None
    rotation = matrix_from_euler(a.rotation)
    turned = np.abs(rotation.T @ matrix_from_euler(b.rotation))
    apart = rotation.T @ (np.array(b.center) - a.center)
    if a.kind == "cylinder":
        other = np.array([b.size[0], b.size[0], b.size[1] / 2]) if turned[2, 2] > LEVEL else None
        mine = np.array([a.size[0], a.size[0], a.size[1] / 2])
    else:
        order = turned.argmax(1)
        other = np.array(b.size)[order] / 2 if turned.max(1).min() > LEVEL else None
        mine = np.array(a.size) / 2
    if other is None:
        return None
    for k, slot in FLAT_ENDS[a.kind].items():
        across = [j for j in range(3) if j != k]
        if (np.abs(apart[across]) + np.abs(mine - other)[across] < near).all():
            low, high = min(-mine[k], apart[k] - other[k]), max(mine[k], apart[k] + other[k])
            return with_ends(a, rotation, k, slot, float(low), float(high))
    return None


def layers(boxes: Mapping[int, Primitive], near: float) -> Iterator[tuple[Primitive, tuple[int, ...]]]:
    """The box about all of those boxes that have the same two faces across one of their axes, to within `near`, and the keys of these, the
    first of them first."""
    known = set[tuple[int, ...]]()
    for key, first in boxes.items():
        rotation = matrix_from_euler(first.rotation)
        ends = {k: np.array(_ends_along(box, first, rotation)) for k, box in boxes.items() if _is_aligned(box, rotation)}
        for axis in range(3):
            level = [k for k in ends if k >= key and np.abs(ends[k][:, axis] - ends[key][:, axis]).max() < near]
            if len(level) > 1 and tuple(level) not in known:
                known.add(tuple(level))
                low, high = np.min([ends[k][0] for k in level], axis=0), np.max([ends[k][1] for k in level], axis=0)
                low[axis], high[axis] = np.median([ends[k][:, axis] for k in level], axis=0)
                yield resize(first, high - low, np.array(first.center) + rotation @ ((low + high) / 2)), tuple(level)


def _is_aligned(box: Primitive, rotation: np.ndarray) -> bool:
    return bool(np.abs(rotation.T @ matrix_from_euler(box.rotation)).max(1).min() > LEVEL)


def _ends_along(box: Primitive, first: Primitive, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a box that is aligned with the `first` begins and ends along its axes, seen from its middle, [3] each."""
    order = np.abs(rotation.T @ matrix_from_euler(box.rotation)).argmax(1)
    middle, half = rotation.T @ (np.array(box.center) - first.center), np.array(box.size)[order] / 2
    return middle - half, middle + half


def with_ends(part: Primitive, rotation: np.ndarray, k: int, slot: int, low: float, high: float) -> Primitive:
    """The part between two places along its axis k, which has that place in its size, seen from its middle."""
    size = np.array(part.size, float)
    size[slot] = high - low
    return resize(part, size, np.array(part.center) + (low + high) / 2 * rotation[:, k])
