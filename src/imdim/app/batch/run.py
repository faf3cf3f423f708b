"""``imdim batch parts/ -o out/``: every model file of a folder reconstructed, whatever some of them do; continues where it was stopped."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

from imdim.app.batch import folder
from imdim.app.batch.engine import PartJob, run_jobs
from imdim.app.batch.folder import Outcome, Part, to_line
from imdim.app.batch.process import Ended, ProcessLimits
from imdim.app.batch.table import write_tables
from imdim.app.cli import SETTINGS, settings_help
from imdim.program.cost import describe_size
from imdim.reconstruction.config import ConfigError, Settings, from_arguments
from imdim.side_process import count_cores

COMMAND = (sys.executable, "-m", "imdim.app.cli", "fit")
GRACE_S = 60.0  # for start-up and delivery, beyond the budget, before a part is ended by force
MEMORY_MIB = 4096
BAD_INPUT, SOME_FAILED, INTERRUPTED = 2, 1, 130
PATHS = ("checkpoint", "stump_checkpoint", "logdir")


def parser() -> argparse.ArgumentParser:
    """The arguments of `imdim batch`."""
    out = argparse.ArgumentParser(
        prog="imdim batch",
        description="Reconstruct every model file of a folder. The same command continues a batch that was stopped.",
        epilog="exit status: 0 all done, 1 some failed (results.csv says why), 2 nothing could be done, 130 stopped\n\n"
        + settings_help("input", "output", "budget_s", "seed"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("input", metavar="PARTS", help="folder of STL, OBJ, OFF, PLY, 3MF, GLB, XYZ, TXT, CSV, PCD, NPY and NPZ files")
    out.add_argument("-o", "--output", required=True, metavar="FOLDER", help="where results.csv, results.html and a folder per part go")
    out.add_argument("--jobs", type=int, help="parts at a time (default 1; on a cluster as many as it has CPUs)")
    out.add_argument("--address", metavar="ADDRESS", help="of a Ray cluster, e.g. ray://head:10001; needs the extra [cluster]")
    out.add_argument("--budget", type=float, metavar="SECONDS", help="time for the search of each part (default 60)")
    out.add_argument("--seed", type=int, help="the same seed gives the same programs (default 0)")
    out.add_argument("--limit", type=float, metavar="SECONDS", help=f"wall clock before a part is ended (default: budget + {GRACE_S:g})")
    out.add_argument("--memory", type=float, default=MEMORY_MIB, metavar="MIB", help="before a part is ended (default %(default)s)")
    out.add_argument("--again", action="store_true", help="try parts again that failed in an earlier run")
    out.add_argument("settings", nargs="*", metavar="key=value", help=SETTINGS)
    return out


def main(argv: Sequence[str], command: Sequence[str] = COMMAND) -> int:
    """Run or continue a batch; the exit status. `command` is what fits one part."""
    given = parser().parse_intermixed_args(argv)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return _run(given, tuple(command))
    except ConfigError as error:
        sys.stderr.write(f"imdim: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("imdim: stopped; the same command continues\n")
        return INTERRUPTED


def _run(given: argparse.Namespace, command: tuple[str, ...]) -> int:
    from imdim.target.readers import FORMATS

    settings = settings_of(given)
    limits = limits_of(given, settings)
    out, parts = Path(given.output).absolute(), folder.find_parts(Path(given.input), tuple(FORMATS))
    noted = decisive(settings)
    with folder.open_batch(out, noted):
        outcomes = folder.read_finished(out / folder.PARTS, parts, given.again)
        jobs = (PartJob(p, folder.staging(out, p), command, options(noted), limits) for p in parts if p.name not in outcomes)
        with closing(run_jobs(jobs, given.jobs, given.address)) as ended:
            _record(out, parts, outcomes, ended)
    failed = sum(bool(outcome.failure) for outcome in outcomes.values())
    lines = (f"{len(parts)} parts, {failed} failed", f"  table    {given.output}/results.html", f"  numbers  {given.output}/results.csv")
    sys.stdout.write("\n".join(lines) + "\n")
    return SOME_FAILED if failed else 0


def settings_of(given: argparse.Namespace) -> Settings:
    """Of every part, from `budget`, `seed` and `settings`. Raises ConfigError. Paths are made absolute: parts run elsewhere."""
    typed = {"budget_s": given.budget, "seed": given.seed}
    settings = from_arguments(given.settings, **{key: value for key, value in typed.items() if value is not None})
    if settings.input or settings.output:
        raise ConfigError("settings input and output are those of each part: give PARTS and -o FOLDER")
    for key in PATHS:
        if getattr(settings, key) not in ("", "none"):
            setattr(settings, key, str(Path(getattr(settings, key)).absolute()))
    return settings


def limits_of(given: argparse.Namespace, settings: Settings) -> ProcessLimits:
    """Of every part, from `limit` and `memory`. Raises ConfigError, for `jobs` too."""
    cores = 1 if given.address else count_cores() // (given.jobs or 1)
    limits = ProcessLimits(given.limit or settings.budget_s + GRACE_S, given.memory, max(1, cores))
    if limits.seconds <= 0 or limits.mib <= 0 or (given.jobs is not None and given.jobs < 1):
        raise ConfigError("--limit, --memory and --jobs need positive numbers")
    return limits


def decisive(settings: Settings) -> dict[str, Any]:
    """What decides the results."""
    return {key: value for key, value in asdict(settings).items() if key not in ("input", "output")}


def options(noted: Mapping[str, Any]) -> tuple[str, ...]:
    """`decisive` settings as arguments of `imdim fit`."""
    return tuple(f"{key}={json.dumps(value)}" for key, value in noted.items())


def _record(out: Path, parts: Sequence[Part], outcomes: dict[str, Outcome], ended: Iterator[tuple[PartJob, Ended]]) -> None:
    """Put each part that ends in its place, with a line, and rewrite the tables."""
    start, before = time.monotonic(), len(outcomes)
    if before:
        sys.stderr.write(f"imdim: {before} of {len(parts)} parts are done already\n")
    try:
        write_tables(out, parts, outcomes, _status(outcomes, len(parts), None), running=True)
        for job, how in ended:
            outcome = folder.outcome_of(job.part, job.staging, how.seconds, how.peak_mib, how.why)
            folder.commit(out / folder.PARTS, job.staging, outcome)
            outcomes[outcome.part] = outcome
            left = (len(parts) - len(outcomes)) * (time.monotonic() - start) / (len(outcomes) - before)
            sys.stderr.write(f"[{len(outcomes)}/{len(parts)}] {_line(outcome)}; {_time_left(left)}\n")
            write_tables(out, parts, outcomes, _status(outcomes, len(parts), left), running=True)
    finally:
        write_tables(out, parts, outcomes, _status(outcomes, len(parts), None), running=False)


def _line(outcome: Outcome) -> str:
    if outcome.failure:
        return f"{to_line(outcome.input)}: FAILED, {to_line(outcome.failure)}"
    iou = f"mean distance {100 * (outcome.mean_distance or 0):.3f} %" if outcome.volume_iou is None else f"IoU {outcome.volume_iou:.4f}"
    size = describe_size(outcome.primitives or 0, outcome.curves)
    return f"{to_line(outcome.input)}: {size}, {iou}, {outcome.seconds:.1f} s"


def _status(outcomes: dict[str, Outcome], total: int, left: float | None) -> str:
    failed = sum(bool(outcome.failure) for outcome in outcomes.values())
    return f"{len(outcomes)} of {total} parts done, {failed} failed" + ("" if left is None else f", {_time_left(left)}")


def _time_left(seconds: float) -> str:
    return f"{seconds:.0f} s left" if seconds < 100 else f"{seconds / 60:.0f} min left"
