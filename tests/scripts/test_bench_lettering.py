"""The bench of planted text: what it plants, and what it counts."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from imdim.geometry.solid import mesh_to_manifold, symmetric_difference_volume, to_trimesh
from imdim.program.codec import dumps
from imdim.program.tree import Primitive
from imdim.reconstruction.text_aside import set_text_aside
from imdim.target.target import target_from

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import lettering as bench

BOX = Primitive("box", (80.0, 30.0, 6.0))


@pytest.mark.skipif(shutil.which("openscad") is None, reason="openscad is not installed")
@pytest.mark.parametrize("number", range(8))
def test_planted_text_is_one_part_with_the_plain_one_and_is_taken_off(number):
    planted = bench.plant(np.random.default_rng([0, number]), number)
    assert len(planted.solid.decompose()) == len(planted.plain.decompose()) == 1
    assert 1e-4 < symmetric_difference_volume(planted.solid, planted.plain) / planted.plain.volume() < 0.05
    bare = set_text_aside(target_from(to_trimesh(planted.solid)))
    assert symmetric_difference_volume(mesh_to_manifold(bare.target.mesh), planted.plain) < 1e-6 * planted.plain.volume()


def test_what_comes_back_is_counted(tmp_path):
    plain = bench._box(80, 30, -3, 3)
    to_trimesh(plain).export(tmp_path / "mesh.stl")
    (tmp_path / "program.json").write_text(dumps(BOX))
    report = {"scores": {"volume_iou": 0.99}, "verdict": {"regions": [{"kind": "text"}]}}
    (tmp_path / "report.json").write_text(json.dumps(report))
    (tmp_path / "fitted.json").write_text(json.dumps({"status": 0, "seconds": 2.0}))
    lettered = plain + bench._box(40, 10, 2, 4)
    row = bench.score(tmp_path, bench.Planted(lettered, plain))
    assert row.items() >= {"aside": True, "told": True, "failed": False, "features": 1, "curves": 0, "iou": 0.99, "seconds": 2.0}.items()
    assert row["text"] == pytest.approx(400 / (80 * 30 * 6))
    assert not bench.score(tmp_path, bench.Planted(plain, lettered))["aside"]
    assert bench.totals([row, row]).startswith("2 parts: 2 without their text, 2 told by the verdict, 0 failed; features 2 (median 1)")
