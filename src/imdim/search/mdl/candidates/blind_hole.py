"""Holes of an extrusion that end at a floor, in the place of holes that go through it.

A tube with a floor is traced as a ring, whose hole goes from end to end; the floor comes later, as some part that fills the hole, and no
change of one part makes the hole end where the floor begins.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.outline import Outline, nesting
from imdim.program.tree import Combine, Primitive, Program
from imdim.search.mdl.candidates.drawn import simplest

BESIDE = 2.5  # deviations of the noise from the wall of a hole, within which points may be the wall's
FEWEST = 30  # points of a floor
LEVELS = (0.1, 0.5, 0.9)  # shares of them below a level: a thin floor has points of both its skins
BEYOND = 4.0  # deviations of the noise, by which a hole goes through the face that it opens


def blind_holes(part: Primitive, points: np.ndarray, sigma: float) -> Iterator[Program]:
    """The extrusion without one of its holes, less a cut of that outline from a floor to either end: the `points` [n, 3] of the whole
    cloud in the hole and off its walls tell where a floor may be. `sigma` is the deviation of their noise."""
    if part.kind != "extrude" or part.outline is None or len(part.outline.loops) < 2:
        return
    loops, half = part.outline.loops, part.size[0] / 2
    rotation = matrix_from_euler(part.rotation)
    local = (points - part.center) @ rotation
    between = local[np.abs(local[:, 2]) < half + BESIDE * sigma]
    for i, side in enumerate(nesting(loops)):
        if side > 0:
            continue
        hole = Outline((loops[i],))
        within = kernels.outline_sdf(Outlines.pack([hole]).curves, between[:, :2]) < -BESIDE * sigma
        if np.count_nonzero(within) < FEWEST:
            continue
        filled = simplest(replace(part, outline=Outline(loops[:i] + loops[i + 1 :])))
        for level in np.quantile(between[within, 2], LEVELS).tolist():
            for end in (half, -half):
                if abs(end - level) > BESIDE * sigma:
                    past = end + np.sign(end) * BEYOND * sigma
                    middle = part.center + rotation[:, 2] * (level + past) / 2
                    cut = replace(part, size=(abs(past - level),), center=vec(middle), outline=hole)
                    yield Combine("difference", filled, simplest(cut))
