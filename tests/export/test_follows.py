"""What moves with what: numbers that nothing shows, first leaves that stay, walls in one plane, and ends that leave by a wall."""

import math
from dataclasses import replace
from functools import partial, reduce

import pytest
from tests.export.test_collisions import _read, _rectangle
from tests.export.test_outlines import opened

from imdim.delivery.finish import finish
from imdim.export.edit import change_values, solid_of
from imdim.export.seen import find_hidden_ends
from imdim.export.seen_walls import find_hidden_walls
from imdim.geometry.census import census_of
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, leaves
from imdim.relations.discover import exact_relations


def _extrude(corners, height, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)):
    return Primitive("extrude", (height,), center, rotation, Outline((tuple((x, y, 0.0) for x, y in corners),)))


def _walls(leaf, axis):
    return sorted({round(v[axis] + leaf.center[axis], 6) for v in leaf.outline.loops[0]})


# holes about an axis: how long and how far out they are, which way from it, and their turn
AROUND = [
    (h, r, math.cos(math.radians(turn)), math.sin(math.radians(turn)), turn) for h, r, turn in ((30, 40, 0), (26, 38, 120), (22, 37, -120))
]
STEPPED = [(-30.0, -20.0), (30.0, -20.0), (30.0, 0.0), (10.0, 0.0), (10.0, 20.0), (-30.0, 20.0)]


def test_how_far_a_cut_goes_on_in_the_air_has_no_name():
    ball, hole = Primitive("sphere", (20.0,)), Primitive("cylinder", (5.0, 60.0))
    program = Combine("difference", ball, hole)
    assert find_hidden_ends(program) == {(1, 2, -1), (1, 2, 1)}
    assert list(opened(program).values) == ["ball_radius", "hole_diameter"]


def test_a_floor_that_is_seen_has_a_name():
    ball, hole = Primitive("sphere", (20.0,)), Primitive("cylinder", (5.0, 40.0), (0.0, 0.0, 25.0))
    program = Combine("difference", ball, hole)
    assert find_hidden_ends(program) == {(1, 2, 1)}
    assert opened(program).values == {"ball_radius": 20.0, "hole_diameter": 10.0, "hole_z": 5.0}


def test_a_part_beside_the_origin_stays_where_it_is_and_stands_on_its_base():
    """How far it is from there is no dimension of it; the plate grows upward, and the hole stays where it is in that."""
    plate = Primitive("box", (60.0, 40.0, 6.0), (150.0, 90.0, 33.0))
    hole = Primitive("cylinder", (3.0, 10.0), (130.0, 80.0, 33.0))
    part = opened(Combine("difference", plate, hole))
    assert not {name for name, value in part.values.items() if value in (150.0, 90.0, 33.0, 30.0)}
    base, _ = leaves(change_values(part, {"plate_thickness": 10.0}).program)
    assert base.center[2] - base.size[2] / 2 == pytest.approx(30.0)


def test_what_is_drawn_on_an_edge_stays_on_that():
    """A drawing whose wall lies in that of an earlier one and touches it."""
    plate = _extrude(STEPPED, 6.0)
    rim = _extrude([(-4.0, -10.0), (4.0, -10.0), (4.0, 10.0), (0.0, 14.0), (-4.0, 10.0)], 20.0, (26.0, -10.0, 5.0))
    part = opened(Combine("union", plate, rim))
    first, second = leaves(change_values(part, {"plate_length": 70.0}).program)
    assert max(_walls(first, 0)) == max(_walls(second, 0)) == pytest.approx(35.0)


def test_a_wall_of_the_same_level_elsewhere_stays():
    plate = _extrude(STEPPED, 6.0)
    far = _extrude([(-4.0, -10.0), (4.0, -10.0), (4.0, 10.0), (0.0, 14.0), (-4.0, 10.0)], 20.0, (26.0, -10.0, 50.0))
    _, second = leaves(change_values(opened(Combine("union", plate, far)), {"plate_length": 70.0}).program)
    assert max(_walls(second, 0)) == pytest.approx(30.0)


