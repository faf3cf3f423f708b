"""STEP export in a process of its own: OpenCASCADE can take minutes or crash on a hard shape, and must not take the other results along.

``python -m imdim.export.step_worker`` loads OpenCASCADE, which takes a second, reads one line of JSON, [PROGRAM.json, OUT.step, NAME,
FEATURES, EDGES], writes the file, in millimetres whatever the units of the document, and prints its re-read volume; a failure is one line
on stderr. FEATURES are the names of the features; where there are none, they are found once more. EDGES are where those of edge features
lie, in millimetres: who asks has compiled kernels, which take a second to load, to find them with.
A part is written, and told, as soon as there is a valid file of it, and again where there is a better one: in fewer solids, then with as
many of its edge features as OpenCASCADE can blend. If it fails on these, or is stopped, the last one stays. It ends with the process that
started it, however that ends: its standard input closes then.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, NamedTuple

from imdim.deadline import Deadline
from imdim.export.part_names import NAMELESS, PartNames, spell
from imdim.export.placed_edges import PlacedEdges
from imdim.export.step import StepError, path_beside, write_stages
from imdim.export.step_booleans import ocp
from imdim.install import install_command
from imdim.program.codec import constraints_of, edges_of, from_json, meta_of, parse, read_folded
from imdim.program.edges import EdgeFeature, EdgeNumber, name_edges, scale_edges
from imdim.program.tree import Primitive, Program, map_leaves, map_lengths
from imdim.program.units import to_millimetres
from imdim.side_process import end_with_parent

LOOK_S = 0.1  # between two looks at the clock, which may be another than the wall's


class Exported(NamedTuple):
    """What was written: the volume re-read from the file, how many edges of features the part has, and those of them that are sharp in it,
    and the `reason` if OpenCASCADE did not get to these, or to a better file."""

    volume: float
    edges: int = 0
    sharp: tuple[EdgeNumber, ...] = ()
    reason: str = ""


class StepJob(NamedTuple):
    """A running export of a program document to `out`; it ends when `lifeline` closes."""

    process: subprocess.Popen[str]
    out: Path
    lifeline: IO[bytes] | None = None


class StepWorker(NamedTuple):
    """A process that loads OpenCASCADE, and then waits to be told what to export; it ends when `lifeline` closes."""

    process: subprocess.Popen[str]
    lifeline: IO[bytes]


def start_worker() -> StepWorker:
    """Raises StepError when OpenCASCADE is not installed."""
    if find_spec("OCP") is None:
        raise StepError(f"no STEP without OpenCASCADE: {install_command('step')}")
    theirs, ours = os.pipe()  # no pipe of the process itself: waiting for its output would close that
    with os.fdopen(theirs, "rb") as end:
        command = [sys.executable, "-m", __spec__.name]
        pipes = {"stdin": end, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen(command, **pipes, text=True, process_group=0)  # a group of its own: Ctrl-C is for who started it
    return StepWorker(process, os.fdopen(ours, "wb"))


def stop_worker(worker: StepWorker) -> None:
    """End it, whatever it does, and close its pipes."""
    _end(StepJob(worker.process, Path(), worker.lifeline))


def start_step(document: Path, out: Path, name: str = NAMELESS, features: Sequence[str] = (), worker: StepWorker | None = None) -> StepJob:
    """Start exporting the program.json `document` as a part called `name`, its features as these or, of none, by their roles, by a `worker`
    that waits or by a new one; raises StepError when OpenCASCADE is not installed."""
    process, lifeline = worker or start_worker()
    asked = [str(document), str(out), spell(name), list(features), _place_edges(document).rows]
    # one that has ended already says why when it is waited for
    with suppress(BrokenPipeError):
        lifeline.write(json.dumps(asked).encode() + b"\n")
        lifeline.flush()
    return StepJob(process, out, lifeline)


def _place_edges(document: Path) -> PlacedEdges:
    """Where the edges of a document's features are, in millimetres; none of one that cannot be read, which its process says."""
    try:
        read = parse(document.read_text(encoding="utf-8"))
        program, edges = _in_millimetres(read), scale_edges(edges_of(read), _millimetres_of(read))
    except (OSError, ValueError):
        return PlacedEdges()
    return PlacedEdges.of(program, edges) if edges else PlacedEdges()


def finish_step(job: StepJob, deadline: Deadline) -> Exported:
    """Wait until the `deadline` at most; what was written. Raises StepError, and leaves no file, when there is none."""
    limit_s = deadline.left()
    while True:
        try:
            out, problems = job.process.communicate(timeout=min(deadline.left(), LOOK_S))
            break
        except subprocess.TimeoutExpired as error:
            if deadline.left() == 0.0:
                _end(job)
                told = (error.stdout or b"").decode()  # type: ignore[union-attr]
                return _last_stage(job, told, f"OpenCASCADE took more than {limit_s:.2g} s")
    _end(job)
    if job.process.returncode == 0:
        return _read_stage(out.splitlines()[-1])
    lines = problems.strip().splitlines() if job.process.returncode == 1 else []
    return _last_stage(job, out, lines[-1] if lines else f"OpenCASCADE ended with status {job.process.returncode}")


