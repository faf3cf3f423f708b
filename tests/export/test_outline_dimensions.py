"""What the numbers of outlines are called, what follows them, and which edits are refused."""

import subprocess
from math import asin, sqrt, tan

import numpy as np
import pytest
from tests.export.test_outlines import SEGMENTS, interpreter, opened
from tests.export.test_parameters import rendered

from imdim.export.delivered import EditError, meanings
from imdim.export.edit import change_values, solid_of
from imdim.export.numbers import round_program
from imdim.geometry.census import census_of
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.outline import Outline, arc_center, arc_radius, circle, ring_curves
from imdim.program.tree import Combine, Primitive, leaves

QUARTER = tan(np.pi / 8)  # the bulge of a quarter turn


def rounded(width, height, radius):
    x, y, a, b = width / 2, height / 2, width / 2 - radius, height / 2 - radius
    ends = [(-a, -y), (a, -y), (x, -b), (x, b), (a, y), (-a, y), (-x, b), (-x, -b)]
    return tuple((u, v, QUARTER if i % 2 else 0.0) for i, (u, v) in enumerate(ends))


def slot(length, radius):
    x = length / 2
    return ((-x, -radius, 0.0), (x, -radius, 1.0), (x, radius, 0.0), (-x, radius, 1.0))


def plate(length=60.0, width=40.0, corner=8.0, hole=2.5, across=48.0, up=28.0, spacing=10.0, end=3.0, thickness=8.0, chamfer=5.0):
    """A plate with round corners, four holes, countersunk at one, and a slot; on it a block with a chamfered corner."""
    holes = [circle(hole, x, y) for x in (-across / 2, across / 2) for y in (-up / 2, up / 2)]
    base = Primitive("extrude", (thickness,), outline=Outline((rounded(length, width, corner), *holes, slot(spacing, end))))
    block = Primitive(
        "extrude",
        (6.0,),
        (0.0, 14.0, thickness / 2 + 3.0),
        outline=Outline((((-9, -3, 0), (9 - chamfer, -3, 0), (9, -3 + chamfer, 0), (9, 3, 0), (-9, 3, 0)),)),
    )
    sink = Primitive("cone", (hole, 5.0, 2.0), (across / 2, up / 2, thickness / 2 - 1.0))
    return Combine("difference", Combine("union", base, block), sink)


NAMED = {
    "plate_length": ("length", 66.0),
    "plate_width": ("width", 44.0),
    "plate_corner_radius": ("corner", 6.0),
    "plate_hole_diameter": ("hole", 6.0),
    "plate_hole_spacing_x": ("across", 44.0),
    "plate_hole_spacing_y": ("up", 30.0),
    "plate_round_spacing_x": ("spacing", 16.0),
    "plate_slot_radius": ("end", 2.0),
    "plate_thickness": ("thickness", 12.0),
    "profile_chamfer": ("chamfer", 4.0),
}


@pytest.mark.parametrize("name", NAMED)
def test_a_dimension_of_an_outline_changes_what_it_says_and_what_stands_there(name):
    """Holes keep their countersinks, and what stands on the plate stays on it."""
    drawn, value = NAMED[name]
    after = solid_of(change_values(opened(plate()), {name: value}))
    value = value / 2 if drawn == "hole" else value
    # a countersink that sticks out by a constant changes its slope a little with its lower radius
    slack = 3e-4 if drawn == "hole" else 1e-6
    assert volume_iou(after, to_manifold(plate(**{drawn: value}), SEGMENTS)) > 1 - slack


def test_openscad_draws_the_edited_outline(tmp_path):
    delivered = opened(plate())
    text = delivered.texts["program.scad"]
    assert "ring(plate_hole_diameter/2, plate_hole_spacing_x/2, plate_hole_spacing_y/2)" in text
    mesh = rendered(text, tmp_path, "plate_corner_radius=6", "plate_slot_radius=2")
    assert volume_iou(mesh_to_manifold(mesh), to_manifold(plate(corner=6.0, end=2.0), SEGMENTS)) > 1 - 1e-5


def angle_bracket(holes=()):
    """A foot of 8 and a back of 12, about the middle of their box."""
    ring = ((-30, -20, 0), (30, -20, 0), (30, -12, 0), (-18, -12, 0), (-18, 20, 0), (-30, 20, 0))
    return Primitive("extrude", (25.0,), outline=Outline((as_floats(ring), *holes)))