def test_a_cut_that_leaves_by_an_inner_wall_goes_on_doing_so():
    """A slot in the narrow half of a stepped plate comes out at the step."""
    plate = _extrude(STEPPED, 6.0)
    slot = Primitive("box", (12.0, 6.0, 20.0), (6.0, 10.0, 0.0))
    part = opened(Combine("difference", plate, slot))
    step = next(name for name, value in part.values.items() if value == 20.0 and "inset" in name)
    first, second = leaves(change_values(part, {step: 16.0}).program)
    assert 14.0 in _walls(first, 0)
    assert second.center[0] + second.size[0] / 2 == pytest.approx(16.0)


def test_what_stands_on_an_inner_wall_stays_on_it():
    plate = _extrude(STEPPED, 6.0)
    pin = Primitive("cylinder", (2.0, 12.0), (15.0, 10.0, 0.0), (0.0, 90.0, 0.0))
    part = opened(Combine("union", plate, pin))
    step = next(name for name, value in part.values.items() if value == 20.0 and "inset" in name)
    _, second = leaves(change_values(part, {step: 16.0}).program)
    assert second.center[0] - second.size[1] / 2 == pytest.approx(13.0)


def test_a_drawing_whose_base_is_at_0_grows_from_there():
    bracket = _extrude([(-10.0, -15.0), (10.0, -15.0), (10.0, -9.0), (-4.0, -9.0), (-4.0, 15.0), (-10.0, 15.0)], 8.0, (10.0, 15.0, 0.0))
    part = opened(bracket)
    (after,) = leaves(change_values(part, {"body_width": 40.0}).program)
    assert _walls(after, 1)[0] == pytest.approx(0.0)
    assert _walls(after, 1)[-1] == pytest.approx(40.0)


def test_a_cut_goes_through_what_it_cuts_and_not_through_what_is_added_to_it():
    """A hole across a body, and a plug in the middle of it: the hole follows the body's sides."""
    body = _extrude([(-12.0, -30.0), (12.0, -30.0), (12.0, 30.0), (0.0, 32.0), (-12.0, 30.0)], 27.0)
    across = (0.0, 90.0, 0.0)
    hole, plug = Primitive("cylinder", (3.0, 26.0), rotation=across), Primitive("cylinder", (3.0, 6.0), rotation=across)
    part = opened(Combine("union", Combine("difference", body, hole), plug))
    length = next(name for name, value in part.values.items() if value == 24.0)
    _, after, still = leaves(change_values(part, {length: 30.0}).program)
    assert after.size[1] == pytest.approx(32.0)
    assert still.size[1] == pytest.approx(6.0)


def test_what_ends_level_with_a_hidden_face_does_not_follow_it():
    """A block inside a body has a wall where a drawing above has one; nobody sees the former."""
    body = Primitive("box", (60.0, 40.0, 20.0), (0.0, 0.0, 10.0))
    inside = _extrude([(-6.0, -6.0), (6.0, -6.0), (6.0, 6.0), (0.0, 8.0), (-6.0, 6.0)], 20.0, (0.0, 0.0, 10.0))
    above = _extrude([(-6.0, -6.0), (6.0, -6.0), (6.0, 3.0), (0.0, 5.0), (-6.0, 3.0)], 8.0, (0.0, 0.0, 24.0))
    part = opened(Combine("union", Combine("union", body, inside), above))
    (own,) = (name for name, value in part.values.items() if value == 12.0 and name.endswith("length"))
    _, before, _ = leaves(part.program)
    _, first, second = leaves(change_values(part, {own: 14.0}).program)
    assert _walls(first, 0) == pytest.approx(_walls(before, 0))
    assert _walls(second, 0)[-1] == pytest.approx(7.0)


