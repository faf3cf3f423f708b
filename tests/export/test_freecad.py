"""The FreeCAD macro, run by FreeCAD itself: volumes in closed form, and cells of its spreadsheet against edits by name."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from tests.export.blended import BOX, CASES, RIM, chamfer, fillet
from tests.export.outlined import OUTLINED_PARTS
from tests.export.test_blend_scripts import STAND, STAND_EDGES
from tests.export.test_drawn_corners import EDITED, every_bend
from tests.export.test_loops import PARTS
from tests.export.test_outlines import opened
from tests.known_programs import KNOWN

from imdim.app.cli import main
from imdim.delivery.finish import finish
from imdim.export.delivered import EditError, texts_of
from imdim.export.edit import change_values, open_delivered
from imdim.export.freecad import to_freecad
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import volume
from imdim.program.codec import edges_of, from_json, to_json
from imdim.program.edges import name_edges
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, leaves
from imdim.reconstruction.fitting import relations_of

SOLIDS = {name: known for name, known in KNOWN.items() if name != "nothing"}
BRACKET = Path(__file__).parents[2] / "examples" / "bracket_program.json"
NURBS = 5e-4  # FreeCAD integrates over patches of an ellipsoid without refining them
SOLVED = 1e-7  # of a volume, by which FreeCAD's constraint solver may be off
DRIVER = """
import json
import FreeCAD as App
document = App.ActiveDocument
for name, text in json.load(open("cells.json")).items():
    document.getObject("Parameters").set(name, text)
