"""How time and memory grow with the size of a part: planted plates of 10, 30, 100 and 250 primitives through the default method.

    python scripts/bench/scaling.py [--sizes 10,30,100,250] [--budget 60] [--clock wall] [--csv out.csv]

Each part is a plate with an array of holes, bosses, blocks and pockets (`planting.plate`), reconstructed of the six primitives alone in a
process of its own. Seconds are those of the reconstruction, without delivery; the peak is of the resident memory of the process. The
exponent is the slope of a straight line through the logarithms of primitives and seconds. A budget that cuts the search flattens it: give
one that does not, and see `stop`. With `--clock processor` budget and seconds are of the processor.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from planting import SEGMENTS, mesh_of, plate, write_csv
from processor import CLOCKS, rule_the_clock


@dataclass(frozen=True)
class Row:
    """One part: `stages` are seconds per stage."""

    planted: int
    primitives: int
    iou: float
    seconds: float
    peak_mib: float
    stop: str
    proof: str
    stages: str


def main() -> None:
    args = _arguments()
    if args.one:
        if args.clock == "processor":
            rule_the_clock()
        sys.stdout.write(json.dumps(asdict(run(args.one, args.seed, args.budget))) + "\n")
        return
    rows = []
    for size in (int(s) for s in args.sizes.split(",")):
        command = [sys.executable, *sys.argv, "--one", str(size)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        rows.append(Row(**json.loads(done.stdout.splitlines()[-1])))
        print(line(rows[-1]), flush=True)
    print("\n" + table(rows))
    if args.csv:
        write_csv(rows, args.csv)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="10,30,100,250")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--clock", default="wall", choices=CLOCKS, help="what budget and seconds are told by (default wall)")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    return parser.parse_args()


def run(size: int, seed: int, budget_s: float) -> Row:
    """Plant, reconstruct and compare one part in this process."""
    from imdim.geometry.solid import to_manifold, volume_iou
    from imdim.program.cost import count
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import reconstruct
    from imdim.target.target import target_from

    program = plate(np.random.default_rng([seed, size]), size)
    target = target_from(mesh_of(program))
    # compiled code is loaded before the clock starts
    for _ in reconstruct(target_from(mesh_of(plate(np.random.default_rng(1), 4))), Settings(language="csg"), np.random.default_rng(0)):
        pass
    start, before, stages = time.perf_counter(), 0.0, {}
    for snapshot in reconstruct(target, Settings(budget_s=budget_s, language="csg"), np.random.default_rng(0)):
        stages[snapshot.stage] = stages.get(snapshot.stage, 0.0) + snapshot.seconds - before
        before = snapshot.seconds
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    iou = volume_iou(to_manifold(program, SEGMENTS), to_manifold(snapshot.program, SEGMENTS))
    told = ", ".join(f"{stage} {s:.1f}" for stage, s in stages.items())
    return Row(size, count(snapshot.program).primitives, iou, seconds, peak, snapshot.stop or "", snapshot.proof, told)


def line(row: Row) -> str:
    return (
        f"{row.planted} planted: {row.primitives} primitives, IoU {row.iou:.4f}, {row.seconds:.1f} s ({row.stages}), "
        f"{row.peak_mib:.0f} MiB, {row.stop}, {row.proof}"
    )


def exponent(rows: Sequence[Row]) -> float:
    """Slope of log seconds over log primitives."""
    x, y = (np.log([getattr(r, name) for r in rows]) for name in ("planted", "seconds"))
    return float(np.polyfit(x, y, 1)[0]) if len(rows) > 1 else float("nan")


def table(rows: Sequence[Row]) -> str:
    lines = ["| planted | primitives | IoU | seconds | peak MiB | stop | proof |", "| --- " * 7 + "|"]
    lines += [f"| {r.planted} | {r.primitives} | {r.iou:.4f} | {r.seconds:.1f} | {r.peak_mib:.0f} | {r.stop} | {r.proof} |" for r in rows]
    return "\n".join([*lines, "", f"time grows with the exponent {exponent(rows):.2f}"])


if __name__ == "__main__":
    main()
