"""The only scoring path: a program or a delivered file against its target, by exact booleans and exact surface distances.

Nothing here is shared with the optimiser: volumes come from manifold3d, distances from a triangle tree over the exact result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.export.openscad_reader import read_openscad
from imdim.geometry.metrics import diagonal, nearest_distances
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import SEGMENTS, mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.geometry.triangles import distances, triangle_tree
from imdim.program.tree import Program, leaves
from imdim.target.target import Target

SAMPLES = 20_000
ONE_SOLID = 5e-10  # of the volume IoU, which is told with nine decimals


@dataclass(frozen=True)
class Distances:
    """Mean and maximum of the unsigned distances in one direction, in model units; both infinite when the result is empty."""

    mean: float
    max: float


@dataclass(frozen=True)
class Scores:
    """How well a result explains a target.

    `volume_iou` is None when the target bounds no solid, and `iou_missing` then says why. `to_result` goes from the target's surface
    (or cloud) to the result's surface, `to_target` back; for a cloud, the latter cannot be below the spacing of its points.
    `diagonal` is that of the target's box, in model units. `primitives` and `operations` are None for a mesh.
    """

    volume_iou: float | None
    iou_missing: str | None
    to_result: Distances
    to_target: Distances
    diagonal: float
    primitives: int | None = None

    @property
    def operations(self) -> int | None:
        return None if self.primitives is None else self.primitives - 1

    def relative(self, distances: Distances) -> Distances:
        """The same distances as fractions of the target's diagonal."""
        return Distances(distances.mean / self.diagonal, distances.max / self.diagonal)


@dataclass(frozen=True)
class DeliveryLoss:
    """What delivery kept of the program that was found: that program's volume IoU with the target, None where the target bounds no solid,
    and with the program delivered."""

    found: float | None
    delivered: float

    @staticmethod
    def of(found: Program, delivered: Manifold, target: Target, segments: int = SEGMENTS, scored: float | None = None) -> DeliveryLoss:
        """By exact booleans; `scored` is the volume IoU of what is delivered with the target, where that is known."""
        solid = to_manifold(found, segments)
        kept = volume_iou(solid, delivered)
        # one less an IoU is a distance between solids: two that are one miss the target, which has the most faces, by as much
        known = scored is not None and 1 - kept < ONE_SOLID
        return DeliveryLoss(scored if known else target_iou(solid, target)[0], kept)


def evaluate(program: Program, target: Target, samples: int = SAMPLES, segments: int = SEGMENTS) -> Scores:
    """Scores of `program` against `target`: distances from `samples` points each way (and the corners, for the maxima)."""
    count = sum(1 for _ in leaves(program))
    return evaluate_solid(to_manifold(program, segments), target, samples, count)


def evaluate_file(path: Path, target: Target, samples: int = SAMPLES, segments: int = SEGMENTS) -> Scores:
    """Scores of a delivered `.scad` file, or of a mesh file, re-read from disk.

    Raises ValueError when the file holds no program that `read_openscad` reads, or no closed mesh; OSError when it cannot be read.
    """
    if path.suffix == ".scad":
        solid, count = read_solid(path, segments)
        return evaluate_solid(solid, target, samples, count)
    return evaluate_solid(mesh_to_manifold(trimesh.load_mesh(path)), target, samples)


def read_solid(path: Path, segments: int = SEGMENTS) -> tuple[Manifold, int]:
    """The solid of a delivered `.scad` file with its blends, and how many primitives it has without them."""
    text = path.read_text(encoding="utf-8")
    return to_manifold(read_openscad(text, blended=True), segments), sum(1 for _ in leaves(read_openscad(text)))


def evaluate_solid(solid: Manifold, target: Target, samples: int = SAMPLES, primitives: int | None = None) -> Scores:
    """Scores of an exact solid of `primitives` primitives, joined by one operation fewer."""
    iou, missing = target_iou(solid, target)
    surface = to_trimesh(solid)
    length = diagonal(target.points if target.mesh is None else target.mesh.vertices)
    if not len(surface.faces):
        nowhere = Distances(math.inf, math.inf)
        return Scores(iou, missing, nowhere, nowhere, length, primitives)
    to_result = _summary(*target_distances(target, surface, samples)[1:])
    to_target = _summary(*_result_distances(surface, target, samples))
    return Scores(iou, missing, to_result, to_target, length, primitives)


def target_distances(target: Target, surface: trimesh.Trimesh, samples: int = SAMPLES) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points [n, 3] spread over the target (or of its cloud), their distances [n] to `surface`, and those [m] of the target's corners."""
    tree = triangle_tree(surface)
    if target.mesh is None:
        points = subsample(target.points, samples)
        return points, distances(tree, points), np.empty(0)
    points = trimesh.sample.sample_surface(target.mesh, samples, seed=0)[0]
    return points, distances(tree, points), distances(tree, subsample(np.asarray(target.mesh.vertices), samples))


def _result_distances(surface: trimesh.Trimesh, target: Target, samples: int) -> tuple[np.ndarray, np.ndarray]:
    points = trimesh.sample.sample_surface(surface, samples, seed=1)[0]
    corners = subsample(np.asarray(surface.vertices), samples)
    if target.mesh is None:
        return nearest_distances(points, target.points), nearest_distances(corners, target.points)
    tree = triangle_tree(target.mesh)
    return distances(tree, points), distances(tree, corners)


def target_iou(solid: Manifold, target: Target) -> tuple[float | None, str | None]:
    """Volume IoU with the target's solid; None, and why, where it bounds none."""
    if target.mesh is None:
        return None, "the target is a cloud"
    if not target.is_solid:
        return None, "the target's mesh is not closed"
    try:
        return volume_iou(solid, mesh_to_manifold(target.mesh)), None
    except ValueError as error:
        return None, str(error)


def _summary(spread: np.ndarray, corners: np.ndarray) -> Distances:
    return Distances(float(spread.mean()), float(max(spread.max(), corners.max(initial=0.0))))
