"""The comparison: its floors against brute force, its peers on parts they must get right, its table, and what it does about failures."""

from __future__ import annotations

import csv
import json
import sys
from argparse import Namespace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh

from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou

SCRIPTS = Path(__file__).parents[1] / "scripts" / "peers"
sys.path += [str(SCRIPTS), str(SCRIPTS.with_name("bench"))]  # the scripts import each other by name

import compare  # noqa: E402
import compare_peers  # noqa: E402
from compare_table import Row, summary, text, wide  # noqa: E402
from peer_boxes import bounding, cover, merged, voxels  # noqa: E402


def cube(low: tuple, high: tuple) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def joined(*boxes: trimesh.Trimesh) -> trimesh.Trimesh:
    solid = mesh_to_manifold(boxes[0])
    for box in boxes[1:]:
        solid += mesh_to_manifold(box)
    return to_trimesh(solid)


L_SHAPE = joined(cube((0, 0, 0), (16, 8, 4)), cube((0, 0, 0), (4, 8, 12)))


@pytest.mark.parametrize("floor", [bounding, cover])
def test_a_floor_is_exact_on_a_box(floor):
    mesh = cube((-1.0, 2.0, 3.0), (1.5, 2.7, 9.0))
    program, parts, _ = floor(mesh, 0)
    assert parts == 1
    assert volume_iou(to_manifold(program), mesh_to_manifold(mesh)) == pytest.approx(1.0, abs=1e-9)


def test_the_voxels_are_exact_on_boxes_along_the_grid():
    program, parts, _ = cover(L_SHAPE, 0)
    assert parts == 2
    assert volume_iou(to_manifold(program), mesh_to_manifold(L_SHAPE)) == pytest.approx(1.0, abs=1e-9)


def test_the_box_of_an_l_holds_its_share():
    program, _, _ = bounding(L_SHAPE, 0)
    assert volume_iou(to_manifold(program), mesh_to_manifold(L_SHAPE)) == pytest.approx((16 * 4 + 4 * 8) / (16 * 12))


def test_boxes_hold_each_full_cell_once_and_no_other():
    full = np.random.default_rng(0).random((7, 5, 9)) < 0.6
    held = np.zeros(full.shape, int)
    for start, stop in merged(full):
        held[tuple(map(slice, start, stop))] += 1
    assert (held == full).all()


