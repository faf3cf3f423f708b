"""`imdim edit`: files whole or not at all, one line and status 2 for what cannot be."""

import json
import re
import subprocess
import sys

import pytest
import trimesh
from tests.planted import box, cut, cylinder

from imdim.app.cli import main
from imdim.app.export import find_document
from imdim.geometry.solid import to_manifold
from imdim.program import codec
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import Combine

PLATE = cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0)))
SAME = Constraint("equal", (Ref(1, "r"), Ref(2, "r")), name="hole_radius")


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "out" / "program.json"
    path.parent.mkdir()
    path.write_text(codec.dumps(PLATE, codec.Meta(), [SAME]))
    return path


def test_the_edited_folder(source, tmp_path, capsys):
    folder = tmp_path / "new"
    assert main(["edit", str(source), "--set", "hole_diameter=6.4", "--set", "plate_thickness=9", "-o", str(folder)]) == 0
    assert {p.name for p in folder.iterdir()} == {
        "program.json",
        "program.scad",
        "program.py",
        "program.cq.py",
        "program.FCMacro",
        "program.ucad",
        "mesh.stl",
        "mesh.glb",
        "mesh.3mf",
        "edit.png",
    }
    sizes = [part["size"] for part in json.loads((folder / "program.json").read_text())["program"]["parts"]]
    assert (sizes[0]["sz"], sizes[1]["r"], sizes[2]["r"]) == (9, 3.2, 3.2)
    assert trimesh.load_mesh(folder / "mesh.stl").extents == pytest.approx([80, 50, 9])
    assert str(folder / "program.scad") in capsys.readouterr().out


def test_the_list(source, capsys):
    assert main(["edit", str(source), "--list"]) == 0
    assert "hole_diameter     6  diameter of hole #1, #2\n" in capsys.readouterr().out


@pytest.mark.parametrize("named", ["", "program.scad", "program.py"])
def test_a_results_folder_or_a_text_in_it_names_the_program(source, capsys, named):
    for text in ("program.scad", "program.py"):
        (source.parent / text).write_text("")
    assert find_document(source.parent / named) == source
    assert find_document(source.parent / "front.json") == source.parent / "front.json"
    for text in ("program.scad", "program.py"):
        (source.parent / text).unlink()
    assert main(["edit", str(source.parent), "--list"]) == 0
    assert "hole_diameter     6  diameter of hole #1, #2\n" in capsys.readouterr().out


