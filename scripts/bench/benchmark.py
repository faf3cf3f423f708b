"""Run a folder of parts through `imdim fit`, score what was delivered, print and write the table.

    python scripts/bench/benchmark.py FOLDER [--condition mesh] [--jobs 2] [--budget 60] [--clock wall] [--scorer score.py]
        [--out out/bench] [--set key=value]

What a policy is worth on clouds: `--condition noise=1%` once with `--set checkpoint=none` and once without.

Each part is a job of the engine that `imdim batch` has: a process of its own that samples, fits and scores, with the fit's seconds and
peak memory measured by the system. With `--clock processor` budget and seconds are of the processor, which other work on the machine
changes little. A part that fails, in whatever way, is a row with IoU 0. The same command continues a benchmark that
was stopped; parts whose file has changed are done again, other settings, another scorer and other code are refused. `human.json` or
`inversecsg.json` in the folder give reference counts (and IoUs). Exit status 2: nothing could be done, 130: stopped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmark_part import ROW, SCORING_S, Row, Task
from benchmark_table import FAILED, contact_sheet, line, write_tables
from processor import CLOCKS

import imdim
from imdim.app.batch import folder
from imdim.app.batch.engine import PartJob, run_jobs
from imdim.app.batch.folder import PARTS, Outcome, Part
from imdim.app.batch.process import Ended, ProcessLimits
from imdim.app.batch.run import BAD_INPUT, COMMAND, GRACE_S, INTERRUPTED, MEMORY_MIB, decisive, limits_of, options, settings_of
from imdim.reconstruction.config import ConfigError, Settings
from imdim.target.readers import FORMATS
from imdim.target.scan import parse_condition

JOB = (sys.executable, str(Path(__file__).with_name("benchmark_part.py")))
CODE = (  # rows of two versions make no table
    (Path(imdim.__file__).parent, "**/*.py"),
    (Path(__file__).parents[2] / "models", "*.safetensors"),
    (Path(__file__).parent, "benchmark_part.py"),
)
REFERENCES = ("human.json", "inversecsg.json")
TABLES = ("table.md", "table.csv", "sheet.png")
BUSY = 5.0  # the wall clock's limit may be longer by this where the budget is told by the processor's
CLOCKED = (sys.executable, str(Path(__file__).with_name("processor.py")), "fit")
BESIDE_S, BESIDE_MIB = SCORING_S + 120.0, 2048.0  # for sampling and scoring, beyond what the fit may take


def main(argv: Sequence[str], command: Sequence[str] | None = None) -> int:
    """Run or continue a benchmark; the exit status. `command` is what fits one part, by default `imdim fit` by the clock given."""
    args = _parser().parse_intermixed_args(argv)
    command = command or (COMMAND if args.clock == "wall" else CLOCKED)
    args.settings += args.given
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        _run(args, command)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"benchmark: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("benchmark: stopped; the same command continues\n")
        return INTERRUPTED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--condition", default="mesh", help="mesh, cloud, normals, noise=0.5%%, outliers=2%%, views=3, scanners, points=20000, joined by +"
    )
    parser.add_argument("--jobs", type=int, default=1, help="parts at a time, on a cluster too (default 1)")
    parser.add_argument("--address", default="", help="of a Ray cluster whose machines see this checkout under the same path")
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--clock", default="wall", choices=CLOCKS, help="what budget and seconds are told by (default wall)")
    parser.add_argument("--limit", type=float, metavar="SECONDS", help=f"wall clock before a fit is ended (default: budget + {GRACE_S:g})")
    parser.add_argument("--memory", type=float, default=MEMORY_MIB, metavar="MIB", help="before a fit is ended (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    parser.add_argument("--skip", default="", help="parts to leave out, joined by commas")
    parser.add_argument("--again", action="store_true", help="try parts again that failed in an earlier run")
    parser.add_argument("--scorer", type=Path, help="an independent scorer: `python SCORER TARGET PREDICTION` prints one JSON line")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--sheet", action="store_true", help="write sheet.png, all previews in one picture")
    parser.add_argument("--set", action="append", default=[], dest="given", metavar="key=value", help="a setting of the run, any number")
    parser.add_argument("settings", nargs="*", metavar="key=value", help="the same")
    return parser


def _run(args: argparse.Namespace, command: Sequence[str]) -> None:
    parse_condition(args.condition)
    settings = settings_of(args)
    limits, out = limits_of(args, settings), args.out.absolute()
    parts = find_parts(args.folder, _names(args.only), _names(args.skip))
    scorer = "" if args.scorer is None else str(args.scorer.absolute())
    limit = limits.seconds if args.limit or args.clock == "wall" else BUSY * limits.seconds
    task = Task(args.condition, scorer, tuple(command), limit, limits.mib, args.clock)
    whole = ProcessLimits(limit + BESIDE_S, limits.mib + BESIDE_MIB, limits.cores)
    with folder.open_batch(out, _noted(args, task, settings)):
        rows = _kept(out, parts, args.again)
        jobs = (_job(part, out, task, whole, settings) for part in parts if part.name not in rows)
        with closing(run_jobs(jobs, args.jobs, args.address or None)) as ended:
            text = _record(args, parts, rows, ended)
        print("\n" + text)
        if args.sheet:
            contact_sheet([out / part.name / "preview.png" for part in parts], out / "sheet.png")
    print(f"table: {args.out / 'table.md'}")


def _names(text: str) -> set[str]:
    return set(filter(None, text.split(",")))


def find_parts(source: Path, only: set[str], skip: set[str]) -> list[Part]:
    """Model files of a folder by name, those that `only` names (if any) but for those that `skip` names. Raises ConfigError for none."""
    every = folder.find_parts(source, tuple(FORMATS))
    if missing := (only | skip) - {p.name for p in every}:
        raise ConfigError(f"{source}: no part named {', '.join(sorted(missing))}")
    chosen = [p for p in every if (not only or p.name in only) and p.name not in skip]
    if reserved := [p.source.name for p in chosen if p.name in (folder.NOTE, *TABLES)]:
        raise ConfigError(f"{source}: {reserved[0]} has the name of a table, rename it")
    if not chosen:
        raise ConfigError(f"{source}: no part is left")
    return chosen


def read_reference(source: Path) -> dict[str, dict]:
    """Per part name: `primitives`, and `iou` where the reference has one."""
    found = [json.loads((source / name).read_text()) for name in REFERENCES if (source / name).is_file()]
    return {part: entry for table in found for part, entry in table.items()}


def _noted(args: argparse.Namespace, task: Task, settings: Settings) -> dict[str, Any]:
    """What decides the rows, seconds among them."""
    seen = {"condition": args.condition, "jobs": args.jobs, "address": args.address}
    seen |= {"clock": task.clock, "limit_s": task.limit_s, "memory_mib": task.mib}
    code = [path for place, pattern in CODE for path in sorted(place.glob(pattern))]
    return seen | {"scorer": _digest([Path(task.scorer)]) if task.scorer else "", "code": _digest(code)} | decisive(settings)


def _digest(files: Sequence[Path]) -> str:
    try:
        return hashlib.sha256(b"".join(hashlib.sha256(path.read_bytes()).digest() for path in files)).hexdigest()[:12]
    except OSError as error:
        raise ConfigError(f"{error.filename}: {error.strerror}") from error


def _job(part: Part, out: Path, task: Task, limits: ProcessLimits, settings: Settings) -> PartJob:
    return PartJob(part, folder.staging(out, part), (*JOB, json.dumps(asdict(task))), options(decisive(settings)), limits)


def _kept(out: Path, parts: Sequence[Part], again: bool) -> dict[str, Row]:
    """The rows of an earlier run, by part; with `again` not those of failures."""
    outcomes = folder.read_finished(out, parts, again)
    found = {name: _failure(outcome) if outcome.failure else _read(out / name / ROW) for name, outcome in outcomes.items()}
    return {name: row for name, row in found.items() if row and not (again and row.stop.startswith(FAILED))}


def _record(args: argparse.Namespace, parts: Sequence[Part], rows: dict[str, Row], ended: Iterator[tuple[PartJob, Ended]]) -> str:
    """Put each part that ends in its place, print its row and rewrite the tables; the text of the last."""
    out, reference = args.out.absolute(), read_reference(args.folder)
    settings = [f"{args.jobs} at a time", *(["by the processor's clock"] if args.clock == "processor" else []), *args.settings]
    title = ", ".join([f"{args.folder.name}, {args.condition}, budget {args.budget:g} s, seed {args.seed}", *settings])
    if rows:
        sys.stderr.write(f"benchmark: {len(rows)} of {len(parts)} parts are done already\n")

    def tables() -> str:
        done = [_referred(rows[part.name], reference) for part in parts if part.name in rows]
        missing = "" if len(done) == len(parts) else f", {len(done)} of {len(parts)} parts"
        return write_tables(done, title + missing, args.budget, out)

    for job, how in ended:
        outcome, row = _judged(job, how)
        folder.commit(out, job.staging, outcome)
        rows[row.part] = row
        print(line(_referred(row, reference)), flush=True)
        tables()
    return tables()


def _judged(job: PartJob, how: Ended) -> tuple[Outcome, Row]:
    """The record of a job and its row: what it has measured, or its own failure."""
    outcome = Outcome(job.part.name, job.part.source.name, job.part.digest, how.why, seconds=how.seconds, peak_mib=how.peak_mib)
    row = None if how.why else _read(job.staging / PARTS / outcome.part / ROW)
    if row is None:
        outcome = replace(outcome, failure=how.why or f"no readable {ROW}")
    return outcome, row or _failure(outcome)


def _failure(outcome: Outcome) -> Row:
    return Row(outcome.part, seconds=outcome.seconds, peak_mib=outcome.peak_mib, stop=f"{FAILED}, {outcome.failure}")


def _read(path: Path) -> Row | None:
    try:
        return Row(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError):
        return None


def _referred(row: Row, reference: Mapping[str, Any]) -> Row:
    entry = reference.get(row.part, {})
    return replace(row, reference=entry.get("primitives"), reference_iou=entry.get("iou"))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
