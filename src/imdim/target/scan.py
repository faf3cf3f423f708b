"""Simulated scans: a mesh sampled under a named condition, with a fixed seed, as benchmarks and examples need it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from imdim.geometry.crossings import sort_columns
from imdim.target.target import sample_surface

POINTS = 8192
FAR_AWAY = 1000.0  # diagonals
SAID, MEASURED = ("cloud", "normals", "scanners"), ("noise", "outliers", "views", "points")  # words of conditions
# unit, from the part to the scanner: each but the first three as far as may be from those before it
VIEWS = np.array(
    [
        (0.48, 0.60, 0.64),
        (-0.80, 0.36, 0.48),
        (0.28, -0.72, -0.64),
        (-0.07, 0.70, -0.71),
        (0.08, -0.68, 0.72),
        (-0.81, -0.25, -0.53),
        (0.93, 0.18, -0.33),
        (-0.21, 0.97, 0.15),
        (-0.77, -0.56, 0.32),
        (0.81, -0.57, 0.15),
        (-0.09, 0.10, 0.99),
        (-0.13, -0.11, -0.99),
    ]
)
VIEWS /= np.linalg.norm(VIEWS, axis=1, keepdims=True)


@dataclass(frozen=True)
class Condition:
    """How a part is seen: `noise` is a standard deviation relative to the box diagonal, `outliers` a share of the points,
    `views` the number of sides it is seen from (0: all around), `scanners` whether the cloud says from where, `points` how many it has."""

    normals: bool = False
    noise: float = 0.0
    outliers: float = 0.0
    views: int = 0
    scanners: bool = False
    points: int = POINTS


def parse_condition(text: str) -> Condition | None:
    """``mesh`` (None), or ``cloud`` and what spoils or helps it, joined by +: ``cloud+normals``, ``noise=0.5%``, ``views=3+scanners`` or
    ``points=20000``.

    Raises ValueError that names the unknown word.
    """
    if text == "mesh":
        return None
    found: dict[str, float] = {}
    for word in text.split("+"):
        key, _, value = word.partition("=")
        if key not in (*SAID, *MEASURED) or bool(value) != (key in MEASURED):
            raise ValueError(
                f"unknown condition {word!r} in {text!r}: "
                "mesh, or cloud, normals, noise=0.5%, outliers=2%, views=1, scanners, points=20000 joined by +"
            )
        found[key] = float(value.removesuffix("%")) / 100 if value.endswith("%") else float(value or 1)
    views = int(found.get("views", 0))
    if not 0 <= views <= len(VIEWS):
        raise ValueError(f"condition {text!r}: views must be 0 to {len(VIEWS)}, got {views}")
    if "scanners" in found and not views:
        raise ValueError(f"condition {text!r}: what is seen all around has no scanners, give views=1 to {len(VIEWS)}")
    points = int(found.get("points", POINTS))
    if points < 1:
        raise ValueError(f"condition {text!r}: points must be 1 or more, got {points}")
    return Condition("normals" in found, found.get("noise", 0.0), found.get("outliers", 0.0), views, "scanners" in found, points)


def place_scanners(mesh: trimesh.Trimesh, views: int) -> np.ndarray:
    """Where the scanners [views, 3] of a mesh stand: so far away that their rays are parallel."""
    return mesh.bounds.mean(0) + FAR_AWAY * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))) * VIEWS[:views]


def scan(
    mesh: trimesh.Trimesh, condition: Condition, rng: np.random.Generator, count: int | None = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Points [count, 3] on the mesh, spoilt as `condition` says, and the normals of their true faces [count, 3] or None.

    There are as many as it says unless a `count` is given.

    Noise is isotropic and Gaussian; outliers are uniform in the box grown by a tenth, with random normals.
    """
    count = condition.points if count is None else count
    points, normals = _sample_visible(mesh, condition.views, rng, count)
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    points = points + rng.normal(0.0, condition.noise * diagonal, points.shape) if condition.noise else points
    wrong = rng.permutation(count)[: round(condition.outliers * count)]
    low, high = (np.asarray(v) for v in mesh.bounds)
    grow = 0.1 * (high - low)
    points[wrong] = rng.uniform(low - grow, high + grow, (len(wrong), 3))
    random = rng.normal(size=(len(wrong), 3))
    normals[wrong] = random / np.linalg.norm(random, axis=1, keepdims=True)
    return points, normals if condition.normals else None


def _sample_visible(mesh: trimesh.Trimesh, views: int, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples that at least one of the first `views` directions sees unobstructed."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not views:
        return sample_surface(vertices, faces, count, rng)
    points, normals = sample_surface(vertices, faces, 16 * count, rng)
    start = points + normals * (1e-4 * np.linalg.norm(np.ptp(vertices, axis=0)))
    seen = np.zeros(len(points), bool)
    for direction in VIEWS[:views]:
        facing = np.flatnonzero(~seen & (normals @ direction > 0.05))
        seen[facing] = sort_columns(vertices[faces], direction).count_above(start[facing]) == 0
    found = rng.permutation(np.flatnonzero(seen))[:count]
    if len(found) < count:
        raise ValueError(f"only {len(found)} of {len(points)} samples are seen from {views} sides, {count} are needed")
    return points[found], normals[found]
