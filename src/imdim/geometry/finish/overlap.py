"""Whether solids overlap, told without booleans by a ball that lies in all of them.

A point may lie so deep that a ball about it is larger than what counts as nothing. Where no point shows it they may overlap all the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.finish.posed import INSCRIBED
from imdim.program.ellipse import Ellipse
from imdim.program.outline import arc_radii
from imdim.program.tree import Primitive, Program, leaves

POINTS = 512  # that are strewn over a box
STEP = np.array([0.8191725134, 0.6710436067, 0.5497004779])  # of a low-discrepancy sequence (Roberts 2018)


def surely_overlap(within: Sequence[Program], box: np.ndarray, volume: float, outside: Sequence[Program] = ()) -> bool:
    """Whether polyhedra of programs (of CHECK_SEGMENTS facets a circle, or more) surely share more than a `volume` that none of those
    `outside` has, as points strewn over a `box` [2, 3] tell; False where none tells it."""
    every = [leaf for program in (*within, *outside) for leaf in leaves(program)]
    # what the kernels have for an ellipsoid is no distance
    if (box[1] <= box[0]).any() or any(leaf.kind == "ellipsoid" for leaf in every):
        return False
    points = box[0] + (np.arange(1, POINTS + 1)[:, None] * STEP) % 1.0 * (box[1] - box[0])
    least = np.cbrt(volume * 3 / (4 * np.pi)) + max(map(_facet_depth, every))
    for sign, programs in ((-1.0, within), (1.0, outside)):
        for program in programs:
            if len(points):
                points = points[sign * kernels.program_sdf(program, points) > least]
    return len(points) > 0


def _facet_depth(leaf: Primitive) -> float:
    """How far the faces of a leaf's polyhedron lie off its surface at most."""
    if leaf.outline is None:
        radii = {"box": (), "torus": (sum(leaf.size),), "sphere": leaf.size}.get(leaf.kind, leaf.size[:-1])
    else:
        turned = [leaf.outline.bounds[1][0]] if leaf.kind == "revolve" else []
        drawn = [radius for loop in leaf.outline.loops if isinstance(loop, Ellipse) for radius in (loop.rx, loop.ry)]
        # a turned arc has facets either way
        radii = [sum([max([*arc_radii(leaf.outline), *drawn], default=0.0), *turned])]
    return (1 - INSCRIBED) * max(radii, default=0.0)
