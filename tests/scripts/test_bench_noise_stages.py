"""The bench of what each stage of the search in noise adds: what it records, and what it counts."""

import csv
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from imdim.deadline import NEVER, Deadline
from imdim.reconstruction import mdl

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import noise_stages as bench


def row(part, ious, leaves=2, asked=False):
    stages = bench.TOLD[: len(ious)]
    return bench.Row(part, dict(zip(stages, ious, strict=True)), dict.fromkeys(stages, leaves), asked)


@pytest.mark.parametrize(("policy", "left_s", "asked"), [(True, 1e9, True), (True, 0.0, False), (False, 1e9, False)])
def test_each_stage_is_what_it_ends_with_and_a_policy_is_asked_where_there_is_one_and_time(policy, left_s, asked, monkeypatch):
    cloud = mdl._NoisyCloud
    for name in ("_copy", "_rebuild_and_shorten", "_ask"):
        monkeypatch.setattr(cloud, name, lambda self, best, *rest, name=name: f"{best}{name}")
    found = {}
    bench.record_stages(found)
    deadline = Deadline(left_s, lambda: 0.0) if left_s < 1e9 else NEVER
    this = SimpleNamespace(policy=(lambda: None) if policy else None)
    copied = cloud._copy(this, "best", [], deadline)
    anew = cloud._rebuild_and_shorten(this, copied, [], deadline)
    cloud._rebuild_and_shorten(this, cloud._ask(this, anew, [], deadline), [], deadline)
    assert found["searches"] == "best"
    assert found["copies"] == "best_copy"
    assert found["anew"] == "best_copy_rebuild_and_shorten"
    assert found["policy"] == "best_copy_rebuild_and_shorten_ask_rebuild_and_shorten"
    assert ("asked" in found) == asked


def test_a_stage_counts_what_it_reaches_with_as_many_primitives_as_may_be():
    rows = [row("a", (0.9, 0.9, 0.98, 0.98, 0.96), asked=True), row("b", (0.99,), 7), row("c", (0.5, 0.6, 0.7, 0.99, 0.99), asked=True)]
    said = bench.summarise([*rows, bench.Row("d", stop="FAILED: no inside found")], {"a": 2, "b": 4, "c": 2})
    assert said[0] == "4 parts, 1 without stages"
    assert [line.split(",")[0] for line in said[1:6]] == [
        *("after searches: 0 of 4 at 0.97", "after copies: 0 of 4 at 0.97", "after anew: 1 of 4 at 0.97"),
        *("after policy: 2 of 4 at 0.97", "after delivered: 1 of 4 at 0.97"),
    ]
    assert said[1] == f"after searches: 0 of 4 at 0.97, mean {(0.9 + 0.99 + 0.5) / 4:.4f} of 4"
    assert said[-1] == "policy asked on 2, changed 1"


def test_rows_are_written_with_what_did_not_come_to_pass_left_empty(tmp_path):
    bench.write_rows([row("a", (0.9, 0.95)), bench.Row("b", stop="FAILED: out of memory")], tmp_path / "new")
    head, first, second = csv.reader((tmp_path / "new" / "stages.csv").read_text().splitlines())
    assert head[:3] == ["part", "iou searches", "leaves searches"]
    assert first[:7] == ["a", "0.9", "2", "0.95", "2", "", ""]
    assert second[-1] == "FAILED: out of memory"


def test_a_part_that_is_not_there_is_refused(tmp_path, capsys, monkeypatch):
    (tmp_path / "a.stl").touch()
    monkeypatch.setattr(sys, "argv", ["noise_stages.py", str(tmp_path), "--only", "b"])
    assert bench.main() == 2
    assert "no b" in capsys.readouterr().err
