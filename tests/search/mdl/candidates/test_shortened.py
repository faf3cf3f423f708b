"""Parts that end where cuts take their ends off, against the same solid without these cuts."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.search.mdl.candidates.shortened import end_at_cuts

SIGMA = 0.3
BODY = box(30, 50, 18, (0.0, 0.0, 9.0))
TURN = (20.0, -35.0, 50.0)


def test_a_body_whose_end_three_cuts_take_off_ends_there():
    cuts = {4: box(20, 60, 10, (0.0, 0.0, 16.05)), 5: box(12, 60, 10, (-12.0, 0.0, 16.0)), 6: box(12, 60, 10, (12.0, 0.0, 15.95))}
    found = dict(end_at_cuts(BODY, cuts, SIGMA))
    (short,) = (part for part, gone in found.items() if gone == (4, 5, 6))
    assert short.size == pytest.approx((30, 50, 11), abs=0.1)
    assert short.center == pytest.approx((0, 0, 5.5), abs=0.1)


@pytest.mark.parametrize("sign", [1, -1])
def test_it_ends_at_either_side_and_in_any_pose(sign):
    turn = matrix_from_euler(TURN)

    def placed(solid, z):
        return cylinder(8, solid, tuple((turn @ (0.0, 0.0, sign * z)).tolist()), TURN)

    body, off = placed(20, 0.0), placed(10, 9.0)
    truth = to_manifold(cut(body, off))
    (found,) = end_at_cuts(body, {1: off}, SIGMA)
    assert found[1] == (1,)
    assert volume_iou(to_manifold(found[0]), truth) == pytest.approx(1.0, abs=1e-6)


def test_cuts_that_reach_no_end_or_leave_nothing_shorten_nothing():
    inside, through = box(5, 5, 6, (0.0, 0.0, 9.0)), box(5, 5, 40, (0.0, 0.0, 9.0))
    slanted = box(60, 60, 10, (0.0, 0.0, 16.0), (15.0, 0.0, 0.0))
    assert not list(end_at_cuts(BODY, {1: inside, 2: through, 3: slanted}, SIGMA))


def test_a_deeper_floor_is_a_level_of_its_own():
    cuts = {1: box(40, 20, 10, (0.0, 15.0, 17.0)), 2: box(40, 20, 16, (0.0, -15.0, 14.0))}
    levels = sorted((round(part.size[2], 6), gone) for part, gone in end_at_cuts(BODY, cuts, SIGMA))
    assert (6.0, (2,)) in levels
    assert (12.0, (1,)) in levels
    assert np.all([size > 0 for size, _ in levels])
