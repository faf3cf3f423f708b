"""Distances from surfaces with numpy alone, against those of the compiled kernels."""

import numpy as np
import pytest
from outlined_samples import random_drawn
from tests.known_programs import AWAY, DRAWN_LEAVES, LEAVES, TILT

from imdim.geometry.kernels import program_sdf
from imdim.geometry.off_surface import LOCAL, measure_distances
from imdim.geometry.sampling import bounding_radius
from imdim.geometry.surface_map import map_surface
from imdim.program.outline import Outline, circle, ellipse, rectangle
from imdim.program.tree import KINDS, OUTLINED, Primitive

WINDOW = Outline((*rectangle(2.0, 1.4).loops, ellipse(0.4, 0.2, 0.3, 0.1, 30.0), circle(0.2, -0.6, 0.3)))
RANDOM = [random_drawn(np.random.default_rng(n), kind, 0.05 + 0.9 * n / 20) for kind in OUTLINED for n in range(20)]


def test_each_kind_has_its_distance():
    assert set(LOCAL) == set(KINDS)


@pytest.mark.parametrize("leaf", [*LEAVES, *DRAWN_LEAVES, *RANDOM, Primitive("extrude", (0.8,), AWAY, TILT, WINDOW)])
def test_distances_are_those_of_the_kernels(leaf):
    rng = np.random.default_rng(3)
    around = np.asarray(leaf.center) + rng.uniform(-1.5, 1.5, (300, 3)) * bounding_radius(leaf)
    assert measure_distances(leaf, around) == pytest.approx(np.abs(program_sdf(leaf, around)), abs=1e-12)


@pytest.mark.parametrize("leaf", [Primitive(leaf.kind, leaf.size, outline=leaf.outline) for leaf in (*LEAVES, *DRAWN_LEAVES)])
def test_points_of_the_surface_are_on_it(leaf):
    u = np.random.default_rng(5).random((200, 3))
    points, _, share = map_surface(leaf, u)
    assert measure_distances(leaf, points[share > 0]).max() < 1e-9
