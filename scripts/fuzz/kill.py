"""Kill commands with -9 at random moments and continue them: outputs are whole or absent, and as if nothing had happened in the end.

    python scripts/fuzz/kill.py [--kills 5] [--seed 0] [--only infer pretrain dataset batch] [--out out/kills]

infer: after each kill the results folder is absent, or complete as the last run left it, and the next run sweeps what was half written.
pretrain: resumed to the end, its weights have the bytes of a run that nobody killed. dataset: so has every file. batch: every part has one
outcome, and none that was done is done again. The moments are random in what the command has done, or in what it has had of the processor,
not in seconds of the clock: a busy machine makes the trial longer, not another.
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

sys.path.append(str(Path(__file__).parents[1] / "bench"))  # the benches' parts and clock serve here too
from processor import processor_s

ROOT = Path(__file__).parents[2]
RESULTS = {"program.json", "program.scad", "program.py", "mesh.stl", "mesh.glb", "preview.png", "front.json", "report.json"}
TRAIN = ["experiment=seed", "max_minutes=0", "epochs=8", "samples_per_epoch=24", "batch_size=4", "workers=0", "save_every=2"]
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


def killed(command: list[str], folder: Path, due: Callable[[float], bool]) -> bool:
    """Start, kill as soon as it is `due` (told what the process has had of the processor, in seconds), and say whether that came before
    its end. Its children are left to end by themselves."""
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=ROOT)
    while process.poll() is None and not due(processor_s(process.pid)):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def ended(command: list[str], folder: Path, status: int = 0) -> float:
    """Run to the end: what it had of the processor, in seconds. Raises RuntimeError for another exit status."""
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=ROOT)
    seconds = 0.0
    while process.poll() is None:
        seconds = max(seconds, processor_s(process.pid))
        time.sleep(0.02)
    if process.returncode != status:
        raise RuntimeError(f"exit status {process.returncode}, see {folder / 'log.txt'}: {' '.join(command)}")
    return seconds


def digests(folder: Path) -> dict[str, str]:
    """Of every file that is not hidden, by its path in `folder`."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(".")]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def infer(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / "part.stl")
    out = folder / "out"
    command = [sys.executable, "infer.py", f"input={folder}/part.stl", f"output={out}", "budget_s=20"]
    # the first run may compile, which no other does
    seconds, faults, hits, delivering, absent = min(ended(command, folder) for _ in range(2)), [], 0, 0, 0
    first = json.loads((out / "program.json").read_text())
    shutil.rmtree(out)
    for i in range(kills):
        if i == kills // 2 and not out.exists():
            ended(command, folder)  # from here on there are older results to lose
        known = set(hidden(folder))
        if i % 2:
            due = at_share(rng.uniform(0, 0.9), seconds)
        else:
            due = after(lambda known=known: bool(set(hidden(folder)) - known), rng.uniform(0, 0.5))
        hits += killed(command, folder, due)
        delivering += bool(set(hidden(folder)) - known)
        names = {path.name for path in out.iterdir()} if out.exists() else set()
        absent += not names
        if names and not (names >= RESULTS and json.loads((out / "report.json").read_text())):
            faults.append(f"after kill {i} the folder holds {sorted(names)}")
        if i >= kills // 2 and not (names or hidden(folder)):
            faults.append(f"after kill {i} the older results are gone")
    ended(command, folder)
    if json.loads((out / "program.json").read_text()) != first:
        faults.append("the last run gave another program")
    if hidden(folder):
        faults.append(f"the last run left {hidden(folder)}")
    return (
        f"{hits} of {kills} kills hit, {delivering} of them while results were written; {absent} left none, the others whole ones",
        faults,
    )


def hidden(folder: Path) -> list[str]:
    """Folders that a run of `infer` writes into, or left."""
    return [path.name for path in folder.iterdir() if path.name.startswith(".out-")]