def test_what_ends_level_with_a_wall_does_not_stand_on_that():
    """A rib from a boss to the edge of its plate, whose inner end is hidden in the boss: it stays at the edge, and is not 0 high there."""
    plate = _extrude(STEPPED, 6.0)
    boss = Primitive("cylinder", (8.0, 20.0), (-10.0, 0.0, 10.0))
    rib = Primitive("box", (6.0, 16.0, 12.0), (-10.0, -12.0, 6.0))
    part = opened(Combine("union", Combine("union", plate, boss), rib))
    assert 0.0 not in part.values.values()
    width = next(name for name, value in part.values.items() if value == 40.0)
    first, _, after = leaves(change_values(part, {width: 44.0}).program)
    assert after.center[1] - after.size[1] / 2 == pytest.approx(min(_walls(first, 1)))


def test_a_cut_with_one_end_in_the_air_lies_where_its_other_end_does():
    """Above a ball nothing says how high a slot goes; its floor is so far above the middle of that."""
    body = Combine("union", Primitive("box", (80.0, 60.0, 6.0), (0.0, 0.0, 3.0)), Primitive("sphere", (20.0,), (0.0, 0.0, 20.0)))
    part = opened(Combine("difference", body, Primitive("box", (50.0, 8.0, 30.0), (0.0, 0.0, 40.0))))
    assert sorted(part.values) == ["ball_radius", "ball_z", "plate_length", "plate_thickness", "plate_width", "pocket_width", "pocket_z"]
    name = next(name for name, value in part.values.items() if value == 5.0)
    *_, slot = leaves(change_values(part, {name: 7.0}).program)
    assert slot.center[2] - slot.size[2] / 2 == pytest.approx(27.0)


def test_a_wall_that_nobody_sees_has_no_name():
    body = Primitive("cylinder", (20.0, 30.0))
    around = [(-12.0, -31.0), (12.0, -31.0), (12.0, 31.0), (-12.0, 31.0)]
    mask = _extrude(around, 40.0)
    part = opened(Combine("intersection", body, mask))
    assert find_hidden_walls(part.program) == {(1, 0, 0), (1, 0, 2)}
    assert {24.0} <= set(part.values.values())
    assert 62.0 not in part.values.values()


def test_a_wall_of_what_lies_across_stays_level_with_a_floor():
    """A bar that is turned about the vertical, drawn from its side: its upper wall is level with the floor of a drawn cut."""
    plate = _extrude(STEPPED, 20.0)
    bar = _extrude([(-4.0, -6.0), (5.0, -6.0), (5.0, 6.0), (0.0, 8.0), (-4.0, 6.0)], 30.0, (-10.0, 0.0, 0.0), (0.0, -90.0, -85.0))
    cut = _extrude([(-8.0, -16.0), (8.0, -16.0), (8.0, 16.0), (0.0, 17.0), (-8.0, 16.0)], 6.0, (-10.0, 0.0, 8.0))
    part = opened(Combine("union", Combine("difference", plate, cut), bar))
    depth = next(name for name in part.values if name.endswith("depth"))
    _, floor, bar = leaves(change_values(part, {depth: part.values[depth] + 1.0}).program)
    assert floor.center[2] - floor.size[0] / 2 == pytest.approx(4.0)
    assert max(v[0] for v in bar.outline.loops[0]) + bar.center[2] == pytest.approx(4.0)


def test_a_plug_has_the_radius_of_its_hole():
    body, hole = Primitive("box", (60.0, 40.0, 20.0)), Primitive("cylinder", (5.0, 22.0))
    plug, apart = Primitive("cylinder", (5.0, 6.0)), Primitive("cylinder", (5.0, 6.0), (0.0, 0.0, 30.0))
    part = opened(Combine("union", Combine("union", Combine("difference", body, hole), plug), apart))
    assert [value for name, value in part.values.items() if name.endswith("diameter")] == [10.0, 10.0]
    _, wider, filled, still = leaves(change_values(part, {"hole_diameter": 12.0}).program)
    assert (wider.size[0], filled.size[0], still.size[0]) == (6.0, 6.0, 5.0)


