"""What a bare cloud says of its own noise, measured once: the spacing of its points, the noise's deviation, and which points show faces."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from imdim.detection.sheets import measure_sheets
from imdim.geometry.sampling import EIGHTH, surface_spacing

# With this many neighbours and random triples, Gaussian noise of deviation 1 on a plane gives this tenth percentile of the
# least quantile residual; measured by simulation once, and checked by a test.
_NEIGHBOURS, _TRIPLES, _QUANTILE, _CALIBRATION = 24, 120, 8, 0.257
_FLAT = 5.0  # deviations of the noise that the neighbours of a place must reach around it, to show it as a disc
_FEWEST = 1500  # points; fewer would hide the part's own shape
ENOUGH_POINTS = 8192  # of a crowded cloud are kept
_BLURRING = 1e-3  # deviation of the noise, as a share of the diagonal, from which edges and walls are blurred


@dataclass(frozen=True)
class NoiseModel:
    """`spacing`: side of the square that one point stands for; `sigma`: deviation of the noise along the normal; `diagonal`: of the box.
    Whether neighbouring points are off together, as bulges of real things and waves of depth cameras are, is in `bulges`."""

    spacing: float
    sigma: float
    diagonal: float
    bulges: bool = False

    @property
    def blurs(self) -> bool:
        """Whether the noise is so large that edges and walls are blurred."""
        return self.sigma > _BLURRING * self.diagonal

    def scale(self, factor: float) -> NoiseModel:
        """The noise where lengths are `factor` times as long."""
        return replace(self, spacing=factor * self.spacing, sigma=factor * self.sigma, diagonal=factor * self.diagonal)


@dataclass(frozen=True, eq=False)
class MeasuredNoise:
    """A target's noise, in its units, as it is measured once in a run, and the indices `kept` [m] of a cloud's points that show faces; None
    for a mesh."""

    model: NoiseModel
    kept: np.ndarray | None = None


EXACT = NoiseModel(0.0, 0.0, 1.0)  # of a mesh in its unit frame


def measure_noise(points: np.ndarray, rng: np.random.Generator) -> tuple[NoiseModel, np.ndarray]:
    """The noise of `points` [n, 3], and the indices [m] of those that show faces: all, unless neighbours lie nearer than the noise.

    Spacing is that of the points kept, from the eighth neighbours of a Poisson process on a surface; noise by least quantiles of local
    planes. Least quantiles look at a third of the neighbours only, so that the two sides of a thin wall are not taken for noise, and the
    calmest tenth of the places counts, because noise is everywhere but curvature is not. Where curves and thin walls are everywhere
    too, bent sheets tell less noise (`sheets`). Neighbours within the noise lie in a ball: they
    show no face, take the time that faces need to be found, and hide the noise itself, so it is measured with ever fewer points.
    """
    kept = np.arange(len(points))
    levels = []
    while True:
        spacing, sigma = _measure_spacing_and_sigma(points[kept], rng)
        levels.append((spacing, kept))
        if _FLAT * sigma <= spacing * math.sqrt(_NEIGHBOURS / math.pi) or len(kept) <= _FEWEST:
            break
        kept = rng.permutation(kept)[: max(len(kept) // 2, ENOUGH_POINTS if len(kept) > ENOUGH_POINTS else _FEWEST)]
    spacing, kept = next((s, k) for s, k in levels if s >= sigma or len(k) <= ENOUGH_POINTS)
    return NoiseModel(spacing, sigma, float(np.linalg.norm(np.ptp(points[kept], axis=0)))), kept


def _measure_spacing_and_sigma(points: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """Spacing and deviation of the noise, where neighbours are farther apart than it."""
    tree = KDTree(points)
    seeds = rng.choice(len(points), min(600, len(points)), replace=False)
    count = min(_NEIGHBOURS, len(points) - 1)
    distance, near = tree.query(points[seeds], k=count + 1)
    spacing = surface_spacing(distance[:, min(EIGHTH, count)])
    triples = np.array([rng.choice(count + 1, 3, replace=False) for _ in range(_TRIPLES)])
    least = _least_quantiles(points, np.asarray(near), triples, min(_QUANTILE, count))
    sigma = float(np.quantile(least, 0.1)) / _CALIBRATION
    if sigma > _BLURRING * float(np.linalg.norm(np.ptp(points, axis=0))):
        sigma = min(sigma, measure_sheets(points, sigma))
    return spacing, sigma


def _least_quantiles(points: np.ndarray, near: np.ndarray, triples: np.ndarray, rank: int) -> np.ndarray:
    """Of each place [m] the least distance of its neighbour of this rank from a plane through three of its neighbours `near` [m, k]."""
    a, b, c = points[near[:, triples]].transpose(2, 0, 1, 3)
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal**2).sum(-1))
    reach = np.maximum(((b - a) ** 2).sum(-1), ((c - a) ** 2).sum(-1))
    away = sum((points[near, i][:, None] - a[..., i, None]) * normal[..., i, None] for i in range(3))
    least = np.sort(np.abs(away) / np.maximum(length, 1e-300)[..., None])[..., rank + 2]
    return np.where((length < 0.2 * reach) | (length == 0), np.inf, least).min(1)