document.recompute()
document.saveAs("saved.FCStd")
App.closeDocument(document.Name)
document = App.openDocument("saved.FCStd")
last = [o for o in document.RootObjects if hasattr(o, "Shape")]
found = {
    "volumes": [o.Shape.Volume for o in last],
    "labels": [o.Label for o in document.Objects],
    "kinds": [o.TypeId for o in document.Objects],
    "wrong": [o.Label for o in document.Objects if not o.isValid()],
    "loose": [o.Label for o in document.Objects if o.TypeId.startswith("Sketcher") and not o.FullyConstrained],
}
json.dump(found, open("found.json", "w"))
"""


def run(text: str, folder: Path, **cells: str) -> tuple[dict, str]:
    """What FreeCAD has after the macro and some cells of its spreadsheet, saved and opened again, and what was printed."""
    tool = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if tool is None:
        pytest.skip("FreeCAD is not installed: apt-get install freecad gives freecadcmd")
    (folder / "program.FCMacro").write_text(text)
    (folder / "cells.json").write_text(json.dumps(cells))
    (folder / "driver.py").write_text(DRIVER)
    (folder / "found.json").unlink(missing_ok=True)
    said = subprocess.run([tool, "program.FCMacro", "driver.py"], check=True, cwd=folder, timeout=120, capture_output=True, text=True)
    assert (folder / "found.json").exists(), said.stdout + said.stderr
    found = json.loads((folder / "found.json").read_text())
    assert not found["wrong"]
    return found, said.stdout


def measured(text: str, folder: Path, **cells: str) -> float:
    """The volume of the one part that the document shows; its sketches have no freedom left."""
    found, _ = run(text, folder, **cells)
    assert not found["loose"]
    (volume,) = found["volumes"]
    return volume


@pytest.mark.tool
@pytest.mark.parametrize("name", SOLIDS)
def test_freecad_builds_the_exact_solid(name, tmp_path):
    program, exact = SOLIDS[name]
    assert measured(to_freecad(program), tmp_path) == pytest.approx(exact, rel=NURBS if name == "ellipsoid" else SOLVED)


@pytest.mark.tool
@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_freecad_draws_outlines(name, tmp_path):
    program, exact = OUTLINED_PARTS[name]
    assert measured(to_freecad(program), tmp_path) == pytest.approx(exact, rel=SOLVED)


@pytest.mark.tool
@pytest.mark.parametrize("name", PARTS)
def test_freecad_builds_every_copy(name, tmp_path):
    found = finish(*relations_of(PARTS[name]))
    text = to_freecad(found.program, found.parameters)
    assert measured(text, tmp_path) == pytest.approx(volume(found.program, 512), rel=1e-4)


@pytest.mark.tool
@pytest.mark.parametrize("name", CASES)
def test_freecad_blends_the_edges(name, tmp_path):
    program, edges, exact, _ = CASES[name]
    if math.isnan(exact):
        pytest.skip("needs the features in another order")
    assert measured(to_freecad(program, edges=edges), tmp_path) == pytest.approx(exact, rel=1e-6)


@pytest.mark.tool
@pytest.mark.parametrize(
    "values", [{"plate_thickness": 7.5}, {"plate_corner_radius": 4.0, "plate_length": 26.0}, {"boss_diameter": 11.0, "bore_diameter": 3.0}]
)
def test_blends_follow_the_cells(values, tmp_path):
    stand = finish(*relations_of(STAND))
    edges = name_edges(STAND_EDGES, stand.parameters.values)
    document = to_json(stand.program, None, stand.constraints)
    delivered = open_delivered(document, texts_of(stand.program, stand.parameters, stand.folded, 64))
    edited = change_values(delivered, values).program
    text = to_freecad(stand.program, stand.parameters, edges)
    got = measured(text, tmp_path, **{name: f"={value} mm" for name, value in values.items()})
    assert got == pytest.approx(solid_with_edges(edited, edges, 512).volume(), rel=2e-4)


@pytest.mark.tool
def test_sizes_of_blends_are_cells(tmp_path):
    text = to_freecad(BOX, edges=[fillet(2.0, RIM[:1])])
    assert measured(text, tmp_path, fillet_radius="=3 mm") == pytest.approx(6000 - 20 * 9 * (1 - math.pi / 4), rel=1e-9)


@pytest.mark.tool
def test_what_cannot_be_blended_stays_sharp_and_is_told(tmp_path):
    found, said = run(to_freecad(BOX, edges=[fillet(2.0, RIM[:1]), fillet(25.0, RIM[1:2])]), tmp_path)
    assert found["volumes"] == [pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-9)]
    assert said.count(" sharp: ") == 1
    assert "fillet_edges leaves the edge at [-5.0, 0.0, 15.0] sharp: " in said


@pytest.mark.tool
def test_edges_of_several_bodies_keep_their_sizes(tmp_path):
    apart = Combine("union", BOX, Primitive("sphere", (3.0,), (50.0, 0.0, 0.0)))
    found, said = run(to_freecad(apart, edges=[chamfer((1.0, 3.0), RIM[:1])]), tmp_path)
    assert found["volumes"] == [pytest.approx(6000 - 20 * 1.5 + 36 * math.pi, rel=1e-9)]
    assert "several solids" in said
    assert "Part::Chamfer" in found["kinds"]


@pytest.mark.tool
@pytest.mark.parametrize("values", [{}, {name: v for name, v in EDITED.items() if name != "plate_sides"}, {"plate_sides": 5}])
def test_sketches_follow_every_bend(values, tmp_path):
    delivered = opened(every_bend())
    after = change_values(delivered, values) if values else delivered
    units = {"plate_sides": "", "profile2_arc_angle": " deg"}
    cells = {name: f"={value}{units.get(name, ' mm')}" for name, value in values.items()}
    got = measured(delivered.texts["program.FCMacro"], tmp_path, **cells)
    assert got == pytest.approx(volume(after.program, 4096), rel=2e-6)


@pytest.mark.tool
def test_long_loops_stay_as_they_are_drawn(tmp_path):
    corners = [(math.cos(t) * r, math.sin(t) * r, 0.0) for k in range(120) for t, r in [(k * math.pi / 60, 20 + 3 * (k % 2))]]
    gear = Primitive("extrude", (5.0,), outline=Outline((tuple(corners),)))
    found, said = run(to_freecad(gear), tmp_path)
    assert found["volumes"] == [pytest.approx(volume(gear), rel=SOLVED)]
    assert "a loop of 120 curves stays as it is drawn" in said


@pytest.mark.tool
def test_a_cell_of_the_bracket_is_an_edit_of_it(tmp_path):
    """The bundled example, its spreadsheet against `imdim edit --set`."""
    assert main(["edit", str(BRACKET), "--set", "plate_thickness=8", "-o", str(tmp_path / "same")]) == 0
    assert main(["edit", str(BRACKET), "--set", "plate_thickness=10", "-o", str(tmp_path / "thicker")]) == 0
    macro = (tmp_path / "same" / "program.FCMacro").read_text()
    for folder, cells in (("same", {}), ("thicker", {"plate_thickness": "=10 mm"})):
        document = json.loads((tmp_path / folder / "program.json").read_text())
        wanted = solid_with_edges(from_json(document), edges_of(document), 1024).volume()
        assert measured(macro, tmp_path, **cells) == pytest.approx(wanted, rel=1e-4)
        # what the edit wrote begins with the same number
        assert measured((tmp_path / folder / "program.FCMacro").read_text(), tmp_path) == pytest.approx(wanted, rel=1e-4)


# --- the text itself


@pytest.mark.parametrize("name", [*SOLIDS, *OUTLINED_PARTS])
def test_the_macro_is_python_with_one_call_per_primitive(name):
    program = {**SOLIDS, **OUTLINED_PARTS}[name][0]
    text = to_freecad(program)
    compile(text, "program.FCMacro", "exec")
    build = text[text.index("\npart = ") :]
    assert len(re.findall(r"\b(?:add|extruded|turned|drafted)\(", build)) == sum(1 for _ in leaves(program))


def test_every_name_has_a_cell_and_a_unit():
    delivered = opened(every_bend())
    text = delivered.texts["program.FCMacro"]
    units = dict(re.findall(r'^    "(\w+)": "(mm|deg|)",$', text, re.MULTILINE))
    assert list(units) == list(delivered.values)
    assert units["plate_sides"] == ""
    assert units["profile2_arc_angle"] == "deg"
    assert units["plate_corner_radius"] == "mm"


def test_features_are_called_as_their_sizes():
    found = finish(*relations_of(PARTS["mount"]))
    text = to_freecad(found.program, found.parameters)
    called = set(re.findall(r'(?:add\("\w+"|extruded\(|turned\()(?:, )?"(\w+)"', text[text.index("\npart = ") :]))
    assert called
    assert all(any(name.startswith(f"{label}_") for name in found.parameters.values) for label in called)


def test_an_edit_rewrites_the_macro():
    delivered = opened(every_bend())
    after = change_values(delivered, {"plate_corner_radius": 5.5})
    assert "\nplate_corner_radius = 5.5\n" in after.texts["program.FCMacro"]
    changed = {**delivered.texts, "program.FCMacro": after.texts["program.FCMacro"]}
    document = to_json(delivered.program, None, delivered.constraints)
    with pytest.raises((ValueError, EditError), match=r"program\.FCMacro beside it begins with other names or values"):
        open_delivered(document, changed)
