"""Coordinates of outlines: how far each moves the boundary agrees with distances, and what is level or on the axis stays so."""

import numpy as np
import pytest

from imdim.geometry.kernels import outline_sdf, program_sdf
from imdim.geometry.lowering import Outlines
from imdim.numbers.outline_coordinates import center_leaf, outline_coordinates
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive

STEP = 1e-5
SHAFT = Outline((((0.0, -3.0, 0.0), (8.0, -3.0, 1.2), (8.0, 3.0, -0.3), (5.0, 4.0, 0.0), (0.0, 3.0, 0.0)), circle(0.5, 4.0, 0.0)))


def sdf(outline, points):
    return outline_sdf(Outlines.pack([outline]).curves, points)


def gradient(outline, points):
    out = np.stack([(sdf(outline, points + STEP * e) - sdf(outline, points - STEP * e)) / (2 * STEP) for e in np.eye(2)], 1)
    return out / np.linalg.norm(out, axis=1)[:, None]


def boundary(outline, count=2000):
    """Points on an outline, by steps along the gradient of the distance, away from its corners."""
    points = np.random.default_rng(0).uniform((-1, -7), (13, 7), (count, 2))
    for _ in range(6):
        points = points - sdf(outline, points)[:, None] * gradient(outline, points)
    corners = np.array([v[:2] for loop in outline.loops for v in loop])
    clear = np.linalg.norm(points[:, None] - corners, axis=2).min(1) > 0.05
    return points[clear & (np.abs(sdf(outline, points)) < 1e-9)]


@pytest.mark.parametrize("turned", [False, True])
def test_each_coordinate_moves_the_boundary_as_distances_say(turned):
    coordinates, points = outline_coordinates(SHAFT, turned), boundary(SHAFT)
    rows = coordinates.rows(points, gradient(SHAFT, points)).toarray()
    for j, by in enumerate(np.eye(coordinates.count) * STEP):
        measured = -(sdf(coordinates.move(by), points) - sdf(coordinates.move(-by), points)) / (2 * STEP)
        assert np.abs(measured - rows[:, j]).max() < 1e-3


def test_level_lines_stay_level_and_the_axis_stays_on_the_axis():
    """Five vertices and two arcs are twelve coordinates; two level lines and the one on the axis join three of them, a circle adds three.
    Turned, the two on the axis have no x."""
    assert outline_coordinates(SHAFT, False).count == 12 - 2 + 3
    coordinates = outline_coordinates(SHAFT, True)
    assert coordinates.count == 12 - 1 - 2 + 3
    moved = coordinates.move(np.random.default_rng(0).normal(0, 0.1, coordinates.count)).loops
    assert moved[0][0][0] == moved[0][4][0] == 0.0
    assert moved[0][0][1] == moved[0][1][1]
    assert moved[1][0][1] == moved[1][1][1]


def test_a_leaf_with_its_outline_in_the_middle_is_the_same_solid():
    points = np.random.default_rng(0).uniform(-15, 15, (500, 3))
    for kind, size in (("extrude", (4.0,)), ("revolve", (360.0,))):
        leaf = Primitive(kind, size, (1.0, 2.0, 3.0), (20.0, 30.0, 40.0), SHAFT.shift(0.0, 5.0))
        centered = center_leaf(leaf)
        assert program_sdf(centered, points) == pytest.approx(program_sdf(leaf, points), abs=1e-9)
        assert centered.outline is not None
        low, high = centered.outline.bounds
        assert low[1] == pytest.approx(-high[1])
