"""Numbers that copies share: found by their equality, kept by a fit, and the better known for it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, sphere, union

from imdim.geometry.lowering import lower
from imdim.geometry.sampling import surface_points
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise, SurfaceSamples
from imdim.numbers.ties import shape_numbers, tie_alike, ties_of
from imdim.program.outline import Outline, rectangle
from imdim.program.tree import Primitive, leaves, map_leaves

PLACES = [(-15.0, -8.0), (0.0, -8.0), (15.0, -8.0), (-15.0, 8.0), (0.0, 8.0), (15.0, 8.0)]


def plate(radii=(2.0,) * 6, places=PLACES):
    holes = [cylinder(r, 20, (x, y, 0.0)) for r, (x, y) in zip(radii, places, strict=True)]
    return cut(box(50, 30, 6), union(*holes))


def saved(program):
    return int(ties_of(program, 2.0).count_saved([*leaves(program)]).sum())


def test_a_grid_of_copies_has_one_size_and_two_steps():
    # five copies: radius and height; of 18 coordinates x0 and its step, two y (no step is told from two values), and z are left
    assert saved(plate()) == 5 * 2 + 18 - (2 + 2 + 1)
    assert saved(plate(radii=(1.0, 1.2, 1.4, 1.6, 1.8, 2.0))) == 0
    uneven = [(-15.0, -8.0), (1.0, -8.0), (15.0, -8.0), (-15.0, 8.0), (1.0, 8.0), (15.0, 8.0)]
    assert saved(plate(places=uneven)) == saved(plate()) - 1


def test_a_drawn_copy_says_where_it_lies_by_its_middle():
    drawn = Primitive("extrude", (5.0,), outline=Outline((*rectangle(8.0, 4.0).loops, *rectangle(2.0, 1.0).loops)))
    assert shape_numbers(drawn) == 1 + 8 - 2  # height, and four walls of each loop
    assert saved(union(drawn, replace(drawn, center=(20.0, 3.0, 1.0)))) == 7


def test_a_fit_keeps_what_copies_share_and_knows_it_better():
    rng = np.random.default_rng(0)
    truth, sigma = plate(), 0.3
    points = surface_points(truth, 3000, rng)[0] + rng.normal(0, sigma, (3000, 3))
    wrong = map_leaves(truth, lambda i, p: replace(p, size=(2.3, p.size[1])) if i else p)
    tied = maximise_likelihood(wrong, points, Noise(sigma))
    radii = [p.size[0] for p in [*leaves(tied.program)][1:]]
    assert np.ptp(radii) < 1e-6
    assert saved(tied.program) == saved(truth)
    apart = map_leaves(wrong, lambda i, p: replace(p, size=(p.size[0] + 1e-3 * i, p.size[1])) if i else p)
    free = [p.size[0] for p in [*leaves(maximise_likelihood(apart, points, Noise(sigma)).program)][1:]]
    assert np.ptp(free) > 0.02
    assert abs(radii[0] - 2.0) < np.abs(np.array(free) - 2.0).mean()


def test_drawings_of_copies_move_as_one():
    rng = np.random.default_rng(1)
    bar = Primitive("extrude", (6.0,), outline=Outline((((-4.0, -2.0, 0.0), (4.0, -2.0, 0.0), (4.0, 2.0, 0.6), (-4.0, 2.0, 0.0)),)))
    truth = union(*(replace(bar, center=(0.0, 14.0 * k, 0.0)) for k in range(3)))
    points = surface_points(truth, 3000, rng)[0] + rng.normal(0, 0.2, (3000, 3))
    wide = Outline(tuple(tuple((1.05 * x, y, b) for x, y, b in loop) for loop in bar.outline.loops))
    start = map_leaves(truth, lambda _, p: replace(p, outline=wide))
    found = [*leaves(maximise_likelihood(start, points, Noise(0.2)).program)]
    corners = np.array([p.outline.loops[0] for p in found])
    assert np.ptp(corners, axis=0).max() < 1e-6
    assert np.ptp(corners[0, :, 0]) == pytest.approx(8.0, abs=0.1)


def test_what_is_nearly_alike_becomes_alike():
    shaken = [(x + 0.1 * (-1) ** k, y + 0.05 * k) for k, (x, y) in enumerate(PLACES)]
    near = plate(radii=(2.0, 2.1, 1.9, 2.05, 1.95, 2.02), places=shaken)
    assert saved(near) == 0
    assert saved(tie_alike(near, 0.3, 2.0)) == saved(plate())
    assert tie_alike(near, 0.01, 2.0) == near
    balls = union(sphere(3.0, (0.0, 0.0, 0.0)), sphere(3.1, (10.0, 0.0, 0.0)))
    assert [p.size for p in leaves(tie_alike(balls, 0.3, 2.0))] == [pytest.approx((3.05,))] * 2


def test_ends_that_show_nowhere_are_told():
    blind = cut(box(20, 20, 10), cylinder(3, 10, (0.0, 0.0, 3.0)))
    through = cut(box(20, 20, 10), cylinder(3, 30))
    nothing = union(box(20, 20, 10), cylinder(3, 4))
    for program, hidden in (
        (nothing, [0, 0]),
        (blind, [0, 1]),
        (through, [0, 2]),
        (union(box(20, 20, 10), cylinder(3, 10, (0.0, 0.0, 6.0))), [0, 1]),
    ):
        assert SurfaceSamples.of(program, 0.3).count_hidden_ends(lower(program)).tolist() == hidden
