"""Rounded rectangles and slots are one drawing each, wherever they lie and whatever they are made of."""

import numpy as np
import pytest
from tests.planted import box, common, cut, cylinder, union

from imdim.geometry.finish.rounded import draw_rounded
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Primitive, leaves, map_leaves


def rounded_plate(length=80.0, width=50.0, radius=5.0, height=6.0, z=0.0):
    x, y = length / 2 - radius, width / 2 - radius
    corners = [cylinder(radius, height, (a * x, b * y, z)) for a in (-1, 1) for b in (-1, 1)]
    return union(box(length, 2 * y, height, (0, 0, z)), *corners, box(2 * x, width, height, (0, 0, z)))


def slot(length, radius, height, center=(0.0, 0.0, 0.0), upright=False):
    x, y, z = center
    across = (2 * radius, length) if upright else (length, 2 * radius)
    ends = [(x, y + side * length / 2, z) if upright else (x + side * length / 2, y, z) for side in (-1, 1)]
    return [cylinder(radius, height, end) for end in ends] + [box(*across, height, center)]


def turned(program, angles):
    turn = matrix_from_euler(angles)

    def move(_, leaf: Primitive) -> Primitive:
        own = turn @ matrix_from_euler(leaf.rotation)
        return Primitive(leaf.kind, leaf.size, tuple((turn @ leaf.center).tolist()), euler_from_matrix(own), leaf.outline)

    return map_leaves(program, move)


@pytest.mark.parametrize("angles", [(0, 0, 0), (90, 0, 0), (0, 90, 0), (0, 0, 90), (20, -35, 50)])
def test_a_rounded_plate_with_a_slot_is_two_drawings_and_its_hole(angles):
    program = turned(cut(rounded_plate(), cylinder(2, 8, (30, 0, 0)), *slot(20, 4, 8, (-5, 10, 0))), angles)
    drawn = draw_rounded(program)
    assert sorted(leaf.kind for leaf in leaves(drawn)) == ["cylinder", "extrude", "extrude"]
    assert volume_iou(to_manifold(drawn, 192), to_manifold(program, 192)) > 1 - 1e-5


def test_it_lies_as_a_person_would_draw_it():
    for program in (rounded_plate(), turned(rounded_plate(50.0, 80.0), (0, 0, 90)), turned(rounded_plate(), (180, 0, 0))):
        (plate,) = leaves(draw_rounded(program))
        assert plate.rotation == pytest.approx((0, 0, 0))
        assert plate.outline is not None
        assert np.ptp([v[:2] for v in plate.outline.loops[0]], axis=0) == pytest.approx((80, 50))


@pytest.mark.parametrize("upright", [False, True])
def test_slots_of_either_way_are_drawn_and_bars_with_round_ends_are_not(upright):
    program = cut(box(60, 60, 4), *slot(20, 4, 6, upright=upright))
    drawn = draw_rounded(program)
    assert [leaf.kind for leaf in leaves(drawn)] == ["box", "extrude"]
    assert volume_iou(to_manifold(drawn, 192), to_manifold(program, 192)) > 1 - 1e-5
    bar = union(box(9, 9, 30), *slot(20, 4, 6, upright=upright))
    assert draw_rounded(bar) is bar
    # what is not cut out is joined
    island = cut(box(60, 60, 4), cut(box(40, 40, 6), *slot(20, 4, 9, upright=upright)))
    assert draw_rounded(island) is island


@pytest.mark.parametrize("angles", [(0, 0, 0), (20, -35, 50)])
@pytest.mark.parametrize("place", [0.0, 5.0])
def test_two_slots_may_share_a_cut_with_a_bridge_across_it(place, angles):
    ends = [cylinder(4, 6, (x, 0, 0)) for x in (-30, place - 10, place + 10, 30)]
    bridge = box(20, 10, 9, (place, 1, 0))
    for cuts in ([cut(box(60, 8, 6), bridge), *ends], [cut(box(60, 8, 6), cut(bridge, union(*ends[1:3]))), *ends[::3]]):
        program = turned(cut(box(90, 30, 4), *cuts), angles)
        drawn = draw_rounded(program)
        assert [leaf.kind for leaf in leaves(drawn)] == ["box", "extrude", "extrude"]
        assert volume_iou(to_manifold(drawn, 192), to_manifold(program, 192)) > 1 - 1e-5


@pytest.mark.parametrize(
    "program",
    [
        union(
            box(80, 40, 6), box(70, 50, 6), *(cylinder(5, 6, (35 * a, 20 * b, 0)) for a, b in ((-1, -1), (-1, 1), (1, -1)))
        ),  # a corner is left
        union(box(80, 40, 6), box(70, 50, 6), *(cylinder(4.9, 6, (35 * a, 20 * b, 0)) for a in (-1, 1) for b in (-1, 1))),
        cut(box(60, 60, 4), *slot(20, 4, 6)[:2], box(20, 7.9, 6)),
        common(*slot(20, 4, 6)),
        cut(*slot(20, 4, 6)),
        cut(box(90, 30, 4), cut(box(60, 8, 6), box(20, 10, 9)), *(cylinder(4, 6, (x, 0, 0)) for x in (-29, -9, 9, 29))),  # beside the ends
        cut(box(90, 30, 4), cut(box(60, 8, 6), box(20, 6, 9)), *(cylinder(4, 6, (x, 0, 0)) for x in (-30, -10, 10, 30))),  # a narrow bridge
        cut(box(60, 60, 4), *(cylinder(4, 6, (x, 0, 0), (0, 90, 0)) for x in (-10, 10)), box(20, 8, 6)),  # about another axis
    ],
)
def test_what_is_none_stays(program):
    assert draw_rounded(program) is program


def test_a_drawing_is_cut_where_it_was():
    """What is cut from a part of a union stays cut from that alone."""
    lug = cut(rounded_plate(), *slot(20, 4, 8))
    program = union(box(10, 10, 40, (0, 40, 0)), lug)
    drawn = draw_rounded(program)
    assert sorted(leaf.kind for leaf in leaves(drawn)) == ["box", "extrude", "extrude"]
    assert volume_iou(to_manifold(drawn, 192), to_manifold(program, 192)) > 1 - 1e-5
