"""The bars of the constraint solver, measured: ``python scripts/bench/sketch.py [--clouds 50] [--json out.json]``

Cube: 200 random starts, 8 points, 18 constraints. Freedom: 40 planted sketches and skeletons. Rectangles: 50 noisy clouds. No case is
dropped; the exit status is 1 where a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from imdim.sketch import named
from imdim.sketch.freedom import freedom
from imdim.sketch.solver import solve

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "examples" / "phases"), str(ROOT / "tests" / "sketch")]
CUBE_DISTANCES = np.sqrt(np.repeat([1, 2, 3], [12, 12, 4]))


def cubes(starts: int) -> dict[str, float]:
    theory, good, first, seconds = named.cube(), 0, 0, []
    for seed in range(starts):
        began = time.perf_counter()
        found = solve(theory, rng=np.random.default_rng(seed))
        seconds.append(time.perf_counter() - began)
        gaps = np.linalg.norm(found.points[:, None] - found.points, axis=2)[np.triu_indices(8, 1)]
        exact = found.violation <= 1e-9 and np.abs(np.sort(gaps) - CUBE_DISTANCES).max() < 1e-8
        good += exact
        first += exact and found.starts == 1
    return {
        "starts": starts,
        "solved_share": good / starts,
        "solved_without_restart_share": first / starts,
        "median_s": float(np.median(seconds)),
        "max_s": max(seconds),
    }


def freedoms() -> dict[str, int]:
    from planted_sketches import planted_forty

    right = 0
    everything = planted_forty()
    for number, planted in enumerate(everything):
        rng = np.random.default_rng(number)
        start = planted.points + 0.02 * rng.normal(size=planted.points.shape) * [1, 1, planted.theory.dimension - 2]
        found = solve(planted.theory, start, rng=rng)
        free = freedom(planted.theory, found.points)
        right += found.stop == "solved" and (free.dof, free.redundant) == (planted.dof, planted.redundant)
    return {"planted": len(everything), "right": right}


def rectangles(clouds: int) -> dict[str, float]:
    from phase3_evolution import is_rectangle, rectangle_cloud
    from theory_evolution import evolve

    good, exact, seconds = 0, 0, []
    for seed in range(clouds):
        rng = np.random.default_rng(seed)
        planted = rectangle_cloud(rng)
        began = time.perf_counter()
        *_, last = evolve(planted.cloud, rng=rng)
        seconds.append(time.perf_counter() - began)
        good += is_rectangle(last, planted.sides)
        exact += is_rectangle(last, planted.sides, degrees=1e-4)
    return {"clouds": clouds, "found_share": good / clouds, "exact_share": exact / clouds, "median_s": float(np.median(seconds))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--clouds", type=int, default=50)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result = {"cube": cubes(arguments.starts), "freedom": freedoms(), "rectangle": rectangles(arguments.clouds)}
    for name, row in result.items():
        print(f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in row.items()))
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1) + "\n")
    met = (
        result["cube"]["solved_share"] >= 0.98 and result["cube"]["median_s"] < 0.3,
        result["freedom"]["right"] == result["freedom"]["planted"],
        result["rectangle"]["found_share"] >= 0.9,
    )
    print("bars met" if all(met) else "a bar is missed")
    sys.exit(0 if all(met) else 1)


if __name__ == "__main__":
    main()
