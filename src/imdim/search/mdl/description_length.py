"""Description length (MDL) of a noisy cloud by a program: what the noise could have done is no feature.

It is the negative log-density of all points, half the logarithm of their number
for each number of the program (Schwarz 1978), and a surcharge for skins that the noise blurs into one surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from imdim.geometry.lowering import lower, pack_all, split_params
from imdim.geometry.pose import extent_of
from imdim.numbers.em import EMConfig, FittedProgram
from imdim.numbers.likelihood import Noise, SurfaceSamples, expectation_step
from imdim.numbers.outline_coordinates import outline_coordinates
from imdim.numbers.shared_rotations import FULL, frames
from imdim.numbers.ties import SAME, find_ties, have_same_shape, shape_numbers, ties_of
from imdim.program.tree import FULL_TURN, SIZE_NAMES, Primitive, Program, combine_all, leaves

# numbers that say where a kind lies, of an outline its own say the rest, and those that say which way it points
PLACE = {"box": 3, "ellipsoid": 3, "sphere": 3, "cylinder": 3, "cone": 3, "torus": 3, "extrude": 1, "revolve": 2, "drafted": 1}
WAY = {"box": 3, "ellipsoid": 3, "sphere": 0, "cylinder": 2, "cone": 2, "torus": 2, "extrude": 2, "revolve": 2, "drafted": 2}
PARALLEL_DEG = EMConfig.parallel_deg  # between directions that fits take to be one
FEATURE = 1  # numbers' worth that say that a leaf is there: its kind, operation and place in the order, and which of its ends show
SKIN = 0.05  # nats that a point on a skin thinner than the noise costs


def description_length(program: Program, points: np.ndarray, noise: Noise) -> float:
    """Nats per point of `points` [n, 3] for the program as it is."""
    shown = SurfaceSamples.of(program, noise.sigma, shadows=noise.shadows)
    hidden = tuple(shown.count_hidden_ends(lower(program)).tolist())
    return length_of(FittedProgram(program, noise, expectation_step(points, shown, noise).nll, 0, shown.skin, hidden), len(points))


def length_of(likely: FittedProgram, count: int) -> float:
    """The description length of `count` points by a program that was fitted to them: the more, the less a number weighs."""
    return likely.nll + 0.5 * count_told(likely) * math.log(count) / count + SKIN * likely.skin


def count_told(likely: FittedProgram) -> int:
    """How many `numbers` a fitted program has that its points tell something of, and what stands for its leaves but for copies: where an
    end lies that shows nowhere, as of a hole that goes through, costs nothing (the prior is as wide as the posterior)."""
    own = [*leaves(likely.program)]
    copies = len(ties_of(likely.program, PARALLEL_DEG).twins)
    return numbers(likely.program, likely.hidden) + FEATURE * (len(own) - copies)


def numbers(program: Program, hidden: Sequence[int] = ()) -> int:
    """How many numbers say where the primitives lie and how large they are; those that say which way they point count once for all that
    share directions, as fits turn them together, and so do those of copies (`numbers.ties`). Of an outline what lies along an axis
    of its plane or on the axis that it is turned about needs fewer, and of each leaf so many ends as are `hidden` need none."""
    own = [*leaves(program)]
    lowered = lower(program)
    member, _ = frames(lowered, PARALLEL_DEG)
    ways: dict[int, int] = {}
    for leaf, frame in zip(own, member.tolist(), strict=True):
        ways[frame] = max(ways.get(frame, 0), direction_numbers(leaf))
    ties = find_ties(own, lowered, member)
    saved = ties.count_saved(own)
    copies = {i for i, _ in ties.twins}  # which say nothing of their own ends
    unseen = sum(count for i, count in enumerate(hidden) if i not in copies)
    return sum(map(count_own, own)) + sum(ways.values()) - int(saved.sum()) - unseen


def count_own(leaf: Primitive) -> int:
    """How many numbers a leaf has but for its directions."""
    if leaf.outline is None:
        return PLACE[leaf.kind] + len(SIZE_NAMES[leaf.kind])
    turned = leaf.kind == "revolve"
    whole = turned and leaf.size[0] == FULL_TURN
    return PLACE[leaf.kind] + (not whole) + outline_coordinates(leaf.outline, turned).count


def direction_numbers(leaf: Primitive) -> int:
    """How many numbers say which way a leaf points. The coordinates of an extrusion's vertices tell how it is turned about its axis,
    unless some of them are one."""
    if leaf.outline is None or leaf.kind == "revolve":
        return WAY[leaf.kind]
    free = outline_coordinates(leaf.outline, turned=False).count
    return WAY[leaf.kind] + (free < sum(2 + (bulge != 0) for ring in leaf.outline.rings for _, _, bulge in ring))


def count_each(settled: Sequence[Program], others: Sequence[Program]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many numbers each of the `settled` parts and of the `others` has but for its directions, int64 [p], and how many it needs for
    each direction that settled parts share and, in the last column, for those that are its own, int64 [p, f + 1]: of parts that stand
    together the largest of a column counts. What copies share is counted for the first of them, and of others that are copies of a settled
    part for that; whether a part is a copy is told too, bool [p]."""
    directions = frames(lower(combine_all("union", list(settled))), PARALLEL_DEG)[1] if settled else np.empty((0, 3, 3))
    own = [[*leaves(part)] for part in (*settled, *others)]
    every = [leaf for some in own for leaf in some]
    alike = np.pad(_lie_along(every, directions), ((0, 0), (0, 1)), constant_values=True)
    each, ways = np.array([count_own(leaf) for leaf in every], int), np.zeros(alike.shape, int)
    shared = _count_shared(own, len(settled))
    each += FEATURE * (shared == 0) - shared
    ways[np.arange(len(every)), alike.argmax(1)] = [direction_numbers(leaf) for leaf in every]
    firsts = np.cumsum([0, *map(len, own)])[:-1]
    return np.add.reduceat(each, firsts), np.maximum.reduceat(ways, firsts), shared[firsts] > 0


def _count_shared(own: Sequence[Sequence[Primitive]], settled: int) -> np.ndarray:
    """How many numbers of each leaf, part after part, earlier ones of the same part have, or of one of the first `settled` parts, which
    count as one."""
    stand = [leaf for some in own[:settled] for leaf in some]
    out = [*_saved(stand)] if stand else []
    same = SAME * extent_of(lower(combine_all("union", list[Program](stand)))) if stand else 0.0
    for some in own[settled:]:
        twin = any(leaf.kind == some[0].kind and have_same_shape(some[0], leaf, same) for leaf in stand)
        saved = _saved(some) if len(some) > 1 else [0]
        out += [saved[0] + (shape_numbers(some[0]) if twin else 0), *saved[1:]]
    return np.array(out, np.int64)


def _saved(parts: Sequence[Primitive]) -> np.ndarray:
    """How many numbers of each of the leaves earlier ones have."""
    lowered = lower(combine_all("union", list(parts)))
    return find_ties(parts, lowered, frames(lowered, PARALLEL_DEG)[0]).count_saved(parts)


def _lie_along(parts: Sequence[Primitive], directions: np.ndarray) -> np.ndarray:
    """Whether each of `parts` points along each of the `directions` [f, 3, 3], up to exchanged axes, bool [p, f]."""
    kinds, params = pack_all(parts)
    along = np.abs(np.einsum("pji,fjk->pfik", split_params(params)[2], directions)).max(3)
    least = np.where(np.isin(kinds, FULL)[:, None], along.min(2), along[:, :, 2])
    return least >= math.cos(math.radians(PARALLEL_DEG))
