"""Edits by name: OpenSCAD's -D is the truth for what moves; what cannot be is refused in one line."""

import math
import re
import shutil
import subprocess
from dataclasses import replace

import pytest
import trimesh
from tests.export.test_parameters import FLANGE, MOUNT, ROW, mount, parametrised
from tests.planted import PARTS, box, cut, cylinder, union

from imdim.delivery.finish import finish
from imdim.export.delivered import Delivered, EditError, meanings
from imdim.export.edit import change_values, open_delivered, solid_of, write
from imdim.export.elimination import without_loose
from imdim.export.openscad import to_openscad, to_openscad_loops
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import parametrise
from imdim.export.script import to_script
from imdim.export.ucad import to_ucad
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.codec import Meta, constraints_of, dumps, parse, to_json
from imdim.program.constraints import Constraint, Ref
from imdim.program.repeats import expand
from imdim.program.tree import Program, leaves
from imdim.reconstruction.fitting import relations_of
from imdim.relations.discover import exact_relations
from imdim.relations.residuals import rebase_constraints, verify


def delivered_of(program: Program):
    """As `deliver` writes it."""
    found = exact_relations(program)
    after, parameters = parametrised(program)
    texts = {
        "program.scad": to_openscad(after, 64, parameters),
        "program.py": to_script(after, parameters),
        "program.ucad": to_ucad(after, parameters),
    }
    return open_delivered(parse(dumps(after, Meta("millimeter"), rebase_constraints(after, found.constraints))), texts)


@pytest.mark.tool
@pytest.mark.parametrize(
    ("program", "values"),
    [
        (MOUNT, {"hole_diameter": 8.5}),
        (MOUNT, {"plate_thickness": 15.0, "hole_spacing_x": 50.0, "boss_height": 3.5}),
        (ROW, {"hole_spacing": 17.0}),
        (FLANGE, {"bolt_circle": 66.0, "hole_diameter": 8.0}),
        (PARTS["L bracket"], {"plate_thickness": 9.0}),
    ],
    ids=["holes", "plate", "row", "circle", "bracket"],
)
def test_an_edit_is_openscads_d(program, values, tmp_path):
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    delivered = delivered_of(program)
    (tmp_path / "given.scad").write_text(delivered.texts["program.scad"])
    options = [f"-D{name}={value}" for name, value in values.items()]
    command = [tool, "-o", str(tmp_path / "given.stl"), *options, str(tmp_path / "given.scad")]
    assert "WARNING" not in subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    theirs = mesh_to_manifold(trimesh.load_mesh(tmp_path / "given.stl"))
    write(change_values(delivered, values), tmp_path / "new")
    ours = mesh_to_manifold(trimesh.load_mesh(tmp_path / "new" / "mesh.stl"))
    assert volume_iou(ours, theirs) == pytest.approx(1, abs=1e-5)
    assert volume_iou(ours, to_manifold(program, 64)) < 0.999


def test_all_files_say_the_same_and_can_be_edited_back(tmp_path):
    delivered = delivered_of(MOUNT)
    write(change_values(delivered, {"hole_diameter": 8.0}), tmp_path / "new")
    texts = {p.name: p.read_text() for p in (tmp_path / "new").iterdir() if p.suffix in (".scad", ".py", ".ucad")}
    document = parse((tmp_path / "new" / "program.json").read_text())
    again = open_delivered(document, texts)
    assert volume_iou(to_manifold(again.program, 64), to_manifold(mount(hole=4.0), 64)) == pytest.approx(1, abs=1e-9)
    verify(again.program, constraints_of(document))
    assert again.meta.units == "millimeter"
    assert "hole_diameter = 8\n" in texts["program.py"]
    assert "hole_diameter = 8mm;" in texts["program.ucad"]
    back = change_values(again, {"hole_diameter": 6.0})
    assert (back.program, back.texts, back.constraints) == (delivered.program, delivered.texts, delivered.constraints)


