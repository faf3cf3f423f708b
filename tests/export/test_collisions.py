"""What a tenth more would run into is measured from that: holes near edges and each other, windows, faces that miss a plane."""

import math

import pytest
from tests.deadlines import PASSED
from tests.export.test_outlines import opened

from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.export.elimination import LinearSystem
from imdim.export.parameters import parametrise
from imdim.export.spans import list_spans
from imdim.geometry.census import census_of
from imdim.geometry.solid import bounds_of
from imdim.program.codec import dumps, parse
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, leaves

RIM = ((-4.0, -10.0, 0.0), (4.0, -10.0, 0.0), (4.0, 10.0, 0.0), (0.0, 14.0, 0.0), (-4.0, 10.0, 0.0))


def _plate(*loops, thickness=3.0):
    return Primitive("extrude", (thickness,), outline=Outline(loops))


def _read(program, *constraints):
    """As `imdim edit` reads a program that is delivered already."""
    return open_delivered(parse(dumps(program, None, constraints)), {})


def _bounds(loop):
    xs, ys = [v[0] for v in loop], [v[1] for v in loop]
    return min(xs), max(xs), min(ys), max(ys)


def _rectangle(left, right, low, high):
    return ((left, low, 0.0), (right, low, 0.0), (right, high, 0.0), (left, high, 0.0))


def test_a_hole_near_the_end_of_a_plate_follows_that():
    """Holes 52 apart in a plate 60 long: one of 54 would cut through them."""
    part = opened(_plate(rectangle(60.0, 30.0).loops[0], circle(1.7, -26.0, 0.0), circle(1.7, 26.0, 0.0)))
    assert 4.0 in part.values.values()
    (edited,) = leaves(change_values(part, {"plate_length": 54.0}).program)
    _, right, _, _ = _bounds(edited.outline.loops[0])
    assert right == pytest.approx(27.0)
    assert sorted(sum(_bounds(loop)[:2]) / 2 for loop in edited.outline.loops[1:]) == pytest.approx([-23.0, 23.0])


def test_without_time_faces_are_not_kept_apart():
    plate = _plate(rectangle(60.0, 30.0).loops[0], circle(1.7, -26.0, 0.0), circle(1.7, 26.0, 0.0))
    assert 4.0 not in parametrise(plate, (), plate, deadline=PASSED).values.values()
    assert 4.0 in parametrise(plate, (), plate).values.values()


def test_holes_that_nothing_is_near_have_a_spacing():
    part = opened(_plate(rectangle(60.0, 30.0).loops[0], circle(1.7, -15.0, 0.0), circle(1.7, 15.0, 0.0)))
    assert part.values["plate_hole_spacing_x"] == 30.0


def test_a_hole_near_another_one_is_measured_from_that():
    part = opened(_plate(rectangle(40.0, 140.0).loops[0], circle(10.0, 0.0, 43.0), circle(1.5, 0.0, 28.0)))
    for name in part.values:
        for factor in (0.9, 1.1):
            assert census_of(solid_of(change_values(part, {name: factor * part.values[name]}))).kind == (1, 2, 0)


def test_a_window_near_an_edge_has_a_wall():
    """Not in the middle of the plate, so that no two of its edges mirror each other."""
    part = opened(_plate(_rectangle(-30.0, 30.0, -20.0, 20.0), _rectangle(-12.0, 27.0, -9.0, 4.0)))
    assert part.values["plate_wall_x"] == pytest.approx(3.0)
    (edited,) = leaves(change_values(part, {"plate_length": 66.0}).program)
    assert _bounds(edited.outline.loops[1])[1] == pytest.approx(30.0)


def test_what_misses_a_wall_by_a_hair_follows_it():
    """A rim that a fit put a fifth of a thousandth of a millimetre beside the end of its plate."""
    plate = _plate(_rectangle(-30.0, 30.0, -20.0, 20.0), thickness=6.0)
    rim = Primitive("extrude", (20.0,), (25.9998, -10.0, 5.0), outline=Outline((RIM,)))
    part = opened(Combine("union", plate, rim))
    first, second = leaves(change_values(part, {"plate_length": 66.0}).program)
    assert _bounds(first.outline.loops[0])[1] == pytest.approx(33.0)
    assert second.center[0] + _bounds(second.outline.loops[0])[1] == pytest.approx(32.9998)


