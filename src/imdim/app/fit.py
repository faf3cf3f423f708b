"""One reconstruction from the command line: check, load, reconstruct, deliver, say where the results are."""

from __future__ import annotations

import gc
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict, replace
from io import StringIO
from os import environ
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from imdim.app.deferred import defer_modules
from imdim.app.orderly import INTERRUPTED, SIGNALS, EndSignal, finishing_first
from imdim.app.piped import STDIN, load_piped
from imdim.app.progress import show_progress
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.program.cost import describe_size
from imdim.reconstruction.config import ConfigError, Settings

if TYPE_CHECKING:
    import numpy as np

    from imdim.export.step_worker import StepWorker
    from imdim.reconstruction.pipeline import Snapshot
    from imdim.target.target import Target

Reconstruct = Callable[["Target", Settings, "np.random.Generator"], "Iterator[Snapshot]"]

FILED_S, PICTURE_S = 1.5, 0.8  # for those of a program as it was found, and for the picture and what comes after it
# for texts, scores and pictures, which take that long whatever the part; at most that share of a budget
WRITING_S, WRITING_SHARE = 2.0, 0.4
LEAST_S = 1.0  # for the reconstruction, however long loading took
STEP_SHARE = 0.01  # of the budget, which STEP may take beyond it; what Python takes to start comes on top
MOST_SAID = 6  # groups of holes on the screen; the report has all
DIFFERS = 1e-3  # of the volume IoU, from which delivery says that it did not keep what was found
ALL_SEEN = 0.99  # share of a result's surface that a cloud shows, from which nothing is said of the rest
SAID_REGIONS, LEAST_SAID = 3, 1e-3  # regions on the screen, and the share of the surface from which one is named
NEARLY_DONE = ("simplify", "solve")  # stages that take about as long as OpenCASCADE to load
RARELY = 20_000  # objects more, at which Python looks for cycles of dead ones: at its own 700 that is 2 to 3 % of a fit
BAD_INPUT = 2
NOT_THE_PART = 3  # results were written, but a script is not to take them for the part
ENDINGS = {
    "left out": "this is not the part: most of its surface is left out",
    "not explained": "this is not the part: the program does not explain what was measured",
    "partial": "this is the part at best in part: what was measured bears out no more",
}
BY_HAND = "by hand"
WRITING = "the result is being written, which takes seconds (press Ctrl-C again to write nothing)"
ENDED = {f"by {signal.Signals(number).name}": 128 + number for number in SIGNALS}  # how a search was stopped, and the exit status then