def test_without_the_text_the_constraints_give_the_names():
    given = delivered_of(MOUNT)
    alone = open_delivered(parse(dumps(given.program, given.meta, given.constraints)), {})
    assert alone.values["hole_diameter"] == 6
    wide = change_values(alone, {"hole_diameter": 8.0})
    assert volume_iou(solid_of(wide), to_manifold(mount(hole=4.0), wide.segments)) == pytest.approx(1, abs=1e-6)


def slanted(*parts):
    """The parts turned by 30 degrees about z."""
    turn = math.radians(30)
    c, s = math.cos(turn), math.sin(turn)
    place = lambda x, y, z: (c * x - s * y, s * x + c * y, z)  # noqa: E731
    return [replace(p, center=place(*p.center), rotation=(0.0, 0.0, 30.0)) for p in parts]


SLOTS = slanted(box(20, 20, 8, (0, 3, 3)), box(8, 6, 8, (6, 3, 3)))
ALONG = [Constraint("coplanar", (Ref(1, "+x"), Ref(2, "+x"))), Constraint("aligned", (Ref(1), Ref(2)), Ref(1, "y"))]
UPRIGHT = [Constraint("coplanar", (Ref(1, "+z"), Ref(2, "+z"))), Constraint("equal", (Ref(3, "r"), Ref(4, "r")))]
HOLES = [cylinder(2, 8, (-15, 3, 3)), cylinder(2, 8, (15, 3, 3))]


def check_edits(program, kept):
    """Relations that were kept hold after an edit of any name."""
    delivered = open_delivered(parse(dumps(program, None, kept)), {})
    for name, value in delivered.values.items():
        verify(change_values(delivered, {name: 1.05 * value}).program, kept, 1e-6)


def test_relations_along_slanted_directions_bind_no_edit():
    """A sum of sines and cosines of names is what nobody would read: lengths along what is turned on a body are plain numbers, and nothing
    is claimed that the next edit would break."""
    program = cut(box(60, 60, 6, (5, 3, 3)), *SLOTS, *HOLES)
    held = [*ALONG, *UPRIGHT]
    verify(program, held)
    kept = without_loose(program, held, program)
    assert kept == tuple(UPRIGHT)
    check_edits(program, kept)


def test_relations_of_a_part_that_is_turned_as_a_whole_bind_its_edits():
    program = cut(*slanted(box(60, 60, 6, (5, 3, 3))), *SLOTS, *slanted(*HOLES))
    held = [*ALONG, *UPRIGHT]
    verify(program, held)
    kept = without_loose(program, held, program)
    assert kept == tuple(held)
    check_edits(program, kept)


def test_a_length_that_a_constraint_gives_has_no_name():
    program = cut(box(30, 20, 6), cylinder(3, 8))
    value = Constraint("value", (Ref(0, "sx"),), value=30.0)
    with pytest.raises(EditError, match="no parameter 'plate_length'"):
        change_values(open_delivered(parse(dumps(program, None, [value])), {}), {"plate_length": 40.0})


def test_names_say_what_they_are_and_what_follows():
    said = meanings(delivered_of(MOUNT))
    assert said["hole_diameter"] == "diameter of hole #2 to #5"
    assert said["plate_thickness"].startswith("length along z of plate #0; moves z of plate #0, boss #1, hole #2 to #5")
    assert said["hole_spacing_x"] == "moves x of hole #2 to #5"
    assert meanings(delivered_of(FLANGE))["bolt_circle"].startswith("moves x of hole #1 to #6 and y of hole #2, #3, #5")


