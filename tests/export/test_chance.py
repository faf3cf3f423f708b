"""Relations that hold by chance bind no edit; those that a designer may have meant stay."""

import pytest
from tests.export.test_outlines import SEGMENTS

from imdim.delivery.finish import finish
from imdim.export.chance import without_chance
from imdim.export.delivered import texts_of
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.geometry.solid import bounds_of, to_manifold, volume_iou
from imdim.program.codec import dumps, parse
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, combine_all, leaves
from imdim.reconstruction.fitting import relations_of


def part(thickness=3.0, depth=2.0, hole=5.0, ball=5.0):
    """A plate with a hole and a slot that both end at z = -2, and a pocket from below that does not go through; on it a ball."""
    plate = Primitive("box", (60.0, 40.0, thickness), (0.0, 0.0, thickness / 2))
    top = Primitive("sphere", (ball,), (-20.0, 0.0, thickness))
    bore = Primitive("cylinder", (hole, thickness + 2.0), (15.0, 0.0, thickness / 2 - 1.0))
    slot = Primitive("box", (4.0, 20.0, thickness + 2.0), (0.0, 0.0, thickness / 2 - 1.0))
    pocket = Primitive("box", (8.0, 8.0, depth + 2.0), (22.0, 12.0, depth / 2 - 1.0))
    cuts = Combine("union", Combine("union", bore, slot), pocket)
    return Combine("difference", Combine("union", plate, top), cuts)


def delivered(program, constraints):
    """The part with its relations, as it is delivered."""
    found = finish(program, constraints)
    texts = texts_of(found.program, found.parameters, found.folded, SEGMENTS)
    return open_delivered(parse(dumps(found.program, None, found.constraints, found.folded)), texts)


def test_where_cuts_end_in_the_air_binds_nothing():
    program = part()
    level = Constraint("coplanar", (Ref(2, "-z"), Ref(3, "-z")), name="level")
    flush = Constraint("coplanar", (Ref(0, "+z"), Ref(2, "+z")), name="flush")
    assert without_chance(program, [level]) == ()
    assert without_chance(program, [flush]) == (flush,), "an end in the face that it meets is seen"
    for thickness in (4.0, 9.0):
        after = change_values(delivered(program, [level, flush]), {"plate_thickness": thickness})
        wanted = Combine("difference", part(thickness, ball=0.1), Primitive("box", (1.0, 1.0, 1.0), (0.0, 0.0, 90.0)))
        got, meant = solid_of(after), to_manifold(wanted, SEGMENTS)
        assert volume_iou(got.trim_by_plane((1.0, 0.0, 0.0), -10.0), meant.trim_by_plane((1.0, 0.0, 0.0), -10.0)) > 1 - 1e-6


def test_holes_that_end_in_one_face_go_through_a_thicker_plate():
    """Both ends of two holes lie in the plate's faces: they are level with these, and not with each other."""
    plate, holes = Primitive("box", (20.0, 10.0, 3.0)), [Primitive("cylinder", (2.0, 3.0), (x, 0.0, 0.0)) for x in (-6.0, 6.0)]
    program = combine_all("difference", [plate, *holes])
    level = Constraint("coplanar", (Ref(1, "-z"), Ref(2, "-z")), name="level")
    flush = [Constraint("coplanar", (Ref(0, "+z"), Ref(i, "+z")), name=f"flush_{i}") for i in (1, 2)]
    tall = Constraint("equal", (Ref(1, "h"), Ref(2, "h")), name="hole_height")
    given = [level, *flush, tall]
    assert [c.of for c in without_chance(program, given)] == [c.of for c in flush]
    thicker = solid_of(change_values(delivered(program, given), {"plate_thickness": 8.0}))
    assert thicker.genus() == 2


