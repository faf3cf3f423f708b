"""What a noisy cloud says of numbers: by closed forms for how well, and by planted numbers for which."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, sphere, union

from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.numbers.design_values import common_grid, grid_of, is_designed
from imdim.numbers.information import Coordinates, bends_of, measure_spread
from imdim.numbers.measured import MAD, NORMAL_95, measure, noise_beside
from imdim.numbers.measured_leaves import MeasuredLeaves
from imdim.numbers.symmetry_normal_form import canonical
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, leaves

SIGMA = 0.2
FREE = np.zeros((0, 9))


def cloud(program, n=6000, sigma=SIGMA, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, sigma, (n, 3))


def test_the_interval_of_a_height_is_that_of_two_means():
    block = box(40, 30, 20)
    known = measure(block, cloud(block), FREE)
    # each face has its share of the points; those within a deviation or two of an edge tell less
    face = 6000 * 40 * 30 / (2 * (40 * 30 + 40 * 20 + 30 * 20))
    height = np.eye(9)[2:3]
    half = known.half_widths(height)[0]
    assert half == pytest.approx(NORMAL_95 * SIGMA * np.sqrt(2 / face), rel=0.15)
    assert abs(known.shift[2]) < half
    assert known.noise.sigma == pytest.approx(SIGMA, rel=0.05)


def test_the_measured_numbers_are_those_of_the_part_and_not_those_given():
    ring = cut(cylinder(20, 8), cylinder(6, 30))
    wrong = cut(cylinder(20.3, 8.2), cylinder(5.8, 30))
    known = measure(wrong, cloud(ring), FREE.repeat(2, 1))
    outer, inner = leaves(known.program)
    half = known.half_widths(np.eye(18)[[0, 1, 9]])
    assert (np.abs(np.array([*outer.size, inner.size[0]]) - [20, 8, 6]) < half).all()
    assert half.max() < 0.1


def test_what_no_point_shows_has_no_interval_and_stays():
    ring = cut(cylinder(20, 8), cylinder(6, 30))
    known = measure(ring, cloud(ring), FREE.repeat(2, 1))
    assert np.isinf(known.half_widths(np.eye(18)[10:11]))[0]  # the height of the bore
    assert [*leaves(known.program)][1].size[1] == pytest.approx(30, abs=1e-6)


def test_what_relations_hold_was_not_measured():
    """It had an interval of 1e-16, and counted as snapped to what was measured."""
    block, held = box(40, 30, 20), np.eye(9)[:1]
    known = measure(block, cloud(block), held)
    assert np.isinf(known.half_widths(np.eye(9)[:1])[0])
    assert np.isfinite(known.half_widths(np.eye(9)[1:2])[0])


def test_relations_hold_and_narrow_the_intervals():
    block = box(40, 30, 20)
    points, difference = cloud(block), np.zeros((1, 9))
    difference[0, :2] = 1.0, -1.0  # the length stays ten more than the width
    free, bound = measure(block, points, FREE), measure(block, points, difference)
    size = next(leaves(bound.program)).size
    assert size[0] - size[1] == pytest.approx(10, abs=1e-9)
    assert bound.half_widths(np.eye(9)[:1])[0] < 0.8 * free.half_widths(np.eye(9)[:1])[0]


def test_a_place_that_relations_tie_is_known_as_all_its_faces_tell_it():
    """It was known as many times worse as leaves were tied, and rounded by ten standard errors."""
    row = union(*(box(8, 8, 8, (0.0, 20.0 * i, 0.0)) for i in range(4)))
    tied = np.zeros((3, 36))
    for i in range(3):
        tied[i, 3], tied[i, 9 * i + 12] = 1.0, -1.0  # all in one plane across x
    known, place = measure(row, cloud(row), tied), np.eye(36)[3]
    alone = measure(row, cloud(row), np.zeros((0, 36)))
    assert known.half_width_along(place) == pytest.approx(known.half_widths(place[None])[0], rel=0.1)
    assert known.half_width_along(place) < 0.7 * alone.half_width_along(place)
    assert known.half_width_along(5 * place) == pytest.approx(known.half_width_along(place) / 5)


def test_tied_numbers_are_told_once():
    pair = union(box(8, 8, 8), box(8, 8, 8, (0.0, 20.0, 0.0)))
    tied = np.zeros((1, 18))
    tied[0, 0], tied[0, 9] = 1.0, -1.0  # one width
    points = cloud(pair)
    assert measure(pair, points, np.zeros((0, 18))).count_told([0, 1]) == 18
    known = measure(pair, points, tied)
    assert known.count_told([0]) == 9
    assert known.count_told([0, 1]) == 17
    assert known.count_told([]) == 0


def test_curvature_of_a_ball_and_of_a_flat_face():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    bends = bends_of(sphere(5), 5 * normals, normals, 10.0)
    truth = (np.eye(3) - normals[:, :, None] * normals[:, None, :]) / 5
    assert np.abs(bends - truth).max() < 1e-3
    face = np.column_stack([rng.uniform(-9, 9, (50, 2)), np.full(50, 10.0)])
    assert not bends_of(box(20, 20, 20), face, np.tile([0.0, 0.0, 1.0], (50, 1)), 30.0).any()


def test_noise_of_single_points_spreads_nothing_and_dents_do():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 10, (4000, 2)), np.zeros(4000)])
    assert measure_spread(points, rng.normal(size=4000)) == 1.0
    dents = rng.normal(size=(10, 10))[tuple(points[:, :2].astype(int).T)]  # forty points share each
    assert 10 < measure_spread(points, dents) < 60


@pytest.mark.filterwarnings("error")
def test_points_that_fall_together_tell_of_no_neighbours():
    """A program that is far from its points: many are nearest to one place of it."""
    assert measure_spread(np.zeros((400, 3)), np.random.default_rng(0).normal(size=400)) == 1.0


def test_a_rim_on_which_thousands_of_points_fall_takes_no_memory_for_their_pairs():
    rng = np.random.default_rng(2)
    places = np.concatenate([rng.uniform(0, 1, (3000, 3)) * [1, 1, 0], rng.normal(0, 1e-6, (7000, 3))])
    tracemalloc.start()
    spread = measure_spread(places, rng.normal(size=10_000))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 1.0 <= spread < 2.0
    assert most < 1e9  # 24 million pairs, each of two numbers, a distance and a weight, are more


def test_coordinates_move_a_drawn_leaf_as_they_say():
    square = ((-10.0, -5.0, 0.0), (10.0, -5.0, 0.0), (10.0, 5.0, 0.0), (-10.0, 5.0, 0.0))
    plate = Primitive("extrude", (4.0,), (1.0, 2.0, 3.0), (10.0, 20.0, 30.0), Outline((square, circle(2.0))))
    start = Coordinates.of(plate)
    step = np.random.default_rng(0).normal(0, 1e-3, start.count)
    moved = next(leaves(start.move(step)))
    assert moved.size[0] == pytest.approx(4 + step[0])
    assert moved.outline is not None
    assert moved.outline != plate.outline
    assert start.move(0 * step) == plate


def test_a_turned_outline_stays_where_a_step_would_take_it_across_its_axis():
    ring = Primitive("revolve", (360.0,), outline=Outline((((0.2, 0, 0), (3.0, 0, 0), (3.0, 1.0, 0), (0.2, 1.0, 0)),)))
    start = Coordinates.of(ring)
    assert any(next(leaves(start.move(0.3 * way))) != ring for way in np.eye(start.count)[9:])
    for way in np.eye(start.count)[9:]:
        for step in (0.3 * way, -0.3 * way):
            leaf = next(leaves(start.move(step)))
            assert leaf.outline is not None
            assert min(x for x, *_ in leaf.outline.loops[0]) >= 0
    thin = cloud(ring, n=400, sigma=0.3)
    measure(ring, thin, np.zeros((0, start.count)))  # whose steps are as long as the ring's hole is wide


@pytest.mark.parametrize(("value", "finest", "grid"), [(40, 0.1, 10), (17.5, 0.1, 0.5), (17.53, 0.1, 0), (0.05, 0.01, 0.05), (-3, 0.2, 1)])
def test_the_grid_of_a_number(value, finest, grid):
    assert grid_of(value, finest) == pytest.approx(grid)


def test_a_part_tells_its_grid_and_numbers_from_anywhere_tell_none():
    rng = np.random.default_rng(0)
    half = np.full(8, 0.05)
    designed = np.round(rng.uniform(10, 60, 8) * 2) / 2
    assert common_grid(designed + rng.normal(0, 0.025, 8), half) == 0.5
    assert [common_grid(rng.uniform(10, 60, 8), half) for _ in range(50)].count(0.0) >= 48


def test_a_round_number_is_designed_where_the_interval_holds_it_and_no_other():
    assert is_designed(8.0, 7.99, 0.012, 0.0)
    assert not is_designed(8.0, 7.98, 0.012, 0.0)  # outside
    assert not is_designed(8.0, 7.9, 0.3, 0.0)  # a half would do as well
    assert is_designed(8.5, 8.45, 0.1, 0.5)
    assert not is_designed(8.5, 8.45, 0.2, 0.5)


def test_rounding_goes_as_far_as_the_intervals():
    block = box(40, 30.25, 20)
    bounds = MeasuredLeaves.of(measure(block, cloud(block), FREE))
    own = bounds.parts[0]
    half = bounds.known.half_widths(np.eye(9)[:3])

    def with_size(*size):
        return Primitive("box", size, own.center, own.rotation)

    assert bounds.allow(own)
    assert bounds.allow(with_size(own.size[0] + 0.04 * half[0], *own.size[1:]))
    assert not bounds.allow(with_size(own.size[0] + 2 * half[0], *own.size[1:]))
    rounded = next(leaves(bounds.round_sizes(bounds.known.program)))
    assert rounded.size[0] == 40
    assert rounded.size[2] == 20
    assert not bounds.allow(with_size(40, 30, 20))


def test_what_no_point_shows_is_rounded_by_no_more_than_the_noise():
    """A hidden end was free to go anywhere, and drawn corners that few points show went far."""
    ring = cut(cylinder(20, 8), cylinder(6, 30.1))
    bounds = MeasuredLeaves.of(measure(ring, cloud(ring), FREE.repeat(2, 1)))

    def with_height(height):
        outer, bore = bounds.parts
        return cut(outer, Primitive("cylinder", (bore.size[0], height), bore.center, bore.rotation))

    assert bounds.allow(with_height(30))
    assert not bounds.allow(with_height(31))
    assert not bounds.allow(with_height(35))


def test_what_no_point_shows_turns_by_no_more_than_the_noise():
    inner = Primitive("box", (10.0, 8.0, 6.0), rotation=(0.0, 0.0, 0.5))
    bounds = MeasuredLeaves.of(measure(union(box(40, 30, 20), inner), cloud(box(40, 30, 20)), FREE.repeat(2, 1)))
    outer, own = bounds.parts
    assert bounds.allow(union(outer, replace(own, rotation=(0.0, 0.0, 0.0))))
    assert not bounds.allow(union(outer, replace(own, rotation=(0.0, 0.0, 5.0))))


@pytest.mark.parametrize("size", [(6.0, 30.0), (9.0, 4.0, 30.0)])
def test_what_points_the_other_way_in_its_normal_form_is_compared_all_the_same(size):
    """A hair beyond a right angle nothing was known to be the same, and so anything to be allowed."""
    kind = "cylinder" if len(size) == 2 else "cone"
    rod = Primitive(kind, size, (1.0, 2.0, 3.0), (0.0, 90.01, 0.0))
    bounds = MeasuredLeaves.of(replace(measure(rod, cloud(rod, 20_000), FREE), program=rod))
    turned = canonical(rod)
    assert matrix_from_euler(turned.rotation)[:, 2] @ matrix_from_euler(rod.rotation)[:, 2] < -0.9
    assert bounds.allow(turned)
    assert not bounds.allow(replace(turned, size=tuple(s + 1.0 for s in turned.size)))
    assert not bounds.allow(replace(turned, center=(1.0, 2.0, 4.0)))


def test_a_size_that_may_be_nothing_is_not_rounded_to_it():
    """Of a shallow pocket in coarse noise the interval holds 0, the coarsest grid's nearest place."""
    plate = cut(box(40, 30, 0.3), cylinder(5, 0.15, (0.0, 0.0, 0.075)))
    bounds = MeasuredLeaves.of(measure(plate, cloud(plate, 150, 1.0, seed=1), FREE.repeat(2, 1)))
    depth = bounds.parts[1].size[1]
    assert depth < bounds._half_widths(1, np.eye(6))[1]
    _, pocket = leaves(bounds.round_sizes(bounds.known.program))
    assert pocket.size[1] == pytest.approx(depth, abs=0.15)


