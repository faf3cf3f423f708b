"""Numbers of noisy clouds, rounded as far as their points bear it."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.geometry.sampling import surface_points
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.numbers.measured import measure
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import leaves
from imdim.reconstruction.fitting import _keep_likely, find_relations, snap_measured
from imdim.target.target import target_from

SIGMA = 0.15


def cloud(program, n=8000, seed=0):
    rng = np.random.default_rng(seed)
    return surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))


def test_a_cup_with_walls_of_four_deviations_of_the_noise_has_round_numbers():
    """Another fit of its numbers moves a hundredth of so thin a volume: for that the whole part once stayed as it was measured."""
    cup = cut(cylinder(15, 8), cylinder(14.4, 8, (0.0, 0.0, 1.0)))
    points = cloud(cup)
    fitted = maximise_likelihood(cup, points, Noise(SIGMA)).program
    outer, inner = leaves(snap_measured(fitted, (), points))
    assert outer.size[0] == 15.0
    assert inner.size[0] == pytest.approx(14.4, abs=0.02)
    assert inner.size[0] == round(inner.size[0], 3)  # digits that say nothing are gone


def test_numbers_of_a_fit_that_was_cut_short_are_fitted_before_they_are_rounded():
    block = box(40, 30, 20)
    (found,) = leaves(snap_measured(box(39.9, 30.1, 19.9), (), cloud(block)))
    assert found.size[:2] == (40.0, 30.0)
    assert found.size[2] == pytest.approx(20.0, abs=0.015)


def test_leaves_whose_rounding_the_points_refuse_together_stay_as_they_were_measured():
    measured = union(box(40.02, 30.01, 6), cylinder(8.01, 20, (0.0, 0.0, 7.0)))
    points = cloud(measured)
    wrong, right = box(40, 31, 6), cylinder(8, 20, (0.0, 0.0, 7.0))
    plate, boss = leaves(_keep_likely(measured, union(wrong, right), points, measure(measured, points, np.zeros((0, 18)))))
    assert plate == next(leaves(measured))
    assert boss == right


def test_relations_that_leave_a_part_without_extent_are_not_held():
    """Both faces of a plate thinner than the noise lay in one plane by its points: an internal error, and a part was lost."""
    program = union(box(10, 9, 10, (-2.5, -0.88, 0.12)), box(6, 6, 0.04, (0.0, 0.0, 5.0)))
    flush = [Constraint("coplanar", (Ref(1, side), Ref(0, "+z"))) for side in ("-z", "+z")]
    points = surface_points(program, 2000, np.random.default_rng(0))[0]
    found, held = find_relations(program, target_from(points), flush)
    assert min(leaf.size[2] for leaf in leaves(found)) > 0
    assert len(held) < 2
