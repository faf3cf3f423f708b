"""A part that ends where cuts take its end off, in the place of the part and these cuts.

A drawing reaches as far as anything that was drawn with it, as a frame as far as the posts at its corners; cuts then take the rest away
piece by piece. No single change undoes that: without one of the cuts there is too much, and a shorter part leaves the cuts without work.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import FLAT_ENDS, Primitive
from imdim.search.mdl.candidates.span import with_ends

LEVEL = math.cos(math.radians(4.0))  # of directions that are one
NEAR = 3.0  # deviations of the noise, within which floors of cuts are one level
OPEN = 2.0  # deviations of the noise by which a cut may miss the end that it takes off
LEAST = 2.0  # deviations of the noise, of what is left


def end_at_cuts(part: Primitive, cuts: Mapping[int, Primitive], sigma: float) -> Iterator[tuple[Primitive, tuple[int, ...]]]:
    """The part as far as each level at which some of `cuts` through one of its flat ends have their floors, and the keys of those cuts;
    `sigma` is the deviation of the noise."""
    rotation = matrix_from_euler(part.rotation)
    for k, slot in FLAT_ENDS.get(part.kind, {}).items():
        if part.kind == "cone":
            continue
        half = part.size[slot] / 2
        spans = {key: span for key, cut in cuts.items() if (span := _span_along(cut, rotation[:, k], part)) is not None}
        for sign in (1, -1):
            floors = {
                key: min(sign * low, sign * high)
                for key, (low, high) in spans.items()
                if max(sign * low, sign * high) > half - OPEN * sigma
            }
            floors = {key: floor for key, floor in floors.items() if -half + LEAST * sigma < floor < half - LEAST * sigma}
            for level in sorted(floors.values()):
                gone = tuple(key for key, floor in floors.items() if level <= floor <= level + NEAR * sigma)
                at = sign * float(np.median([floors[key] for key in gone]))
                yield with_ends(part, rotation, k, slot, min(-sign * half, at), max(-sign * half, at)), gone


def _span_along(cut: Primitive, way: np.ndarray, part: Primitive) -> tuple[float, float] | None:
    """From where to where a cut with a flat end that looks this `way` reaches, seen from the middle of the part; None without such an
    end."""
    if cut.kind == "cone":
        return None
    facing = matrix_from_euler(cut.rotation).T @ way
    for k, slot in FLAT_ENDS.get(cut.kind, {}).items():
        if abs(float(facing[k])) > LEVEL:
            middle = float((np.array(cut.center) - part.center) @ way)
            return middle - cut.size[slot] / 2, middle + cut.size[slot] / 2
    return None
