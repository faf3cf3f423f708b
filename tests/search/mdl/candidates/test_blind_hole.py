"""Holes that end at a floor, on tubes whose numbers are known."""

import numpy as np
import pytest

from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive
from imdim.search.mdl.candidates.blind_hole import blind_holes

SIGMA = 0.3
OVAL = (Ellipse(18.0, 23.0), Ellipse(16.0, 21.0))
SQUARE = ((-20.0, -20.0, 0.0), (20.0, -20.0, 0.0), (20.0, 20.0, 0.0), (-20.0, 20.0, 0.0))


def points_of(program, n=6000):
    rng = np.random.default_rng(0)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


@pytest.mark.parametrize(("loops", "top"), [(OVAL, True), (OVAL, False), ((SQUARE, circle(16.0)), True)])
def test_a_tube_with_a_floor_is_found_from_one_without(loops, top):
    outer, inner = (Outline((loop,)) for loop in loops)
    hole = Primitive("extrude", (100.0,), (0.0, 0.0, 5.0 if top else -5.0), outline=inner)
    truth = Combine("difference", Primitive("extrude", (100.0,), outline=outer), hole)
    tube = Primitive("extrude", (100.0,), outline=Outline(loops))
    goal = to_manifold(truth)
    best = max(volume_iou(to_manifold(found), goal) for found in blind_holes(tube, points_of(truth), SIGMA))
    assert best > 0.98 > volume_iou(to_manifold(tube), goal) + 0.02


def test_a_hole_without_a_floor_and_a_part_without_a_hole_suggest_nothing():
    tube = Primitive("extrude", (100.0,), outline=Outline(OVAL))
    assert [*blind_holes(tube, points_of(tube), SIGMA)] == []
    full = Primitive("extrude", (100.0,), outline=Outline(OVAL[:1]))
    assert [*blind_holes(full, points_of(full), SIGMA)] == []
