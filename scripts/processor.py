"""What a process has had of the processor (Linux), and that as its clock."""

from __future__ import annotations

import os
import time
from pathlib import Path


def processor_s(pid: int) -> float:
    """Seconds of the processor that a process has had; those of one that has ended are 0."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except FileNotFoundError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rule_the_clock() -> None:
    """Let budgets and stages in this process count what it has of the processor, so that a busy machine changes nothing.

    To be called before anything of `imdim` is imported: a default argument keeps the clock that it found.
    """
    time.perf_counter = time.process_time