def as_floats(ring):
    return tuple(tuple(map(float, vertex)) for vertex in ring)


def test_where_nothing_lies_about_the_middle_walls_are_measured_from_the_ends():
    delivered = opened(angle_bracket())
    assert sorted(delivered.values.values()) == [8.0, 12.0, 25.0, 40.0, 60.0]
    thicker = next(name for name, value in delivered.values.items() if value == 8.0)
    low, high = np.reshape(solid_of(change_values(delivered, {thicker: 10.0})).bounding_box(), (2, 3))
    assert (high - low).tolist() == pytest.approx([60.0, 40.0, 25.0])


def test_where_holes_lie_about_the_middle_walls_are_measured_from_that():
    delivered = opened(angle_bracket((circle(2.0, -10.0, -16.0), circle(2.0, 10.0, -16.0))))
    assert -18.0 in delivered.values.values()
    assert 20.0 in delivered.values.values()  # from hole to hole


def test_every_vertex_follows_names_alone():
    """No free number is left where lines run along the axes and arcs touch them."""
    text = opened(plate()).texts["program.scad"]
    drawn = text[text.index("outline([\n") :].split("]);")[0].replace("0.414213562", "").replace("/2", "").replace(", 1]", "]")
    assert not any(c.isdigit() for c in drawn.replace("_2", ""))


def test_meanings_say_which_drawings_follow():
    said = meanings(opened(plate()))
    assert said["plate_hole_diameter"].startswith("diameter at the bottom of countersink #2;")
    assert "drawing of plate #0" in said["plate_hole_diameter"]
    assert said["plate_corner_radius"] == "moves drawing of plate #0"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"plate_hole_diameter": 60.0}, "plate_hole_diameter = 60: primitive 0: .* cross"),
        ({"plate_corner_radius": 25.0}, "plate_corner_radius = 25: primitive 0: .* cross"),
        ({"plate_corner_radius": 0.0}, "plate_corner_radius needs a positive number, got 0"),
    ],
)
def test_an_edit_that_crosses_is_refused_in_one_line(values, message):
    with pytest.raises(EditError, match=message):
        change_values(opened(plate()), values)


def disc_and_bar(radius=12.0, width=9.0, reach=40.0, end=4.5):
    """A disc and a bar that ends round, in one outline: the disc's arc crosses the bar's sides."""
    x, half = float(np.sqrt(radius**2 - (width / 2) ** 2)), width / 2
    turn = 2 * np.pi - 2 * np.arctan2(half, x)
    far, bulge = (-radius, 0.0), tan(turn / 8)
    return Outline((((x, -half, 0.0), (reach, -half, 1.0), (reach, half, 0.0), (x, half, bulge), (*far, bulge)), circle(5.0)))


@pytest.mark.parametrize(("name", "drawn", "value"), [("plate_end_radius", "width", 3.5), ("plate_arc_radius", "radius", 14.0)])
def test_where_an_arc_crosses_a_line_follows_both(name, drawn, value):
    delivered = opened(Primitive("extrude", (5.0,), outline=disc_and_bar()))
    wanted = disc_and_bar(**{drawn: 2 * value if drawn == "width" else value})
    after = change_values(delivered, {name: value})
    assert volume_iou(solid_of(after), to_manifold(Primitive("extrude", (5.0,), outline=wanted), SEGMENTS)) > 1 - 1e-4
    assert "reach(" in delivered.texts["program.scad"]


def test_openscad_reads_centres_and_reaches(tmp_path):
    def part(**drawn):
        return Combine(
            "union", Primitive("extrude", (5.0,), outline=disc_and_bar(**drawn)), Primitive("box", (4.0, 4.0, 4.0), (30.0, 0.0, 4.0))
        )

    delivered = opened(part())
    for define, wanted in (([], part()), (["plate_arc_radius=14"], part(radius=14.0))):
        mesh = rendered(delivered.texts["program.scad"], tmp_path, *define)
        assert volume_iou(mesh_to_manifold(mesh), to_manifold(wanted, SEGMENTS)) > 1 - 1e-3


