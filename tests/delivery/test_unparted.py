"""Ends that nothing is seen of are not moved where that parts what hangs together by a hair."""

from unittest import mock

from tests.planted import box, cut, union

from imdim.delivery import finish
from imdim.geometry.census import census_of
from imdim.geometry.solid import to_manifold

PLATE, TOWER = box(60, 40, 6), box(10, 10, 20, (0, 0, 13))
WHOLE = cut(union(PLATE, TOWER), box(12, 12, 4, (5, 0, 10)))
PARTED = cut(union(PLATE, TOWER), box(12, 12, 4, (0, 0, 10)))


def test_what_parts_a_solid_is_not_done():
    assert census_of(to_manifold(PARTED)).bodies == 2
    far = mock.patch.object(finish, "reach_far", return_value=PARTED)
    kept = mock.patch.object(finish, "preserve", side_effect=lambda _, after, **__: after)
    with far, kept:
        assert census_of(to_manifold(finish.finish(WHOLE).program)).bodies == 1
