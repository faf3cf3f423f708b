"""Break files of every kind that is read, and see that each is read or refused in one line: no traceback, no hang, no flood of memory.

    python scripts/fuzz/files.py [--cases 10000] [--seed 0] [--kinds stl program ...] [--limit 10] [--memory 2000] [--keep out/fuzz]
    python scripts/fuzz/files.py --case glb 123        one case again, in this process, with its traceback

Case i of a kind is a function of kind, i and seed. Cases run in a worker that is ended and replaced where one takes more than `--limit`
seconds or `--memory` MiB beyond what the worker had at its start. An audit hook sees files opened for writing outside of the case's
folder, and classes looked up for a pickle. Seconds are those of the processor, so that a busy machine finds nothing of its own; a case that
sleeps is ended after ten times as many of the wall clock. Exit status 1 where anything was found; the files that found it are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "bench"))  # the benches' parts and clock serve here too
from kind import Unclear
from mutations import mutated
from processor import processor_s
from programs import edit_mutated
from targets import KINDS

from imdim.app.batch.process import resident_mib

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.chmod", "os.truncate")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--limit", type=float, default=10.0, metavar="SECONDS")
    parser.add_argument("--memory", type=float, default=2000.0, metavar="MIB")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--case", nargs=2, metavar=("KIND", "I"))
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return work(args.worker, args.seed)
    if args.case:
        os.environ["IMDIM_TRACEBACK"] = "1"
        with tempfile.TemporaryDirectory() as folder:
            print(Worker.here(Path(folder), args.seed).case(args.case[0], int(args.case[1])))
        return 0
    return fuzz(args)


def fuzz(args: argparse.Namespace) -> int:
    whole = sum(KINDS[kind].share for kind in args.kinds)
    wanted = {kind: round(args.cases * KINDS[kind].share / whole) for kind in args.kinds}
    wanted[args.kinds[-1]] += args.cases - sum(wanted.values())
    start, tally, found, slowest = time.monotonic(), Counter[tuple[str, str]](), [], (0.0, "")
    worker = Supervised(args)
    try:
        for kind, count in wanted.items():
            for i in range(count):
                outcome, seconds = worker.ask(kind, i)
                slowest = max(slowest, (seconds, f"{kind} {i}"))
                word = outcome.split(":")[0]
                tally[kind, word] += 1
                if word not in ("read", "refused"):
                    found.append(f"{kind} {i}: {outcome}")
                    print(found[-1], flush=True)
                    keep(args, kind, i)
            print(f"{kind:<10} {count:>5} cases, {tally[kind, 'read']} read, {tally[kind, 'refused']} refused", flush=True)
    finally:
        worker.stop()
    print(
        f"{sum(tally.values())} cases of {len(args.kinds)} kinds in {time.monotonic() - start:.0f} s, seed {args.seed}; "
        f"{len(found)} found; "
        f"slowest {slowest[0]:.1f} s ({slowest[1]}); most memory beyond the start {worker.peak:.0f} MiB"
    )
    return 1 if found else 0


def keep(args: argparse.Namespace, kind: str, i: int) -> None:
    args.keep.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        (args.keep / f"{kind}-{i}{KINDS[kind].suffix}").write_bytes(Worker.here(Path(folder), args.seed).made(kind, i))


class Supervised:
    """A worker process, replaced where it ends or has to be ended."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args, self.peak = args, 0.0
        self._begin()

    def _begin(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
        command = [sys.executable, __file__, "--worker", str(self.folder), "--seed", str(self.args.seed)]
        self.process = subprocess.Popen(
            command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        assert self.process.stdout is not None
        if self.process.stdout.readline() != b"ready\n":
            raise SystemExit("fuzz: the worker does not start")
        self.start_mib = resident_mib(self.process.pid)

    def ask(self, kind: str, i: int) -> tuple[str, float]:
        """What a case led to, and seconds."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{kind} {i}\n".encode())
        self.process.stdout.readline()  # the case is made, which is the fuzzer's time
        start, before = time.monotonic(), processor_s(self.process.pid)
        while not select.select([self.process.stdout], [], [], 0.02)[0]:
            grown = resident_mib(self.process.pid) - self.start_mib
            self.peak = max(self.peak, grown)
            seconds, wall = processor_s(self.process.pid) - before, time.monotonic() - start
            late = seconds > self.args.limit or wall > 10 * self.args.limit
            if over := "MEMORY" if grown > self.args.memory else "HANG" if late else "":
                self.stop()
                self._begin()
                return f"{over}: {grown:.0f} MiB, {seconds:.1f} s", seconds
        line = self.process.stdout.readline()
        seconds = processor_s(self.process.pid) - before if line else 0.0
        if not line:
            status = self.process.wait()
            self.stop()
            self._begin()
            return f"CRASH: exit status {status}", seconds
        return json.loads(line), seconds

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def work(folder: Path, seed: int) -> int:
    """The worker's side: a line with kind and number in, a line when the case is made and one with the outcome out."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    worker = Worker.here(folder, seed)
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        kind, i = line.split()
        data = worker.made(kind, int(i))
        print("made", file=answers, flush=True)
        print(json.dumps(worker.tried(kind, data)), file=answers, flush=True)
    return 0


class Worker:
    """Makes and tries cases in `folder`."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.seed = folder, seed
        self.seeds: dict[str, list[bytes]] = {}
        self.seen: list[str] = []
        self.watching = False

    @staticmethod
    def here(folder: Path, seed: int) -> Worker:
        """One that watches this process. What is slow, or is written, on first use happens now."""
        from imdim.export import step_worker
        from imdim.export.step import StepError
        from imdim.reconstruction import pipeline  # noqa: F401

        def left_out(*_: object) -> None:
            raise StepError("left out of the fuzzing: two seconds each")

        step_worker.start_step = left_out
        worker = Worker(folder, seed)
        for kind in KINDS:
            for data in worker.seeds_of(kind):
                outcome = worker.tried(kind, data)
                if outcome != "read":
                    raise SystemExit(f"fuzz: a valid {kind} is not read: {outcome}")
        sys.addaudithook(worker.watch)
        return worker

    def seeds_of(self, kind: str) -> list[bytes]:
        if kind not in self.seeds:
            place = self.folder / "seeds" / kind
            place.mkdir(parents=True)
            self.seeds[kind] = KINDS[kind].seeds(place)
        return self.seeds[kind]

    def made(self, kind: str, i: int) -> bytes:
        """The bytes of a case."""
        rng = random.Random(f"{self.seed} {kind} {i}")
        data, other = (rng.choice(self.seeds_of(kind)) for _ in range(2))
        if KINDS[kind].form == "edit":
            return edit_mutated(data, rng, lambda text, form: mutated(text, text, form, rng))
        return mutated(data, other, KINDS[kind].form, rng)

    def case(self, kind: str, i: int) -> str:
        return self.tried(kind, self.made(kind, i))

    def tried(self, kind: str, data: bytes) -> str:
        """`read`, `refused`, or what went wrong."""
        place = self.folder / "case"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        path = place / f"part{KINDS[kind].suffix}"
        path.write_bytes(data)
        self.seen, self.watching = [], True
        try:
            outcome = self.outcome(kind, path)
        finally:
            self.watching = False
        return f"WRITES: {self.seen[:3]}" if self.seen else outcome

    def outcome(self, kind: str, path: Path) -> str:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return "refused" if KINDS[kind].try_one(path) else "read"
            except Unclear as error:
                return f"UNCLEAR: {error}"
            except (Exception, RecursionError, MemoryError, SystemExit) as error:  # noqa: BLE001 (any is a find)
                if os.environ.get("IMDIM_TRACEBACK"):
                    traceback.print_exc()
                at = traceback.extract_tb(error.__traceback__)[-1]
                ours = [f for f in traceback.extract_tb(error.__traceback__) if "imdim" in f.filename]
                here = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}" if ours else ""
                return f"TRACEBACK: {type(error).__name__} {str(error)[:100]!r} at {here} ({Path(at.filename).name}:{at.lineno})"

    def watch(self, event: str, arguments: tuple[Any, ...]) -> None:
        """An audit hook."""
        if not self.watching:
            return
        if event == "pickle.find_class" and not _numba_reads():
            self.seen.append(f"{event} {arguments}")
        if (event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITES) or event in CHANGES:
            path = str(arguments[0])
            within = path.startswith(str(self.folder)) or path == os.devnull or "__pycache__" in path
            if not within and not isinstance(arguments[0], int):
                self.seen.append(f"{event} {path}")


def _numba_reads() -> bool:
    """Whether the pickle is that of numba's own cache of compiled code."""
    frame = sys._getframe()
    while frame is not None and "/numba/" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


if __name__ == "__main__":
    sys.exit(main())
