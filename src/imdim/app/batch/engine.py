"""What runs jobs: processes of this machine, each under its limits, or a Ray cluster. Every batch goes through this one door.

On a cluster files travel with the task, so that machines need not share a disk, only have IMDIM installed. A task whose machine or worker
dies is started again elsewhere by Ray; its result reaches this machine once.
"""

from __future__ import annotations

import logging
import os
import signal
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from imdim.app.batch.folder import LOG, PARTS, Part
from imdim.app.batch.process import LOOK_S, Ended, Process, ProcessLimits, run
from imdim.install import install_command
from imdim.reconstruction.config import ConfigError

RETRIES = 3  # of a task whose machine died; what the part itself does is no reason to try again
AHEAD = 2  # tasks in flight per CPU, so that none waits for its file

Files = dict[str, bytes]


@dataclass(frozen=True)
class PartJob:
    """A part to reconstruct in the folder `staging`, by `command` followed by input, output and `options`."""

    part: Part
    staging: Path
    command: tuple[str, ...]
    options: tuple[str, ...]
    limits: ProcessLimits

    def arguments(self, source: str) -> Sequence[str]:
        """The whole command line. The output is relative to the folder that it runs in, so that reports don't depend on where that is."""
        return [*self.command, source, "-o", f"{PARTS}/{self.part.name}", *self.options]


def run_jobs(jobs: Iterator[PartJob], at_once: int | None, address: str | None) -> Generator[tuple[PartJob, Ended], None, None]:
    """Run jobs, `at_once` at a time (None: one here, all CPUs of a cluster), and yield each when it has ended.

    What runs is ended when the iteration is left. Raises ConfigError where no cluster answers at `address`.
    """
    if not address:
        yield from run_local(jobs, at_once or 1)
        return
    with connect(address) as ray:
        yield from run_cluster(jobs, at_once, ray)


def run_local(jobs: Iterable[PartJob], at_once: int) -> Generator[tuple[PartJob, Ended], None, None]:
    """As `run_jobs`, on this machine; one loop watches all processes."""
    waiting, running = iter(jobs), dict[Process, PartJob]()
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


@contextmanager
def connect(address: str) -> Iterator[Any]:
    """The ray module, connected to the cluster at `address`. Raises ConfigError without the package or the cluster."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray  # pyright: ignore[reportMissingImports]  # an extra
    except ImportError as error:
        raise ConfigError(f"--address needs Ray: {install_command('cluster')}") from error
    try:
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise ConfigError(f"--address {address}: no cluster answers: {next(iter(str(error).splitlines()), '')}") from error
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # Ray had put its own in place
    try:
        yield ray
    finally:
        ray.shutdown()


def run_cluster(jobs: Iterable[PartJob], at_once: int | None, ray: Any) -> Iterator[tuple[PartJob, Ended]]:
    """As `run_local`, on all CPUs of the cluster, or `at_once` of them."""
    task = ray.remote(num_cpus=1, max_retries=RETRIES)(run_shipped)
    waiting, running = iter(jobs), dict[Any, PartJob]()
    try:
        while True:
            room = (at_once or AHEAD * max(int(ray.cluster_resources().get("CPU", 1)), 1)) - len(running)
            for job in islice(waiting, max(room, 0)):
                running[task.remote(_relative(job), job.part.source.read_bytes())] = job
            if not running:
                return
            done, _ = ray.wait(list(running), timeout=1.0)
            for reference in done:
                job = running.pop(reference)
                yield job, _received(ray, reference, job)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)


def run_shipped(job: PartJob, content: bytes) -> tuple[Ended, Files]:
    """On the cluster: run a job on `content` in a folder of its own; what it wrote, by path relative to that."""
    with tempfile.TemporaryDirectory(prefix="imdim-") as name:
        folder = Path(name)
        source = f"./{job.part.source.name}"
        (folder / source).write_bytes(content)
        (folder / PARTS).mkdir()
        ended = run(job.arguments(source), job.limits, folder / LOG, folder)
        made = [folder / LOG, *(folder / PARTS / job.part.name).glob("*")]
        return ended, {str(path.relative_to(folder)): path.read_bytes() for path in made if path.is_file()}


def _relative(job: PartJob) -> PartJob:
    """Without the paths of this machine."""
    return replace(job, staging=Path(), part=replace(job.part, source=Path(job.part.source.name)))


def _received(ray: Any, reference: Any, job: PartJob) -> Ended:
    try:
        ended, files = ray.get(reference)
    except ray.exceptions.RayError as error:
        lines = str(error).strip().splitlines()
        return Ended(1, 0.0, 0.0, f"the cluster did not finish it: {lines[-1] if lines else type(error).__name__}")
    for name, content in files.items():
        path = job.staging / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return ended
