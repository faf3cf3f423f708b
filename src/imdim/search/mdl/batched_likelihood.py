"""The likelihood of a noisy cloud under many choices among the same parts: what depends on one part alone is computed once.

The density is that of `likelihood`, over coarser samples. Which of a part's samples lie within every other part is kept in bits, and how
near each point lies to them as densities, so that a choice costs a pass over bits and a sum: a thousand choices take about a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.sampling import EIGHTH, even_surface, surface_spacing
from imdim.geometry.shadows import Shadows
from imdim.geometry.surface_map import surface_area
from imdim.numbers.likelihood import GAP, WIDE, Noise
from imdim.program.tree import Combine, Program, leaves
from imdim.search.mdl.description_length import SKIN, numbers
from imdim.search.mdl.local_search import Choice, pack_choices

SAMPLES = 2048  # of the surface that the points show
KEPT = 2  # deviations of the noise for which tables are kept
STEP = 1e-5  # from a surface to either side, of the cloud's diagonal
MOST = 6144  # of one part's surface
NEIGHBOURS = 14  # samples of one part near a point
ALIKE = 1.1  # ratio of deviations of the noise up to which nothing is drawn again
MOST_ROWS = 2500  # parts in the tables, some 170 KiB each
FAR = 3.0  # deviations along the surface, beyond which a sample lends nothing
LOOSE = 1.5  # times the noise: parts that were not fitted yet lie a little off


@dataclass(frozen=True)
class PartSamples:
    """A part seen alone: samples of its surface with outward `normals` [s, 3], and whether the part itself holds the places just behind
    and ahead of them, and those a gap away (`selves` [s, 4]). `row` is the part's in the tables of `PartTables`."""

    points: np.ndarray
    normals: np.ndarray
    selves: np.ndarray
    row: int


