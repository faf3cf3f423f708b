"""What each seed source is worth: evaluations until an evolution reaches IoU 0.95, against random seeds.

    python scripts/bench/seeds.py FOLDER [--least 3] [--most 10] [--parts N] [--limit 20] [--json out.json] [--programs DIR]

Parts are those of FOLDER whose reference (human.json) has `least` to `most` primitives; with --parts an even choice of N of them. Sources:
random trees (`blind`: with operators that know no detected surface either), the decision tree, greedy insertion over detected surfaces,
the structure search, all of them together, and `policy` where --programs names a folder with PART/program.json files that a policy wrote.
Every evolution has the same operators and the same generator; it ends at IoU 0.95 (by the samples: one minus the volume that differs, a
lower bound) or after --limit seconds. Evaluations count trees that were folded, seeds among them; a part that never gets there counts with
what it used, so its ratio is a bound. Seconds include making the seeds; they and the ratios hold within one run.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.program.codec import loads
from imdim.program.tree import Program
from imdim.reconstruction.config import Settings
from imdim.reconstruction.evidence import ScoringSamples
from imdim.reconstruction.observation import UnitBody, observe
from imdim.search.evolve.population import EvolutionConfig, evolve
from imdim.search.evolve.proposals import random_programs
from imdim.search.evolve.scene import Scene
from imdim.search.evolve.seeds import steps, surface_seeds
from imdim.search.structure import StructureConfig, search
from imdim.target.target import Frame, in_unit_frame, load_target

BAR = 0.95
RANDOM = 64


@dataclass
class Run:
    part: str
    source: str
    seeds: int
    evaluations: int
    seconds: float
    reached: bool


def main() -> None:
    args = _arguments()
    runs: list[Run] = []
    for part in chosen(args.folder, args.least, args.most, args.parts):
        for run in part_runs(part, args.limit, args.programs):
            runs.append(run)
            how = "reached" if run.reached else "NOT reached"
            print(f"{run.part:<12} {run.source:<9} {how} with {run.evaluations} evaluations, {run.seconds:.2f} s", flush=True)
    print("\n" + table(runs))
    if args.json:
        args.json.write_text(json.dumps([asdict(r) for r in runs], indent=1) + "\n")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--least", type=int, default=3)
    parser.add_argument("--most", type=int, default=10)
    parser.add_argument("--parts", type=int, help="an even choice of so many parts")
    parser.add_argument("--limit", type=float, default=20.0, metavar="SECONDS")
    parser.add_argument("--programs", type=Path, help="a folder with PART/program.json of a policy, in the part's units")
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


def chosen(folder: Path, least: int, most: int, count: int | None) -> list[Path]:
    """Mesh files of parts with a reference of the wanted size, by name."""
    reference = json.loads((folder / "human.json").read_text())
    names = sorted(name for name, entry in reference.items() if least <= entry["primitives"] <= most)
    if count is not None and count < len(names):
        names = [names[i] for i in np.linspace(0, len(names) - 1, count).round().astype(int)]
    return [next(p for p in sorted(folder.glob(f"{name}.*")) if p.suffix != ".json") for name in names]


def part_runs(part: Path, limit_s: float, programs: Path | None) -> list[Run]:
    """One run per source. Each starts from the same generator and a scorer that has seen nothing."""
    unit, frame = in_unit_frame(load_target(part))
    runs = []
    for source in ("random", "blind", "tree", "surfaces", "search", *(("policy",) if programs else ()), "all"):
        rng = np.random.default_rng(0)
        seen = observe(UnitBody.of(unit, rng), Settings().size_weight, rng)
        evidence = replace(seen.evidence, exact=source != "blind")  # a price of leaving surfaces that are not known would make no sense
        given = programs / part.stem / "program.json" if programs else None
        runs.append(one_run(part.stem, source, evidence, frame, limit_s, given))
    return runs


def one_run(part: str, source: str, evidence: ScoringSamples, frame: Frame, limit_s: float, given: Path | None) -> Run:
    scene = Scene(evidence.scorer, evidence.families.arrangement.outer, None if source == "blind" else evidence.families)
    scene.scorer.score(random_programs(scene, 1, np.random.default_rng(9)))  # compiled code is loaded before the clock starts
    rng, start, before = np.random.default_rng(1), time.perf_counter(), scene.scorer.evaluations
    seeds = make_seeds(source, evidence, scene, frame, given)

    def run(reached: bool) -> Run:
        return Run(part, source, len(seeds), scene.scorer.evaluations - before, time.perf_counter() - start, reached)

    # one by one, so that a seed that is good enough counts itself and those before it
    for seed in seeds:
        if 1 - scene.scorer.score([seed])[0].volume >= BAR:
            return run(True)
    config = EvolutionConfig(generations=100_000, patience=100_000)
    for generation in evolve({source: seeds}, scene, rng, Deadline(start + limit_s), config, evidence.solve):
        if 1 - min(i.score.volume for i in generation.front) >= BAR:
            return run(True)
    return run(False)


def make_seeds(source: str, evidence: ScoringSamples, scene: Scene, frame: Frame, given: Path | None) -> list[Program]:
    """Programs of a source in the unit frame; the policy's, then the cheapest first where all are asked for."""
    if source in ("random", "blind"):
        return random_programs(scene, RANDOM, np.random.default_rng(2))
    if source == "tree":
        return [tree] if (tree := evidence.tree()) else []
    if source == "surfaces":
        return surface_seeds(evidence.families, evidence.size_weight, NEVER)
    if source == "search":
        found = search(evidence.families, StructureConfig(size_weight=evidence.size_weight), np.random.default_rng(3), NEVER)
        return [p for f in found for p in steps(f.sequence, evidence.families)]
    if source == "policy":
        return [frame.apply(loads(given.read_text()))] if given and given.is_file() else []
    return [p for s in ("policy", "tree", "surfaces", "search") for p in make_seeds(s, evidence, scene, frame, given)]


def table(runs: Sequence[Run]) -> str:
    """Medians per source, ratios being those of each part."""
    random = {r.part: r for r in runs if r.source == "random"}
    lines = ["| seeds | reached | evaluations | fewer than random, times | seconds | faster than random, times |"]
    lines.append("| --- " * 6 + "|")
    for source in dict.fromkeys(r.source for r in runs):
        own = [r for r in runs if r.source == source]
        fewer = statistics.median(random[r.part].evaluations / max(r.evaluations, 1) for r in own)
        faster = statistics.median(random[r.part].seconds / r.seconds for r in own)
        evaluations, seconds = (statistics.median(v) for v in zip(*((r.evaluations, r.seconds) for r in own), strict=True))
        reached = f"{sum(r.reached for r in own)} of {len(own)}"
        lines.append(f"| {source} | {reached} | {evaluations:.0f} | {fewer:.1f} | {seconds:.2f} | {faster:.1f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
