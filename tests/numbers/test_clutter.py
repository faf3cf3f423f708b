"""Where clutter lies, and what a fit makes of thin walls among it, by planted clouds."""

import numpy as np
import pytest
from tests.planted import box, mesh_of

from imdim.numbers import clutter
from imdim.numbers.clutter import BINS, EVERYWHERE, ClutterBox
from imdim.numbers.em import EMConfig, maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.program.tree import Primitive
from imdim.target.scan import parse_condition, scan

PLATE = box(70, 70, 6)
SIGMA = 0.01 * float(np.linalg.norm((70, 70, 6)))
CORNERS = np.array([[0.0, 0.0, 0.0], [64.0, 64.0, 64.0]])


def test_ends_are_found_to_a_bin_where_the_points_tell():
    """A third of the points is even in a box, the others are where the surface is as dense as they are."""
    rng = np.random.default_rng(0)
    strewn, surface = rng.uniform((4, 10, 0), (40, 60, 64), (3000, 3)), np.concatenate([rng.uniform(0, 64, (5998, 3)), CORNERS])
    points = np.concatenate([strewn, surface])
    signal = np.full(len(points), 2 / 3 / 64**3)
    found = EVERYWHERE
    for _ in range(4):
        found = found.fit(points, signal, 1 / 3, 1.0)
    assert found.low == pytest.approx((4, 10, 0), abs=1.5)
    assert found.high == pytest.approx((40, 60, BINS), abs=1.5)
    assert EVERYWHERE.fit(points, signal, 0.01, 1.0) == EVERYWHERE  # where there is little, it does not matter


@pytest.mark.parametrize("found", [EVERYWHERE, ClutterBox((10, 10, 10), (30, 50, 60))])
def test_its_density_is_one_in_all(found):
    points = np.concatenate([np.random.default_rng(1).uniform(0, 64, (200_000, 3)), CORNERS])
    assert found.density(points, 0.1).mean() * 64**3 == pytest.approx(1, abs=0.02)


def thicknesses(seeds):
    """Of the plate, fitted to its points among as many strays as a ninth of them, in a box that is a tenth larger."""
    wanted = parse_condition("noise=1%+outliers=10%")
    assert wanted is not None
    for seed in range(seeds):
        points, _ = scan(mesh_of(PLATE), wanted, np.random.default_rng(seed))
        fitted = maximise_likelihood(PLATE, points, Noise(SIGMA, clutter=0.1), EMConfig(samples=30_000, still=0.004, whole=True)).program
        assert isinstance(fitted, Primitive)
        yield fitted.size[2]


def test_strays_do_not_thin_a_plate(monkeypatch):
    assert np.mean([*thicknesses(6)]) == pytest.approx(6, abs=0.05)
    monkeypatch.setattr(clutter, "TELLING", 1.0)  # taken to be even in the box of all points
    assert np.mean([*thicknesses(6)]) < 5.9
