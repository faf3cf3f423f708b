"""A copy of this process that computes beside it, on another core, what it will ask for: what is the same wherever it is computed."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import chain, islice
from types import TracebackType
from typing import IO, Generic, TypeVar

S = TypeVar("S")
T = TypeVar("T")

MOST_SHARED = 256  # items that two processes take by turns: each is named by a byte
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
    in the copy alone. A copy that ends before its time is replaced by this process. What both have, being `known`, is not sent: what
    is yielded comes with this process's own.
    """

    def __init__(self, generate: Callable[[bool], Iterator[T]], known: Sequence[object] = ()) -> None:
        self._generate, self._known, self._pid = generate, known, 0
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
            _send(self._generate, theirs, self._known)
        os.close(theirs)
        self._stream = os.fdopen(ours, "rb")

    def _receive(self) -> Iterator[T]:
        received = 0
        while self._stream is not None:
            try:
                item = _KnownUnpickler(self._stream, self._known).load()
            except (EOFError, pickle.UnpicklingError):
                break
            if item is None:
                return
            received += 1
            yield item[0]
        yield from islice(self._generate(False), received, None)


def map_beside(compute: Callable[[S], T], items: Sequence[S], known: Sequence[object] = ()) -> list[T]:
    """What `compute` gives for each of the `items`, in their order. Where there can be a copy of this process, both take the next item each
    time that they have done one; what is `known` is as in a `SideProcess`.

    `compute` has to give the same in a copy, and what can be pickled. To make the copy takes some hundredths of a second.
    """
    if not 1 < len(items) <= MOST_SHARED or not can_fork():
        return [compute(item) for item in items]
    ours, theirs = os.pipe()
    os.write(theirs, bytes(range(len(items))))
    os.close(theirs)
    with os.fdopen(ours, "rb", buffering=0) as numbers:

        def take(_: bool) -> Iterator[dict[int, T]]:
            # all at once: a pipe that is full would hold up the copy
            yield {number[0]: compute(items[number[0]]) for number in iter(lambda: numbers.read(1), b"")}

        found: dict[int, T] = {}
        with SideProcess(take, known) as beside:
            for some in chain(take(False), beside):
                found |= some
    # a copy that ended too soon may have taken one with it
    return [found[i] if i in found else compute(item) for i, item in enumerate(items)]


class _KnownPickler(pickle.Pickler):
    """Writes what the reader knows as its number."""

    def __init__(self, stream: IO[bytes], known: Sequence[object]) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self._number = {id(item): i for i, item in enumerate(known)}

    def persistent_id(self, obj: object) -> int | None:
        return self._number.get(id(obj))


class _KnownUnpickler(pickle.Unpickler):
    """Reads what a `_KnownPickler` has written that knows the same."""

    def __init__(self, stream: IO[bytes], known: Sequence[object]) -> None:
        super().__init__(stream)
        self._known = known

    def persistent_load(self, pid: int) -> object:
        return self._known[pid]


def _send(generate: Callable[[bool], Iterator[object]], to: int, known: Sequence[object]) -> None:
    """Write what is generated, and then None, as pickles; ends the process."""
    try:
        end_with_parent()
        _ALONE.set(True)  # the other core is the parent's
        with os.fdopen(to, "wb") as stream:
            for item in generate(True):
                _KnownPickler(stream, known).dump((item,))
                stream.flush()
            _KnownPickler(stream, ()).dump(None)
    finally:
        os._exit(0)  # on a signal and an error too: nothing of the parent's is closed or told here, and who waits does what is missing