def test_the_cover_of_a_ball_agrees_with_points_thrown_at_it():
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=3.0)
    iou = volume_iou(to_manifold(cover(mesh, 0)[0]), mesh_to_manifold(mesh))
    low, cell, full = voxels(mesh)
    points = np.random.default_rng(0).uniform(-3, 3, (200_000, 3))
    held = full[tuple(np.minimum((points - low) // cell, np.array(full.shape) - 1).astype(int).T)]
    inside = np.linalg.norm(points, axis=1) < 3
    # the mesh of 20,480 faces lies within 0.1 % of the ball's volume, and so many points err by 0.2 %
    assert iou == pytest.approx((held & inside).sum() / (held | inside).sum(), abs=5e-3)


PARTS = {"box": cube((0, 0, 0), (4, 3, 2)), "l": L_SHAPE}


@pytest.mark.parametrize(("peer", "part", "least"), [("coacd", "l", 0.98), ("pyransac3d", "box", 0.9), ("build123d", "box", 0.999)])
def test_a_package_gets_an_easy_part_right(peer, part, least, tmp_path):
    if find_spec(compare_peers.PEERS[peer].package) is None:
        pytest.skip(f"{peer} is not installed")
    path = tmp_path / f"{part}.stl"
    PARTS[part].export(path)
    entrant = next(compare.entrants(given(peers=[peer], limit=120.0)))
    row = compare.compete(entrant, path, path, tmp_path, None)
    assert row.failure == ""
    assert row.iou >= least
    assert row.parts >= 1


def given(**changed) -> Namespace:
    plain = {"peers": [], "ablate": [], "budget": 5.0, "limit": 30.0, "seed": 0, "condition": "mesh", "scorer": None, "clock": "wall"}
    return Namespace(**{**plain, **changed})


def python(code: str, limit: float = 30.0) -> compare.Entrant:
    return compare.Entrant("stand-in", (sys.executable, "-c", code, "{target}", "{folder}"), limit)


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "part.stl"
    trimesh.creation.box((1.0, 1.0, 1.0)).export(path)
    return path


ANSWERING = "import pathlib, sys; f = pathlib.Path(sys.argv[2]); f.mkdir(); (f / 'program.scad').write_text({!r}); {}"


@pytest.mark.parametrize(
    ("code", "limit", "failure"),
    [
        ("import time; time.sleep(60)", 0.5, "took more than 0.5 s and was ended"),
        ("import os; os.abort()", 30.0, "ended by signal SIGABRT"),
        ("import sys; sys.exit('part.stl: nothing there')", 30.0, "part.stl: nothing there"),
        ("pass", 30.0, "no answer"),
        (ANSWERING.format("sphere(", "0"), 30.0, "not scored"),
        (ANSWERING.format("$fn = 96;\ncube([1, 1, 1], center = true);\n", "import os; os.abort()"), 30.0, "ended by signal SIGABRT"),
    ],
)
def test_what_goes_wrong_is_the_entrants_own_failure(part, tmp_path, code, limit, failure):
    row = compare.compete(python(code, limit), part, part, tmp_path, None)
    assert failure in row.failure
    assert (row.iou, row.hausdorff, row.parts) == (0.0, float("inf"), None)
    assert row.seconds < 20


def test_by_the_processors_clock_waiting_costs_nothing(part, tmp_path):
    code = "import time; time.sleep(1.5); " + ANSWERING.format("$fn = 96;\ncube([1, 1, 1], center = true);\n", "0")
    row = compare.compete(python(code, 0.8), part, part, tmp_path, None, "processor")
    assert (row.failure, row.iou) == ("", pytest.approx(1.0))
    assert row.seconds < 1.5
    (own,) = compare.entrants(given(peers=["imdim"], clock="processor"))
    assert own.command[1].endswith("processor.py")


def test_a_scorer_that_takes_an_answer_for_no_solid_is_believed(part, tmp_path):
    scorer = tmp_path / "score.py"
    scorer.write_text('print(\'{"iou": 0.0, "hausdorff": 5.0, "pred_ok": "NotManifold"}\')')
    row = compare.compete(python(ANSWERING.format("$fn = 96;\ncube([1, 1, 1], center = true);\n", "0")), part, part, tmp_path, scorer)
    assert row.failure == "not scored: the scorer takes it for no solid (NotManifold)"


def test_a_row_is_kept_until_its_command_changes(part, tmp_path):
    count = tmp_path / "count"
    code = f"open({str(count)!r}, 'a').write('x'); " + ANSWERING.format("$fn = 96;\ncube([1, 1, 1], center = true);\n", "0")
    args = given(out=tmp_path / "out")
    rows = [compare.kept_or_run(entrant, part, args) for entrant in (python(code), python(code), python(code + " "))]
    assert [row.iou for row in rows] == pytest.approx([1.0] * 3)
    assert rows[0] == rows[1]
    assert count.read_text() == "xx"


def test_a_folder_becomes_one_table(tmp_path, monkeypatch, capsys):
    folder, out = tmp_path / "parts", tmp_path / "out"
    folder.mkdir()
    for name, size in (("a", 1.0), ("b", 2.0), ("c", 3.0)):
        cube((0, 0, 0), (1, 1, size)).export(folder / f"{name}.stl")
    (folder / "inversecsg.json").write_text(json.dumps({"a": {"primitives": 7, "iou": 0.9, "hausdorff": 0.02}, "b": {"primitives": 9}}))
    arguments = ["compare.py", str(folder), "--peers", "box", "--every", "2", "--out", str(out)]
    monkeypatch.setattr(sys, "argv", arguments)
    compare.main()
    with (out / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(r["part"], r["entrant"], r["reference"]) for r in rows] == [
        ("a", "InverseCSG (published)", ""),
        ("a", "box", "7"),
        ("c", "box", ""),
    ]
    assert float(rows[2]["iou"]) == pytest.approx(1.0)
    assert "| a | 0.900 (7) | 1.000 (1) |" in capsys.readouterr().out


def test_missing_packages_are_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(compare_peers, "find_spec", lambda name: None)
    monkeypatch.setattr(sys, "argv", ["compare.py", str(tmp_path), "--peers", "box,coacd,build123d", "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        compare.main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said == 'compare.py: not installed: coacd, build123d; pip install "imdim[peers]", or leave them out of --peers\n'
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--peers", "box,cgal"], "no peer named cgal"),
        (["--peers", "box", "--every", "0"], "--every 0"),
        (["--peers", "box,imdim", "--condition", "cloud"], "box need a mesh"),
    ],
)
def test_arguments_that_cannot_be_are_one_line(monkeypatch, capsys, tmp_path, arguments, line):
    monkeypatch.setattr(sys, "argv", ["compare.py", str(tmp_path), *arguments, "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit):
        compare.main()
    said = capsys.readouterr().err
    assert line in said
    assert said.count("\n") == 1


def test_failures_count_in_the_summary():
    rows = [Row("x", "a", 1.0, 0.1, 3, seconds=1.0), Row("x", "b", 0.5, 0.3, 5, seconds=2.0), Row("x", "c", seconds=60.0, failure="hung")]
    cells = [cell.strip() for cell in summary(rows).splitlines()[-1].strip("|").split("|")]
    assert cells == ["x", "3", "1", "0.5000", "0.5000", "0.3000", "4", "", "2.0", "60.0"]
    assert summary(rows[:2]).splitlines()[-1].split("|")[8].strip() == "8"
    assert summary([*rows[:1], *rows[2:], *rows[2:]]).splitlines()[-1].split("|")[6].strip() == "inf"


def test_the_table_sets_parts_side_by_side():
    rows = [Row("x", "b", 0.5, 0.3, 5), Row("x", "a", 1.0, 0.1, 3), Row("y z", "a", failure="no | answer")]
    assert wide(rows).splitlines() == ["| part | x | y z |", "| --- | --- | --- |", "| a | 1.000 (3) | - |", "| b | 0.500 (5) |  |"]
    page = text(rows, "title")
    assert "On the 1 parts that all have run:" in page
    assert "| a | y z | 0.0000 | inf |  |  |  | FAILED: no \\| answer |" in page
