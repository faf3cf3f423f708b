"""What an agent may do, a public method for each tool, without the protocol that carries it (`server`). Methods raise one-line ValueErrors.

A step that changes something is kept, so that it can be taken back; files are read and written in one folder alone.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from imdim.app.agent import changes
from imdim.app.agent.locks import NamedLocks, check_locks, find_locks, is_reference, keep_locks, shift_locks
from imdim.app.agent.measured import MeasuredProgram
from imdim.app.agent.replies import (
    ChangeReply,
    ExplainReply,
    ExportReply,
    FeatureReply,
    FeaturesReply,
    FitReply,
    MeasureReply,
    ParameterReply,
    ParametersReply,
    RegionReply,
    StatusReply,
    StopReply,
    UndoReply,
    shorten,
    shorten_all,
)
from imdim.app.agent.search import Progress, run_fit
from imdim.app.agent.workplace import Workplace
from imdim.app.edit import open_results
from imdim.app.export import find_document
from imdim.app.lab import edits
from imdim.app.lab.drawing import roles
from imdim.app.lab.jobs import WorkerPool
from imdim.app.lab.solving import Lock
from imdim.delivery.finish import FinishedProgram, finish
from imdim.delivery.verdict import JudgedRegion
from imdim.export.delivered import Delivered, EditError, meanings, texts_of
from imdim.export.edit import change_values, lost_edges, open_delivered, write
from imdim.export.edit_report import EditReport
from imdim.export.feature_names import say_features
from imdim.export.folder import OutputError
from imdim.export.hole_names import hole_groups
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.export.untie import list_ties, new_names, untie
from imdim.geometry.solid import SEGMENTS
from imdim.program import codec
from imdim.program.constraints import RULES, describe, read_ref
from imdim.program.tree import Op, Primitive, leaves
from imdim.reconstruction.config import ConfigError, Settings, check
from imdim.reconstruction.fitting import relations_of
from imdim.target.placement import place
from imdim.target.readers import FORMATS
from imdim.target.target import InputError, Target, frame_meta, load_target

MOST_STEPS = 200  # that can be taken back
MOST_REGIONS = 6  # of a reply
MOST_NAMES = 60
DOES = {"union": "add", "difference": "cut", "intersection": "clip"}
OPS: dict[str, Op] = {"add": "union", "cut": "difference", "clip": "intersection"}
LONGEST_S = 600.0
WORSE = 1e-6  # IoU, or share of the mean distance, that a fit may cost: the last digits

Id = Annotated[int, Field(ge=0, description="a feature's id, as features lists it")]
Ids = Annotated[list[Id], Field(min_length=1, max_length=200)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3, description="x, y, z in the part's units")]


@dataclass(frozen=True, eq=False)
class AgentStep:
    """What was done, and what there is since then: the part, the program and what is locked. `locks` has each locked name with its numbers
    of primitives, and `source` says where the program is from."""

    what: str
    target: Target | None = None
    measured: MeasuredProgram | None = None
    locks: tuple[NamedLocks, ...] = ()
    source: str = ""

    @property
    def held(self) -> frozenset[Lock]:
        """The numbers that are locked."""
        return frozenset(lock for _, of in self.locks for lock in of)


class AgentSession:
    """See the module. One call at a time, but for `stop_fit`."""

    def __init__(self, workplace: Workplace) -> None:
        self.workplace, self._pool = workplace, WorkerPool()
        self._past, self._future = [AgentStep("start")], list[AgentStep]()
        self._ending, self._dropped = threading.Event(), threading.Event()
        self._fitting = False

    def close(self) -> None:
        """End what goes on."""
        self._pool.close()

    # --- what there is -------------------------------------------------------------------------------------------------

    def status(self) -> StatusReply:
        """Say what is open, which steps can be taken back, and which files of the folder can be opened."""
        now, program = self._now, self._now.measured
        size, volume = ([], None) if program is None else _box(program)
        part = "" if now.target is None else now.target.name
        return StatusReply(
            folder=self.workplace.root.name,
            part=part,
            part_size=[] if now.target is None else shorten_all(np.ptp(_corners(now.target), axis=0).tolist()),
            program=now.source,
            features=0 if program is None else program.size,
            size=size,
            volume=volume,
            undo=[step.what for step in self._past[:0:-1]][:10],
            redo=[step.what for step in self._future[::-1]][:10],
            locked=[name for name, _ in now.locks],
            notes=[] if now.target is None else list(now.target.notes),
            files=self.workplace.list_parts(),
        )

    def open(
        self,
        path: Annotated[
            str, Field(description="a mesh, a cloud, a results folder or a program.json, relative to the folder of the server")
        ],
        units: Annotated[Literal["auto", "mm", "cm", "m", "inch"], Field(description="what the lengths of a mesh or a cloud are")] = "auto",
    ) -> StatusReply:
        """Open a file. A mesh or a cloud becomes the part that programs are measured against, and closes the program before; a program is
        measured against the part that is open, if there is one."""
        place_of = self.workplace.read_path(path)
        if place_of.is_file() and place_of.suffix.lower() in FORMATS:
            target = place(load_target(place_of), units)
            self._push(AgentStep(f"open {path}", target))
            self._pool.prepare()  # while the agent thinks
        else:
            if units != "auto":
                raise ConfigError(f"{path}: a program says its units itself; scale converts it")
            source = find_document(place_of)
            if not source.is_file() or source.suffix != ".json":
                raise ConfigError(f"{path}: is no results folder, no program.json and no file of {', '.join(FORMATS)}")
            target = self._now.target
            self._push(AgentStep(f"open {path}", target, _measure(open_results(source), target), source=path))
        return self.status()

    def fit(
        self,
        budget_s: Annotated[float, Field(gt=0, le=LONGEST_S, description="seconds for the search")] = 30.0,
        seed: Annotated[int, Field(ge=0)] = 0,
        language: Annotated[Literal["cad", "csg"], Field(description="cad draws outlines, csg has six primitives alone")] = "cad",
        *,
        progress: Progress = lambda *_: None,
    ) -> FitReply:
        """Reconstruct the part that is open as a program, within about the budget. stop_fit ends it and keeps what it found."""
        target = self._part()
        self._ending.clear()
        self._dropped.clear()
        self._fitting = True
        try:
            return self._fit(target, check(Settings(budget_s=budget_s, seed=seed, language=language)), progress)
        finally:
            self._fitting = False

    def _fit(self, target: Target, settings: Settings, progress: Progress) -> FitReply:
        start = time.perf_counter()
        found = run_fit(self._pool, target, settings, progress, self._ending)
        if self._dropped.is_set():
            raise ValueError("the fit was cancelled")
        related = (found.program, found.constraints) if found.is_last else relations_of(found.program)
        measured = _measure(_deliver(finish(*related, edges=found.edges), target), target)
        delivered = measured.delivered
        self._push(AgentStep("fit", target, measured, source=target.name))
        names = [*delivered.values, *delivered.counts][:MOST_NAMES]
        seconds = shorten(time.perf_counter() - start)
        return FitReply(found.stop, seconds, measured.size, _shorten(measured.iou), names, list(found.notes))

    def stop_fit(self, keep: Annotated[bool, Field(description="whether what was found so far becomes the program")] = True) -> StopReply:
        """End the fit that is going on."""
        going = self._fitting
        if not keep:
            self._dropped.set()
        self._ending.set()
        return StopReply(going)

    def features(self, ids: Annotated[list[Id], Field(description="which; all where empty")] = []) -> FeaturesReply:  # noqa: B006 - read only
        """List features: what each is and does, its numbers, the share of the part's surface that it explains, and how far its own surface
        is from the part's."""
        program = self._program()
        d, parts = program.delivered, list(leaves(program.delivered.program))
        chosen = self._ids(ids) or range(program.size)
        does = [DOES[role] for role in roles(d.program)]
        rows = []
        for i in chosen:
            if i < len(parts):
                row = FeatureReply(i, program.names[i], parts[i].kind, does[i], _numbers(parts[i]))
            else:
                edge = d.edges[i - len(parts)]
                row = FeatureReply(i, edge.name, edge.kind, "blend", dict(zip(edge.size_names, edge.sizes, strict=True)))
            if program.target is not None:
                explains, mean, most = map(shorten, program.evidence[i])
                row = replace(row, explains=explains, off_mean=mean, off_max=most)
            rows.append(row)
        if ids:
            return FeaturesReply(rows, [], [])
        holes = [f"{group} (features {', '.join(map(str, group.leaves))})" for group in hole_groups(d.program)]
        return FeaturesReply(rows, holes, [describe(i, c) for i, c in enumerate(d.constraints)])

    def explain(
        self,
        point: Annotated[Vector | None, Field(description="a point")] = None,
        low: Annotated[Vector | None, Field(description="the low corner of a box, with high, in place of a point")] = None,
        high: Vector | None = None,
    ) -> ExplainReply:
        """Say what is at a point or in a box: which features made the surface there, what the verdict on the part's surface is, how far the
        program is from it."""
        program = self._program()
        if (point is None) == (low is None) or (low is None) != (high is None):
            raise ValueError("explain needs a point, or low and high of a box")
        corners = np.array([point, point] if point is not None else [low, high], float)
        if not np.isfinite(corners).all() or (corners[0] > corners[1]).any():
            raise ValueError("explain needs finite numbers, those of low not above those of high")
        middle = corners.mean(axis=0)
        if program.target is None:
            owners, _ = program.owners_of(middle[None])
            return self._explained(program, {int(owners[0]): 1.0}, "", None, middle, [])
        elements, codes = program.verdict.elements, program.verdict.codes
        if point is not None:
            chosen = np.array([int(np.linalg.norm(elements.points - middle, axis=1).argmin())])
            owners, _ = program.owners_of(middle[None])
        else:
            chosen = np.flatnonzero(((elements.points >= corners[0]) & (elements.points <= corners[1])).all(axis=1))
            if not len(chosen):
                owners, _ = program.owners_of(middle[None])
                return self._explained(program, {int(owners[0]): 0.0}, "", None, middle, [])
            owners, _ = program.owners_of(elements.points[chosen])
        areas = elements.areas[chosen] if point is None else np.ones(1)
        shares = np.bincount(owners, areas) / areas.sum()
        found = {int(i): shorten(float(shares[i])) for i in np.argsort(-shares) if shares[i] > 0}
        verdict = int(np.bincount(codes[chosen], elements.areas[chosen]).argmax())
        regions = [r for r in program.verdict.regions if all(r.low[a] <= corners[1][a] and r.high[a] >= corners[0][a] for a in range(3))]
        furthest = float(program.far(elements.points[chosen]).max())
        return self._explained(program, found, list(program.verdict.shares)[verdict], furthest, middle, regions)

    def _explained(
        self,
        program: MeasuredProgram,
        found: dict[int, float],
        verdict: str,
        furthest: float | None,
        middle: np.ndarray,
        regions: Sequence[JudgedRegion],
    ) -> ExplainReply:
        found = dict(list(found.items())[:10])
        inside = program.is_in_part(middle), program.is_inside(middle)
        return ExplainReply(found, [program.names[i] for i in found], verdict, _shorten(furthest), *inside, _regions(regions))

    def measure(self) -> MeasureReply:
        """Measure the program against the part: IoU, distances both ways, the verdict, and the largest regions that are not exact."""
        program = self._program()
        scores, verdict = program.scores, program.verdict
        to_program, to_part = ((shorten(d.mean), shorten(d.max)) for d in (scores.to_result, scores.to_target))
        shares = {name: shorten(share) for name, share in verdict.shares.items()}
        missing = scores.iou_missing or ""
        tolerance, regions = shorten(verdict.tolerance), _regions(verdict.regions)
        said, doubts = verdict.overall, list(verdict.doubts)
        return MeasureReply(_shorten(scores.volume_iou), missing, said, shares, tolerance, *to_program, *to_part, regions, doubts)

    # --- numbers -------------------------------------------------------------------------------------------------------

    def parameters(self, like: Annotated[str, Field(description="part of a name; all where empty")] = "") -> ParametersReply:
        """List the named numbers: what each is, what moves with it, which features share it."""
        d = self._program().delivered
        ties, locked = list_ties(d), {name for name, _ in self._now.locks}
        rows = []
        for name, meaning in meanings(d).items():
            if like in name:
                value = d.values[name] if name in d.values else float(d.counts[name])
                of = list(dict.fromkeys(i for i, _ in ties.get(name, ())))
                rows.append(ParameterReply(name, shorten(value), meaning, of, name in locked))
        return ParametersReply(rows[:MOST_NAMES])

    def set(
        self,
        values: Annotated[
            dict[str, float],
            Field(min_length=1, max_length=50, description="new values by name, or by feature and number as in 3.x, 3.r, 3.rz"),
        ],
        strict: Annotated[bool, Field(description="refuse what opens, closes or parts something")] = False,
    ) -> ChangeReply:
        """Change numbers; all that depends on them follows."""
        before = self._program().delivered
        locked = {name for name, _ in self._now.locks}
        for name in values:
            if name in locked:
                raise EditError(f"{name} is locked: unlock it first")
        direct = {name: value for name, value in values.items() if name not in before.values and is_reference(name)}
        after = change_values(before, {k: v for k, v in values.items() if k not in direct}) if len(direct) < len(values) else before
        for name, value in direct.items():
            ref = read_ref(name)
            if not math.isfinite(value):
                raise EditError(f"{name} needs a finite number, got {value}")
            after = changes.set_number(after, ref.leaf, ref.feature, value, self._now.held)
        return self._change(f"set {', '.join(f'{name} = {value:.6g}' for name, value in values.items())}", after, strict)

    def tie(self, names: Annotated[list[str], Field(min_length=2, max_length=50, description="names of sizes")]) -> ChangeReply:
        """Make sizes one: they take the value of the first name, and share a name from now on."""
        return self._change(f"tie {', '.join(names)}", changes.tie_sizes(self._program().delivered, names))

    def untie(
        self,
        name: Annotated[str, Field(description="a name that several features share")],
        ids: Annotated[
            list[Id], Field(description="the features that are to have a name of their own together; each its own where empty")
        ] = [],  # noqa: B006 - read only
    ) -> ChangeReply:
        """Give sizes that share a name names of their own."""
        before = self._program().delivered
        after = untie(before, name, ids or None)
        said = [
            f"{old} is now {', '.join(f'{new} ({say_features(of, after.labels)})' for new, of in names.items())}"
            for old, names in new_names(before, after).items()
        ]
        return self._change(f"untie {name}", after, notes=said)

    def hold(
        self,
        kind: Annotated[str, Field(description=f"one of {', '.join(RULES)}")],
        of: Annotated[str, Field(description="features such as '2.r, 3.r' (sizes), '1, 2' (centres), '0.+z, 1.-z' (faces), '1.z' (axes)")],
        about: Annotated[str, Field(description="what an arrangement is about, such as 'world.z'")] = "",
        value: Annotated[float, Field(description="of kinds that have one")] = 0.0,
    ) -> ChangeReply:
        """Say a relation between features; numbers move as little as it needs, and it holds from now on."""
        relation = edits.read_constraint(kind, of, about, value)
        return self._change(f"hold {kind} of {of}", changes.hold_relation(self._program().delivered, relation, self._now.held))

    def drop(self, relation: Annotated[int, Field(ge=0, description="its place in the list of features")]) -> ChangeReply:
        """Take a relation away."""
        return self._change(f"drop relation {relation}", changes.drop_relation(self._program().delivered, relation))

    def lock(
        self,
        names: Annotated[list[str], Field(min_length=1, max_length=100, description="names of numbers, or a feature and number as in 3.x")],
        locked: bool = True,
    ) -> StatusReply:
        """Hold numbers, or let them go: nothing changes them meanwhile, refit and relations neither."""
        program, now = self._program(), self._now
        locks = dict(now.locks)
        for name in names:
            if locked:
                locks[name] = find_locks(program.delivered, name)
            elif locks.pop(name, None) is None:
                raise EditError(f"{name} is not locked")
        self._push(replace(now, what=f"{'lock' if locked else 'unlock'} {', '.join(names)}", locks=tuple(locks.items())))
        return self.status()

    def scale(self, factor: Annotated[float, Field(gt=0, description="25.4 makes millimetres of inches")]) -> ChangeReply:
        """Multiply all lengths of the program, as where they were taken for another unit."""
        if not 1e-6 <= factor <= 1e6:
            raise ValueError(f"scale needs a factor within 1e-6 to 1e6, got {factor:g}")
        if self._now.locks:
            raise EditError(f"{self._now.locks[0][0]} is locked: unlock it first")
        return self._change(f"scale {factor:g}", changes.scale(self._program().delivered, factor))

    # --- structure -----------------------------------------------------------------------------------------------------

    def add(
        self,
        does: Annotated[Literal["add", "cut", "clip"], Field(description="what it does to all that is there")],
        feature: Annotated[
            dict[str, Any],
            Field(
                description='a node of program.json, such as {"kind": "cylinder", "size": {"r": 3, "h": 20}, "center": [0, 0, 0]}; '
                "kinds: box sx sy sz, sphere r, cylinder r h, cone r_bottom r_top h, torus r_major r_minor, ellipsoid rx ry rz, "
                "extrude h, revolve angle and drafted h draft (degrees by which walls lean in from the outline at the lower end), with "
                "outline as loops of [x, y] or [x, y, bulge]; rotation is in degrees about x, y, z"
            ),
        ],
        before_cuts: Annotated[bool, Field(description="join it to what is there before cuts are made, which go through it too")] = False,
    ) -> ChangeReply:
        """Add one more feature; the answer has its id. Later ids move up."""
        program, now = self._program(), self._now
        after, first = changes.add_feature(program.delivered, OPS[does], feature, before_cuts)
        more = sum(1 for _ in leaves(after.program)) - sum(1 for _ in leaves(program.delivered.program))
        said = f"it is feature {first}" if more == 1 else f"it is features {first} to {first + more - 1}"
        locks = shift_locks(now.locks, first, more)
        return self._change(f"{does} {feature.get('kind', 'features')}", after, notes=[said], locks=locks)

    def remove(self, ids: Ids) -> ChangeReply:
        """Remove features; what was cut out of one of them alone goes with it. Later ids move down."""
        program, now = self._program(), self._now
        chosen = self._ids(ids)
        after = changes.remove_features(program.delivered, chosen)
        names = ", ".join(program.names[i] for i in chosen)
        return self._change(f"remove {names}", after, locks=keep_locks(now.locks, program.delivered.program, after.program))

    def refit(
        self,
        only: Annotated[list[Id], Field(description="the features whose numbers may move; all where empty")] = [],  # noqa: B006 - read only
        turn: Annotated[bool, Field(description="let orientations move too")] = False,
    ) -> ChangeReply:
        """Fit sizes and places of primitives to the part, while relations and locks hold; it goes a few per cent of the part at most.
        Drawings and edges stay. A result that is farther from the part, or opens, closes or parts something, is refused."""
        target, program = self._part(), self._program()
        after = changes.refit(program.delivered, target, self._now.held, self._ids(only) or None, turn)
        fitted = MeasuredProgram(after, target)
        if program.iou is not None and fitted.iou is not None:
            if program.iou - fitted.iou > WORSE:
                raise EditError(f"refit finds nothing nearer: the IoU would be {fitted.iou:.6f}, and is {program.iou:.6f}")
        elif (would := fitted.scores.to_result.mean) > (now := program.scores.to_result.mean) * (1 + WORSE):
            raise EditError(f"refit finds nothing nearer: the part's points would be {would:.6g} off on average, and are {now:.6g}")
        return self._change("refit", after, strict=True)

    def relate(self) -> ChangeReply:
        """Look for relations and repeats among the numbers: equal holes share a name, rows have a spacing and a count. Ids may change."""
        if self._now.locks:
            raise EditError(f"{self._now.locks[0][0]} is locked, and relate may move numbers: unlock it first")
        return self._change("relate", changes.relate(self._program().delivered))

    # --- steps and files -----------------------------------------------------------------------------------------------

    def undo(self) -> UndoReply:
        """Take the last step back."""
        if len(self._past) < 2:
            raise ValueError("there is nothing to undo")
        self._future.append(self._past.pop())
        return self._moved(self._future[-1].what)

    def redo(self) -> UndoReply:
        """Do again what was taken back."""
        if not self._future:
            raise ValueError("there is nothing to redo")
        self._past.append(self._future.pop())
        return self._moved(self._now.what)

    def export(
        self,
        folder: Annotated[str, Field(description="a new folder, or one with earlier results, relative to the folder of the server")],
        step: Annotated[bool, Field(description="STEP too, which takes seconds")] = False,
    ) -> ExportReply:
        """Write the program as JSON, OpenSCAD, build123d, CadQuery, FreeCAD and µcad texts, and as STL, GLB and 3MF meshes."""
        where, program = self.workplace.write_path(folder), self._program()
        files = write(program.delivered, where, STEP_LIMIT_S if step else 0.0)
        return ExportReply(folder, files)

    # --- inner ---------------------------------------------------------------------------------------------------------

    @property
    def _now(self) -> AgentStep:
        return self._past[-1]

    def _push(self, step: AgentStep) -> None:
        self._past = [*self._past, step][-MOST_STEPS:]
        self._future.clear()

    def _moved(self, what: str) -> UndoReply:
        program = self._now.measured
        return UndoReply(what, 0 if program is None else program.size, None if program is None else _shorten(program.iou))

    def _part(self) -> Target:
        if self._now.target is None:
            raise ValueError("no part is open: open a mesh or a cloud first")
        return self._now.target

    def _program(self) -> MeasuredProgram:
        if self._now.measured is None:
            raise ValueError("there is no program: open one, or fit the part")
        return self._now.measured

    def _ids(self, ids: Sequence[int]) -> list[int]:
        program = self._program()
        stranger = next((i for i in ids if not 0 <= i < program.size), None)
        if stranger is not None:
            raise EditError(f"no feature {stranger}; there are {program.size}, counted from 0")
        return list(dict.fromkeys(ids))

    def _change(
        self,
        what: str,
        after: Delivered,
        strict: bool = False,
        notes: Sequence[str] = (),
        locks: tuple[NamedLocks, ...] | None = None,
    ) -> ChangeReply:
        """Make `after` the program, as one step. Raises EditError, changing nothing, where it moves what is locked or leaves no solid."""
        now, program = self._now, self._program()
        if locks is None:
            check_locks(now.locks, program.delivered.program, after.program)
        measured = _measure(after, now.target)
        same = program.size == measured.size
        report = EditReport.of(program.solid, measured.solid, lost_edges(program.delivered, after) if same else ())
        if strict and report.changes_in_kind:
            raise EditError(f"{what}: {report.changes_in_kind}")
        self._push(replace(now, what=what, measured=measured, locks=now.locks if locks is None else locks))
        had, has = ({**d.values, **d.counts} for d in (program.delivered, after))
        fresh = {name: shorten(value) for name, value in has.items() if name not in had}
        return ChangeReply(
            step=what,
            size=shorten_all(report.after.size),
            volume_before=shorten(report.before.volume),
            volume=shorten(report.after.volume),
            kind=report.changes_in_kind,
            iou_before=_shorten(program.iou),
            iou=_shorten(measured.iou),
            names=dict(list(fresh.items())[:MOST_NAMES]),
            gone=[name for name in had if name not in has][:MOST_NAMES],
            notes=list(notes),
        )


