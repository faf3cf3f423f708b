"""What the solver makes of imperfect programs: ``python scripts/bench/proposals.py [--n 60] [--sigma 0.03] [--change missing]``.

True programs of 1 to 6 primitives are spoilt `k` times each: every number by a normal deviation of `sigma` (of the diagonal; angles by as
many radians), and one primitive left out, one put in, two swapped, or nothing. The solver sees the `k` candidates and the cloud of 2,048
points; its answer is compared with the truth by exact booleans. The best of four candidates, chosen by the truth, stands beside it.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
import torch

from imdim.data.families import PLAIN
from imdim.data.solids import from_sequences, to_signed
from imdim.data.synthesize import SynthesisConfig, synthesize
from imdim.geometry.axes import main_axes
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.sequence import Step, map_terms, to_program
from imdim.program.tree import Primitive, Program
from imdim.search.mdl.repair import Signed, settle

CHANGES = ("none", "missing", "spurious", "swapped")


def main() -> None:
    args = _arguments()
    head = ("sigma", "change", "best of 4 candidates", "IoU >= 0.95", "IoU >= 0.99", "median", "mean", "primitives off", "CPU s per target")
    print(f"| {' | '.join(head)} |")
    print("| --- " * 9 + "|")
    for sigma in args.sigma:
        for change in args.change:
            print(row(sigma, change, args), flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=60, help="targets")
    parser.add_argument("--k", type=int, default=16, help="candidates per target")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--noise", type=float, default=0.0, help="of the cloud, relative to its diagonal")
    parser.add_argument("--primitives", type=int, nargs=2, default=(1, 6), metavar=("MIN", "MAX"))
    parser.add_argument("--sigma", type=float, nargs="*", default=(0.01, 0.03, 0.05))
    parser.add_argument("--change", nargs="*", choices=CHANGES, default=CHANGES)
    return parser.parse_args()


def targets(n: int, low: int, high: int, noise: float, seed: int) -> list[tuple[Signed, np.ndarray]]:
    """True sequences and their clouds [2048, 3]."""
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(seed)
    batch = synthesize(n, SynthesisConfig(n_min=low, n_max=high, free_rotation=0.2, families=PLAIN), generator)
    sequences = to_signed(from_sequences(batch.gt_tokens, batch.gt_params))
    rng = np.random.default_rng(seed)
    clouds = [points.double().numpy() for points in batch.gt_points]
    noisy = [c + noise * rng.normal(size=c.shape) for c in clouds]
    return [(s, c) for s, c in zip(sequences, noisy, strict=True) if s]


def spoilt(truth: Signed, sigma: float, change: str, rng: np.random.Generator) -> Signed:
    """One imperfect candidate; a program of one primitive keeps it, and the first primitive stays positive."""
    parts = list(truth)
    if change == "missing" and len(parts) > 1:
        parts.pop(int(rng.integers(1, len(parts))))
    if change == "spurious":
        size, center = rng.uniform(0.05, 0.4, 3), rng.uniform(-0.3, 0.3, 3)
        kind = ("box", "sphere", "cylinder")[int(rng.integers(3))]
        count = {"box": 3, "sphere": 1, "cylinder": 2}[kind]
        at, op = int(rng.integers(1, len(parts) + 1)), "union" if rng.random() < 0.5 else "difference"
        parts.insert(at, Step(op, Primitive(kind, tuple(size[:count]), tuple(center))))
    if change == "swapped" and len(parts) > 2:
        i = int(rng.integers(1, len(parts) - 1))
        parts[i], parts[i + 1] = parts[i + 1], parts[i]
    return map_terms(tuple(parts), lambda p: _jittered(p, sigma, rng))


def _jittered(p: Primitive, sigma: float, rng: np.random.Generator) -> Primitive:
    size = tuple(max(s + sigma * rng.normal(), 0.3 * s) for s in p.size)
    center = tuple(c + sigma * rng.normal() for c in p.center)
    turn = sigma * rng.normal(size=3)
    rotation = matrix_from_euler(p.rotation) @ matrix_from_euler(tuple(np.degrees(turn)))
    return Primitive(p.kind, size, center, euler_from_matrix(rotation))  # type: ignore[arg-type]


def iou(found: Program, truth: Program) -> float:
    return volume_iou(to_manifold(found), to_manifold(truth))


def row(sigma: float, change: str, args: argparse.Namespace) -> str:
    """One line of the table."""
    rng = np.random.default_rng(args.seed)
    before, after, extra, seconds = [], [], [], []
    for truth, cloud in targets(args.n, *args.primitives, args.noise, args.seed):
        candidates = [spoilt(truth, sigma, change, rng) for _ in range(args.k)]
        start = time.process_time()
        found = settle(candidates, cloud, args.noise, main_axes(cloud))[0]
        seconds.append(time.process_time() - start)
        exact = to_program(truth)
        before.append(max(iou(to_program(c), exact) for c in candidates[:4]))
        after.append(iou(found.program, exact))
        extra.append(len(found.signed) - len(truth))
    shares = [f"{statistics.median(before):.3f}", share(after, 0.95), share(after, 0.99)]
    means = [f"{statistics.median(after):.4f}", f"{statistics.fmean(after):.3f}", f"{statistics.fmean(extra):+.2f}"]
    return f"| {sigma:g} | {change} | {' | '.join([*shares, *means])} | {statistics.fmean(seconds):.2f} |"


def share(values: list[float], bar: float) -> str:
    return f"{sum(v >= bar for v in values) / len(values):.0%}"


if __name__ == "__main__":
    main()
