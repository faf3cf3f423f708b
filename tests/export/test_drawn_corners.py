"""Outlines whose lines lean and whose arcs meet corners: what their names say, that what touched still touches, and who else reads them."""

import cmath
import math
import subprocess
from fractions import Fraction

import numpy as np
import pytest
from tests.export.test_outlines import SEGMENTS, interpreter, opened
from tests.export.test_parameters import rendered

from imdim.export.bends import regular_polygon, to_loop
from imdim.export.delivered import EditError, meanings
from imdim.export.drawn_vertex import BendRadius, DrawnVertex
from imdim.export.edit import change_values, solid_of
from imdim.export.numbers import Expression, Term
from imdim.export.parameters import Parameters, _share_corners
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.outline import Outline, arc_center, arc_radius, circle, loop_curves, reverse_loop
from imdim.program.regular_polygon import regular_of
from imdim.program.tree import Combine, Primitive, leaves


def wedge(round_=4.0, x=18.0, bow=40.0, sides=6, nut=3.0):
    """A triangle with one corner round, `x` beside another, one side bowed outwards, and a hexagon in it; each by its own formula."""
    a, b, c = np.array([-20.0, -12.0]), np.array([6.0 + x, -9.0]), np.array([6.0, 21.0])
    into, out = (p / np.linalg.norm(p) for p in (a - b, c - b))
    half = math.acos(into @ out) / 2
    middle = b + (into + out) / np.linalg.norm(into + out) * round_ / math.sin(half)
    ends = [b + into * (into @ (middle - b)), b + out * (out @ (middle - b))]
    bow_bulge = math.tan(math.asin(np.linalg.norm(a - c) / 2 / bow) / 2)
    turn = math.tan((math.pi - 2 * half) / 4)
    loop = ((*a, 0.0), (*ends[0], turn), (*ends[1], 0.0), (*c, bow_bulge))
    corners = [2 * math.pi * k / sides for k in range(sides)]
    hexagon = tuple((2 + nut * math.cos(t), 1 + nut * math.sin(t), 0.0) for t in corners)
    return Primitive("extrude", (5.0,), outline=Outline((as_floats(loop), reverse_loop(as_floats(hexagon)))))


def socket(width, x=0.0, sides=6):
    """A hole for a nut, which is `width` across flats."""
    corners = [cmath.rect(width / 2 / math.cos(math.pi / sides), 2 * math.pi * k / sides) for k in range(sides)]
    return reverse_loop(as_floats((x + c.real, c.imag, 0.0) for c in corners))


def as_floats(loop):
    return tuple(tuple(map(float, v)) for v in loop)


def snake(radius=6.0, other=9.0):
    """Two arcs that touch each other and a leaning line, closed by two more lines."""
    at, way, drawn = np.array([-20.0, 0.0]), math.radians(25), []
    for length, size, turn in ((12.0, 0.0, 0.0), (0.0, radius, 60.0), (0.0, other, -80.0)):
        bulge = math.tan(math.radians(turn) / 4)
        drawn.append((*at, bulge))
        half = math.radians(turn) / 2
        chord = length or 2 * size * abs(math.sin(half))
        at = at + chord * np.array([math.cos(way + half), math.sin(way + half)])
        way += 2 * half
    return Primitive("extrude", (5.0,), outline=Outline((as_floats([*drawn, (*at, 0.0), (17.0, -21.0, 0.0)]),)))


def web(radius=15.0, turn=80.0, width=10.0):
    """The web of a fillet: an arc from a bar's end that comes back along a wall that leans, by its circle."""
    wall, bar = (np.array([math.cos(t), math.sin(t)]) for t in (math.radians(230), math.radians(220)))
    touch = np.array([4.0, 9.0])
    center = touch + radius * np.array([-wall[1], wall[0]])
    away = touch - center
    start = center + np.array(turned(away, turn))
    loop = ((*(touch + 22 * wall), 0.0), (*(start + width * bar), 0.0), (*start, -math.tan(math.radians(turn) / 4)), (*touch, 0.0))
    return Primitive("extrude", (5.0,), outline=Outline((as_floats(loop),)))


