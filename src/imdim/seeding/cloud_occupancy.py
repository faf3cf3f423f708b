"""Inside or outside from a cloud's carrier surfaces, without oriented normals: parity of crossings that points bear out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.surface import SURFACE_KINDS, Patch
from imdim.geometry.surface import normals as surface_normals
from imdim.seeding.cloud_kernels import pack
from imdim.seeding.cloud_rays import build_grid, parity_votes, presence, sides_of


@dataclass
class OccupancyConfig:
    lines: int = 12  # per query
    pure: tuple[float, float] = (0.92, 0.97)  # a cell of the carriers' arrangement this unanimous begins to, and does, speak for all in it
    outward_lines: int = 6  # per side of a point when patches are oriented
    lift: float = 0.15  # spacings from a point to its probes on either side
    reach: float = 1.5  # spacings within which a point bears out a crossing: a Poisson process misses it once in 1,200
    presence: int = 2  # reaches within which a carrier's points let it bound other faces
    merge: float = 0.2  # spacings within which tangent carriers count as one place
    band: float = 2e-4  # of the diagonal: points nearer to a carrier lie on no side of it


def inside_probability(patches: list[Patch], points: np.ndarray, queries: np.ndarray, config: OccupancyConfig | None = None) -> np.ndarray:
    """Probability [m] that each of `queries` [m, 3] lies inside the solid that the cloud `points` [n, 3] samples.

    Lines through the query are cut with the carriers where the patches' points support a crossing; both halves of a line
    must agree, and the lines vote. Queries on the same side of every carrier share their votes where these are nearly
    unanimous; where they are not, a face between them has no carrier. Points of no patch are ignored.
    """
    config = config or OccupancyConfig()
    queries = np.ascontiguousarray(queries, dtype=float)
    if not patches:
        return np.zeros(len(queries))
    scene = _Scene.of(patches, np.asarray(points, float), config)
    votes = scene.votes(queries, config.lines)
    single = _probability(votes, config.lines)
    mean = _pooled(scene, queries, single, votes[:, 1])
    follow = np.interp(np.maximum(mean, 1 - mean), config.pure, (0.0, 1.0))
    return single + follow * (mean - single)


def _probability(votes: np.ndarray, lines: int) -> np.ndarray:
    agreed = votes[:, 1]
    sure = (votes[:, 0] + 0.25) / (agreed + 0.5)
    loose = votes[:, 2] / (2 * lines)
    return np.where(agreed > 0, sure, loose)


def _pooled(scene: _Scene, queries: np.ndarray, single: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Mean over the queries with the same sides of all carriers, weighted by the lines that agreed."""
    kinds, rows = scene.cloud[0], scene.cloud[1]
    sides = np.packbits(sides_of(queries, kinds, rows, 0.0) > 0, axis=1)
    _, cell = np.unique(sides, axis=0, return_inverse=True)
    cell = cell.ravel()
    total = np.bincount(cell, weight + 1e-6)
    return (np.bincount(cell, (weight + 1e-6) * single) / total)[cell]


def orient(patches: list[Patch], points: np.ndarray, config: OccupancyConfig | None = None) -> list[Patch]:
    """The patches with `outward` filled in; a carrier that shows both sides becomes two patches.

    Each point asks on both of its sides; neighbours on the patch smooth the answers.
    """
    config = config or OccupancyConfig()
    if not patches:
        return []
    scene = _Scene.of(patches, np.asarray(points, float), config)
    normals = np.vstack([surface_normals(p.surface, p.points) for p in patches])
    step = config.lift * scene.spacing * normals
    owned = scene.cloud[2]
    below, above = (_probability(scene.votes(owned + s, config.outward_lines), config.outward_lines) for s in (-step, step))
    ends = np.cumsum([len(p.points) for p in patches])
    out: list[Patch] = []
    for patch, lean in zip(patches, np.split(below - above, ends[:-1]), strict=True):
        out += _split(patch, lean)
    return out


def _split(patch: Patch, lean: np.ndarray, least: int = 9) -> list[Patch]:
    near = KDTree(patch.points).query(patch.points, k=min(9, len(patch.points)))[1].reshape(len(patch.points), -1)
    smooth = lean[near].mean(1)
    parts = {+1: smooth > 0.2, -1: smooth < -0.2}
    counts = {sign: int(part.sum()) for sign, part in parts.items()}
    if min(counts.values()) >= max(least, 0.03 * len(smooth)):
        return [
            replace(patch, points=patch.points[on], area=patch.area * on.mean(), outward=s)
            for s, on in ((1, smooth > 0), (-1, smooth <= 0))
        ]
    sign = max(counts, key=lambda s: counts[s])
    return [replace(patch, outward=sign if counts[sign] > 0.5 * len(smooth) else 0)]


@dataclass(frozen=True)
class _Scene:
    """What the compiled kernels read."""

    cloud: tuple
    grid: tuple
    boxes: tuple[np.ndarray, np.ndarray]
    reach: float
    merge: float
    spacing: float

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
        cell = max(reach, diagonal / 80)
        shape = np.maximum(np.ceil((owned.max(0) - low) / cell).astype(np.int64), 1)
        starts, order = build_grid(owned, low, cell, shape)
        marks = presence(owned, owner, low, cell, shape, len(kinds), config.presence)
        boxes = np.array([p.points.min(0) - reach for p in patches]), np.array([p.points.max(0) + reach for p in patches])
        return _Scene(
            (kinds, rows, owned, owner, side), (starts, order, low, cell, shape, marks), boxes, reach, config.merge * spacing, spacing
        )

    def votes(self, queries: np.ndarray, lines: int) -> np.ndarray:
        return parity_votes(queries, _directions(), lines, self.boxes, self.cloud, self.grid, self.reach, self.merge)


def _directions(count: int = 61) -> np.ndarray:
    """A Fibonacci half sphere, turned away from the coordinate planes."""
    i = np.arange(count) + 0.5
    z, turn = i / count, math.pi * (1 + math.sqrt(5)) * i
    side = np.sqrt(1 - z * z)
    even = np.column_stack([side * np.cos(turn), side * np.sin(turn), z])
    tilt = np.linalg.qr(np.array([[1.0, 0.31, -0.17], [-0.23, 1.0, 0.41], [0.37, -0.29, 1.0]]))[0]
    # neighbours in the list are far apart on the sphere
    return np.ascontiguousarray((even @ tilt)[(np.arange(count) * 23) % count])
