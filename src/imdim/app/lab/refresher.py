"""Drawing in a thread of its own: what changes while it draws is drawn together the next time, so that it never falls behind."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import traceback
from collections.abc import Callable, Set


class Refresher:
    """Calls `draw` with the topics that `poke` named since the last time, `rest()` seconds after the first of them.

    Its thread gives way to others by `nice`, where the system knows that of threads.
    """

    def __init__(self, draw: Callable[[Set[str]], None], name: str, rest: Callable[[], float] = lambda: 0.0, nice: int = 0) -> None:
        self._draw, self._topics, self._ready = draw, set[str](), threading.Condition()
        self._rest, self._nice = rest, nice
        self._closed = False
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def poke(self, *topics: str) -> None:
        """Never blocks for long."""
        with self._ready:
            self._topics.update(topics)
            self._ready.notify()

    def close(self) -> None:
        with self._ready:
            self._closed = True
            self._ready.notify()

    def _run(self) -> None:
        if self._nice and sys.platform == "linux":
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), self._nice)
        while True:
            with self._ready:
                self._ready.wait_for(lambda: self._topics or self._closed)
                self._ready.wait_for(lambda: self._closed, self._rest())
                if self._closed:
                    return
                topics, self._topics = self._topics, set()
            try:
                self._draw(frozenset(topics))
            except Exception:  # noqa: BLE001 - one picture that fails must not freeze the page; it is told, and the next one is drawn
                sys.stderr.write(f"imdim lab: {traceback.format_exc()}")
