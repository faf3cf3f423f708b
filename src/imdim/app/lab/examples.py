"""Parts to try the lab with, made where they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine as Join
from imdim.program.tree import Primitive, Program, combine_all
from imdim.target.target import Target, sample_surface, target_from

POINTS = 8192
NOISE = 0.002  # of the diagonal
SEED = 0  # every person sees the same cloud


def _bracket() -> Program:
    """A plate with a boss that is bored through, and four holes at its corners."""
    body = Join("union", Primitive("box", (80.0, 50.0, 8.0)), Primitive("cylinder", (14.0, 24.0), (0.0, 0.0, 8.0)))
    holes: list[Program] = [Primitive("cylinder", (3.0, 20.0), (x, y, 0.0)) for x in (-30.0, 30.0) for y in (-17.0, 17.0)]
    return Join("difference", Join("difference", body, combine_all("union", holes)), Primitive("cylinder", (8.0, 60.0)))


def _flange() -> Program:
    """A disc with six holes on a circle, and a conical neck."""
    body = Join("union", Primitive("cylinder", (40.0, 8.0)), Primitive("cone", (22.0, 14.0, 20.0), (0.0, 0.0, 14.0)))
    turns = np.radians(np.arange(6) * 60.0)
    at = [(30.0 * float(np.cos(t)), 30.0 * float(np.sin(t)), 0.0) for t in turns]
    holes: list[Program] = [Primitive("cylinder", (3.5, 20.0), place) for place in at]
    return Join("difference", Join("difference", body, combine_all("union", holes)), Primitive("cylinder", (9.0, 80.0)))


def _knob() -> Program:
    """A ball on a shaft, flattened, with a groove and a bore."""
    ball = Join("intersection", Primitive("sphere", (20.0,)), Primitive("box", (60.0, 60.0, 30.0)))
    body = Join("union", ball, Primitive("cylinder", (8.0, 30.0), (0.0, 0.0, -25.0)))
    grooved = Join("difference", body, Primitive("torus", (20.0, 3.0)))
    return Join("difference", grooved, Primitive("cylinder", (4.0, 30.0), (0.0, 0.0, -30.0)))


def _lever() -> Program:
    """A drawn arm, two rounded ends joined by straight tangents, with a slot, a hub at the thick end and a hole at the thin one."""
    (large, small), reach = (20.0, 10.0), 60.0
    lean = float(np.arccos((large - small) / reach))  # of the radii to where the tangents touch
    touch = [(at + r * float(np.cos(lean)), r * float(np.sin(lean))) for at, r in ((0.0, large), (reach, small))]
    (x0, y0), (x1, y1) = touch
    rim = ((x0, -y0, 0.0), (x1, -y1, float(np.tan(lean / 2))), (x1, y1, 0.0), (x0, y0, float(np.tan((np.pi - lean) / 2))))
    slot = ((24.0, -4.0, 0.0), (42.0, -4.0, 1.0), (42.0, 4.0, 0.0), (24.0, 4.0, 1.0))
    arm = Primitive("extrude", (8.0,), outline=Outline((rim, slot, circle(4.0, reach))))
    hub = Primitive("cylinder", (14.0, 12.0), (0.0, 0.0, 9.0))
    return Join("difference", Join("union", arm, hub), Primitive("cylinder", (8.0, 60.0)))


PROGRAMS: Mapping[str, Callable[[], Program]] = {"Bracket": _bracket, "Flange": _flange, "Knob": _knob, "Lever": _lever}
NAMES = (*PROGRAMS, "Bracket, scanned")


def example(name: str) -> Target:
    """The target of that name; "scanned" makes it a noisy cloud without normals. Raises KeyError."""
    plain = name.removesuffix(", scanned")
    mesh = to_trimesh(to_manifold(PROGRAMS[plain]()))
    if plain == name:
        return target_from(mesh, name)
    rng = np.random.default_rng(SEED)
    points, _ = sample_surface(mesh.vertices, mesh.faces, POINTS, rng)
    return target_from(points + rng.normal(0.0, NOISE * mesh.scale, points.shape), name)
