"""What delivery lost, from the reports of a benchmark's folders."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

from delivered import main


def reported(folder: Path, name: str, found: float | None, delivered: float | None, same: float) -> None:
    (folder / name).mkdir(parents=True)
    report = {"scores": {"volume_iou": delivered}, "found": {"volume_iou": found, "iou_with_delivered": same}}
    (folder / name / "report.json").write_text(json.dumps(report))


def test_the_worst_comes_first_and_old_reports_are_counted(tmp_path, capsys):
    reported(tmp_path / "set", "kept", 0.98, 0.98, 1.0)
    reported(tmp_path / "set", "prism", 1.0, 0.826, 0.826)
    reported(tmp_path / "set", "cloud", None, None, 0.9999)
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "report.json").write_text('{"scores": {"volume_iou": 1.0}}')
    assert main([tmp_path]) == 1
    _, first, *_, last = capsys.readouterr().out.splitlines()
    assert first.split() == ["prism", "1.00000", "0.82600", "0.17400", "0.82600"]
    assert last == "1 of 3 parts lost more than 0.001, worst prism by 0.17400; 1 reports do not tell"


def test_nothing_lost_is_no_failure(tmp_path):
    reported(tmp_path, "kept", 0.98, 0.9799, 0.9999)
    assert main([tmp_path]) == 0
