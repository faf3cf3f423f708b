"""The gate passes the committed figures and refuses a worse one, whichever it is."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GATE, BASELINE = ROOT / "scripts" / "bench" / "gate.py", ROOT / "benchmarks" / "baseline.json"


@pytest.fixture
def committed() -> dict[str, dict[str, float]]:
    return json.loads(BASELINE.read_text())


def judged(folder: Path, figures: dict[str, float]) -> subprocess.CompletedProcess[str]:
    path = folder / "figures.json"
    path.write_text(json.dumps(figures))
    return subprocess.run([sys.executable, str(GATE), "--figures", str(path)], capture_output=True, text=True, check=False)


def test_the_committed_figures_pass(tmp_path, committed):
    done = judged(tmp_path, {name: row["value"] for name, row in committed.items()})
    assert (done.returncode, done.stderr) == (0, "")
    assert "no figure is worse" in done.stdout


def test_every_worse_figure_is_named(tmp_path, committed):
    # a third of a ratio or share; a primitive more; a hundredth of the volume
    less = {name: row["value"] + 1 if row["less"] else row["value"] / 3 for name, row in committed.items()}
    done = judged(tmp_path, less)
    assert done.returncode == 1
    assert all(f"WORSE: {name} is" in done.stdout for name in committed)


def test_one_worse_figure_is_enough(tmp_path, committed):
    figures = {name: row["value"] for name, row in committed.items()}
    figures["bracket.stl: primitives"] += 1
    done = judged(tmp_path, figures)
    assert done.returncode == 1
    assert done.stdout.count("WORSE") == 1


def test_a_figure_that_was_not_measured_does_not_pass(tmp_path, committed):
    name, *others = committed
    done = judged(tmp_path, {other: committed[other]["value"] for other in others})
    assert done.returncode == 1
    assert f"MISSING: {name}" in done.stdout


def test_figures_are_ratios_shares_and_counts(committed):
    assert committed
    assert all(name.endswith(("times faster", "share of peak", "primitives", "error")) for name in committed)
