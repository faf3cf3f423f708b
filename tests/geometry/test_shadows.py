"""Shadows of scanners, by shapes of which one can tell at sight what is hidden."""

import numpy as np

from imdim.geometry.shadows import Shadows

ABOVE = np.array([[0.0, 0.0, 3000.0]])
SIDE = np.array([[3000.0, 0.0, 0.0]])


def roof(count=4000, height=0.0):
    """Points of a square of side 20 at a height."""
    return np.column_stack([np.random.default_rng(0).uniform(-10, 10, (count, 2)), np.full(count, height)])


def test_what_lies_behind_points_is_hidden():
    shadows = Shadows.of(roof(), ABOVE, 0.02)
    places = np.array([[0, 0, -3], [5, -5, -9], [0, 0, 3], [0, 0, -0.2], [14, 0, -3]])
    assert shadows.hide(places).tolist() == [True, True, False, False, False]


def test_one_scanner_that_sees_a_place_is_enough():
    shadows = Shadows.of(roof(), np.concatenate([ABOVE, SIDE]), 0.02)
    assert not shadows.hide(np.array([[0, 0, -3], [9, 9, -3]])).any()


def test_strays_throw_no_shadow_and_two_sheets_do():
    lone = np.concatenate([roof(), [[3.0, 3.0, 8.0]]])
    assert not Shadows.of(lone, ABOVE, 0.02).hide(np.array([[3.0, 3.0, 4.0]])).any()
    both = np.concatenate([roof(), roof(4000, -5.0)])
    assert Shadows.of(both, ABOVE, 0.02).hide(np.array([[0, 0, -2.5], [0, 0, -8]])).all()


def test_near_scanners_see_past_edges_at_a_slant():
    """From 20 above, the square of side 20 hides one of side 30 ten below."""
    shadows = Shadows.of(roof(), np.array([[0.0, 0.0, 20.0]]), 0.02)
    assert shadows.hide(np.array([[13.0, 0.0, -10.0], [17.0, 0.0, -10.0], [0.0, 0.0, 25.0]])).tolist() == [True, False, False]


def test_surface_that_turns_away_is_hidden_though_points_are_near():
    """The lower side of a plate that is thinner than its points are apart; its rim, which a scanner grazes, may be there without points."""
    shadows = Shadows.of(roof(), ABOVE, 0.02)
    places, up = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -0.1], [12.0, 0.0, -0.5]]), np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0]])
    assert shadows.hide_surface(places, up).tolist() == [False, True, True]
    assert Shadows.of(roof(), np.concatenate([ABOVE, -ABOVE]), 0.02).face(places[:2], up[:2]).all()