def _measure(delivered: Delivered, target: Target | None) -> MeasuredProgram:
    """The program with its solid made; raises EditError where there is none."""
    measured = MeasuredProgram(delivered, target)
    _ = measured.solid
    return measured


def _corners(target: Target) -> np.ndarray:
    return target.points if target.mesh is None else np.asarray(target.mesh.vertices)


def _deliver(found: FinishedProgram, target: Target) -> Delivered:
    meta = frame_meta(target)
    document = codec.to_json(found.program, meta, found.constraints, found.folded, found.edges)
    return open_delivered(document, texts_of(found.program, found.parameters, found.folded, SEGMENTS, found.edges))


def _numbers(part: Primitive) -> dict[str, float]:
    return {number.name: shorten(number.value) for number in edits.numbers(part)}


def _box(program: MeasuredProgram) -> tuple[list[float], float]:
    box = program.solid.bounding_box()
    return shorten_all(box[a + 3] - box[a] for a in range(3)), shorten(program.solid.volume())


def _shorten(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else shorten(value)


def _regions(regions: Sequence[JudgedRegion]) -> list[RegionReply]:
    return [
        RegionReply(r.verdict, r.what, r.where, shorten(r.share), shorten(r.furthest), shorten_all(r.low), shorten_all(r.high))
        for r in regions[:MOST_REGIONS]
    ]


REFUSED = (ValueError, ConfigError, InputError, OutputError)