def test_a_hole_of_another_leaf_near_an_edge_follows_that():
    """A hole that a cylinder cuts, 2 from a plate's end, and far from the world's origin: its place was a tenth of that off."""
    plate = _plate(_rectangle(-30.0, 30.0, -20.0, 20.0), thickness=6.0)
    tower = Primitive("box", (10.0, 10.0, 60.0), (-20.0, 0.0, 33.0))
    bore = Primitive("cylinder", (3.0, 80.0), (-20.0, 0.0, 58.0), (0.0, 90.0, 0.0))
    part = opened(Combine("difference", Combine("union", plate, tower), bore))
    assert 5.0 in part.values.values(), "from the top of the tower to its axis"
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            assert census_of(solid_of(change_values(part, {name: factor * value}))).kind == (1, 1, 0), name


def test_a_cut_that_leaves_a_thin_wall_before_another_one_ends_there():
    """Two pockets from both ends of a bar, with a wall of 1 between them: no tenth of a depth breaks through."""
    bar = Primitive("box", (80.0, 20.0, 20.0))
    left = Primitive("box", (50.0, 12.0, 12.0), (-24.0, 0.0, 0.0))
    right = Primitive("box", (50.0, 12.0, 12.0), (27.0, 0.0, 0.0))
    part = opened(Combine("difference", Combine("difference", bar, left), right))
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            assert census_of(solid_of(change_values(part, {name: factor * value}))).kind == (1, 0, 0), name


def test_a_distance_is_called_after_what_is_between():
    """A wall between two pockets, the air around a peg, and how far a bore's axis is from the end of what it goes through."""
    bar = Primitive("box", (80.0, 20.0, 20.0))
    left, right = (Primitive("box", (50.0, 12.0, 12.0), (x, 0.0, 0.0)) for x in (-24.0, 27.0))
    part = opened(Combine("difference", Combine("difference", bar, left), right))
    assert part.values["pocket2_wall_thickness"] == 1.0
    assert not [name for name in part.values if "gap" in name]

    ring = Combine("difference", Primitive("box", (12.0, 12.0, 2.0)), Primitive("box", (11.0, 11.0, 4.0)))
    part = opened(Combine("union", Primitive("box", (10.0, 10.0, 2.0)), ring))
    assert part.values["pocket_gap"] == 0.5

    tower = Primitive("box", (10.0, 10.0, 60.0), (-20.0, 0.0, 33.0))
    bore = Primitive("cylinder", (3.0, 80.0), (-20.0, 0.0, 58.0), (0.0, 90.0, 0.0))
    plate = _plate(_rectangle(-30.0, 30.0, -20.0, 20.0), thickness=6.0)
    part = opened(Combine("difference", Combine("union", plate, tower), bore))
    assert [name for name, value in part.values.items() if value == 5.0] == ["hole_edge_distance"]


def test_what_lies_in_the_top_of_a_plate_stays_there():
    """A ring groove about a screw, half in the air."""
    plate = Primitive("box", (60.0, 40.0, 12.0), (0.0, 0.0, 6.0))
    part = opened(Combine("difference", plate, Primitive("torus", (6.0, 2.0), (10.0, 0.0, 12.0))))
    thicker, groove = leaves(change_values(part, {"plate_thickness": 15.0}).program)
    assert groove.center[2] == pytest.approx(thicker.center[2] + 7.5)


def test_a_hole_that_all_but_fills_a_plate_leaves_a_wall():
    """A hole of 38 in a plate of 40: nobody measures that to its centre."""
    part = opened(_plate(rectangle(40.0, 40.0).loops[0], circle(19.0)))
    assert part.values["plate_wall_thickness"] == pytest.approx(1.0)
    assert part.values["plate_hole_diameter"] == 38.0
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            assert census_of(solid_of(change_values(part, {name: factor * value}))).kind == (1, 1, 0), name


