"""Inside or outside from a cloud's carrier surfaces, without oriented normals: parity of crossings that points bear out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.surface import SURFACE_KINDS, Patch
from imdim.seeding.cloud_kernels import pack
from imdim.seeding.cloud_rays import build_grid, parity_votes, sides_of


@dataclass
class OccupancyConfig:
    lines: int = 12  # per query
    reach: float = 2.0  # spacings within which a point bears out a crossing: a Poisson process misses it once in 300,000
    band: float = 2e-4  # of the diagonal: points nearer to a carrier lie on no side of it


def inside_probability(patches: list[Patch], points: np.ndarray, queries: np.ndarray, config: OccupancyConfig | None = None) -> np.ndarray:
    """Probability [m] that each of `queries` [m, 3] lies inside the solid that the cloud `points` [n, 3] samples.

    Lines through the query are cut with the carriers where the patches' points support a crossing; both halves of a line
    must agree, and the lines vote. Points of no patch are ignored.
    """
    config = config or OccupancyConfig()
    queries = np.ascontiguousarray(queries, dtype=float)
    if not patches:
        return np.zeros(len(queries))
    scene = _Scene.of(patches, np.asarray(points, float), config)
    votes = scene.votes(queries, config.lines)
    return _probability(votes, config.lines)


def _probability(votes: np.ndarray, lines: int) -> np.ndarray:
    agreed = votes[:, 1]
    sure = (votes[:, 0] + 0.25) / (agreed + 0.5)
    loose = votes[:, 2] / (2 * lines)
    return np.where(agreed > 0, sure, loose)


@dataclass(frozen=True)
class _Scene:
    """What the compiled kernels read."""

    cloud: tuple
    grid: tuple
    boxes: tuple[np.ndarray, np.ndarray]
    reach: float

    @staticmethod
    def of(patches: list[Patch], points: np.ndarray, config: OccupancyConfig) -> _Scene:
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
        spacing = math.sqrt(sum(p.area for p in patches) / max(sum(len(p.points) for p in patches), 1))
        reach = config.reach * spacing
        kinds = np.array([SURFACE_KINDS.index(p.surface.kind) for p in patches])
        rows = np.array([pack(p.surface) for p in patches])
        owned = np.ascontiguousarray(np.vstack([p.points for p in patches]))
        owner = np.repeat(np.arange(len(patches)), [len(p.points) for p in patches])
        side = sides_of(owned, kinds, rows, config.band * diagonal)
        low = owned.min(0) - 1e-9 * diagonal
        cell = max(reach, diagonal / 150)
        shape = np.maximum(np.ceil((owned.max(0) - low) / cell).astype(np.int64), 1)
        starts, order = build_grid(owned, low, cell, shape)
        boxes = np.array([p.points.min(0) - reach for p in patches]), np.array([p.points.max(0) + reach for p in patches])
        return _Scene((kinds, rows, owned, owner, side), (starts, order, low, cell, shape), boxes, reach)

    def votes(self, queries: np.ndarray, lines: int) -> np.ndarray:
        return parity_votes(queries, _directions(), lines, self.boxes, self.cloud, self.grid, self.reach)


def _directions(count: int = 61) -> np.ndarray:
    """A Fibonacci half sphere, turned away from the coordinate planes."""
    i = np.arange(count) + 0.5
    z, turn = i / count, math.pi * (1 + math.sqrt(5)) * i
    side = np.sqrt(1 - z * z)
    even = np.column_stack([side * np.cos(turn), side * np.sin(turn), z])
    tilt = np.linalg.qr(np.array([[1.0, 0.31, -0.17], [-0.23, 1.0, 0.41], [0.37, -0.29, 1.0]]))[0]
    # neighbours in the list are far apart on the sphere
    return np.ascontiguousarray((even @ tilt)[(np.arange(count) * 23) % count])
