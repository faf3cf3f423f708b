"""New primitives for operators: where the program is wrong, from the detected surfaces or at random."""

from __future__ import annotations

import math

import numpy as np

from imdim.geometry import kernels
from imdim.program.tree import OPS, Combine, Primitive, Program, Vec3
from imdim.search.evolve.insertion import random_candidate
from imdim.search.evolve.scene import Scene

KINDS = ("box", "sphere", "cylinder", "cone", "torus")
MOST_RANDOM = 6  # primitives of a random program
DETECTED = 0.7  # share of proposals that come from detected surfaces, where there are any


def propose(program: Program, scene: Scene, rng: np.random.Generator) -> Primitive | None:
    """A primitive that holds a point at which `program` is wrong (any point where none is known)."""
    point = scene.wrong_point(program, rng)
    if point is None:
        point = rng.uniform(*scene.bounds)
    if scene.families is not None and rng.random() < DETECTED:
        candidate = random_candidate(scene, point, rng)
        primitive = scene.families.primitive(candidate) if candidate else None
        return primitive if primitive and scene.holds(primitive) else None
    return _random(point, _scale(program, point, scene, rng), scene, rng)


def random_programs(scene: Scene, count: int, rng: np.random.Generator) -> list[Program]:
    """Random trees of up to MOST_RANDOM random primitives: the seeds that others are measured against."""
    out: list[Program] = []
    while len(out) < count:
        program: Program | None = None
        for _ in range(int(rng.integers(1, MOST_RANDOM + 1))):
            primitive = _random(rng.uniform(*scene.bounds), scene.diagonal * 0.5 ** rng.uniform(1, 4), scene, rng)
            if primitive:
                program = Combine(OPS[rng.integers(len(OPS))], program, primitive) if program else primitive
        out += [program] if program else []
    return out


def _scale(program: Program, point: np.ndarray, scene: Scene, rng: np.random.Generator) -> float:
    """The size of the error around a point: the distance to the program's surface, with a spread of an octave."""
    distance = abs(float(kernels.program_sdf(program, point[None])[0]))
    return float(np.clip(distance * 2 ** rng.uniform(0, 2), 5e-3 * scene.diagonal, 0.5 * scene.diagonal))


def _random(point: np.ndarray, scale: float, scene: Scene, rng: np.random.Generator) -> Primitive | None:
    kind = KINDS[rng.integers(len(KINDS))]
    a, b, c = (scale * 2 ** rng.uniform(-1, 1.5, 3)).tolist()
    size = {"box": (2 * a, 2 * b, 2 * c), "sphere": (a,), "cylinder": (a, 2 * b), "cone": (a, b, 2 * c), "torus": (a + b, min(a, b))}[kind]
    center: Vec3 = tuple((point + rng.normal(0, 0.3 * scale, 3)).tolist())  # type: ignore[assignment]
    primitive = Primitive(kind, size, center, random_rotation(scene, rng))
    return primitive if scene.holds(primitive) else None


def random_rotation(scene: Scene, rng: np.random.Generator) -> Vec3:
    """Mostly one of the orientations that the scene suggests."""
    if rng.random() < 0.9:
        return scene.rotations[rng.integers(len(scene.rotations))]
    u, v, w = rng.uniform(-1, 1, 3)
    return (180.0 * float(u), math.degrees(math.asin(float(v))), 180.0 * float(w))
