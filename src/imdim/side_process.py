"""A copy of this process that computes beside it, on another core, what it will ask for: what is the same wherever it is computed."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import islice
from types import TracebackType
from typing import IO, Generic, TypeVar

T = TypeVar("T")

PARENT_DEATH = 1  # PR_SET_PDEATHSIG, <linux/prctl.h>
_ALONE = ContextVar("_ALONE", default=False)
CORES = "OMP_NUM_THREADS"  # how many cores a person wants used, as numeric libraries understand it


def leave_cores_to_copies() -> None:
    """Where nobody says otherwise, numpy's matrices take one core, if this is called before it is imported: those of a fit are small, and
    threads that wait for one another take more time than they save."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def count_cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def has_second_core() -> bool:
    """Whether there is one for what this process computes, and nobody wants it left alone."""
    return count_cores() > 1 and os.environ.get(CORES) != "1" and not _ALONE.get()


def can_fork() -> bool:
    """Whether there is a core for a copy of this process, and nothing in it that a copy breaks: threads of torch's do not survive in one,
    and what another thread holds stays held."""
    is_safe = "torch" not in sys.modules and threading.current_thread() is threading.main_thread()
    return sys.platform == "linux" and is_safe and has_second_core()


@contextmanager
def without_copies() -> Iterator[None]:
    """Let this process compute all in the block by itself: a copy of one that compiles compiles the same again."""
    before = _ALONE.set(True)
    try:
        yield
    finally:
        _ALONE.reset(before)


def end_with_parent() -> None:
    """Let this process end when the thread that started it does, however that ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PARENT_DEATH, signal.SIGKILL)


class SideProcess(Generic[T]):
    """What `generate` yields, in a context that begins with computing it: by a copy of this process, which ends with the context, or, where
    there can be none, by this process as it is asked for.

    `generate` is told whether it runs apart; it has to yield the same either way, and what can be pickled. What it changes there it changes
    in the copy alone. A copy that ends before its time is replaced by this process.
    """

    def __init__(self, generate: Callable[[bool], Iterator[T]]) -> None:
        self._generate, self._pid = generate, 0
        self._stream: IO[bytes] | None = None

    def __enter__(self) -> Iterator[T]:
        if can_fork():
            self._fork()
        return self._receive()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._stream is not None:
            self._stream.close()
            with suppress(ProcessLookupError):
                os.kill(self._pid, signal.SIGKILL)
            os.waitpid(self._pid, 0)

    def _fork(self) -> None:
        ours, theirs = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which draw progress here and nothing in the copy
            try:
                self._pid = os.fork()
            except OSError:  # too many processes, or too little memory
                os.close(ours)
                os.close(theirs)
                return
        if self._pid == 0:
            _send(self._generate, theirs)
        os.close(theirs)
        self._stream = os.fdopen(ours, "rb")

    def _receive(self) -> Iterator[T]:
        received = 0
        while self._stream is not None:
            try:
                item = pickle.load(self._stream)
            except (EOFError, pickle.UnpicklingError):
                break
            if item is None:
                return
            received += 1
            yield item[0]
        yield from islice(self._generate(False), received, None)


def _send(generate: Callable[[bool], Iterator[object]], to: int) -> None:
    """Write what is generated, and then None, as pickles; ends the process."""
    try:
        end_with_parent()
        with os.fdopen(to, "wb") as stream:
            for item in generate(True):
                pickle.dump((item,), stream, pickle.HIGHEST_PROTOCOL)
                stream.flush()
            pickle.dump(None, stream)
    finally:
        os._exit(0)  # on a signal and an error too: nothing of the parent's is closed or told here, and who waits does what is missing
