"""Ellipses in texts, edits, STEP and pictures: named lengths and widths, true curves, and a circle where both become equal."""

import math
import re

import pytest
from tests.export.outlined import HANDLE, OVAL
from tests.export.test_outlines import opened, step_text

from imdim.app.lab.outline_picture import draw_outline
from imdim.export.cadquery import to_cadquery
from imdim.export.delivered import EditError, meanings
from imdim.export.edit import change_values
from imdim.export.html_tree import outline_values
from imdim.export.openscad import OUTLINE, to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.script import to_script
from imdim.export.ucad import to_ucad
from imdim.geometry.solid import volume
from imdim.numbers.outline_values import snap_leaf, snap_outline
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, circle, ellipse
from imdim.program.repeats import Folded, Repeat, expand
from imdim.program.tree import Primitive, leaves


def extrude(*loops: Loop) -> Primitive:
    return Primitive("extrude", (4.0,), outline=Outline(loops))


PLATE = extrude(ellipse(40, 25), ellipse(8, 5, 20, 0), ellipse(8, 5, -20, 0), circle(4))
TURNED = extrude(ellipse(40, 25, 0, 0, 17.3), ellipse(8, 5, 0, 0, 30.0))


def test_an_ellipse_has_a_length_and_a_width():
    delivered = opened(PLATE)
    assert delivered.values == pytest.approx(
        {
            "plate_thickness": 4.0,
            "plate_hole_spacing_x": 40.0,
            "plate_hole_diameter": 8.0,
            "plate_length": 80.0,
            "plate_width": 50.0,
            "plate_hole_length": 16.0,
            "plate_hole_width": 10.0,
        }
    )
    for text in (t.replace('"', "") for t in delivered.texts.values()):  # FreeCAD's expressions are in quotes
        assert "ellipse(plate_length/2, plate_width/2)" in text
        assert "ellipse(plate_hole_length/2, plate_hole_width/2, -plate_hole_spacing_x/2)" in text


def test_an_odd_angle_has_a_name_and_one_that_one_would_draw_has_none():
    delivered = opened(TURNED)
    assert delivered.values["plate_ellipse_angle"] == 17.3
    assert meanings(delivered)["plate_ellipse_angle"]
    assert "ellipse(plate_length/2, plate_width/2, 0, 0, plate_ellipse_angle)" in delivered.texts["program.scad"]
    assert "ellipse(plate_hole_length/2, plate_hole_width/2, 0, 0, 30)" in delivered.texts["program.scad"]
    turned = change_values(delivered, {"plate_ellipse_angle": 45.0})
    assert turned.program == next(leaves(extrude(ellipse(40, 25, 0, 0, 45.0), ellipse(8, 5, 0, 0, 30.0))))


def test_an_edit_makes_it_longer_or_a_circle_and_refuses_what_is_none():
    delivered = opened(PLATE)
    longer = change_values(delivered, {"plate_length": 100.0})
    assert longer.program.outline.loops[0] == Ellipse(50.0, 25.0)
    assert longer.program.outline.loops[1:] == PLATE.outline.loops[1:]
    both = change_values(delivered, {"plate_hole_length": 10.0})
    assert both.program.outline.loops[1] == circle(5.0, 20.0)
    assert volume(both.program, 1024) == pytest.approx(4 * math.pi * (1000 - 50 - 16), rel=1e-4)
    with pytest.raises(EditError, match="loop 1 curve 0 crosses or touches loop 3"):
        change_values(delivered, {"plate_hole_length": 36.0})
    with pytest.raises(EditError, match="needs a positive number"):
        change_values(delivered, {"plate_width": -1.0})


def test_copies_of_a_repeat_share_their_numbers():
    folded: Folded = Repeat("linear", extrude(ellipse(4, 2, 0, 0, 20.0)), (3,), ((20.0, 0.0, 0.0),))
    text = to_script(expand(folded), folded=folded)
    assert text.count("ellipse(4, 2, 0, 0, 20)") == 1
    assert "for i in range(" in text


