"""The bench of coarse designs: what it asks OpenSCAD for, and what it counts."""

import json
import shutil
import sys
from pathlib import Path

import pytest

from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh
from imdim.program.tree import Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import coarse as bench


@pytest.mark.skipif(shutil.which("openscad") is None, reason="openscad is not installed")
def test_a_design_is_drawn_with_as_many_sides_as_are_asked_for(tmp_path):
    import trimesh

    volumes = [mesh_to_manifold(trimesh.load(bench.draw("cone", sides, tmp_path, "openscad"))).volume() for sides in (8, 16, 96)]
    assert volumes == sorted(volumes)
    assert volumes[0] < 0.95 * volumes[-1]


def test_a_part_is_compared_with_its_design_and_not_with_its_mesh(tmp_path):
    folder = tmp_path / "cone_16"
    folder.mkdir()
    to_trimesh(to_manifold(Primitive("box", (10.0, 10.0, 10.0)))).export(folder / "mesh.stl")
    (folder / "report.json").write_text(json.dumps({"scores": {"volume_iou": 0.9}, "result": {"primitives": 4}}))
    (folder / "fitted.json").write_text(json.dumps({"status": 0, "seconds": 3.0}))
    row = bench.score(tmp_path, "cone", 16, to_manifold(Primitive("box", (10.0, 10.0, 20.0))))
    assert row["same"] == pytest.approx(0.5)
    assert (row["iou"], row["features"], row["wanted"], row["seconds"]) == (0.9, 4, bench.DESIGNS["cone"].features, 3.0)


def test_a_part_without_a_program_counts_as_failed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(bench, "draw", lambda name, sides, folder, _: _disc(folder / f"{name}_{sides}.stl"))
    monkeypatch.setattr(bench.subprocess, "run", lambda *_, **__: bench.subprocess.CompletedProcess([], 3))
    assert bench.main([str(tmp_path), "--only", "cone", "--sides", "16,24"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split(" | ")[1:4] for line in said[2:4]] == [["0.0000", "0.0000", "failed"]] * 2
    assert said[-1].startswith("2 parts, 2 failed: 0 are the design's")


def _disc(path):
    to_trimesh(to_manifold(Primitive("cylinder", (5.0, 2.0)))).export(path)
    return path


def test_what_is_not_there_is_said_in_one_line(tmp_path, capsys):
    assert bench.main([str(tmp_path), "--only", "cube"]) == bench.BAD_INPUT
    assert bench.main([str(tmp_path), "--only", "cone", "--openscad", str(tmp_path / "none")]) == bench.BAD_INPUT
    assert [line[:10] for line in capsys.readouterr().err.splitlines()] == ["coarse.py:"] * 2
