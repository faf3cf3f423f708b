"""Population scoring against a plain numpy loop over trees, and against the leaf table alone.

    python scripts/bench/population_scoring.py [--trees 256] [--primitives 16] [--points 4096] [--json out.json]

`cold` scores trees of which no leaf was ever seen, `warm` the children of those trees, each with one new leaf, as an evolution does.
All run on one core; the least of several repetitions counts. The exit status is 1 where cold scoring is under 20 times the loop.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import pack
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.paths import leaf_paths, replace_at
from imdim.program.tree import OPS, SIZE_NAMES, Combine, Primitive, Program, fold, leaves
from imdim.search.front.fitness import FitnessConfig, SampledTarget, Scorer
from imdim.search.front.leaf_cache import LeafCache, Registry

KINDS = ("box", "sphere", "cylinder", "cone", "torus")
BAR = 20.0
T = TypeVar("T")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("trees", 256), ("primitives", 16), ("points", 4096), ("repeat", 5)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--json", type=Path)
    found = measured(**{k: v for k, v in vars(parser.parse_args()).items() if k != "json"})
    for key, value in found.items():
        print(f"{key:<28} {value:.4g}")
    if path := parser.parse_args().json:
        path.write_text(json.dumps(found, indent=1) + "\n")
    sys.exit(found["cold_times_faster"] < BAR)


def measured(trees: int, primitives: int, points: int, repeat: int) -> dict[str, float]:
    """Milliseconds and ratios; distances at half of the `points` and occupancy at the other half."""
    rng = np.random.default_rng(0)
    surface, samples = rng.uniform(-1, 1, (2, points // 2, 3))
    w_in = (np.linalg.norm(samples, axis=1) < 0.8) / len(samples)
    evidence = SampledTarget(surface, 1.0, samples, w_in, 1 / len(samples) - w_in)
    capacity = trees * (primitives + 2)
    config = FitnessConfig(capacity=capacity)
    parents = [random_tree(rng, primitives) for _ in range(trees)]
    children = [with_new_leaf(p, rng) for p in parents]
    scorer = Scorer(evidence, config)
    scorer.score([random_tree(rng, 2)])

    loop_s, expected = timed(lambda: [plain(p, evidence, config) for p in parents])
    populations = [[random_tree(rng, primitives) for _ in range(trees)] for _ in range(repeat)]
    cold_s = min(timed(lambda p=p: scorer.score(p))[0] for p in populations)
    got = [s.error for s in scorer.score(parents)]
    warm_s = timed(lambda: scorer.score(children))[0]
    table_s = min(leaf_table_s(p, evidence, capacity) for p in populations)
    double_s = min(double_table_s(p, evidence) for p in populations)
    return {
        "loop_ms": 1e3 * loop_s,
        "cold_ms": 1e3 * cold_s,
        "warm_ms": 1e3 * warm_s,
        "leaf_table_ms": 1e3 * table_s,
        "double_leaf_table_ms": 1e3 * double_s,
        "cold_times_faster": loop_s / cold_s,
        "warm_times_faster": loop_s / warm_s,
        "cold_over_leaf_table": cold_s / table_s,
        "cold_over_double_leaf_table": cold_s / double_s,
        "warm_over_leaf_table": warm_s / table_s,
        "largest_difference": float(np.abs(np.subtract(got, expected)).max()),
    }


def timed(run: Callable[[], T]) -> tuple[float, T]:
    start = time.perf_counter()
    value = run()
    return time.perf_counter() - start, value


def leaf_table_s(population: list[Program], evidence: SampledTarget, capacity: int) -> float:
    """Filling both tables with the leaves of a population, without trees."""
    parts = [leaf for p in population for leaf in leaves(p)]
    registry = Registry()
    tables = [LeafCache(evidence.surface, "distances", registry, capacity), LeafCache(evidence.samples, "bits", registry, capacity)]
    for table in tables:
        table.table.fill(0)  # the pages are there, as they are in a run
    ids = np.array([registry.id(part) for part in parts])
    return timed(lambda: [table.rows(ids) for table in tables])[0]


def double_table_s(population: list[Program], evidence: SampledTarget) -> float:
    """The same points through the project's double-precision leaf table, a tree at a time."""
    packed = [pack(p) for p in population]
    both = np.concatenate([evidence.surface, evidence.samples])
    return timed(lambda: [kernels.leaf_table(kinds, params, both) for kinds, params in packed])[0]