@pytest.mark.parametrize(
    ("program", "values", "message"),
    [
        (MOUNT, {"hole_diamter": 6.0}, "no parameter 'hole_diamter'; nearest are hole_diameter"),
        (MOUNT, {"qqq": 3.0}, "no parameter 'qqq'; it has plate_length, plate_width"),
        (MOUNT, {"hole_diameter": math.nan}, "hole_diameter needs a finite number, got nan"),
        (MOUNT, {"hole_diameter": math.inf}, "hole_diameter needs a finite number, got inf"),
        (MOUNT, {"plate_thickness": 0.0}, "plate_thickness needs a positive number, got 0"),
        (FLANGE, {"bolt_circle": -60.0}, "bolt_circle needs a positive number, got -60"),
        (MOUNT, {"boss_height": -30.0}, "boss_height needs a positive number, got -30"),
        (ROW, {"hole_spacing": 0.0}, "hole_spacing = 0: .* a reference of no length"),
    ],
)
def test_what_cannot_be_is_refused(program, values, message):
    with pytest.raises(EditError, match=message) as caught:
        change_values(delivered_of(program), values)
    assert "\n" not in str(caught.value)


def test_a_place_may_be_negative_whatever_its_feature_is_called():
    """What a chamfer is called begins the name of its level, which is no size."""
    text = "$fn = 48;\n\nbore_chamfer_base = -5;\n\ntranslate([0, 0, bore_chamfer_base]) cube([4, 4, 4], center = true);\n"
    placed = open_delivered(parse(dumps(box(4, 4, 4, (0, 0, -5.0)), None)), {"program.scad": text})
    (moved,) = leaves(change_values(placed, {"bore_chamfer_base": -6.0}).program)
    assert moved.center == (0, 0, -6)


