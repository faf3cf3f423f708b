"""A data set as a batch of shares: each poisoned share is its own failure, a killed run continues, bytes are those of one process."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.data.folders import make_folder
from tests.stand_ins import log, stand_in_for, wait_for

from imdim.app.batch.dataset import main
from imdim.data.folder import FolderConfig
from imdim.data.synthesize import SynthesisConfig

# what a share does is decided by its name; every start and every end is a line of a file that is not part of the data set
STAND_IN = """
import json, os, pathlib, sys, time
source, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
note = lambda what: open(LOG, "a").write(f"{what} {out.name}\\n")
note("start")
out.mkdir(parents=True)
files = [name for _, _, names in json.loads(source.read_text())["chunks"] for name in names]
for name in files[: len(files) // 2]:
    (out / name).write_bytes(name.encode())
how = POISON.get(out.name)
if how == "crash":
    os.abort()
if how == "hang":
    time.sleep(600)
if how == "less":
    sys.exit(0)
time.sleep(PAUSE)
for name in files:
    (out / name).write_bytes(name.encode())
note("end")
"""


def stand_in(tmp_path: Path, pause: float = 0.0, **poison: str) -> list[str]:
    given = {name.replace("_", "-"): how for name, how in poison.items()}
    return stand_in_for(tmp_path, STAND_IN, PAUSE=pause, POISON=given)


def samples(out: Path) -> dict[str, bytes]:
    return {str(p.relative_to(out)): p.read_bytes() for p in out.glob("*/*.npz")}


def arguments(out: Path, *more: str) -> list[str]:
    return [f"out={out}", "n_train=200", "n_val=70", "share=64", *more]


def test_each_poisoned_share_is_its_own_failure_and_is_tried_again(tmp_path, capsys):
    out = tmp_path / "out"
    poisoned = stand_in(tmp_path, train_00001="crash", train_00003="hang", val_00001="less")
    assert main(arguments(out, "jobs=2", "limit_s=1.5"), poisoned) == 1
    with (out / "failures.csv").open(newline="") as file:
        found = {row["share"]: row for row in csv.DictReader(file)}
    assert {name: row["failure"] for name, row in found.items()} == {
        "train-00001": "ended by signal SIGABRT",
        "train-00003": "took more than 1.5 s and was ended",
        "val-00001": "3 of 6 samples are missing",
    }
    assert (found["train-00001"]["first"], found["train-00001"]["last"]) == ("sample_00064.npz", "sample_00127.npz")
    assert len(samples(out)) == 270 - 64 - 8 - 6
    said = capsys.readouterr()
    assert "192 of 270 samples are there" in said.out
    assert said.err.count("FAILED") == 3
    before = len(log(tmp_path))
    assert main(arguments(out), stand_in(tmp_path)) == 0
    assert [line for line in log(tmp_path)[before:] if line.startswith("end")] == ["end train-00001", "end train-00003", "end val-00001"]
    assert len(samples(out)) == 270
    assert sorted(path.name for path in out.iterdir()) == ["dataset.json", "train", "val"]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_run_that_is_stopped_continues(tmp_path, how):
    out = tmp_path / "out"
    code = f"import sys; from imdim.app.batch.dataset import main; sys.exit(main({arguments(out)!r}, {stand_in(tmp_path, 0.4)!r}))"
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_for(lambda: (out / "train" / "sample_00127.npz").exists() and "start train-00002" in log(tmp_path))
    process.send_signal(how)
    _, error = process.communicate(timeout=20)
    if how == signal.SIGTERM:
        assert (process.returncode, error) == (130, "make_dataset: stopped; the same command continues\n")
        assert not (out / ".running").exists()
    before = log(tmp_path)
    time.sleep(0.6)
    assert log(tmp_path) == before  # the share that ran has ended with the batch
    assert len(samples(out)) == 128  # and left nothing half done
    assert main(arguments(out), stand_in(tmp_path)) == 0
    assert len(samples(out)) == 270
    ends = [line for line in log(tmp_path) if line.startswith("end")]
    assert len(ends) == len(set(ends)) == 6  # nothing lost, nothing done twice


def test_its_bytes_are_those_of_one_process(tmp_path):
    synthesis = SynthesisConfig(gt_points=32, cur_points=16, volume_samples=256)
    list(make_folder(FolderConfig(str(tmp_path / "one"), 70, 3, 7, synthesis)))
    given = ["n_train=70", "n_val=3", "seed=7", "synthesis.gt_points=32", "synthesis.cur_points=16", "synthesis.volume_samples=256"]
    assert main([f"out={tmp_path / 'two'}", "jobs=2", *given]) == 0
    assert samples(tmp_path / "one") == samples(tmp_path / "two")
    assert len(samples(tmp_path / "two")) == 73
    notes = [json.loads((tmp_path / name / "dataset.json").read_text()) for name in ("one", "two")]
    assert notes[0] == notes[1]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["seed=1"], "of a data set with other settings"),
        (["share=0"], "need positive numbers"),
        (["colour=red"], "colour"),
        (["address=nowhere:1", "jobs=-1"], "none below 0"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, capsys, given, said):
    out = tmp_path / "out"
    assert main(arguments(out, "n_train=1", "n_val=0"), stand_in(tmp_path)) == 0
    before = len(log(tmp_path))
    capsys.readouterr()
    assert main(arguments(out, *given), stand_in(tmp_path)) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert len(log(tmp_path)) == before


def test_two_runs_do_not_share_a_folder(tmp_path, capsys):
    from imdim.app.batch.folder import hold_folder

    with hold_folder(tmp_path / "out"):
        assert main(arguments(tmp_path / "out"), stand_in(tmp_path)) == 2
    assert "in use by another batch" in capsys.readouterr().err
