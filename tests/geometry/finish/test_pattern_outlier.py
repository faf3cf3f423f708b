"""An odd one among equal features becomes like them where the target has it so, and only there."""

from dataclasses import replace

import pytest
from tests.planted import box, cut, cylinder

from imdim.geometry.finish.pattern_outlier import regularise_outliers
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Program, leaves

PLATE = box(60, 60, 6)
CORNERS = [(x, y, 0.0) for x in (-20.0, 20.0) for y in (-15.0, 15.0)]
ROW = [(-24.0 + 12 * i, 5.0, 0.0) for i in range(5)]


def nearer(target: Program):
    solid = to_manifold(target)
    return lambda program: volume_iou(solid, to_manifold(program))


@pytest.mark.parametrize("places", [CORNERS, ROW])
@pytest.mark.parametrize("odd", range(3))
@pytest.mark.parametrize("turn", [0.0, 45.0])
def test_a_square_hole_becomes_round_as_in_the_target(places, odd, turn):
    target = cut(PLATE, *(cylinder(2, 12, p) for p in places))
    holes = [cylinder(2, 12, p) for p in places]
    holes[odd] = box(3.8, 4.0, 7.0, (places[odd][0] + 0.1, places[odd][1], 0.3), (0.0, 0.0, turn))
    found = cut(PLATE, *holes)
    after = list(leaves(regularise_outliers(found, 1e-3, nearer(target))))
    assert [leaf.kind for leaf in after] == ["box"] + ["cylinder"] * len(places)
    assert after[1 + odd].center == pytest.approx(places[odd])


def test_what_the_target_has_stays():
    holes = [cylinder(2, 12, p) for p in CORNERS]
    square = cut(PLATE, *holes[:3], box(4, 4, 12, CORNERS[3]))
    assert regularise_outliers(square, 1e-3, nearer(square)) == square
    elsewhere = cut(PLATE, *holes[:3], replace(holes[3], center=(20.0, 19.0, 0.0)))
    assert regularise_outliers(elsewhere, 1e-3, nearer(cut(PLATE, *holes))) == elsewhere