def test_a_drawn_part_is_rounded_as_a_whole_no_further_than_its_walls_are_known():
    """Its place is told by its outline: unmeasured as it seemed, it was moved by the noise, and walls of five lost a fiftieth."""
    ring = Primitive(
        "extrude", (6.0,), (0.08, 0.0, 1.0), outline=Outline((circle(18), ((-10, -9, 0), (11, -9, 0), (11, 9, 0), (-10, 9, 0))))
    )
    known = measure(ring, cloud(ring), np.zeros((0, Coordinates.of(ring).count)))
    bounds, (own,) = MeasuredLeaves.of(known), [*leaves(known.program)]
    x, y, z = own.center
    assert 0 < bounds.slides[0, 0] < SIGMA / 5
    assert bounds.slides[0, 2] == 0
    assert not bounds.allow(replace(own, center=(x + SIGMA / 2, y, z)))
    assert not bounds.allow(replace(own, rotation=(*own.rotation[:2], own.rotation[2] + 0.5)))
    assert bounds.allow(own)


def test_a_turned_outline_is_not_rounded_along_its_axis_beyond_what_is_known():
    knob = Primitive("revolve", (360.0,), (0.0, 0.0, 0.07), outline=Outline((((0, -8, 0), (15, -8, 0), (9, 8, 0), (0, 8, 0)),)))
    known = measure(knob, cloud(knob), np.zeros((0, Coordinates.of(knob).count)))
    bounds, (own,) = MeasuredLeaves.of(known), [*leaves(known.program)]
    x, y, z = own.center
    assert 0 < bounds.slides[0, 2] < SIGMA / 5
    assert not bounds.allow(replace(own, center=(x, y, z - SIGMA / 2)))


