"""What each stage of the search in noise adds: searches that share the time, copies, leaves looked for anew, and the policy, in one run.

    python scripts/bench/noise_stages.py FOLDER --condition noise=1% [--budget 60] [--only d001,d002] [--scorer score.py] [--out out/stages]

The stages follow one another, and the policy is asked last: without it a run ends with what it had before, and without it and leaves that
are looked for anew with what the searches and copies had found. So one run of a part, with budget and seconds of the processor, is its
ablations too. The program of each stage gets its numbers and relations as a last one does, without a limit of time, and the volume IoU with
the mesh. Also told is how many parts had the policy asked at all, and on how many it changed the program. Bodies that are looked at one by
one are left out: a cloud that is split has no stages of its own.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from processor import rule_the_clock

STAGES = ("searches", "copies", "anew", "policy")
TOLD = (*STAGES, "delivered")
REACHED, LONGER = 0.97, 1.5  # the IoU that counts, with at most so many times the person's primitives


@dataclass
class Row:
    """A part: the IoU and the number of leaves of each stage that had its turn, and, as `delivered`, of program.scad; whether the policy
    was asked, what ended the search, and the seconds of the processor that the fit took."""

    part: str
    iou: dict[str, float] = field(default_factory=dict)
    leaves: dict[str, int] = field(default_factory=dict)
    asked: bool = False
    stop: str = ""
    seconds: float = 0.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--condition", default="noise=1%")
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    parser.add_argument("--scorer", type=Path, help="as that of benchmark.py, for what is delivered")
    parser.add_argument("--out", type=Path, default=Path("out/stages"))
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(asdict(run_part(args.folder, args.condition, args.budget, args.scorer))))
        return 0
    wanted = {name for name in args.only.split(",") if name}
    parts = [path for path in sorted(args.folder.glob("*.stl")) if not wanted or path.stem in wanted]
    if not parts or wanted - {path.stem for path in parts}:
        sys.stderr.write(f"{args.folder}: {len(parts)} parts, no {', '.join(sorted(wanted - {p.stem for p in parts})) or '.stl file'}\n")
        return 2
    rows = []
    for part in parts:
        command = [sys.executable, __file__, str(part), "--condition", args.condition, "--budget", str(args.budget), "--one"]
        command += [] if args.scorer is None else ["--scorer", str(args.scorer)]
        done = subprocess.run(command, capture_output=True, text=True)
        row = Row(**json.loads(done.stdout.splitlines()[-1])) if done.returncode == 0 else Row(part.stem, stop=f"FAILED: {last_line(done)}")
        rows.append(row)
        said = ", ".join(f"{stage} {row.iou[stage]:.4f} ({row.leaves[stage]})" for stage in TOLD if stage in row.iou)
        print(f"{row.part}  {said}  {'asked' if row.asked else ''}  {row.seconds:.1f} s  {row.stop}", flush=True)
    write_rows(rows, args.out)
    print("\n".join(summarise(rows, read_reference(args.folder))))
    return 0


def last_line(done: subprocess.CompletedProcess[str]) -> str:
    return (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1][:120]


def run_part(part: Path, condition: str, budget_s: float, scorer: Path | None) -> Row:
    """One part in this process."""
    from benchmark_part import sample, score

    row, found = Row(part.stem), dict[str, Any]()
    with tempfile.TemporaryDirectory() as name:
        source = sample(part, condition, Path(name) / f"{part.stem}.npy")
        rule_the_clock()
        from imdim.app.fit import fit
        from imdim.reconstruction.config import Settings

        record_stages(found)
        start = time.process_time()
        report = fit(Settings(input=str(source), output=f"{name}/out", budget_s=budget_s))
        row.asked, row.stop, row.seconds = "asked" in found, report["stop"], time.process_time() - start
        finish_stages(row, found, part, source)
        judged = score(part, Path(name) / "out" / "program.scad", scorer)
        row.iou["delivered"], row.leaves["delivered"] = judged.iou, judged.primitives or 0
    return row


def record_stages(found: dict[str, Any]) -> None:
    """Have the stages of this process's searches put what they begin and end with into `found`."""
    from imdim.reconstruction import mdl

    cloud = mdl._NoisyCloud
    copy, anew, ask = cloud._copy, cloud._rebuild_and_shorten, cloud._ask

    def copying(self: Any, best: Any, *rest: Any) -> Any:
        found.clear()  # where kernels were compiled first, that had a search of its own
        found["searches"], found["cloud"] = best, self
        return copy(self, best, *rest)

    def rebuilding(self: Any, best: Any, *rest: Any) -> Any:
        found.setdefault("copies", best)
        out = anew(self, best, *rest)
        found["policy" if "before" in found else "anew"] = out
        return out

    def asking(self: Any, best: Any, *rest: Any) -> Any:
        found["before"] = best
        if self.policy is not None and mdl.has_time_for_beam(rest[-1]):
            found["asked"] = True
        found["policy"] = ask(self, best, *rest)
        return found["policy"]

    for name, wrapped in (("_copy", copying), ("_rebuild_and_shorten", rebuilding), ("_ask", asking)):
        setattr(cloud, name, wrapped)