def turned(v, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c * v[0] - s * v[1], s * v[0] + c * v[1]


def clamp(radius=4.0, slit=0.6, fillet=0.5):
    """A plate with a hole, off its middle, in which a slit ends; where they meet they are rounded."""
    x, y = 1.3, -0.7
    middle = np.array([-math.sqrt((radius + fillet) ** 2 - (slit + fillet) ** 2), slit + fillet])
    touch, beside = middle * radius / (radius + fillet), math.atan2(middle[1], -middle[0])
    fillets, hole = math.tan((math.pi / 2 - beside) / 4), -math.tan((2 * math.pi - 2 * beside) / 4)
    ends = [(-15.0, y + slit, 0.0), (x + middle[0], y + slit, fillets), (x + touch[0], y + touch[1], hole)]
    ends += [(x + touch[0], y - touch[1], fillets), (x + middle[0], y - slit, 0.0), (-15.0, y - slit, 0.0)]
    loop = ((15.0, -10.0, 0.0), (15.0, 10.0, 0.0), (-15.0, 10.0, 0.0), *ends, (-15.0, -10.0, 0.0))
    return Primitive("extrude", (5.0,), outline=Outline((as_floats(loop),)))


def lever(radius=9.0, end=4.0, x=30.0, slot=2.0):
    """What a belt about two pulleys bounds, a hole in the large one, and a slanted slot in it, by the normals of its straight sides."""
    far, belt = np.array([x, 12.0]), []
    distance, turned = np.linalg.norm(far), math.atan2(far[1], far[0])
    lean = math.acos((radius - end) / distance)
    normals = [np.array([math.cos(turned + t), math.sin(turned + t)]) for t in (-lean, lean)]
    for middle, size, (a, b), turn in (((0, 0), radius, normals[::-1], 2 * math.pi - 2 * lean), (far, end, normals, 2 * lean)):
        belt += [(*(np.array(middle) + size * a), math.tan(turn / 4)), (*(np.array(middle) + size * b), 0.0)]
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    ends = [7 * along - slot * across, 11 * along - slot * across, 11 * along + slot * across, 7 * along + slot * across]
    slotted = [(*p, float(i % 2)) for i, p in enumerate(ends)]
    return Primitive("extrude", (5.0,), outline=Outline((as_floats(belt), circle(3.0), as_floats(slotted))))


LEVER = {
    "plate_end_radius": ("radius", 8.0),
    "plate_end_radius_2": ("end", 5.0),
    "plate_slot_radius": ("slot", 1.5),
}


@pytest.mark.parametrize("name", LEVER)
def test_a_lever_is_round_about_its_ends(name):
    delivered = opened(lever())
    drawn, value = LEVER[name]
    after = change_values(delivered, {name: value})
    assert volume_iou(solid_of(after), to_manifold(lever(**{drawn: value}), SEGMENTS)) > 1 - 1e-7
    assert not any("corner" in known or "step" in known for known in delivered.values)


def test_a_pulley_within_the_other_has_no_belt():
    with pytest.raises(EditError, match=r"plate_end_radius = 37: line \d+: no line touches circles"):
        change_values(opened(lever()), {"plate_end_radius": 37.0})


def test_a_pulley_that_is_almost_within_the_other_is_told_without_a_belt():
    """A line touches both circles only just: of a tenth less between their centres it would touch none, and no edit could be made."""
    delivered = opened(lever(radius=36.0, end=4.0, x=33.0))
    for name, value in delivered.values.items():
        for factor in (0.9, 1.1):
            assert solid_of(change_values(delivered, {name: value * factor})).volume() > 0, name


def bends_between(outline):
    """By how much the loop turns at each vertex, in degrees."""
    curves = loop_curves(outline.loops[0])
    ends = [math.degrees(math.atan2(v - y, u - x)) for x, y, u, v, _ in curves]
    half = [math.degrees(2 * math.atan(b)) for *_, b in curves]
    return [math.remainder(ends[k] - half[k] - ends[k - 1] - half[k - 1], 360) for k in range(len(curves))]


WEDGE = {
    "plate_corner_radius": ("round_", 5.5),
    "plate_step_x": ("x", 21.0),
    "plate_arc_radius": ("bow", 33.0),
    "plate_sides": ("sides", 8),
    "plate_polygon_radius": ("nut", 3.5),
}


@pytest.mark.parametrize("name", WEDGE)
def test_a_name_changes_what_it_says(name):
    delivered = opened(wedge())
    drawn, value = WEDGE[name]
    assert delivered.values[name] == pytest.approx(wedge.__defaults__[wedge.__code__.co_varnames.index(drawn)])
    after = change_values(delivered, {name: value})
    assert volume_iou(solid_of(after), to_manifold(wedge(**{drawn: value}), SEGMENTS)) > 1 - 1e-7


def test_a_nut_is_measured_across_its_flats():
    """5.5 for M3, not the 3.175426 of its corners; of three or five sides none faces another."""

    def plate(width, sides=6):
        square = ((-10.0, -10.0, 0.0), (10.0, -10.0, 0.0), (10.0, 10.0, 0.0), (-10.0, 10.0, 0.0))
        return Primitive("extrude", (5.0,), outline=Outline((square, socket(width, 0.0, sides))))

    delivered = opened(plate(5.5))
    assert delivered.values["plate_across_flats"] == pytest.approx(5.5)
    assert not any("polygon_radius" in name for name in delivered.values)
    for sides in (6, 8):
        after = change_values(delivered, {"plate_across_flats": 6.0, "plate_sides": sides})
        assert volume_iou(solid_of(after), to_manifold(plate(6.0, sides), SEGMENTS)) > 1 - 1e-7
    assert "plate_polygon_radius" in opened(plate(5.5, 5)).values
    assert "plate_polygon_radius" in opened(plate(2 * 3.35 * math.cos(math.pi / 6))).values, "its corners have the rounder number"


def test_each_freedom_of_the_outline_has_one_name():
    """Three corners, a rounding and a bow; the hexagon has a place, sides and a radius, and stands as everyone draws it."""
    values = opened(wedge()).values
    corners = {"plate_corner_x", "plate_corner_x_2", "plate_corner_y", "plate_corner_y_2", "plate_step_y"}
    assert set(values) == {"plate_thickness", "plate_hole_x", "plate_hole_y", *WEDGE, *corners}


def test_small_things_far_from_the_middle_move_whole():
    """A notch near a corner is told by steps, each from the nearest place."""
    delivered = opened(
        Primitive("extrude", (5.0,), outline=Outline((((-25.0, -9.0, 0.0), (31.0, -8.0, 0.0), (30.0, 10.0, 0.3), (28.5, 11.0, 0.0)),)))
    )
    assert (delivered.values["plate_step_x"], delivered.values["plate_step_x_2"]) == (1.5, 1.0)
    before, after = (d.program.outline.loops[0] for d in (delivered, change_values(delivered, {"plate_corner_x_2": 32.5})))
    assert [b[0] - a[0] for a, b in zip(before, after, strict=True)] == pytest.approx([0, 4, 4, 4])


def test_a_step_that_nobody_would_measure_has_no_name():
    """Two corners of a kite lie half a micron off each other: what moves one of them moves the other."""
    ring = ((-30.0, -3.0, 0.0), (2.0, -15.0, 0.0), (25.0, 4.0, 0.0), (5.0, 17.0, 0.0), (-4.0, 17.0005, 0.0))
    delivered = opened(Primitive("extrude", (5.0,), outline=Outline((ring,))))
    assert min(map(abs, delivered.values.values())) > 0.1
    outline = next(iter(leaves(change_values(delivered, {"plate_step_y_2": 16.0}).program))).outline
    assert sorted(y for _, y, _ in outline.loops[0])[-2:] == pytest.approx([20.0, 20.0005])


def test_a_polygon_needs_whole_sides():
    delivered = opened(wedge())
    with pytest.raises(EditError, match=r"plate_sides = 6.5: .* a polygon needs a whole number of 3 or more sides, got 6.5"):
        change_values(delivered, {"plate_sides": 6.5})
    assert meanings(delivered)["plate_sides"] == "moves drawing of plate #0"


def test_arcs_that_touch_still_touch_after_an_edit():
    delivered = opened(snake())
    assert bends_between(delivered.program.outline)[1:3] == pytest.approx([0, 0], abs=1e-5)
    text = delivered.texts["program.scad"]
    assert text.count('"before"]') == 2
    for name in delivered.values:
        if "corner" in name or "step" in name:
            after = change_values(delivered, {name: 1.06 * delivered.values[name]}).program.outline
            assert after != delivered.program.outline
            assert bends_between(after)[1:3] == pytest.approx([0, 0], abs=1e-5)


def test_an_arc_that_comes_back_along_a_wall_does_so_after_an_edit():
    delivered = opened(web())
    assert delivered.texts["program.scad"].count('"cusp after"]') == 1
    before = delivered.program.outline
    assert abs(bends_between(before)[3]) == pytest.approx(180)
    for name in (name for name in delivered.values if "corner" in name or "step" in name):
        for factor in (0.9, 1.1):
            after = change_values(delivered, {name: factor * delivered.values[name]}).program.outline
            assert after != before
            assert abs(bends_between(after)[3]) == pytest.approx(180, abs=1e-5)


def test_a_hole_in_which_a_slit_ends_has_a_radius_and_stays_round():
    delivered = opened(clamp())
    assert delivered.values["plate_arc_radius"] == pytest.approx(4.0)

    def hole(values):
        arc = max(loop_curves(change_values(delivered, values).program.outline.loops[0]), key=lambda c: abs(c[4]))
        return [*arc_center(arc), arc_radius(arc)]

    others = [name for name in delivered.values if "arc" not in name and "round" not in name]
    for name in others:
        for factor in (0.9, 1.1):
            assert hole({name: factor * delivered.values[name]}) == pytest.approx([1.3, -0.7, 4.0], abs=1e-5), name
    assert hole({"plate_arc_radius": 4.4, "plate_round_x": 1.0}) == pytest.approx([1.0, -0.7, 4.4], abs=1e-5)


def test_an_eye_lies_about_its_hole():
    """Its centre is as exact as the digits of its ends, which are fewer than those of the hole's."""
    off, (x, y) = 1e-4, (-35.0, -6.0)
    start, end = ((x + 5 * math.cos(t), y + 5 * math.sin(t)) for t in (math.radians(80), math.radians(300)))
    corner = end[0] + 25 * math.cos(math.radians(30)), end[1] + 25 * math.sin(math.radians(30))
    arm = ((20.0, 12.0, 0.0), (*start, math.tan(math.radians(220) / 4)), (*end, 0.0), (*corner, 0.0), (20.0, 5.0, 0.0))
    delivered = opened(Primitive("extrude", (5.0,), outline=Outline((arm, circle(2.0, x + off, y)))))
    assert not [name for name in delivered.values if "round" in name]
    after = change_values(delivered, {"plate_hole_x": -33.0, "plate_arc_radius": 5.5}).program.outline
    arc = max(loop_curves(after.loops[0]), key=lambda c: abs(c[4]))
    assert [*arc_center(arc), arc_radius(arc)] == pytest.approx([-33.0 - off, y, 5.5], abs=1e-5)


@pytest.mark.parametrize("degrees", [140, 220])
def test_an_eye_goes_along_with_the_post_of_another_feature(degrees):
    """Its centre, as fitted, misses the axis of the post by a hundredth of a millimetre."""
    off, (x, y) = 0.01, (-35.0, -6.0)
    start, end = ((x + 5 * math.cos(t), y + 5 * math.sin(t)) for t in (math.radians(80), math.radians(80 + degrees)))
    arm = ((20.0, 12.0, 0.0), (*start, math.tan(math.radians(degrees) / 4)), (*end, 0.0), (19.0, -17.0, 0.0))
    post = Primitive("extrude", (9.0,), (x + off, y, 2.0), outline=Outline((circle(4.0),)))
    delivered = opened(Combine("union", Primitive("extrude", (5.0,), outline=Outline((arm,))), post))
    for name, value in delivered.values.items():
        for factor in (0.9, 1.1):
            plate, other = leaves(change_values(delivered, {name: factor * value}).program)
            arc = max(loop_curves(plate.outline.loops[0]), key=lambda c: abs(c[4]))
            centre = np.array(arc_center(arc)) + plate.center[:2]
            assert np.array(other.center[:2]) - centre == pytest.approx([off, 0.0], abs=1e-3), name
            assert name.endswith("arc_radius") or arc_radius(arc) == pytest.approx(5.0, abs=1e-3), name


def test_an_arc_that_is_too_short_for_its_ends_is_refused():
    with pytest.raises(EditError, match=r"plate_arc_radius = 15: line \d+: an arc of radius 15 does not span 42.0119"):
        change_values(opened(wedge()), {"plate_arc_radius": 15.0})


@pytest.mark.parametrize(
    ("arcs", "message"),
    [
        (["before", "before", "before", "before"], "touches its neighbour"),
        ([(2.0,), 0.0, 0.0, 0.0], "rounds a corner that stands at both its ends"),
        ([(8.0, 2.0), 0.0, 0.0, 0.0], "counter-clockwise or clockwise, not 2"),
        ([(0.0, 0.0, 1.0), 0.0, 0.0, 0.0], "ends in its centre"),
    ],
)
def test_what_no_arc_can_be_is_refused(arcs, message):
    corners = [(0.0, 0.0), (10.0, 1.0), (9.0, 8.0), (-1.0, 7.0)]
    with pytest.raises(ValueError, match=message):
        to_loop([(*corner, arc) for corner, arc in zip(corners, arcs, strict=True)])


def test_bends_draw_what_they_say():
    """The centre and the radius of each arc, and what touches, measured on the loop."""
    loop = to_loop([(0.0, 0.0, 0.0), (10.0, 0.0, "before"), (10.0, 8.0, (6.0, -1)), (0.0, 9.0, (-3.0, 4.5, 1)), (0.0, 0.0, "after")][:-1])
    curves = loop_curves(loop)
    assert arc_center(curves[1]) == pytest.approx((10.0, 4.0))
    assert (arc_radius(curves[2]), curves[2][4] < 0) == (pytest.approx(6.0), True)
    assert arc_center(curves[3]) == pytest.approx((-3.0, 4.5))


@pytest.mark.parametrize("sides", [3, 5, 6, 12])
def test_a_regular_polygon_is_known_either_way_round(sides):
    loop = regular_polygon(sides, 4.0, 1.0, -2.0, 10.0)
    for run in (loop, reverse_loop(loop), loop[2:] + loop[:2]):
        found = regular_of(run, 1e-7)
        assert (found.sides, found.radius, found.angle) == (sides, pytest.approx(4.0), pytest.approx(10.0))
    assert regular_of((*loop[:-1], (loop[-1][0] + 1e-3, *loop[-1][1:])), 1e-7) is None


def test_a_turned_outline_has_no_number_but_names_wherever_it_begins():
    def spool(low, high):
        section = ((0.0, low, 0.0), (9.0, low, 0.0), (6.0, low + 4, 0.0), (6.0, high, 0.0), (0.0, high, 0.0))
        return Primitive("revolve", (360.0,), (0.0, 0.0, 10.0), outline=Outline((section,)))

    middle, off = opened(spool(-8.0, 8.0)), opened(spool(-8.0, 10.0))
    assert "-turned_part_height/2 + turned_part_level" in middle.texts["program.scad"]
    assert off.values.keys() == middle.values.keys()
    for delivered in (middle, off):
        taller = solid_of(change_values(delivered, {"turned_part_height": 20.0})).bounding_box()
        assert (taller[2], taller[5]) == pytest.approx((2.0, 22.0))


def test_sections_of_a_turned_part_are_as_long_as_they_are():
    """Each from the end that is nearer, or from the section before: what is changed by a tenth runs into nothing."""
    levels = (0.0, 4.0, 5.0, 9.0, 15.0, 17.0, 20.0)
    section = [(0.0, levels[0] - 10), *((r, y - 10) for r, y in zip((9, 8, 7, 6, 5, 4, 3), levels, strict=True)), (0.0, levels[-1] - 10)]
    shaft = Primitive("revolve", (360.0,), outline=Outline((tuple((float(x), y, 0.0) for x, y in section),)))
    delivered = opened(shaft)
    names = ("level", "step", "step_2", "depth", "step_3", "height")
    assert [delivered.values[f"turned_part_{name}"] for name in names] == pytest.approx([4, 1, 4, 3, 2, 20])
    longer = change_values(delivered, {"turned_part_level": 4.4}).program.outline.loops[0]
    assert sorted({y for _, y, _ in longer}) == pytest.approx([-10, -5.6, -4.6, -0.6, 5, 7, 10])


def test_a_window_that_reaches_from_side_to_side_has_a_wall():
    def frame(length, wall):
        sides = [(x, y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        loops = [tuple((x * (length / 2 - w), y * (20.0 - w), 0.0) for x, y in sides) for w in (0.0, wall)]
        return Primitive("extrude", (5.0,), outline=Outline(tuple(loops)))

    delivered = opened(frame(60.0, 2.0))
    for values, drawn in (({"plate_length": 50.0}, frame(50.0, 2.0)), ({"plate_wall_x": 3.0, "plate_wall_y": 3.0}, frame(60.0, 3.0))):
        assert volume_iou(solid_of(change_values(delivered, values)), to_manifold(drawn, SEGMENTS)) > 1 - 1e-9


def eared(radius=9.0):
    """A bar with two ears, mirror images of each other, that end in an arc between leaning lines; both pinned."""

    def pinned(side):
        chord = math.dist((8.0, -5.0), (9.0, 6.0))
        loop = ((-12.0, -7.0, 0.0), (8.0, -5.0, math.tan(math.asin(chord / 2 / radius) / 2)), (9.0, 6.0, 0.0), (-12.0, 4.0, 0.0))
        drawn = Outline((loop,))
        ear = Primitive("extrude", (6.0,), (side * 40.0, 0.0, 0.0), outline=drawn if side > 0 else drawn.mirror())
        return Combine("difference", ear, Primitive("cylinder", (1.0, 20.0), (side * 35.0, 0.0, 0.0)))

    return Combine("union", Primitive("box", (60.0, 8.0, 6.0)), Combine("union", pinned(1), pinned(-1)))


def test_mirror_images_are_edited_together():
    delivered = opened(eared())
    assert delivered.folded is not None
    after = change_values(delivered, {"profile_arc_radius": 7.0})
    assert volume_iou(solid_of(after), to_manifold(eared(7.0), SEGMENTS)) > 1 - 1e-6


# --- other readers


def every_bend():
    """All that a text may say of arcs: in the wedge, in the snake behind it, in a disc with two flats, one upright, and in the lever;
    and a hexagon that is measured from side to side."""
    a, b, middle = (math.radians(t) for t in (20, 70, 225))
    ends = [(10 * math.cos(t), 10 * math.sin(t)) for t in (a, b, middle)]
    wide = math.tan((middle - b) / 4)
    disc = Outline((((*ends[0], 0.0), (ends[0][0], 6.0, 0.0), (*ends[1], wide), (*ends[2], wide)), circle(3.0), socket(3.0, -6.0)))
    parts = [
        Primitive("extrude", (5.0,), (40.0, 0.0, 1.0), outline=snake().outline),
        Primitive("extrude", (5.0,), (-45.0, 0.0, 1.0), outline=disc),
    ]
    beside = Primitive("extrude", (5.0,), (0.0, 50.0, 1.0), outline=lever().outline)
    below = Primitive("extrude", (5.0,), (0.0, -50.0, 1.0), outline=web().outline)
    return Combine("union", Combine("union", Combine("union", wedge(), parts[0]), Combine("union", parts[1], beside)), below)


EDITED = {
    "plate_sides": 5,
    "plate_corner_radius": 5.5,
    "profile_corner_y_2": 17.0,
    "profile2_arc_angle": 150.0,
    "profile3_end_radius": 10.0,
    "profile4_corner_x": -4.5,
    "profile2_across_flats": 4.0,
}


def test_openscad_draws_every_bend(tmp_path):
    delivered = opened(every_bend())
    text = delivered.texts["program.scad"]
    assert all(
        said in text
        for said in (
            "ngon(",
            "across_flats(profile2_sides, profile2_across_flats, ",
            "[plate_corner_radius]",
            '"before"',
            '"cusp after"',
            "bend(profile2_arc_angle)",
            "[plate_arc_radius, 1]",
        )
    )
    for values in ({}, EDITED):
        mesh = rendered(text, tmp_path, *(f"{name}={value}" for name, value in values.items()))
        ours = solid_of(change_values(delivered, values) if values else delivered)
        assert volume_iou(mesh_to_manifold(mesh), ours) > 1 - 1e-5


@pytest.mark.tool
@pytest.mark.parametrize(("package", "file"), [("build123d", "program.py"), ("cadquery", "program.cq.py")])
@pytest.mark.parametrize("values", [{}, EDITED])
def test_scripts_draw_every_bend(package, file, values, tmp_path):
    python = interpreter(package)
    pytest.importorskip("OCP", reason="the extra [step] is not installed")
    from imdim.export.step import read_step, shape_volume

    delivered = opened(every_bend())
    after = change_values(delivered, values) if values else delivered
    (tmp_path / file).write_text(after.texts[file])
    subprocess.run([python, file], check=True, cwd=tmp_path, timeout=120, capture_output=True)
    wanted = to_manifold(after.program, 4096).volume()
    assert shape_volume(read_step(tmp_path / "part.step"), 1e-9) == pytest.approx(wanted, rel=2e-6)


def test_both_ends_of_a_rounded_corner_are_written_alike() -> None:
    # two ways to the same corner that differ by less than the text's digits
    values = {"length": 15.0000004, "corner_x": -7.4999984507, "top": 19.2}
    named, whole = Fraction(1), Expression((), 0.0)
    corner = Expression((Term("corner_x", named),), 0.0)
    wall = Expression((Term("length", -named / 2),), 7.5000002 - 7.4999984507 + 1e-10)
    top = Expression((Term("top", named),), 0.0)
    loop = (
        DrawnVertex(whole, whole, 0.0),
        DrawnVertex(corner, top, BendRadius(Expression((), 3.0), 0)),
        DrawnVertex(wall, top, 0.0),
        DrawnVertex(whole, top, 0.0),
    )
    shared = _share_corners(Parameters(values, outlines=((loop,),)))
    assert shared.outlines[0][0][1].x == shared.outlines[0][0][2].x == wall
    assert "corner_x" not in shared.values
