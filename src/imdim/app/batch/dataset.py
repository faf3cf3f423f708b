"""A data set as a batch: shares of its chunks are jobs, a process each, here or on a cluster.

A share is worked on under ``.running``, and its samples move to their places when it has ended well. So a killed run loses what was
running, a share that crashes, hangs or takes the memory is missing, noted in ``failures.csv`` and tried again by the same command.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields
from itertools import groupby
from pathlib import Path

from imdim.app.arguments import from_arguments
from imdim.app.batch import folder
from imdim.app.batch.engine import PartJob, run_jobs
from imdim.app.batch.folder import PARTS, Part
from imdim.app.batch.process import Ended, ProcessLimits
from imdim.app.batch.table import csv_text
from imdim.data.folder import CHUNK, Chunk, FolderConfig, chunks, claim, is_there
from imdim.reconstruction.config import ConfigError
from imdim.whole_file import write_text_whole

COMMAND = (sys.executable, "-m", "imdim.app.batch.share")
FAILURES = "failures.csv"
BAD_INPUT, SOME_FAILED, INTERRUPTED = 2, 1, 130


@dataclass
class DatasetConfig(FolderConfig):
    """How the folder is made, which changes no byte of it."""

    jobs: int = 0  # shares at a time; 0: one here, as many as it has CPUs on a cluster
    address: str = ""  # of a Ray cluster, instead of this machine
    share: int = 1024  # samples of one share, at most, in whole chunks
    limit_s: float = 600.0  # wall clock of a share before it is ended
    memory_mib: float = 4096.0  # and its memory


@dataclass(frozen=True)
class _Share:
    """Chunks of one split."""

    chunks: tuple[Chunk, ...]

    @property
    def name(self) -> str:
        return f"{self.chunks[0].split}-{self.chunks[0].index:05d}"

    @property
    def files(self) -> list[str]:
        return [name for chunk in self.chunks for name in chunk.names]


def main(arguments: Sequence[str], command: Sequence[str] = COMMAND) -> int:
    """Make or continue a data set; the exit status. `command` is what draws one share."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        config = from_arguments(DatasetConfig, arguments)
        if config.jobs < 0 or min(config.share, config.limit_s, config.memory_mib) <= 0:
            raise ConfigError("settings share, limit_s and memory_mib need positive numbers, jobs none below 0")
        return _run(config, tuple(command))
    except (ConfigError, ValueError, OSError) as error:
        sys.stderr.write(f"make_dataset: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("make_dataset: stopped; the same command continues\n")
        return INTERRUPTED


def _run(config: DatasetConfig, command: tuple[str, ...]) -> int:
    out, total, start = Path(config.out).absolute(), config.n_train + config.n_val, time.monotonic()
    with folder.hold_folder(out):
        claim(config)
        missing = [chunk for chunk in chunks(config) if not is_there(chunk, out)]
        shares = {share.name: share for share in _shares(missing, config)}
        jobs = (_job(share, out, config, command) for share in shares.values())
        with closing(run_jobs(jobs, config.jobs or None, config.address or None)) as ended:
            failures = _record(out, shares, total, ended)
    there = total - sum(len(shares[name].files) for name in failures)
    sys.stdout.write(f"{there} of {total} samples are there, {time.monotonic() - start:.1f} s\n")
    return SOME_FAILED if failures else 0


def _record(out: Path, shares: Mapping[str, _Share], total: int, ended: Iterator[tuple[PartJob, Ended]]) -> dict[str, str]:
    """Put the samples of each share that ends in their places, with a line; what failed, and why."""
    done, failures = total - sum(len(share.files) for share in shares.values()), dict[str, str]()
    (out / FAILURES).unlink(missing_ok=True)
    for job, how in ended:
        share = shares[job.part.name]
        why = _keep(share, job, how, out)
        if why:
            failures[share.name] = why
            files = ((name, shares[name].files) for name in failures)
            rows = ((name, some[0], some[-1], len(some), failures[name]) for name, some in files)
            write_text_whole(out / FAILURES, csv_text(("share", "first", "last", "samples", "failure"), rows))
            sys.stderr.write(f"make_dataset: {share.name}: FAILED, {why}\n")
            continue
        done += len(share.files)
        sys.stdout.write(f"{done}/{total} samples, {len(share.files) / how.seconds:.0f} per second and job\n")
        sys.stdout.flush()
    return failures


def _shares(missing: Sequence[Chunk], config: DatasetConfig) -> Iterator[_Share]:
    """Runs of chunks of one split, as many shares as there are jobs at least."""
    size = max(1, min(config.share // CHUNK, -(-len(missing) // max(config.jobs, 1))))
    for _, group in groupby(missing, key=lambda chunk: chunk.split):
        some = tuple(group)
        yield from (_Share(some[i : i + size]) for i in range(0, len(some), size))


def _job(share: _Share, out: Path, config: DatasetConfig, command: tuple[str, ...]) -> PartJob:
    staging = folder.staging(out, Part(share.name, Path(), ""))
    source = staging / "share.json"
    settings = {f.name: asdict(config)[f.name] for f in fields(FolderConfig)}
    source.write_text(json.dumps({"config": settings, "chunks": [(c.split, c.index, c.names) for c in share.chunks]}), encoding="utf-8")
    return PartJob(Part(share.name, source, ""), staging, command, (), ProcessLimits(config.limit_s, config.memory_mib))


def _keep(share: _Share, job: PartJob, how: Ended, out: Path) -> str:
    """Put the samples of a share in their places, or say why there are none."""
    made = job.staging / PARTS / share.name
    missing = [] if how.why else [name for name in share.files if not (made / name).is_file()]
    if how.why or missing:
        return how.why or f"{len(missing)} of {len(share.files)} samples are missing"
    for name in share.files:
        (made / name).replace(out / share.chunks[0].split / name)
    return ""
