"""Weighted samples integrate to volumes known in closed form; cells keep what the samples say."""

import math

import numpy as np
import pytest
from tests.planted import PARTS, box, cut, cylinder, sphere
from tests.search.planted_families import arrangement_of, cells_of, planted

from imdim.geometry import kernels
from imdim.geometry.surface import Surface
from imdim.search.arrangement import ArrangementConfig, arrange, codes
from imdim.search.cells import VolumeSamples, compress_samples, importance_samples

TILT = (20.0, -35.0, 50.0)
VOLUMES = {
    "box": (box(4, 3, 2, (1.0, 2.0, 3.0)), 24.0),
    "tilted box": (box(4, 3, 2, rotation=TILT), 24.0),
    "ball": (sphere(2), 32 / 3 * math.pi),
    "thin tube": (cut(cylinder(10, 40), cylinder(9.9, 50)), math.pi * (100 - 9.9**2) * 40),
    "thin lying tube": (cut(cylinder(10, 40, rotation=TILT), cylinder(9.9, 50, rotation=TILT)), math.pi * (100 - 9.9**2) * 40),
    "thin shell": (cut(sphere(10), sphere(9.9)), 4 / 3 * math.pi * (1000 - 9.9**3)),
    "thin plate": (box(100, 100, 0.1), 1000.0),
}


@pytest.mark.parametrize("name", VOLUMES)
def test_samples_integrate_to_known_volumes(name):
    program, volume = VOLUMES[name]
    points, weights = importance_samples(arrangement_of(program), 60_000, np.random.default_rng(3))
    inside = kernels.inside(program, points)
    deviation = math.sqrt((weights[inside] ** 2).sum())
    assert abs(weights[inside].sum() - volume) < 4 * deviation
    assert deviation < 0.045 * volume


@pytest.mark.parametrize("name", ["thin tube", "thin lying tube", "thin plate"])
def test_thin_walls_get_more_than_their_share_of_samples(name):
    program, volume = VOLUMES[name]
    arrangement = arrangement_of(program)
    points, _ = importance_samples(arrangement, 60_000, np.random.default_rng(3))
    share = volume / np.prod(arrangement.bounds[1] - arrangement.bounds[0])
    assert kernels.inside(program, points).mean() > 2 * share


@pytest.mark.parametrize("name", ["bored ball", "tube on a flange"])
def test_samples_fill_their_box(name):
    arrangement = arrangement_of(PARTS[name])
    points, weights = importance_samples(arrangement, 60_000, np.random.default_rng(4))
    low, high = arrangement.outer
    assert ((points >= low) & (points <= high)).all()
    assert abs(weights.sum() - np.prod(high - low)) < 4 * math.sqrt((weights**2).sum())
    half = points[:, 0] > (low[0] + high[0]) / 2
    assert abs(weights[half].sum() - np.prod(high - low) / 2) < 4 * math.sqrt((weights**2).sum())


def test_slabs_of_no_thickness_leave_all_weights_finite():
    """A ball over one corner moves the outer box there, and leaves it where it was at the other."""
    corner = Surface("sphere", (-0.5, -0.5, -0.5), (0.0, 0.0, 1.0), (0.25 / 1.01,))
    box_ends = np.array([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]])
    arrangement = arrange([corner], [1.0], box_ends, ArrangementConfig(margin=0.0))
    assert all((np.diff(d.offsets) == 0).any() for d in arrangement.directions)
    points, weights = importance_samples(arrangement, 60_000, np.random.default_rng(5))
    assert (np.isfinite(weights) & (weights > 0)).all()
    inside = np.linalg.norm(points - corner.point, axis=1) < corner.sizes[0]
    assert abs(weights[inside].sum() - 4 / 3 * math.pi * corner.sizes[0] ** 3) < 4 * math.sqrt((weights[inside] ** 2).sum())


