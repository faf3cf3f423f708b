"""Jobs on this machine, a few at a time, each a spawned process under its limits; one loop watches them all."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from imdim.app.batch.folder import LOG, PARTS, Part
from imdim.app.batch.process import LOOK_S, Ended, Limits, Process


@dataclass(frozen=True)
class Job:
    """A part to reconstruct in the folder `staging`, by `command` followed by input, output and `options`."""

    part: Part
    staging: Path
    command: tuple[str, ...]
    options: tuple[str, ...]
    limits: Limits

    def arguments(self, source: str) -> Sequence[str]:
        """The whole command line. The output is relative to the folder that it runs in, so that reports don't depend on where that is."""
        return [*self.command, source, "-o", f"{PARTS}/{self.part.name}", *self.options]


def run_local(jobs: Iterable[Job], at_once: int) -> Generator[tuple[Job, Ended], None, None]:
    """Run jobs, `at_once` at a time, and yield each when it has ended. What runs is ended when the iteration is left."""
    waiting, running = iter(jobs), dict[Process, Job]()
    try:
        while True:
            while len(running) < at_once and (job := next(waiting, None)) is not None:
                running[Process(job.arguments(str(job.part.source)), job.limits, job.staging / LOG, job.staging)] = job
            if not running:
                return
            for process in list(running):
                if (ended := process.look()) is not None:
                    yield running.pop(process), ended
            time.sleep(LOOK_S)
    finally:
        for process in running:
            process.stop()