def _last_stage(job: StepJob, out: str, reason: str) -> Exported:
    """What stands although the export did not end; raises StepError, and leaves no file, when that is nothing."""
    path_beside(job.out).unlink(missing_ok=True)
    stages = [line for line in out.splitlines(keepends=True) if line.endswith("\n")]
    if not stages:
        job.out.unlink(missing_ok=True)  # it may have been written just before the process was stopped
        raise StepError(reason)
    return _read_stage(stages[-1])._replace(reason=reason)


def _read_stage(line: str) -> Exported:
    volume, edges, sharp = json.loads(line)
    return Exported(volume, edges, tuple((feature, edge) for feature, edge in sharp))


def stop_step(job: StepJob) -> None:
    """End the export, and remove what it wrote if it was not finished; its pipes are closed in any case."""
    if job.process.poll() is None:
        _end(job)
        for path in (job.out, path_beside(job.out)):
            path.unlink(missing_ok=True)
    _end(job)


def _end(job: StepJob) -> None:
    if job.process.poll() is None:
        job.process.kill()
        job.process.wait()
    for pipe in (job.process.stdout, job.process.stderr, job.lifeline):
        if pipe is not None:
            pipe.close()


@contextmanager
def exporting(
    folder: Path, name: str = NAMELESS, features: Sequence[str] = (), worker: StepWorker | None = None
) -> Iterator[StepJob | StepError]:
    """The export of the program.json in `folder`, running beside the other work; it never outlives the block, nor does the `worker`."""
    try:
        job = start_step(folder / "program.json", folder / "program.step", name, features, worker)
    except StepError as error:
        yield error
        return
    try:
        yield job
    finally:
        stop_step(job)


def finish_or_skip_step(
    job: StepJob | StepError, deadline: Deadline, volumes: dict[str, float], features: Sequence[EdgeFeature]
) -> dict[str, str]:
    """Wait for the file, whose volume joins `volumes`; why there is none, why it is the first of several, or which edges of the `features`
    are sharp in it, by its name."""
    try:
        if isinstance(job, StepError):
            raise job
        exported = finish_step(job, deadline)
    except StepError as error:
        return {"program.step": f"skipped: {error}"}
    volumes["program.step"] = exported.volume
    if not exported.sharp:
        # there is a first file where the right one was still looked for: in too many solids, or rough
        return {"program.step": f"written, the first valid one, perhaps in more solids: {exported.reason}"} if exported.reason else {}
    said = exported.reason or "; ".join(_list_sharp(exported.sharp, name_edges(features)))
    return {"program.step": f"written, {len(exported.sharp)} of {exported.edges} edges not blended: {said}"}


def _list_sharp(sharp: Sequence[EdgeNumber], features: Sequence[EdgeFeature]) -> Iterator[str]:
    """The edges of each feature that are sharp, by its name and theirs, as program.json has them: "fillet: 0.+z with 1.side"."""
    for number, feature in enumerate(features):
        pairs = [feature.edges[edge] for of, edge in sharp if of == number]
        if pairs:
            yield f"{feature.name}: " + ", ".join(f"{one} with {other}" for one, other in pairs)


def _read_line() -> bytes:
    """The first line of the standard input, up to its end; by bytes of the file itself, which is read on later."""
    line = bytearray()
    while (byte := os.read(0, 1)) not in (b"", b"\n"):
        line += byte
    return bytes(line)


def _end_with_pipe() -> None:
    while os.read(0, 1):  # the file itself: a stream's lock, held by a thread, ends Python in an error
        pass
    os._exit(1)


def _in_millimetres(document: object) -> Program:
    factor = _millimetres_of(document)
    return map_leaves(from_json(document), lambda _, leaf: _scale(leaf, factor))


def _millimetres_of(document: object) -> float:
    """What a unit of a document is."""
    return to_millimetres(meta_of(document).units)


def _scale(leaf: Primitive, factor: float) -> Primitive:
    x, y, z = (c * factor for c in leaf.center)
    return leaf if factor == 1 else map_lengths(leaf, lambda s: s * factor, (x, y, z))


def _label(program: Program, document: object) -> tuple[str, ...]:
    from imdim.export.feature_names import label_features  # with it come compiled kernels, half a second of a process

    return label_features(program, constraints_of(document), read_folded(document))


def main() -> None:
    """The worker's side."""
    # its group is not that of who started it, which may be killed as a whole, and a long boolean lets no thread look at the pipe
    end_with_parent()
    ocp("BRepAlgoAPI")  # with it comes all that is heavy
    asked = _read_line()
    if not asked:
        return  # nobody needs it any more
    document, out, name, called, placed = json.loads(asked)
    threading.Thread(target=_end_with_pipe, daemon=True).start()
    try:
        read = parse(Path(document).read_text(encoding="utf-8"))
        program = from_json(read)
        names = PartNames.of(program, name, tuple(called) or _label(program, read))
        for stage in write_stages(_in_millimetres(read), Path(out), PlacedEdges.from_rows(placed), names):
            edges, sharp = stage.blending
            sys.stdout.write(json.dumps([stage.volume, len(edges), sharp]) + "\n")
            sys.stdout.flush()
    except (StepError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        _leave(1)


def _leave(status: int) -> None:
    """End at once: to take all classes of OpenCASCADE apart first is a third of a second, for which the fit would wait, and they may have
    something to say to that."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    main()
    _leave(0)