def test_a_plug_in_a_hole_aslant_has_its_radius_and_its_height():
    across = (0.0, 90.0, 60.0)
    body, hole = Primitive("box", (60.0, 60.0, 40.0)), Primitive("cylinder", (5.0, 90.0), (0.0, 0.0, 3.0), across)
    plug = Primitive("cylinder", (5.0, 6.0), (0.0, 0.0, 3.0), across)
    part = _read(Combine("union", Combine("difference", body, hole), plug))
    assert [value for name, value in part.values.items() if name.endswith("diameter")] == [10.0]
    for name, value in part.values.items():
        _, hole, plug = leaves(change_values(part, {name: 1.1 * value}).program)
        assert (hole.size[0], hole.center[2]) == (plug.size[0], plug.center[2]), name


def test_a_turned_plug_and_its_copies_have_the_radius_of_their_holes():
    """A sleeve in each of three holes about an axis, which are no copies: they end in the air at different places."""
    ring = ((3.0, -7.0, 0.0), (5.0, -7.0, 0.0), (5.0, 7.0, 0.0), (3.0, 7.0, 0.0))
    holes = [Primitive("cylinder", (5.0, h), (r * x, r * y, 0.0), (0.0, 90.0, turn)) for h, r, x, y, turn in AROUND]
    sleeves = [Primitive("revolve", (360.0,), (35 * x, 35 * y, 0.0), (0.0, 90.0, turn), Outline((ring,))) for _, _, x, y, turn in AROUND]
    body = Combine("difference", Primitive("cylinder", (40.0, 20.0)), Primitive("cylinder", (29.0, 22.0)))
    part = opened(reduce(partial(Combine, "union"), sleeves, reduce(partial(Combine, "difference"), holes, body)))
    (wide,) = (name for name, value in part.values.items() if value == 10.0)
    wider = [leaf for leaf in leaves(change_values(part, {wide: 12.0}).program) if leaf.rotation != (0.0, 0.0, 0.0)]
    assert len(wider) == 6
    assert all(leaf.size[0] == 6.0 if leaf.kind == "cylinder" else max(x for x, _, _ in leaf.outline.loops[0]) == 6.0 for leaf in wider)


def test_bores_of_bosses_in_a_circle_stay_in_them():
    """Both lie along spokes about an axis: one circle has a name, and bores go on through longer bosses."""
    tube = Combine("difference", Primitive("cylinder", (40.0, 30.0)), Primitive("cylinder", (30.0, 32.0)))

    def spokes(radius, height, away):
        return [Primitive("cylinder", (radius, height), (away * x, away * y, 0.0), (0.0, 90.0, turn)) for _, _, x, y, turn in AROUND]

    bossed = reduce(partial(Combine, "union"), spokes(6.0, 14.0, 42.0), tube)
    part = opened(reduce(partial(Combine, "difference"), spokes(3.0, 22.0, 39.0), bossed))
    (circle,) = (name for name, value in part.values.items() if name.endswith("circle"))
    assert part.values[circle] == 84.0
    _, (before, *_) = _spokes_of(part.program)
    for name, value, more in ((circle, 88.0, 2.0), ("disc_diameter", 78.0, 0.0)):
        bosses, bores = _spokes_of(change_values(part, {name: value}).program)
        assert bosses == [pytest.approx((42.0 + more, 16.0 + more))] * 3
        assert bores == [pytest.approx((before[0] + more, before[1] + 2.0 + more))] * 3


def _spokes_of(program):
    """How far from the axis bosses of radius 6 are, and how long, and bores of radius 3."""
    return ([(math.hypot(*leaf.center[:2]), leaf.size[1]) for leaf in leaves(program) if leaf.size[0] == r] for r in (6.0, 3.0))


def _place(part, corner):
    return [part.center[axis] + corner[axis] for axis in (0, 1)]


