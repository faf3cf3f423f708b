"""What `drafts.py` plants, and what it calls found."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.codec import dumps
from imdim.program.tree import Program, leaves, map_leaves

BENCH = Path(__file__).parents[2] / "scripts" / "bench"


@pytest.fixture(scope="module")
def bench():
    sys.path.insert(0, str(BENCH))
    try:
        import drafts

        yield drafts
    finally:
        sys.path.remove(str(BENCH))


def test_parts_are_in_one_piece_and_have_a_draft(bench):
    for number in range(24):
        program = bench.plant(np.random.default_rng([0, number]), number)
        assert len(to_manifold(program).decompose()) == 1
        drafts = {leaf.size[1] for leaf in leaves(program) if leaf.kind == "drafted"}
        assert drafts
        assert all(1 <= draft <= 15 and 2 * draft == round(2 * draft) for draft in drafts)


def scored(bench, folder: Path, found: Program, planted: Program) -> dict[str, float]:
    (folder / "program.json").write_text(dumps(found))
    (folder / "report.json").write_text(json.dumps({"scores": {"volume_iou": 1.0}}))
    (folder / "fitted.json").write_text(json.dumps({"status": 0, "seconds": 1.0}))
    to_trimesh(to_manifold(found)).export(folder / "mesh.stl")
    return bench.score(folder, planted)


def test_a_program_with_another_angle_is_not_the_design(bench, tmp_path):
    planted = bench.plant(np.random.default_rng(0), 0)
    other = map_leaves(planted, lambda _, p: replace(p, size=(p.size[0], p.size[1] + 0.1)) if p.kind == "drafted" else p)
    own, off = scored(bench, tmp_path, planted, planted), scored(bench, tmp_path, other, planted)
    assert (own["found"], own["angles"]) == (True, True)
    assert own["features"] == own["design"]
    assert (off["found"], off["angles"]) == (False, False)
    assert "1 found, 1 with all angles" in bench.totals([own, off])
