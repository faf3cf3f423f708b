"""A line of comment above each feature, and one label for it in every file, before and after an edit."""

import re

from tests.export.test_hole_names import opened
from tests.planted import box, cut, cylinder, union

from imdim.export import html
from imdim.export.delivered import meanings
from imdim.export.edit import change_values, open_delivered, write
from imdim.export.feature_names import name_leaves
from imdim.export.feature_notes import feature_notes, read_labels, renew_notes
from imdim.export.meshes import NamedFeatures
from imdim.program.codec import dumps, parse, to_json

PLATE = box(80, 50, 6)
BOSS = cylinder(9, 14, (0, 0, 10))
PART = cut(
    union(PLATE, BOSS, *(box(10, 4, 8, (x, 0, 7)) for x in (-25, 25))),
    cylinder(4, 60),
    *(cylinder(1.7, 20, (x, y, 0)) for x in (-34, 34) for y in (-19, 19)),
)


def comments(delivered, file):
    """Those of features, without the mark."""
    return [line.split(maxsplit=1)[1] for line in delivered.texts[file].splitlines() if re.match(r"\s*(//|#) .* ?#\d", line)]


def test_each_feature_has_one_line_in_each_text():
    delivered = opened(PART)
    assert set(delivered.texts) > {"program.scad", "program.loops.scad", "program.py", "program.cq.py", "program.FCMacro"}
    for file in delivered.texts:
        assert sorted(comments(delivered, file)) == [
            "block #2, #3",
            "bore #4, in boss: hole, diameter 8, through",
            "boss #1",
            "m3_hole #5 to #8, in plate: 4 x M3 clearance hole, diameter 3.4, through, on a 68 x 38 grid",
            "plate #0",
        ], file


def test_all_files_call_a_feature_alike(tmp_path):
    delivered = opened(PART)
    label = delivered.labels
    called = read_labels(delivered.texts["program.scad"], delivered.program, delivered.folded)
    macro = re.findall(r'^ *(?:add\("\w+", |extruded\(|turned\()"(\w+)"', delivered.texts["program.FCMacro"], re.M)
    page = html.content(to_json(delivered.program, delivered.meta, delivered.constraints, delivered.folded))
    meshes = NamedFeatures.of("part", delivered.program, (), label).names.features  # which STEP has too
    assert called == label == meshes == tuple(macro) == tuple(leaf["label"] for leaf in page["leaves"])
    names = meanings(delivered)
    assert names["plate_thickness"].startswith("length along z of plate #0; moves z of boss #1, block #2, #3")
    assert names["bore_diameter"] == "diameter of bore #4"
    assert names["m3_hole_diameter"] == "diameter of m3_hole #5 to #8"


def test_labels_stay_when_numbers_change(tmp_path):
    """A plate that is made thicker than a plate is, and a hole that suits no screw of that size any more."""
    after = change_values(opened(PART), {"plate_thickness": 40.0, "m3_hole_diameter": 5.0})
    again = open_delivered(parse(dumps(after.program, after.meta, after.constraints, after.folded)), after.texts)
    assert again.labels == after.labels == opened(PART).labels
    assert "m3_hole #5 to #8, in plate: 4 x hole, diameter 5, through, on a 68 x 38 grid" in comments(again, "program.py")
    assert "plate #0" in comments(again, "program.scad")
    write(again, tmp_path / "new")
    assert b'"m3_hole"' in (tmp_path / "new" / "mesh.glb").read_bytes()


def test_texts_without_labels_keep_their_comments_of_holes():
    """As older versions wrote them."""
    before = opened(PART)
    texts = {file: re.sub(r"(// |# )(?:\w+ #[^:\n]*: )?(.*)", r"\1\2", text) for file, text in before.texts.items()}
    texts = {file: "\n".join(line for line in text.split("\n") if not re.search(r"(//|#) \w+ #\d", line)) for file, text in texts.items()}
    old = open_delivered(parse(dumps(before.program, before.meta, before.constraints, before.folded)), texts)
    assert not comments(old, "program.scad")
    assert old.labels == before.labels
    assert "// hole, diameter 9, through" in change_values(old, {"bore_diameter": 9.0}).texts["program.scad"]


def test_a_comment_goes_with_its_hole():
    text = "a\n  // hole, diameter 6, through\nb\n  // hole, diameter 6, through\nc\n  // note"
    before = {1: ("hole, diameter 6, through",), 2: ("hole, diameter 6, through",)}
    assert renew_notes(text, before, {2: ("hole, diameter 7, through",)}) == "a\nb\n  // hole, diameter 7, through\nc\n  // note"


def test_numbers_tell_those_of_one_label_apart():
    label = ("plate", "hole", "hole", "hole", "boss", "hole")
    assert name_leaves([0, 4, 5, 3, 2, 1], label) == ["plate", "boss", "hole #1 to #3, #5"]
    many = [i for i in range(40) if i % 3]
    assert name_leaves(many, ["hole"] * 40) == ["hole #1, #2, #4, #5, #7, #8, #10, #11, #13, #14, #16, #17, #19, #20, #22, #23 and 10 more"]


def test_what_an_edit_tells_apart_has_lines_of_its_own():
    def said(radius):
        part = cut(PLATE, cylinder(3, 20, (-30, 10, 0)), cylinder(radius, 20, (32, -14, 0)))
        return feature_notes(part, ("plate", "hole", "hole"))

    text = "  // hole #1, #2: 2 x hole, diameter 6, through, 66.483 apart\n  b"
    apart = ["  // hole #1, #2", "  // hole, diameter 6, through", "  // hole, diameter 8, through", "  b"]
    assert renew_notes(text, said(3), said(4)).split("\n") == apart
    assert renew_notes("\n".join(apart), said(4), said(3)) == text


def test_blind_pockets_say_how_deep_they_are():
    plate = box(80, 50, 6, (0, 0, 3))
    pockets = [box(20, 10, 4, (x, 0, 5)) for x in (-25, 25)]  # from a floor at 3, past the face at 6
    channel, window = box(90, 6, 4, (0, 20, 6)), box(10, 5, 20, (0, -18, 3))
    said = comments(opened(cut(plate, *pockets, channel, window)), "program.scad")
    assert sorted(line for line in said if "deep" in line) == ["pocket #1, #2: 20 x 10, 3 deep", "pocket2 #3: 6 wide, 2 deep"]


def test_what_is_shaved_off_has_no_depth():
    """No wall stands beside it."""
    delivered = opened(cut(box(40, 30, 10), box(50, 40, 4, (0, 0, 5))))
    assert not any("deep" in line for line in comments(delivered, "program.scad"))


def test_a_pocket_that_an_edit_made_deeper_says_so():
    delivered = opened(cut(box(80, 50, 6, (0, 0, 3)), box(20, 10, 4, (5, 3, 5))))
    after = change_values(delivered, {"pocket_depth": 4.0})
    assert "pocket #1: 20 x 10, 3 deep" in comments(delivered, "program.scad")
    assert "pocket #1: 20 x 10, 4 deep" in comments(after, "program.py")
