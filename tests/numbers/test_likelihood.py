"""How likely a noisy cloud is: against the mixture written out, and against what is known of clouds that were made from it."""

import numpy as np
import pytest
from tests.planted import PARTS, box, cut, cylinder, union

from imdim.geometry.sampling import surface_points
from imdim.geometry.shadows import Shadows
from imdim.geometry.solid import to_manifold
from imdim.numbers.likelihood import NEIGHBOURS, WIDE, Noise, SurfaceSamples, expectation_step

RING = cut(cylinder(20, 6), cylinder(15, 30))
SIGMA = 1.2  # a fifth of the ring's height


def cloud(program, n=6000, sigma=SIGMA, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, sigma, (n, 3))


def test_it_is_the_density_of_the_mixture():
    points, noise = cloud(RING, 300), Noise(SIGMA, 0.05)
    shown = SurfaceSamples(*surface_points(RING, NEIGHBOURS, np.random.default_rng(3)), area=3000.0, skin=0.0)
    wide = max(SIGMA, WIDE * shown.spacing)
    away = points[:, None] - shown.points
    along = np.einsum("nmc,mc->nm", away, shown.normals)
    across = (away**2).sum(2) - along**2
    density = np.exp(-(along**2) / SIGMA**2 / 2 - across / wide**2 / 2) / ((2 * np.pi) ** 1.5 * SIGMA * wide**2)
    reach = np.linalg.norm(away, axis=2) < 4 * wide
    whole = 0.95 * (density * reach).mean(1) + 0.05 / np.prod(np.ptp(points, axis=0))
    found = expectation_step(points, shown, noise)
    assert found.nll == pytest.approx(-np.log(whole).mean(), rel=1e-9)
    answer = 0.95 * density * reach / len(shown.points) / whole[:, None]
    assert found.mass == pytest.approx(answer.sum(0), rel=1e-9)
    assert found.offset == pytest.approx((answer * along).sum(0) / answer.sum(0), rel=1e-6, abs=1e-9)
    assert found.noise.clutter == pytest.approx(1 - answer.sum() / len(points), abs=1e-9)


def test_faces_that_lie_in_one_are_one_surface():
    """Ribs of their plate's length that end in its faces: sampled once for each part, flush walls would bear twice the points."""
    flush = union(box(40, 30, 4), union(box(40, 4, 20, (0.0, -13.0, 8.0)), box(40, 4, 20, (0.0, 13.0, 8.0))))
    exact = to_manifold(flush).surface_area()
    assert SurfaceSamples.of(flush, 0.5).area == pytest.approx(exact, rel=0.01)
    apart = union(box(40, 30, 4), union(box(40.1, 4, 20, (0.0, -13.0, 8.05)), box(39.9, 4, 20, (0.0, 13.0, 8.05))))
    points = cloud(flush, sigma=0.5)
    of_flush, of_apart = (expectation_step(points, SurfaceSamples.of(p, 0.5), Noise(0.5)).nll for p in (flush, apart))
    assert of_flush < of_apart + 1e-3


def test_noise_has_a_floor():
    points, shown = cloud(RING, 4000, sigma=0.1), SurfaceSamples.of(RING, SIGMA)
    free, held = (expectation_step(points, shown, Noise(SIGMA, least=least)).noise for least in (0.0, 0.8))
    assert free.sigma < 0.8 == held.sigma == held.least
    assert free.clutter == held.clutter


def test_no_face_is_pulled_at_the_truth():
    """Distances to the nearest surface would move the ring's ends outward by a good part of the noise."""
    points, shown = cloud(RING, 40_000), SurfaceSamples.of(RING, SIGMA)
    found = expectation_step(points, shown, Noise(SIGMA, 1e-3))
    for face in (shown.normals[:, 2] > 0.9, shown.normals[:, 2] < -0.9, np.hypot(*shown.points[:, :2].T) > 19.9):
        pull = (found.mass * found.offset)[face].sum() / found.mass[face].sum()
        assert abs(pull) < 0.05 * SIGMA
    assert found.noise.sigma == pytest.approx(SIGMA, rel=0.02)
    assert found.noise.clutter < 0.01


