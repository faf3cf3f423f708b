"""What cloud detection keeps in hand: the points, what is known of their noise, the surfaces found and who owns which point."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from imdim.detection.cloud_kernels import CONE, PLANE, gains, pack
from imdim.detection.noise import NoiseModel
from imdim.geometry.components import components
from imdim.geometry.surface import SURFACE_KINDS, Surface, is_spindle


@dataclass
class CloudConfig:
    """Lengths are fractions of the cloud's diagonal."""

    flat: float = 3e-4  # tolerance of planes in a clean cloud
    curved: float = 6e-4  # the same of curved surfaces
    exact: float = 1.5e-4  # by which relations (parallel, coaxial, flush) may move a surface of a clean cloud
    facet: float = 6e-3  # of the radius: curved walls of a design often are prisms of 30 or more sides
    noise: float = 2.7  # tolerance in deviations of the noise
    max_angle_deg: float = 28.0  # between a point's normal and the surface's
    min_points: int = 9
    noisy_min_points: int = 30
    calmed: float = 0.35  # of the noise is left after denoising
    linked: float = 4.0  # spacings between neighbours of one piece
    hypotheses: int = 260  # per family of minimal sets and round
    polished: int = 5  # hypotheses per kind and round that are fitted
    off_frame: float = 0.85  # what support is worth on an axis that no other surface of the part shares
    tightness: float = 0.5  # least mean gain of a curved surface's points; points strewn evenly over the tolerance have 0.42
    sparse: float = 2.2  # spacings to the third neighbour on a curved surface; a Poisson process on a surface has 1
    rounds: int = 120
    patience: int = 3  # rounds without a find before the rest is given up


@dataclass
class DetectionState:
    """Mutable state of one detection; the kernels read its arrays."""

    points: np.ndarray
    normals: np.ndarray
    trust: np.ndarray
    noise: NoiseModel
    config: CloudConfig
    owner: np.ndarray  # index of the found surface, -1 for none
    viewed: int  # free points when their normals were last estimated; 0 for given normals
    found: list[Surface] = field(default_factory=list)
    raw: np.ndarray | None = None  # the points as measured, where `points` are denoised

    @property
    def cosine(self) -> float:
        return math.cos(math.radians(self.config.max_angle_deg))

    @property
    def noisy(self) -> bool:
        return self.raw is not None or self.noise.blurs

    @property
    def sigma(self) -> float:
        """Deviation of the noise that `points` have, as measured or denoised."""
        return self.noise.sigma * (1.0 if self.raw is None else self.config.calmed)

    @property
    def least(self) -> int:
        return self.config.noisy_min_points if self.noisy else self.config.min_points

    def tolerance(self, kinds: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Of each hypothesis: noise, or the flats of a faceted wall."""
        d = self.noise.diagonal
        radius = np.choose(kinds, [0 * rows[:, 6], rows[:, 6], rows[:, 6], 0 * rows[:, 6], rows[:, 7], rows[:, 6:9].min(1)])
        # a radius beyond the part's own is a gentle arc, and such arcs have many sides
        facet = self.config.facet * np.where(radius < 0.5 * d, radius, 0.0)
        base = np.where(kinds == PLANE, self.config.flat * d, np.maximum(self.config.curved * d, facet))
        base = np.where(kinds == CONE, 2 * self.config.curved * d, base)
        return np.maximum(base, self.config.noise * self.sigma)

    def tolerance_of(self, surface: Surface) -> float:
        return float(self.tolerance(np.array([SURFACE_KINDS.index(surface.kind)]), pack(surface)[None])[0])

    def members(self, surface: Surface) -> np.ndarray:
        """Indices of all points within the surface's tolerance and of its normal."""
        kind, row = SURFACE_KINDS.index(surface.kind), pack(surface)
        return np.flatnonzero(gains(kind, row, self.tolerance_of(surface), self.points, self.normals, self.trust, self.cosine) > 0)


def sane(surface: Surface, diagonal: float) -> bool:
    """Whether a fitted surface is one that a part of this size may have, and not the degenerate end of a fit."""
    if surface.kind == "plane":
        return True
    if surface.kind == "cone":
        return 0.01 < surface.sizes[0] < 1.54
    return max(surface.sizes) < 1.5 * diagonal and not is_spindle(surface)


def pieces(points: np.ndarray, reach: float) -> np.ndarray:
    """Labels [n] of the connected pieces of `points` when near neighbours within `reach` are linked."""
    k = min(9, len(points))
    distance, near = KDTree(points).query(points, k=k)
    ok = (distance < reach).ravel()
    start = np.repeat(np.arange(len(points)), k)[ok]
    return components(start, near.reshape(-1)[ok], len(points))[1]
