"""How likely a noisy cloud is for a solid: points are places of its surface, all alike, moved by Gaussian noise; a few are clutter.

The surface is a mixture of one Gaussian per sample of it, as flat as the noise along the normal and as wide as the samples are apart, and a
uniform density over the cloud's box (Myronenko & Song 2010, section 4; Granger & Pennec 2002 for surfaces). Distances to the nearest
surface, which least squares add up, are biased where noise is no longer small beside what it blurs: at an edge points stray to the outside
only, and in a thin wall each point is counted for the nearer side. Here every place answers for its share of each point, so that the mean
offset over any face is zero at the truth; and a surface without points costs, because the density is spread over all of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.point_grid import PointGrid, measure_diagonal
from imdim.geometry.sampling import even_surfaces
from imdim.geometry.shadows import Shadows
from imdim.geometry.surface_map import surface_area
from imdim.numbers.clutter import EVERYWHERE, ClutterBox
from imdim.program.tree import FLAT_ENDS, KINDS, Primitive, Program, leaves

NEIGHBOURS = 40  # both skins of a thin wall, and the walls of a corner, have to be among them
APART = 1.4  # deviations of the noise between samples: nearer ones would be more work
REACH = 4.0  # deviations, the wider ones, beyond which a sample lends nothing
VANISHING = 80.0  # squared deviations at which a density is nought
MOST_SAMPLES = 10_000
LEAST_DRAWN, MOST_DRAWN = 1024, 65_536  # hidden ones included
GAP = 2.0  # deviations of the noise
FLAT = 0.99  # cosine of a normal with an axis, from which it is that of an end
FEWEST = 3  # samples of an end that shows
WIDE = 0.7  # a sample's deviation along the surface, times the side of the square that it stands for


@dataclass(frozen=True)
class Noise:
    """`sigma`: deviation of a coordinate, in units of the points; `clutter`: share of points that belong to no surface, most of them in the
    box `strewn`; `least`: what `sigma` is at least, however near to a surface the points lie. In the `shadows` of known scanners no surface
    bears points."""

    sigma: float
    clutter: float = 0.01
    least: float = 0.0
    shadows: Shadows | None = None
    strewn: ClutterBox = EVERYWHERE


@dataclass(frozen=True)
class SurfaceSamples:
    """Samples of a program's surface, of what can be seen of it: `points`, outward `normals` [m, 3], its `area`, the share of it whose wall
    is a `skin`, the share of the leaves' surfaces that is `seen`, and which `leaf` [m] of the program each is on, empty for places that
    are of no program."""

    points: np.ndarray
    normals: np.ndarray
    area: float
    skin: float
    seen: float = 1.0
    leaf: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))

    @staticmethod
    def of(
        program: Program, sigma: float, most: int = MOST_SAMPLES, shadows: Shadows | None = None, seen: float | None = None
    ) -> SurfaceSamples:
        """About one sample per square of APART * `sigma`, at most `most` that show, spread evenly: chance would make a density of lumps,
        which is less likely than an even one, and less so where two sheets lie in one, so that thin walls would vanish. None is in the
        `shadows`. Some are drawn before to tell the share of the surface that is `seen`, unless that of a program much like it is known.
        """
        parts, lowered = list(leaves(program)), lower(program)
        areas = np.array([surface_area(p.kind, p.size, p.outline) for p in parts])
        visible = len(_visible(lowered, parts, _counts(areas, LEAST_DRAWN), GAP * sigma)[2]) / LEAST_DRAWN if seen is None else seen
        # every other sample of an even set is not even: their number has to be right at once
        wanted = np.clip(areas.sum() / (APART * sigma) ** 2, LEAST_DRAWN, min(most / max(visible, 1e-3), most / MOST_SAMPLES * MOST_DRAWN))
        points, normals, leaf = _visible(lowered, parts, _counts(areas, wanted), GAP * sigma)
        visible = len(points) / float(wanted)
        if shadows is not None:
            lit = ~shadows.hide_surface(points, normals)
            points, normals, leaf = points[lit], normals[lit], leaf[lit]
        area = len(points) / wanted * float(areas.sum())
        thin = ~kernels.inside(lowered, points - GAP * sigma * normals)
        return SurfaceSamples(points, normals, area, float(thin.mean()) if len(thin) else 0.0, visible, leaf)

    def count_hidden_ends(self, program: Lowered) -> np.ndarray:
        """How many flat ends of each leaf of the program show nowhere, int64 [k]: where they are nobody can tell, nor needs to. Of a leaf
        that does not show at all, and is there for nothing, none is told."""
        at, k = program.rotations[self.leaf], len(program.kinds)
        local = np.einsum("sji,sj->si", at, self.points - program.centers[self.leaf])
        flat = np.abs(np.einsum("sji,sj->si", at, self.normals)) > FLAT
        hidden = np.zeros(k, np.int64)
        for axis in range(3):
            has = np.array([axis in FLAT_ENDS.get(KINDS[kind], {}) for kind in program.kinds])
            for side in (-1, 1):
                own = self.leaf[flat[:, axis] & (np.sign(local[:, axis]) == side)]
                hidden += has & (np.bincount(own, minlength=k) < FEWEST)
        return hidden * (np.bincount(self.leaf, minlength=k) > 0)

    @property
    def spacing(self) -> float:
        return math.sqrt(self.area / max(len(self.points), 1))


@dataclass(frozen=True)
class Responsibilities:
    """What the points say of each sample: `mass` [m] is how many of them it answers for, `offset` [m] their mean distance along its
    normal. `noise` is what explains them best, `logs` [n] the logarithms of their densities, `nll` their negative mean."""

    mass: np.ndarray
    offset: np.ndarray
    noise: Noise
    nll: float
    logs: np.ndarray


def expectation_step(points: np.ndarray, shown: SurfaceSamples, noise: Noise) -> Responsibilities:
    """The expectation step for `points` [n, 3]."""
    m, strewn = len(shown.points), noise.clutter * noise.strewn.density(points, noise.sigma)
    wide = max(noise.sigma, WIDE * shown.spacing)
    peak = math.log((1 - noise.clutter) / max(m, 1)) - 1.5 * math.log(2 * math.pi) - math.log(noise.sigma) - 2 * math.log(wide)
    if m == 0:
        logs = np.log(strewn)
        return Responsibilities(np.zeros(0), np.zeros(0), noise, -float(logs.mean()), logs)
    grid = PointGrid.of(shown.points, REACH * wide)
    relative = np.exp(np.log(strewn) - peak)
    arrays = np.ascontiguousarray(points), shown.points[grid.order], shown.normals[grid.order]
    cells = grid.first, grid.low, grid.cell, grid.shape
    sorted_mass, sorted_moment, square, log, logs = _shares(*arrays, *cells, noise.sigma, wide, REACH * wide, relative)
    mass, moment = np.empty(m), np.empty(m)
    mass[grid.order], moment[grid.order] = sorted_mass, sorted_moment
    held = float(mass.sum())
    offset = np.divide(moment, mass, out=np.zeros(m), where=mass > 1e-12)
    sigma = math.sqrt(square / held) if held > 0 else noise.sigma
    clutter = min(max(1 - held / len(points), 1e-3), 0.5)
    after = replace(noise, sigma=max(sigma, noise.least), clutter=clutter)
    return Responsibilities(mass, offset, after, -(log / len(points) + peak), logs + peak)


def settle_clutter(points: np.ndarray, share: Responsibilities, told_by: Noise) -> Noise:
    """The noise after an expectation step for `points` [n, 3], which was `told_by` the one before, with its clutter in the likeliest box.

    For programs that have all their parts: what a search has not found yet would be a box of clutter, and hardly worth finding.
    """
    signal = np.exp(share.logs) - told_by.clutter * told_by.strewn.density(points, told_by.sigma)
    return replace(share.noise, strewn=told_by.strewn.fit(points, np.maximum(signal, 0.0), share.noise.clutter, told_by.sigma))


def negative_log_density(program: Program, points: np.ndarray, noise: Noise, most: int = MOST_SAMPLES) -> float:
    """The negative mean of the logarithms of the densities of `points` [n, 3] beside a program as it is, by `most` samples of it."""
    return expectation_step(points, SurfaceSamples.of(program, noise.sigma, most, noise.shadows), noise).nll


def _counts(areas: np.ndarray, wanted: float) -> np.ndarray:
    return np.ceil(wanted * areas / areas.sum()).astype(int)


def _visible(program: Lowered, parts: list[Primitive], counts: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of `counts` samples of each leaf those on the program's boundary, with the program's outward normals, and which leaf each is on.

    A gap that the noise hides is none: where two faces only just met, a step of either would open it. Of faces that lie in one only the
    first leaf's is sampled: twice as dense, it would be likelier to lie a little apart.
    """
    points, normals, starts = even_surfaces(parts, counts.tolist())
    step = 1e-6 * measure_diagonal(points)
    behind, ahead = (kernels.inside(program, points + side * normals) for side in (-step, step))
    shown = np.flatnonzero(behind != ahead)
    points, normals, behind = points[shown], normals[shown], behind[shown]
    sides = kernels.inside_each(parts, np.concatenate([points - step * normals, points + step * normals]))
    shared = sides[:, : len(shown)] != sides[:, len(shown) :]
    normals = np.where(behind, 1.0, -1.0)[:, None] * normals
    clear = ~kernels.inside(program, points + gap * normals)
    leaf = np.searchsorted(starts, shown, side="right") - 1
    clear &= shared.argmax(0) == leaf
    return points[clear], normals[clear], leaf[clear]


