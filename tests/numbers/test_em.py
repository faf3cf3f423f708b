"""The numbers that make a noisy cloud most likely: unbiased where walls and edges are of the noise's size."""

from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.drawn import BRACKET, centred
from tests.planted import box, cut, cylinder, sphere, union

from imdim.geometry import kernels
from imdim.geometry.lowering import lower
from imdim.geometry.sampling import surface_points
from imdim.numbers import em
from imdim.numbers.em import EMConfig, clip_program, maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.refine import refine
from imdim.numbers.shared_rotations import align_rotations, frames, map_shared_turns
from imdim.program.outline import Outline, are_near, check_crossings, circle
from imdim.program.tree import Primitive, leaves, map_leaves

RING = cut(cylinder(20, 6), cylinder(15, 12))
SIGMA = 1.2


def cloud(program, n=8000, sigma=SIGMA, seed=0, clutter=0.0):
    rng = np.random.default_rng(seed)
    points = surface_points(program, n, rng)[0] + rng.normal(0, sigma, (n, 3))
    wrong = rng.permutation(n)[: round(clutter * n)]
    points[wrong] = rng.uniform(points.min(0), points.max(0), (len(wrong), 3))
    return points


@pytest.mark.parametrize("clutter", [0.0, 0.05])
def test_a_wall_of_five_deviations_keeps_its_measures(clutter):
    points = cloud(RING, clutter=clutter)
    found = maximise_likelihood(RING, points, Noise(1.3 * SIGMA))
    outer, inner = leaves(found.program)
    assert outer.size == pytest.approx((20.0, 6.0), abs=0.1 * SIGMA)
    assert inner.size[0] == pytest.approx(15.0, abs=0.1 * SIGMA)
    assert inner.size[1] >= 12  # what nothing shows stays
    assert found.noise.sigma == pytest.approx(SIGMA, rel=0.03)
    assert found.noise.clutter == pytest.approx(clutter, abs=0.01)
    least_squares = next(leaves(refine(RING, points).program))
    assert abs(least_squares.size[1] - 6.0) > 2 * abs(outer.size[1] - 6.0)


def test_it_comes_back_from_wrong_numbers():
    truth = union(box(40, 30, 6), cylinder(7, 16, (5.0, 2.0, 8.0)))
    start = map_leaves(truth, lambda i, p: replace(p, size=tuple(1.05 * s for s in p.size), center=tuple(c + 0.5 for c in p.center)))
    found = maximise_likelihood(start, cloud(truth, sigma=0.5), Noise(0.8))
    plate, boss = leaves(found.program)
    assert plate.size == pytest.approx((40, 30, 6), abs=0.08)
    assert boss.size[0] == pytest.approx(7, abs=0.05)
    assert boss.center[2] + boss.size[1] / 2 == pytest.approx(16, abs=0.08)


def test_a_flush_end_neither_opens_nor_closes():
    flush = cut(cylinder(20, 6), cylinder(15, 6.0))
    found = maximise_likelihood(flush, cloud(RING, sigma=0.4), Noise(0.5))
    outer, inner = leaves(found.program)
    assert inner.size[1] > outer.size[1] + 0.8
    assert outer.size == pytest.approx((20.0, 6.0), abs=0.05)


def test_what_is_parallel_turns_together():
    tilted = union(box(40, 30, 6, (0.0, 0.0, 0.0), (2.0, -1.0, 0.0)), cylinder(7, 16, (5.0, 2.0, 8.0)))
    truth = union(box(40, 30, 6), cylinder(7, 16, (5.0, 2.0, 8.0)))
    found = maximise_likelihood(tilted, cloud(truth, sigma=0.3), Noise(0.4), EMConfig(parallel_deg=4.0))
    plate, boss = lower(found.program).rotations
    assert abs(plate[:, 2] @ boss[:, 2]) == pytest.approx(1.0, abs=1e-9)
    assert np.degrees(np.arccos(plate[2, 2])) < 0.3