def test_an_arc_that_no_longer_meets_its_line_is_refused():
    delivered = opened(Primitive("extrude", (5.0,), outline=disc_and_bar()))
    with pytest.raises(EditError, match=r"plate_arc_radius = 3: .* a circle of radius 3 does not meet a line 4\.5 from its centre"):
        change_values(delivered, {"plate_arc_radius": 3.0})


def test_a_turned_part_grows_upwards():
    profile = Outline((((0.0, -10.0, 0.0), (12.0, -10.0, 0.0), (12.0, -4.0, 0.0), (6.0, -4.0, 0.0), (6.0, 10.0, 0.0), (0.0, 10.0, 0.0)),))
    delivered = opened(Primitive("revolve", (360.0,), (0.0, 0.0, 10.0), outline=profile))
    low, high = (solid_of(change_values(delivered, {"turned_part_height": 26.0})).bounding_box()[i] for i in (2, 5))
    assert (low, high) == pytest.approx((0.0, 26.0))


def test_a_turned_part_has_diameters_and_heights():
    profile = Outline((((0.0, -10.0, 0.0), (12.0, -10.0, 0.0), (12.0, -4.0, 0.0), (6.0, -4.0, 0.0), (6.0, 10.0, 0.0), (0.0, 10.0, 0.0)),))
    delivered = opened(Primitive("revolve", (360.0,), outline=profile))
    assert {n: v for n, v in delivered.values.items() if "diameter" in n} == {"turned_part_diameter": 24.0, "turned_part_diameter_2": 12.0}
    after = change_values(delivered, {"turned_part_diameter_2": 10.0})
    wanted = Outline(tuple(tuple((5.0 if x == 6.0 else x, y, b) for x, y, b in loop) for loop in profile.loops))
    assert volume_iou(solid_of(after), to_manifold(Primitive("revolve", (360.0,), outline=wanted), SEGMENTS)) > 1 - 1e-6


def ears(height=8.0, radius=6.0):
    """A bar with a pair of ears, mirror images of each other: a hole, a slanted corner, and an arc that crosses two edges."""

    def ear(side):
        low, top, reach = -height / 2, height / 2, float(np.sqrt(radius**2 - 4.0))
        arc = tan(np.arctan2(2.0, reach) / 2)
        drawn = Outline(
            (
                (
                    (-12.0, low, 0.0),
                    (-1.0, low, 0.0),
                    (0.0, low + 1, 0.0),
                    (0.0, -2.0, 0.0),
                    (reach, -2.0, arc),
                    (reach, 2.0, 0.0),
                    (0.0, 2.0, 0.0),
                    (0.0, top, 0.0),
                    (-12.0, top, 0.0),
                ),
            )
        )
        return Primitive("extrude", (6.0,), (side * 40.0, 0.0, 0.0), outline=drawn if side > 0 else drawn.mirror())

    def pinned(side):
        return Combine("difference", ear(side), Primitive("cylinder", (1.0, 20.0), (side * 35.0, 0.0, 0.0)))

    return Combine("union", Primitive("box", (60.0, 7.0, 6.0)), Combine("union", pinned(1), pinned(-1)))


@pytest.mark.parametrize(("name", "drawn", "value"), [("profile_width", "height", 10.0), ("profile_arc_radius", "radius", 7.0)])
def test_mirror_images_are_edited_together(name, drawn, value):
    delivered = opened(ears())
    assert delivered.folded is not None
    after = solid_of(change_values(delivered, {name: value}))
    assert volume_iou(after, to_manifold(ears(**{drawn: value}), SEGMENTS)) > 1 - 1e-4


def test_a_pocket_keeps_its_depth_and_a_boss_its_height_on_a_thicker_plate():
    def part(thickness):
        base = Primitive("box", (60.0, 40.0, thickness), (0.0, 0.0, thickness / 2))
        boss = Primitive("cylinder", (6.0, 10.0), (15.0, 0.0, thickness + 4.0))
        pocket = Primitive("box", (20.0, 20.0, 5.0), (-15.0, 0.0, thickness - 1.5))
        return Combine("difference", Combine("union", base, boss), pocket)

    delivered = opened(part(8.0))
    assert delivered.values["boss_height"] == pytest.approx(9.0)
    assert delivered.values["pocket_depth"] == pytest.approx(4.0)
    after = solid_of(change_values(delivered, {"plate_thickness": 12.0}))
    assert volume_iou(after, to_manifold(part(12.0), SEGMENTS)) > 1 - 1e-6


