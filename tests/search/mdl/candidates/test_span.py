"""Long parts in the place of two short ones, against where the ends of these lie."""

import numpy as np
import pytest
from tests.planted import box, cone, cylinder, sphere

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import Primitive
from imdim.search.mdl.candidates.span import layers, prolong, span
from imdim.search.mdl.primitive_selection import Cloud

BLOCK = Cloud.of(np.random.default_rng(0).uniform((-20, -15, -8), (20, 15, 8), (3000, 3)), 0.2)


def test_a_cut_is_let_out_of_the_cloud_at_either_end_and_at_both():
    short = cylinder(3, 6, (5.0, 2.0, 1.0))  # from -2 to 4 along z
    ends = sorted((p.center[2] - p.size[1] / 2, p.center[2] + p.size[1] / 2) for p in prolong(short, BLOCK))
    assert [p.center[:2] for p in prolong(short, BLOCK)] == [(5.0, 2.0)] * 3
    assert all(p.size[0] == 3 for p in prolong(short, BLOCK))
    for found, expected in zip(ends, ((-8, 4), (-8, 8), (-2, 8)), strict=True):
        for end, wanted in zip(found, expected, strict=True):
            assert end == pytest.approx(wanted, abs=0.1) if abs(wanted) < 8 else 8 < abs(end) < 11
    assert len(list(prolong(box(4, 4, 4), BLOCK))) == 9


def test_what_is_out_of_the_cloud_or_has_no_straight_walls_stays():
    assert list(prolong(cylinder(3, 40), BLOCK)) == []
    assert list(prolong(sphere(3), BLOCK)) == []
    assert list(prolong(cone(3, 2, 4), BLOCK)) == []


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (20.0, -35.0, 50.0), (0.0, 0.0, 90.0)])
def test_two_boxes_of_one_section_are_spanned(turn):
    axes = matrix_from_euler(turn)
    a = Primitive("box", (4.0, 6.0, 10.0), tuple(axes @ (1.0, 2.0, -8.0)), turn)
    b = Primitive("box", (4.2, 6.0, 3.0), tuple(axes @ (1.0, 2.1, 6.5)), turn)
    both = span(a, b, 0.5)
    assert both is not None
    assert both.size == pytest.approx((4.0, 6.0, 21.0))
    assert np.array(both.center) @ axes == pytest.approx((1.0, 2.0, -2.5))
    assert span(a, b, 0.09) is None
    turned = Primitive("box", (10.0, 6.0, 4.0), a.center, b.rotation)
    assert span(a, turned, 0.5) is None


def test_coaxial_cylinders_of_one_radius_are_spanned():
    both = span(cylinder(5, 4), cylinder(5.1, 6, (0.0, 0.1, 20.0)), 0.5)
    assert both is not None
    assert both.size == pytest.approx((5.0, 25.0))
    assert both.center == pytest.approx((0.0, 0.0, 10.5))
    assert span(cylinder(5, 4), cylinder(3, 6, (0.0, 0.0, 20.0)), 0.5) is None
    assert span(cylinder(5, 4), box(5, 5, 5), 0.5) is None
    assert span(sphere(3), sphere(3), 9.0) is None


def test_pieces_of_a_floor_are_one_floor():
    floor = {3: box(10, 12, 2, (-10.0, 0.0, 1.0)), 5: box(14, 12, 2.1, (0.0, 0.0, 1.0)), 8: box(2, 10, 10, (12.0, 1.0, 1.05), (0, 90, 0))}
    wall = {9: box(30, 2, 12, (0.0, 8.0, 6.0))}
    found = [(part, those) for part, those in layers({**floor, **wall}, 0.3) if those == (3, 5, 8)]
    ((part, _),) = found
    assert part.size == pytest.approx((32, 12, 2), abs=0.1)  # from -15 to 17
    assert part.center == pytest.approx((1, 0, 1), abs=0.1)


def test_boxes_in_no_common_layer_are_not_joined():
    turned = box(10, 10, 2, (20.0, 0.0, 1.0), (0.0, 0.0, 30.0))
    assert not list(layers({0: box(10, 10, 2), 1: box(12, 9, 3, (3.0, 4.0, 5.0)), 2: turned}, 0.3))