def test_what_is_drawn_on_corners_of_another_drawing_stays_there():
    """A pocket whose walls lean as those of the window in its floor do, with three corners in common."""
    window = ((-8.0, -6.0, 0.0), (7.0, -4.0, 0.0), (8.0, 1.1, 0.41), (6.9, 2.3, 0.0), (-6.0, 5.0, 0.0))
    outer = ((-30.0, -20.0, 0.0), (30.0, -20.0, 0.0), (30.0, 20.0, 0.0), (0.0, 24.0, 0.0), (-30.0, 20.0, 0.0))
    plate = Primitive("extrude", (6.0,), (0.0, 0.0, 3.0), outline=Outline((outer, window)))
    pocket = Primitive(
        "extrude",
        (4.0,),
        (10.0, 4.0, 5.0),
        outline=Outline((((-18.0, -10.0, 0.0), (-3.0, -8.0, 0.0), (4.0, 9.0, 0.0), (-16.0, 1.0, 0.0)),)),
    )
    part = _read(Combine("difference", plate, pocket))
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            plate, pocket = leaves(change_values(part, {name: factor * value}).program)
            inner, own = plate.outline.loops[1], pocket.outline.loops[0]
            for i, j in ((0, 0), (1, 1), (4, 3)):
                assert _place(plate, inner[i]) == pytest.approx(_place(pocket, own[j])), name


def _rounded(before, corner, after, radius):
    """The two vertices by which an arc rounds a corner on the right-hand side of the way there."""
    (ux, uy), (vx, vy) = ([(q - p) / math.dist(corner, at) for p, q in zip(corner, at, strict=True)] for at in (before, after))
    half = math.acos(ux * vx + uy * vy) / 2
    far = radius / math.tan(half)
    bulge = math.tan((math.pi / 2 - half) / 2)
    return (corner[0] + far * ux, corner[1] + far * uy, bulge), (corner[0] + far * vx, corner[1] + far * vy, 0.0)


def test_corners_in_one_place_that_are_rounded_alike_stay_so():
    tip, low, high = (17.0, -4.0), (-8.0, -6.0), (-6.0, 9.0)
    window = ((*low, 0.0), *_rounded(low, tip, high, 2.0), (*high, 0.0))
    plate = Primitive("extrude", (6.0,), (0.0, 0.0, 3.0), outline=Outline((_rectangle(-30.0, 30.0, -20.0, 20.0), window)))
    pocket = ((-10.0, 9.0, 0.0), (-8.0, -6.0, 0.0), *_rounded(low, tip, high, 2.0), (*high, 0.0))
    part = _read(Combine("difference", plate, Primitive("extrude", (4.0,), (0.0, 0.0, 5.0), outline=Outline((pocket,)))))
    (name,) = (name for name, value in part.values.items() if value == pytest.approx(2.0) and name.endswith("radius"))
    plate, pocket = leaves(change_values(part, {name: 3.0}).program)
    inner, own = plate.outline.loops[1], pocket.outline.loops[0]
    assert [*inner[1], *inner[2]] == pytest.approx([*own[2], *own[3]])
    assert inner[1][:2] == pytest.approx(_rounded(low, tip, high, 3.0)[0][:2])


def test_a_hole_goes_through_what_is_seen_of_a_nut():
    """Not to the end of the prism, of which a cone that bounds the nut leaves nothing."""
    prism = _extrude([(-6.0, 0.0), (-3.0, -5.2), (3.0, -5.2), (6.0, 0.0), (3.0, 5.2), (-3.0, 5.2)], 5.0, (0.0, 0.0, 2.5))
    nut = Combine("intersection", prism, Primitive("cone", (9.0, 4.0, 4.0), (0.0, 0.0, 2.0)))
    part = opened(Combine("difference", nut, Primitive("cylinder", (2.5, 40.0), (0.0, 0.0, 2.0))))
    (name,) = (n for n, value in part.values.items() if value == 4.0 and n.endswith("height"))
    _, cone, hole = leaves(change_values(part, {name: 30.0}).program)
    assert hole.center[2] + hole.size[1] / 2 > cone.center[2] + cone.size[2] / 2


