"""What runs jobs: processes of this machine, or a Ray cluster. Every batch goes through this one door."""

from __future__ import annotations

from collections.abc import Generator, Iterator

from imdim.app.batch.local import Job, run_local
from imdim.app.batch.process import Ended


def run_jobs(jobs: Iterator[Job], at_once: int | None, address: str | None) -> Generator[tuple[Job, Ended], None, None]:
    """Run jobs, `at_once` at a time (None: one here, all CPUs of a cluster), and yield each when it has ended.

    What runs is ended when the iteration is left. Raises ConfigError where no cluster answers at `address`.
    """
    if not address:
        yield from run_local(jobs, at_once or 1)
        return
    from imdim.app.batch.cluster import connected, run_cluster

    with connected(address) as ray:
        yield from run_cluster(jobs, at_once, ray)
