"""What people draw with several primitives at once, in the place of one: walls between two skins, and boxes with round ends.

A search that changes one primitive at a time does not get there: a solid fitted to both skins of a thin wall runs between them, so that
neither skin alone makes it likelier, and a round end leaves a box that is too short or corners that nothing explains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.tree import FLAT_ENDS, Combine, Primitive, Program, combine_all
from imdim.search.mdl.candidates.drawn_shell import draw_shells
from imdim.search.mdl.candidates.residual import bare_ends, resize
from imdim.search.mdl.primitive_selection import Cloud

THIN = 3.0  # deviations of the noise, a wall to begin with
LEAST_ROUND = 4.0  # deviations of the noise, the least radius of an end that is seen to be round


def compounds(parts: Sequence[Primitive], cloud: Cloud, sigma: float) -> list[Program]:
    """Walls and round ends in the place of each of `parts`; `sigma` is the deviation of the noise."""
    return [c for part in parts for c in (*shells(part, THIN * sigma, cloud, sigma), *stadiums(part, sigma))]


def shells(part: Primitive, wall: float, cloud: Cloud, sigma: float) -> Iterator[Program]:
    """Walls of thickness `wall` with `part` in their middle: open at the ends that bear no points, or closed all around."""
    if part.kind == "extrude":
        yield from draw_shells(part, wall, cloud, sigma)
    if part.outline is not None or part.kind not in (*FLAT_ENDS, "sphere"):
        return
    for bare in dict.fromkeys((tuple(bare_ends(part, cloud)), ())):
        outer, inner = _offset(part, wall / 2, bare, 0.0), _offset(part, -wall / 2, bare, wall / 2 + LEAST_ROUND * sigma)
        if outer is not None and inner is not None:
            yield Combine("difference", outer, inner)


def _offset(part: Primitive, by: float, bare: Sequence[tuple[int, int]], beyond: float) -> Primitive | None:
    """The part with its skin moved outwards, but for its bare ends, which move `beyond`; None if nothing is left."""
    rotation, size, center = matrix_from_euler(part.rotation), np.array(part.size, float), np.array(part.center, float)
    flat = {slot: k for k, slot in FLAT_ENDS.get(part.kind, {}).items()}
    ends = {slot: [beyond if (k, sign) in bare else by for sign in (-1, 1)] for slot, k in flat.items()}
    if part.kind == "cone":
        slope = (size[1] - size[0]) / size[2]
        # a slanted skin moves along its normal, and the ends move along the slant
        size[:2] += by * np.hypot(1.0, slope) + slope * np.array([-1.0, 1.0]) * ends[2]
        size[:2] = np.maximum(size[:2], 0.0)
    for slot in range(len(size)):
        if slot in ends:
            size[slot] += sum(ends[slot])
            center += (ends[slot][1] - ends[slot][0]) / 2 * rotation[:, flat[slot]]
        elif part.kind != "cone":
            size[slot] += by
    least = size.min() if part.kind != "cone" else min(size[2], size[:2].max())
    return resize(part, size, center) if least > 0 else None


def stadiums(box: Primitive, sigma: float) -> Iterator[Program]:
    """The box with half round ends, at both ends or at one, along each pair of its axes."""
    if box.kind != "box":
        return
    rotation, size = matrix_from_euler(box.rotation), np.array(box.size, float)
    for k in range(3):
        for j, across in (((k + 1) % 3, (k + 2) % 3), ((k + 2) % 3, (k + 1) % 3)):
            radius = size[across] / 2
            if radius < LEAST_ROUND * sigma:
                continue
            for ends in ((-1, 1), (-1,), (1,)):
                left = size[j] - radius * len(ends)
                if left > sigma:
                    yield _stadium(box, rotation, (k, j), radius, left, ends)


def _stadium(box: Primitive, rotation: np.ndarray, axes: tuple[int, int], radius: float, left: float, ends: Sequence[int]) -> Program:
    (k, j), center, size = axes, np.array(box.center, float), np.array(box.size, float)
    size[j] = left
    middle = center - sum(ends) * radius / 2 * rotation[:, j]
    turn = euler_from_matrix(frame_from_axis(rotation[:, k]))
    rounds = [Primitive("cylinder", (radius, box.size[k]), vec(middle + e * left / 2 * rotation[:, j]), turn) for e in ends]
    return combine_all("union", [resize(box, size, middle), *rounds])
