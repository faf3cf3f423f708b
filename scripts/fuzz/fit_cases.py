"""The random parts of `fits.py`, what is done to them before a reconstruction, its settings, and what it must lead to."""

from __future__ import annotations

import traceback
import warnings
from dataclasses import dataclass

import numpy as np
import planting
import population_scoring
import trimesh

from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.codec import dumps, loads
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.reconstruction.config import LANGUAGES, ConfigError, Settings
from imdim.reconstruction.pipeline import Snapshot, reconstruct_best
from imdim.target.readers import InputError
from imdim.target.scan import VIEWS, Condition, scan

METHODS = ["auto"] * 12 + ["tree", "policy", "evolve", "stump", "stump-net"]
DENSE = 200_000  # faces at most after a mesh is divided
ELSEWHERE = 3.0  # of the part's diagonal


@dataclass(frozen=True)
class Case:
    """`given` is a mesh, points [n, 3] or points with normals [n, 6] of `part`; `told` says what was drawn."""

    given: trimesh.Trimesh | np.ndarray
    part: trimesh.Trimesh
    settings: Settings
    told: str


def drawn(seed: int, index: int, longest_s: float) -> Case:
    """Case `index` of `seed`, with a budget between 2 s and `longest_s`."""
    rng = np.random.default_rng([seed, index])
    program, of = _program(rng)
    mesh = _placed(to_trimesh(to_manifold(program, int(rng.choice([8, 24, 96])))), rng)
    given, how = _mesh(mesh, rng) if rng.random() < 0.4 else _cloud(mesh, rng)
    settings = Settings(
        seed=int(rng.integers(1000)),
        budget_s=float(rng.uniform(2.0, longest_s)),
        method=str(rng.choice(METHODS)),
        size_weight=float(rng.choice([2.5e-4, 2.5e-4, 2e-3])),
        evolution=bool(rng.random() > 0.1),
        synthesis=bool(rng.random() > 0.1),
        solver=bool(rng.random() > 0.1),
        language=str(rng.choice(LANGUAGES)),
    )
    off = [stage for stage in ("evolution", "synthesis", "solver") if not getattr(settings, stage)]
    return Case(
        given, mesh, settings, f"{of}, {how}, {settings.method} in {settings.language}" + "".join(f" without {stage}" for stage in off)
    )


def tried(case: Case) -> str:
    """What a case leads to, in a line that begins with solid, refused or FOUND."""
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            outcome = looked_at(case, fitted(case))
        return f"FOUND: a warning, {warned[0].message} at {warned[0].filename.rsplit('/', 1)[-1]}:{warned[0].lineno}" if warned else outcome
    except (InputError, ConfigError) as error:
        line = str(error)
        return f"FOUND: a refusal of several lines: {line!r}" if "\n" in line else f"refused: {line}"
    except Exception as error:  # noqa: BLE001 - any other is what this looks for
        at = traceback.extract_tb(error.__traceback__)[-1]
        return f"FOUND: {type(error).__name__}: {error} at {at.filename.rsplit('/', 1)[-1]}:{at.lineno}"


def fitted(case: Case) -> Snapshot:
    return reconstruct_best(case.given, case.settings, case.settings.seed)


def looked_at(case: Case, last: Snapshot) -> str:
    """Whether the answer is a solid near the part that is written and read without a loss, and what it has in common with the part."""
    bounds = case.part.bounds if isinstance(case.given, np.ndarray) else case.given.bounds
    for program in (last.program, *(choice.program for choice in last.front)):
        solid = to_manifold(program)
        if not solid.volume() > 0:
            return f"FOUND: no solid, a volume of {solid.volume():g}"
        box = np.reshape(solid.bounding_box(), (2, 3))
        if np.abs(box - bounds).max() > ELSEWHERE * np.linalg.norm(np.ptp(bounds, axis=0)):
            return f"FOUND: a solid elsewhere, {box.round(3).tolist()} for {bounds.round(3).tolist()}"
        text = dumps(program)
        if dumps(loads(text)) != text:
            return "FOUND: another program after writing and reading"
    same = volume_iou(to_manifold(last.program), mesh_to_manifold(case.part))
    return f"solid: IoU {same:.3f}, {count(last.program).primitives} primitives, error {last.error:.4f}, front of {len(last.front)}"