def test_frames_join_up_to_exchanged_axes():
    lying, apart = cylinder(1, 9, rotation=(90.5, 0.0, 0.0)), box(1, 2, 3, (9.0, 0.0, 0.0), (0.0, 0.0, 30.0))
    parts = union(box(4, 3, 2), lying, sphere(2), apart)
    member, directions = frames(lower(parts), 2.0)
    assert member.tolist() == [0, 0, -1, 1]
    assert len(directions) == 2
    turned = align_rotations(lower(parts), 2.0)
    assert np.abs(turned[1][:, 2]).max() == pytest.approx(1.0)
    assert np.linalg.det(turned[1]) == pytest.approx(1.0)
    assert frames(lower(parts), 0.1)[0].tolist() == [0, 2, -1, 1]


def test_a_shared_turn_is_the_turn_of_the_points():
    parts = lower(union(box(4, 3, 2, (5.0, 0.0, 1.0)), cylinder(1, 9, (-3.0, 2.0, 0.0), (90.0, 0.0, 0.0))))
    turns = map_shared_turns(parts, np.zeros(2, int))
    by, middle = np.array([1e-6, -2e-6, 3e-6]), parts.centers.mean(0)
    for i in range(2):
        raw = turns[i] @ by
        moved = parts.centers[i] + parts.rotations[i] @ raw[3:6]
        assert moved == pytest.approx(parts.centers[i] + np.cross(by, parts.centers[i] - middle), abs=1e-15)
        assert parts.rotations[i] @ raw[6:9] == pytest.approx(by, abs=1e-15)


def test_long_cutters_are_clipped_to_the_cloud():
    points = cloud(RING, 2000)
    long = cut(cylinder(20, 6), cylinder(15, 900, (0.0, 0.0, 300.0)), box(500, 8, 8, (250.0, 0.0, 0.0), (0.0, 10.0, 0.0)))
    short = clip_program(long, points, 10.0)
    low, high = points.min(0) - 5, points.max(0) + 5
    places = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    assert (kernels.inside(short, places) == kernels.inside(long, places)).all()
    assert max(size for leaf in leaves(short) for size in leaf.size) < 80
    assert clip_program(RING, points, 10.0) == RING


def test_a_program_of_nothing_stays_as_it_is():
    nothing = cut(box(1, 1, 1), box(2, 2, 2))
    found = maximise_likelihood(nothing, cloud(RING, 500), Noise(SIGMA), EMConfig(through=0.0))
    assert found.program == nothing
    assert np.isfinite(found.nll)


def test_a_surface_of_one_sample_is_held():
    sliver = cut(cylinder(20, 6), sphere(500, (0.0, 0.0, 500.0 - 2.9995)))
    found = maximise_likelihood(sliver, cloud(RING, 500), Noise(SIGMA), EMConfig(through=0.0))
    assert np.isfinite(found.nll)


def test_without_time_a_program_is_judged_as_it_is():
    points = cloud(RING, 1000)
    found = maximise_likelihood(RING, points, Noise(SIGMA), deadline=PASSED)
    assert found.program == RING
    assert found.rounds == 0
    assert np.isfinite(found.nll)


def test_without_time_one_surface_is_not_taken_for_two_sheets():
    """Under a first guess of the noise of half its size two sheets, a deviation to either side, are likelier than the one that is there."""
    block = box(40, 30, 20)
    sheets = cut(box(40 + 2 * SIGMA, 30 + 2 * SIGMA, 20 + 2 * SIGMA), box(40 - 2 * SIGMA, 30 - 2 * SIGMA, 20 - 2 * SIGMA))
    points = cloud(block, 4000)
    one, two = (maximise_likelihood(p, points, Noise(SIGMA / 2), deadline=PASSED) for p in (block, sheets))
    assert one.nll < two.nll
    assert one.noise.sigma == pytest.approx(SIGMA, rel=0.1)


def test_the_ends_of_an_extrusion_are_found_and_its_outline_stays_near():
    plate = centred(BRACKET, 8.0)
    start = replace(plate, size=(7.4,), center=(plate.center[0], plate.center[1], 0.3))
    found = maximise_likelihood(start, cloud(plate, sigma=0.5), Noise(0.6))
    [leaf] = leaves(found.program)
    assert are_near(leaf.outline, plate.outline, 0.3)
    assert leaf.size[0] == pytest.approx(8.0, abs=0.1)
    assert leaf.center == pytest.approx(plate.center, abs=0.1)
    reaching = clip_program(replace(plate, size=(80.0,)), cloud(plate, sigma=0.0), 1.0)
    assert next(leaves(reaching)).size[0] == pytest.approx(10.0, abs=0.01)