def test_a_cut_does_not_follow_what_it_never_enters():
    """A block above the pocket is not what the pocket's floor follows."""
    base, block = Primitive("box", (60.0, 40.0, 8.0)), Primitive("box", (40.0, 30.0, 3.0), (0.0, 0.0, 9.0))
    pocket = Primitive("box", (20.0, 20.0, 3.5), (0.0, 0.0, 2.75))
    delivered = opened(Combine("difference", Combine("union", base, block), pocket))
    line = next(line for line in delivered.texts["program.scad"].splitlines() if "pocket" in line and "cube" in line)
    assert "block" not in line


@pytest.mark.tool
@pytest.mark.parametrize(("package", "file"), [("build123d", "program.py"), ("cadquery", "program.cq.py")])
def test_scripts_draw_what_the_names_say(package, file, tmp_path):
    python = interpreter(package)
    pytest.importorskip("OCP", reason="the extra [step] is not installed")
    from imdim.export.step import read_step, shape_volume

    program = Primitive("extrude", (5.0,), outline=disc_and_bar())
    after = change_values(opened(program), {"plate_arc_radius": 14.0})
    (tmp_path / file).write_text(after.texts[file])
    subprocess.run([python, file], check=True, cwd=tmp_path, timeout=120, capture_output=True)
    wanted = to_manifold(Primitive("extrude", (5.0,), outline=disc_and_bar(radius=14.0)), 2048).volume()
    assert shape_volume(read_step(tmp_path / "part.step"), 1e-9) == pytest.approx(wanted, rel=1e-5)


def test_a_flat_arc_is_where_its_apex_is():
    """A plate with a crown of radius 100: a larger radius makes it flatter and leaves its top where it is."""
    side = sqrt(100.0**2 - 10.0**2) - 88.0  # where the circle about (0, -88) crosses the sides
    bulge = tan(asin(0.1) / 2)
    crown = ((-10.0, -12.0, 0.0), (10.0, -12.0, 0.0), (10.0, side, bulge), (-10.0, side, 0.0))
    part = opened(Primitive("extrude", (4.0,), outline=Outline((crown,))))
    assert 88.0 not in map(abs, part.values.values())
    names = {name.split("_", 1)[1]: name for name in part.values}
    assert part.values[names["apex_y"]] == pytest.approx(12.0)
    (flatter,) = leaves(change_values(part, {names["arc_radius"]: 200.0}).program)
    assert flatter.outline.bounds[1][1] + flatter.center[1] == pytest.approx(12.0)
    assert flatter.outline.loops[0][2][1] + flatter.center[1] == pytest.approx(sqrt(200.0**2 - 10.0**2) - 188.0)


def test_a_flat_arc_that_ends_before_its_apex_is_where_that_is():
    """Half of that crown: a radius of nine tenths about the same centre would not reach its sides."""
    high, low = (sqrt(100.0**2 - x**2) - 88.0 for x in (2.0, 10.0))
    bulge = tan((asin(0.1) - asin(0.02)) / 4)
    crown = ((2.0, -12.0, 0.0), (10.0, -12.0, 0.0), (10.0, low, bulge), (2.0, high, 0.0))
    part = opened(Primitive("extrude", (4.0,), outline=Outline((crown,))))
    names = {name.split("_", 1)[1]: name for name in part.values}
    assert part.values[names["apex_y"]] == pytest.approx(12.0)
    (flatter,) = leaves(change_values(part, {names["arc_radius"]: 200.0}).program)
    assert flatter.outline.loops[0][2][1] + flatter.center[1] == pytest.approx(sqrt(200.0**2 - 10.0**2) - 188.0)
    change_values(part, {names["arc_radius"]: 90.0})


def test_a_pocket_for_a_nut_stays_about_its_hole():
    holes = [circle(1.7, x, y) for x in (-16.0, 16.0) for y in (-16.0, 16.0)]
    corners = [(3.35 * np.cos(k * np.pi / 3), 3.35 * np.sin(k * np.pi / 3)) for k in range(6)]
    nuts = [tuple((x + u, y + v, 0.0) for u, v in corners) for x in (-16.0, 16.0) for y in (-16.0, 16.0)]
    plate = Primitive("extrude", (8.0,), (0.0, 0.0, 4.0), outline=Outline((rounded(60.0, 60.0, 4.0), *holes)))
    pocket = Primitive("extrude", (3.0,), (0.0, 0.0, 1.0), outline=Outline(tuple(nuts)))
    part = opened(Combine("difference", plate, pocket))
    drilled, cut = leaves(change_values(part, {"plate_hole_spacing_x": 36.0}).program)
    places = [np.mean([v[0] for v in loop]) for leaf in (drilled, cut) for loop in leaf.outline.loops[-4:]]
    assert np.abs(places) == pytest.approx([18.0] * 8)


