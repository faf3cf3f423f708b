"""What a batch survives, and whether the budget holds on a loaded machine; prints one table.

    python scripts/bench/faults.py batch [--parts 200] [--kills 5] [--budget 5] [--jobs 1] [--out out/faults]
    python scripts/bench/faults.py load PART... [--budgets 5 20 60] [--jobs 1 2] [--clock processor]

`batch` makes simple parts and five poisoned ones (a crash, a hang, a memory blow-up, a truncated file, a cloud of NaN), kills the
whole batch at random moments and continues it; what was begun and what was ended is counted by the parts themselves. `load` fits the
same parts with each budget, alone and two at a time, and says for each fit what it took, from reading to the last file; exit status 1
where one failed or took more than its budget, a second and a twentieth. Start-up, which no budget bounds, stands beside it.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
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
from itertools import product
from pathlib import Path

import numpy as np
import processor
from processor import CLOCKS

from imdim.app.batch.process import ProcessLimits, run
from imdim.app.fit import NOT_THE_PART
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Combine, Primitive

LIMIT_S, MEMORY_MIB = 60.0, 3000.0
SOON_S, SHARE = 1.0, 0.05  # by which a fit may outlast its budget


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
    two.add_argument("--budgets", type=float, nargs="+", default=[5.0, 20.0, 60.0])
    two.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    two.add_argument("--clock", choices=CLOCKS, default=CLOCKS[0], help="by which a fit tells its time")
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
    """One fit with its budget among others: seconds of its stages and in all, and of the whole command; `stop` says how it ended."""

    part: str
    budget_s: float
    stages_s: dict[str, float]
    total_s: float
    command_s: float
    stop: str
    failed: bool = False

    @property
    def late(self) -> bool:
        return self.total_s > SOON_S + (1 + SHARE) * self.budget_s

    def line(self, jobs: int) -> str:
        longest = ", ".join(f"{name} {s:.1f}" for name, s in sorted(self.stages_s.items(), key=lambda stage: -stage[1])[:3])
        return (
            f"{jobs} at a time  {self.part:<24} budget {self.budget_s:g} s  took {self.total_s:6.1f} s{'  LATE' if self.late else ''}  "
            f"command {self.command_s:6.1f} s  {self.stop}; {longest}"
        )


def load(args: argparse.Namespace) -> int:
    """Seconds of reading, reconstruction and delivery against the budget."""
    print(f"load average at the start: {' '.join(f'{v:.1f}' for v in os.getloadavg())}; {os.cpu_count()} cores")
    bad = 0
    for jobs, budget in product(args.jobs, args.budgets):
        with ThreadPoolExecutor(jobs) as pool:
            tasks = [pool.submit(timed, part, budget, args, f"{jobs}-{budget:g}-{part.stem}") for part in args.parts]
            fits = [task.result() for task in tasks]
        print("\n".join(fit.line(jobs) for fit in fits), flush=True)
        wrong = sum(fit.failed or fit.late for fit in fits)
        allowed = SOON_S + (1 + SHARE) * budget
        print(f"{jobs} at a time, budget {budget:g} s: {len(fits) - wrong} of {len(fits)} within {allowed:g} s", flush=True)
        bad += wrong
    return 1 if bad else 0


def timed(part: Path, budget_s: float, args: argparse.Namespace, name: str) -> Fit:
    """The fit of a part into the folder of that name."""
    folder = args.out / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "imdim.app.cli"] if args.clock == "wall" else [sys.executable, processor.__file__]
    ended = run(
        [*command, "fit", str(part), "-o", str(folder), "--budget", str(budget_s), "--force"],
        ProcessLimits(20 * budget_s),
        folder.with_suffix(".log"),
    )
    if ended.status not in (0, NOT_THE_PART):
        return Fit(part.name, budget_s, {}, math.inf, ended.seconds, f"FAILED: {ended.why}", failed=True)
    found = json.loads((folder / "report.json").read_text())
    timing = found["timing"]
    return Fit(part.name, budget_s, timing["stages_s"], timing["total_s"], ended.seconds, found["stop"])


if __name__ == "__main__":
    sys.exit(main())
