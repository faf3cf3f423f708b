"""Whether more points of a noisy cloud ever make its program worse: planted parts, scanned with more and more points.

    python scripts/bench/density.py [--noise 0.5% 1% 2%] [--points 8192 16384 65536] [--seeds 1 2 3] [--primitives 4] [--budget 40]

Part i is `planting.planted` of seed i; every scan has 2 % of outliers. A row for each noise and number of points: the IoU with the part of
each seed, by exact booleans, their mean, and the numbers of primitives. Budgets are seconds of the processor, so that a busy machine
changes little.
"""

from __future__ import annotations

import argparse
import sys

from processor import rule_the_clock

OUTLIERS = 0.02


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noise", nargs="+", default=["0.5%", "1%", "2%"])
    parser.add_argument("--points", nargs="+", type=int, default=[8192, 16384, 65536])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--primitives", type=int, default=4)
    parser.add_argument("--budget", type=float, default=40.0, metavar="SECONDS")
    args = parser.parse_args()
    rule_the_clock()
    # kernels that were not compiled yet would cost the first part its time
    _row(0.01, 2048, argparse.Namespace(seeds=[1], primitives=2, budget=args.budget))
    print("| noise | points | IoU of each part | mean | primitives |\n| --- | --- | --- | --- | --- |", flush=True)
    for noise in args.noise:
        for points in args.points:
            print(f"| {noise} | {points:,} | {_row(float(noise.rstrip('%')) / 100, points, args)} |", flush=True)
    return 0


def _row(noise: float, points: int, args: argparse.Namespace) -> str:
    """The cells of one condition."""
    import numpy as np
    import planting

    from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
    from imdim.program.cost import count
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import reconstruct_best
    from imdim.target.scan import Condition, scan

    same, sizes = [], []
    for seed in args.seeds:
        mesh = planting.mesh_of(planting.planted(np.random.default_rng(seed), args.primitives))
        cloud, _ = scan(mesh, Condition(noise=noise, outliers=OUTLIERS), np.random.default_rng(seed), points)
        program = reconstruct_best(cloud, Settings(budget_s=args.budget)).program
        same.append(volume_iou(to_manifold(program), mesh_to_manifold(mesh)))
        sizes.append(count(program).primitives)
    return f"{', '.join(f'{v:.3f}' for v in same)} | {np.mean(same):.3f} | {', '.join(map(str, sizes))}"


if __name__ == "__main__":
    sys.exit(main())
