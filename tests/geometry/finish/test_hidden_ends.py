"""Cones begin where they are seen: with the radius of the hole or shaft that they are about."""

import numpy as np
import pytest

from imdim.geometry.finish.hidden_ends import shorten_cones
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, leaves

PLATE = Primitive("box", (60.0, 40.0, 8.0), (0.0, 0.0, 4.0))
SINK = Primitive("cone", (0.0, 9.0, 9.0), (10.0, 5.0, 3.5))  # from z = -1, where it is a point, to the plate's face


def holes():
    yield Combine("difference", PLATE, Primitive("cylinder", (5.0, 12.0), (10.0, 5.0, 4.0))), True
    drawn = Outline((rectangle(60.0, 40.0).loops[0], circle(5.0, 10.0, 5.0)))
    yield Primitive("extrude", (8.0,), (0.0, 0.0, 4.0), outline=drawn), True
    yield Combine("difference", PLATE, Primitive("cylinder", (5.0, 12.0), (11.0, 5.0, 4.0))), False  # beside it
    yield Combine("union", PLATE, Primitive("cylinder", (5.0, 12.0), (10.0, 5.0, 4.0))), False  # no hole
    yield Combine("difference", PLATE, Primitive("cylinder", (9.5, 12.0), (10.0, 5.0, 4.0))), False  # as wide as the countersink


@pytest.mark.parametrize(("part", "begins"), holes())
def test_a_countersink_begins_with_its_hole(part, begins):
    program = Combine("difference", part, SINK)
    out = shorten_cones(program)
    cone = next(leaf for leaf in leaves(out) if leaf.kind == "cone")
    assert cone.size == pytest.approx((5.0, 9.0, 4.0) if begins else SINK.size)
    assert cone.center == pytest.approx((10.0, 5.0, 6.0) if begins else SINK.center)
    assert volume_iou(to_manifold(out, 96), to_manifold(program, 96)) > 1 - 1e-9


def test_a_foot_ends_at_its_shaft_whichever_way_it_stands():
    shaft = Primitive("cylinder", (18.0, 60.0), (0.0, 0.0, 30.0))
    foot = Primitive("cone", (17.0, 24.5, 15.0), (0.0, 0.0, 7.5), (180.0, 0.0, 0.0))
    out = shorten_cones(Combine("union", shaft, foot))
    assert list(leaves(out))[1].size == pytest.approx((18.0, 24.5, 13.0))
    assert volume_iou(to_manifold(out, 96), to_manifold(Combine("union", shaft, foot), 96)) > 1 - 1e-9
    assert np.array(list(leaves(out))[1].center) == pytest.approx((0.0, 0.0, 6.5))


def test_a_cone_about_a_thin_shaft_in_a_thick_one_ends_at_the_thick_one():
    thin, thick = Primitive("cylinder", (4.0, 60.0), (0.0, 0.0, 30.0)), Primitive("cylinder", (18.0, 60.0), (0.0, 0.0, 30.0))
    foot = Primitive("cone", (24.5, 1.0, 47.0), (0.0, 0.0, 23.5))
    for shafts in (Combine("union", thin, thick), Combine("union", thick, thin)):
        assert list(leaves(shorten_cones(Combine("union", shafts, foot))))[2].size == pytest.approx((24.5, 18.0, 13.0))