def test_texts_say_what_an_ellipse_is_only_where_there_is_one():
    ringed = extrude(circle(5), circle(4))
    for write in (to_openscad, to_script, to_cadquery):
        assert "ellipse" not in write(ringed).lower()
    assert "Ellipse(rx, ry)" in to_script(PLATE)
    assert "Ellipse" in re.search(r"from build123d import (.*)", to_script(PLATE))[1]
    assert ".ellipse(rx, ry, angle)" in to_cadquery(PLATE)
    assert "function ellipse(" in to_openscad(PLATE).replace(OUTLINE, "")
    with pytest.raises(ValueError, match="polygons"):
        to_ucad(PLATE)


@pytest.mark.parametrize("said", ["ellipse(3, 0)", "ellipse(-3, 2)", "ellipse(3)", "ellipse(3, 2, 1, 0, 0, 0)"])
def test_a_text_with_what_is_no_ellipse_is_refused_by_its_line(said):
    text = to_openscad(PLATE).replace("ellipse(40, 25)", said)
    assert said in text
    with pytest.raises(ValueError, match=r"^line \d+"):
        read_openscad(text)


def test_step_has_one_true_face_a_wall(tmp_path):
    for part, kind, count in ((OVAL, "SURFACE_OF_LINEAR_EXTRUSION", 3), (HANDLE, "SURFACE_OF_REVOLUTION", 1)):
        text = step_text(part, tmp_path)
        assert text.count(f"= {kind}(") == count
        assert len(re.findall(r"= ELLIPSE\(", text)) >= count


@pytest.mark.parametrize("loop", [Ellipse(30, 18, 2, 1, 20), Ellipse(5, 9, -3, 4, -70)])
def test_pictures_draw_half_and_half(loop):
    outline = Outline((loop,))
    values = outline_values(outline)
    assert values["curves"] == 1
    assert values["radii"] == []
    halves = re.findall(r"A (\S+) (\S+) (\S+) 0 1 (\S+) (\S+)", values["path"])
    assert [[float(n) for n in half[:3]] for half in halves] == [[loop.rx, loop.ry, loop.angle]] * 2
    start = [float(n) for n in re.match(r"M (\S+) (\S+)", values["path"]).groups()]
    assert [float(n) for n in halves[1][3:]] == start
    assert math.dist(start, [float(n) for n in halves[0][3:]]) == pytest.approx(2 * loop.rx, rel=1e-4)
    page = draw_outline(Primitive("extrude", (1.0,), outline=outline), "mm")
    assert "1 curves" in page or "1 curve" in page
    assert f"ellipses {2 * loop.rx:g}&nbsp;mm × {2 * loop.ry:g}&nbsp;mm" in page


def test_snapping_gives_typed_numbers_back():
    near = Outline(
        (ellipse(40.0004, 24.9997, 0.0003, 0.0, 0.0004), ellipse(8.0002, 5.0003, 19.9998, 0.0002, 29.998), circle(4.0001, 0.0002))
    )
    assert snap_outline(near, 0.002).loops == (ellipse(40, 25), ellipse(8, 5, 20, 0, 30), circle(4))
    assert snap_outline(Outline((Ellipse(5.0004, 4.9998, 1.0, 0.0, 33.0),)), 0.002).loops == (circle(5, 1),)
    leaf = Primitive("extrude", (4.0,), (10.0003, 0.0, 0.0), outline=Outline((Ellipse(7.0001, 12.5002, 0.0001, 0.0, 89.9999),)))
    snapped = snap_leaf(leaf, 0.002)
    assert snapped.center == (10.0, 0.0, 0.0)
    assert snapped.outline == Outline((ellipse(12.5, 7.0),))


def test_a_concentric_hole_takes_the_centre_of_its_ellipse():
    third = 10 / 3
    near = Outline((circle(9, third, third), Ellipse(5.0, 3.0, third + 1e-4, third - 1e-4)))
    ring, oval = snap_outline(near, 0.001).loops
    assert isinstance(oval, Ellipse)
    assert (oval.x, oval.y) == pytest.approx(((ring[0][0] + ring[1][0]) / 2, ring[0][1]), abs=1e-9)
