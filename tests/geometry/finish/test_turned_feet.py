"""Cones and turned drawings end on the face they stand on."""

import pytest
from tests.deadlines import PASSED
from tests.planted import ALONG_X, box, cone, cut, cylinder

from imdim.geometry.finish import turned_feet
from imdim.geometry.finish.turned_feet import stand_on_faces
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, combine_all, leaves

PLATE = box(80.0, 50.0, 8.0, (0.0, 0.0, 4.0))  # from 0 to 8
RING = ((0.0, 0.0, 0.0), (24.0, 0.0, 0.0), (18.0, 12.0, 0.0), (0.0, 12.0, 0.0))
LONG = ((0.0, -3.0, 0.0), (25.5, -3.0, 0.0), (18.0, 12.0, 0.0), (0.0, 12.0, 0.0))  # comes out at the sides of the plate


def join(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def turned(ring) -> Primitive:
    return Primitive("revolve", (360.0,), (0.0, 0.0, 8.0), outline=Outline((ring,)))


TARGET = to_manifold(join(PLATE, turned(RING)), 96)


def test_a_drawing_ends_where_it_is_seen() -> None:
    foot = list(leaves(stand_on_faces(join(PLATE, turned(LONG)), TARGET)))[1]
    assert foot.outline is not None
    assert sorted(foot.outline.rings[0]) == [pytest.approx(v) for v in sorted(RING)]


def test_so_does_a_cone() -> None:
    foot = list(leaves(stand_on_faces(join(PLATE, cone(25.5, 18.0, 15.0, (0.0, 0.0, 12.5))), TARGET)))[1]
    assert foot.size == pytest.approx((24.0, 18.0, 12.0))
    assert foot.center[2] == pytest.approx(14.0)


def test_a_cone_on_the_side_of_a_wall_does() -> None:
    wall = box(8.0, 50.0, 80.0, (4.0, 0.0, 0.0))  # to x = 8
    found = join(wall, Primitive("cone", (26.0, 18.0, 16.0), (8.0, 0.0, 0.0), (0.0, 90.0, 0.0)))
    target = to_manifold(join(wall, Primitive("cone", (18.0, 22.0, 8.0), (12.0, 0.0, 0.0), (0.0, -90.0, 0.0))), 96)
    foot = list(leaves(stand_on_faces(found, target)))[1]
    assert foot.size == pytest.approx((22.0, 18.0, 8.0))


def test_what_is_seen_on_both_sides_stays() -> None:
    both = join(PLATE, cone(30.0, 10.0, 40.0, (0.0, 0.0, 4.0)))
    assert stand_on_faces(both, to_manifold(both, 96)) == both


@pytest.mark.parametrize(("depth", "kept", "asked"), [(0.0, False, 0), (1.5, False, 2), (3.0, True, 0), (4.0, True, 0)])
def test_whole_solids_are_asked_only_where_air_and_body_are_lost_together(depth, kept, asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """A foot that comes out below its plate, by four; the target has one that does so by its `depth`."""
    calls = []
    monkeypatch.setattr(turned_feet, "volume_iou", lambda solid, target: calls.append(solid) or volume_iou(solid, target))
    found = join(PLATE, cone(10.0, 9.0, 16.0, (0.0, 0.0, 4.0)))
    target = to_manifold(join(PLATE, cone(9.25, 9.0, 4.0, (0.0, 0.0, 10.0)), cylinder(9.9, depth + 1.0, (0.0, 0.0, (1.0 - depth) / 2))), 96)
    assert (stand_on_faces(found, target) == found) == kept
    assert len(calls) == asked


def test_the_target_is_not_asked_where_the_whole_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The end of a cone that is hidden in its plate goes, and nothing else changes."""
    monkeypatch.setattr(turned_feet, "volume_iou", lambda *_: pytest.fail("the target was asked"))
    hidden = join(box(80.0, 50.0, 8.0, (0.0, 0.0, 4.0)), cone(20.0, 18.0, 15.0, (0.0, 0.0, 12.5)))
    foot = list(leaves(stand_on_faces(hidden, to_manifold(hidden, 96))))[1]
    assert foot.size == pytest.approx((19.6, 18.0, 12.0))


def test_the_target_is_not_asked_of_a_solid_that_is_far_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(turned_feet, "volume_iou", lambda solid, target: asked.append(solid) or volume_iou(solid, target))
    both = join(box(80.0, 50.0, 8.0), cone(24.0, 20.0, 120.0))  # a plate about the middle of a cone, half of which no trial has
    assert stand_on_faces(both, to_manifold(both, 96)) == both
    assert not asked


def test_what_a_pocket_shows_is_kept() -> None:
    """The plate is cut away below the foot, which reaches down to a smaller plate."""
    found = join(cut(PLATE, cylinder(20.0, 20.0)), turned(LONG))
    target = to_manifold(found, 96)
    assert stand_on_faces(found, target) == found


def test_past_its_deadline_all_stays() -> None:
    found = join(PLATE, turned(LONG))
    assert stand_on_faces(found, TARGET, PASSED) == found


def test_cutters_and_prisms_stay() -> None:
    found = join(cut(PLATE, cone(3.0, 9.0, 20.0)), cylinder(5.0, 20.0, (20.0, 0.0, 8.0), ALONG_X))
    assert stand_on_faces(found, to_manifold(found, 96)) == found
