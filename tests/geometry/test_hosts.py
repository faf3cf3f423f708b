"""What cuts serve, and that they are written in its order."""

import pytest
from tests.planted import box, cut, cylinder, union

from imdim.geometry.finish.late_cuts import group_cuts
from imdim.geometry.hosts import hosts_of_cuts
from imdim.geometry.solid import to_manifold
from imdim.program.tree import leaves

PLATE, BOSS = box(60, 40, 6), cylinder(8, 20, (15.0, 0.0, 13.0))
BORE = cylinder(4, 40, (15.0, 0.0, 10.0))
CORNERS = [cylinder(2, 8, (x, y, 0.0)) for x in (-25.0, 25.0) for y in (-15.0, 15.0)]
SLOT = box(20, 4, 8, (-12.0, 0.0, 0.0))


def test_a_cut_serves_what_holds_its_faces():
    program = cut(union(PLATE, BOSS), BORE, SLOT, CORNERS[0])
    assert hosts_of_cuts(program) == [None, None, 1, 0, 0]


def test_a_cut_in_the_air_serves_nothing():
    assert hosts_of_cuts(cut(PLATE, box(5, 5, 5, (0.0, 0.0, 50.0)))) == [None, None]


def test_cuts_stand_by_what_they_serve_and_alike_ones_together():
    mixed = cut(union(PLATE, BOSS), BORE, CORNERS[0], SLOT, *CORNERS[1:])
    grouped = group_cuts(mixed)
    assert list(leaves(grouped)) == [PLATE, BOSS, *CORNERS, SLOT, BORE]
    assert to_manifold(grouped).volume() == pytest.approx(to_manifold(mixed).volume())
    assert group_cuts(grouped) is grouped


def test_cuts_of_one_body_keep_their_order():
    program = cut(PLATE, SLOT, CORNERS[0])
    assert group_cuts(program) is program