def test_middles_of_cuts_that_begin_in_the_air_are_level_with_their_like_alone():
    """A blind hole is as deep as another one, and the middle of neither is where a drilled one's, or that of the plate beside it, is."""
    plate = Primitive("box", (60.0, 20.0, 12.0), (0.0, 0.0, -6.0))
    blind = [Primitive("cylinder", (2.5, 8.0), (x, 0.0, -4.0)) for x in (-20.0, -10.0)]
    tip = Outline((((1.5, 4.0, 0.0), (0.0, 4.0, 0.0), (0.0, -4.0, 0.0), (1.5, -3.0, 0.0)),))
    drilled = Primitive("revolve", (360.0,), (10.0, 0.0, -4.0), outline=tip)
    lug = Primitive("box", (10.0, 10.0, 4.0), (35.0, 0.0, -4.0))
    program = combine_all("difference", [Combine("union", plate, lug), *blind, drilled])
    up = Ref(WORLD, "z")
    alike = Constraint("aligned", (Ref(2), Ref(3)), about=up, name="as_deep")
    by_chance = [Constraint("aligned", (Ref(2), other), about=up, name="level") for other in (Ref(1), Ref(4))]
    across = Constraint("aligned", (Ref(2), Ref(4)), about=Ref(WORLD, "y"), name="in_a_row")
    assert [c.of for c in without_chance(program, [alike, *by_chance, across])] == [alike.of, across.of]


def test_features_level_by_way_of_a_cut_stay_level():
    """The hole ends in the face of the second plate, and was level with the first one: the plates are level with each other."""
    plates = combine_all("union", [Primitive("box", (20.0, 10.0, 3.0)), Primitive("box", (8.0, 8.0, 3.0), (12.0, 0.0, 0.0))])
    program = combine_all("difference", [plates, Primitive("cylinder", (1.0, 3.0), (14.0, 0.0, 0.0))])
    chain = [Constraint("coplanar", (Ref(a, "-z"), Ref(b, "-z")), name=f"level_{a}_{b}") for a, b in ((0, 2), (2, 1))]
    kept = {c.of for c in without_chance(program, chain)}
    assert (Ref(0, "-z"), Ref(1, "-z")) in kept


def test_equal_sizes_are_tied_within_one_role():
    program = part()
    equal = Constraint("equal", (Ref(1, "r"), Ref(2, "r")), name="ball_hole_radius")
    assert without_chance(program, [equal]) == ()
    narrow = Constraint("equal", (Ref(3, "sx"), Ref(4, "sx")), name="slot_pocket_length")
    assert without_chance(program, [narrow]) == ()
    program = Combine("difference", program, Primitive("box", (8.0, 6.0, 4.0), (22.0, -12.0, 1.0)))
    pair = Constraint("equal", (Ref(4, "sx"), Ref(5, "sx")), name="pocket_length")
    assert without_chance(program, [pair]) == (pair,)


def test_a_face_at_the_middle_of_something_is_chance():
    middle = Constraint("aligned", (Ref(2, "-z"), Ref(0, "")), about=Ref(-1, "z"), name="level")
    centers = Constraint("aligned", (Ref(2, ""), Ref(0, "")), about=Ref(-1, "y"), name="centred")
    assert without_chance(part(), [middle, centers])[0].of == centers.of
    assert len(without_chance(part(), [middle, centers])) == 1


def test_a_ball_is_made_larger_and_the_hole_of_its_size_stays():
    after = solid_of(change_values(delivered(*relations_of(part())), {"ball_radius": 6.0}))
    assert volume_iou(after, to_manifold(part(ball=6.0), SEGMENTS)) > 1 - 1e-6


def test_heights_are_tied_where_parts_are_as_wide_or_begin_and_end_together():
    """A flange as thick as another one that is wider and elsewhere is so by chance."""
    sizes = ((12.0, 2.0, 1.0), (11.0, 2.0, 15.0), (12.0, 2.0, 30.0), (8.0, 2.0, 30.0))
    flanges = [Primitive("cylinder", (r, h), (0.0, 0.0, z)) for r, h, z in sizes]
    program = combine_all("union", [Primitive("box", (40.0, 40.0, 1.0)), *flanges])
    equal = Constraint("equal", tuple(Ref(i, "h") for i in (1, 2, 3, 4)), name="boss_height")
    assert [c.of for c in without_chance(program, [equal])] == [(Ref(1, "h"), Ref(3, "h"))]
    together = Constraint("equal", (Ref(3, "h"), Ref(4, "h")), name="boss_height")
    assert without_chance(program, [together]) == (together,)


