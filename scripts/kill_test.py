"""Kill commands with -9 at random moments and continue them: outputs are whole or absent, and as if nothing had happened in the end.

    python scripts/kill_test.py [--kills 5] [--seed 0] [--only infer pretrain dataset batch] [--out out/kills]

infer: after each kill the results folder is absent, or complete as the last run left it. pretrain: resumed to the end, its weights have the
bytes of a run that nobody killed. dataset: so has every file. batch: every part has one outcome, and none that was done is done again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import torch
import trimesh
from safetensors import safe_open

ROOT = Path(__file__).parents[1]
RESULTS = {"program.json", "program.scad", "program.py", "mesh.stl", "mesh.glb", "preview.png", "front.json", "report.json"}
TRAIN = ["experiment=seed", "max_minutes=0", "epochs=3", "samples_per_epoch=24", "batch_size=4", "workers=0", "save_every=2"]
TRAIN += [
    "n_val=16",
    "n_measure=4",
    "measure_every=4",
    "synthesis.volume_samples=256",
    "synthesis.gt_points=128",
    "synthesis.cur_points=64",
]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=5, help="of each command")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=list(TRIALS), default=list(TRIALS))
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    args = parser.parse_args()
    failed = 0
    for name in args.only:
        folder = (args.out / name).absolute()
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        start = time.monotonic()
        said, faults = TRIALS[name](folder, args.kills, random.Random(f"{args.seed} {name}"))
        failed += len(faults)
        print(f"{name}: {said}, {time.monotonic() - start:.0f} s; {len(faults)} faults", flush=True)
        for fault in faults:
            print(f"  {fault}", flush=True)
    return 1 if failed else 0


def killed(command: list[str], after_s: float, folder: Path) -> bool:
    """Start, kill after a while (unless it ended), and say whether it was killed. Its children are left to end by themselves."""
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=ROOT)
        try:
            process.wait(after_s)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
    return process.returncode == -signal.SIGKILL


def ended(command: list[str], folder: Path) -> float:
    """Run to the end: seconds. Raises CalledProcessError with its log."""
    start = time.monotonic()
    with (folder / "log.txt").open("ab") as log:
        subprocess.run(command, stdout=log, stderr=log, cwd=ROOT, check=True)
    return time.monotonic() - start


def digests(folder: Path) -> dict[str, str]:
    """Of every file that is not hidden, by its path in `folder`."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(".")]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def infer(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    trimesh.creation.annulus(0.4, 1.0, 1.0).export(folder / "part.stl")
    out = folder / "out"
    command = [sys.executable, "infer.py", f"input={folder}/part.stl", f"output={out}", "budget_s=10"]
    seconds, faults, hits, absent = ended(command, folder), [], 0, 0
    first = json.loads((out / "program.json").read_text())
    shutil.rmtree(out)
    for i in range(kills):
        if i == kills // 2:
            ended(command, folder)  # from here on there are older results to lose
        # half of the kills fall into the delivery, the last second
        hits += killed(command, rng.uniform(0, seconds) if i % 2 else seconds - rng.uniform(0, 1.0), folder)
        names = {path.name for path in out.iterdir()} if out.exists() else set()
        absent += not names
        if names and not (names >= RESULTS and json.loads((out / "report.json").read_text())):
            faults.append(f"after kill {i} the folder holds {sorted(names)}")
    ended(command, folder)
    if json.loads((out / "program.json").read_text()) != first:
        faults.append("the last run gave another program")
    left = [path.name for path in folder.iterdir() if path.name.startswith(".out")]
    return f"{hits} of {kills} kills hit, {absent} left no folder, the others a whole one; {len(left)} hidden folders left over", faults


def pretrain(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    command = [sys.executable, "pretrain.py", *TRAIN]
    seconds, faults, hits = ended([*command, f"out={folder}/whole"], folder), [], 0
    for _ in range(kills):
        resume = ["resume=true"] if (folder / "cut" / "state.pt").exists() else []
        hits += killed([*command, f"out={folder}/cut", *resume], rng.uniform(0.3, 0.9) * seconds, folder)
    ended([*command, f"out={folder}/cut", "resume=true"], folder)
    whole, cut = (weights(folder / name) for name in ("whole", "cut"))
    if whole != cut:
        faults.append(f"{sum(whole[k] != cut.get(k) for k in whole)} of {len(whole)} tensors differ")
    return f"{hits} of {kills} kills hit, {len(whole)} tensors compared", faults


def weights(folder: Path) -> dict[str, bytes]:
    """The bytes of all tensors of the last state and of the best weights."""
    state = torch.load(folder / "state.pt", weights_only=True)
    out = {f"{part} {key}": tensor.numpy().tobytes() for part in ("policy", "average") for key, tensor in state[part].items()}
    with safe_open(folder / "best.safetensors", framework="np") as file:
        return out | {key: file.get_tensor(key).tobytes() for key in file.keys()}  # noqa: SIM118 (not a mapping)


def dataset(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    command = [sys.executable, "scripts/make_dataset.py", "n_train=700", "n_val=50", "seed=3"]
    seconds, faults, hits = ended([*command, f"out={folder}/whole"], folder), [], 0
    whole = digests(folder / "whole")
    for i in range(kills):
        hits += killed([*command, f"out={folder}/cut"], seconds * rng.uniform(0.2, 1.0) / (i + 1), folder)
        broken = [name for name, digest in digests(folder / "cut").items() if name.endswith(".npz") and digest != whole[name]]
        if broken:
            faults.append(f"after kill {i} {len(broken)} files are broken, {broken[0]} first")
    ended([*command, f"out={folder}/cut"], folder)
    if whole != digests(folder / "cut"):
        faults.append("the folders differ")
    return f"{hits} of {kills} kills hit, {len(whole)} files compared", faults


def batch(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    parts = folder / "parts"
    parts.mkdir()
    for i in range(6):
        trimesh.creation.box((1.0, 2.0, 3.0 + i)).export(parts / f"box{i}.stl")
    (parts / "broken.stl").write_text("solid")
    command = [sys.executable, "-m", "imdim.app.cli", "batch", str(parts), "-o", str(folder / "out"), "--budget", "3"]
    faults, hits, done = [], 0, dict[str, int]()
    for i in range(kills):
        hits += killed(command, rng.uniform(3, 20), folder)
        for record in (folder / "out").glob("parts/*/outcome.json"):
            json.loads(record.read_text())
            at = record.stat().st_mtime_ns
            if done.setdefault(record.parent.name, at) != at:
                faults.append(f"after kill {i} {record.parent.name} was done again")
    with (folder / "log.txt").open("ab") as log:
        subprocess.run(command, stdout=log, stderr=log, cwd=ROOT, check=False)
    outcomes = {path.parent.name: json.loads(path.read_text()) for path in (folder / "out").glob("parts/*/outcome.json")}
    if len(outcomes) != 7 or [name for name, outcome in outcomes.items() if outcome["failure"]] != ["broken"]:
        faults.append(f"outcomes {outcomes}")
    if (folder / "out" / ".running").exists():
        faults.append("something is left of what was running")
    return f"{hits} of {kills} kills hit, {len(outcomes)} outcomes of 7 parts", faults


TRIALS: dict[str, Callable[[Path, int, random.Random], tuple[str, list[str]]]] = {
    "infer": infer,
    "pretrain": pretrain,
    "dataset": dataset,
    "batch": batch,
}

if __name__ == "__main__":
    sys.exit(main())
