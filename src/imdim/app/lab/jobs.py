"""Work in background processes: one task per client at a time, few at once, the others in a queue; paused, stepped, killed from here.

A process is started before it is needed, so that a run begins at once. It is stopped by a signal, and its clock leaves out the time in
which it was stopped. Whatever becomes of it, the server goes on.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from imdim.app.lab import protocol
from imdim.app.lab.protocol import Message

LARGEST_ANSWER = 1 << 30  # bytes
ENDS_WITHIN_S = 2.0
SPARE_AFTER_S = 5.0  # the start of a run has the cores for itself
WELL = ("done", "refused")  # the process is as it was before
END_KINDS = (*WELL, "failed", "died")
GiB = 1 << 30


@dataclass(frozen=True)
class PoolLimits:
    """`running` tasks at once, `waiting` ones at most, `memory` bytes for each process."""

    running: int = 2
    waiting: int = 8
    memory: int = 6 * GiB


class Worker:
    """One process and the pipe to it."""

    def __init__(self, memory: int) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, far = context.Pipe()
        self.paused_s: Any = context.Value("d", 0.0)
        from imdim.app.lab.worker import main

        self.process: BaseProcess = context.Process(target=main, args=(far, self.paused_s, memory), name="imdim-lab-worker")
        self.process.start()
        far.close()

    @property
    def alive(self) -> bool:
        return self.process.is_alive()

    def signal(self, number: signal.Signals) -> None:
        """To the process and what it started."""
        pid = self.process.pid
        if pid is None or not self.process.is_alive():
            return
        try:
            os.killpg(pid, number)
        except ProcessLookupError:  # it is only starting, and has no group of its own yet
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)

    def kill(self) -> None:
        """End it, and reap it."""
        self.signal(signal.SIGKILL)
        self.process.join(5.0)
        self.pipe.close()


@dataclass(eq=False)
class Job:
    """A task of one client. `tell` is called with each answer, from a thread of the job; the last one's kind is in END_KINDS."""

    request: Message
    tell: Callable[[Message], None]
    state: str = "waiting"  # running, paused, ended
    stepping: bool = False
    worker: Worker | None = None
    _lock: threading.RLock = field(default_factory=threading.RLock)
    _stopped_at: float = 0.0

    def pause(self) -> None:
        """Stop it where it is; its time stands still."""
        with self._lock:
            if self.state == "running" and self.worker:
                self.worker.signal(signal.SIGSTOP)
                self.state, self._stopped_at = "paused", time.perf_counter()

    def resume(self) -> None:
        with self._lock:
            if self.state == "paused" and self.worker:
                self.worker.paused_s.value += time.perf_counter() - self._stopped_at
                self.state = "running"
                self.worker.signal(signal.SIGCONT)

    def step(self) -> None:
        """Go on to the next snapshot, and pause there."""
        with self._lock:
            self.stepping = True
            self.resume()

    def receive(self, message: Message) -> None:
        with self._lock:
            if self.stepping and message.kind == "snapshot":
                self.stepping = False
                self.pause()
        self.tell(message)


class WorkerPool:
    """The processes of a server."""

    def __init__(self, limits: PoolLimits | None = None) -> None:
        self.limits = limits or PoolLimits()
        self._lock = threading.RLock()
        self._waiting: deque[Job] = deque()
        self._running: list[Job] = []
        self._spare: Worker | None = None
        self._closed = False

    def prepare(self) -> None:
        """Have a process ready for the next task."""
        with self._lock:
            if self._spare is None and not self._closed:
                self._spare = Worker(self.limits.memory)

    def submit(self, request: Message, tell: Callable[[Message], None]) -> Job:
        """Queue a task; raises RuntimeError where too many wait already."""
        job = Job(request, tell)
        with self._lock:
            if len(self._waiting) >= self.limits.waiting:
                raise RuntimeError(f"{len(self._waiting)} runs are waiting already, try again later")
            self._waiting.append(job)
        self._dispatch()
        return job

    def place(self, job: Job) -> int:
        """How many tasks are before a waiting one."""
        with self._lock:
            return self._waiting.index(job) if job in self._waiting else 0

    def stop(self, job: Job) -> None:
        """End a task, whatever it is doing; nothing more is told."""
        with self._lock:
            job.tell = lambda _: None
            if job in self._waiting:
                self._waiting.remove(job)
                job.state = "ended"
            worker = job.worker
        if worker is not None:  # its thread sees the pipe close, and reaps it
            worker.signal(signal.SIGKILL)

    def close(self) -> None:
        """End everything."""
        with self._lock:
            self._closed = True
            jobs, spare = [*self._running, *self._waiting], self._spare
        for job in jobs:
            self.stop(job)
        if spare is not None:
            spare.kill()

    def _dispatch(self) -> None:
        with self._lock:
            while self._waiting and len(self._running) < self.limits.running and not self._closed:
                job = self._waiting.popleft()
                if self._spare is None or not self._spare.alive:
                    self._spare = Worker(self.limits.memory)
                job.worker, self._spare, job.state = self._spare, None, "running"
                self._running.append(job)
                threading.Thread(target=self._serve, args=(job, job.worker), daemon=True).start()
                self._later = threading.Timer(SPARE_AFTER_S, self.prepare)
                self._later.daemon = True
                self._later.start()

    def _serve(self, job: Job, worker: Worker) -> None:
        last = Message("")
        try:
            for last in _answers(worker, job.request):
                if last.kind not in END_KINDS:
                    job.receive(last)
        finally:
            end = last if last.kind in END_KINDS else Message("died", {"message": describe_death(worker.process)})
            self._release(job, worker, reusable=last.kind in WELL and worker.alive)
            job.tell(end)
            self._dispatch()
            self.prepare()

    def _release(self, job: Job, worker: Worker, reusable: bool) -> None:
        """A process that did its work well waits for the next task."""
        with self._lock:
            job.state, job.worker = "ended", None
            self._running.remove(job)
            keep = reusable and self._spare is None and not self._closed
            if keep:
                self._spare = worker
        if not keep:
            worker.kill()


def _answers(worker: Worker, request: Message):
    """What the process says, until its last word or its end."""
    pipe: Connection = worker.pipe
    with contextlib.suppress(EOFError, OSError):
        pipe.send_bytes(protocol.pack_message(request))
        while True:
            message = protocol.unpack_message(pipe.recv_bytes(LARGEST_ANSWER))
            if message.kind != "ready":
                yield message
            if message.kind in END_KINDS:
                return


def describe_death(process: BaseProcess) -> str:
    """How a process ended that gave no last word, in words."""
    code = _status(process)
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        hint = ", perhaps for want of memory" if name == "SIGKILL" else ""
        return f"the run was ended by {name}{hint}; the lab goes on"
    return f"the run ended unexpectedly (status {code}); the lab goes on"


def _status(process: BaseProcess) -> int | None:
    """The exit status. Another thread may have collected it from the system and not noted it yet: until then it reads as None."""
    end = time.perf_counter() + ENDS_WITHIN_S
    process.join(ENDS_WITHIN_S)
    while process.exitcode is None and time.perf_counter() < end:
        time.sleep(0.01)
    return process.exitcode
