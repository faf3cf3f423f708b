"""Relations found on planted programs, measured: ``python scripts/bench/relations.py [--programs 60] [--seed 0] [--json out.json]``

Programs come from the generator's families; their true relations are found by brute force over their exact numbers (`planted_relations`),
independent of the code under test. A cloud with noise, numbers that are disturbed, a fit without constraints (`refine`), then `discover`,
both as a reconstruction of a cloud calls them. Precision: of the pairwise relations found, those that hold exactly for the true program.
Recall: the share of the rank of all true relations between shown features that those found span. Error: of the shown numbers, with and
without constraints, as a share of the diagonal. No program is dropped; the exit status is 1 where a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from imdim.data.families import PLAIN
from imdim.data.solids import to_signed
from imdim.data.synthesize import SynthesisConfig, draw_programs
from imdim.geometry.lowering import pack, unpack
from imdim.geometry.sampling import surface_points
from imdim.numbers.refine import refine
from imdim.program.sequence import to_program
from imdim.program.tree import Program
from imdim.relations.discover import discover

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "relations"))

POINTS = (2048, 4096, 8192)
BARS = {"precision": 0.95, "recall": 0.85, "error_ratio": 0.5}


def planted(count: int, seed: int) -> list[Program]:
    """Programs of the generator of two to twelve primitives."""
    generator = torch.Generator().manual_seed(seed)
    config = SynthesisConfig(n_min=2, families=PLAIN)
    solids, _ = draw_programs(count, config, generator)
    return [to_program(sequence) for sequence in to_signed(solids) if sequence]


def disturbed(program: Program, rng: np.random.Generator) -> Program:
    """Sizes by up to 2 %, centres by up to 0.005 of the diagonal (which is 1), angles by up to 1 degree."""
    _, params = pack(program)
    noise = rng.uniform(-1, 1, params.shape)
    shifts = noise[:, 3:] * ([0.005] * 3 + [1.0] * 3)
    return unpack(program, np.hstack([params[:, :3] * (1 + 0.02 * noise[:, :3]), params[:, 3:] + shifts]))


def measure(program: Program, points: int, noise: float, rng: np.random.Generator) -> dict:
    """One program: counts, ranks, errors and seconds."""
    from planted_relations import Truth

    exact, _ = surface_points(program, points, rng)
    cloud = exact + noise * float(np.linalg.norm(np.ptp(exact, axis=0))) * rng.normal(size=exact.shape)
    truth = Truth(program, exact)
    free = refine(disturbed(program, rng), cloud).program
    began = time.perf_counter()
    found = discover(free, cloud)
    seconds = time.perf_counter() - began
    pairs = truth.pairs(found.constraints)
    wrong = [p for p in pairs if not truth.holds(p)]
    spanned, rank = truth.spanned([p for p in pairs if truth.holds(p)])
    return {
        "found": len(pairs),
        "wrong": len(wrong),
        "wrong_kinds": [p.kind for p in wrong],
        "wrong_names": [str(p) for p in wrong],
        "rank": rank,
        "spanned": spanned,
        "missed": truth.missed([p for p in pairs if truth.holds(p)]),
        "error_free": truth.error(free),
        "error_held": truth.error(found.program),
        "abs_free": truth.error(free, mean=True),
        "abs_held": truth.error(found.program, mean=True),
        "seconds": seconds,
    }


def rows(programs: int, noise: float, seed: int) -> Iterator[dict]:
    for number, program in enumerate(planted(programs, seed)):
        yield measure(program, POINTS[number % len(POINTS)], noise, np.random.default_rng((seed, number)))


def summary(results: list[dict]) -> dict[str, float]:
    """Totals over all programs; the ratio of errors is that of the programs that have relations, by their median and their mean squares."""
    total = {key: sum(r[key] for r in results) for key in ("found", "wrong", "rank", "spanned")}
    related = [r for r in results if r["rank"]]
    ratios = [r["error_held"] / max(r["error_free"], 1e-12) for r in related]
    squares = [np.sqrt(np.mean([r[key] ** 2 for r in related])) for key in ("error_held", "error_free")]
    return {
        "programs": len(results),
        "true_rank": total["rank"],
        "found": total["found"],
        "precision": 1 - total["wrong"] / max(total["found"], 1),
        "recall": total["spanned"] / max(total["rank"], 1),
        "error_ratio": float(np.median(ratios)),
        "mean_abs_ratio": sum(r["abs_held"] for r in related) / sum(r["abs_free"] for r in related),
        "median_abs_ratio": float(np.median([r["abs_held"] / max(r["abs_free"], 1e-12) for r in related])),
        "error_ratio_rms": float(squares[0] / squares[1]),
        "worse_share": float(np.mean([ratio > 1.05 for ratio in ratios])),
        "median_s": float(np.median([r["seconds"] for r in results])),
        "max_s": max(r["seconds"] for r in results),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=int, default=60)
    parser.add_argument("--noise", type=float, default=0.005, help="standard deviation as a share of the diagonal")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    results = []
    for number, row in enumerate(rows(arguments.programs, arguments.noise, arguments.seed)):
        results.append(row)
        if arguments.verbose:
            ratio = row["error_held"] / max(row["error_free"], 1e-12)
            counts = f"wrong {row['wrong']}/{row['found']} spanned {row['spanned']}/{row['rank']}"
            print(f"{number}: {counts} error x{ratio:.2f} {row['seconds']:.2f} s")
            print("\n".join(f"    wrong {name}" for name in row["wrong_names"]) or "    none wrong")
            print("\n".join(f"    missed {name}" for name in row["missed"]) or "    none missed")
    result = summary(results)
    print(", ".join(f"{key} {value:.4g}" for key, value in result.items()))
    print("wrong by kind:", dict(Counter(kind for r in results for kind in r["wrong_kinds"])))
    if arguments.json:
        arguments.json.write_text(json.dumps({"summary": result, "programs": results}, indent=1) + "\n")
    met = result["precision"] >= BARS["precision"] and result["recall"] >= BARS["recall"] and result["error_ratio"] <= BARS["error_ratio"]
    print("bars met" if met else "a bar is missed")
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
