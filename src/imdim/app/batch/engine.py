"""What runs jobs: processes of this machine, each under its limits, or a Ray cluster. Every batch goes through this one door."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from imdim.app.batch.folder import LOG, PARTS, Part
from imdim.app.batch.process import LOOK_S, Ended, Process, ProcessLimits


@dataclass(frozen=True)
class Job:
    """A part to reconstruct in the folder `staging`, by `command` followed by input, output and `options`."""

    part: Part
    staging: Path
    command: tuple[str, ...]
    options: tuple[str, ...]
    limits: ProcessLimits

    def arguments(self, source: str) -> Sequence[str]:
        """The whole command line. The output is relative to the folder that it runs in, so that reports don't depend on where that is."""
        return [*self.command, source, "-o", f"{PARTS}/{self.part.name}", *self.options]


def run_jobs(jobs: Iterator[Job], at_once: int | None, address: str | None) -> Generator[tuple[Job, Ended], None, None]:
    """Run jobs, `at_once` at a time (None: one here, all CPUs of a cluster), and yield each when it has ended.

    What runs is ended when the iteration is left. Raises ConfigError where no cluster answers at `address`.
    """
    if not address:
        yield from run_local(jobs, at_once or 1)
        return
    from imdim.app.batch.cluster import connect, run_cluster

    with connect(address) as ray:
        yield from run_cluster(jobs, at_once, ray)


def run_local(jobs: Iterable[Job], at_once: int) -> Generator[tuple[Job, Ended], None, None]:
    """As `run_jobs`, on this machine; one loop watches all processes."""
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
