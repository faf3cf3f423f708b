"""What a process has had of the processor (Linux), and that as its clock.

python scripts/bench/processor.py fit part.stl -o out     # any command of `imdim`, whose budget is in seconds of the processor
"""

from __future__ import annotations

import os
import resource
import sys
import time
from contextlib import suppress
from pathlib import Path

LOOK_S = 0.05  # between two looks at what other processes have had
CLOCKS = "wall", "processor"  # what a benchmark's budget and seconds may be told by


def processor_s(pid: int) -> float:
    """Seconds of the processor that a process has had; those of one that has ended are 0."""
    try:
        fields = _fields(pid)
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _fields(pid: int | str) -> list[str]:
    """What the system tells of a process after its name: proc(5), from field 3."""
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()


def children_s() -> float:
    """Seconds of the processor that all processes have had that this one started and that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


class _Clock:
    """What this process and those that it started have had of the processor, as a clock; the others are asked every LOOK_S of the wall."""

    def __init__(self) -> None:
        self._wall, self._looked, self._others = time.perf_counter, -LOOK_S, 0.0

    def __call__(self) -> float:
        if self._wall() - self._looked >= LOOK_S:
            # one that has just ended may be counted in neither for a moment, and a clock never goes back
            self._others, self._looked = max(self._others, children_s() + sum(map(processor_s, _children()))), self._wall()
        return time.process_time() + self._others


def _children() -> set[int]:
    """The processes that this one has started and that run."""
    found: set[int] = set()
    for path in Path("/proc/self/task").glob("*/children"):
        with suppress(FileNotFoundError, ProcessLookupError):  # a thread that has just ended
            found |= set(map(int, path.read_text().split()))
    return found


def rule_the_clock() -> None:
    """Let budgets and stages in this process count what it and its children have of the processor, so that a busy machine changes nothing;
    on one core, since threads of exact booleans that wait for each other on two count as if they worked.

    To be called before anything of `imdim` is imported: a default argument keeps the clock that it found.
    """
    time.perf_counter = _Clock()
    os.environ["OMP_NUM_THREADS"] = "1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(_fields("self")[36])})  # where the system has put it, which is not where it has put others


if __name__ == "__main__":
    rule_the_clock()
    from imdim.app.cli import main

    sys.exit(main(sys.argv[1:]))
