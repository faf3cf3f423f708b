"""Circles of points at equal angles, wherever the first of them stands."""

import math

import pytest

from imdim.program.patterns.linear import rings

TOLERANCE = 1e-3


@pytest.mark.parametrize("first", [0.0, -1e-6, 1e-6, 17.0])
def test_a_circle_is_found_across_the_angle_at_which_turns_begin(first: float) -> None:
    turns = [math.radians(first + 30 * k) for k in range(12)]
    points = [(2 + 5 * math.cos(t), 3 + 5 * math.sin(t)) for t in turns]
    found = next(iter(rings(points, [(2.0, 3.0)], TOLERANCE)))
    assert sorted(found.members) == list(range(12))
    assert found.angle == pytest.approx(30)


def test_arcs_end_where_the_next_point_is_missing() -> None:
    turns = [math.radians(350 + 10 * k) for k in range(5)]
    points = [(5 * math.cos(t), 5 * math.sin(t)) for t in turns]
    arcs = [ring for ring in rings(points, [(0.0, 0.0)], TOLERANCE) if ring.angle == pytest.approx(10)]
    assert [ring.members for ring in arcs] == [(0, 1, 2, 3, 4)]


def test_points_that_are_off_by_more_than_the_tolerance_are_in_no_circle() -> None:
    turns = [math.radians(30 * k + (0.5 if k == 4 else 0.0)) for k in range(12)]
    points = [(5 * math.cos(t), 5 * math.sin(t)) for t in turns]
    assert not any(4 in ring.members and len(ring.members) > 4 for ring in rings(points, [(0.0, 0.0)], TOLERANCE))
