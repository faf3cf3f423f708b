"""Inside or outside from a cloud's carrier surfaces, without oriented normals: parity of crossings that points support."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_kernels import pack
from imdim.detection.cloud_rays import build_grid, parity_votes, presence, sides_of
from imdim.geometry.axes import half_sphere
from imdim.geometry.surface import SURFACE_KINDS, Patch
from imdim.geometry.surface import normals as surface_normals


@dataclass
class OccupancyConfig:
    lines: int = 12  # per query
    enough: int = 4  # votes on a query that are all the same; it takes no more lines then
    parts: int = 24  # of the queries, each spread over all, between looks at the clock
    pure: tuple[float, float] = (0.92, 0.97)  # a cell of the carriers' arrangement this unanimous begins to, and does, speak for all in it
    outward_lines: int = 6  # per side of a point when patches are oriented
    hasty_lines: int = 2  # the same once time is out
    lift: float = 0.15  # spacings from a point to its probes on either side
    reach: float = 1.5  # spacings within which a point supports a crossing: a Poisson process misses it once in 1,200
    presence: int = 2  # reaches within which a carrier's points let it bound other faces
    merge: float = 0.2  # spacings within which tangent carriers count as one place
    band: float = 2e-4  # of the diagonal: points nearer to a carrier lie on no side of it


def inside_probability(
    patches: list[Patch],
    points: np.ndarray,
    queries: np.ndarray,
    config: OccupancyConfig | None = None,
    deadline: Deadline = NEVER,
) -> np.ndarray:
    """Probability [m] that each of `queries` [m, 3] lies inside the solid that the cloud `points` [n, 3] samples.

    Lines through the query are cut with the carriers where the patches' points support a crossing; both halves of a line
    must agree, and the lines vote. Queries on the same side of every carrier share their votes where these are nearly
    unanimous; where they are not, a face between them has no carrier. Points of no patch are ignored.

    Past the `deadline` (by default never) queries without votes follow those on the same sides, or the nearest; some vote always.
    """
    config = config or OccupancyConfig()
    queries = np.ascontiguousarray(queries, dtype=float)
    if not patches or not len(queries):
        return np.zeros(len(queries))
    scene = _Scene.of(patches, np.asarray(points, float), config)
    votes = _ask_queries(scene, queries, config, deadline)
    single = _probability(votes)
    # the mean over the queries with the same sides of all carriers, weighted by the lines that agreed
    cell, weight = _cells(scene, queries), votes[:, 1] + 1e-6
    mean = (np.bincount(cell, weight * single) / np.bincount(cell, weight))[cell]
    follow = np.interp(np.maximum(mean, 1 - mean), config.pure, (0.0, 1.0))
    found = single + follow * (mean - single)
    known = votes[:, 3] > 0
    if not known.all():
        found[~known] = _follow_nearest(queries, cell, found, known)
    return found


def _ask_queries(scene: _Scene, queries: np.ndarray, config: OccupancyConfig, deadline: Deadline) -> np.ndarray:
    """Votes [m, 4] of the queries, part by part while there is time; nought for those that were not asked."""
    votes = np.zeros((len(queries), 4))
    for first in range(min(config.parts, len(queries))):
        if first and deadline.has_passed():
            break
        asked = np.arange(first, len(queries), config.parts)
        votes[asked] = scene.votes(queries[asked], asked, config.lines, config.enough)
    return votes


def _follow_nearest(queries: np.ndarray, cell: np.ndarray, found: np.ndarray, known: np.ndarray) -> np.ndarray:
    """For each query that was not asked the probability of the nearest that was, among those of the same `cell` [m] if there are any."""
    total, sums = np.bincount(cell[known], minlength=cell.max() + 1), np.bincount(cell[known], found[known], minlength=cell.max() + 1)
    asked = total[cell[~known]] > 0
    nearest = np.asarray(KDTree(queries[known]).query(queries[~known][~asked])[1])
    out = (sums / np.maximum(total, 1))[cell[~known]]
    out[~asked] = found[known][nearest]
    return out


def _probability(votes: np.ndarray) -> np.ndarray:
    agreed = votes[:, 1]
    sure = (votes[:, 0] + 0.25) / (agreed + 0.5)
    loose = votes[:, 2] / np.maximum(2 * votes[:, 3], 1)
    return np.where(agreed > 0, sure, loose)


def _cells(scene: _Scene, queries: np.ndarray) -> np.ndarray:
    """Numbers [m] that are equal where queries are on the same side of every carrier."""
    sides = np.packbits(sides_of(queries, scene.cloud[0], scene.cloud[1], 0.0) > 0, axis=1)
    return np.unique(sides, axis=0, return_inverse=True)[1].ravel()


def orient(patches: list[Patch], points: np.ndarray, deadline: Deadline = NEVER) -> list[Patch]:
    """The patches with `outward` filled in; a carrier that shows both sides becomes two patches.

    Each point asks on both of its sides; neighbours on the patch smooth the answers.
    """
    if not patches:
        return []
    config = OccupancyConfig()
    scene = _Scene.of(patches, np.asarray(points, float), config)
    normals = np.vstack([surface_normals(p.surface, p.points) for p in patches])
    step = config.lift * scene.spacing * normals
    owned = scene.cloud[2]
    numbers, lines = np.arange(len(owned)), config.hasty_lines if deadline.has_passed() else config.outward_lines
    below, above = (_probability(scene.votes(owned + s, numbers, lines, lines)) for s in (-step, step))
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

    def votes(self, queries: np.ndarray, numbers: np.ndarray, lines: int, enough: int) -> np.ndarray:
        return parity_votes(queries, numbers, _directions(), lines, enough, self.boxes, self.cloud, self.grid, self.reach, self.merge)


def _directions(count: int = 61) -> np.ndarray:
    """A Fibonacci half sphere, turned away from the coordinate planes."""
    tilt = np.linalg.qr(np.array([[1.0, 0.31, -0.17], [-0.23, 1.0, 0.41], [0.37, -0.29, 1.0]]))[0]
    # neighbours in the list are far apart on the sphere
    return np.ascontiguousarray((half_sphere(count) @ tilt)[(np.arange(count) * 23) % count])
