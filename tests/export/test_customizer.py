"""Parameters in OpenSCAD's Customizer: what OpenSCAD itself finds in the texts, and that sliders change nothing."""

import json
import re
import shutil
import subprocess
from decimal import Decimal
from pathlib import Path

import pytest
from tests.export.test_drawn_corners import every_bend
from tests.export.test_edge_text import delivered as blended
from tests.export.test_outlines import opened
from tests.export.test_parameters import FLANGE, MOUNT, ROW

from imdim.export.customizer import MOST, slider
from imdim.export.delivered import Delivered, is_count, read_values
from imdim.export.edit import change_values
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.program.tree import Primitive

ANNOTATED = re.compile(r'//Group\("(.*)"\)\n//Parameter\((.*)\)\n(\w+) = (.*);')
OFFERED = re.compile(r"^(\w+) = (.*); // \[(.*):(.*):(.*)\]$", re.MULTILINE)
PROGRAMS = {"mount": MOUNT, "row": ROW, "flange": FLANGE, "bends": every_bend()}


def delivered(name: str) -> Delivered:
    return blended() if name == "blends" else opened(PROGRAMS[name])


def export(text: str, folder: Path, kind: str, *options: str) -> str:
    """The text of a file that OpenSCAD writes of another."""
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (folder / "part.scad").write_text(text)
    subprocess.run([tool, "-q", *options, "-o", f"part.{kind}", "part.scad"], check=True, capture_output=True, timeout=120, cwd=folder)
    return (folder / f"part.{kind}").read_text()


@pytest.mark.tool
@pytest.mark.parametrize("name", [*PROGRAMS, "blends"])
def test_openscad_finds_sections_and_sliders(name, tmp_path):
    given = delivered(name)
    for file, counts in (("program.scad", {}), ("program.loops.scad", given.counts)):
        if file not in given.texts:
            continue
        text = given.texts[file]
        found = {name: (group, limits) for group, limits, name, _ in ANNOTATED.findall(export(text, tmp_path, "ast"))}
        assert found.keys() - {"edges"} == {*given.values, *counts}
        offered = {name: f"[{low} : {step} : {high}]" for name, _, low, step, high in OFFERED.findall(text)}
        assert offered
        for parameter, (group, limits) in found.items():
            assert parameter.startswith(("bolt", "edges", "fillet", "chamfer", group.lower().replace(" ", "_"))), group
            assert limits == offered.get(parameter, limits)


@pytest.mark.tool
@pytest.mark.parametrize("name", [*PROGRAMS, "blends"])
def test_sliders_change_nothing(name, tmp_path):
    text = delivered(name).texts["program.scad"]
    bare = re.sub(r"(?m) // \[.*\]$|^/\* .* \*/$", "", text)
    assert len(bare) < len(text)
    assert export(text, tmp_path, "csg") == export(bare, tmp_path, "csg")
    assert read_openscad(text) == read_openscad(bare)
    assert read_values(text) == read_values(bare)


@pytest.mark.tool
def test_a_set_of_the_customizer_is_an_edit(tmp_path):
    given = delivered("mount")
    sets = {"fileFormatVersion": "1", "parameterSets": {"thick": {"plate_thickness": "9", "hole_diameter": "4.5"}}}
    (tmp_path / "sets.json").write_text(json.dumps(sets))
    edited = change_values(given, {"plate_thickness": 9.0, "hole_diameter": 4.5}).texts["program.scad"]
    written = export(given.texts["program.scad"], tmp_path, "csg", "-p", "sets.json", "-P", "thick")
    assert written == export(edited, tmp_path, "csg")


def test_an_edit_moves_the_slider():
    after = change_values(delivered("mount"), {"plate_thickness": 9.5, "hole_diameter": 4.123456})
    assert "\nplate_thickness = 9.5; // [4.8:0.1:19]\n" in after.texts["program.scad"]
    assert "\nhole_diameter = 4.123456;\n" in after.texts["program.scad"]


@pytest.mark.parametrize("name", [*PROGRAMS, "blends"])
def test_values_lie_on_their_sliders(name):
    rows = [row for text in delivered(name).texts.values() for row in OFFERED.findall(text)]
    assert rows
    for parameter, *numbers in rows:
        value, low, step, high = map(Decimal, numbers)
        assert low <= value <= high, parameter
        assert (value - low) % step == (high - low) % step == 0, parameter
        assert (high - low) / step <= MOST, parameter
        assert step == 1 or not is_count(parameter)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("plate_length", "80", "[40:1:160]"),
        ("plate_thickness", "8", "[4:0.1:16]"),
        ("block_y", "-21.35", "[-42.7:0.01:-10.68]"),
        ("hole_x", "0", ""),
        ("plate_length", "80.123456", ""),
        ("profile_angle", "200", "[100:1:360]"),
        ("plate_sides", "5", "[3:1:10]"),
    ],
)
def test_a_slider_goes_from_half_to_twice(name, text, expected):
    assert slider(name, text).removeprefix(" // ") == expected


def test_counts_of_copies_are_whole():
    assert slider("hole_count", "3", is_copies=True) == " // [2:1:6]"
    assert "/* [Hole] */" in delivered("row").texts["program.loops.scad"]


def test_a_text_without_names_has_no_sections():
    assert "/*" not in to_openscad(Primitive("sphere", (2.0,)))