def test_added_parts_that_touch_stay_together():
    """Their faces look at each other, and nothing is seen of either."""
    block = _extrude([(-10.0, -5.0), (10.0, -5.0), (10.0, 5.0), (0.0, 9.0), (-10.0, 5.0)], 8.0)
    arm = _extrude([(-6.0, -5.0), (6.0, -3.0), (6.0, 3.0), (-6.0, 5.0)], 8.0, (16.0, 0.0, 0.0))
    part = opened(Combine("union", block, arm))
    for name in part.values:
        for factor in (0.9, 1.1):
            after = change_values(part, {name: part.values[name] * factor})
            assert census_of(solid_of(after)).bodies == 1, name


def test_a_pocket_under_a_flange_follows_it():
    """A flat face of what is turned is a wall like others."""
    section = Outline((((0.0, -20.0, 0.0), (6.0, -20.0, 0.0), (6.0, 14.0, 0.0), (30.0, 14.0, 0.0), (30.0, 20.0, 0.0), (0.0, 20.0, 0.0)),))
    pocket = Primitive("box", (10.0, 8.0, 30.0), (8.0, 0.0, -1.0))
    part = opened(Combine("difference", Primitive("revolve", (360.0,), outline=section), pocket))
    turned, cut = leaves(change_values(part, {"turned_part_depth": 9.0}).program)
    assert cut.center[2] + cut.size[2] / 2 == pytest.approx(turned.center[2] + 11.0)


def test_an_arc_about_a_hole_is_as_wide_as_that():
    """An arc in another drawing, on the axis of the hole."""
    plate = Combine("difference", _extrude(STEPPED, 6.0), Primitive("cylinder", (5.0, 8.0), (-10.0, 0.0, 0.0)))
    bar = Outline((((-4.0, -3.0, 0.0), (-4.0, 3.0, 0.0), (4.0, 3.0, -math.tan(math.atan(0.75) / 2)), (4.0, -3.0, 0.0)),))
    part = opened(Combine("union", plate, Primitive("extrude", (4.0,), (-10.0, 0.0, 0.0), outline=bar)))
    assert not any("arc_radius" in name for name in part.values)


def test_a_cut_that_ends_level_with_a_wall_follows_that():
    """A counterbore from the top of a post, which is drawn from its side, down into its foot: not so far above the foot."""
    foot = Primitive("box", (60.0, 40.0, 10.0), (0.0, 0.0, 5.0))
    post = _extrude([(-12.0, -12.0), (10.0, -12.0), (12.0, -10.0), (12.0, 20.0), (-12.0, 20.0)], 30.0, (0.0, 0.0, 20.0), (90.0, 0.0, 0.0))
    cut = Primitive("cylinder", (5.0, 36.0), (0.0, 0.0, 22.0))
    part = opened(Combine("difference", Combine("union", foot, post), cut))
    for name in part.values:
        _, post_after, cut_after = leaves(change_values(part, {name: part.values[name] * 1.1}).program)
        top = post_after.center[2] + max(y for _, y, _ in post_after.outline.loops[0])
        assert cut_after.center[2] + cut_after.size[1] / 2 >= top, name


def _toothed(count, middle, way=1.0, start=11.0):
    """A disc beside the origin, with drawn parts in a circle through its rim: added, or cut."""
    length = 4.0
    disc = Primitive("cylinder", (20.0, 8.0), (70.0, 90.0, 4.0))
    teeth = []
    for k in range(count):
        angle = 360.0 * k / count + start
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        corners = [(-length / 2, -2.0), (length / 2, -1.0), (length / 2, 1.0), (-length / 2, 2.0)]
        teeth.append(_extrude(corners, 8.0 if way > 0 else 10.0, (70.0 + middle * c, 90.0 + middle * s, 4.0), (0.0, 0.0, angle)))
    program = disc
    for tooth in teeth:
        program = Combine("union" if way > 0 else "difference", program, tooth)
    return program


def _teeth_reach(program):
    """From where to where those teeth go from the axis, each."""
    teeth = [p for p in leaves(program) if p.outline is not None]
    ends = [math.hypot(p.center[0] - 70.0, p.center[1] - 90.0) for p in teeth]
    return [
        (away + _walls(Primitive("extrude", p.size, outline=p.outline), 0)[0], away + p.outline.bounds[1][0])
        for p, away in zip(teeth, ends, strict=True)
    ]


