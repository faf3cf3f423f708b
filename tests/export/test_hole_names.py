"""Holes in the texts: comments that say what they are, names that tell bore and counterbore apart, and both after an edit."""

import pytest
from tests.export.test_edit import delivered_of
from tests.planted import box, cut, cylinder

from imdim.delivery.finish import finish
from imdim.export.cadquery import to_cadquery
from imdim.export.delivered import texts_of
from imdim.export.edit import EditError, change_values, open_delivered
from imdim.export.hole_names import hole_features, hole_notes
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.holes import find_holes
from imdim.program.codec import dumps, parse
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, leaves
from imdim.relations.discover import exact_relations

PLATE = box(80, 50, 10)
CORNERS = [(x, y) for x in (-31, 31) for y in (-18, 18)]
BORED = cut(PLATE, *(cylinder(1.7, 20, (x, y, 0)) for x, y in CORNERS), *(cylinder(3.25, 8, (x, y, 6)) for x, y in CORNERS))
SAID = "4 x M3 clearance hole, diameter 3.4, through, counterbore diameter 6.5, 3 deep, on a 62 x 36 grid"


def opened(program):
    found = finish(*(lambda r: (r.program, r.constraints))(exact_relations(program)))
    texts = texts_of(found.program, found.parameters, found.folded, 64)
    return open_delivered(parse(dumps(found.program, None, found.constraints, found.folded)), texts)


def test_each_text_says_once_what_holes_there_are():
    delivered = opened(BORED)
    assert set(delivered.texts) == {"program.scad", "program.loops.scad", "program.py", "program.cq.py", "program.FCMacro", "program.ucad"}
    for name, text in delivered.texts.items():
        mark = "//" if name.endswith(("scad", "ucad")) else "#"
        said = [line.strip() for line in text.split("\n") if SAID in line]
        assert said == [f"{mark} m3_hole #1 and 3 copies: {SAID}"], name


def test_a_comment_stands_where_python_and_openscad_read_over_it():
    delivered = opened(BORED)
    assert list(leaves(read_openscad(delivered.texts["program.scad"]))) == list(leaves(delivered.program))
    for name in ("program.py", "program.cq.py", "program.FCMacro"):
        compile(delivered.texts[name], name, "exec")
    flat = to_cadquery(BORED)
    compile(flat, "flat", "exec")


def test_names_tell_bores_and_counterbores_apart():
    values = opened(BORED).values
    assert values["m3_hole_diameter"] == pytest.approx(3.4)
    assert values["counterbore_diameter"] == pytest.approx(6.5)
    assert values["counterbore_depth"] == pytest.approx(3.0)


def test_a_chamfer_of_a_bore_is_called_so():
    chamfered = cut(PLATE, cylinder(5, 20), Primitive("cone", (5.0, 6.0, 1.0), (0.0, 0.0, 4.5)))
    names = opened(chamfered).values
    assert {name: value for name, value in names.items() if name.startswith("bore_chamfer")} == {
        "bore_chamfer_diameter": 12.0,
        "bore_chamfer_depth": 1.0,
    }


def test_a_hole_of_an_outline_has_its_screw_as_a_name():
    plate = Primitive("extrude", (6.0,), outline=Outline((*rectangle(40.0, 30.0).loops, circle(2.75, 10.0), circle(5.0, -9.0))))
    assert {"plate_m5_hole_diameter": 5.5, "plate_hole_diameter": 10.0}.items() <= opened(plate).values.items()


def test_a_turned_part_has_names_for_what_is_in_it():
    profile = ((2.25, -5.0), (15.0, -5.0), (15.0, 5.0), (4.0, 5.0), (4.0, 1.0), (2.25, 1.0))
    collar = Primitive("revolve", (360.0,), outline=Outline((tuple((x, z, 0.0) for x, z in profile),)))
    names = {"turned_part_diameter": 30.0, "turned_part_m4_hole_diameter": 4.5, "turned_part_counterbore_diameter": 8.0}
    assert names.items() <= opened(collar).values.items()


def test_a_diameter_is_edited_by_its_name():
    after = change_values(opened(BORED), {"m3_hole_diameter": 5.0, "counterbore_diameter": 9.0})
    sizes = {leaf.size[0] for leaf in leaves(after.program) if leaf.kind == "cylinder"}
    assert sizes == {2.5, 4.5}


def test_comments_follow_an_edit():
    after = change_values(opened(BORED), {"m3_hole_diameter": 4.0})
    said = "4 x hole, diameter 4, through, counterbore diameter 6.5, 3 deep, on a 62 x 36 grid"
    assert all(text.count(said) == 1 and SAID not in text for text in after.texts.values())
    again = open_delivered(parse(dumps(after.program, after.meta, after.constraints, after.folded)), after.texts)
    assert change_values(again, {"m3_hole_diameter": 3.4}).texts == opened(BORED).texts


def test_a_list_of_holes_that_says_something_else_than_the_solid_is_refused():
    delivered = opened(BORED)
    holes = hole_features(delivered.program)
    text = dumps(delivered.program, delivered.meta, delivered.constraints, delivered.folded, holes=holes)
    assert open_delivered(parse(text), delivered.texts).values == delivered.values
    changed = parse(text.replace('"diameter": 3.4', '"diameter": 4.0'))
    with pytest.raises(EditError, match=r"\$.holes\[0\] .* is not what its primitives make.*take the list out"):
        open_delivered(changed, delivered.texts)
    without = {key: value for key, value in changed.items() if key != "holes"}
    assert open_delivered(without, delivered.texts).values == delivered.values


def test_without_holes_nothing_is_said_of_them():
    assert hole_notes(Combine("union", PLATE, cylinder(5, 30))) == {}
    lines = delivered_of(PLATE).texts["program.scad"].splitlines()
    assert [line for line in lines if line.strip().startswith("//")] == ["// plate #0"]


def test_a_whole_turn_has_no_name():
    """Drilled holes in a row, each a turned cut."""
    profile = Outline((((0.0, -6.0, 0.0), (2.1, -4.7, 0.0), (2.1, 6.0, 0.0), (0.0, 6.0, 0.0)),))
    row = cut(PLATE, *(Primitive("revolve", (360.0,), (x, 3.0, 4.0), outline=profile) for x in (-20.0, 0.0, 20.0)))
    delivered = opened(row)
    assert delivered.values["m5_tap_hole_diameter"] == pytest.approx(4.2)
    assert not any("angle" in name for name in delivered.values)
    assert "in a row, 20 apart" in delivered.texts["program.loops.scad"]


def test_a_hole_across_a_side_follows_the_walls():
    """Through a wider body, and as deep below its wall as before."""
    body = Primitive("extrude", (40.0,), outline=rectangle(60.0, 20.0))
    through = Primitive("cylinder", (2.0, 30.0), (10.0, 0.0, 0.0), (90.0, 0.0, 0.0))
    blind = Primitive("cylinder", (3.0, 12.0), (-10.0, 10.0, 0.0), (90.0, 0.0, 0.0))
    delivered = opened(cut(body, through, blind))
    width = next(name for name, value in delivered.values.items() if value == 20)
    after = find_holes(change_values(delivered, {width: 50.0}).program)
    assert [(h.kind, h.depth) for h in after] == [("through", pytest.approx(50.0)), ("blind", pytest.approx(6.0))]