class PartTables:
    """What was computed for single parts beside points [n, 3], for one deviation `sigma` of the noise and one `spacing` of the samples, of
    which there are none in the `shadows`.

    Tables over the parts: their samples that lie `near` each point (int16 [rows, n, k], -1 for none) and the `density` that they lend it.
    """

    def __init__(self, points: np.ndarray, sigma: float, spacing: float, shadows: Shadows | None = None) -> None:
        self._points, self.asked, self._shadows = points, sigma, shadows
        self.sigma, self.spacing = LOOSE * sigma, spacing
        self.wide = max(self.sigma, WIDE * spacing)
        self.offsets = np.outer([STEP * float(np.linalg.norm(np.ptp(points, axis=0))), GAP * sigma], [-1, 1]).ravel()
        self._forget()

    def parts(self, parts: Sequence[Program]) -> list[PartSamples]:
        """The parts' samples, drawn when first asked for; the tables have their rows."""
        missing = list(dict.fromkeys(p for p in parts if p not in self._seen))
        if len(self._seen) + len(missing) > MOST_ROWS:
            self._forget()
            missing = list(dict.fromkeys(parts))
        self._widen(len(self._seen) + len(missing))
        for part in missing:
            self._seen[part] = self._sample_part(part, len(self._seen))
        return [self._seen[p] for p in parts]

    def _forget(self) -> None:
        shape = (0, len(self._points), NEIGHBOURS)
        self._seen: dict[Program, PartSamples] = {}
        self.near, self.density = np.empty(shape, np.int16), np.empty(shape, np.float32)

    def _widen(self, rows: int) -> None:
        more = max(rows, min(2 * len(self.near), MOST_ROWS)) - len(self.near)
        if rows > len(self.near):
            self.near, self.density = (np.concatenate([t, np.empty((more, *t.shape[1:]), t.dtype)]) for t in (self.near, self.density))

    def _sample_part(self, part: Program, row: int) -> PartSamples:
        points, normals = _samples(part, self.spacing, self.offsets[1])
        if self._shadows is not None:
            points, normals = self._shadows.leave(points, normals)
        self.near[row], self.density[row] = -1, 0.0
        # no sample is nearer than the surface
        close = np.flatnonzero(np.abs(kernels.program_sdf(part, self._points)) < FAR * self.wide)
        self.near[row, close], self.density[row, close] = _near(points, normals, self._points[close], self.sigma, self.wide)
        return PartSamples(points, normals, kernels.inside(part, self.probes(points, normals)).reshape(-1, 4), row)

    def probes(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """The places [4 s, 3] behind and ahead of samples [s, 3]."""
        return (points[:, None] + self.offsets[:, None] * normals[:, None]).reshape(-1, 3)


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


class PointScene:
    """The points [n, 3] of `draws` that parts are judged by. They may stand for a cloud of `count` points: the more, the less a number of a
    program weighs."""

    def __init__(self, draws: PartTableCache, noise: Noise, count: int | None = None):
        points = draws.points
        self.drawn, self.count = draws.at(noise.sigma), count or len(points)
        self.clutter = noise.clutter
        self.box = float(np.prod(np.maximum(np.ptp(points, axis=0), self.drawn.sigma)))


@dataclass(frozen=True)
class BatchedLikelihood:
    """Tables over `parts` (p) for the points of a scene: samples of part i are `starts[i]` to `starts[i + 1]`; `rows` [p] are the parts' in
    the tables of `PartTables`; `own` [p] is how many numbers a part has. Only the first parts, the settled ones, may stand together; of the
    others a choice has one at most.

    Which parts hold the places just behind and ahead of a sample, and those a gap away, is in `sides` [settled, s, 4] for the settled,
    in `over` [others, s of the settled, 4] for the others, and in `selves` [s, 4] for the sample's own part.
    """

    scene: PointScene
    parts: tuple[Program, ...]
    starts: np.ndarray
    sides: np.ndarray
    over: np.ndarray
    selves: np.ndarray
    rows: np.ndarray
    own: np.ndarray

    @staticmethod
    def of(scene: PointScene, settled: Sequence[Program], others: Sequence[Program]) -> BatchedLikelihood:
        parts = (*settled, *others)
        drawn = scene.drawn.parts(parts)
        starts = np.cumsum([0, *(len(d.points) for d in drawn)])
        # a part at a time: all places at once are a hundred megabytes
        sides = np.concatenate([_sides(settled, scene.drawn.probes(d.points, d.normals)) for d in drawn], axis=1)
        known = np.concatenate([np.empty((0, 3)), *(scene.drawn.probes(d.points, d.normals) for d in drawn[: len(settled)])])
        selves = np.concatenate([d.selves for d in drawn])
        rows, own = np.array([d.row for d in drawn]), np.array([numbers(p) for p in parts])
        return BatchedLikelihood(scene, parts, starts, sides, _sides(others, known), selves, rows, own)

    def lengths(self, choices: Sequence[Choice], every: int = 1) -> np.ndarray:
        """Description length of the points under each choice, in nats per point (see `description_length`); infinite where nothing is left.

        Only each so-manieth point is looked at.
        """
        scene, drawn, clutter = self.scene, self.scene.drawn, self.scene.clutter
        lattice = 1.5 * math.log(2 * math.pi) + math.log(drawn.sigma) + 2 * math.log(drawn.wide)
        arrays = self.starts, self.sides, self.over, self.selves, self.rows, drawn.near, drawn.density
        nll, skin = _lengths(*pack_choices(choices), *arrays, every, clutter / scene.box, math.log1p(-clutter) - lattice)
        n = scene.count
        own = np.array([sum(self.own[i] for _, i in c) for c in choices])
        return nll + 0.5 * own * math.log(n) / n + SKIN * skin


def _sides(parts: Sequence[Program], probes: np.ndarray) -> np.ndarray:
    """Which of the parts [p] hold which of the probes, four of each sample: [p, s, 4]."""
    return np.array([kernels.inside(part, probes) for part in parts], bool).reshape(len(parts), len(probes) // 4, 4)


def _samples(part: Program, spacing: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals [s, 3] of a part's own surface, one per square of the spacing, within limits."""
    drawn = []
    for leaf in leaves(part):
        count = int(np.clip(math.ceil(surface_area(leaf.kind, leaf.size, leaf.outline) / spacing**2), 16, MOST))
        drawn.append(even_surface(leaf, count))
    points, normals = (np.concatenate(c) for c in zip(*drawn, strict=True))
    if not isinstance(part, Combine):
        return points, normals
    behind, ahead = (kernels.inside(part, points + side * normals) for side in (-step, step))
    normals = np.where(behind, 1.0, -1.0)[:, None] * normals
    return points[behind != ahead], normals[behind != ahead]


def _near(places: np.ndarray, normals: np.ndarray, points: np.ndarray, sigma: float, wide: float) -> tuple[np.ndarray, np.ndarray]:
    """Of each point the nearest samples [n, k] and their densities, relative to that of a sample at its own place."""
    if not len(places) or not len(points):
        return np.full((len(points), NEIGHBOURS), -1, np.int16), np.zeros((len(points), NEIGHBOURS), np.float32)
    found = np.asarray(KDTree(places).query(points, k=NEIGHBOURS, distance_upper_bound=FAR * wide)[1]).reshape(len(points), -1)
    none = found >= len(places)
    found = np.where(none, 0, found)
    away = points[:, None] - places[found]
    along = np.einsum("nkc,nkc->nk", away, normals[found])
    across = np.maximum((away**2).sum(-1) - along**2, 0.0)
    density = np.exp(-0.5 * ((along / sigma) ** 2 + across / wide**2))
    return np.where(none, -1, found).astype(np.int16), density.astype(np.float32)


@njit(nogil=True, cache=True)
def _lengths(lengths, index, sign, starts, sides, over, selves, rows, near, density, every, strewn, held):  # pragma: no cover - compiled
    count, n = len(index), near.shape[1]
    nll, skin = np.full(count, np.inf), np.zeros(count)
    visible = np.zeros(starts[-1], np.bool_)
    for c in range(count):
        k = lengths[c]
        shown, thin = _show(index[c, :k], sign[c, :k], starts, sides, over, selves, visible)
        if shown == 0:
            continue
        peak = held - math.log(shown)
        clutter = strewn / math.exp(peak)
        log = 0.0
        for i in range(0, n, every):
            total = clutter
            for t in range(k):
                e = index[c, t]
                row = rows[e]
                for j in range(near.shape[2]):
                    q = near[row, i, j]
                    if q < 0:
                        break
                    if visible[starts[e] + q]:
                        total += density[row, i, j]
            log += math.log(total)
        nll[c] = -(log / ((n + every - 1) // every) + peak)
        skin[c] = thin / shown
    return nll, skin


@njit(nogil=True, cache=True)
def _show(index, sign, starts, sides, over, selves, visible):  # pragma: no cover - compiled
    """Marks the samples of the fold's surface, but those that face it across a gap; how many, and how many of them have a thin wall."""
    shown, thin = 0, 0
    for e in index:
        for s in range(starts[e], starts[e + 1]):
            behind, ahead, deep, far = False, False, False, False
            for u in range(len(index)):
                o = index[u]
                held = selves[s] if o == e else sides[o, s] if o < len(sides) else over[o - len(sides), s]
                if held[0]:
                    behind = sign[u]
                if held[1]:
                    ahead = sign[u]
                if held[2]:
                    deep = sign[u]
                if held[3]:
                    far = sign[u]
            if ahead:
                deep, far = far, deep
            visible[s] = behind != ahead and not far
            if visible[s]:
                shown += 1
                if not deep:
                    thin += 1
    return shown, thin