@pytest.mark.parametrize("name", ["bored ball", "countersink", "stepped shaft"])
def test_cells_hold_what_the_samples_of_their_code_say(name):
    arrangement, program = arrangement_of(PARTS[name]), PARTS[name]
    cells = cells_of(arrangement, program, 8000)
    points, weights = importance_samples(arrangement, 8000, np.random.default_rng(7))
    sums: dict[bytes, list[float]] = {}
    slabs, inside = codes(arrangement, points)
    for s, i, w, filled in zip(slabs, inside, weights, kernels.inside(program, points), strict=True):
        sums.setdefault(s.tobytes() + i.tobytes(), [0.0, 0.0])[0 if filled else 1] += w
    assert len(sums) == len(cells.points)
    keys = [s.tobytes() + i.tobytes() for s, i in zip(cells.slabs, cells.inside, strict=True)]
    assert np.array([sums[k] for k in keys]) == pytest.approx(np.stack([cells.w_in, cells.w_out], 1))
    again = codes(arrangement, cells.points)
    assert np.array_equal(again[0], cells.slabs)
    assert np.array_equal(again[1], cells.inside)


@pytest.mark.parametrize("name", PARTS)
def test_drawn_surfaces_leave_no_cell_in_doubt(name):
    cells = planted(name).cells
    assert np.minimum(cells.w_in, cells.w_out).sum() < 1e-9 * cells.volume
    assert cells.gain.sum() == pytest.approx(cells.volume - cells.w_out.sum())


def test_slabs_and_flags_are_what_they_say():
    arrangement = arrangement_of(PARTS["tube on a flange"])
    slabs, inside = codes(arrangement, np.array([[8.0, 0.0, 20.0], [0.0, 15.0, 4.0], [0.0, 0.0, 1.0]]))
    radii = [s.sizes[0] for s in arrangement.curved]
    assert [{r for r, flag in zip(radii, row, strict=True) if flag} for row in inside] == [{10, 20}, {20}, {7, 10, 20}]
    up = next(i for i, d in enumerate(arrangement.directions) if abs(d.vector[2]) > 0.9)
    offsets = arrangement.directions[up].offsets
    for z, slab in zip((20.0, 4.0, 1.0), slabs[:, up], strict=True):
        assert offsets[slab] < z < offsets[slab + 1]
    assert np.isin((0, 5, 30), np.round(offsets, 9)).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_cell_in_two_pieces_has_its_point_in_the_larger(seed):
    """The hollow between a fillet and its wall has the code of the plate beyond the fillet."""
    wall, fillet = (
        Surface("cylinder", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.2,)),
        Surface("torus", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.22, 0.02)),
    )
    bounds = np.array([[-0.5, -0.5, -0.1], [0.5, 0.5, 0.1]])
    arrangement = arrange([wall, fillet], [1.0, 1.0], bounds, ArrangementConfig())
    points = np.random.default_rng(seed).uniform([0.2, -0.1, -0.02], [0.24, 0.1, 0.02], (20_000, 3))
    hollow, beyond = (points[r] for r in (np.hypot(points[:, 0], points[:, 1]) < 0.206, np.hypot(points[:, 0], points[:, 1]) > 0.234))
    ordered = np.concatenate([hollow, beyond, beyond + np.array([0.1, 0.0, 0.0])])
    weight = np.ones(len(ordered))
    cells = compress_samples(arrangement, VolumeSamples(ordered, weight, weight))
    slabs, inside = codes(arrangement, ordered)
    for cell in range(len(cells.points)):
        members = ((slabs == cells.slabs[cell]).all(1) & (inside == cells.inside[cell]).all(1)).nonzero()[0]
        near = np.hypot(*ordered[members, :2].T) < 0.22
        assert (np.hypot(*cells.points[cell, :2]) < 0.22) == (near.sum() > len(near) / 2)


def test_directions_that_show_as_much_have_an_order_of_their_own():
    plates = [Surface("plane", (0.1, 0.1, 0.1), axis) for axis in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    bounds = np.array([[-0.5, -0.5, -0.1], [0.5, 0.5, 0.1]])
    for areas in ([1.0, 1.0 - 1e-12, 3.0], [1.0 - 1e-12, 1.0, 3.0]):
        directions = arrange(plates, areas, bounds, ArrangementConfig()).directions
        assert [int(np.argmax(d.vector)) for d in directions] == [2, 0, 1]