def test_an_empty_solid_is_refused(tmp_path):
    gone = change_values(delivered_of(FLANGE), {"hole_diameter": 2000.0})
    with pytest.raises(EditError, match="no solid is left"):
        write(gone, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_an_edit_that_breaks_a_relation_is_refused():
    """Names that know nothing of a constraint: a plate that has to be square, with two names for its edges."""
    plate = cut(box(30, 30, 6), cylinder(3, 8))
    square = Constraint("equal", (Ref(0, "sx"), Ref(0, "sy")), name="square")
    texts = {"program.scad": to_openscad(plate, 48, parametrise(plate, (), plate))}
    delivered = open_delivered(parse(dumps(plate, None, [square])), texts)
    with pytest.raises(EditError, match=r"plate_length = 40: constraints\[0\] 'square'.*is off by"):
        change_values(delivered, {"plate_length": 40.0})
    assert change_values(delivered, {"plate_length": 40.0, "plate_width": 40.0}).values["plate_width"] == 40


def test_texts_that_were_changed_by_hand_are_refused():
    given = delivered_of(MOUNT)
    document = parse(dumps(given.program, given.meta, given.constraints))
    scad = given.texts["program.scad"]
    with pytest.raises(ValueError, match=r"program\.scad beside it describes another program"):
        open_delivered(document, {**given.texts, "program.scad": scad.replace("plate_length = 80", "plate_length = 81")})
    with pytest.raises(ValueError, match=r"program\.py beside it begins with other names"):
        open_delivered(document, {**given.texts, "program.py": given.texts["program.py"].replace("plate_length = 80", "plate_length = 81")})
    with pytest.raises(ValueError, match=r"program\.scad: line \d+ is no primitive"):
        open_delivered(document, {**given.texts, "program.scad": scad + "text();\n"})


def test_the_openscad_text_keeps_what_a_person_wrote_beside_the_numbers():
    given = delivered_of(union(box(10, 10, 10), box(5, 5, 20)))
    noted = re.sub(r"(?m)^(body_length = .*)$", "// a remark\n\\1", given.texts["program.scad"])
    new = change_values(open_delivered(parse(dumps(given.program)), {"program.scad": noted}), {"body_length": 12.0})
    assert "// a remark\nbody_length = 12;" in new.texts["program.scad"]
    assert next(leaves(read_openscad(new.texts["program.scad"]))).size[0] == 12


# --- repeats ---------------------------------------------------------------------------------------------------------


def repeated(program) -> Delivered:
    found = finish(*relations_of(program))
    texts = {
        "program.scad": to_openscad(found.program, 48, found.parameters),
        "program.loops.scad": to_openscad_loops(found.folded, 48, found.parameters),
        "program.py": to_script(found.program, found.parameters, found.folded),
        "program.ucad": to_ucad(found.program, found.parameters, found.folded),
    }
    return open_delivered(to_json(found.program, None, found.constraints, found.folded), texts)


def row(n: int, spacing: float, r: float = 2.0, first: float = -30.0):
    return cut(box(90, 20, 8), *(cylinder(r, 20, (first + spacing * i, 3.0, 0.0)) for i in range(n)))


def bolts(n: int, diameter: float, r: float = 3.0):
    angles = [math.tau * i / n for i in range(n)]
    return cut(cylinder(40, 8), *(cylinder(r, 20, (diameter / 2 * math.cos(a), diameter / 2 * math.sin(a), 0.0)) for a in angles))


@pytest.mark.parametrize(
    ("before", "values", "meant"),
    [
        (ROW, {"hole_diameter": 6.0}, row(4, 20, 3.0)),
        (ROW, {"hole_spacing": 18.0}, row(4, 18, first=-27)),
        (ROW, {"hole_count": 3}, row(3, 20)),
        (ROW, {"hole_count": 5, "hole_spacing": 15.0, "hole_diameter": 5.0}, row(5, 15, 2.5, first=-22.5)),
        (FLANGE, {"hole_count": 8}, bolts(8, 60)),
        (FLANGE, {"hole_count": 5, "bolt_circle": 64.0, "hole_diameter": 4.0}, bolts(5, 64, 2.0)),
        (MOUNT, {"hole_spacing_x": 55.0}, None),
        (MOUNT, {"hole_count_x": 3, "hole_spacing_x": 30.0}, None),
    ],
)
def test_counts_pitch_and_circles_are_edited_by_name(before, values, meant):
    delivered = repeated(before)
    after = change_values(delivered, values)
    names = {**after.values, **after.counts}
    expected = {**delivered.values, **delivered.counts, **values}
    assert {name: names[name] for name in expected} == pytest.approx(expected)
    if meant is not None:
        assert volume_iou(solid_of(after), to_manifold(meant, 48)) == pytest.approx(1, abs=1e-6)
    assert expand(after.folded) == after.program
    # the edited files are delivered files again
    again = open_delivered(to_json(after.program, None, after.constraints, after.folded), after.texts)
    wider = change_values(again, {"hole_diameter": 4.4})
    assert change_values(wider, {"hole_diameter": again.values["hole_diameter"]}).program == after.program
    flat = read_openscad(after.texts["program.scad"])
    assert volume_iou(to_manifold(flat, 48), solid_of(after)) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"hole_count": 2.5}, "hole_count needs a whole number of 2 or more, got 2.5"),
        ({"hole_count": 1}, "hole_count needs a whole number of 2 or more, got 1"),
        ({"hole_count": math.nan}, "hole_count needs a whole number of 2 or more, got nan"),
        ({"hole_count": 1e6}, "hole_count: 1000001 primitives, more than 10000"),
        ({"hole_cont": 3}, "no parameter 'hole_cont'; nearest are hole_count, hole_y, hole_spacing"),
    ],
)
def test_what_is_no_count_is_refused(values, message):
    with pytest.raises(EditError) as caught:
        change_values(repeated(ROW), values)
    assert str(caught.value) == message


def test_counts_are_listed_and_have_to_agree():
    delivered = repeated(ROW)
    assert meanings(delivered)["hole_count"] == "how many copies there are"
    texts = {**delivered.texts, "program.py": delivered.texts["program.py"].replace("hole_count = 4", "hole_count = 6")}
    with pytest.raises(ValueError, match="changed by hand"):
        open_delivered(to_json(delivered.program, None, delivered.constraints, delivered.folded), texts)
