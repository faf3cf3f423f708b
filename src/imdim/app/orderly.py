"""Commands that end in order: on a signal, on a closed pipe, and for want of memory.

What they have opened is closed, nobody who stopped listening loses results, and too little memory is one line: where addresses are
limited the command runs in a process of its own, since libraries that get no memory may end theirs. Only the standard library is imported,
so that help answers at once.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

try:
    import resource
except ImportError:  # where there are no such limits
    resource = None

LEAST_SPACE = 1_300_000_000  # bytes of addresses: libraries, compiled kernels and a small part; with less the compiler of kernels crashes
CANNOT, INTERRUPTED = 2, 130
OUT_OF_MEMORY = "imdim: out of memory: raise the limit, or give a smaller part\n"
CRASHES = tuple(getattr(signal, name) for name in ("SIGSEGV", "SIGABRT", "SIGBUS") if hasattr(signal, name))  # of libraries without memory
SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class EndSignal(SystemExit):
    """A signal asked the process to end; the exit status is that of a shell, 128 and its number."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.signal = signal.Signals(number).name


def run_in_order(command: Callable[[], int]) -> int:
    """The exit status of `command`; 2 where memory does not suffice, 128 and the signal's number where a signal ended it."""
    with _lasting_streams(), _closing_on_signals():
        if too_little := _tell_small_space():
            sys.stderr.write(f"imdim: {too_little}\n")
            return CANNOT
        alone = _space() is not None and threading.current_thread() is threading.main_thread()
        return _run_apart(command) if alone else _run(command)


def _run(command: Callable[[], int]) -> int:
    try:
        return command()
    except MemoryError:
        sys.stderr.write(OUT_OF_MEMORY)
        return CANNOT
    except KeyboardInterrupt:
        sys.stderr.write("imdim: interrupted\n")
        return INTERRUPTED
    except EndSignal as ended:
        sys.stderr.write(f"imdim: ended by {ended.signal}\n")
        return int(ended.code or 0)


def _run_apart(command: Callable[[], int]) -> int:
    """As `_run`, in a process that ends with this one; where that crashes, memory was short."""
    child = os.fork()
    if child == 0:
        from imdim.side_process import end_with_parent  # takes milliseconds, which help need not wait for

        end_with_parent()
        status = 1
        try:
            status = _run(command)
        except SystemExit as ended:  # help, and arguments that cannot be
            status = ended.code if isinstance(ended.code, int) else int(bool(ended.code))
        except Exception:  # noqa: BLE001 - the outermost call: what Python would do with it is done here
            sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    with _passing_on_signals(child):
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status < 0 and -status in CRASHES:
        sys.stderr.write(OUT_OF_MEMORY)
        return CANNOT
    return status if status >= 0 else 128 - status


@contextmanager
def _passing_on_signals(child: int) -> Iterator[None]:
    """What asks this process to end asks the child; Ctrl-C reaches both by itself."""
    passed = {number: lambda given, _: os.kill(child, given) for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN}
    before = {number: signal.signal(number, how) for number, how in {**passed, signal.SIGINT: signal.SIG_IGN}.items()}
    try:
        yield
    finally:
        for number, how in before.items():
            signal.signal(number, how)


def _space() -> int | None:
    """Bytes of addresses that the process may have; None where that is not limited."""
    space = resource.getrlimit(resource.RLIMIT_AS)[0] if resource else -1
    return None if space in (-1, getattr(resource, "RLIM_INFINITY", -1)) else space


def _tell_small_space() -> str | None:
    """What is to be said where the process may not have as many addresses as it needs to begin."""
    space = _space()
    if space is None or space >= LEAST_SPACE:
        return None
    return f"the limit of memory (ulimit -v) is {space / 1e9:.2f} GB, at least {LEAST_SPACE / 1e9:.1f} GB are needed"


@contextmanager
def _closing_on_signals() -> Iterator[None]:
    """Signals that ask the process to end raise EndSignal inside, once, unless somebody handles or ignores them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _: FrameType | None) -> None:
        for each in ours:
            signal.signal(each, signal.SIG_IGN)  # what is being closed is closed
        raise EndSignal(number)

    ours = [number for number in SIGNALS if signal.getsignal(number) is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def finishing_first(say: str) -> Iterator[None]:
    """The block is gone through although Ctrl-C or a signal comes, which `say` tells. A second one counts at once. After the block a signal
    does what it asked for, and one Ctrl-C has nothing left to stop."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *SIGNALS)}
    heard = {number: act for number, act in before.items() if callable(act)}
    if threading.current_thread() is not threading.main_thread() or not heard:
        yield
        return
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        if len(came) > 1:
            heard[number](number, frame)
        sys.stderr.write(f"imdim: {say}\n")

    for number in heard:
        signal.signal(number, note)
    try:
        yield
    finally:
        for number, act in heard.items():
            signal.signal(number, act)
    for number in came[:1]:
        if number != signal.SIGINT:
            heard[number](number, None)


@contextmanager
def _lasting_streams() -> Iterator[None]:
    """Standard output and error that may be closed, full, or read by nobody: what is written to them is lost then, and nothing else."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = lasting = _Lasting(before[0]), _Lasting(before[1])
    try:
        yield
    finally:
        for stream in lasting:
            stream.flush()
        sys.stdout, sys.stderr = before


class _Lasting:
    """A text stream in front of another, whose failures end the other and not the program."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream or _nowhere()

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except UnicodeEncodeError:  # a file's name may be bytes that are no text
            return self._stream.write(text.encode("ascii", "backslashreplace").decode())
        except OSError:
            self._give_up()
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError:
            self._give_up()

    def _give_up(self) -> None:
        """What the stream still holds goes nowhere too, when it is flushed at the end."""
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
        self._stream = _nowhere()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _nowhere() -> Any:
    return open(os.devnull, "w")
