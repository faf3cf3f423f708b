"""Closed curves through noisy points: which side is in, across gaps, about an axis, and where both skins of a wall are one crowd."""

import numpy as np
import pytest

from imdim.geometry.kernels import outline_sdf
from imdim.geometry.lowering import Outlines
from imdim.program.outline import Outline, circle, loop_area
from imdim.search.mdl import curve_fitting
from imdim.search.mdl.curve_fitting import fit_outline
from imdim.search.mdl.curve_tracing import find_sides, trace_borders

SIGMA = 0.5
L_SHAPE = Outline((((0, 0, 0), (100, 0, 0), (100, 20, 0), (25, 20, 0), (25, 80, 0), (0, 80, 0)), circle(6, 12, 60)))


def along(outline, spacing, rng, noise=SIGMA):
    """Points evenly along the lines and arcs of an outline, with noise."""
    out = []
    for x, y, u, v, bulge in outline.curves:
        a, b = np.array([x, y]), np.array([u, v])
        t = np.linspace(0, 1, max(int(np.hypot(*(b - a)) / spacing), 40))[:, None]
        if bulge == 0:
            out.append(a + t * (b - a))
        else:  # half circles only
            middle, arm = (a + b) / 2, a - (a + b) / 2
            out.append(middle + np.cos(np.pi * t) * arm + np.sin(np.pi * t) * np.array([-arm[1], arm[0]]))
    points = np.concatenate(out)
    return points + rng.normal(0, noise, points.shape)


def share_of_right_cells(sides, outline, away):
    """Of the cells farther than `away` from the outline."""
    a, b = sides.inside.shape
    places = np.stack(np.meshgrid(np.arange(a) + 0.5, np.arange(b) + 0.5, indexing="ij"), -1).reshape(-1, 2) * sides.cell + sides.origin
    distance = outline_sdf(Outlines.pack([outline]).curves, places)
    far = np.abs(distance) > away
    return (sides.inside.ravel() == (distance < 0))[far].mean()


def drawn(points, which=0):
    sides = find_sides(points, np.ones(len(points)), SIGMA, turned=False)[which]
    outline = fit_outline(trace_borders(sides), sides.cell, points, SIGMA, turned=False)
    assert outline is not None
    return outline


def test_the_inside_of_an_outline_with_a_hole_is_found():
    rng = np.random.default_rng(0)
    points = np.concatenate([along(L_SHAPE, 0.15, rng), rng.uniform(-10, 110, (60, 2))])
    sides = find_sides(points, np.ones(len(points)), SIGMA, turned=False)[0]
    assert share_of_right_cells(sides, L_SHAPE, 3 * SIGMA) > 0.995


def test_a_gap_in_a_curve_does_no_harm():
    rng = np.random.default_rng(1)
    points = along(L_SHAPE, 0.15, rng)
    points = points[~((points[:, 1] < 5) & (np.abs(points[:, 0] - 60) < 4))]
    sides = find_sides(points, np.ones(len(points)), SIGMA, turned=False)[0]
    assert share_of_right_cells(sides, L_SHAPE, 3 * SIGMA) > 0.98  # where the border runs in the gap nobody knows


def test_what_reaches_an_axis_is_closed_by_it():
    rng = np.random.default_rng(2)
    profile = Outline((((0, 0, 0), (30, 0, 0), (30, 20, 0), (0, 60, 0)),))
    points = along(Outline(profile.loops), 0.1, rng)
    points = points[points[:, 0] > 1.0]  # the axis itself bears none
    sides = find_sides(points, np.ones(len(points)), SIGMA, turned=True)[0]
    assert share_of_right_cells(sides, profile, 4 * SIGMA) > 0.99


def test_both_skins_of_a_thin_wall_are_one_crowd():
    rng = np.random.default_rng(3)
    wall = Outline((((20, 0, 0), (21, 0, 0), (21, 80, 0), (20, 80, 0)),))
    points = along(wall, 0.1, rng)
    outline = drawn(points, -1)
    (left, low), (right, high) = outline.bounds
    assert (low, high) == (pytest.approx(0, abs=3 * SIGMA), pytest.approx(80, abs=3 * SIGMA))
    assert 0.5 < right - left < 4