def test_without_a_folder_it_says_what_it_needs(source, tmp_path):
    command = [sys.executable, "-m", "imdim.app.cli", "edit", source, "--set", "holes=3"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert (done.returncode, done.stderr) == (2, "imdim: imdim edit needs --set NAME=VALUE or --untie NAME, and -o FOLDER, or --list\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["out/program.json", "--set", "hole_diamter=6"], "nearest are hole_diameter"),
        (["out/program.json", "--set", "hole_diameter=nan"], "finite number"),
        (["out/program.json", "--set", "hole_diameter=-1"], "positive number, got -1"),
        (["out/program.json", "--set", "hole_diameter=500"], "no solid is left"),
        (["out/program.json", "--set", "hole_diameter"], "expected NAME=NUMBER"),
        (["out/program.json", "--set", "hole_diameter=wide"], "expected NAME=NUMBER"),
        (["out/program.json", "--set", "hole_diameter=3", "--set", "hole_diameter=4"], "given twice"),
        (["missing.json", "--set", "hole_diameter=3"], "No such file"),
        (["broken.json", "--set", "hole_diameter=3"], "not JSON"),
        (["notes", "--set", "hole_diameter=3"], "notes/program.json: No such file"),
    ],
)
def test_bad_input_is_one_line(source, tmp_path, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "notes").mkdir()
    assert main(["edit", *arguments, "-o", "new"]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_folders_that_are_not_ours_stay(source, tmp_path, capsys):
    for folder in (source.parent, tmp_path):
        assert main(["edit", str(source), "--set", "hole_diameter=6.4", "-o", str(folder)]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert source.exists()


def test_an_edit_says_what_it_did_to_the_solid(source, tmp_path, capsys):
    assert main(["edit", str(source), "--set", "plate_thickness=9", "-o", str(tmp_path / "new")]) == 0
    said = capsys.readouterr().out.splitlines()[-3:]
    assert said[0] == "size    80 x 50 x 6 -> 80 x 50 x 9"
    assert re.fullmatch(r"volume  2366\d\.?\d* -> 3549\d\.?\d* \(\+50\.0%\)", said[1])
    assert said[2] == "in kind as before: 1 body, 2 through-holes"


def test_an_edit_that_closes_or_opens_something_says_so_and_is_refused_if_strict(source, tmp_path, capsys):
    arguments = ["edit", str(source), "--set", "hole_diameter=52", "-o", str(tmp_path / "new")]
    assert main([*arguments, "--strict"]) == 2
    assert capsys.readouterr().err == f"imdim: {source}: hole_diameter = 52: 1 body became 6, 2 through-holes became 0\n"
    assert not (tmp_path / "new").exists()
    assert main(arguments) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "changed in kind: 1 body became 6, 2 through-holes became 0"


def test_a_document_of_a_few_lines_that_unfolds_to_thousands_of_primitives_is_listed_at_once(tmp_path, capsys):
    """Thirteen repeats of two, one in the other: equations for 8,192 boxes would take more memory than machines have."""
    node = {"kind": "box", "size": {"sx": 1.0, "sy": 1.0, "sz": 1.0}, "center": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
    for k in range(13):
        node = {"repeat": "linear", "count": 2, "step": [2.0 * 2 ** (k // 3) * (k % 3 == axis) for axis in range(3)], "part": node}
    plain = json.loads(codec.dumps(box(1, 1, 1), codec.Meta()))
    path = tmp_path / "program.json"
    path.write_text(json.dumps({**plain, "version": 3, "program": node}))
    assert main(["edit", str(path), "--list"]) == 0
    assert [line.split()[1:] for line in capsys.readouterr().out.splitlines()] == [["2", "how", "many", "copies", "there", "are"]] * 13


def test_what_the_last_digits_open_is_not_told_of_the_edit(tmp_path, capsys):
    """program.json leaves a gap of 1e-10 between two blocks, which its texts have no digits for."""
    path = tmp_path / "out" / "program.json"
    path.parent.mkdir()
    blocks = Combine("union", box(20, 20, 10), box(20, 20, 10, (0, 0, 10 + 1e-10)))
    assert len(to_manifold(blocks).decompose()) == 2
    path.write_text(codec.dumps(blocks, codec.Meta()))
    name = next(line.split()[0] for line in listed(path, capsys) if "length along x of body #0" in line)
    assert main(["edit", str(path), "--set", f"{name}=25", "--strict", "-o", str(tmp_path / "new")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "in kind as before: 1 body"


def listed(path, capsys):
    assert main(["edit", str(path), "--list"]) == 0
    return capsys.readouterr().out.splitlines()


def test_ties_are_listed_and_broken(source, tmp_path, capsys):
    assert "ties (--untie NAME)\nhole_diameter of hole #1, #2\n" in "\n".join([*listed(source, capsys), ""])
    assert main(["edit", str(source), "--untie", "hole_diameter", "--list"]) == 0
    assert "\nhole2_diameter " in capsys.readouterr().out
    arguments = ["--untie", "hole_diameter", "--set", "hole2_diameter=7", "-o", str(tmp_path / "new")]
    assert main(["edit", str(source), *arguments]) == 0
    said = capsys.readouterr().out
    assert "hole_diameter is now hole_diameter (hole #1), hole2_diameter (hole2 #2)\n" in said
    sizes = [part["size"] for part in json.loads((tmp_path / "new" / "program.json").read_text())["program"]["parts"]]
    assert (sizes[1]["r"], sizes[2]["r"]) == (3, 3.5)
    assert not any("ties" in line for line in listed(tmp_path / "new" / "program.json", capsys))
    for wrong, message in (("hole_diameter=1,x", "expected NAME or NAME=PRIMITIVE"), ("plate_width", "nothing to untie")):
        assert main(["edit", str(source), "--untie", wrong, "-o", str(tmp_path / "other")]) == 2
        assert message in (error := capsys.readouterr().err)
        assert error.count("\n") == 1
