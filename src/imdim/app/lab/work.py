"""What a working process does: one function per task, each a generator of messages."""

from __future__ import annotations

import functools
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from imdim.app.lab import naming, protocol, resume, solving
from imdim.app.lab.protocol import Message
from imdim.deadline import NEVER
from imdim.delivery.deliver import RunRecord, deliver
from imdim.delivery.evaluate import evaluate
from imdim.delivery.finish import finish
from imdim.detection.fit_surface import fit_surface
from imdim.detection.mesh_surfaces import detect_patches
from imdim.export.edit import open_delivered
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.geometry.even_points import draw_even
from imdim.geometry.winding import winding_number
from imdim.program import codec
from imdim.program.constraints import ConstraintError, renumber_constraints
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import ConfigError, Settings, check, first_line, merge
from imdim.reconstruction.edge_features import find_edge_features, set_edges_aside
from imdim.reconstruction.fitting import relations_of
from imdim.reconstruction.pipeline import Snapshot, reconstruct, reconstruct_best
from imdim.relations.residuals import rebase_constraints
from imdim.search.kernels import add_axial_density, mark_inside_cylinder
from imdim.target.readers import FORMATS
from imdim.target.target import InputError, Target, frame_meta, load_target

Now = Callable[[], float]
SHOWN_EVERY_S = 0.05  # an evolution makes generations faster than they can be drawn
FINISH_S = 10.0  # after which a program is finished no further


def open_file(request: Message, now: Now) -> Iterator[Message]:
    """An uploaded file, which is data and nothing else, as a target. Its own name is only said back."""
    yield protocol.target_message(_load(request))


def fit(request: Message, now: Now) -> Iterator[Message]:
    """A reconstruction from nothing."""
    target, settings = protocol.target_of(request), _settings(request)
    yield from _to_messages(reconstruct(target, settings, np.random.default_rng(settings.seed), now), target)


def go_on(request: Message, now: Now) -> Iterator[Message]:
    """Evolution from a program that a person may have edited."""
    target, settings = protocol.target_of(request), _settings(request)
    program, _ = protocol.read_document(request.values["document"])
    config = resume.Rates(**request.values.get("rates", {}))
    yield from _to_messages(resume.resume_evolution(target, program, settings, config, now), target)


def solve(request: Message, now: Now) -> Iterator[Message]:
    """The numbers of a program fitted while constraints and locked numbers hold."""
    target = protocol.target_of(request)
    program, constraints = protocol.read_document(request.values["document"])
    locks = [solving.Lock(int(leaf), str(name)) for leaf, name in request.values["locks"]]
    start, edges = now(), codec.edges_of(request.values["document"])
    for solved in solving.finish(program, constraints, locks, target):
        error = solving.misfit(solved, target)
        yield _snapshot(Snapshot("solve", solved, error, now() - start, constraints=constraints, edges=edges))


def relate(request: Message, now: Now) -> Iterator[Message]:
    """The relations that the numbers of a program support."""
    target = protocol.target_of(request)
    document = request.values["document"]
    program, constraints = relations_of(protocol.read_document(document)[0])
    edges = codec.edges_of(document)
    yield _snapshot(Snapshot("relate", program, solving.misfit(program, target), 0.0, constraints=constraints, edges=edges))


def files(request: Message, now: Now) -> Iterator[Message]:
    """The results folder of a program, as `imdim fit` writes it, as bytes by name."""
    target = protocol.target_of(request)
    program, constraints = protocol.read_document(request.values["document"])
    front = protocol.read_front(request.values["front"])
    settings = _settings(request)
    edges = codec.edges_of(request.values["document"])
    if request.values.get("find_edges", False) and settings.language == "cad":
        edges = find_edge_features(program, set_edges_aside(target).chains, target).features
    run = RunRecord(target.name, {}, request.values["stop"], settings.seed, asdict(settings))
    named = request.values["named"] and open_delivered(request.values["named"]["document"], request.values["named"]["texts"])
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "part"
        deliver(program, target, folder, run, settings.segments, STEP_LIMIT_S, constraints, front, edges=edges, named=named or None)
        arrays = {path.name: np.frombuffer(path.read_bytes(), np.uint8) for path in sorted(folder.iterdir())}
    yield Message("files", {}, arrays)


TASKS: Mapping[str, Callable[[Message, Now], Iterator[Message]]] = {
    "open": open_file,
    "fit": fit,
    "continue": go_on,
    "solve": solve,
    "relate": relate,
    "files": files,
}


