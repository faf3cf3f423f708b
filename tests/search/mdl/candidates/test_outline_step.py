"""Shoulders and rims of drawings that the noise all but hides."""

import numpy as np
import pytest

from imdim.geometry.kernels import program_sdf
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive
from imdim.search.mdl.candidates.outline_step import step_lines

SIGMA = 0.5


def turned(*corners):
    return Primitive("revolve", (360.0,), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), Outline((tuple((x, y, 0.0) for x, y in corners),)))


def extruded(*corners):
    return Primitive("extrude", (30.0,), (3.0, 0.0, 0.0), (0.0, 90.0, 0.0), Outline((tuple((x, y, 0.0) for x, y in corners),)))


def points_of(truth, found, n=6000):
    """Noisy points of the truth that what was found explains."""
    rng = np.random.default_rng(0)
    points = surface_points(truth, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))
    return points[np.abs(program_sdf(found, points)) < 3 * SIGMA]


def iou(one, other):
    return volume_iou(to_manifold(one), to_manifold(other))


CASES = {
    # a flange of two heights, drawn as a bevelled one
    "a shoulder turned": (
        turned((11, 0), (20, 0), (20, 2.4), (17.5, 2.4), (17.5, 3.6), (13, 3.6), (13, 80), (11, 80)),
        turned((11, 0), (20, 0), (20, 2.2), (15.6, 4), (13, 4), (13, 80), (11, 80)),
    ),
    # a rail whose side stands back by twice the noise above its middle
    "a rebate extruded": (
        extruded((0, 0), (40, 0), (40, 9), (39, 9), (39, 20), (0, 20)),
        extruded((0, 0), (39.5, 0), (39.5, 20), (0, 20)),
    ),
    "a corner drawn as a bevel": (
        extruded((0, 0), (40, 0), (40, 17.5), (36, 17.5), (36, 20), (0, 20)),
        extruded((0, 0), (40, 0), (40, 16), (36, 20), (0, 20)),
    ),
}


@pytest.mark.parametrize(("truth", "found"), CASES.values(), ids=CASES)
def test_a_step_that_one_line_goes_through_is_drawn(truth, found):
    stepped = list(step_lines(found, points_of(truth, found), SIGMA))
    assert stepped
    # fits move what is nearly right: of those that are drawn one is
    closest = max(stepped, key=lambda leaf: iou(leaf, truth))
    assert 1 - iou(closest, truth) < 0.6 * (1 - iou(found, truth))
    assert len(found.outline.loops[0]) < len(closest.outline.loops[0]) <= len(truth.outline.loops[0])


@pytest.mark.parametrize("truth", [truth for truth, _ in CASES.values()], ids=CASES)
def test_what_has_its_steps_gets_no_more(truth):
    assert list(step_lines(truth, points_of(truth, truth), SIGMA)) == []


def test_lines_of_few_points_and_parts_without_outline_stay():
    _, found = CASES["a shoulder turned"]
    assert list(step_lines(found, points_of(found, found)[:15], SIGMA)) == []
    part_turn = Primitive("revolve", (180.0,), found.center, found.rotation, found.outline)
    assert list(step_lines(part_turn, points_of(found, found), SIGMA)) == []
    assert list(step_lines(Primitive("cylinder", (5.0, 9.0), (0.0, 0.0, 0.0)), points_of(found, found), SIGMA)) == []


def test_loops_beside_the_one_with_the_step_stay_as_they_are():
    truth, found = CASES["a rebate extruded"]
    hole = ((10.0, 5.0, 1.0), (16.0, 5.0, 1.0))
    truth, found = (Primitive(p.kind, p.size, p.center, p.rotation, Outline((hole, *p.outline.loops))) for p in (truth, found))
    stepped = next(step_lines(found, points_of(truth, found), SIGMA))
    assert sorted(len(loop) for loop in stepped.outline.loops) == [2, 6]
    assert iou(stepped, truth) > iou(found, truth)