@njit(nogil=True, cache=True)
def _shares(points, samples, normals, first, low, cell, shape, sigma, wide, reach, clutter):  # pragma: no cover - compiled
    """What the samples, cell after cell of a grid (`PointGrid`), have of the points, by the densities of those within `reach` and of the
    `clutter` [n] at each."""
    n, m = len(points), len(samples)
    mass, moment = np.zeros(m), np.zeros(m)
    square, log = 0.0, 0.0
    logs, density, along, who = np.empty(n), np.empty(m), np.empty(m), np.empty(m, np.int64)
    flat, across, bound = 1 / (sigma * sigma), 1 / (wide * wide), reach * reach
    at = np.empty(3, np.int64)
    for i in range(n):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for c in range(3):
            # a place beyond the margin is near nothing, wherever it is looked for
            share = min(max((points[i, c] - low[c]) / cell, 0.0), shape[c] - 1.0)
            at[c] = int(share)
        total, count = clutter[i], 0
        bottom, top = max(at[2] - 1, 0), min(at[2] + 1, shape[2] - 1)
        for a in range(max(at[0] - 1, 0), min(at[0] + 2, shape[0])):
            for b in range(max(at[1] - 1, 0), min(at[1] + 2, shape[1])):
                row = (a * shape[1] + b) * shape[2]
                for q in range(first[row + bottom], first[row + top + 1]):
                    u, v, w = x - samples[q, 0], y - samples[q, 1], z - samples[q, 2]
                    far = u * u + v * v + w * w
                    if far >= bound:
                        continue
                    off = u * normals[q, 0] + v * normals[q, 1] + w * normals[q, 2]
                    power = off * off * flat + max(far - off * off, 0.0) * across
                    if power < VANISHING:
                        density[count], along[count], who[count] = math.exp(-0.5 * power), off, q
                        total += density[count]
                        count += 1
        logs[i] = math.log(total)
        log += logs[i]
        for j in range(count):
            r = density[j] / total
            mass[who[j]] += r
            moment[who[j]] += r * along[j]
            square += r * along[j] * along[j]
    return mass, moment, square, log, logs