def main(
    settings_of: Callable[[], Settings],
    reconstruct: Reconstruct | None = None,
    quiet: bool = False,
    as_json: bool = False,
    force: bool = False,
) -> int:
    """Compose settings and fit; the exit status: 0 fine, 2 for input, settings or an output that cannot be used (one line on stderr), 3
    for a result that is not the part (`ENDINGS`), 128 and its number where a signal ended the search, whose best was written.

    Stdout gets a summary, with `as_json` the report in its place; `quiet` leaves out progress, notes and summary. With `force` earlier
    results are replaced even where somebody has changed them.
    """
    sys.excepthook = one_line
    gc.set_threshold(RARELY, *gc.get_threshold()[1:])
    began = time.perf_counter()
    try:
        settings = name_output(settings_of())
        report = _fit_or_refuse(settings, reconstruct, quiet, force, began)
    except ConfigError as error:
        sys.stderr.write(f"imdim: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("imdim: interrupted, nothing was written\n")
        return INTERRUPTED
    if as_json:
        sys.stdout.write(_dumps(report))
    elif not quiet:
        sys.stdout.write(summary(report, Path(settings.output)))
    if report["stop"] in ENDED:
        return ENDED[report["stop"]]
    return NOT_THE_PART if ending_of(report) else 0


def name_output(settings: Settings) -> Settings:
    """The settings with a folder of this directory that is named after the part, where none is given."""
    if settings.output or not settings.input:
        return settings
    return replace(settings, output=f"{STDIN if settings.input == '-' else Path(settings.input).stem}.imdim")


def _dumps(report: Mapping[str, Any]) -> str:
    from imdim.delivery.report import dumps

    return dumps(report)


def _fit_or_refuse(settings: Settings, reconstruct: Reconstruct | None, quiet: bool, force: bool, began: float) -> dict[str, Any]:
    """As `fit`, with every refusal a ConfigError; imports the numeric libraries, which a misspelt setting need not wait for."""
    gc.disable()
    try:
        with defer_modules():
            import imdim.reconstruction.pipeline  # noqa: F401 - for `fit`
            from imdim.delivery.deliver import OutputError
            from imdim.target.target import InputError
    finally:
        gc.freeze()  # what modules hold stays: no dead ones are looked for among it
        gc.enable()

    try:
        return fit(settings, reconstruct, quiet, force, began)
    except (InputError, OutputError) as error:
        raise ConfigError(str(error)) from error


def fit(
    settings: Settings, reconstruct: Reconstruct | None = None, quiet: bool = False, force: bool = False, began: float | None = None
) -> dict[str, Any]:
    """Reconstruct ``settings.input`` into the folder ``settings.output`` and return the report that was written there.

    The budget runs from when the clock showed `began`, by default now.

    Progress and notes go to stderr unless it is to be `quiet`. Raises ConfigError where input or output is not given, OutputError where the
    folder cannot be written, or holds results that were changed by hand unless told to `force`, and InputError where the input cannot be
    used: in each case before anything was written.
    """
    for key in ("input", "output"):
        if not getattr(settings, key):
            raise ConfigError(f"setting {key} is missing: give {key}=...")
    import numpy as np

    from imdim.deadline import Deadline
    from imdim.delivery.deliver import RunRecord, check_untouched, check_writable, deliver
    from imdim.reconstruction import pipeline
    from imdim.reconstruction.delivery_time import time_to_write
    from imdim.target.placement import place
    from imdim.target.target import load_target, printable

    folder, start = Path(settings.output), time.perf_counter() if began is None else began
    check_writable(folder)
    if not force:
        check_untouched(folder)
    target = load_piped(sys.stdin.buffer.read()) if settings.input == "-" else load_target(settings.input)
    target = place(target, settings.units, settings.origin)
    stages = {"loading": time.perf_counter() - start}
    for note in target.notes if not quiet else ():
        sys.stderr.write(f"imdim: {target.name}: {note}\n")
    if reconstruct is None:
        from imdim.delivery.first_run import compile_kernels

        reconstruct = pipeline.reconstruct
        start += compile_kernels(StringIO() if quiet else sys.stderr, cloud=target.mesh is None)
    left = max(settings.budget_s - stages["loading"] - min(WRITING_S, WRITING_SHARE * settings.budget_s), LEAST_S)
    with _EarlyStep() as step:
        snapshots = reconstruct(target, replace(settings, budget_s=left), np.random.default_rng(settings.seed))
        snapshots = _until_stopped(step.watch(snapshots if quiet else show_progress(snapshots, left)))
        last = pipeline.exhaust(snapshots, stages)
        said = {key: printable(value) if isinstance(value, str) else value for key, value in asdict(settings).items()}
        run = RunRecord(
            said["input"], stages, last.stop or "finished", settings.seed, said, last.proof, last.noisy, last.noise, last.edge_sizes
        )
        for note in last.notes if not quiet else ():
            sys.stderr.write(f"imdim: {note}\n")
        target = replace(target, notes=(*target.notes, *last.notes))
        left = 0.0 if last.stop in ENDED else settings.budget_s - (time.perf_counter() - start)  # who sends signals does not wait long
        beyond = STEP_SHARE * settings.budget_s
        needed_s = time_to_write(last.program), FILED_S, PICTURE_S, -beyond
        times = (Deadline(time.perf_counter() + left - needed) for needed in needed_s)
        finish_by, name_by, draw_by, step_by = times
        found = last.program, target, folder, run, settings.segments, STEP_LIMIT_S, last.constraints, last.front, finish_by, last.edges
        with nullcontext() if last.stop in (BY_HAND, *ENDED) else finishing_first(WRITING):
            return deliver(*found, step_worker=step.worker, name_by=name_by, draw_by=draw_by, step_by=step_by)


class _EarlyStep:
    """A process that loads OpenCASCADE on another core, if there is one, while the numbers of the program are still looked for; it ends
    with the block."""

    def __init__(self) -> None:
        self.worker: StepWorker | None = None

    def __enter__(self) -> _EarlyStep:
        return self

    def watch(self, snapshots: Iterator[Snapshot]) -> Iterator[Snapshot]:
        """The snapshots; the process is started with the first whose structure is found."""
        from imdim.export.step_worker import StepError, start_worker
        from imdim.side_process import count_cores

        for snapshot in snapshots:
            if self.worker is None and snapshot.stage in NEARLY_DONE and count_cores() > 1:
                with suppress(StepError):  # delivery says why there is none
                    self.worker = start_worker()
            yield snapshot

    def __exit__(self, *_: object) -> None:
        from imdim.export.step_worker import stop_worker

        if self.worker is not None:
            stop_worker(self.worker)


def _until_stopped(snapshots: Iterator[Snapshot]) -> Iterator[Snapshot]:
    """The snapshots; where a person or a signal stops the search, those so far, the last of them once more as one that was stopped."""
    last = None
    try:
        for last in snapshots:
            yield last
    except (KeyboardInterrupt, EndSignal) as asked:
        if last is None:
            raise
        stop, again = (f"by {asked.signal}", "") if isinstance(asked, EndSignal) else (BY_HAND, " (press Ctrl-C again to write nothing)")
        sys.stderr.write(f"imdim: stopped {stop}; the best program so far is written{again}\n")
        yield replace(last, stop=stop)


def summary(report: Mapping[str, Any], folder: Path) -> str:
    """What was found and where it is, with the picture to open."""
    scores, result = report["scores"], report["result"]
    size, iou = describe_size(result["primitives"], result.get("curves"), result["without_copies"]), scores["volume_iou"]
    furthest = scores["distance_relative_to_diagonal"]["target_to_result"]
    fit = f"mean distance {100 * furthest['mean']:.3f} % of the diagonal" if iou is None else f"volume IoU {iou:.4f}"
    lines = [f"{size}, {fit}, {report['timing']['total_s']:.1f} s (stopped: {report['stop']})"]
    lines += [f"  {report['proof']}"] if report.get("proof") else []
    lines += _verdict_lines(report)
    same = report["found"]["iou_with_delivered"]
    lines += [f"  delivered differs from found: IoU {same:.4f}"] if 1 - same > DIFFERS else []
    said = [f"{name} {interval['says']}" for name, interval in report.get("intervals", {}).items()]
    more = f" and {len(said) - MOST_SAID} more" if len(said) > MOST_SAID else ""
    lines += [f"  {'measured':<8} {', '.join(said[:MOST_SAID])}{more} (95 %)"] if said else []
    said = [repeat["says"] for repeat in report.get("repeats", [])]
    lines += [f"  {'repeats':<8} {'; '.join(said)}"] if said else []
    said = [group["says"] for group in report.get("holes", [])]
    more = f" and {len(said) - MOST_SAID} more" if len(said) > MOST_SAID else ""
    lines += [f"  {'holes':<8} {'; '.join(said[:MOST_SAID])}{more}"] if said else []
    said = [feature["says"] for feature in report.get("edges", [])]
    sharp = "" if report.get("edges_drawn") in (True, None) else " (program.scad draws them with -D edges=true)"
    lines += [f"  {'edges':<8} {'; '.join(said)}{sharp}"] if said else []
    lines += [f"  {said}" for said in report.get("left_out", [])]
    skipped = {name: said for name, said in report["files"].items() if said.startswith(("skipped", "written, "))}
    lines += [f"  {name} {said}{_later(name, said, folder)}" for name, said in skipped.items() if name != "program.loops.scad"]
    lines += [
        f"  {what:<8} {folder / name}"
        for what, name in (("picture", "preview.png"), ("page", "report.html"), ("program", "program.scad"), ("report", "report.json"))
    ]
    lines += [ending_of(report)] if ending_of(report) else []
    return "\n".join(lines) + "\n"


def ending_of(report: Mapping[str, Any]) -> str:
    """Why the result is not to be taken for the part; empty where it may be."""
    return ENDINGS.get(report.get("verdict", {}).get("overall"), "")


def _verdict_lines(report: Mapping[str, Any]) -> list[str]:
    """What became of the part's surface, which regions are not exact, and what may help."""
    verdict = report.get("verdict")
    if verdict is None:
        return []
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for region in verdict["regions"]:
        if region["share"] >= LEAST_SAID:
            groups.setdefault((region["verdict"], region["what"]), []).append(region)
    parts = [_describe_regions(*key, regions) for key, regions in groups.items()]
    more = f"; and {len(parts) - SAID_REGIONS} more" if len(parts) > SAID_REGIONS else ""
    said = "; ".join(parts[:SAID_REGIONS])
    lines = [f"  {'verdict':<8} {verdict['overall']}: {verdict['says']}"]
    lines += [f"  {'where':<8} {said}{more}"] if said else []
    lines += [f"  {'doubt':<8} {said}" for said in verdict.get("doubts", [])]
    coverage = report.get("coverage")
    if coverage is not None and coverage["shares"]["seen"] < ALL_SEEN:
        unknown = [f"{r['what']} {r['where']}" for r in coverage["regions"] if r["coverage"] == "unknown" and r["share"] >= LEAST_SAID]
        more = f" and {len(unknown) - SAID_REGIONS} more" if len(unknown) > SAID_REGIONS else ""
        lines += [f"  {'seen':<8} of the result's surface: {coverage['says']}"]
        lines += [f"  {'unknown':<8} {'; '.join(unknown[:SAID_REGIONS])}{more}"] if unknown else []
    budget = report.get("settings", {}).get("budget_s")
    helps = verdict["overall"] != "exact" and report["stop"] == "budget_spent" and budget
    return lines + ([f"  {'hint':<8} the time ended the search: try --budget {2 * budget:g}"] if helps else [])


def _describe_regions(verdict: str, what: str, alike: Sequence[Mapping[str, Any]]) -> str:
    """Regions of one verdict that are alike: what they are, and where the first is."""
    share = 100 * sum(region["share"] for region in alike)
    many = f"{len(alike)} x ({what}), the first" if len(alike) > 1 else what
    return f"{share:.1f} % {verdict}, {many} {alike[0]['where']}"


def _later(name: str, said: str, folder: Path) -> str:
    """The command that writes what time did not suffice for."""
    has_time = name == "program.step" and "took more than" in said
    return f"; imdim export {folder / 'program.json'} -o {folder}-step waits {STEP_LIMIT_S:g} s for it" if has_time else ""


def one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """An excepthook for defects: one line with the place, or the whole traceback where IMDIM_TRACEBACK is set."""
    if environ.get("IMDIM_TRACEBACK"):
        traceback.print_exception(kind, error, trace)
        return
    frames = traceback.extract_tb(trace)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    message = next(iter(str(error).splitlines()), "")
    sys.stderr.write(f"imdim: internal error, {kind.__name__}: {message}{place} (set IMDIM_TRACEBACK=1 for the whole trace)\n")
