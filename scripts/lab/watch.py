"""What processes use: seconds by the clock and of a core, and memory. Reads Linux's /proc."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from pathlib import Path
from typing import NamedTuple


class Took(NamedTuple):
    """Seconds by the clock, and of a core."""

    clock: float
    core: float


class Watch:
    """Takes the time from when it is made, of this process and of all that it started."""

    def __init__(self) -> None:
        self._clock, self._core = time.perf_counter(), core_seconds(os.getpid())

    def __call__(self) -> Took:
        return Took(time.perf_counter() - self._clock, core_seconds(os.getpid()) - self._core)


def core_seconds(pid: int) -> float:
    """Of a core, that a process and all that it started have used."""
    tables = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            tables[int(stat.parent.name)] = int(fields[1]), sum(map(int, fields[11:15]))
    mine = {pid}
    while grown := {p for p, (parent, _) in tables.items() if parent in mine} - mine:
        mine |= grown
    return sum(tables[p][1] for p in mine if p in tables) / os.sysconf("SC_CLK_TCK")


def settle(pid: int) -> None:
    """Until a process and all that it started rest."""
    before = -1.0
    while (now := core_seconds(pid)) - before > 0.1:
        before = now
        time.sleep(2.0)


def memory(pid: int) -> float:
    """Resident memory of a process, in MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory_of_workers(server: int) -> float:
    """Of the largest process that works for a lab's server, in MB."""
    listed = subprocess.run(["ps", "-ww", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout.splitlines()
    mine = [int(line.split()[0]) for line in listed[1:] if int(line.split()[1]) == server and "spawn_main" in line]
    return max((memory(pid) for pid in mine), default=0.0)
