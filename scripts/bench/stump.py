"""CSG-Stump as a baseline: ``python scripts/bench/stump.py FOLDER [--methods auto,stump,stump-net,policy] [--only a,b]``.

Per part and method: L2 Chamfer distance, volume IoU, primitives, seconds. The L2 Chamfer distance is that of the published evaluation of
CSG-Stump Net (Ren et al. 2021): 2,048 even points on the result's surface and 2,048 on the target's, in a frame where the target's box has
diagonal 1; the mean squared distance of each set's points to the nearest of the other, averaged over both directions, times 1,000. Points
of two draws from the same surface are not the same: `floor` is the distance of the target to itself, which no method can be expected to
beat by much. IoU is by exact booleans, seconds are of wall clock for the reconstruction, one part at a time. A part that fails is a row
with IoU 0 and an infinite distance; it counts in the means of IoU, and medians are of all parts. Every method has the six primitives alone,
unless `--set language=cad` is given.
"""

from __future__ import annotations

import argparse
import csv
import math
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import trimesh

from imdim.delivery.evaluate import evaluate
from imdim.geometry.metrics import diagonal, nearest_distances
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.reconstruction.config import ConfigError, Settings
from imdim.reconstruction.methods import METHODS
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.readers import FORMATS
from imdim.target.target import InputError, Target, load_target

POINTS = 2048
KNOWN = ("auto", "stump", "stump-net", "policy")
HEAD = ("part", "method", "CD x 1000", "IoU", "primitives", "seconds")


@dataclass
class Row:
    part: str
    method: str
    cd: float = math.inf
    iou: float = 0.0
    primitives: int = 0
    seconds: float = 0.0
    failure: str = ""


def main() -> None:
    args = _arguments()
    methods = [m for m in args.methods.split(",") if m in METHODS]
    for missing in set(args.methods.split(",")) - set(methods):
        print(f"method {missing} is not there: left out", file=sys.stderr)
    settings = {"language": "csg"} | dict(setting.split("=", 1) for setting in args.set)
    rows: list[Row] = []
    print(f"| {' | '.join(HEAD)} |\n{'| --- ' * len(HEAD)}|")
    for path in _parts(args.folder, args.only):
        target = load_target(path)
        rows.append(Row(path.stem, "floor", l2_chamfer(_surface(target), _surface(target)), 1.0))
        print(line(rows[-1]), flush=True)
        for method in methods:
            rows.append(measured(target, path.stem, Settings(method=method, budget_s=args.budget, seed=args.seed, **settings)))
            print(line(rows[-1]), flush=True)
    print("\n" + summary(rows, ["floor", *methods]))
    if args.out:
        _write(rows, args.out)


def measured(target: Target, part: str, settings: Settings) -> Row:
    """One method on one part."""
    start = time.perf_counter()
    try:
        *_, last = reconstruct(target, settings, np.random.default_rng(settings.seed))
    except (InputError, ConfigError, ValueError) as error:
        return Row(part, settings.method, seconds=time.perf_counter() - start, failure=str(error))
    seconds = time.perf_counter() - start
    scores = evaluate(last.program, target)
    found = to_trimesh(to_manifold(last.program))
    cd = l2_chamfer(found, _surface(target)) if len(found.faces) else math.inf
    return Row(part, settings.method, cd, scores.volume_iou or 0.0, scores.primitives or 0, seconds)


def l2_chamfer(found: trimesh.Trimesh, truth: trimesh.Trimesh) -> float:
    """As the docstring of this file says."""
    scale = diagonal(truth.vertices)
    a, b = (trimesh.sample.sample_surface(mesh, POINTS, seed=seed)[0] / scale for seed, mesh in enumerate((found, truth)))
    return 500 * float((nearest_distances(a, b) ** 2).mean() + (nearest_distances(b, a) ** 2).mean())


def _surface(target: Target) -> trimesh.Trimesh:
    if target.mesh is None:
        sys.exit(f"{target.name}: a mesh is needed, to draw points from its surface")
    return target.mesh


def line(row: Row) -> str:
    """A row of the table."""
    cells = (row.part, row.method, f"{row.cd:.3f}", f"{row.iou:.4f}", str(row.primitives or "-"), f"{row.seconds:.1f}")
    return f"| {' | '.join(cells)} |{' ' + row.failure if row.failure else ''}"


def summary(rows: list[Row], methods: list[str]) -> str:
    """Per method: median and mean L2 Chamfer, median and mean IoU, primitives in all, median seconds, failures."""
    head = ("method", "parts", "CD median", "CD mean", "IoU median", "IoU mean", "primitives", "s median", "failed")
    lines = [f"| {' | '.join(head)} |", "| --- " * len(head) + "|"]
    for method in methods:
        mine = [r for r in rows if r.method == method]
        cds, ious = [r.cd for r in mine], [r.iou for r in mine]
        cells = [
            f"{statistics.median(cds):.3f}",
            f"{statistics.fmean(cds):.3f}",
            f"{statistics.median(ious):.4f}",
            f"{statistics.fmean(ious):.4f}",
        ]
        cells += [str(sum(r.primitives for r in mine)), f"{statistics.median(r.seconds for r in mine):.1f}"]
        lines.append(f"| {method} | {len(mine)} | {' | '.join(cells)} | {sum(bool(r.failure) for r in mine)} |")
    return "\n".join(lines)


def _parts(folder: Path, only: str) -> list[Path]:
    wanted = set(filter(None, only.split(",")))
    found = sorted(p for p in folder.glob("*") if p.suffix.lower() in FORMATS and (not wanted or p.stem in wanted))
    missing = wanted - {p.stem for p in found}
    if missing or not found:
        sys.exit(f"{folder}: no part named {', '.join(sorted(missing))}" if missing else f"{folder}: 0 model files")
    return found


def _write(rows: list[Row], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--methods", default=",".join(KNOWN), help="joined by commas")
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--set", action="append", default=[], metavar="key=value", help="a setting that is a text, e.g. stump_checkpoint=none"
    )
    parser.add_argument("--out", type=Path, help="a csv file of the rows")
    return parser.parse_args()


if __name__ == "__main__":
    main()
