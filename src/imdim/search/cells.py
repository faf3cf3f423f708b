"""Cells: sample points compressed into canonical intersections with the volume that is inside and outside the target.

Du et al. 2018, section 4.2, sample representatives and label each by majority. A cell here keeps both volumes instead, so that the
error of a program is exact for the samples, also where no carrier separates what the target separates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice

import numpy as np

from imdim.geometry.rotations import frame_from_axis
from imdim.search.arrangement import Arrangement, codes
from imdim.search.kernels import add_axial_density, add_box_density, group_rows, mark_inside_cylinder, merge_rows
from imdim.shares import by_shares

# Weights of (excess, lack). Cheap excess proposes hulls to cut from, dear lack pure cuts, dear excess pure pieces.
Weights = tuple[float, float]
TRUE, HULLS, CUTS, PIECES = (1.0, 1.0), (0.1, 1.0), (1.0, 8.0), (8.0, 1.0)
EXACT_BITS = 52  # of a sum of gains; a floating number has one more
THINNEST = 1e-9  # of the diagonal; where a part and its outer box end at one place, the slab between has no thickness


@dataclass(frozen=True)
class Cells:
    """m cells: a representative point [m, 3], slab indices, curved flags, and the volume inside and outside the target [m]; in the order of
    their codes."""

    points: np.ndarray
    slabs: np.ndarray
    inside: np.ndarray
    w_in: np.ndarray
    w_out: np.ndarray

    @property
    def gain(self) -> np.ndarray:
        """What filling each cell wins [m]: inside minus outside volume."""
        return self.gain_under(TRUE)

    def gain_under(self, weights: Weights) -> np.ndarray:
        """As `gain`, with weighted volumes.

        Rounded to so many digits that every sum of theirs is exact, in any order: what is even is then equal, and a sum may be carried on.
        """
        gain = weights[1] * self.w_in - weights[0] * self.w_out
        _, exponent = np.frexp(np.abs(gain).sum())
        unit = np.ldexp(1.0, int(exponent) - EXACT_BITS)
        return np.rint(gain / unit) * unit

    @property
    def volume(self) -> float:
        """Volume of the target as sampled."""
        return float(self.w_in.sum())

    def choose(self, which: np.ndarray) -> Cells:
        """Some of the cells."""
        return Cells(self.points[which], self.slabs[which], self.inside[which], self.w_in[which], self.w_out[which])


@dataclass(frozen=True)
class VolumeSamples:
    """Points [n, 3] and the volume [n] inside and outside the target that each stands for."""

    points: np.ndarray
    w_in: np.ndarray
    w_out: np.ndarray


def label_samples(
    arrangement: Arrangement, label: Callable[[np.ndarray], np.ndarray], count: int, rng: np.random.Generator
) -> VolumeSamples:
    """About `count` weighted points, with what `label` gives as their probability [n] of being inside."""
    points, weights = importance_samples(arrangement, count, rng)
    near = ((points >= arrangement.bounds[0]) & (points <= arrangement.bounds[1])).all(1)
    probability = np.zeros(len(points))
    probability[near] = label(points[near])
    return VolumeSamples(points, weights * probability, weights * (1 - probability))


def compress_samples(arrangement: Arrangement, samples: VolumeSamples) -> Cells:
    """The cells of the arrangement that hold samples, with the volume of theirs."""
    slabs, inside = codes(arrangement, samples.points)
    rows = _pack(slabs, inside)
    first, member = group_rows(rows)
    order = np.lexsort(rows[first].T[::-1])
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    first, member = first[order], place[member]
    first = _choose_typical(arrangement, samples, first, member)
    w_in, w_out = (np.bincount(member, w, len(first)) for w in (samples.w_in, samples.w_out))
    return Cells(samples.points[first], slabs[first], inside[first], w_in, w_out)


def _choose_typical(arrangement: Arrangement, samples: VolumeSamples, first: np.ndarray, member: np.ndarray) -> np.ndarray:
    """The `first` sample of each cell, by their `member` [n], or the first of those that lie as most of its volume does, nearer to the axes
    of tori than the middle of their tubes or farther from them: no code tells the hollow of a fillet from what is beyond it."""
    tori = [surface for surface in arrangement.curved if surface.kind == "torus"]
    if not tori:
        return first
    hubs = np.empty((len(member), len(tori)), bool, order="F")
    points = np.ascontiguousarray(samples.points)
    for column, torus in zip(hubs.T, tori, strict=True):
        mark_inside_cylinder(column, points, np.array(torus.point), np.array(torus.axis), torus.sizes[0])
    parts, part = group_rows(_pack(member.astype(np.int32).view(np.int16).reshape(-1, 2), hubs))
    volume, cell = np.bincount(part, samples.w_in + samples.w_out), member[parts]
    order = np.lexsort((-volume, cell))
    return parts[order[np.unique(cell[order], return_index=True)[1]]]


def pool_cells(cells: Cells, others: Cells, weights: tuple[float, float]) -> tuple[Cells, np.ndarray]:
    """The cells of both, of the same arrangement, with the weighted sums of their volumes, and where each went [m + k]."""
    slabs, inside = np.concatenate([cells.slabs, others.slabs]), np.concatenate([cells.inside, others.inside])
    first, member = merge_rows(_pack(cells.slabs, cells.inside), _pack(others.slabs, others.inside))
    w_in = np.bincount(member, np.concatenate([weights[0] * cells.w_in, weights[1] * others.w_in]))
    w_out = np.bincount(member, np.concatenate([weights[0] * cells.w_out, weights[1] * others.w_out]))
    return Cells(np.concatenate([cells.points, others.points])[first], slabs[first], inside[first], w_in, w_out), member


def _pack(slabs: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Each row of codes as whole numbers [n, k], which sort as its bytes do."""
    flags = np.packbits(inside, axis=1)
    width = 2 * slabs.shape[1] + flags.shape[1]
    packed = np.zeros((len(slabs), max(1, -(-width // 8)) * 8), np.uint8)
    packed[:, : 2 * slabs.shape[1]] = slabs.astype(np.int16).view(np.uint8).reshape(len(slabs), -1)
    packed[:, 2 * slabs.shape[1] : width] = flags
    return packed.view(">u8").astype(np.uint64)


def importance_samples(arrangement: Arrangement, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] in the arrangement's box and the volume [n] each stands for.

    A mixture of densities that give thin slabs and thin shells their share: uniform, per box frame a product of slab-stratified
    axes, per axis of revolution a slab-stratified (radius, height). Weights follow the balance heuristic (Veach and Guibas 1995).
    """
    (low, high), (far_low, far_high) = arrangement.bounds, arrangement.outer
    parts = [*_frame_densities(arrangement), *_axial_densities(arrangement)]
    share = count // (len(parts) + 3)
    points = [rng.uniform(low, high, (2 * share, 3)), rng.uniform(far_low, far_high, (share, 3))]
    points += [part.draw(share, rng) for part in parts]
    every = np.concatenate(points)
    every = every[((every >= far_low) & (every <= far_high)).all(1)]
    near = ((every >= low) & (every <= high)).all(1)
    density = by_shares(lambda points: _add_up(parts, points), every)
    uniform = np.where(near, 2 * share / np.prod(high - low), 0.0) + share / np.prod(far_high - far_low)
    return every, 1 / (uniform + share * density)


def _add_up(parts: Iterable[_BoxDensity | _AxialDensity], points: np.ndarray) -> np.ndarray:
    """The sum of the densities at points [n, 3]."""
    density = np.zeros(len(points))
    for part in parts:
        part.add_density(density, points)
    return density


@dataclass(frozen=True)
class _Slabs:
    """A piecewise constant density on a line: half by length, half an equal share for each slab."""

    edges: np.ndarray

    def draw(self, n: int, rng: np.random.Generator) -> np.ndarray:
        cumulative = np.concatenate([[0.0], np.cumsum(self._mass())])
        return np.interp(rng.random(n), cumulative, self.edges)

    @property
    def steps(self) -> np.ndarray:
        """The density in each slab."""
        return self._mass() / np.maximum(np.diff(self.edges), THINNEST)

    def _mass(self) -> np.ndarray:
        widths = np.diff(self.edges)
        return 0.5 * widths / widths.sum() + 0.5 / len(widths)


@dataclass(frozen=True)
class _BoxDensity:
    axes: np.ndarray  # [3, 3], rows are unit and orthogonal
    slabs: list[_Slabs]

    def draw(self, n: int, rng: np.random.Generator) -> np.ndarray:
        return np.stack([s.draw(n, rng) for s in self.slabs], axis=1) @ self.axes

    def add_density(self, total: np.ndarray, points: np.ndarray) -> None:
        """Add the density at points [n, 3] to `total` [n]."""
        add_box_density(total, points, self.axes, *(a for s in self.slabs for a in (s.edges, s.steps)))


@dataclass(frozen=True)
class _AxialDensity:
    origin: np.ndarray
    frame: np.ndarray  # [3, 3], rows x, y, axis
    radii: _Slabs
    heights: _Slabs

    def draw(self, n: int, rng: np.random.Generator) -> np.ndarray:
        rho, height, turn = self.radii.draw(n, rng), self.heights.draw(n, rng), rng.random(n) * 2 * np.pi
        flat = np.stack([rho * np.cos(turn), rho * np.sin(turn), np.zeros(n)], axis=1)
        base = self.origin - (self.origin @ self.frame[2]) * self.frame[2]
        return base + flat @ self.frame + height[:, None] * self.frame[2]

    def add_density(self, total: np.ndarray, points: np.ndarray) -> None:
        """Add the density at points [n, 3] to `total` [n]."""
        slabs = (a for s in (self.radii, self.heights) for a in (s.edges, s.steps))
        add_axial_density(total, points, self.origin, np.ascontiguousarray(self.frame), *slabs)


def _frame_densities(arrangement: Arrangement) -> list[_BoxDensity]:
    chosen = ([arrangement.directions[i] for i in frame] for frame in arrangement.frames[:6])
    return [_BoxDensity(np.stack([d.vector for d in three]), [_Slabs(d.offsets) for d in three]) for three in chosen]


def _axial_densities(arrangement: Arrangement) -> list[_AxialDensity]:
    """One density per group of coaxial cylinders and spheres on that axis, so that tube walls get samples."""
    groups: dict[tuple[int, tuple[float, ...]], list[float]] = {}
    size = float(np.linalg.norm(arrangement.bounds[1] - arrangement.bounds[0]))
    for surface, axis in zip(arrangement.curved, arrangement.axis_of, strict=True):
        if surface.kind not in ("cylinder", "sphere"):
            continue
        direction = arrangement.directions[max(axis, 0)].vector
        point = np.asarray(surface.point)
        foot = point - (point @ direction) * direction
        key = (max(axis, 0), tuple(float(x) for x in np.round(foot / size, 4) + 0.0))
        groups.setdefault(key, []).append(surface.sizes[0])
    out = []
    for (axis, foot), radii in islice(groups.items(), 40):
        direction = arrangement.directions[axis]
        edges = np.unique(np.round(np.array([0.0, *radii, max(radii) + 0.01 * size]) / size, 7)) * size
        out.append(_AxialDensity(np.array(foot) * size, frame_from_axis(direction.vector).T, _Slabs(edges), _Slabs(direction.offsets)))
    return out
