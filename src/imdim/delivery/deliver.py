"""Deliver a program: every file of the results folder, and the report measured over those files.

The delivered program has the solid of the one given, with numbers rounded to nine digits and cutters that overshoot. Constraints that hold
for the program become named parameters of the texts; by how much a cutter overshoots stays a number beside them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import trimesh
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.delivery.coverage import cover
from imdim.delivery.evaluate import DeliveryLoss, evaluate_solid, read_solid
from imdim.delivery.films import find_film
from imdim.delivery.finish import FinishedProgram, finish, finish_flat
from imdim.delivery.intervals import StatedInterval, state_edge_intervals, state_intervals, with_remarks
from imdim.delivery.report import RunRecord, dumps, report_of
from imdim.delivery.verdict import judge
from imdim.export import html
from imdim.export.delivered import Delivered, texts_of, unwritten, with_segments
from imdim.export.edge_text import do_edges_matter, with_edge_sizes
from imdim.export.feature_notes import feature_notes
from imdim.export.folder import DIGESTS, EDIT_PICTURE, FILES, OutputError, check_untouched, check_writable, digests_of, replacing
from imdim.export.hole_names import hole_features
from imdim.export.meshes import NamedFeatures, write_meshes
from imdim.export.numbers import round_program
from imdim.export.openscad_reader import are_drawn
from imdim.export.parameters import parametrise
from imdim.export.preview import SUPERSAMPLE, preview
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.export.step_worker import StepWorker, exporting, finish_or_skip_step
from imdim.geometry.census import census_of
from imdim.geometry.edge_solids import solid_with_edges, with_edges
from imdim.geometry.solid import SEGMENTS, join_touching, mesh_to_manifold, to_trimesh
from imdim.program.codec import Meta
from imdim.program.codec import dumps as program_text
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature
from imdim.program.front import Choice
from imdim.program.front import dumps as front_text
from imdim.program.tree import Program
from imdim.reconstruction.fitting import relations_of
from imdim.target.target import Target, frame_meta

__all__ = ["OutputError", "RunRecord", "check_untouched", "check_writable", "deliver", "finish_flat"]

LEAST_STEP_S = 1.0


def deliver(
    program: Program,
    target: Target,
    folder: Path,
    run: RunRecord,
    segments: int = SEGMENTS,
    step_limit_s: float = STEP_LIMIT_S,
    constraints: Sequence[Constraint] = (),
    front: Sequence[Choice] = (),
    finish_by: Deadline = NEVER,
    edges: Sequence[EdgeFeature] = (),
    named: Delivered | None = None,
    step_worker: StepWorker | None = None,
    name_by: Deadline = NEVER,
    draw_by: Deadline = NEVER,
    step_by: Deadline = NEVER,
) -> dict[str, Any]:
    """Write all results for `program` (in the target's units) into `folder`, whole or not at all; returns the report.

    `constraints` hold for `program` (see `relations.discover`). `front` holds programs from crude to exact, `program` among them; without
    it `front.json` holds the program alone. Past `finish_by` (by default never) the program is finished no further (`finish`). One that
    cannot be named by `name_by` is delivered as it was found, and a picture that is drawn past `draw_by` is a coarser one. `edges` are edge
    features of `program`. A program that is `named` already is written with its own texts, and finished no further.

    STEP is written by the `step_worker`, if there is one, and skipped, and the report says why, where OpenCASCADE is missing, fails or
    takes longer than `step_limit_s`, or when all else is written than until `step_by` (by default never), but for LEAST_STEP_S.
    Raises OutputError when the folder cannot be written or holds foreign files, ValueError when the program is empty.
    """
    seconds: dict[str, float] = {}
    with replacing(folder) as partial:
        with _time(seconds, "program"):
            given, found = program, finish(program, constraints, finish_by, edges, name_by) if named is None else _keep(named)
            program = found.program
            meta = frame_meta(target)
            sharp = join_touching(program, segments)
            solid = solid_with_edges(program, found.edges, segments, join_touching) if found.edges else sharp
            matter = do_edges_matter(sharp.volume(), solid.volume())
            intervals = _state_intervals(found, target, run, finish_by) if run.noisy else None
            texts = compose_texts(found, meta, segments, matter, finish_by) | ({} if named is None else dict(named.texts))
            texts["program.scad"] = with_remarks(texts["program.scad"], intervals or {})
            _write(texts, partial)
            _write_front(front or [Choice(given)], given, meta, partial)
            called = _named(found, Path(target.name).stem)
        with exporting(partial, Path(target.name).stem, called.names.features, step_worker) as job:
            with _time(seconds, "meshes"):
                write_meshes(solid, partial, called, meta.units)
            with _time(seconds, "scores"):
                delivered, count = read_solid(partial / "program.scad", segments)
                scores = evaluate_solid(delivered, target, primitives=count)
                kept = DeliveryLoss.of(given, sharp, target, segments, None if found.edges else scores.volume_iou)
            with _time(seconds, "verdict"):
                surface = to_trimesh(delivered)
                shown = program if target.mesh is not None else with_edges(program, found.edges)
                verdict = judge(target, surface, segments, shown, run.noisy, run.noise)
                coloured = verdict.colour(target)
                noise = verdict.elements.noise if len(surface.faces) else None
                covered = None if noise is None else cover(shown, surface, target.points, noise, found.folded, target.scanners)
                seen = None if covered is None else covered.coloured
            with _time(seconds, "preview"):
                supersample = 1 if draw_by.has_passed() else SUPERSAMPLE
                preview(target, surface, scores.to_result.max, coloured, seen, supersample).save(partial / "preview.png")
            with _time(seconds, "page"):
                document, furthest = _read(partial / "program.json"), scores.to_result.max
                shown = html.content(document, target, found.parameters, segments, furthest, verdict=coloured, coverage=seen)
            with _time(seconds, "films"):
                film = find_film(surface, target, scores.to_target.max)
                faults = [*_parted(solid, target), *([] if film is None else [str(film)])]
            with _time(seconds, "step"):
                volumes = _volumes(partial, target, delivered)
                left = min(max(step_by.left(), LEAST_STEP_S), step_limit_s)
                skipped = finish_or_skip_step(job, step_by.ahead(left), volumes, found.edges)
        skipped |= unwritten(program)
        if found.folded is None:
            skipped["program.loops.scad"] = "skipped: no time was left" if found.hurried else "skipped: no part repeats"
        files = {name: skipped.get(name, "written") for name in FILES if name != EDIT_PICTURE}
        drawn = are_drawn(texts["program.scad"])
        report = report_of(found, target, scores, kept, verdict, volumes, files, run, seconds, drawn, faults, intervals, covered)
        report[DIGESTS] = digests_of(partial)
        (partial / "report.json").write_text(dumps(report), encoding="utf-8")
        (partial / "report.html").write_text(html.page(shown, report, _read(partial / "front.json")), encoding="utf-8")
    return report


def _state_intervals(found: FinishedProgram, target: Target, run: RunRecord, deadline: Deadline) -> dict[str, StatedInterval]:
    """The intervals of all names, those of edge features too."""
    edges = state_edge_intervals(found.edges, run.edge_sizes) if run.edge_sizes else {}
    return {**state_intervals(found, target, deadline), **edges}


def _parted(solid: Manifold, target: Target) -> Iterator[str]:
    """What is to be said of a result that falls into more bodies than its target."""
    if target.mesh is None or not target.is_solid:
        return
    have, wanted = census_of(solid).bodies, census_of(mesh_to_manifold(target.mesh)).bodies
    if have > wanted:
        yield f"the result is in {have} bodies, the target in {wanted}: parts of it miss each other, perhaps by a hair"


def export(
    program: Program,
    folder: Path,
    meta: Meta,
    segments: int = SEGMENTS,
    step_limit_s: float = STEP_LIMIT_S,
    edges: Sequence[EdgeFeature] = (),
    named: Delivered | None = None,
) -> dict[str, str]:
    """Write what needs no target for `program` into `folder`, whole or not at all: texts with the names of
    what its own numbers relate, meshes, the page without a target, and STEP; what became of each file. A program that is `named` already
    is written with its own texts.

    Raises as `deliver` does.
    """
    with replacing(folder) as partial:
        found = finish(*relations_of(program), edges=edges) if named is None else _keep(named)
        program = found.program
        sharp = join_touching(program, segments)
        solid = solid_with_edges(program, found.edges, segments, join_touching) if found.edges else sharp
        matter = do_edges_matter(sharp.volume(), solid.volume())
        kept = {} if named is None else with_segments(named.texts, segments)
        _write(compose_texts(found, meta, segments, matter) | kept, partial)
        called = _named(found, folder.resolve().name)
        with exporting(partial, folder.resolve().name, called.names.features) as job:
            write_meshes(solid, partial, called, meta.units)
            shown = html.content(_read(partial / "program.json"), named=found.parameters, segments=segments)
            (partial / "report.html").write_text(html.page(shown), encoding="utf-8")
            skipped = finish_or_skip_step(job, NEVER.ahead(step_limit_s), {}, found.edges) | unwritten(program)
        files = {path.name: "written" for path in sorted(partial.iterdir())}
    return {**files, **skipped}


def compose_texts(found: FinishedProgram, meta: Meta, segments: int, matter: bool, deadline: Deadline = NEVER) -> dict[str, str]:
    """program.json and the texts of a program by their names; program.scad draws edges where they `matter` or take few statements."""
    document = program_text(found.program, meta, found.constraints, found.folded, found.edges, hole_features(found.program))
    return {"program.json": document, **texts_of(found.program, found.parameters, found.folded, segments, found.edges, matter, deadline)}


def _keep(named: Delivered) -> FinishedProgram:
    """What has its texts already, as it is."""
    parameters = parametrise(named.program, named.constraints, named.program, named.folded, named.values)
    parameters = with_edge_sizes(parameters, named.edges)
    notes = feature_notes(named.program, named.labels, named.folded)
    parameters = replace(parameters, notes=notes, labels=named.labels)
    return FinishedProgram(named.program, named.constraints, parameters, named.folded, named.edges)


def _named(found: FinishedProgram, name: str) -> NamedFeatures:
    return NamedFeatures.of(name, found.program, found.edges, found.labels)


def _write(texts: Mapping[str, str], folder: Path) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _write_front(front: Sequence[Choice], picked: Program, meta: Meta, folder: Path) -> None:
    """Cutters do not overshoot in front.json: they do where a choice is exported."""
    number = next((i for i, choice in enumerate(front, 1) if choice.program == picked), None)
    choices = [Choice(round_program(choice.program), choice.error) for choice in front]
    (folder / "front.json").write_text(front_text(choices, meta, number), encoding="utf-8")


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _volumes(folder: Path, target: Target, delivered: Manifold) -> dict[str, float]:
    """Volumes of the target, where it has one, and of the delivered files, re-read."""
    volumes = {"target": float(target.mesh.volume)} if target.mesh is not None and target.is_solid else {}
    mesh = mesh_to_manifold(trimesh.load_mesh(folder / "mesh.stl"))
    return {**volumes, "program.scad": delivered.volume(), "mesh.stl": mesh.volume()}


@contextmanager
def _time(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = time.perf_counter() - start