def test_relations_of_where_outlines_lie_are_said_of_their_walls():
    """A drawn leaf's place goes with its outline: tied to that place alone, the other leaf seemed to be held where it was."""
    square = ((-10.0, -5.0, 0.0), (10.0, -5.0, 0.0), (10.0, 5.0, 0.0), (-10.0, 5.0, 0.0))
    plate = Primitive("extrude", (4.0,), outline=Outline((square,)))
    both = union(plate, box(6, 6, 12, (0.0, 0.0, 8.0)))
    start, beside = Coordinates.of(both), np.zeros((1, 18))
    beside[0, [3, 12]] = 1.0, -1.0  # the block stays as far along x as the plate
    known = measure(both, cloud(both), start.spread(beside))
    way = np.eye(start.count)[12:13]
    assert known.half_widths(way)[0] < SIGMA
    alone = measure(both, cloud(both), np.pad(beside, ((0, 0), (0, start.count - 18))))
    assert np.isinf(alone.half_widths(way)[0])


def test_without_rounds_the_program_stays_and_tells_how_well_it_is_known():
    block = box(40.01, 30, 20)
    stayed, moved = (measure(block, cloud(box(40, 30, 20)), FREE, rounds=rounds) for rounds in (0, 5))
    assert stayed.program == block
    assert moved.program != block
    ways = np.eye(9)[:3]
    assert stayed.half_widths(ways) == pytest.approx(moved.half_widths(ways), rel=0.2)