def test_borders_run_around_what_is_inside():
    rng = np.random.default_rng(0)
    points = along(L_SHAPE, 0.15, rng)
    sides = find_sides(points, np.ones(len(points)), SIGMA, turned=False)[0]
    outer, hole = sorted(trace_borders(sides), key=len, reverse=True)
    areas = [loop_area(tuple((float(x), float(y), 0.0) for x, y in ring)) for ring in (outer, hole)]
    assert areas[0] == pytest.approx(100 * 20 + 25 * 60, rel=0.1)
    assert areas[1] == pytest.approx(-36 * np.pi, rel=0.3)


def test_points_that_close_nothing_have_no_inside():
    rng = np.random.default_rng(0)
    assert find_sides(rng.uniform(0, 300, (200, 2)), np.ones(200), SIGMA, turned=False) == []


def test_lines_and_a_circle_are_drawn_through_the_points():
    rng = np.random.default_rng(4)
    outline = drawn(along(L_SHAPE, 0.1, rng))
    assert sorted(map(len, outline.loops)) == [2, 6]
    ring = max(outline.loops, key=len)
    expected = {(0, 0), (100, 0), (100, 20), (25, 20), (25, 80), (0, 80)}
    for corner in expected:
        assert min(np.hypot(x - corner[0], y - corner[1]) for x, y, _ in ring) < SIGMA
    # level lines are so exactly
    assert len({x for x, _, _ in ring}) == 3
    assert len({y for _, y, _ in ring}) == 3
    assert outline.area == pytest.approx(3500 - 36 * np.pi, rel=0.02)


def test_an_arc_is_drawn_as_one_curve():
    rng = np.random.default_rng(5)
    slot = Outline((((-30, -10, 0.0), (30, -10, 1.0), (30, 10, 0.0), (-30, 10, 1.0)),))
    (ring,) = drawn(along(slot, 0.1, rng)).loops
    assert len(ring) in (4, 5, 6)
    assert loop_area(ring) == pytest.approx(60 * 20 + 100 * np.pi, rel=0.02)


def test_a_loop_that_crosses_a_larger_one_is_left_out_alone():
    """One of twenty holes that two crowds ran into took all of an outline with it."""
    rng = np.random.default_rng(6)

    def border(outline):
        return along(outline, 0.15, rng, noise=0.0)

    plate = Outline((((0, 0, 0), (100, 0, 0), (100, 60, 0), (0, 60, 0)),))
    whole, across = Outline((circle(8, 30, 30),)), Outline((circle(6, 100, 30),))
    points = np.concatenate([along(o, 0.1, rng) for o in (plate, whole, across)])
    found = fit_outline([border(across), border(plate), border(whole)], SIGMA, points, SIGMA, turned=False)
    assert found is not None
    assert [abs(loop_area(loop)) for loop in found.loops] == [pytest.approx(6000, rel=0.02), pytest.approx(201, rel=0.1)]
    alone = fit_outline([border(plate)], SIGMA, points, SIGMA, turned=False)
    assert alone is not None
    assert len(alone.loops) == 1


def test_where_an_arc_would_cross_the_axis_lines_are_tried():
    """A turned outline whose arc bulges over its axis was dropped where lines would not have."""
    rng = np.random.default_rng(7)
    profile = Outline((((0.2, 0, 0), (30, 0, 0), (30, 40, 0), (0.2, 40, 0.02)),))
    straight = Outline((((0.2, 0, 0), (30, 0, 0), (30, 40, 0), (0.2, 40, 0)),))
    assert profile.bounds[0][0] < 0
    asked = []

    def fit(places, sums, on_axis, sigma, price, most_turn):
        asked.append(most_turn)
        return profile.loops[0] if most_turn else straight.loops[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(curve_fitting, "_fit_loop", fit)
        found = fit_outline([along(straight, 0.2, rng, noise=0.0)], SIGMA, along(straight, 0.2, rng), SIGMA, turned=True)
    assert found == straight
    assert asked == [curve_fitting.MOST_TURN, 0.0]
