"""Hidden ends of what is added go on to the part's outer face, where a person draws it from."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder

from imdim.export.seats import seats
from imdim.geometry.finish import datum_ends
from imdim.geometry.finish.datum_ends import begin_at_datums
from imdim.geometry.solid import to_manifold
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, Program, combine_all, leaves

PLATE = box(60.0, 40.0, 4.0, (0.0, 0.0, 2.0))  # from 0 to 4


def join(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def span(leaf: Primitive, axis: int = 2) -> tuple[float, float]:
    size = leaf.size[axis] if leaf.kind == "box" else leaf.size[-1]
    return leaf.center[axis] - size / 2, leaf.center[axis] + size / 2


def changed(program: Program) -> Program:
    """What it becomes; the solid stays."""
    after = begin_at_datums(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    return after


@pytest.mark.parametrize(
    "boss",
    [
        cylinder(5.0, 8.0, (10.0, 5.0, 7.0)),
        box(6.0, 6.0, 8.0, (10.0, 5.0, 7.0)),
        Primitive("extrude", (8.0,), (10.0, 5.0, 7.0), outline=Outline((circle(4.0), circle(2.0)))),
    ],
    ids=lambda leaf: leaf.kind,
)
def test_a_boss_begins_at_the_base(boss: Primitive) -> None:
    after = list(leaves(changed(join(PLATE, boss))))
    assert span(after[1]) == pytest.approx((0.0, 11.0))
    assert after[0] == PLATE


def test_a_boss_with_a_hole_through_it_does() -> None:
    after = list(leaves(changed(cut(join(PLATE, cylinder(5.0, 8.0, (0.0, 0.0, 7.0))), cylinder(2.0, 20.0)))))
    assert span(after[1]) == pytest.approx((0.0, 11.0))


def test_a_bar_crosses_another_one_from_side_to_side() -> None:
    after = list(leaves(changed(join(box(60.0, 10.0, 10.0), box(10.0, 21.0, 10.0, (0.0, 14.5, 0.0))))))
    assert span(after[1], 1) == pytest.approx((-5.0, 25.0))


def test_a_rib_between_two_walls_keeps_the_length_that_is_seen() -> None:
    walls, rib = join(box(60.0, 4.0, 20.0), box(60.0, 4.0, 20.0, (0.0, 30.0, 0.0))), box(6.0, 13.0, 6.0, (0.0, 7.5, 0.0))  # from 1 to 14
    assert changed(join(walls, rib)) == join(walls, rib)
    assert span(list(leaves(changed(join(box(60.0, 4.0, 20.0), rib))))[1], 1) == pytest.approx((-2.0, 14.0))  # all that stands out


def test_what_is_hidden_nearly_all_the_way_stays() -> None:
    tower = cylinder(5.0, 50.0, (0.0, 0.0, 25.0))
    cap = cylinder(4.0, 3.0, (0.0, 0.0, 50.5))
    assert changed(join(PLATE, tower, cap)) == join(PLATE, tower, cap)


def test_what_has_no_material_below_it_stays() -> None:
    over_a_pocket = join(cut(PLATE, box(20.0, 20.0, 2.0)), box(30.0, 10.0, 4.0, (0.0, 0.0, 5.0)))
    assert changed(over_a_pocket) == over_a_pocket
    beyond_the_edge = join(PLATE, cylinder(5.0, 8.0, (30.0, 0.0, 7.0)))
    assert changed(beyond_the_edge) == beyond_the_edge


def test_alike_parts_move_together_or_not_at_all() -> None:
    pins = [cylinder(2.0, 8.0, (x, 0.0, 7.0)) for x in (-20.0, 0.0, 20.0)]
    moved = list(leaves(changed(join(PLATE, *pins))))[1:]
    assert [span(leaf) for leaf in moved] == [pytest.approx((0.0, 11.0))] * 3
    hollow = join(cut(PLATE, box(4.0, 4.0, 2.0, (20.0, 0.0, 0.0))), *pins)
    assert changed(hollow) == hollow


def test_slanted_parts_and_late_ones_stay() -> None:
    slanted = join(PLATE, Primitive("cylinder", (3.0, 10.0), (0.0, 0.0, 6.0), (0.0, 20.0, 0.0)))
    assert changed(slanted) == slanted
    straight = join(PLATE, cylinder(5.0, 8.0, (10.0, 5.0, 7.0)))
    assert begin_at_datums(straight, PASSED) == straight


def test_ends_at_both_faces_of_a_carrier_follow_both() -> None:
    """A bar as high as the one that it crosses stays so when that becomes higher."""
    found = {(s.own.leaf, s.own.side, s.face.leaf, s.face.side, s.word) for s in seats(join(box(60.0, 10.0, 10.0), box(10.0, 40.0, 10.0)))}
    assert {(1, -1, 0, -1, ""), (1, 1, 0, 1, "")} <= found


def test_an_end_in_the_base_face_stays_there() -> None:
    found = {(s.own.leaf, s.own.side, s.face.leaf, s.face.side, s.word) for s in seats(join(PLATE, cylinder(5.0, 11.0, (10.0, 5.0, 5.5))))}
    assert found == {(1, -1, 0, -1, ""), (1, 1, 0, 1, "height")}


def test_a_collar_and_the_pin_on_it_go_back_to_the_faces_that_they_stand_on() -> None:
    """A search may let all of them begin at the base; a collar of half a millimetre is drawn upon its plate, and a pin upon its collar."""
    collar, pin = cylinder(5.5, 4.5, (10.0, 5.0, 2.25)), cylinder(4.0, 8.0, (10.0, 5.0, 4.0))
    after = list(leaves(changed(cut(join(PLATE, collar, pin), cylinder(2.0, 20.0, (10.0, 5.0, 0.0))))))
    assert span(after[1]) == pytest.approx((4.0, 4.5))
    assert span(after[2]) == pytest.approx((4.5, 8.0))
    again = list(leaves(begin_at_datums(join(*after[:3]))))
    assert again == after[:3]


def test_a_pin_upon_a_boss_that_begins_at_the_base_does_so_too() -> None:
    boss, pin = cylinder(6.0, 8.0, (10.0, 5.0, 7.0)), cylinder(4.0, 10.0, (10.0, 5.0, 15.0))
    after = list(leaves(changed(join(PLATE, boss, pin))))
    assert span(after[1]) == pytest.approx((0.0, 11.0))
    assert span(after[2]) == pytest.approx((0.0, 20.0))


def test_an_end_in_a_round_part_stays_where_no_face_is() -> None:
    """A bar comes out of the wall of a disc at no place that it could be drawn from."""
    bar, disc = box(40.0, 4.0, 4.0, (10.0, 0.0, 2.0)), cylinder(10.0, 4.0, (0.0, 0.0, 2.0))  # both begin at -10
    assert changed(join(disc, bar)) == join(disc, bar)


def test_a_boss_with_a_cone_about_its_foot_begins_at_the_base() -> None:
    boss, foot = cylinder(5.0, 30.0, (10.0, 5.0, 15.0)), Primitive("cone", (8.0, 5.0, 6.0), (10.0, 5.0, 6.0))
    assert changed(join(PLATE, boss, foot)) == join(PLATE, boss, foot)
    higher = cylinder(5.0, 28.0, (10.0, 5.0, 16.0))
    assert span(list(leaves(changed(join(PLATE, higher, foot))))[1]) == pytest.approx((0.0, 30.0))


def test_what_comes_down_to_the_base_may_go_up_to_the_top() -> None:
    """A boss between the two lids of a shell is drawn as high as the shell."""
    shell = cut(box(40.0, 30.0, 7.0, (0.0, 0.0, 3.5)), box(36.0, 40.0, 4.0, (0.0, 0.0, 3.5)))
    after = list(leaves(changed(join(shell, cylinder(6.0, 4.0, (0.0, 0.0, 3.5))))))
    assert span(after[-1]) == pytest.approx((0.0, 7.0))


def test_what_is_seen_of_a_part_alone_is_of_that_part():
    """A bored boss on a plate: the solid less all but the plate has slivers along the bore, as high as the boss."""
    half = Outline((((0.0, -16.0, 0.0), (14.0, -16.0, 0.0), (14.0, 16.0, 0.0), (0.0, 16.0, 0.0)),))
    plate, boss = box(130.0, 50.0, 8.0, (0.0, 0.0, 4.0)), Primitive("revolve", (360.0,), (0.0, 0.0, 20.0), outline=half)
    program = cut(join(plate, boss), cylinder(10.0, 50.0, (0.0, 0.0, 20.0)))
    seen = datum_ends._Visible(program, to_manifold(program, datum_ends.CHECK_SEGMENTS))
    top = next(end for end in datum_ends._ends(program) if (end.leaf, end.axis, end.side) == (0, 2, 1))
    assert seen.along(top) == pytest.approx((0.0, 8.0))
