"""``python limited.py PARENT DATA_MIB COMMAND...``: become a command that cannot outlive its parent nor take the machine's memory (0: any).

A file of its own that imports nothing of the project: it costs a bare start of Python.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys

PR_SET_PDEATHSIG = 1  # <linux/prctl.h>
FIRST_VICTIM = "500"  # of the kernel, where the whole machine runs out of memory; 0 is usual, 1000 the most


def main(parent: str, data_mib: str, *command: str) -> None:
    """Set the limits of this process and turn it into `command`; exit status 127 where there is none."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        if int(data_mib) > 0:
            resource.setrlimit(resource.RLIMIT_DATA, (int(data_mib) << 20, resource.getrlimit(resource.RLIMIT_DATA)[1]))
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
            file.write(FIRST_VICTIM)
    if os.getppid() != int(parent):
        sys.exit("the parent has ended")
    try:
        os.execvp(command[0], command)
    except OSError as error:
        sys.stderr.write(f"{command[0]}: {error.strerror}\n")
        sys.exit(127)


if __name__ == "__main__":
    main(*sys.argv[1:])