def test_outlines_move_with_the_points():
    """A turned profile whose vertices and arc are off by half the noise and more comes back; level lines stay level."""
    right = ((0, -40, 0.0), (30, -40, 0.0), (30, -10, 0.0), (15, 10, 0.0), (15, 30, 0.4), (8, 37, 0.0), (0, 37, 0.0))
    wrong = ((0, -41, 0.0), (31, -41, 0.0), (31, -12, 0.0), (14, 11, 0.0), (14, 29, 0.3), (9, 36, 0.0), (0, 36, 0.0))
    truth, start = (
        Primitive("revolve", (360.0,), (c, 0.0, 0.0), (90.0, 20.0, 0.0), Outline((v,))) for c, v in ((10.0, right), (10.5, wrong))
    )
    found = maximise_likelihood(start, cloud(truth, sigma=0.5), Noise(1.0))
    (leaf,) = leaves(found.program)
    assert leaf.outline is not None
    (loop,) = leaf.outline.loops
    assert loop[0][0] == loop[6][0] == 0.0
    assert (loop[0][1], loop[1][0], loop[5][1]) == (loop[1][1], loop[2][0], loop[6][1])
    assert loop[1][0] == pytest.approx(30, abs=0.1)
    assert loop[5][1] - loop[0][1] == pytest.approx(77, abs=0.3)
    assert loop[4][2] == pytest.approx(0.4, abs=0.08)
    assert found.noise.sigma == pytest.approx(0.5, rel=0.03)


def test_more_samples_keep_the_ends_of_thin_walls():
    """Where samples stand for squares wider than the noise, a wall four deviations thick shrinks at its rim."""
    cup = Primitive(
        "revolve", (360.0,), outline=Outline((((0, -21, 0), (32, -21, 0), (32, 21, 0), (30, 21, 0), (30, -19, 0), (0, -19, 0)),))
    )
    points, heights = cloud(cup, sigma=0.5), []
    for samples in (10_000, 40_000):
        (leaf,) = leaves(maximise_likelihood(cup, points, Noise(0.5), EMConfig(through=0.0, samples=samples)).program)
        assert leaf.outline is not None
        (_, low), (_, high) = leaf.outline.bounds
        heights.append(high - low)
    assert abs(heights[1] - 42) < 0.6 * abs(heights[0] - 42)


def test_no_step_makes_an_outline_cross_itself():
    """Two holes of an outline, of a part in which they are one."""
    around = ((-20, -15, 0.0), (20, -15, 0.0), (20, 15, 0.0), (-20, 15, 0.0))
    start = Primitive("extrude", (10.0,), outline=Outline((around, circle(6, -6.6), circle(6, 6.6))))
    truth = cut(box(40, 30, 10), cylinder(6, 20, (-5.0, 0.0, 0.0)), cylinder(6, 20, (5.0, 0.0, 0.0)))
    found = maximise_likelihood(start, cloud(truth, sigma=0.8), Noise(0.8))
    (leaf,) = leaves(found.program)
    assert leaf.outline is not None
    check_crossings(leaf.outline)


def test_a_fit_ends_where_further_rounds_win_nothing(monkeypatch):
    """The samples leave each round's likelihood in doubt: that alone is no reason to go on."""
    rounds = []
    expectation_step = em.expectation_step
    monkeypatch.setattr(em, "expectation_step", lambda *given: rounds.append(1) or expectation_step(*given))
    points, patient = cloud(RING), EMConfig(rounds=60, still=0.0, samples=20_000)
    found = maximise_likelihood(RING, points, Noise(1.3 * SIGMA), patient)
    short = len(rounds)
    further = maximise_likelihood(RING, points, Noise(1.3 * SIGMA), replace(patient, window=60))
    assert 2 * patient.window <= short < 30 < len(rounds) - short
    assert found.nll < further.nll + 1e-3