def finish_stages(row: Row, found: dict[str, Any], part: Path, source: Path) -> None:
    """Fill in the IoU and the leaves of each stage in `found` whose program is another than that of the stage before, or its own."""
    from imdim.deadline import NEVER
    from imdim.detection.cloud_bodies import split_cloud
    from imdim.detection.noise import measure_noise
    from imdim.geometry.sampling import subsample
    from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
    from imdim.program.rewrite.simplify import reduce_program
    from imdim.program.tree import leaves
    from imdim.reconstruction.likely_numbers import CAREFUL, MOST_POINTS, fit_numbers, hold_relations
    from imdim.target.target import in_unit_frame, load_target

    target = load_target(source)
    if "cloud" not in found or len(split_cloud(target.points, measure_noise(target.points, np.random.default_rng(0))[0].sigma)) > 1:
        return
    mesh = load_target(part).mesh
    assert mesh is not None  # it was sampled
    solid = mesh_to_manifold(mesh)
    _, frame = in_unit_frame(target)
    points, before = subsample(found["cloud"].points, MOST_POINTS), ("", None)
    for stage in STAGES:
        if stage not in found:
            continue
        likely = found[stage]
        if before[1] is not None and likely.program == before[1]:
            row.iou[stage], row.leaves[stage] = row.iou[before[0]], row.leaves[before[0]]
            continue
        fitted = fit_numbers(reduce_program(likely.program), points, likely.noise, NEVER, CAREFUL)
        program, _ = hold_relations(fitted, points, NEVER)
        row.iou[stage] = volume_iou(to_manifold(frame.undo(program)), solid)
        row.leaves[stage], before = sum(1 for _ in leaves(program)), (stage, likely.program)


def write_rows(rows: list[Row], out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with (out / "stages.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["part", *(f"{what} {stage}" for stage in TOLD for what in ("iou", "leaves")), "asked", "seconds", "stop"])
        for row in rows:
            cells = [told.get(stage, "") for stage in TOLD for told in (row.iou, row.leaves)]
            writer.writerow([row.part, *cells, row.asked, f"{row.seconds:.1f}", row.stop])


def read_reference(folder: Path) -> dict[str, int]:
    """The person's primitives by part; empty where the folder does not say."""
    path = folder / "human.json"
    return {} if not path.is_file() else {name: told["primitives"] for name, told in json.loads(path.read_text()).items()}


def summarise(rows: list[Row], reference: dict[str, int]) -> list[str]:
    """Of each stage, over the parts that had it, how many are reached and the mean IoU; a part whose stage had no turn has that before, and
    one that failed has 0."""
    lines = [f"{len(rows)} parts, {sum(1 for row in rows if not row.iou)} without stages"]
    last = dict[str, str]()
    for stage in TOLD:
        last |= {row.part: stage for row in rows if stage in row.iou}
        told = [(row.part, row.iou[last[row.part]], row.leaves[last[row.part]]) for row in rows if row.part in last]
        told += [(row.part, 0.0, 0) for row in rows if row.stop.startswith("FAILED")]
        reached = sum(1 for part, iou, count in told if iou >= REACHED and count <= LONGER * reference.get(part, count))
        mean = sum(iou for _, iou, _ in told) / max(len(told), 1)
        lines.append(f"after {stage}: {reached} of {len(rows)} at {REACHED}, mean {mean:.4f} of {len(told)}")
    changed = sum(1 for row in rows if row.asked and row.iou.get("policy") != row.iou.get("anew"))
    lines.append(f"policy asked on {sum(1 for row in rows if row.asked)}, changed {changed}")
    return lines


if __name__ == "__main__":
    sys.exit(main())
