"""One command in a process of its own, with a limit of time and one of memory: how it ended, whatever it did."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from imdim.app.fit import NOT_THE_PART
from imdim.side_process import CORES

LIMITED = str(Path(__file__).with_name("limited.py"))
LOOK_S = 0.02
SLACK_MIB = 1024  # what an allocator maps without touching it, beyond what resides
TAIL_BYTES = 4096
TIME, MEMORY = "time", "memory"


@dataclass(frozen=True)
class ProcessLimits:
    """Wall clock in seconds, resident memory in MiB and cores, of a process and its children together; who sets OMP_NUM_THREADS says
    himself how many cores there are for each."""

    seconds: float
    mib: float = math.inf
    cores: int = 1


@dataclass(frozen=True)
class Ended:
    """`status` is the exit status (negative: the signal), `why` says in one line what went wrong, empty where nothing did.

    `seconds` is the wall clock, `peak_mib` the most resident memory of the process and its children, looked at every 20 ms.
    """

    status: int
    seconds: float
    peak_mib: float
    why: str = ""


class Process:
    """A running command. It leads a process group, which ends with it; it ends when the thread that started it does (Linux)."""

    def __init__(self, command: Sequence[str], limits: ProcessLimits, log: Path, cwd: Path | None = None) -> None:
        """Start `command` in `cwd` with its output in `log`. Raises OSError where the log cannot be written or no process started."""
        self._limits, self._log = limits, log
        self._start, self._peak, self._over = time.monotonic(), 0.0, ""
        # on macOS, without /proc, memory is not limited
        data = 0 if limits.mib == math.inf else int(limits.mib) + SLACK_MIB
        threads = {CORES: str(limits.cores), "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        with log.open("wb") as out:
            self._child = subprocess.Popen(
                [sys.executable, "-I", "-S", LIMITED, str(os.getpid()), str(data), *command],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=out,
                cwd=cwd,
                env={**threads, **os.environ},
                start_new_session=True,
            )

    def look(self) -> Ended | None:
        """How it ended, None while it runs; ends it where it is over a limit."""
        status = self._child.poll()
        if status is None:
            self._hold()
            return None
        seconds = time.monotonic() - self._start
        self.stop()
        return Ended(status, seconds, self._peak, self._why(status))

    def stop(self) -> None:
        """End the whole group, and wait for it."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._child.pid, signal.SIGKILL)
        self._child.wait()

    def _hold(self) -> None:
        self._peak = max(self._peak, resident_mib(self._child.pid))
        if self._peak > self._limits.mib:
            self._over = MEMORY
        elif time.monotonic() - self._start > self._limits.seconds:
            self._over = TIME
        if self._over:
            self._child.kill()

    def _why(self, status: int) -> str:
        if self._over == TIME:
            return f"took more than {self._limits.seconds:g} s and was ended"
        if self._over == MEMORY:
            return f"took more than {self._limits.mib:g} MiB of memory and was ended"
        if status < 0:
            return f"ended by signal {_signal_name(-status)}"
        return "" if status in (0, NOT_THE_PART) else last_line(self._log) or f"ended with exit status {status}"


def run(command: Sequence[str], limits: ProcessLimits, log: Path, cwd: Path | None = None) -> Ended:
    """Run a command to its end or to a limit."""
    process = Process(command, limits, log, cwd)
    try:
        while (ended := process.look()) is None:
            time.sleep(LOOK_S)
        return ended
    finally:
        process.stop()


def resident_mib(pid: int) -> float:
    """Resident memory of a process and its descendants; what has just ended counts 0."""
    root = Path(f"/proc/{pid}")
    try:
        pages = int((root / "statm").read_text().split()[1])
        children = [child for task in root.glob("task/*/children") for child in task.read_text().split()]
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20 + sum(resident_mib(int(child)) for child in children)


def last_line(log: Path) -> str:
    """The last line that is not blank, without what a terminal would not show."""
    with log.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - TAIL_BYTES, 0))
        lines = file.read().decode("utf-8", "backslashreplace").strip().splitlines()
    return "".join(c for c in lines[-1] if c.isprintable()) if lines else ""


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)