def test_what_may_be_nothing_tells_of_no_grid():
    """Places about the middle of a part are on every grid, and told of one of 100."""
    rng = np.random.default_rng(0)
    places, sizes = rng.normal(0, 0.02, 12), rng.uniform(10, 60, 4)
    assert common_grid(np.concatenate([places, sizes]), np.full(16, 0.05)) == 0.0


@pytest.mark.parametrize(
    "program",
    [cut(box(180, 100, 60), box(176, 96, 80)), cut(cylinder(50, 60), cylinder(48, 60, (0.0, 0.0, 2.0)))],
    ids=["frame", "cup"],
)
def test_both_skins_of_thin_walls_tell_the_noise(program):
    """By the nearer skin of each point a third of it was lost: walls grew, and rounding went on from there."""
    points = cloud(program, 8000, 1.0)
    assert MAD * np.median(np.abs(kernels.program_sdf(program, points))) < 0.85
    assert noise_beside(program, points).sigma == pytest.approx(1.0, rel=0.03)


def test_the_noise_of_a_thick_part_and_of_one_almost_without_are_what_they_are():
    block = box(60, 40, 20)
    assert noise_beside(block, cloud(block, sigma=0.3)).sigma == pytest.approx(0.3, rel=0.03)
    assert noise_beside(block, cloud(block, sigma=1e-4)).sigma < 2e-4


def test_thin_walls_stay_as_thin_as_they_were_fitted():
    frame = cut(box(180, 100, 60), box(176, 96, 80))
    for seed in range(3):
        outer, inner = leaves(measure(frame, cloud(frame, 8000, 1.0, seed), FREE.repeat(2, 1)).program)
        assert (outer.size[0] - inner.size[0]) / 2 == pytest.approx(2.0, abs=0.25)
        assert (outer.size[1] - inner.size[1]) / 2 == pytest.approx(2.0, abs=0.25)
