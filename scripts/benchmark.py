"""Run a folder of parts through `imdim fit`, score what was delivered, print and write the table.

    python scripts/benchmark.py FOLDER [--condition mesh] [--jobs 2] [--budget 60] [--scorer score.py] [--out out/bench] [--set key=value]

What a policy is worth on clouds: `--condition noise=1%` once with `--set checkpoint=none` and once without.

Each part runs in its own process, with its wall clock and peak memory measured by the system. A part that fails, in whatever
way, is a row with IoU 0. `human.json` or `inversecsg.json` in the folder give reference counts (and IoUs).
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import statistics
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from imdim.app.batch.process import Limits, last_line, run
from imdim.evaluate import evaluate_file
from imdim.geometry.cloud import load_target
from imdim.geometry.readers import FORMATS
from imdim.geometry.scan import parse_condition, scan

GRACE_S = 60.0  # for start-up and delivery, beyond the budget, before a part is ended by force
COMMAND = [sys.executable, "-m", "imdim.app.cli", "fit"]
REFERENCES = ("human.json", "inversecsg.json")


@dataclass
class Row:
    """One part; `hausdorff` is relative to the target's diagonal, `seconds` is the wall clock of the whole command."""

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


def main() -> None:
    args = _arguments()
    parts = find_parts(args.folder, _names(args.only), _names(args.skip))
    reference = read_reference(args.folder)
    args.out.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(args.jobs) as pool:
        rows = []
        for row in pool.map(lambda part: run_part(part, args, reference.get(part.stem, {})), parts):
            rows.append(row)
            print(line(row), flush=True)
    title = ", ".join(
        [f"{args.folder.name}, {args.condition}, budget {args.budget:g} s, seed {args.seed}, {args.jobs} at a time", *args.settings]
    )
    text = f"# {title}\n\n{markdown(rows)}\n\n" + "\n".join(f"- {s}" for s in summary(rows, args.budget)) + "\n"
    (args.out / "table.md").write_text(text)
    write_csv(rows, args.out / "table.csv")
    print("\n" + text)
    if args.sheet:
        contact_sheet([args.out / part.stem / "preview.png" for part in parts], args.out / "sheet.png")
    print(f"table: {args.out / 'table.md'}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--condition", default="mesh", help="mesh, cloud, cloud+normals, noise=0.5%%, outliers=2%%, views=1, joined by +")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    parser.add_argument("--skip", default="", help="parts to leave out, joined by commas")
    parser.add_argument("--scorer", type=Path, help="an independent scorer: `python SCORER TARGET PREDICTION` prints one JSON line")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--sheet", action="store_true", help="write sheet.png, all previews in one picture")
    parser.add_argument("--set", action="append", default=[], dest="given", metavar="key=value", help="a setting of the run, any number")
    parser.add_argument("settings", nargs="*", metavar="key=value", help="the same")
    args = parser.parse_intermixed_args()
    args.settings += args.given
    return args


def _names(text: str) -> set[str]:
    return set(filter(None, text.split(",")))


def find_parts(folder: Path, only: set[str], skip: set[str]) -> list[Path]:
    """Model files of `folder` by name, those that `only` names (if any) but for those that `skip` names; exits with one line for none."""
    every = sorted(p for p in folder.glob("*") if p.suffix.lower() in FORMATS)
    missing = (only | skip) - {p.stem for p in every}
    if missing or not every:
        sys.exit(f"{folder}: no part named {', '.join(sorted(missing))}" if missing else f"{folder}: 0 model files")
    return [p for p in every if (not only or p.stem in only) and p.stem not in skip]


def read_reference(folder: Path) -> dict[str, dict]:
    """Per part name: `primitives`, and `iou` where the reference has one."""
    found = [json.loads((folder / name).read_text()) for name in REFERENCES if (folder / name).is_file()]
    return {part: entry for table in found for part, entry in table.items()}


def run_part(part: Path, args: argparse.Namespace, reference: dict) -> Row:
    """Sample, fit, score one part; never raises for what the part does."""
    row = Row(part.stem, reference=reference.get("primitives"), reference_iou=reference.get("iou"))
    folder = args.out / part.stem
    source = sample(part, args.condition, folder.with_suffix(".npy"))
    command = [*COMMAND, str(source), "-o", str(folder), "--budget", str(args.budget), "--seed", str(args.seed), *args.settings]
    status, error, row.seconds, row.peak_mib = measured(command, args.budget + GRACE_S, folder.with_suffix(".log"))
    if status != 0:
        row.stop = f"FAILED, exit {status}: {error}"
        return row
    report = json.loads((folder / "report.json").read_text())
    row.stop, row.search_s = report["stop"], sum(report["timing"]["stages_s"].values())
    try:
        row.iou, row.hausdorff, row.primitives = score(part, folder / "program.scad", args.scorer)
    except (ValueError, KeyError, subprocess.CalledProcessError) as problem:
        row.stop = f"FAILED, not scored: {problem}"
    return row


def sample(part: Path, condition: str, out: Path) -> Path:
    """The part itself, or a cloud of it written to `out`."""
    wanted = parse_condition(condition)
    if wanted is None:
        return part
    mesh = load_target(part).mesh
    if mesh is None:
        raise SystemExit(f"{part}: a cloud cannot be sampled, give --condition mesh")
    points, normals = scan(mesh, wanted, np.random.default_rng(0))
    np.save(out, points if normals is None else np.hstack([points, normals]))
    return out


