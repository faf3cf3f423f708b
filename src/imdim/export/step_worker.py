"""STEP export in a process of its own: OpenCASCADE can take minutes or crash on a hard shape, and must not take the other results along.

``python -m imdim.export.step_worker PROGRAM.json OUT.step`` writes the file and prints its re-read volume; a failure is one line on stderr.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from imdim.export.step import StepError, step_volume, write_step
from imdim.program.codec import loads


class StepJob(NamedTuple):
    """A running export of a program document to `out`."""

    process: subprocess.Popen[str]
    out: Path


def start_step(document: Path, out: Path) -> StepJob:
    """Start exporting the program.json `document`; raises StepError when OpenCASCADE is not installed."""
    if find_spec("OCP") is None:
        raise StepError('no STEP without OpenCASCADE: pip install "imdim[step]"')
    command = [sys.executable, "-m", __spec__.name, str(document), str(out)]
    return StepJob(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True), out)


def finish_step(job: StepJob, limit_s: float) -> float:
    """Wait at most `limit_s` seconds; the volume re-read from the file. Raises StepError, and leaves no file, when there is none."""
    try:
        out, problems = job.process.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired as error:
        stop_step(job)
        job.out.unlink(missing_ok=True)  # it may have ended between the two lines above
        raise StepError(f"OpenCASCADE took more than {limit_s:g} s") from error
    if job.process.returncode == 0:
        return float(out)
    job.out.unlink(missing_ok=True)
    lines = problems.strip().splitlines() if job.process.returncode == 1 else []
    raise StepError(lines[-1] if lines else f"OpenCASCADE ended with status {job.process.returncode}")


def stop_step(job: StepJob) -> None:
    """End the export, and remove what it wrote if it was not finished; its pipes are closed in any case."""
    if job.process.poll() is None:
        job.process.kill()
        job.process.wait()
        job.out.unlink(missing_ok=True)
    for pipe in (job.process.stdout, job.process.stderr):
        if pipe is not None:
            pipe.close()


@contextmanager
def exporting(folder: Path) -> Iterator[StepJob | StepError]:
    """The export of the program.json in `folder`, running beside the other work; it never outlives the block."""
    try:
        job = start_step(folder / "program.json", folder / "program.step")
    except StepError as error:
        yield error
        return
    try:
        yield job
    finally:
        stop_step(job)


def finish_or_skip_step(job: StepJob | StepError, limit_s: float, volumes: dict[str, float]) -> dict[str, str]:
    """Wait for the file, whose volume joins `volumes`; why there is none, by its name."""
    try:
        if isinstance(job, StepError):
            raise job
        volumes["program.step"] = finish_step(job, limit_s)
    except StepError as error:
        return {"program.step": f"skipped: {error}"}
    return {}


def main(document: str, out: str) -> None:
    """The worker's side."""
    try:
        write_step(loads(Path(document).read_text(encoding="utf-8")), Path(out))
        sys.stdout.write(repr(step_volume(Path(out))))
    except (StepError, OSError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main(*sys.argv[1:])
