"""Walls that noise lets nobody tell apart, against those that were planted."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.geometry import kernels
from imdim.geometry.sampling import surface_points
from imdim.numbers.information import Coordinates
from imdim.numbers.measured import MAD, measure, noise_beside
from imdim.numbers.wall_ties import find_walls, tie_walls
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves

SIGMA = 1.0
WALL = 2.0
FRAME = cut(box(180, 100, 60), box(180 - 2 * WALL, 100 - 2 * WALL, 80))
CUP = cut(cylinder(50, 60), cylinder(50 - WALL, 60, (0.0, 0.0, WALL)))


def cloud(program, sigma=SIGMA, n=8000, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, sigma, (n, 3))


def measured(program, points):
    return measure(program, points, np.zeros((0, Coordinates.of(program).count)), rounds=0)


def thicknesses(frame):
    outer, inner = leaves(frame)
    return [sign * (outer.center[k] - inner.center[k]) + (outer.size[k] - inner.size[k]) / 2 for k in range(2) for sign in (-1, 1)]


@pytest.mark.parametrize("program", [FRAME, CUP], ids=["frame", "cup"])
def test_both_skins_of_thin_walls_tell_the_noise(program):
    points = cloud(program)
    nearest = MAD * np.median(np.abs(kernels.program_sdf(program, points)))
    assert nearest < 0.85 * SIGMA
    assert noise_beside(program, points).sigma == pytest.approx(SIGMA, rel=0.03)


def test_the_noise_of_a_thick_part_and_of_one_without_noise_are_what_they_are():
    block = box(60, 40, 20)
    assert noise_beside(block, cloud(block, 0.3)).sigma == pytest.approx(0.3, rel=0.03)
    assert noise_beside(block, cloud(block, 1e-4)).sigma < 2e-4


def test_walls_are_found_with_how_they_change_with_the_numbers():
    known = measured(FRAME, cloud(FRAME))
    walls = find_walls(known)
    assert len(walls) == 4
    moved = known.start.move(walls[0].slope * 0.01)
    grown = max(np.abs(np.array(thicknesses(moved)) - WALL))
    assert [w.thickness for w in walls] == pytest.approx([WALL] * 4, abs=1e-3)
    assert grown == pytest.approx(0.01 * float(walls[0].slope @ walls[0].slope), rel=0.05)


def test_walls_of_one_thickness_are_known_better_together_than_alone():
    off_alone, off_together = [], []
    for seed in range(12):
        points = cloud(FRAME, seed=seed)
        wrong = cut(box(180.15, 99.9, 60), box(175.95, 96.2, 80, (0.05, -0.05, 0.0)))
        known = measure(wrong, points, np.zeros((0, 18)))
        tied = tie_walls(known)
        assert tied is not None
        off_alone += [abs(t - WALL) for t in thicknesses(known.program)]
        off_together += [abs(t - WALL) for t in thicknesses(tied[0])]
        assert np.ptp(thicknesses(tied[0])) < 0.02
    assert np.mean(off_together) < 0.75 * np.mean(off_alone)


def test_walls_that_clearly_differ_stay_different():
    tray = cut(box(180, 100, 60), box(176, 92, 80))  # walls of two and of four
    tied = tie_walls(measured(tray, cloud(tray)))
    assert tied is not None
    assert thicknesses(tied[0]) == pytest.approx([2, 2, 4, 4], abs=0.25)


def test_the_walls_of_a_drawing_are_walls_too():
    ring = [(-90, -50), (90, -50), (90, 50), (-90, 50)]
    hole = [(x * (1 - WALL / abs(x)), y * (1 - WALL / abs(y))) for x, y in ring]
    frame = Primitive("extrude", (60.0,), outline=Outline((tuple((x, y, 0) for x, y in ring), tuple((x, y, 0) for x, y in reversed(hole)))))
    known = measured(frame, cloud(frame))
    assert [w.thickness for w in find_walls(known)] == pytest.approx([WALL] * 4, abs=1e-3)


def test_a_thick_part_and_one_wall_alone_have_none_to_tie():
    plates = union(box(60, 40, 20)), union(box(60, 40, 2))
    for plate in plates:
        assert tie_walls(measured(plate, cloud(plate, 0.5))) is None
