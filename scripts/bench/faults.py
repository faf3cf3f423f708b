"""What a batch survives, and whether the budget holds on a loaded machine; prints one table.

    python scripts/bench/faults.py batch [--parts 200] [--kills 5] [--budget 5] [--jobs 1] [--out out/faults]
    python scripts/bench/faults.py load PART... [--budget 20] [--jobs 1 2 4] [--tolerance 0.25]

`batch` makes simple parts and five poisoned ones (a crash, a hang, a memory blow-up, a truncated file, a cloud of NaN), kills the
whole batch at random moments and continues it; what was begun and what was ended is counted by the parts themselves. `load` fits the
same parts alone, two and four at a time, and says for each fit what it had and what it took; exit status 1 where a fit failed or took
more than `--tolerance` of its budget beyond it. Loading and reconstruction count, start-up and delivery do not: those stand beside them.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from imdim.app.batch.process import ProcessLimits, run
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Combine, Primitive

LIMIT_S, MEMORY_MIB = 60.0, 3000.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("batch")
    one.add_argument("--parts", type=int, default=200)
    one.add_argument("--kills", type=int, default=5)
    one.add_argument("--budget", type=float, default=5.0)
    one.add_argument("--jobs", type=int, default=1)
    one.add_argument("--seed", type=int, default=0)
    one.add_argument("--out", type=Path, default=Path("out/faults"))
    one.set_defaults(run=batch)
    two = commands.add_parser("load")
    two.add_argument("parts", type=Path, nargs="+")
    two.add_argument("--budget", type=float, default=20.0)
    two.add_argument("--jobs", type=int, nargs="+", default=[1, 2, 4])
    two.add_argument("--tolerance", type=float, default=0.25, help="of the budget, beyond it")
    two.add_argument("--out", type=Path, default=Path("out/load"))
    two.set_defaults(run=load)
    fit = commands.add_parser("fit")
    fit.add_argument("arguments", nargs=argparse.REMAINDER)
    fit.set_defaults(run=poisoned_fit)
    args = parser.parse_args()
    return args.run(args)


def poisoned_fit(args: argparse.Namespace) -> int:
    """`imdim fit`, but for parts whose name says what they do; begins and ends are noted in $LEDGER."""
    name = Path(args.arguments[0]).stem
    note(f"begin {name}")
    if name == "poison-crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if name == "poison-hang":
        time.sleep(3600)
    if name == "poison-memory":
        hoard = []
        while True:
            hoard.append(np.ones(1 << 22))
    from imdim.app.cli import main as imdim

    status = imdim(["fit", *args.arguments])
    note(f"end {name} {status}")
    return status


def note(line: str) -> None:
    with open(os.environ["LEDGER"], "a") as ledger:
        ledger.write(line + "\n")


def batch(args: argparse.Namespace) -> int:
    rng = random.Random(args.seed)
    parts, results, ledger = args.out / "parts", args.out / "results", args.out / "ledger.txt"
    make_parts(parts, args.parts, np.random.default_rng(args.seed))
    os.environ["LEDGER"] = str(ledger.absolute())
    arguments = [str(parts), "-o", str(results), "--jobs", str(args.jobs), "--budget", str(args.budget)]
    arguments += ["--limit", str(LIMIT_S), "--memory", str(MEMORY_MIB)]
    code = f"import sys; from imdim.app.batch.run import main; sys.exit(main({arguments!r}, {[sys.executable, __file__, 'fit']!r}))"
    start = time.monotonic()
    marks = sorted(rng.sample(range(1, args.parts), args.kills))
    for mark in marks:
        process = subprocess.Popen([sys.executable, "-c", code])
        while process.poll() is None and finished(results) < mark:
            time.sleep(0.05)
        time.sleep(rng.uniform(0, args.budget))
        process.kill()
        process.wait()
        print(f"killed at {finished(results)} parts", flush=True)
    status = subprocess.run([sys.executable, "-c", code], check=False).returncode
    print(report(results, ledger, args, status, time.monotonic() - start))
    return 0


def finished(results: Path) -> int:
    return len(list(results.glob("parts/*/outcome.json")))


def make_parts(folder: Path, count: int, rng: np.random.Generator) -> None:
    """`count` - 5 blocks with a hole, and five that fail."""
    folder.mkdir(parents=True)
    for i in range(count - 5):
        x, y, z = np.round(rng.uniform(10, 40, 3), 1).tolist()
        hole = Primitive("cylinder", (round(min(x, y) * float(rng.uniform(0.1, 0.3)), 1), 2 * z))
        to_trimesh(to_manifold(Combine("difference", Primitive("box", (x, y, z)), hole), 64)).export(folder / f"block{i:03}.stl")
    whole = (folder / "block000.stl").read_bytes()
    for name in ("crash", "hang", "memory"):
        (folder / f"poison-{name}.stl").write_bytes(whole)
    (folder / "poison-truncated.stl").write_bytes(whole[: len(whole) // 2])
    np.save(folder / "poison-nan.npy", np.full((1000, 3), np.nan))


def report(results: Path, ledger: Path, args: argparse.Namespace, status: int, seconds: float) -> str:
    with (results / "results.csv").open(newline="") as file:
        rows = {row["part"]: row for row in csv.DictReader(file)}
    lines = ledger.read_text().splitlines()
    begun, ended = (Counter(line.split()[1] for line in lines if line.startswith(what)) for what in ("begin", "end"))
    failed = {name: row["failure"] for name, row in rows.items() if row["failure"]}
    good = [row for name, row in rows.items() if not name.startswith("poison")]
    return "\n".join(
        [
            f"{args.parts} parts, {args.kills} kills, {args.jobs} at a time, {seconds:.0f} s, exit status {status}",
            f"rows {len(rows)}, failed {len(failed)}",
            *(f"  {name}: {why}" for name, why in failed.items()),
            f"good parts with IoU >= 0.99: {sum(float(row['volume_iou'] or 0) >= 0.99 for row in good)} of {len(good)}",
            f"begun {sum(begun.values())} times, ended {sum(ended.values())} times",
            f"ended more than once: {sum(n > 1 for n in ended.values())}",
            f"median {statistics.median(float(row['seconds']) for row in good):.1f} s a part",
        ]
    )


@dataclass(frozen=True)
class Fit:
    """One fit among others: seconds of its stages, which the budget bounds, and of the whole command; `stop` says how it ended."""

    part: str
    stages_s: dict[str, float]
    command_s: float
    stop: str
    failed: bool = False

    @property
    def seconds(self) -> float:
        return sum(self.stages_s.values())

    def line(self, jobs: int, budget: float) -> str:
        longest = ", ".join(f"{name} {s:.1f}" for name, s in sorted(self.stages_s.items(), key=lambda stage: -stage[1])[:3])
        over = 100 * (self.seconds / budget - 1)
        return (
            f"{jobs} at a time  {self.part:<24} budget {budget:g} s  took {self.seconds:6.1f} s ({over:+.0f} %)  "
            f"command {self.command_s:6.1f} s  {self.stop}; {longest}"
        )


def load(args: argparse.Namespace) -> int:
    """Seconds of reconstruction against the budget, which bounds it together with loading."""
    print(f"load average at the start: {' '.join(f'{v:.1f}' for v in os.getloadavg())}; {os.cpu_count()} cores")
    bad = 0
    for jobs in args.jobs:
        with ThreadPoolExecutor(jobs) as pool:
            tasks = [pool.submit(timed, args.parts[i % len(args.parts)], args, jobs, i) for i in range(max(jobs, len(args.parts)))]
            for fit in (task.result() for task in tasks):
                print(fit.line(jobs, args.budget), flush=True)
                bad += fit.failed or fit.seconds > (1 + args.tolerance) * args.budget
    print(f"{bad} fits failed or took more than {100 * args.tolerance:g} % over their budget")
    return 1 if bad else 0


def timed(part: Path, args: argparse.Namespace, jobs: int, i: int) -> Fit:
    folder = args.out / f"{jobs}-{i}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "imdim.app.cli", "fit", str(part), "-o", str(folder), "--budget", str(args.budget)]
    ended = run(command, ProcessLimits(20 * args.budget), folder.with_suffix(".log"))
    if ended.status:
        return Fit(part.name, {}, ended.seconds, f"FAILED: {ended.why}", failed=True)
    found = json.loads((folder / "report.json").read_text())
    return Fit(part.name, found["timing"]["stages_s"], ended.seconds, found["stop"])


if __name__ == "__main__":
    sys.exit(main())