def _program(rng: np.random.Generator) -> tuple[Program, str]:
    """A part as it may have been designed, or primitives of every kind anywhere."""
    primitives = int(rng.integers(1, 11))
    if rng.random() < 0.6:
        return planting.planted(rng, primitives), f"{primitives} planted"
    while True:
        program = population_scoring.random_tree(rng, primitives)
        if to_manifold(program).volume() > 1e-3:
            return program, f"{primitives} anywhere"


def _placed(mesh: trimesh.Trimesh, rng: np.random.Generator) -> trimesh.Trimesh:
    """Turned at times, in any unit, and at times far from the origin."""
    if rng.random() < 0.3:
        mesh.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    mesh.apply_scale(10.0 ** rng.uniform(-4, 4))
    if rng.random() < 0.3:
        mesh.apply_translation(rng.normal(size=3) * 10.0 ** rng.uniform(0, 3) * mesh.extents.max())
    return mesh


def _mesh(mesh: trimesh.Trimesh, rng: np.random.Generator) -> tuple[trimesh.Trimesh, str]:
    """A mesh as exporters and scanners leave it: whole, with holes, turned faces, shaken corners, torn apart, divided, or twice."""
    spoil = str(rng.choice(["whole", "whole", "holed", "turned", "shaken", "soup", "divided", "twice"]))
    share = float(10.0 ** rng.uniform(-2.5, -0.3))
    faces, vertices = np.array(mesh.faces), np.array(mesh.vertices)
    hit = rng.random(len(faces)) < share
    if spoil == "holed":
        faces = faces[~hit] if not hit.all() else faces
    elif spoil == "turned":
        faces[hit] = faces[hit, ::-1]
    elif spoil == "shaken":
        vertices = vertices + rng.normal(0, 0.03 * share * mesh.scale, vertices.shape)
    elif spoil == "soup":
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    elif spoil == "divided":
        vertices, faces = trimesh.remesh.subdivide_to_size(vertices, faces, mesh.scale / rng.uniform(5, 40), max_iter=20)[:2]
        faces = faces[:DENSE]
    elif spoil == "twice":
        other = vertices + rng.normal(size=3) * mesh.extents * rng.choice([1e-6, 0.3, 2.0])
        vertices, faces = np.vstack([vertices, other]), np.vstack([faces, faces + len(vertices)])
    return trimesh.Trimesh(vertices, faces, process=False), f"mesh {spoil}" + (
        f" {share:.1%}" if spoil in ("holed", "turned", "shaken") else ""
    )


def _cloud(mesh: trimesh.Trimesh, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """A scan: few or many points, with or without normals, noise, outliers, seen from all or from some sides; at times uneven."""
    condition = Condition(
        bool(rng.random() < 0.3),
        float(rng.choice([0.0, 0.001, 0.005, 0.01, 0.03])),
        float(rng.choice([0.0, 0.0, 0.02, 0.2])),
        int(rng.choice([0, 0, *range(1, len(VIEWS) + 1)])),
    )
    count = round(10.0 ** rng.uniform(1.7, 4.5))
    try:
        points, normals = scan(mesh, condition, rng, count)
    except ValueError:  # too little is seen from there
        condition = Condition(condition.normals, condition.noise, condition.outliers, 0)
        points, normals = scan(mesh, condition, rng, count)
    uneven = rng.random() < 0.2
    if uneven:  # as a scanner near one end sees it
        side = (points - points.mean(0)) @ rng.normal(size=3)
        kept = rng.random(len(points)) < 10.0 ** (-2.0 * (side - side.min()) / max(np.ptp(side), 1e-300))
        kept[:50] = True
        points, normals = points[kept], None if normals is None else normals[kept]
    parts = [f"{len(points)} points", f"noise {condition.noise:.1%}", f"outliers {condition.outliers:.0%}"]
    parts += [f"{condition.views} views"] * bool(condition.views) + ["normals"] * condition.normals + ["uneven"] * uneven
    return points if normals is None else np.hstack([points, normals]), "cloud " + " ".join(parts)
