"""The same seed gives the same bytes: in fresh processes, other working directories, and with other hashes of strings."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import torch
import trimesh

ROOT = Path(__file__).parents[2]


def run(command: list[str], cwd: Path, hashing: str) -> None:
    env = {**os.environ, "PYTHONHASHSEED": hashing, "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, *command], cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=280)
    assert done.returncode == 0, done.stderr


def twice(tmp_path: Path, command: list[str]) -> tuple[Path, Path]:
    """The same command in two places."""
    places = tmp_path / "one", tmp_path / "a" / "deeper place"
    for place, hashing in zip(places, ("1", "4711"), strict=True):
        place.mkdir(parents=True)
        run(command, place, hashing)
    return places


def digests(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.rglob("*")) if p.is_file()}


def without_time(report: dict) -> dict:
    return {key: value for key, value in report.items() if key != "timing"}


def test_a_fit_gives_the_same_files_and_the_same_report_but_for_times(tmp_path):
    trimesh.creation.annulus(0.4, 1.0, 1.0).export(tmp_path / "part.stl")
    command = ["-m", "imdim.app.cli", "fit", str(tmp_path / "part.stl"), "-o", "out", "--budget", "200", "--seed", "3"]
    one, two = twice(tmp_path, command)
    reports = [json.loads((place / "out" / "report.json").read_text()) for place in (one, two)]
    assert reports[0]["stop"] != "budget_spent"
    assert without_time(reports[0]) == without_time(reports[1])
    assert reports[0]["timing"].keys() == reports[1]["timing"].keys()
    names = ("program.json", "front.json", "program.scad", "program.py", "program.ucad", "mesh.stl", "preview.png")
    files = [digests(place / "out") for place in (one, two)]
    assert {name: files[0][name] for name in names} == {name: files[1][name] for name in names}


def test_a_data_set_has_the_same_bytes(tmp_path):
    settings = ["out=data", "n_train=20", "n_val=10", "seed=5", "synthesis.volume_samples=256", "synthesis.gt_points=64"]
    one, two = twice(tmp_path, [str(ROOT / "scripts" / "make_dataset.py"), *settings])
    assert len(digests(one)) == 31
    assert digests(one) == digests(two)


def test_training_on_a_cpu_has_the_same_bytes(tmp_path):
    settings = ["experiment=seed", "out=run", "max_minutes=0", "epochs=2", "samples_per_epoch=32", "batch_size=8", "workers=0", "n_val=8"]
    settings += ["n_measure=2", "measure_every=2", "synthesis.volume_samples=256", "synthesis.gt_points=64", "synthesis.cur_points=32"]
    one, two = twice(tmp_path, [str(ROOT / "pretrain.py"), *settings])
    assert (one / "run" / "best.safetensors").read_bytes() == (two / "run" / "best.safetensors").read_bytes()
    states = [torch.load(place / "run" / "state.pt", weights_only=True) for place in (one, two)]
    for part in ("policy", "average"):
        assert all(torch.equal(value, states[1][part][key]) for key, value in states[0][part].items())
