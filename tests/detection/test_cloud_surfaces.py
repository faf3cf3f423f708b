"""Carriers planted in a cloud must come back: kinds, sizes, number, and who owns which point."""

from collections import Counter

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.deadlines import PASSED
from tests.detection.cloud_parts import PARTS, detected, plate

from imdim.deadline import NEVER
from imdim.geometry.surface import Patch, signed_distance


def match(patches: list[Patch], carriers: list[tuple[str, tuple[float, ...]]], scale: float, tolerance: float) -> None:
    surfaces = {p.surface for p in patches}
    assert Counter(s.kind for s in surfaces) == Counter(kind for kind, _ in carriers)
    for kind in {kind for kind, _ in carriers}:
        unit = 1.0 if kind == "cone" else scale
        found = sorted(tuple(v / unit for v in s.sizes) for s in surfaces if s.kind == kind)
        assert np.array(found) == pytest.approx(np.array(sorted(sizes for k, sizes in carriers if k == kind)), abs=tolerance)


@pytest.mark.parametrize("name", PARTS)
def test_a_clean_cloud_gives_its_carriers_exactly(name):
    part, rng = PARTS[name](), np.random.default_rng(0)
    points, _ = part.sample(rng, 8192)
    patches = detected(points, None, rng)
    match(patches, part.carriers, 1.0, 1e-4)
    assert sum(len(p.points) for p in patches) > 0.99 * len(points)
    for p in patches:
        assert np.quantile(np.abs(signed_distance(p.surface, p.points)), 0.98) < 1e-4
        assert p.outward in (-1, 1)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_turned_moved_and_in_other_units(scale):
    part, rng = plate(), np.random.default_rng(1)
    turn = Rotation.from_euler("xyz", [10, 35, -50], degrees=True).as_matrix()
    points = scale * (part.sample(rng, 6000)[0] @ turn.T + (5.0, -3.0, 2.0))
    match(detected(points, None, rng), part.carriers, scale, 1e-4)


def test_outliers_are_left_out():
    part, rng = plate(), np.random.default_rng(2)
    points, _ = part.sample(rng, 8000)
    stray = rng.uniform((-2.2, -1.7, -0.4), (2.2, 1.7, 0.4), (160, 3))
    patches = detected(np.vstack([points, stray]), None, rng)
    match(patches, part.carriers, 1.0, 1e-4)
    assert sum(len(p.points) for p in patches) < 8000 + 40


@pytest.mark.parametrize("name", ["lamp", "plate"])
def test_noise_of_a_two_hundredth_of_the_diagonal(name):
    part, rng = PARTS[name](), np.random.default_rng(3)
    points, normals = part.sample(rng, 8192)
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    noisy = points + rng.normal(scale=0.005 * diagonal, size=points.shape)
    patches = detected(noisy, normals, rng)
    match(patches, part.carriers, 1.0, 0.03)


def test_few_points_and_the_same_seed():
    points, _ = plate().sample(np.random.default_rng(4), 600)
    a, b = (detected(points, None, np.random.default_rng(7)) for _ in range(2))
    assert [p.surface for p in a] == [p.surface for p in b]
    assert {p.surface.kind for p in a} >= {"plane"}


@pytest.mark.parametrize("sigma", [0.0, 4e-3])
def test_without_time_the_largest_surfaces_are_found(sigma):
    part, rng = plate(), np.random.default_rng(5)
    points = part.sample(rng, 6000)[0]
    points = points + sigma * np.linalg.norm(np.ptp(points, axis=0)) * rng.normal(size=points.shape)
    few, whole = (detected(points, None, np.random.default_rng(0), deadline=d) for d in (PASSED, NEVER))
    assert 1 <= len(few) < len(whole)
    assert max(p.area for p in few) > 0.8 * max(p.area for p in whole)


def test_a_noisy_cloud_that_shows_nothing_gives_nothing():
    points = np.random.default_rng(28).uniform(-1, 1, (60, 3))  # seeds of which others show some plane
    assert detected(points, None, np.random.default_rng(0)) == []