def test_a_turned_bore_is_as_wide_as_the_hole_that_goes_on_from_it():
    block = Primitive("box", (40.0, 20.0, 20.0))
    rim = ((0.0, -4.0, 0.0), (6.0, -4.0, 0.0), (6.0, 0.0, 0.0), (3.0, 3.0, 0.0), (3.0, 8.0, 0.0), (0.0, 8.0, 0.0))
    turned = Primitive("revolve", (360.0,), (-14.0, 0.0, 0.0), (0.0, 90.0, 0.0), Outline((rim,)))
    drawn = Primitive("extrude", (20.0,), (2.0, 0.0, 0.0), (0.0, 90.0, 0.0), Outline((circle(3.0), circle(1.0, 0.0, 7.0))))
    part = opened(Combine("difference", Combine("difference", block, turned), drawn))
    (name,) = (name for name, value in part.values.items() if value == pytest.approx(6.0) and "diameter" in name)
    _, bore, hole = leaves(change_values(part, {name: 6.6}).program)
    assert bore.outline.loops[0][4][0] == pytest.approx(3.3)
    assert hole.outline.bounds[0][1] == pytest.approx(-3.3)


def notched(radius, half=20.0, deep=0.7):
    """A disc with a notch between slanted walls that begin `half` degrees to either side of the x axis."""
    a = np.radians(half)
    low, high = (radius * np.cos(a), -radius * np.sin(a)), (radius * np.cos(a), radius * np.sin(a))
    turn = tan((2 * np.pi - 2 * a) / 4)
    return Outline((((*high, turn), (*low, 0.0), (deep * radius, -0.1 * radius, 0.0), (deep * radius, 0.15 * radius, 0.0)),))


def test_the_rim_of_a_notched_disc_has_a_radius_and_stays_round():
    part = opened(Primitive("extrude", (4.0,), outline=notched(30.0)))
    (name,) = (name for name, value in part.values.items() if value == pytest.approx(30.0))
    assert not any("angle" in name for name in part.values)
    (wider,) = leaves(change_values(part, {name: 33.0}).program)
    rim = ring_curves(wider.outline.loops[0])[0]
    assert arc_radius(rim) == pytest.approx(33.0, abs=1e-9)
    assert np.degrees(4 * np.arctan(rim[4])) == pytest.approx(320.0)


@pytest.mark.parametrize("half", [17.3, 23.1, 33.7, 41.9])
def test_a_flange_about_a_notched_disc_still_touches_it_all_round(half):
    """Of a rim that its ends' six decimals move by a hair the flange would part here and there."""
    ring = Outline((((31.0, -5.0, 0.0), (34.0, -5.0, 0.0), (34.0, -3.0, 0.0), (31.0, -3.0, 0.0)),))
    disc = Primitive("extrude", (10.0,), outline=notched(31.0, half))
    part = opened(Combine("union", disc, Primitive("revolve", (360.0,), outline=ring)))
    assert census_of(solid_of(part)).kind == (1, 1, 0)
    name = "plate_edge_x"  # how far the notch reaches in
    assert census_of(solid_of(change_values(part, {name: 0.9 * part.values[name]}))).kind == (1, 1, 0)


def test_rounding_leaves_arcs_on_round_circles():
    around = ((30.0 * np.cos(0.3), 30.0 * np.sin(0.3), tan(1.1)), (30.0 * np.cos(4.7), 30.0 * np.sin(4.7), 0.0))
    rounded_once = round_program(Primitive("extrude", (4.0,), (100.0, 0.0, 0.0), outline=Outline((around,))))
    (arc, _) = ring_curves(rounded_once.outline.loops[0])
    assert (*arc_center(arc), arc_radius(arc)) == pytest.approx((0.0, 0.0, 30.0), abs=1e-12)
    assert round_program(rounded_once) == rounded_once