@pytest.mark.parametrize("count", [12, 19])
def test_teeth_follow_the_rim_that_they_stand_on(count):
    """An odd number too, where copies lie level but for the digits of files."""
    part = opened(_toothed(count, 21.0))
    assert "tooth_circle" not in part.values
    for low, high in _teeth_reach(change_values(part, {"disc_diameter": 50.0}).program):
        assert (low, high) == pytest.approx((24.0, 28.0), abs=1e-5)
    for low, high in _teeth_reach(change_values(part, {"tooth_length": 5.0}).program):
        assert (low, high) == pytest.approx((19.0, 24.0), abs=1e-5)


def test_that_two_teeth_are_level_is_no_relation_of_its_own():
    rough = _toothed(19, 21.0, start=0.0)
    moved = [replace(p, center=tuple(round(c, 4) for c in p.center)) for p in leaves(rough)]
    program = reduce(partial(Combine, "union"), moved)
    relations = exact_relations(program).constraints
    assert any(c.kind == "aligned" and len(c.of) == 2 for c in relations)
    found = finish(program, relations)
    assert not any(c.kind == "aligned" for c in found.constraints)
    assert all(any(t.name == "disc_diameter" for e in center for t in e.terms) for center in found.parameters.centers[1:])


def test_notches_of_a_rim_grow_into_it():
    part = opened(_toothed(12, 19.0, -1.0))
    name = next(name for name in part.values if name.endswith("_length"))
    for low, high in _teeth_reach(change_values(part, {name: 5.0}).program):
        assert (low, high) == pytest.approx((16.0, 21.0), abs=1e-5)


def _with_arms(ring, low, high, count=6):
    """A ring with boxes along its spokes, from where to where each goes from the axis."""
    length, away = high - low, (low + high) / 2
    turns = [360.0 * k / count for k in range(count)]
    places = [(away * math.cos(math.radians(t)), away * math.sin(math.radians(t))) for t in turns]
    arms = [Primitive("box", (length, 4.0, 6.0), (x, y, 0.0), (0.0, 0.0, t)) for t, (x, y) in zip(turns, places, strict=True)]
    return reduce(partial(Combine, "union"), arms, ring)


def _arms_reach(program):
    boxes = [p for p in leaves(program) if p.kind == "box"]
    return [(math.hypot(*p.center[:2]) - p.size[0] / 2, math.hypot(*p.center[:2]) + p.size[0] / 2) for p in boxes]


def test_tabs_that_begin_in_a_bore_go_outwards_with_it_and_stay_as_long():
    tube = Combine("difference", Primitive("cylinder", (30.0, 20.0)), Primitive("cylinder", (28.0, 22.0)))
    part = opened(_with_arms(tube, 28.0, 40.0))
    (length,) = (name for name, value in part.values.items() if value == 12.0)
    (bore,) = (name for name, value in part.values.items() if value in (56.0, 2.0))
    assert not any(name.endswith("circle") for name in part.values)
    wider = change_values(part, {bore: 60.0 if part.values[bore] == 56.0 else 1.0}).program
    inner = min(p.size[0] for p in leaves(wider) if p.kind == "cylinder")
    assert inner > 28.0
    assert _arms_reach(wider) == [pytest.approx((inner, inner + 12.0))] * 6
    assert _arms_reach(change_values(part, {length: 15.0}).program) == [pytest.approx((28.0, 43.0))] * 6


def test_spokes_are_as_long_as_hub_and_rim_are_apart():
    """They go on into the rim by what is not seen of them."""
    hub, wheel = Primitive("cylinder", (8.0, 20.0)), Primitive("cylinder", (40.0, 20.0))
    rim = Combine("union", Combine("difference", wheel, Primitive("cylinder", (30.0, 22.0))), hub)
    part = opened(_with_arms(rim, 8.0, 30.0))
    assert sorted(part.values.values()) == [4.0, 6.0, 16.0, 20.0, 60.0, 80.0]
    (_, sunk), *_ = _arms_reach(part.program)
    for value, wanted in ((16.0, (10.0, sunk)), (60.0, (8.0, sunk + 5.0))):
        (name,) = (name for name, own in part.values.items() if own == value)
        edited = change_values(part, {name: 20.0 if value == 16.0 else 70.0}).program
        assert _arms_reach(edited) == [pytest.approx(wanted)] * 6


