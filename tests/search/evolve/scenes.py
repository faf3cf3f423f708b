"""Scenes of planted parts: their families, samples labelled by the program itself, and points of its exact surface."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
from tests.planted import PARTS, mesh_of
from tests.search.planted_families import arrangement_of

from imdim.geometry import kernels
from imdim.program.tree import Program
from imdim.search.candidate_families import Families
from imdim.search.cells import compress_samples, label_samples
from imdim.search.evolve.scene import Scene
from imdim.search.front.fitness import FitnessConfig, SampledTarget, Scorer


def scene_of(program: Program, count: int = 20_000, detected: bool = True) -> Scene:
    arrangement = arrangement_of(program)
    samples = label_samples(arrangement, lambda p: kernels.inside(program, p).astype(float), count, np.random.default_rng(7))
    mesh = mesh_of(program)
    surface = trimesh.sample.sample_surface(mesh, 1000, seed=3)[0]
    evidence = SampledTarget(surface, float(mesh.area), samples.points, samples.w_in, samples.w_out)
    families = Families(arrangement, compress_samples(arrangement, samples)) if detected else None
    return Scene(Scorer(evidence, FitnessConfig(capacity=512)), arrangement.outer, families)


@cache
def planted_scene(name: str) -> Scene:
    return scene_of(PARTS[name])