def pretrain(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    command = [sys.executable, "pretrain.py", *TRAIN]
    state, faults, hits, resumed = folder / "cut" / "state.pt", [], 0, 0
    seconds = ended([*command, f"out={folder}/whole"], folder)
    for i in range(kills):
        saved = state.exists()
        resumed += saved
        # once before anything is saved, then after one to three states more
        due = after(versions(state, rng.randint(1, 3)), rng.uniform(0, 0.05)) if i else at_share(rng.uniform(0, 0.5), seconds)
        hits += killed([*command, f"out={folder}/cut", *(["resume=true"] if saved else [])], folder, due)
    ended([*command, f"out={folder}/cut", "resume=true"], folder)
    whole, cut = (weights(folder / name) for name in ("whole", "cut"))
    if whole != cut:
        faults.append(f"{sum(whole[k] != cut.get(k) for k in whole)} of {len(whole)} tensors differ")
    return f"{hits} of {kills} kills hit, {resumed} times a state was there to go on from, {len(whole)} tensors compared", faults


def versions(path: Path, count: int) -> Callable[[], bool]:
    """Whether a file has been replaced so often since this was asked for."""
    seen = {path.stat().st_mtime_ns if path.exists() else 0}

    def reached() -> bool:
        if path.exists():
            seen.add(path.stat().st_mtime_ns)
        return len(seen) > count

    return reached


def weights(folder: Path) -> dict[str, bytes]:
    """The bytes of all tensors of the last state and of the best weights."""
    state = torch.load(folder / "state.pt", weights_only=True)
    out = {f"{part} {key}": tensor.numpy().tobytes() for part in ("policy", "average") for key, tensor in state[part].items()}
    with safe_open(folder / "best.safetensors", framework="np") as file:
        return out | {key: file.get_tensor(key).tobytes() for key in file.keys()}  # noqa: SIM118 (not a mapping)


def dataset(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    command = [sys.executable, "scripts/make_dataset.py", "n_train=400", "n_val=50", "seed=3", "share=64"]
    faults, hits = [], 0
    ended([*command, f"out={folder}/whole"], folder)
    whole = digests(folder / "whole")
    marks = sorted(rng.sample(range(400), kills))
    for i, mark in enumerate(marks):
        due = after(lambda mark=mark: len(digests_of_samples(folder / "cut")) >= mark, rng.uniform(0, 0.05))  # it mostly waits
        hits += killed([*command, f"out={folder}/cut"], folder, due)
        broken = [name for name, digest in digests(folder / "cut").items() if name.endswith(".npz") and digest != whole[name]]
        if broken:
            faults.append(f"after kill {i} {len(broken)} files are broken, {broken[0]} first")
    ended([*command, f"out={folder}/cut"], folder)
    if whole != digests(folder / "cut"):
        faults.append("the folders differ")
    return f"{hits} of {kills} kills hit, {len(whole)} files compared", faults


def digests_of_samples(folder: Path) -> list[Path]:
    return list(folder.glob("*/sample_*.npz"))


def batch(folder: Path, kills: int, rng: random.Random) -> tuple[str, list[str]]:
    parts = folder / "parts"
    parts.mkdir()
    for i in range(kills):
        trimesh.creation.box((1.0, 2.0, 3.0 + i)).export(parts / f"box{i}.stl")
    (parts / "broken.stl").write_text("solid")
    command = [sys.executable, "-m", "imdim.app.cli", "batch", str(parts), "-o", str(folder / "out"), "--budget", "5", "--limit", "600"]
    faults, hits, done = [], 0, dict[str, int]()
    for i in range(kills):
        # after each kill a part more is done, or as many as before
        due = after(lambda i=i: len(records(folder)) >= i + 1, rng.uniform(0, 0.05))  # it mostly waits
        hits += killed(command, folder, due)
        for record in records(folder):
            json.loads(record.read_text())
            at = record.stat().st_mtime_ns
            if done.setdefault(record.parent.name, at) != at:
                faults.append(f"after kill {i} {record.parent.name} was done again")
    ended(command, folder, status=1)
    outcomes = {path.parent.name: json.loads(path.read_text()) for path in records(folder)}
    if len(outcomes) != kills + 1 or [name for name, outcome in outcomes.items() if outcome["failure"]] != ["broken"]:
        faults.append(f"outcomes {outcomes}")
    if (folder / "out" / ".running").exists():
        faults.append("something is left of what was running")
    return f"{hits} of {kills} kills hit, {len(outcomes)} outcomes of {kills + 1} parts", faults


def records(folder: Path) -> list[Path]:
    return list((folder / "out").glob("parts/*/outcome.json"))


def at_share(share: float, whole_s: float) -> Callable[[float], bool]:
    """Due once a process has had that share of what a whole run takes of the processor: a busy machine changes nothing."""
    return lambda seconds: seconds >= share * whole_s


def after(event: Callable[[], bool], delay_s: float) -> Callable[[float], bool]:
    """Due so many seconds of the processor after an event."""
    since: list[float] = []

    def due(seconds: float) -> bool:
        if not since and event():
            since.append(seconds)
        return bool(since) and seconds >= since[0] + delay_s

    return due


TRIALS: dict[str, Callable[[Path, int, random.Random], tuple[str, list[str]]]] = {
    "infer": infer,
    "pretrain": pretrain,
    "dataset": dataset,
    "batch": batch,
}

if __name__ == "__main__":
    sys.exit(main())
