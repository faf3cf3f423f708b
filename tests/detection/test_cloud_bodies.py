"""Bodies of noisy clouds that stand apart, planted at known places."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.detection.cloud_bodies import group_alike, split_cloud
from imdim.geometry.sampling import surface_points
from imdim.program.tree import Program

SIGMA = 0.4
APART = 30.0


def noisy(program: Program, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


def test_bodies_apart_have_their_own_points_and_strays_far_off_none():
    rng = np.random.default_rng(1)
    first, second, strays = noisy(box(20, 16, 12), 3000), noisy(cylinder(5, 12, (APART, 0.0, 0.0)), 1200), rng.uniform(-60, 60, (60, 3))
    large, small = split_cloud(np.concatenate([second, first, strays]), SIGMA)
    assert set(range(1200, 4200)) <= set(large.tolist())
    assert set(range(1200)) <= set(small.tolist())
    assert len(large) + len(small) < 4260 - 30


@pytest.mark.parametrize(
    "parts",
    [
        [box(20, 16, 12)],
        [box(20, 16, 12), box(20, 16, 12, (20 + 2 * SIGMA, 0.0, 0.0))],
        [union(box(20, 16, 12), cylinder(2, 40, (0.0, 0.0, 20.0)))],
    ],
    ids=["one", "a gap within the noise", "a thin neck"],
)
def test_what_hangs_together_stays_whole(parts):
    points = np.concatenate([noisy(part, 3000) for part in parts])
    (whole,) = split_cloud(points, SIGMA)
    assert len(whole) == len(points)


def test_two_sheets_of_a_body_whose_sides_nobody_saw_are_no_bodies():
    """A plate from above and from below: nothing says that either is closed."""
    points = noisy(box(40, 40, 14), 6000)
    seen = points[(np.abs(np.abs(points[:, 2]) - 7) < 3 * SIGMA) & (np.abs(points[:, :2]).max(1) < 19)]
    (whole,) = split_cloud(seen, SIGMA)
    assert len(whole) == len(seen)


def test_too_few_points_tell_no_body():
    (whole,) = split_cloud(np.concatenate([noisy(box(20, 16, 12), 3000), noisy(box(4, 4, 4, (APART, 0.0, 0.0)), 150)]), SIGMA)
    assert len(whole) == 3150


def test_few_points_and_points_told_many_times_are_one():
    for points in (noisy(box(20, 16, 12), 30), np.repeat(noisy(box(20, 16, 12), 100), 12, axis=0)):
        (whole,) = split_cloud(points, SIGMA)
        assert len(whole) == len(points)


def test_bodies_that_differ_by_their_place_alone_are_of_one_group():
    peg = cut(cylinder(6, 20), cylinder(3, 30))
    ways = [(0.0, 0.0, 0.0), (0.0, APART, 0.0), (3.0, 2 * APART, 5.0)]
    pegs = [noisy(peg, 1500, seed) + np.array(way) for seed, way in enumerate(ways)]
    lid = noisy(box(40, 40, 6), 3000)
    first, second = group_alike([pegs[0], lid, pegs[1], pegs[2]], SIGMA)
    assert [i for i, _ in first] == [0, 2, 3]  # 4,500 points in all
    assert [i for i, _ in second] == [1]
    for (_, found), way in zip(first, ways, strict=True):
        assert found == pytest.approx(way, abs=SIGMA / 2)


def test_bodies_of_one_size_and_other_shapes_are_not_alike():
    groups = group_alike([noisy(box(12, 12, 20), 1500), noisy(cylinder(6.0, 20), 1500)], SIGMA)
    assert len(groups) == 2
