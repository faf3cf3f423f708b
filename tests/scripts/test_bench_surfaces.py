"""The script that compares round faces of STEP files with those of true parts counts what is lost, strange and not there at all."""

import json
import sys
from pathlib import Path

import pytest
from tests.planted import box, cut, cylinder

from imdim.export.step import write_step

pytest.importorskip("OCP", reason="the extra [step] is not installed")
sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import surfaces


def test_sizes_are_found_lost_and_strange(tmp_path, monkeypatch, capsys):
    for name in ("plate", "nothing"):
        (tmp_path / name).mkdir()
    plate = cut(box(40, 30, 6), cylinder(3.03, 8, (-10.0, 0.0, 0.0)), cylinder(5.0, 8, (10.0, 0.0, 0.0)))
    write_step(plate, tmp_path / "plate" / "program.step")
    plain = {"faces": 8, "operations_in_script": {"box": 1}}
    truth = {
        "plate": {**plain, "operations_in_script": {"fillet": 2}, "surface_parameters": {"cylinder_radius": {"3.0": 1, "4.0": 2}}},
        "nothing": {**plain, "surface_parameters": {"torus_major_minor": {"5.0/1.0": 1}}},
        "elsewhere": {**plain, "surface_parameters": {}},
    }
    (tmp_path / "truth.json").write_text(json.dumps({"parts": truth}))
    monkeypatch.setattr(sys, "argv", ["surfaces.py", str(tmp_path), "--truth", str(tmp_path / "truth.json")])
    assert surfaces.main() == 0
    said = capsys.readouterr().out
    assert "plate: 1 of 2, 1 of 2 strange, fillets 2" in said  # 3.03 is within two percent of 3
    assert "lost: cylinder 4\n" in said
    assert "strange: cylinder 5\n" in said
    assert "nothing: no STEP, 0 of 1, 0 of 0 strange" in said
    assert "elsewhere: not in " in said
    assert "2 parts, 1 with STEP: 1 of 3 sizes" in said
    assert "1 parts with fillets or chamfers in their script, 1 with STEP: 1 of 2 sizes" in said
