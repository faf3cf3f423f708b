"""The bench of planted edges: what it counts as found, as right and as strange."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from imdim.program.codec import dumps
from imdim.program.edges import EdgeFeature, Face
from imdim.program.tree import Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
from edges import PLACES, PlantedEdge, score, totals
from planted_parts import AskedPart

BOX = Primitive("box", (10.0, 20.0, 30.0))


def planted(side: float, kind: str = "chamfer", size: float = 1.0) -> PlantedEdge:
    """One of the two long edges on top of the box."""
    return PlantedEdge(kind, size, np.linspace((side * 5.0, -10.0, 15.0), (side * 5.0, 10.0, 15.0), PLACES))


@pytest.fixture
def asked(tmp_path):
    rim = EdgeFeature("chamfer", (1.01,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x")))
    (tmp_path / "program.json").write_text(dumps(BOX, edges=[rim]), encoding="utf-8")
    report = {"result": {"primitives": 1}, "scores": {"volume_iou": 0.99}, "timing": {"total_s": 2.0}, "target": {"diagonal": 40.0}}
    report["intervals"] = {"chamfer_distance": {"measured": 1.02, "half": 0.05}}
    (tmp_path / "report.json").write_text(json.dumps(report), encoding="utf-8")
    return AskedPart(np.random.default_rng(0), 0, tmp_path, 60.0, "mesh")


def test_edges_where_they_were_planted_are_found_with_their_size(asked):
    row = score(asked, [planted(1), planted(-1)])
    assert (row["edges"], row["found"], row["right"], row["strange"]) == (2, 2, 2, 0)
    assert row["length"] == pytest.approx(40)


def test_another_kind_or_size_is_not_right(asked):
    row = score(asked, [planted(1, kind="fillet"), planted(-1, size=2.0)])
    assert (row["found"], row["right"]) == (1, 0)


def test_what_was_not_planted_is_strange(asked):
    row = score(asked, [planted(1)])
    assert row["strange"] == pytest.approx(20)
    said = totals([row])
    assert "recall 1.000, precision 0.500, sizes 1.000" in said


def test_of_a_noisy_cloud_an_edge_may_be_off_and_its_interval_has_to_hold(asked):
    shifted = PlantedEdge("chamfer", 1.0, planted(1).points + np.array([0.0, 0.0, 0.3]))
    assert score(asked, [shifted])["found"] == 0
    noisy = asked._replace(condition="noise=0.5%")
    row = score(noisy, [shifted])
    assert (row["found"], row["stated"], row["held"]) == (1, 1, 1)
    assert score(noisy, [PlantedEdge("chamfer", 1.1, shifted.points)])["held"] == 0
