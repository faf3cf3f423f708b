"""The benchmark counts failures, keeps the limit and measures memory; its parts are boxes whose scores are known."""

from __future__ import annotations

import csv
import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from imdim.geometry.cloud import target_from
from imdim.geometry.scan import Condition, parse_condition, scan

PATH = Path(__file__).parents[1] / "scripts" / "benchmark.py"
spec = importlib.util.spec_from_file_location("benchmark", PATH)
assert spec is not None
assert spec.loader is not None
benchmark = importlib.util.module_from_spec(spec)
sys.modules["benchmark"] = benchmark
spec.loader.exec_module(benchmark)

# stands in for `imdim fit`: delivers a unit cube whatever the part is, and fails for the part named "bad"
STAND_IN = """
import json, pathlib, sys
source, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
if source.stem == "bad":
    sys.exit("bad.stl: 0 points")
folder.mkdir(parents=True)
(folder / "program.scad").write_text("$fn = 96;\\ncube([1, 1, 1], center = true);\\n")
(folder / "report.json").write_text(json.dumps({"stop": "finished", "timing": {"stages_s": {"a": 1.5, "b": 1.0}}}))
"""


@pytest.fixture
def parts(tmp_path):
    folder = tmp_path / "parts"
    folder.mkdir()
    for name, size in (("bad", 1.0), ("cube", 1.0), ("half", 2.0)):
        trimesh.creation.box((1.0, 1.0, size)).export(folder / f"{name}.stl")
    (folder / "human.json").write_text(json.dumps({"cube": {"primitives": 1}, "half": {"primitives": 1}, "bad": {"primitives": 9}}))
    return folder


def test_a_folder_becomes_a_table(parts, tmp_path, monkeypatch, capsys):
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    monkeypatch.setattr(benchmark, "COMMAND", [sys.executable, str(tmp_path / "stand_in.py")])
    arguments = [str(parts), "--jobs", "2", "--out", str(tmp_path / "out"), "--set", "a=1", "--set", "b=2"]
    monkeypatch.setattr(sys, "argv", ["benchmark.py", *arguments])
    benchmark.main()
    with (tmp_path / "out" / "table.csv").open() as file:
        rows = {row["part"]: row for row in csv.DictReader(file)}
    assert float(rows["cube"]["iou"]) == pytest.approx(1.0)
    assert float(rows["half"]["iou"]) == pytest.approx(0.5)
    assert float(rows["half"]["hausdorff"]) == pytest.approx(0.5 / 6**0.5, rel=1e-3)
    assert float(rows["half"]["search_s"]) == 2.5
    assert (rows["bad"]["iou"], rows["bad"]["primitives"]) == ("0.0", "")
    assert rows["bad"]["stop"] == "FAILED, exit 1: bad.stl: 0 points"
    said = capsys.readouterr().out
    for line in (
        "2 at a time, a=1, b=2",
        "3 parts, 1 failed",
        "IoU >= 0.99: 1 of 3",
        "mean IoU 0.5",
        "no more primitives than the reference: 2 of 3",
    ):
        assert line in said
    assert "IoU >= 0.99 and no more primitives than the reference: 1 of 3 (33 %)" in said


def test_an_independent_scorer_is_asked(parts, tmp_path):
    scorer = tmp_path / "score.py"
    scorer.write_text('import json, sys\nprint(json.dumps({"iou": 0.75, "hausdorff": 20, "leaves": len(sys.argv)}))\n')
    assert benchmark.score(parts / "cube.stl", tmp_path / "x.scad", scorer) == (0.75, 0.02, 3)


def test_a_part_that_does_not_end_is_ended(tmp_path):
    status, _, seconds, _ = benchmark.measured([sys.executable, "-c", "import time; time.sleep(60)"], 0.5, tmp_path / "log")
    assert status == -9
    assert 0.5 <= seconds < 20


def test_memory_is_that_of_the_process_and_its_children(tmp_path):
    inner = "x = bytearray(100 * 2**20); import time; time.sleep(0.4)"
    outer = f"import subprocess, sys; x = bytearray(50 * 2**20); subprocess.run([sys.executable, '-c', {inner!r}])"
    status, _, _, peak = benchmark.measured([sys.executable, "-c", outer], 30.0, tmp_path / "log")
    assert status == 0
    assert 150 < peak < 230


def test_an_unknown_part_is_one_line(parts):
    with pytest.raises(SystemExit, match="no part named nothing"):
        benchmark.find_parts(parts, {"nothing"}, set())


def test_reference_rivals_are_those_with_an_iou():
    better = benchmark.Row("a", iou=0.98, primitives=9, reference=10, reference_iou=0.97)
    longer = benchmark.Row("b", iou=0.99, primitives=50, reference=50, reference_iou=0.97)
    failed = benchmark.Row("c", reference=10, reference_iou=0.9, stop="FAILED")
    lines = benchmark.summary([better, longer, failed], 60.0)
    assert "IoU at least the reference's and fewer primitives: 1 of 3 (33 %)" in lines
    assert "IoU at least the reference's and fewer primitives, among those of at most 30 reference primitives: 1 of 2 (50 %)" in lines


def test_conditions_are_read():
    assert parse_condition("mesh") is None
    assert parse_condition("cloud+normals") == Condition(normals=True)
    assert parse_condition("noise=0.5%+outliers=2%+views=3") == Condition(noise=0.005, outliers=0.02, views=3)
    for wrong in ("clod", "noise", "views=9", "normals=1"):
        with pytest.raises(ValueError, match=wrong.split("=")[0]):
            parse_condition(wrong)


def test_a_scan_has_the_noise_and_the_outliers_that_were_asked_for():
    mesh = target_from(trimesh.creation.box((3.0, 4.0, 12.0))).mesh
    rng = np.random.default_rng(0)
    points, _ = scan(mesh, Condition(noise=0.005), rng)
    # the nearest face's distance is one component of the noise: a half-normal with mean sigma sqrt(2 / pi), sigma 0.005 * 13
    gap = np.abs(np.abs(points) - [1.5, 2, 6]).min(axis=1)
    assert gap.mean() == pytest.approx(0.065 * (2 / np.pi) ** 0.5, rel=0.05)
    points, normals = scan(mesh, Condition(normals=True, outliers=0.1), rng)
    off = np.abs(np.abs(points) - [1.5, 2, 6]).min(axis=1) > 1e-6
    assert off.mean() == pytest.approx(0.1, abs=0.005)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)


def test_one_view_sees_three_faces_of_a_box_and_not_into_a_blind_side():
    mesh = target_from(trimesh.creation.box()).mesh
    points, _ = scan(mesh, Condition(views=1), np.random.default_rng(0))
    assert len(points) == 8192
    assert points.max(axis=1) == pytest.approx(0.5)
    assert points.min() > -0.5
