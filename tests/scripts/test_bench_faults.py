"""The load benchmark counts a fit that outlasts its budget, and one that fails, and ends with that."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))  # the scripts import each other by name
faults = importlib.import_module("faults")


@pytest.mark.parametrize(("took", "status", "within"), [(6.24, 0, 2), (6.26, 1, 1), (None, 1, 1)], ids=["on time", "late", "failed"])
def test_what_is_late_or_fails_is_counted(took, status, within, monkeypatch, capsys, tmp_path):
    def fit(command, limits, log):
        assert limits.seconds > 5
        folder = Path(command[command.index("-o") + 1])
        if "slow" in folder.name and took is None:
            return SimpleNamespace(status=1, why="a crash", seconds=1.0)
        folder.mkdir(parents=True)
        total = took if "slow" in folder.name else 1.0
        (folder / "report.json").write_text(json.dumps({"stop": "finished", "timing": {"stages_s": {"search": total}, "total_s": total}}))
        return SimpleNamespace(status=0, why="", seconds=total)

    monkeypatch.setattr(faults, "run", fit)
    command = ["faults.py", "load", "quick.stl", "slow.stl", "--budgets", "5", "--jobs", "2", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    assert faults.main() == status
    said = capsys.readouterr().out
    assert f"2 at a time, budget 5 s: {within} of 2 within 6.25 s" in said
    assert ("LATE" in said) == (status == 1)
