"""The Python way in: a file, points or a mesh reconstructed in one call, and all that can be done with the result.

Names, edge features and repeats are of a finished program, so texts and files are methods of the result and not of the bare program.
"""

from __future__ import annotations

import html
import os
import sys
import tempfile
import webbrowser
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.deadline import NEVER
from imdim.delivery import first_run
from imdim.delivery.deliver import RunRecord, check_untouched, compose_texts, deliver
from imdim.delivery.finish import FinishedProgram, finish
from imdim.detection.noise import MeasuredNoise
from imdim.export.edge_text import do_edges_matter
from imdim.export.step_limit import STEP_LIMIT_S
from imdim.export.step_worker import finish_step, start_step, stop_step
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import join_touching, to_manifold, to_trimesh
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature
from imdim.program.front import Choice
from imdim.program.tree import Program
from imdim.reconstruction import pipeline
from imdim.reconstruction.config import Settings, check
from imdim.reconstruction.edge_features import MeasuredSizes
from imdim.target.placement import place
from imdim.target.target import Target, frame_meta, load_target, target_from

PAGE_HEIGHT = 640  # pixels of the page in a notebook


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction:
    """What was found for `target`, in its units.

    `constraints` hold for `program`, and `edges` are fillets and chamfers of it. `front` holds programs from crude to exact, `error`,
    `stop`, `proof`, `notes`, `noisy`, `noise` and `edge_sizes` are as a `pipeline.Snapshot`'s. `stages` are seconds.
    """

    target: Target
    program: Program
    edges: tuple[EdgeFeature, ...]
    constraints: tuple[Constraint, ...]
    front: tuple[Choice, ...]
    error: float
    stop: str
    proof: str
    notes: tuple[str, ...]
    settings: Settings
    seed: int
    stages: Mapping[str, float]
    noisy: bool = False
    noise: MeasuredNoise | None = None
    edge_sizes: tuple[MeasuredSizes, ...] = ()

    def __repr__(self) -> str:
        return f"<{self.target.name}: {count(self.program)}, error {self.error:.3g}, {sum(self.stages.values()):.1f} s ({self.stop})>"

    def _repr_html_(self) -> str:
        """The page of `show` for a notebook, in a frame that may run its scripts and nothing else."""
        page = html.escape(self._page, quote=True)
        return f'<iframe srcdoc="{page}" sandbox="allow-scripts" style="width:100%;height:{PAGE_HEIGHT}px;border:0"></iframe>'

    def save(self, folder: str | Path, step_limit_s: float = STEP_LIMIT_S, force: bool = False) -> dict[str, Any]:
        """Write all results into `folder`, whole or not at all; returns the report, which is report.json there.

        STEP is skipped, and the report says why, where OpenCASCADE is missing, fails or takes longer than `step_limit_s`.
        Raises OutputError when the folder cannot be written, holds files that are no results, or, unless told to `force`, earlier results
        that somebody has changed.
        """
        if not force:
            check_untouched(Path(folder))
        name = self.settings.input or self.target.name
        run = RunRecord(name, self.stages, self.stop, self.seed, asdict(self.settings), self.proof, self.noisy, self.noise, self.edge_sizes)
        target = replace(self.target, notes=(*self.target.notes, *self.notes))
        rest = {"constraints": self.constraints, "front": self.front, "edges": self.edges}
        return deliver(self.program, target, Path(folder), run, self.settings.segments, step_limit_s, **rest)

    def show(self) -> Path:
        """Open the page in the browser: target and result in 3D, the program, all numbers. Returns its path, in a temporary folder."""
        path = Path(tempfile.mkdtemp(prefix="imdim-")) / "report.html"
        path.write_text(self._page, encoding="utf-8")
        webbrowser.open(path.as_uri())
        return path

    def to_json(self) -> str:
        """program.json: the program, its repeats, relations and edges."""
        return self._texts["program.json"]

    def to_openscad(self) -> str:
        """The program for OpenSCAD, with named parameters."""
        return self._texts["program.scad"]

    def to_build123d(self) -> str:
        """The program as a build123d script, with named parameters."""
        return self._texts["program.py"]

    def to_cadquery(self) -> str:
        """The program as a CadQuery script, with named parameters."""
        return self._texts["program.cq.py"]

    def to_freecad(self) -> str:
        """The program as a FreeCAD macro, with a spreadsheet of named parameters."""
        return self._texts["program.FCMacro"]

    def to_step(self, path: str | Path, limit_s: float = 60.0) -> Path:
        """Write a STEP file with analytic faces, in mm; returns its path.

        Raises StepError where OpenCASCADE is not installed, fails, or takes longer than `limit_s`, OSError where `path` cannot be written.
        """
        path = Path(path)
        with tempfile.TemporaryDirectory(prefix=".imdim-", dir=path.absolute().parent) as folder:
            document, written = Path(folder, "program.json"), Path(folder, "program.step")
            document.write_text(self.to_json(), encoding="utf-8")
            job = start_step(document, written, Path(self.target.name).stem)
            try:
                finish_step(job, NEVER.ahead(limit_s))
            finally:
                stop_step(job)
            os.replace(written, path)
        return path

    def to_trimesh(self) -> trimesh.Trimesh:
        """The exact solid as a closed mesh."""
        return to_trimesh(self._solid)

    @cached_property
    def _finished(self) -> FinishedProgram:
        return finish(self.program, self.constraints, edges=self.edges)

    @cached_property
    def _solid(self) -> Manifold:
        return solid_with_edges(self._finished.program, self._finished.edges, self.settings.segments, join_touching)

    @cached_property
    def _texts(self) -> dict[str, str]:
        segments, found = self.settings.segments, self._finished
        volumes = to_manifold(found.program, segments).volume(), self._solid.volume()
        return compose_texts(found, frame_meta(self.target), segments, do_edges_matter(*volumes))

    @cached_property
    def _page(self) -> str:
        with tempfile.TemporaryDirectory() as folder:
            results = Path(folder, "results")
            self.save(results, step_limit_s=0.0)
            return (results / "report.html").read_text(encoding="utf-8")


def reconstruct(
    part: str | os.PathLike[str] | np.ndarray | trimesh.Trimesh | Target, settings: Settings | None = None, seed: int | None = None
) -> Reconstruction:
    """Reconstruct a file (see `readers.FORMATS`), points [n, 3], points with normals [n, 6], or a trimesh.

    `seed`, where given, goes before that of the `settings`. The first call on a machine compiles before the budget starts, and says so on
    stderr. Where the `settings` say what lengths are (`units`), they become millimetres, those of the result's `target` too. Raises
    InputError, one line, for a part that cannot be used, and ConfigError for settings that cannot.
    """
    settings = check(settings or Settings())
    seed = settings.seed if seed is None else seed
    if isinstance(part, str | os.PathLike):
        part = os.fspath(part)
        settings, target = replace(settings, input=part), load_target(part)
    else:
        target = part if isinstance(part, Target) else target_from(part)
    target = place(target, settings.units, settings.origin)
    stages: dict[str, float] = {}
    first_run.compile_kernels(sys.stderr, cloud=target.mesh is None)
    last = pipeline.exhaust(pipeline.reconstruct(target, settings, np.random.default_rng(seed)), stages)
    found = (last.program, last.edges, last.constraints, last.front, last.error, last.stop or "finished", last.proof, last.notes)
    known = {"noisy": last.noisy, "noise": last.noise, "edge_sizes": last.edge_sizes}
    return Reconstruction(target, *found, settings=settings, seed=seed, stages=stages, **known)