def test_arms_that_begin_at_the_axis_do_so_however_long():
    part = opened(_with_arms(Primitive("cylinder", (8.0, 20.0)), 0.0, 30.0))
    (name,) = (name for name, value in part.values.items() if value == 30.0)
    assert _arms_reach(change_values(part, {name: 36.0}).program) == [pytest.approx((0.0, 36.0))] * 6


@pytest.mark.parametrize("angle", [90.0, 360.0])
def test_an_elbow_has_one_radius(angle):
    """Its bore, and the straight ends that go on from it, lie as far from its axis as it is bent about it."""
    circles = [Outline((((r_major - r, 0.0, 1.0), (r_major + r, 0.0, 1.0)),)) for r_major, r in ((25.0, 8.0),)]
    bent = Primitive("torus", (25.0, 8.0)) if angle == 360.0 else Primitive("revolve", (angle,), outline=circles[0])
    ends = [Primitive("cylinder", (11.0, 4.0), center, turn) for center, turn in (((25, -2, 0), (90, 0, 0)), ((-2, 25, 0), (0, 90, 0)))]
    part = opened(Combine("difference", reduce(partial(Combine, "union"), ends, bent), Primitive("torus", (25.0, 6.0))))
    (radius,) = (name for name, value in part.values.items() if value == 25.0)
    outer, *rest = leaves(change_values(part, {radius: 30.0}).program)
    assert (outer.size[0] if angle == 360.0 else sum(x for x, _, _ in outer.outline.loops[0]) / 2) == pytest.approx(30.0)
    assert rest[-1].size == pytest.approx((30.0, 6.0))
    assert [p.center for p in rest[:2]] == [pytest.approx((30.0, -2.0, 0.0)), pytest.approx((-2.0, 30.0, 0.0))]


def _ring(x, y, radius):
    return (x - radius, y, 1.0), (x + radius, y, 1.0)


def test_what_shortens_posts_in_a_tray_follows_its_walls_and_not_slots_in_its_floor():
    outside, inside, slot = ([(-x, -y), (x, -y), (x, y), (-x, y)] for x, y in ((42.0, 27.0), (38.0, 23.0), (1.5, 15.0)))
    slots = tuple(tuple((x + at, y, 0.0) for x, y in slot) for at in (-21.0, 0.0, 21.0))
    body = replace(_extrude(outside, 25.0), outline=Outline((*_extrude(outside, 25.0).outline.loops, *slots)))
    posts = tuple(_ring(x, y, 3.5) for x in (-33.0, 33.0) for y in (-18.0, 18.0))
    cavity = replace(_extrude(inside, 25.0, (0.0, 0.0, 2.0)), outline=Outline((*_extrude(inside, 25.0).outline.loops, *posts)))
    tops = Primitive("box", (73.2, 43.2, 7.0), (0.0, 0.0, 11.0))
    part = opened(Combine("difference", Combine("difference", body, cavity), tops))
    assert {(2, axis, side) for axis in (0, 1) for side in (-1, 1)} <= find_hidden_ends(part.program)
    assert [v for v in part.values.values() if v in (73.2, 43.2)] == []
    moved = 0
    for name, value in part.values.items():
        _, wider, cut = leaves(change_values(part, {name: 1.02 * value}).program)
        for axis in (0, 1):
            wall = max(vertex[axis] for vertex in wider.outline.loops[0]) + wider.center[axis]
            assert wall - (cut.center[axis] + cut.size[axis] / 2) == pytest.approx(1.4), name
            moved += abs(wall - (38.0, 23.0)[axis]) > 1e-6
    assert moved >= 2
