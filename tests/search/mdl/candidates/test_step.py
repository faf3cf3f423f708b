"""Steps that the noise all but hides, on parts whose numbers are known."""

import numpy as np
import pytest
from tests.planted import box, cylinder, union

from imdim.geometry.kernels import program_sdf
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline, ellipse
from imdim.program.tree import Primitive, leaves
from imdim.search.mdl.candidates.step import stepped

SIGMA = 0.5


def points_of(program, part, n=6000):
    """Noisy points of the program that a part explains."""
    rng = np.random.default_rng(0)
    points = surface_points(program, n, rng)[0] + rng.normal(0, SIGMA, (n, 3))
    return points[np.abs(program_sdf(part, points)) < 3 * SIGMA]


def oval(rx, ry, height, level=0.0, x=3.0):
    """A tube's solid whose outline lies beside the origin of its plane."""
    return Primitive("extrude", (height,), (-x, 0.0, level), (0.0, 0.0, 0.0), Outline((ellipse(rx, ry, x, 0.0, 0.0),)))


@pytest.mark.parametrize(
    ("truth", "mean"),
    [
        (union(box(40, 60, 12), box(42.4, 62.4, 2.4, (0.0, 0.0, -4.8))), box(40.6, 60.6, 12)),
        (union(cylinder(20, 40), cylinder(21.2, 10, (0.0, 0.0, -15.0))), cylinder(20.4, 40)),
        (union(oval(18, 25, 40), oval(19.2, 26.2, 10, -15.0)), oval(18.4, 25.4, 40)),
    ],
    ids=["a flange", "a collar", "an oval collar"],
)
def test_a_step_of_two_deviations_of_the_noise_is_seen(truth, mean):
    (found,) = stepped(mean, points_of(truth, mean), SIGMA)
    one, other = sorted(leaves(found), key=lambda leaf: leaf.size[-1])
    assert other.size[-1] == mean.size[-1]  # what is narrower goes on through the other
    wide, middle, slim = (np.ptp(to_manifold(part).bounding_box()[i::3]) for part, i in ((one, 0), (mean, 0), (other, 0)))
    assert wide > middle > slim
    goal = to_manifold(truth)
    assert volume_iou(to_manifold(found), goal) > volume_iou(to_manifold(mean), goal)


def test_a_plain_part_has_no_step():
    for part in (box(40, 60, 12), cylinder(20, 40), oval(18, 25, 40)):
        assert [*stepped(part, points_of(part, part), SIGMA)] == []
        assert [*stepped(part, points_of(part, part)[:10], SIGMA)] == []


def test_parts_that_lie_beside_each_other_are_told_as_two():
    """Neither is wider all around. Along the other axes their mean may seem to have steps, too."""
    truth, mean = union(box(20, 40, 30, (-10.0, 0.6, 0.0)), box(20, 40, 30, (10.0, -0.6, 0.0))), box(40, 40, 30)
    found, *_ = stepped(mean, points_of(truth, mean), SIGMA)
    assert [round(leaf.center[1], 1) for leaf in leaves(found)] == [pytest.approx(0.6, abs=0.25), pytest.approx(-0.6, abs=0.25)]
    assert sum(leaf.size[0] for leaf in leaves(found)) == pytest.approx(40.0)