@pytest.mark.parametrize(
    "worse",
    [
        cut(cylinder(20, 1.0), cylinder(15, 30)),  # a sheet in the middle of the wall
        cut(cylinder(20, 8.0), cylinder(15, 30)),
        cut(cylinder(20, 6.0), cylinder(16.5, 30)),
        cylinder(20, 6),
        union(RING, box(8, 8, 8, (30.0, 0.0, 0.0))),  # a surface without points
        cut(RING, box(6, 6, 30, (17.0, 0.0, 0.0))),
    ],
)
def test_the_truth_is_likelier_than_what_is_wrong(worse):
    points = cloud(RING)
    true, wrong = (expectation_step(points, SurfaceSamples.of(p, SIGMA), Noise(SIGMA, 0.01)).nll for p in (RING, worse))
    assert true < wrong - 0.01


def test_a_wall_thinner_than_the_noise_keeps_its_thickness():
    """Samples drawn by chance are likelier where two skins lie in one: twice as many lie there, and their density is more even."""
    points = cloud(box(60, 60, 1.0), 8000, 1.0)
    found = {t: expectation_step(points, SurfaceSamples.of(box(60, 60, t), 1.0), Noise(1.0, 1e-3)).nll for t in (0.02, 0.5, 1.0, 1.5, 2.0)}
    assert min(found, key=found.__getitem__) == 1.0


def test_samples_show_the_surface_alone():
    shown = SurfaceSamples.of(RING, 0.3)
    radius, height = np.hypot(*shown.points[:, :2].T), np.abs(shown.points[:, 2])
    assert (radius > 15 - 1e-9).all()
    assert (height < 3 + 1e-9).all()
    assert shown.area == pytest.approx(2 * np.pi * (20**2 - 15**2 + 35 * 6), rel=0.03)
    assert shown.skin == 0.0
    assert SurfaceSamples.of(cut(cylinder(20, 6), cylinder(19.5, 30)), 0.3).skin > 0.5


def test_a_gap_that_noise_hides_is_none():
    sunk, apart = (union(box(20, 20, 4), box(10, 10, 4, (0.0, 0.0, z))) for z in (4.0, 4.1))
    assert SurfaceSamples.of(apart, 0.2).area == pytest.approx(SurfaceSamples.of(sunk, 0.2).area, rel=0.03)


def test_nothing_shown_leaves_clutter():
    nothing = cut(box(1, 1, 1), box(2, 2, 2))
    points = cloud(RING, 200)
    found = expectation_step(points, SurfaceSamples.of(nothing, 0.1), Noise(0.1, 0.5))
    assert found.nll == pytest.approx(np.log(np.prod(np.ptp(points, axis=0))) - np.log(0.5))
    assert len(found.mass) == 0


@pytest.mark.parametrize("name", ["L bracket", "stepped shaft"])
def test_units_only_shift_it(name):
    points = cloud(PARTS[name], 2000, 0.5)
    scaled = [
        expectation_step(points * s, SurfaceSamples.of(_scaled(PARTS[name], s), 0.5 * s), Noise(0.5 * s)).nll - 3 * np.log(s)
        for s in (1.0, 1e3)
    ]
    assert scaled[0] == pytest.approx(scaled[1], abs=1e-6)


def _scaled(program, by):
    from imdim.target.target import Frame

    return Frame((0.0, 0.0, 0.0), by).apply(program)


def test_what_no_scanner_could_see_needs_no_points():
    """A scanner above a block sees its top; the density of the points is spread over that alone, and a block of any depth is as likely."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-10, 10, (4000, 2)), rng.normal(0, 0.1, 4000)])
    shadows = Shadows.of(points, np.array([[0.0, 0.0, 2000.0]]), 0.1)
    deep, flat = (box(20, 20, h, (0, 0, -h / 2)) for h in (30, 8))
    blind, told = (expectation_step(points, SurfaceSamples.of(deep, 0.1, shadows=s), Noise(0.1)).nll for s in (None, shadows))
    assert blind - told == pytest.approx(np.log((2 * 400 + 4 * 600) / 400), abs=0.35)  # the upper ends of the walls are near the points
    assert expectation_step(points, SurfaceSamples.of(flat, 0.1, shadows=shadows), Noise(0.1)).nll == pytest.approx(told, abs=0.1)
