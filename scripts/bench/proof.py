"""Whether what is proved minimal is: random planted parts through the default method, programs of the six primitives alone.

    python scripts/bench/proof.py [--most 8] [--parts 5] [--seed 0] [--budget 60] [--csv out.csv]

`--parts` parts of each size from 1 to `--most` primitives are planted (`planting.py`), turned into meshes by exact booleans and
reconstructed. Printed are the share that was proved minimal over its candidates, of those the share with no more primitives than planted,
and seconds.
A proof is about candidates between detected surfaces, so a planted part that was drawn with others could be shorter than what is proved.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from planting import SEGMENTS, mesh_of, planted, write_csv

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.cost import count
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import target_from


@dataclass(frozen=True)
class Row:
    """One part; `proof_s` is what the proof took out of `seconds`, `searched` what the methods before it came to."""

    planted: int
    part: int
    searched: int
    primitives: int
    iou: float
    proof: str
    proof_s: float
    seconds: float

    @property
    def proved(self) -> bool:
        return self.proof.startswith("proved")


def main() -> None:
    args = _arguments()
    rows: list[Row] = []
    for size in range(args.least, args.most + 1):
        for part in range(args.parts):
            rows.append(run(size, part, args.seed, args.budget))
            print(line(rows[-1]), flush=True)
    print("\n" + table(rows))
    if args.csv:
        write_csv(rows, args.csv)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--least", type=int, default=1, metavar="PRIMITIVES")
    parser.add_argument("--most", type=int, default=8, metavar="PRIMITIVES")
    parser.add_argument("--parts", type=int, default=5, help="of each size")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--csv", type=Path)
    return parser.parse_args()


def run(size: int, part: int, seed: int, budget_s: float) -> Row:
    """Plant, reconstruct and compare one part."""
    program = planted(np.random.default_rng([seed, size, part]), size)
    target = target_from(mesh_of(program))
    start, before, proof_s, searched = time.perf_counter(), 0.0, 0.0, 0
    for snapshot in reconstruct(target, Settings(budget_s=budget_s, language="csg"), np.random.default_rng(0)):
        if snapshot.stage == "proof":
            proof_s += snapshot.seconds - before
        elif snapshot.stage in ("search", "evolve", "tree"):
            searched = count(snapshot.program).primitives
        before = snapshot.seconds
    seconds = time.perf_counter() - start
    iou = volume_iou(to_manifold(program, SEGMENTS), to_manifold(snapshot.program, SEGMENTS))
    return Row(size, part, searched, count(snapshot.program).primitives, iou, snapshot.proof, proof_s, seconds)


def line(row: Row) -> str:
    return (
        f"{row.planted} planted, part {row.part}: searched {row.searched}, delivered {row.primitives}, IoU {row.iou:.4f}, "
        f"{row.seconds:.1f} s of which the proof {row.proof_s:.1f} s, {row.proof}"
    )


def table(rows: Sequence[Row]) -> str:
    """Shares per size and of all parts."""
    head = "| planted | parts | proved | of those no more than planted | shorter than the search's | IoU >= 0.99 | median s | longest s |"
    lines = [head, "| --- " * 8 + "|"]
    sizes = sorted({r.planted for r in rows})
    for name, own in [*((str(n), [r for r in rows if r.planted == n]) for n in sizes), ("all", list(rows))]:
        proved = [r for r in own if r.proved]
        within = f"{sum(r.primitives <= r.planted for r in proved)} of {len(proved)}"
        shorter, good = sum(r.primitives < r.searched for r in own), sum(r.iou >= 0.99 for r in own)
        times = [r.seconds for r in own]
        lines.append(
            f"| {name} | {len(own)} | {len(proved)} | {within} | {shorter} | {good} | {statistics.median(times):.1f} | {max(times):.1f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