def test_the_first_part_is_tied_to_those_that_are_as_large():
    """It is called a plate, and the others blocks."""
    bars = combine_all("union", [Primitive("box", (2.0, 50.0, 11.0), (x, 0.0, 0.0)) for x in (-15.0, 15.0)])
    equal = Constraint("equal", (Ref(0, "sx"), Ref(1, "sx")), name="plate_thickness")
    assert without_chance(bars, [equal]) == (equal,)
    other = combine_all("union", [bars.left, Primitive("box", (2.0, 40.0, 11.0), (15.0, 0.0, 0.0))])
    assert without_chance(other, [equal]) == ()


def test_a_boss_as_high_as_the_cavity_about_it_begins_with_that():
    """A ring, a cavity in it from below, and a boss of the cavity's height that stands in it."""
    ring, cavity = Primitive("cylinder", (28.0, 18.0), (0.0, 0.0, 9.0)), Primitive("cylinder", (20.0, 14.0), (0.0, 0.0, 7.0))
    boss = Primitive("cylinder", (8.0, 14.0), (0.0, 0.0, 7.0))
    program = Combine("union", Combine("difference", ring, cavity), boss)
    middle = Constraint("concentric", (Ref(1, ""), Ref(2, "")), name="middle")
    assert [(c.kind, c.of[0].feature) for c in without_chance(program, [middle])] == [("coaxial", "z"), ("coplanar", "-z")]
    part = delivered(program, [middle])
    assert "boss_height" not in part.values  # it ends in the floor of the cavity, where nobody sees it
    assert solid_of(change_values(part, {"hole_depth": 12.0})).bounding_box()[2] == 0.0


def test_of_three_as_high_each_begins_with_the_first():
    """A coplanar relation is of two faces."""
    rings = [Primitive("cylinder", (r, 20.0)) for r in (5.0, 8.0, 11.0)]
    middle = Constraint("concentric", tuple(Ref(i, "") for i in range(3)), name="middle")
    found = without_chance(combine_all("union", [*rings]), [middle])
    assert [(c.kind, len(c.of)) for c in found] == [("coaxial", 3), ("coplanar", 2), ("coplanar", 2)]


def test_a_bore_begins_and_ends_with_its_boss() -> None:
    boss, bore = Primitive("cylinder", (14.0, 24.0)), Primitive("cylinder", (8.0, 24.0))
    middle = Constraint("concentric", (Ref(0, ""), Ref(1, "")), name="middle")
    found = without_chance(Combine("difference", boss, bore), [middle])
    assert [(c.kind, c.of[0].feature, c.of[1].feature) for c in found] == [
        ("coaxial", "z", "z"),
        ("coplanar", "-z", "-z"),
        ("coplanar", "+z", "+z"),
    ]


def test_the_middle_of_what_goes_from_face_to_face_is_that_of_its_carrier():
    """A wing as high as the plate had a groove at half its height, and so the groove, not the plate, said how high the wing was."""
    plate, wing = Primitive("box", (40.0, 20.0, 12.0), (0.0, 0.0, 6.0)), Primitive("box", (8.0, 8.0, 12.0), (22.0, 0.0, 6.0))
    groove = Primitive("box", (20.0, 12.0, 3.0), (-15.0, 8.0, 6.0))
    step = Primitive("box", (14.0, 30.0, 9.0), (-20.0, 0.0, 12.0))
    program = Combine("difference", Combine("union", Combine("difference", plate, step), wing), groove)
    level = Constraint("aligned", (Ref(2), Ref(3)), about=Ref(WORLD, "z"), name="level")
    pairs = (Ref(1, "-z"), Ref(3, "+z")), (Ref(0, "-z"), Ref(2, "-z")), (Ref(0, "+z"), Ref(2, "+z"))
    flush = [Constraint("coplanar", pair, name=f"flush_{i}") for i, pair in enumerate(pairs)]
    after = change_values(delivered(program, [level, *flush]), {"body_height": 14.0})
    low, high = bounds_of(solid_of(after))
    assert (low[2], high[2]) == pytest.approx((0.0, 14.0))
    assert list(leaves(after.program))[2].size[2] == pytest.approx(14.0)
