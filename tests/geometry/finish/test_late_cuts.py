"""Cuts of one part that another part fills again are made last, and end where one sees them end."""

from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder

from imdim.geometry.finish.late_cuts import cut_last, lead_with_body
from imdim.geometry.solid import to_manifold
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import Primitive, Program, combine_all


def join(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def flat(program: Program) -> tuple[list[Program], list[Program]]:
    """What is joined, and then cut; the solid stays."""
    after = cut_last(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    base, cuts = spine(after)
    return parts(base, "union"), cuts


CUP = cut(cylinder(32.0, 42.0, (0.0, 0.0, 21.0)), cylinder(30.0, 42.0, (0.0, 0.0, 23.0)))  # its floor reaches up to 2
TUBE = cut(cylinder(17.0, 15.0, (0.0, 0.0, 7.5)), cylinder(15.0, 16.0, (0.0, 0.0, 8.0)))  # its bore from 0 to 16


def test_a_bore_ends_on_the_floor_that_fills_it() -> None:
    joined, cuts = flat(join(CUP, TUBE))
    assert joined == [CUP, TUBE.left]  # the hollow would take the tube
    assert cuts == [Primitive("cylinder", (15.0, 14.0), (0.0, 0.0, 9.0))]


def test_an_island_left_by_a_cutter_is_joined() -> None:
    hollow = cut(CUP.right, TUBE)
    joined, cuts = flat(cut(CUP.left, hollow))
    assert joined == [CUP, TUBE.left]
    assert cuts == [Primitive("cylinder", (15.0, 14.0), (0.0, 0.0, 9.0))]


def test_a_cut_that_takes_from_nothing_else_keeps_its_ends() -> None:
    plate, hole = box(40.0, 40.0, 4.0), cylinder(3.0, 10.0, (10.0, 10.0, 0.0))
    joined, cuts = flat(join(cut(plate, hole), box(10.0, 10.0, 20.0)))
    assert (joined, cuts) == ([plate, box(10.0, 10.0, 20.0)], [hole])


def test_a_slot_ends_at_the_wall_that_stands_in_it() -> None:
    """In either direction, and through two levels of joins."""
    slotted = cut(box(60.0, 40.0, 5.0), box(30.0, 60.0, 9.0, (0.0, 0.0, 0.0)))
    wall, knob = box(5.0, 60.0, 5.0, (12.5, 0.0, 0.0)), cylinder(4.0, 5.0, (-25.0, 0.0, 2.5))
    joined, cuts = flat(join(join(slotted, knob), wall))
    assert set(joined) == {slotted.left, knob, wall}
    assert cuts == [Primitive("box", (25.0, 60.0, 9.0), (-2.5, 0.0, 0.0))]


def test_what_cannot_be_cut_last_stays() -> None:
    assert cut_last(join(CUP, cylinder(17.0, 15.0, (0.0, 0.0, 7.5)))) == join(CUP, cylinder(17.0, 15.0, (0.0, 0.0, 7.5)))
    early = cut(box(40.0, 40.0, 4.0), box(20.0, 20.0, 9.0), cut(box(10.0, 60.0, 9.0), box(4.0, 70.0, 9.0)))
    assert to_manifold(cut_last(early)).volume() == to_manifold(early).volume()
    assert cut_last(join(CUP, TUBE), PASSED) == join(CUP, TUBE)


def test_posts_that_rise_above_their_tray_end_where_one_sees_them_end() -> None:
    """The second pocket, which had cut them off, goes."""
    body, pocket = box(60.0, 40.0, 20.0, (0.0, 0.0, 10.0)), box(54.0, 34.0, 20.0, (0.0, 0.0, 14.0))
    posts = [cylinder(4.0, 26.0, (x, 0.0, 13.0)) for x in (-15.0, 15.0)]
    above = box(50.0, 30.0, 12.0, (0.0, 0.0, 20.0))  # from 14 on
    joined, cuts = flat(cut(body, cut(pocket, *posts), above))
    assert joined[0] == cut(body, pocket)
    assert joined[1:] == [cylinder(4.0, 14.0, (x, 0.0, 7.0)) for x in (-15.0, 15.0)]
    assert cuts == []


def test_a_body_comes_first_and_the_others_in_their_order() -> None:
    body, boss, pin = box(60.0, 40.0, 5.0), cylinder(5.0, 9.0), cylinder(3.0, 20.0, (20.0, 0.0, 0.0))
    hole = cylinder(1.0, 30.0)
    assert lead_with_body(cut(join(boss, cut(body, hole), pin), hole)) == cut(join(cut(body, hole), boss, pin), hole)
    assert lead_with_body(join(body, boss)) == join(body, boss)
    assert lead_with_body(boss) == boss
    hub = cylinder(25.0, 60.0)  # has more volume than the plate that it stands on
    plate = box(120.0, 50.0, 8.0)
    assert lead_with_body(join(hub, plate)) == join(plate, hub)
