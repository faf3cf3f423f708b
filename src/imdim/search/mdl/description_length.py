"""Description length (MDL) of a noisy cloud by a program: what the noise could have done is no feature.

It is the negative log-density of all points, half the logarithm of their number
for each number of the program (Schwarz 1978), and a surcharge for skins that the noise blurs into one surface.
"""

from __future__ import annotations

import math

import numpy as np

from imdim.numbers.likelihood import MOST_SAMPLES, Noise, SurfaceSamples, expectation_step
from imdim.numbers.outline_coordinates import outline_coordinates
from imdim.program.tree import FULL_TURN, SIZE_NAMES, Primitive, Program, leaves

# numbers that say where a kind lies; of an outline its own say the rest
PLACE = {"box": 6, "ellipsoid": 6, "sphere": 3, "cylinder": 5, "cone": 5, "torus": 5, "extrude": 3, "revolve": 4}
SKIN_SAMPLES = 3000  # that tell how much of a surface is a skin
SKIN = 0.1  # nats that a point on a skin thinner than the noise costs


def description_length(
    program: Program, points: np.ndarray, noise: Noise, fitted: float | None = None, stand_for: int | None = None
) -> float:
    """Nats per point of `points` [n, 3], which may stand for more: the more, the less a number weighs. `fitted` is the negative log-density
    where it is known already."""
    shown = SurfaceSamples.of(program, noise.sigma, MOST_SAMPLES if fitted is None else SKIN_SAMPLES, noise.shadows)
    nll = expectation_step(points, shown, noise).nll if fitted is None else fitted
    n = stand_for or len(points)
    return nll + 0.5 * numbers(program) * math.log(n) / n + SKIN * shown.skin


def numbers(program: Program) -> int:
    """How many numbers say where the primitives lie and how large they are; of an outline, what lies along an axis of its plane or on the
    axis that it is turned about needs fewer."""
    return sum(_numbers(leaf) for leaf in leaves(program))


def _numbers(leaf: Primitive) -> int:
    if leaf.outline is None:
        return PLACE[leaf.kind] + len(SIZE_NAMES[leaf.kind])
    turned = leaf.kind == "revolve"
    whole = turned and leaf.size[0] == FULL_TURN
    free = outline_coordinates(leaf.outline, turned).count
    # the coordinates of an extrusion's vertices tell how it is turned about its axis, unless some of them are one
    spun = not turned and free < sum(2 + (bulge != 0) for ring in leaf.outline.rings for _, _, bulge in ring)
    return PLACE[leaf.kind] + (not whole) + spun + free