def test_an_arc_that_bites_into_an_edge_stays_in_reach_of_it():
    """It does so by a twentieth of a millimetre: a tenth of any distance would part them."""
    side, half = 3.25, (3.3**2 - 3.25**2) ** 0.5
    rim = ((-30.0, -15.0, 0.0), (30.0, -15.0, 0.0), (30.0, -half, -math.tan(math.asin(half / 3.3) / 2)), (30.0, half, 0.0))
    part = opened(_plate((*rim, (30.0, 15.0, 0.0), (-30.0, 15.0, 0.0))))
    radius = next(name for name, value in part.values.items() if value == pytest.approx(3.3))
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            (edited,) = leaves(change_values(part, {name: factor * value}).program)
            if name != radius:
                chord = edited.outline.loops[0][3][1] - edited.outline.loops[0][2][1]
                assert (3.3**2 - chord**2 / 4) ** 0.5 == pytest.approx(side, abs=1e-3), name


def test_an_arc_with_a_centre_of_its_own_is_measured_to_that():
    """A bar ends in a disc of radius 12: to the disc's side, a larger radius would move what is measured from it."""
    x, half = math.sqrt(12.0**2 - 4.5**2), 4.5
    bulge = math.tan((math.pi - math.atan2(half, x)) / 4)
    bar = _plate(((x, -half, 0.0), (40.0, -half, 0.0), (40.0, half, 0.0), (x, half, bulge), (-12.0, 0.0, bulge)))
    system = LinearSystem.of(bar, ())
    arcs = [span for span in list_spans(system, bar) if span.axis == 0 and span.low[0] == pytest.approx(-12.0) and span.is_round]
    assert len(arcs) == 2
    assert all(at == pytest.approx(0.0, abs=1e-6) for span in arcs for at, _ in span.datums)


def test_what_an_outline_cuts_off_is_cut_off_still_when_that_grows():
    """A block and the outline that clips it, out of which it sticks by a fortieth of a millimetre."""
    block = Primitive("box", (40.0, 30.0, 20.05), (0.0, 0.0, 10.0))
    rim = ((-10.0, -30.0, 0.0), (10.0, -30.0, 0.0), (10.0, 12.0, 0.0), (7.0, 15.0, 0.0), (-10.0, 15.0, 0.0))
    clip = Primitive("extrude", (38.0,), (0.0, 0.0, 10.0), (0.0, -90.0, -90.0), Outline((rim,)))
    part = _read(Combine("intersection", block, clip))
    (name,) = (name for name, value in part.values.items() if value == pytest.approx(20.0))
    for value in (18.0, 22.0):
        low, high = bounds_of(solid_of(change_values(part, {name: value})))
        assert high[2] - low[2] == pytest.approx(value)


def test_what_follows_by_a_quarter_follows():
    """Two holes from both ends of a disc with a web between them: each ends at half of that, however thick the disc is."""
    disc = Primitive("cylinder", (30.0, 40.0))
    lower, upper = (Primitive("cylinder", (20.0, 29.5), (0.0, 0.0, side * 15.75)) for side in (-1, 1))
    mirrored = Constraint("symmetric", (Ref(1), Ref(2), Ref(0)), Ref(WORLD, "z"))
    flush = Constraint("coplanar", (Ref(0, "+z"), Ref(2, "+z")), None, 10.5)
    part = _read(Combine("difference", Combine("difference", disc, lower), upper), mirrored, flush)
    web = next(name for name, value in part.values.items() if value == pytest.approx(2.0))
    for name, value in part.values.items():
        changed = change_values(part, {name: 1.1 * value})
        low, high = (
            leaf.center[2] - side * leaf.size[1] / 2 for leaf, side in zip(list(leaves(changed.program))[1:], (-1, 1), strict=True)
        )
        assert high - low == pytest.approx(changed.values[web]), name


def test_a_hole_aslant_stays_below_a_groove():
    """By a millimetre, as seen along the vertical: how far a cylinder reaches there does not depend on which way it lies across."""
    block = Primitive("box", (60.0, 60.0, 40.0), (0.0, 0.0, 20.0))
    hole = Primitive("cylinder", (6.0, 100.0), (0.0, 0.0, 25.0), (0.0, 90.0, 60.0))
    groove = Primitive("box", (10.0, 70.0, 10.0), (0.0, 0.0, 37.0))
    part = _read(Combine("difference", Combine("difference", block, hole), groove))
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            assert census_of(solid_of(change_values(part, {name: factor * value}))).kind == (1, 1, 0), name