def measured(command: list[str], limit_s: float, log: Path) -> tuple[int, str, float, float]:
    """Run to the end or to `limit_s`: exit status (negative: a signal), last line of its output, seconds, peak MiB."""
    ended = run(command, Limits(limit_s), log)
    return ended.status, last_line(log), ended.seconds, ended.peak_mib


def score(part: Path, prediction: Path, scorer: Path | None) -> tuple[float, float, int]:
    """IoU, Hausdorff distance relative to the target's diagonal, and primitives of a delivered program."""
    if scorer is not None:
        done = subprocess.run([sys.executable, str(scorer), str(part), str(prediction)], capture_output=True, text=True, check=True)
        found = json.loads(done.stdout.strip().splitlines()[-1])
        return found["iou"], found.get("hausdorff", float("inf")) / 1000, found["leaves"]
    scores = evaluate_file(prediction, load_target(part))
    if scores.volume_iou is None or scores.primitives is None:
        raise ValueError(scores.iou_missing)
    return scores.volume_iou, max(scores.relative(d).max for d in (scores.to_result, scores.to_target)), scores.primitives


def line(row: Row) -> str:
    against = "" if row.reference is None else f" (reference {row.reference})"
    return (
        f"{row.part:<28} IoU {row.iou:.4f}  {row.primitives} primitives{against}  {row.seconds:.1f} s  {row.peak_mib:.0f} MiB  {row.stop}"
    )


def markdown(rows: list[Row]) -> str:
    """The table, one row per part."""
    head = "| part | IoU | Hausdorff / diagonal | primitives | reference | reference IoU | seconds | peak MiB | stop |"
    body = [
        f"| {r.part} | {r.iou:.4f} | {r.hausdorff:.4f} | {_or(r.primitives)} | {_or(r.reference)} | {_or(r.reference_iou)} "
        f"| {r.seconds:.1f} | {r.peak_mib:.0f} | {r.stop} |"
        for r in rows
    ]
    return "\n".join([head, "| --- " * 9 + "|", *body])


def summary(rows: list[Row], budget: float) -> list[str]:
    """Shares over every part, failures counted as misses."""
    count = len(rows)
    known = [r for r in rows if r.reference is not None]
    short = [r for r in known if _primitives(r) <= (r.reference or 0)]
    lines = [f"{count} parts, {sum(r.stop.startswith('FAILED') for r in rows)} failed"]
    lines += [f"IoU >= {bar}: {_share(sum(r.iou >= bar for r in rows), count)}" for bar in (0.99, 0.98, 0.97)]
    lines.append(f"mean IoU {statistics.fmean(r.iou for r in rows):.4f}")
    if known:
        lines.append(f"no more primitives than the reference: {_share(len(short), len(known))}")
        lines.append(f"IoU >= 0.99 and no more primitives than the reference: {_share(sum(r.iou >= 0.99 for r in short), len(known))}")
    for most in (math.inf, 30):
        rivals = [r for r in known if r.reference_iou and (r.reference or 0) <= most]
        better = sum(r.iou >= (r.reference_iou or 0) and _primitives(r) < (r.reference or 0) for r in rivals)
        if rivals:
            among = "" if most == math.inf else f", among those of at most {most} reference primitives"
            lines.append(f"IoU at least the reference's and fewer primitives{among}: {_share(better, len(rivals))}")
    times = [r.seconds for r in rows]
    lines.append(
        f"seconds: median {statistics.median(times):.1f}, longest {max(times):.1f}; over the budget: {sum(t > budget for t in times)}"
    )
    lines.append(f"peak memory: {max(r.peak_mib for r in rows):.0f} MiB")
    return lines


def _primitives(row: Row) -> float:
    return math.inf if row.primitives is None else row.primitives


def _share(hits: int, count: int) -> str:
    return f"{hits} of {count} ({100 * hits / count:.0f} %)"


def _or(value: float | int | None) -> str:
    return "" if value is None else str(value)


def write_csv(rows: list[Row], path: Path) -> None:
    with path.open("w", newline="") as out:
        writer = csv.DictWriter(out, [f.name for f in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def contact_sheet(pictures: list[Path], out: Path, width: int = 480, columns: int = 3) -> None:
    """All pictures that exist, scaled to `width`, row by row, each under its part's name."""
    from PIL import Image, ImageDraw

    tiles = []
    for path in filter(Path.is_file, pictures):
        with Image.open(path) as picture:
            tiles.append((path.parent.name, picture.convert("RGB").resize((width, round(width * picture.height / picture.width)))))
    if not tiles:
        return
    height = max(tile.height for _, tile in tiles) + 16
    sheet = Image.new("RGB", (width * columns, height * -(-len(tiles) // columns)), "white")
    for i, (name, tile) in enumerate(tiles):
        corner = (i % columns * width, i // columns * height)
        ImageDraw.Draw(sheet).text((corner[0] + 4, corner[1] + 2), name, fill="black")
        sheet.paste(tile, (corner[0], corner[1] + 16))
    sheet.save(out)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        os._exit(130)  # the threads wait for their parts, which end with this process
