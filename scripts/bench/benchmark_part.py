"""One part of a benchmark, as a job of its own: sample, fit, score, and `row.json` beside what was delivered.

`benchmark.py` starts it: ``python benchmark_part.py TASK SOURCE -o FOLDER [key=value ...]``, TASK being a `Task` in JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from processor import children_s

from imdim.app.batch.process import ProcessLimits, last_line, run

ROW, FIT_LOG = "row.json", "imdim.log"
SCORING_S = 300.0  # for an independent scorer, at most


@dataclass(frozen=True)
class Task:
    """What all parts share: `command` fits one within `limit_s` and `mib`, `scorer` judges it (empty: this project's own evaluation).

    Seconds of a fit's whole command are told by `clock`, one of `processor.CLOCKS`.
    """

    condition: str
    scorer: str
    command: Sequence[str]
    limit_s: float
    mib: float
    clock: str = "wall"


@dataclass
class Row:
    """One part; `hausdorff` is relative to the target's diagonal, `seconds` are of the fit's whole command.

    `curves` are those of outlines, None where nobody counts them; what they bound is a feature, counted among the `primitives`, each copy
    too. `distinct` is how many of these are no copies, as the report has it, and `step` whether the part came with a STEP file. Fillets and
    chamfers, which `program.scad` draws of several statements or not at all, are features too: `edges` are so many, `features` those of the
    sharp program, by the report, and `whole_iou` is of the delivered mesh, which has all of them.
    """

    part: str
    iou: float = 0.0
    hausdorff: float = float("inf")
    primitives: int | None = None
    reference: int | None = None
    reference_iou: float | None = None
    seconds: float = 0.0
    search_s: float | None = None
    peak_mib: float = 0.0
    stop: str = ""
    curves: int | None = None
    distinct: int | None = None
    step: bool = False
    features: int | None = None
    edges: int = 0
    whole_iou: float = 0.0


class Judgement(NamedTuple):
    """What a scorer says of a program: `hausdorff` is relative to the target's diagonal, the counts are None for a mesh."""

    iou: float
    hausdorff: float
    primitives: int | None = None
    curves: int | None = None


def main(task: str, source: str, _: str, out: str, *settings: str) -> int:
    """Do one part; what the fit does is its row, the exit status tells of what is no fault of it."""
    try:
        row = benchmarked(Task(**json.loads(task)), Path(source), Path(out), settings)
    except ValueError as problem:
        sys.stderr.write(f"{problem}\n")
        return 2
    (Path(out) / ROW).write_text(json.dumps(asdict(row)))
    return 0


def benchmarked(task: Task, part: Path, folder: Path, settings: Sequence[str]) -> Row:
    """Sample, fit, score `part` in `folder`. Raises ValueError for what cannot be sampled."""
    row = Row(folder.name)
    source = sample(part, task.condition, Path(f"{folder.name}.npy"))
    before = children_s()
    ended = run([*task.command, str(source), "-o", str(folder), *settings], ProcessLimits(task.limit_s, task.mib), Path(FIT_LOG))
    sys.stdout.write(Path(FIT_LOG).read_text(encoding="utf-8", errors="backslashreplace"))
    row.seconds, row.peak_mib = ended.seconds if task.clock == "wall" else children_s() - before, ended.peak_mib
    folder.mkdir(exist_ok=True)
    if source != part:
        source.replace(folder / source.name)
    if ended.why:
        row.stop = f"FAILED, {ended.why}" if ended.status <= 0 else f"FAILED, exit {ended.status}: {last_line(Path(FIT_LOG))}"
        return row
    try:
        report = json.loads((folder / "report.json").read_text())
        row.stop, row.search_s = report["stop"], sum(report["timing"]["stages_s"].values())
        row.step = (folder / "program.step").is_file()
        result, scorer = report.get("result", {}), Path(task.scorer) if task.scorer else None
        row.distinct, row.features, row.edges = result.get("without_copies"), result.get("features"), len(report.get("edges", ()))
        judged = score(part, folder / "program.scad", scorer)
        whole = score(part, folder / "mesh.stl", scorer) if row.edges else judged
        row.iou, row.hausdorff, row.primitives, row.curves = judged
        row.whole_iou = whole.iou
    except (ValueError, KeyError, IndexError, OSError, subprocess.SubprocessError) as problem:
        row.stop = f"FAILED, not scored: {' '.join(str(problem).split())[:200]}"
    return row


def sample(part: Path, condition: str, out: Path) -> Path:
    """The part itself, or a cloud of it written to `out`. Raises ValueError for a part that is a cloud already."""
    if condition == "mesh":  # without a second of imports
        return part
    from imdim.target.scan import parse_condition, place_scanners, scan
    from imdim.target.target import load_target

    wanted = parse_condition(condition)
    mesh = load_target(part).mesh
    if mesh is None or wanted is None:
        raise ValueError(f"{part}: a cloud cannot be sampled, give --condition mesh")
    points, normals = scan(mesh, wanted, np.random.default_rng(0))
    table = points if normals is None else np.hstack([points, normals])
    if not wanted.scanners:
        np.save(out, table)
        return out
    np.savez(out.with_suffix(".npz"), points=table, scanners=place_scanners(mesh, wanted.views))
    return out.with_suffix(".npz")


def score(part: Path, answer: Path, scorer: Path | None) -> Judgement:
    """What the scorer says, where there is none this project's own evaluation. Raises ValueError for no solid."""
    if scorer is None:
        return _evaluate(part, answer)
    command = [sys.executable, str(scorer), str(part), str(answer)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=SCORING_S)
    found = json.loads(done.stdout.strip().splitlines()[-1])
    if (state := found.get("pred_ok", "NoError")) != "NoError":
        raise ValueError(f"the scorer takes it for no solid ({state})")
    return Judgement(found["iou"], found.get("hausdorff", float("inf")) / 1000, found.get("leaves"), found.get("curves"))


def _evaluate(part: Path, answer: Path) -> Judgement:
    from imdim.delivery.evaluate import evaluate_file
    from imdim.export.openscad_reader import read_openscad
    from imdim.program.cost import count
    from imdim.target.target import load_target

    scores = evaluate_file(answer, load_target(part))
    if scores.volume_iou is None:
        raise ValueError(scores.iou_missing)
    curves = count(read_openscad(answer.read_text(encoding="utf-8"))).curves if answer.suffix == ".scad" else 0
    hausdorff = max(scores.relative(d).max for d in (scores.to_result, scores.to_target))
    return Judgement(scores.volume_iou, hausdorff, scores.primitives, curves or None)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
