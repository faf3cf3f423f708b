"""`imdim export`: every program of a front comes out as files that hold its solid; what cannot be is one line and status 2."""

import json

import pytest
import trimesh
from tests.planted import PARTS, box, cut, cylinder, union

from imdim.app.cli import main
from imdim.export.hole_names import hole_features
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program import codec, front
from imdim.program.edges import EdgeFeature, Face
from imdim.program.front import Choice
from imdim.program.tree import Program

CHOICES = [Choice(box(60, 40, 5, (0.0, 0.0, 2.5)), 0.4), Choice(PARTS["L bracket"], 0.0)]


@pytest.fixture
def front_file(tmp_path):
    path = tmp_path / "front.json"
    path.write_text(front.dumps(CHOICES, codec.Meta(center=(1.0, 2.0, 3.0), scale=0.5), picked=2))
    return path


def same(a: Program, b: Program) -> bool:
    return volume_iou(to_manifold(a), to_manifold(b)) > 1 - 1e-9


@pytest.mark.usefixtures("without_step")
@pytest.mark.parametrize(("pick", "expected"), [(["--pick", "1"], 0), (["--pick", "2"], 1), ([], 1)])
def test_the_picked_program_is_in_every_file(front_file, tmp_path, capsys, pick, expected):
    folder = tmp_path / "out"
    assert main(["export", str(front_file), *pick, "-o", str(folder)]) == 0
    program = CHOICES[expected].program
    document = json.loads((folder / "program.json").read_text())
    assert same(codec.from_json(document), program)
    assert codec.meta_of(document).center == (1.0, 2.0, 3.0)
    assert same(read_openscad((folder / "program.scad").read_text()), program)
    mesh = mesh_to_manifold(trimesh.load_mesh(folder / "mesh.stl"))
    assert volume_iou(mesh, to_manifold(program)) > 1 - 1e-6
    assert {p.name for p in folder.iterdir()} >= {"program.py", "mesh.glb", "mesh.3mf"}
    assert str(folder / "program.scad") in capsys.readouterr().out


@pytest.mark.usefixtures("without_step")
def test_a_results_folder_has_both(front_file, tmp_path):
    front_file.with_name("program.json").write_text(codec.dumps(PARTS["countersink"]))
    for pick, expected in (([], PARTS["countersink"]), (["--pick", "1"], CHOICES[0].program)):
        assert main(["export", str(tmp_path), *pick, "-o", str(tmp_path / "out")]) == 0
        assert same(read_openscad((tmp_path / "out" / "program.scad").read_text()), expected)


def test_a_program_is_exported_too(tmp_path):
    source = tmp_path / "program.json"
    source.write_text(codec.dumps(PARTS["countersink"]))
    assert main(["export", str(source), "-o", str(tmp_path / "out")]) == 0
    assert same(read_openscad((tmp_path / "out" / "program.scad").read_text()), PARTS["countersink"])


@pytest.mark.usefixtures("without_step")
def test_what_is_exported_has_names_to_edit(tmp_path):
    source = tmp_path / "program.json"
    holes = [cylinder(3, 5, (x, 0.0, 2.5)) for x in (-20.0, 20.0)]
    source.write_text(codec.dumps(cut(box(60, 40, 5, (0.0, 0.0, 2.5)), *holes)))
    assert main(["export", str(source), "-o", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "program.scad").read_text()
    assert "hole_diameter = 6;" in text
    wider = cut(box(60, 40, 5, (0.0, 0.0, 2.5)), *(cylinder(4, 5, (x, 0.0, 2.5)) for x in (-20.0, 20.0)))
    assert same(read_openscad(text, {"hole_diameter": 8}), wider)
    assert json.loads((tmp_path / "out" / "program.json").read_text())["constraints"]


@pytest.mark.usefixtures("without_step")
def test_a_hole_that_was_changed_by_hand_in_the_list_is_refused_in_a_line(tmp_path, capsys):
    source, out = tmp_path / "program.json", tmp_path / "out"
    plate = cut(box(60, 40, 5, (0.0, 0.0, 2.5)), cylinder(3, 5, (0.0, 0.0, 2.5)))
    document = json.loads(codec.dumps(plate, holes=hole_features(plate)))
    assert [hole["diameter"] for hole in document["holes"]] == [6]
    document["holes"][0]["diameter"] = 8
    source.write_text(json.dumps(document))
    assert main(["export", str(source), "-o", str(out)]) == 2
    assert capsys.readouterr().err.startswith(f"imdim: {source}: $.holes[0] of program.json is not what its primitives make: change a hole")
    assert not out.exists()
    del document["holes"]
    source.write_text(json.dumps(document))
    assert main(["export", str(source), "-o", str(out)]) == 0
    assert json.loads((out / "program.json").read_text())["holes"][0]["diameter"] == 6


@pytest.mark.usefixtures("without_step")
def test_edges_that_a_change_by_hand_took_are_told(tmp_path, capsys):
    source, rim = tmp_path / "program.json", tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
    whole = box(60, 40, 5)
    for program, said in ((whole, ""), (union(whole, box(10, 60, 20, (30.0, 0.0, 5.0))), "  chamfer 1: 1 of 4 edges no more\n")):
        source.write_text(codec.dumps(program, edges=[EdgeFeature("chamfer", (1.0,), rim)]))
        assert main(["export", str(source), "-o", str(tmp_path / "out")]) == 0
        assert "".join(line for line in capsys.readouterr().out.splitlines(keepends=True) if "chamfer 1:" in line) == said


@pytest.mark.usefixtures("without_step")
def test_an_export_of_an_export_has_its_names(tmp_path):
    """A cutter that overshoots is wider there than what one sees of it, and only the texts know that."""
    source, out, again = tmp_path / "program.json", tmp_path / "out", tmp_path / "again"
    source.write_text(codec.dumps(PARTS["countersink"]))
    assert main(["export", str(source), "-o", str(out)]) == 0
    assert main(["export", str(out), "-o", str(again), "--segments", "24"]) == 0
    for name in ("program.scad", "program.py", "program.FCMacro"):
        assert (again / name).read_text() == (out / name).read_text().replace("$fn = 96;", "$fn = 24;")
    assert len(trimesh.load_mesh(again / "mesh.stl").faces) < len(trimesh.load_mesh(out / "mesh.stl").faces)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["front.json", "--pick", "3"], "pick must lie in 1..2, got 3"),
        (["front.json", "--pick", "0"], "pick must lie in 1..2, got 0"),
        (["missing.json"], "No such file"),
        (["broken.json"], "not JSON"),
        (["program.json", "--pick", "1"], "nothing to pick"),
        (["front.json", "--segments", "2"], "at least 3, got 2"),
    ],
)
def test_bad_input_is_one_line(front_file, tmp_path, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "program.json").write_text(codec.dumps(box(1, 1, 1)))
    assert main(["export", *arguments, "-o", "out"]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