def perform(request: Message, now: Now) -> Iterator[Message]:
    """The messages of a task; the last one is "done", or "refused" with one line for what cannot be used, or "failed" with what broke."""
    try:
        yield from TASKS[request.kind](request, now)
    except (InputError, ConfigError, ConstraintError) as error:
        yield Message("refused", {"message": first_line(error)})
    except MemoryError:
        yield Message("refused", {"message": "the part needs more memory than a run may use"})
    except Exception as error:  # noqa: BLE001 - the process's outermost call: whatever broke is told to the person, and to the terminal
        sys.stderr.write(f"imdim lab: {traceback.format_exc()}")
        yield Message("failed", {"message": f"the run failed: {type(error).__name__}: {first_line(error)}; the lab goes on"})
    else:
        yield Message("done")


def _load(request: Message) -> Target:
    """The target in the bytes of an upload. On disk it has a name of ours; messages say the one it came with."""
    shown, suffix = request.values["name"], Path(request.values["name"]).suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{shown}: unknown format {suffix!r}; known are {', '.join(FORMATS)}")
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / f"upload{suffix}"
        path.write_bytes(request.arrays["data"].tobytes())
        try:
            return replace(load_target(path, int(request.values["max_points"])), name=shown)
        except InputError as error:
            raise InputError(str(error).replace(str(path), shown).replace(path.name, shown)) from error


def _settings(request: Message) -> Settings:
    return check(merge(Settings, request.values.get("settings", {})))


def _to_messages(snapshots: Iterator[Snapshot], target: Target) -> Iterator[Message]:
    """Snapshots as messages; of those that follow each other at once only the last, and all that say why a run ended, which are finished
    as they will be delivered."""
    last = 0.0
    kept: Snapshot | None = None
    for snapshot in snapshots:
        kept = snapshot
        if snapshot.stop or time.perf_counter() - last > SHOWN_EVERY_S:
            last, kept = time.perf_counter(), None
            yield _finished(snapshot, target) if snapshot.stop else _snapshot(snapshot)
    if kept is not None:
        yield _snapshot(kept)


def _finished(snapshot: Snapshot, target: Target) -> Message:
    """The last snapshot of a run: its program with the order, the numbers and the names that files have."""
    by = NEVER.ahead(FINISH_S)
    found = finish(snapshot.program, snapshot.constraints, by, snapshot.edges)
    place = {old: new for new, old in enumerate(found.order)}
    constraints = rebase_constraints(found.program, renumber_constraints(snapshot.constraints, place))
    named = naming.name_finished(found, frame_meta(target), constraints, snapshot.program)
    message = _snapshot(replace(snapshot, program=found.program, constraints=constraints, edges=found.edges))
    return Message(message.kind, {**message.values, "named": naming.to_values(named)}, message.arrays)


def _snapshot(snapshot: Snapshot) -> Message:
    values: dict[str, Any] = {
        "stage": snapshot.stage,
        "document": codec.to_json(snapshot.program, None, snapshot.constraints, edges=snapshot.edges),
        "error": float(snapshot.error),
        "seconds": snapshot.seconds,
        "stop": snapshot.stop,
        "front": protocol.front_values(snapshot.front),
        "proof": snapshot.proof,
        "notes": list(snapshot.notes),
    }
    return Message("snapshot", values)


@functools.cache
def warm() -> Target:
    """One tiny reconstruction and its score, so that the first real one finds compiled kernels loaded. Gives the tiny part."""
    import trimesh

    from imdim.target.target import target_from

    box = trimesh.creation.box((3.0, 2.0, 1.0))
    target = target_from(box, "warm-up")
    last = reconstruct_best(target, Settings(budget_s=5.0))
    evaluate(last.program, target, samples=100)
    winding_number(box, target.points[:1])  # which a box's own points never ask for: rays are sure about all of them
    return target


@functools.cache
def warm_rest() -> None:
    """What a reconstruction does not need and the other tasks do: an evolution that goes on, the solver, the search for relations."""
    import trimesh

    target, part = warm(), Primitive("cylinder", (1.0, 1.0))
    *_, last = resume.resume_evolution(
        target, Combine("union", part, part), Settings(budget_s=2.0), resume.Rates(population=8), time.perf_counter
    )
    _, constraints = relations_of(last.program)
    for solved in solving.finish(last.program, constraints, [solving.Lock(0, "x")], target):
        solving.misfit(solved, target)
    draw_even([part], [1])  # a busy machine may cut the evolution before it comes to that
    ends, steps = np.array([0.0, 1.0]), np.ones(1)  # a box has no axes, and no curved surfaces
    add_axial_density(np.zeros(1), np.zeros((1, 3)), np.zeros(3), np.eye(3), ends, steps, ends, steps)
    fit_surface("sphere", np.concatenate([np.eye(3), -np.eye(3)]))
    detect_patches(trimesh.creation.cylinder(1.0, 1.0))
    mark_inside_cylinder(np.zeros(1, bool), np.zeros((1, 3)), np.zeros(3), np.zeros(3), 1.0)