def random_tree(rng: np.random.Generator, count: int) -> Program:
    parts: list[Program] = [random_leaf(rng) for _ in range(count)]
    while len(parts) > 1:
        i = int(rng.integers(len(parts) - 1))
        parts[i : i + 2] = [Combine(OPS[rng.integers(3)], parts[i], parts[i + 1])]
    return parts[0]


def random_leaf(rng: np.random.Generator) -> Primitive:
    kind = KINDS[rng.integers(len(KINDS))]
    size = tuple(sorted(rng.uniform(0.2, 0.8, len(SIZE_NAMES[kind])).tolist(), reverse=True))
    x, y, z, rx, ry, rz = (*rng.uniform(-0.5, 0.5, 3).tolist(), *rng.uniform(-180, 180, 3).tolist())
    return Primitive(kind, size, (x, y, z), (rx, ry, rz))


def with_new_leaf(program: Program, rng: np.random.Generator) -> Program:
    paths = leaf_paths(program)
    path, leaf = paths[rng.integers(len(paths))]
    return replace_at(program, path, replace(leaf, center=tuple((np.array(leaf.center) + rng.normal(0, 0.01, 3)).tolist())))


# --- the plain loop --------------------------------------------------------------------------------------------------


def plain(program: Program, evidence: SampledTarget, config: FitnessConfig) -> float:
    """The error of one tree as numpy says it, leaf by leaf."""
    both = np.concatenate([evidence.surface, evidence.samples])
    ops = {"union": np.minimum, "intersection": np.maximum, "difference": lambda a, b: np.maximum(a, -b)}
    value = fold(program, lambda _, leaf: plain_leaf(leaf, both), ops)  # type: ignore[arg-type]
    near, inside = np.abs(value[: len(evidence.surface)]), value[len(evidence.surface) :] < 0
    distance = np.minimum(near, config.cap * evidence.diagonal).mean() * evidence.area
    return float(np.where(inside, evidence.w_out, evidence.w_in).sum() + config.distance_weight * distance) / evidence.volume


def plain_leaf(leaf: Primitive, points: np.ndarray) -> np.ndarray:
    """Signed distances [n]; written from the definitions, for the comparison is with what one would write first."""
    q = (points - leaf.center) @ matrix_from_euler(leaf.rotation)
    size = np.array(leaf.size)
    if leaf.kind == "box":
        d = np.abs(q) - size / 2
        return np.linalg.norm(np.maximum(d, 0), axis=1) + np.minimum(d.max(1), 0)
    if leaf.kind == "sphere":
        return np.linalg.norm(q, axis=1) - size[0]
    rho, z = np.hypot(q[:, 0], q[:, 1]), q[:, 2]
    if leaf.kind == "cylinder":
        d = np.stack([rho - size[0], np.abs(z) - size[1] / 2], 1)
        return np.linalg.norm(np.maximum(d, 0), axis=1) + np.minimum(d.max(1), 0)
    if leaf.kind == "torus":
        return np.hypot(rho - size[0], z) - size[1]
    edge = np.array([size[1] - size[0], size[2]])
    rim = np.stack([rho - size[0], z + size[2] / 2], 1)
    within = np.maximum(rim @ [edge[1], -edge[0]] / np.linalg.norm(edge), np.abs(z) - size[2] / 2)
    slant = rim - np.clip(rim @ edge / (edge @ edge), 0, 1)[:, None] * edge
    cap = np.hypot(np.maximum(rho - np.where(z < 0, size[0], size[1]), 0), np.abs(z) - size[2] / 2)
    return np.where(within > 0, np.minimum(np.linalg.norm(slant, axis=1), cap), within)


if __name__ == "__main__":
    main()
