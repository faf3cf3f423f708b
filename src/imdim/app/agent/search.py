"""A fit in a process of its own, which the lab's pool has: it reports as it goes, ends at once, and no fault in it ends the server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from imdim.app.lab import protocol
from imdim.app.lab.jobs import END_KINDS, WorkerPool
from imdim.app.lab.protocol import Message
from imdim.app.lab.requests import request
from imdim.program import codec
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature
from imdim.program.tree import Program, leaves
from imdim.reconstruction.config import Settings
from imdim.target.target import Target

LISTENED_EVERY_S, REPORT_EVERY_S = 0.2, 1.0
LATE_S = 120.0  # after the budget, by which even a slow machine has ended
THE_LAB = "; the lab goes on"

Progress = Callable[[float, float, str], None]  # seconds, of how many, and what is going on


@dataclass(frozen=True)
class FoundProgram:
    """The last program of a fit, and why it ended; `is_last` unless the fit was stopped before, and then relations were not looked for."""

    program: Program
    constraints: tuple[Constraint, ...]
    edges: tuple[EdgeFeature, ...]
    stop: str
    notes: tuple[str, ...]
    is_last: bool


def run_fit(pool: WorkerPool, target: Target, settings: Settings, progress: Progress, ending: threading.Event) -> FoundProgram:
    """Reconstruct `target`, until `ending` is set at the latest. Raises a one-line ValueError where nothing was found."""
    answers: SimpleQueue[Message] = SimpleQueue()
    job = pool.submit(request("fit", target, settings), answers.put)
    start, reported, last, said, stop = time.perf_counter(), -REPORT_EVERY_S, None, "starting", "finished"
    while True:
        try:
            message = answers.get(timeout=LISTENED_EVERY_S)
        except Empty:
            message = None
        seconds = time.perf_counter() - start
        if message is not None and message.kind == "snapshot":
            last, stop = message.values, message.values["stop"] or stop
            features = sum(1 for _ in leaves(codec.from_json(last["document"])))
            said = f"{last['stage']}: {features} features, error {last['error']:.3g}"
        elif message is not None and message.kind in END_KINDS:
            if message.kind != "done":
                raise ValueError(message.values["message"].removesuffix(THE_LAB))
            break
        if ending.is_set() or seconds > settings.budget_s + LATE_S:
            pool.stop(job)
            stop = "stopped" if ending.is_set() else "took too long"
            break
        if message is not None or seconds - reported >= REPORT_EVERY_S:
            reported = seconds
            progress(seconds, max(settings.budget_s, seconds), said)
    if last is None:
        raise ValueError(f"the fit found no program: {stop}")
    program, constraints = protocol.read_document(last["document"])
    return FoundProgram(program, constraints, codec.edges_of(last["document"]), stop, tuple(last["notes"]), bool(last["stop"]))
