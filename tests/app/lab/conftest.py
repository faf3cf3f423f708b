import asyncio
import threading

import pytest

from imdim.app.lab.jobs import END_KINDS, PoolLimits, WorkerPool


class Heard:
    """Collects what a job tells, and waits for its last word."""

    def __init__(self):
        self.messages, self._end, self._any = [], threading.Event(), threading.Event()

    def __call__(self, message):
        self.messages.append(message)
        self._any.set()
        if message.kind in END_KINDS:
            self._end.set()

    def first(self, seconds=90.0):
        assert self._any.wait(seconds), "nothing was told"
        return self.messages[0]

    def last(self, seconds=90.0):
        assert self._end.wait(seconds), f"no end among {[m.kind for m in self.messages]}"
        return self.messages[-1]


@pytest.fixture
def loop():
    """The event loop of a server, in a thread of its own."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    yield loop
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


@pytest.fixture
def heard():
    return Heard()


@pytest.fixture(scope="module")
def pool():
    pool = WorkerPool(PoolLimits(running=1, waiting=2))
    yield pool
    pool.close()
