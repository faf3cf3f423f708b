"""What single parts are beside a noisy cloud, computed once for all searches: samples of their surfaces, and what these lend to points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.point_grid import PointGrid, measure_diagonal
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import EIGHTH, even_surfaces, surface_spacing
from imdim.geometry.shadows import Shadows
from imdim.geometry.surface_map import surface_area
from imdim.numbers.likelihood import FLAT, GAP, WIDE
from imdim.program.tree import FLAT_ENDS, Combine, Primitive, Program, leaves

T = TypeVar("T")

SAMPLES = 2048  # of the surface that the points show
KEPT = 2  # deviations of the noise for which tables are kept
STEP = 1e-5  # from a surface to either side, of the cloud's diagonal
MOST = 6144  # of one part's surface
NEIGHBOURS = 14  # samples of one part near a point
ALIKE = 1.1  # ratio of deviations of the noise up to which nothing is drawn again
BATCH = 64  # parts that are sampled at once
MOST_PARTS = 2500  # in the tables
FAR = 3.0  # deviations along the surface, beyond which a sample lends nothing
LOOSE = 1.5  # times the noise: parts that were not fitted yet lie a little off
AHEAD, BEHIND = np.uint8(1), np.uint8(2)  # bits: from where a surface can be seen


@dataclass(frozen=True)
class PartSamples:
    """A part seen alone: samples of its surface with outward `normals` [s, 3], and whether the part itself holds the places just behind
    and ahead of them, and those a gap away (`selves` [s, 4]). Sample i lends `density` to the points of the indices `lent`, those of both
    from `first[i]` to `first[i + 1]` [s + 1]; a point has of one part the nearest. `ends` uint8 [s] are which flat end of a primitive a
    sample is on, from 1, and 0 elsewhere. `faces` uint8 [s] has AHEAD where a scanner could see the surface from outside of the part, and
    BEHIND where from within, as that of a cut is seen."""

    points: np.ndarray
    normals: np.ndarray
    selves: np.ndarray
    first: np.ndarray
    lent: np.ndarray
    density: np.ndarray
    ends: np.ndarray
    faces: np.ndarray


class PartTables:
    """What was computed for single parts beside points [n, 3], for one deviation `sigma` of the noise and one `spacing` of the samples, of
    which there are none in the `shadows`."""

    def __init__(self, points: np.ndarray, sigma: float, spacing: float, shadows: Shadows | None = None) -> None:
        self.asked, self._shadows = sigma, shadows
        self.sigma, self.spacing = LOOSE * sigma, spacing
        self.wide = max(self.sigma, WIDE * spacing)
        self._grid = PointGrid.of(points, FAR * self.wide)
        self._sorted = points[self._grid.order]
        self.offsets = np.outer([STEP * measure_diagonal(points), GAP * sigma], [-1, 1]).ravel()
        self._seen: dict[Program, PartSamples] = {}

    def parts(self, parts: Sequence[Program]) -> list[PartSamples]:
        """The parts' samples, drawn when first asked for."""
        missing = list(dict.fromkeys(p for p in parts if p not in self._seen))
        if len(self._seen) + len(missing) > MOST_PARTS:
            self._seen = {}
            missing = list(dict.fromkeys(parts))
        for few in in_batches(missing):
            self._sample(few)
        return [self._seen[p] for p in parts]

    def _sample(self, parts: Sequence[Program]) -> None:
        drawn = _samples(parts, self.spacing, self.offsets[1])
        if self._shadows is not None:
            lit = [~self._shadows.hide(points, normals) for points, normals in drawn]
            drawn = [(points[own], normals[own]) for (points, normals), own in zip(drawn, lit, strict=True)]
        starts = np.cumsum([0, *(len(points) for points, _ in drawn)])
        points, normals = (np.concatenate(column) for column in zip(*drawn, strict=True))
        selves = kernels.inside_each(parts, self.probes(points, normals), 4 * starts).reshape(-1, 4)
        grid = self._grid
        cells = self._sorted, grid.order, grid.first, grid.low, grid.cell, grid.shape, self.sigma, self.wide, FAR * self.wide
        for part, first, last in zip(parts, starts, starts[1:], strict=False):
            own = slice(first, last)
            lent = _lend(points[own], normals[own], *cells, NEIGHBOURS)
            ends, faces = _find_ends(part, points[own], normals[own]), self._facing(points[own], normals[own])
            self._seen[part] = PartSamples(points[own], normals[own], selves[own], *lent, ends, faces)

    def _facing(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        if self._shadows is None:
            return np.full(len(points), AHEAD | BEHIND)
        outside, within = self._shadows.face(points, normals), self._shadows.face(points, -normals)
        return np.where(outside, AHEAD, np.uint8(0)) | np.where(within, BEHIND, np.uint8(0))

    def probes(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """The places [4 s, 3] behind and ahead of samples [s, 3]."""
        return _offset(points, normals, self.offsets)


class PartTableCache:
    """What was drawn beside some points, for later scenes of nearly the same noise. The surface that the points show gets SAMPLES, whatever
    a program has of it, so that several searches can share what was drawn."""

    def __init__(self, points: np.ndarray, shadows: Shadows | None = None) -> None:
        self.points, self._shadows = points, shadows
        eighth = KDTree(points).query(points, k=min(EIGHTH + 1, len(points)))[0][:, -1]
        self._spacing = max(surface_spacing(eighth) * math.sqrt(len(points) / SAMPLES), 1e-100)
        self._drawn: list[PartTables] = []

    def at(self, sigma: float) -> PartTables:
        """For the noise, or what is there for one that differs by no more than ALIKE; of those that were asked for last KEPT are kept."""
        sigma = max(sigma, 1e-300)
        found = next((t for t in self._drawn if abs(math.log(sigma / t.asked)) < math.log(ALIKE)), None)
        found = found or PartTables(self.points, sigma, self._spacing, self._shadows)
        self._drawn = [found, *(t for t in self._drawn if t is not found)][:KEPT]
        return found


def in_batches(items: Sequence[T]) -> list[Sequence[T]]:
    """The items, BATCH at a time."""
    return [items[i : i + BATCH] for i in range(0, len(items), BATCH)]


def _samples(parts: Sequence[Program], spacing: float, step: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points and outward normals [s, 3] of each part's own surface, one per square of the spacing, within limits."""
    own = [[*leaves(part)] for part in parts]
    every = [leaf for few in own for leaf in few]
    areas = np.array([surface_area(leaf.kind, leaf.size, leaf.outline) for leaf in every])
    points, normals, starts = even_surfaces(every, np.clip(np.ceil(areas / spacing**2), 16, MOST).astype(int).tolist())
    ends = starts[np.cumsum([0, *map(len, own)])]
    out = [(points[a:b], normals[a:b]) for a, b in pairwise(ends)]
    return [_bare(part, *found, step) if isinstance(part, Combine) else found for part, found in zip(parts, out, strict=True)]


def count_ends(part: Program) -> int:
    """The flat ends of a primitive; of parts that are made of several none are told."""
    return 2 * len(FLAT_ENDS.get(part.kind, {})) if isinstance(part, Primitive) else 0


def _find_ends(part: Program, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Which flat end of a primitive samples [s, 3] are on, from 1, uint8 [s]."""
    out = np.zeros(len(points), np.uint8)
    if isinstance(part, Primitive):
        rotation = matrix_from_euler(part.rotation)
        local, along = (points - part.center) @ rotation, np.abs(normals @ rotation)
        for k, axis in enumerate(FLAT_ENDS.get(part.kind, {})):
            on = along[:, axis] > FLAT
            out[on] = 2 * k + 1 + (local[on, axis] > 0)
    return out


def _bare(part: Combine, points: np.ndarray, normals: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the samples of a part's leaves those on its own surface."""
    behind, ahead = (kernels.inside(part, points + side * normals) for side in (-step, step))
    normals = np.where(behind, 1.0, -1.0)[:, None] * normals
    return points[behind != ahead], normals[behind != ahead]


@njit(nogil=True, cache=True)
def _offset(points, normals, offsets):  # pragma: no cover - compiled
    out = np.empty((4 * len(points), 3))
    for i in range(len(points)):
        for k in range(4):
            for c in range(3):
                out[4 * i + k, c] = points[i, c] + offsets[k] * normals[i, c]
    return out


@njit(nogil=True, cache=True)
def _lend(samples, normals, points, order, first, low, cell, shape, sigma, wide, reach, k):  # pragma: no cover - compiled
    """To which points, cell after cell of a grid (`PointGrid`), samples lend density, relative to that of a sample at its own place: to
    each point its `k` nearest within `reach`. Where the points of each sample begin [s + 1], their indices, and the densities."""
    n = len(points)
    near, away = np.full((n, k), -1, np.int32), np.full((n, k), np.inf)
    at = np.empty(3, np.int64)
    for s in range(len(samples)):
        for c in range(3):
            at[c] = int(min(max((samples[s, c] - low[c]) / cell, 0.0), shape[c] - 1.0))
        bottom, top = max(at[2] - 1, 0), min(at[2] + 1, shape[2] - 1)
        for a in range(max(at[0] - 1, 0), min(at[0] + 2, shape[0])):
            for b in range(max(at[1] - 1, 0), min(at[1] + 2, shape[1])):
                row = (a * shape[1] + b) * shape[2]
                for q in range(first[row + bottom], first[row + top + 1]):
                    u, v, w = points[q, 0] - samples[s, 0], points[q, 1] - samples[s, 1], points[q, 2] - samples[s, 2]
                    far = u * u + v * v + w * w
                    if far >= reach * reach or far >= away[q, k - 1]:
                        continue
                    j = k - 1
                    while j > 0 and away[q, j - 1] > far:
                        away[q, j], near[q, j] = away[q, j - 1], near[q, j - 1]
                        j -= 1
                    away[q, j], near[q, j] = far, s
    starts = np.zeros(len(samples) + 1, np.int64)
    for q in range(n):
        for j in range(k):
            if near[q, j] < 0:
                break
            starts[near[q, j] + 1] += 1
    for s in range(len(samples)):
        starts[s + 1] += starts[s]
    done, lent, density = starts.copy(), np.empty(starts[-1], np.int32), np.empty(starts[-1], np.float32)
    for q in range(n):
        for j in range(k):
            s = near[q, j]
            if s < 0:
                break
            off = 0.0
            for c in range(3):
                off += (points[q, c] - samples[s, c]) * normals[s, c]
            power = (off / sigma) ** 2 + max(away[q, j] - off * off, 0.0) / wide**2
            lent[done[s]], density[done[s]] = order[q], math.exp(-0.5 * power)
            done[s] += 1
    return starts, lent, density
