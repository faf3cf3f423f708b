"""Polygons redrawn with lines and arcs: what was drawn comes back from the corners of its tessellation."""

import math

import numpy as np
import pytest

from imdim.geometry import kernels
from imdim.geometry.lowering import Outlines
from imdim.geometry.polygon_arcs import draw_ring
from imdim.program.outline import Outline, arc_radii, circle, circle_of, flatten_loop, loop_area

QUARTER = math.tan(math.pi / 8)
PLATE = ((-20.0, -10.0, 0.0), (20.0, -10.0, 0.0), (20.0, 6.0, QUARTER), (16.0, 10.0, 0.0), (-20.0, 10.0, 0.0))


@pytest.mark.parametrize("first", [0, 2, 4, 9])
def test_a_round_corner_is_one_arc_wherever_the_polygon_begins(first: int) -> None:
    corners = np.roll(np.array(flatten_loop(PLATE, 64)), first, axis=0)
    ring = draw_ring(corners, 1e-3)
    assert ring is not None
    assert sorted(round(b, 3) for _, _, b in ring) == [0, 0, 0, 0, round(QUARTER, 3)]
    assert arc_radii(Outline((ring,))) == pytest.approx([4.0], rel=1e-3)
    assert loop_area(ring) == pytest.approx(loop_area(PLATE), rel=1e-4)


def test_corners_of_a_circle_are_a_circle() -> None:
    corners = np.array(flatten_loop(circle(3.0, 1.0, 2.0), 24))
    ring = draw_ring(corners[::-1], 1e-3)
    assert ring is not None
    found = circle_of(ring)
    assert found is not None
    assert found == pytest.approx((1.0, 2.0, 3.0), abs=1e-6)


def test_polygons_stay_polygons() -> None:
    hexagon = np.array([(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)])
    ring = draw_ring(hexagon, 1e-3)
    assert ring is not None
    assert [b for _, _, b in ring] == [0.0] * 6
    chamfered = np.array([(0, 0), (9, 0), (10, 1), (10, 9), (9, 10), (1, 10), (0, 9)], float)
    assert [b for _, _, b in draw_ring(chamfered, 1e-3) or ()] == [0.0] * 7


def test_no_corner_is_farther_off_than_the_tolerance() -> None:
    turns = np.linspace(0, 2 * math.pi, 200, endpoint=False)
    wave = np.column_stack([(5 + np.cos(3 * turns)) * np.cos(turns), (5 + np.cos(3 * turns)) * np.sin(turns)])
    counts = []
    for tolerance in (1e-3, 1e-2):
        ring = draw_ring(wave, tolerance)
        assert ring is not None
        off = kernels.outline_sdf(Outlines.pack([Outline((ring,))]).curves, wave)
        assert np.abs(off).max() < tolerance
        counts.append(len(ring))
    assert counts[1] < counts[0] < 60


def test_what_bounds_nothing_is_no_ring() -> None:
    assert draw_ring(np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 1e-6)]), 1e-3) is None
