"""Progress of a reconstruction on stderr: a live line on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from imdim.reconstruction.pipeline import Snapshot

QUIET_S = 2.0  # between two plain lines of one stage
FIRST = "finding surfaces"  # said before there is any program


def describe(snapshot: Snapshot, best: float) -> str:
    """One line: stage, best error so far if it is known, how many primitives, or features and curves."""
    from imdim.program.cost import count
    from imdim.reconstruction.body_state import UNKNOWN

    told = "unknown" if best == UNKNOWN else f"{best:.3g}"
    return f"{snapshot.stage:<12} error {told:<9} {count(snapshot.program)}"


def show_progress(snapshots: Iterable[Snapshot], budget_s: float, stream: TextIO | None = None) -> Iterator[Snapshot]:
    """The same snapshots, each shown on `stream` (stderr) as it passes."""
    out: TextIO = stream or sys.stderr
    return _live(snapshots, budget_s, out) if out.isatty() else _plain(snapshots, budget_s, out)


def _plain(snapshots: Iterable[Snapshot], budget_s: float, stream: TextIO) -> Iterator[Snapshot]:
    stream.write(f"{0.0:6.1f} s  {FIRST}, {budget_s:.0f} s left\n")
    stream.flush()
    stage, last, best = "", -QUIET_S, float("inf")
    for snapshot in snapshots:
        best = min(best, snapshot.error)
        if snapshot.stage != stage or snapshot.seconds >= last + QUIET_S:
            left = max(0.0, budget_s - snapshot.seconds)
            stream.write(f"{snapshot.seconds:6.1f} s  {describe(snapshot, best)}, {left:.0f} s left\n")
            stream.flush()
            stage, last = snapshot.stage, snapshot.seconds
        yield snapshot


def _live(snapshots: Iterable[Snapshot], budget_s: float, stream: TextIO) -> Iterator[Snapshot]:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{max(0.0, budget_s - (task.elapsed or 0.0)):.0f} s left")

    best = float("inf")
    with Progress(SpinnerColumn(), TextColumn("{task.description}"), TimeLeft(), console=Console(file=stream), transient=True) as bar:
        task = bar.add_task(FIRST, total=None)
        for snapshot in snapshots:
            best = min(best, snapshot.error)
            bar.update(task, description=describe(snapshot, best))
            yield snapshot
