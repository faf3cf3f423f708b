"""Two real processes under torchrun against one process that learns the same parts."""

import os
import subprocess
import sys
from pathlib import Path

import torch

from imdim.app.arguments import from_arguments
from imdim.learn.checkpoint import load_state
from imdim.learn.settings import TrainConfig
from imdim.learn.train import train

ROOT = Path(__file__).parents[2]
SMALL = [
    "experiment=seed",
    "samples_per_epoch=24",
    "n_val=8",
    "n_measure=4",
    "batch_size=8",
    "max_seq_len=6",
    "warmup=2",
    "cooldown=0",
    "max_minutes=0",
    "synthesis.gt_points=64",
    "synthesis.cur_points=32",
    "synthesis.n_max=3",
    "synthesis.volume_samples=256",
    "synthesis.prefixes=1",
    "seed_design.d_model=16",
    "seed_design.layers=1",
    "seed_design.heads=2",
    "seed_design.hidden=16",
]


def torchrun(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", str(ROOT / "pretrain.py")]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run([*command, *SMALL, *arguments], capture_output=True, text=True, timeout=240, check=False, env=environment)


def test_two_processes_learn_what_one_learns_and_resume(tmp_path):
    for more in (["epochs=1"], ["epochs=2", "resume=true"]):
        run = torchrun(f"out={tmp_path / 'two'}", *more)
        assert run.returncode == 0, run.stderr
        assert run.stdout.count("step ") == 1  # the first process alone reports
    one = from_arguments(TrainConfig, [*SMALL, f"out={tmp_path / 'one'}", "epochs=2", "shards=2"], ROOT / "configs", "pretrain")
    list(train(one))
    a, b = (load_state(tmp_path / name / "state.pt") for name in ("one", "two"))
    assert a["step"] == b["step"] == 6
    assert a["config"]["shards"] == b["config"]["shards"] == 2
    for part in ("policy", "average"):
        for key, value in a[part].items():
            assert torch.allclose(value, b[part][key], atol=1e-6), key
