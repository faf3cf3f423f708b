"""The process that works: it waits for requests, performs one after the other, and dies with the server."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

from imdim.app.lab import protocol

IDLE_S = 3.0  # after which the kernels of the rarer tasks are made ready too
BEHIND_THE_PAGE = 5  # niceness: where cores are few, what a run found is drawn before it searches on


def main(pipe: Connection, paused: Any, most_bytes: int) -> None:
    """Serve requests from `pipe`. `paused` holds the seconds that this process was stopped, which its clock leaves out.

    Memory beyond `most_bytes` is refused where the system can do that, so that a run fails alone.
    """
    os.setsid()  # what it starts is stopped and killed with it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(BEHIND_THE_PAGE)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))
    threading.Thread(target=_die_with_parent, daemon=True).start()
    from imdim.app.lab import work

    def now() -> float:
        """The time; a run counts none in which it was paused."""
        return time.perf_counter() - paused.value

    work.warm()
    pipe.send_bytes(protocol.pack_message(protocol.Message("ready")))
    with contextlib.suppress(EOFError, BrokenPipeError):
        if not pipe.poll(IDLE_S):
            work.warm_rest()
        while True:
            for answer in work.perform(protocol.unpack_message(pipe.recv_bytes()), now):
                pipe.send_bytes(protocol.pack_message(answer))


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.killpg(0, signal.SIGKILL)
