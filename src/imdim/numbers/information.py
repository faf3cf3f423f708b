"""What the points of a noisy cloud say of a program's numbers, by the likelihood of `likelihood`: its slope and its curvature.

Samples of the surface move with the numbers, and each point is shared among those near it. The observed information of such a mixture is
that of the points with their shares known, less what the shares leave open (Louis 1982); the scatter of the single points' slopes tells the
same where the model is right, and both together what it is worth where it is not (White 1982, the sandwich). Distances are taken to the
curved surface: along a sample's normal alone round walls would come out too narrow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import radii
from imdim.numbers.em import in_plane
from imdim.numbers.face_coordinates import lift_numbers, shift_leaves
from imdim.numbers.likelihood import NEIGHBOURS, WIDE, Noise, SurfaceSamples
from imdim.numbers.outline_coordinates import OutlineCoordinates, outline_coordinates
from imdim.program.outline import check_crossings
from imdim.program.tree import KINDS, Primitive, Program, leaves, map_leaves

BESIDE = 1e-4  # of the part, between which normals are compared
BENT = 0.2  # how far normals that near may differ on one smooth surface
NEAR = (8, 32, 128, 512)  # neighbours on average, over which residuals may go on
CERTAIN = 3.0  # deviations, by which residuals must go on to be believed to
BLOCK = 512  # points whose neighbours are looked at at a time


@dataclass(frozen=True)
class Coordinates:
    """The numbers of a program as lengths: nine of each leaf as `geometry.pose` has them, then those of each outline."""

    program: Program
    numbers: Lowered
    outlines: tuple[tuple[int, OutlineCoordinates, int], ...]  # of a leaf, from a column on
    count: int

    @staticmethod
    def of(program: Program) -> Coordinates:
        numbers = lower(program)
        found, column = [], 9 * len(numbers.kinds)
        for i, part in enumerate(leaves(program)):
            if part.outline is not None:
                own = outline_coordinates(part.outline, part.kind == "revolve")
                found.append((i, own, column))
                column += own.count
        return Coordinates(program, numbers, tuple(found), column)

    @cached_property
    def radii(self) -> np.ndarray:
        return radii(self.numbers)

    @cached_property
    def twice(self) -> list[int]:
        """Coordinates of drawn leaves that say what those of their outlines say: where it lies in its plane, and how it is turned there if
        no wall keeps it along an axis."""
        out: list[int] = []
        for leaf, own, _ in self.outlines:
            if KINDS[self.numbers.kinds[leaf]] == "revolve":
                out.append(9 * leaf + 5)
                continue
            free = sum(2 + (bulge != 0) for ring in own.outline.rings for _, _, bulge in ring)
            out += [9 * leaf + 3, 9 * leaf + 4] + ([9 * leaf + 8] if own.count >= free else [])
        return out

    def spread(self, rows: np.ndarray) -> np.ndarray:
        """Combinations of the coordinates of poses, `rows` [m, 9 k], in all coordinates [m, count]. What they say of where an outline lies
        in its plane is said of the middle between the vertices at its ends, with which its walls move."""
        out = np.pad(rows, ((0, 0), (0, self.count - rows.shape[1])))
        for leaf, own, first in self.outlines:
            turned = KINDS[self.numbers.kinds[leaf]] == "revolve"
            places = np.array([v[:2] for loop in own.outline.loops for v in (loop if isinstance(loop, tuple) else [(loop.x, loop.y)])])
            for column, axis in ((9 * leaf + 5, 1),) if turned else ((9 * leaf + 3, 0), (9 * leaf + 4, 1)):
                for vertex in (int(places[:, axis].argmin()), int(places[:, axis].argmax())):
                    out[:, first : first + own.count] += out[:, column, None] / 2 * own.map[3 * vertex + axis]
                out[:, column] = 0.0
        return out

    def move(self, step: np.ndarray) -> Program:
        """The program after a step [count]; an outline that would bound nothing, cross itself, or its axis, stays."""
        k = len(self.numbers.kinds)
        raw = step[: 9 * k].reshape(k, 9).copy()
        raw[:, 6:] /= self.radii[:, None]
        moved = lift_numbers(self.program, self.numbers, shift_leaves(self.numbers, raw))
        drawn = {}
        for leaf, own, first in self.outlines:
            try:
                outline = own.move(step[first : first + own.count])
                check_crossings(outline)
                drawn[leaf] = outline
            except ValueError:
                continue

        def redraw(i: int, p: Primitive) -> Primitive:
            try:
                return replace(p, outline=drawn[i]) if i in drawn else p
            except ValueError:
                return p

        return map_leaves(moved, redraw)

    def tangents(self, shown: SurfaceSamples) -> np.ndarray:
        """How the distance of a point at each sample grows with each coordinate [m, count]."""
        leaf, tangent = shown.leaf, kernels.leaf_tangent(self.numbers, shown.points, shown.normals, shown.leaf)
        out = np.zeros((len(leaf), self.count))
        tangent[:, 6:] /= self.radii[leaf, None]
        np.put_along_axis(out, 9 * leaf[:, None] + np.arange(9), tangent, axis=1)
        for i, own, first in self.outlines:
            mine, kind = np.flatnonzero(leaf == i), next(p.kind for n, p in enumerate(leaves(self.program)) if n == i)
            places = in_plane(kind, self.numbers.centers[i], self.numbers.rotations[i], shown.points[mine], shown.normals[mine])
            out[mine, first : first + own.count] = -own.rows(*places).toarray()
        return out


@dataclass(frozen=True)
class Information:
    """Of some coordinates [p]: the `slope` of the logarithm of the likelihood, its negative `curvature` [p, p], and the `scatter` [p, p] of
    the points' slopes. Of the points how far they lie off, as `residual` [n], of which `places` [n, 3] of the surface; and the `noise` that
    explains them."""

    slope: np.ndarray
    curvature: np.ndarray
    scatter: np.ndarray
    residual: np.ndarray
    places: np.ndarray
    noise: Noise


def inform(points: np.ndarray, shown: SurfaceSamples, bends: np.ndarray, tangents: np.ndarray, noise: Noise) -> Information:
    """The information of `points` [n, 3] on coordinates that the distances from samples with `bends` [m, 3, 3] grow by as `tangents` [m, p]
    say."""
    m, n = len(shown.points), len(points)
    wide = max(noise.sigma, WIDE * shown.spacing)
    near = np.asarray(KDTree(shown.points).query(points, k=min(NEIGHBOURS, m), distance_upper_bound=4 * wide)[1]).reshape(n, -1)
    peak = (1 - noise.clutter) / m / ((2 * np.pi) ** 1.5 * noise.sigma * wide**2)
    strewn = noise.clutter * noise.strewn.density(points, noise.sigma) / peak
    weight, away = _share(points, shown.points, shown.normals, bends, near, noise.sigma, wide, strewn)
    held = near < m
    rows, columns = np.nonzero(held)[0], near[held]
    pull = weight * away
    slopes = np.asarray(csr_matrix((pull[held], (rows, columns)), shape=(n, m)) @ tangents) / -(noise.sigma**2)
    mass = np.bincount(columns, weight[held], m)
    square = np.bincount(columns, (pull * away)[held], m)
    total = max(float(mass.sum()), 1.0)
    sigma, clutter = float(np.sqrt(square.sum() / total)), min(max(1 - total / n, 1e-3), 0.5)
    rest = np.maximum(1 - weight.sum(1), 1e-12)  # the share of the clutter
    signal = noise.clutter * noise.strewn.density(points, noise.sigma) * (1 - rest) / rest
    after = replace(noise, sigma=sigma, clutter=clutter, strewn=noise.strewn.fit(points, signal, clutter, noise.sigma))
    places = shown.points[np.minimum(near[np.arange(n), np.argmax(weight, axis=1)], m - 1)]
    scatter = slopes.T @ slopes
    known = (mass / noise.sigma**2 - square / noise.sigma**4)[:, None] * tangents
    return Information(slopes.sum(0), tangents.T @ known + scatter, scatter, pull.sum(1), places, after)


def measure_spread(points: np.ndarray, residual: np.ndarray) -> float:
    """By how much the variance of a mean of residuals [n] is larger than if those of neighbours had nothing in common: 1 for noise of
    single points; bulges and dents go on over many (Conley 1999, with Bartlett's weights). `points` [n, 3] are on the surface: off it
    neighbours lie on one side."""
    tree, square = KDTree(points), float(residual @ residual)
    if square == 0 or len(points) < 2 * NEAR[0]:
        return 1.0
    eighth = float(np.median(np.asarray(tree.query(points[:: max(1, len(points) // 500)], k=NEAR[0] + 1)[0])[:, -1]))
    found = 1.0
    for count in NEAR:
        # of points that fall together on the surface there are no neighbours at a distance
        if 4 * count > len(points) or eighth == 0:
            break
        reach = eighth * np.sqrt(count / NEAR[0])
        more, squares = 0.0, 0.0
        for first in range(0, len(points), BLOCK):
            both = _weigh_neighbours(tree, residual, slice(first, first + BLOCK), reach)
            more, squares = more + float(both.sum()) / square, squares + float(both @ both)
        if more > CERTAIN * np.sqrt(2 * squares) / square:  # each pair is there twice
            found = max(found, 1 + more)
    return found


def _weigh_neighbours(tree: KDTree, residual: np.ndarray, block: slice, reach: float) -> np.ndarray:
    """The products of the residuals of some points of a `tree` with those of all others within `reach` of each, weighted by how near they
    are. Of a few points at a time: where a program's rim gathers thousands, each is a neighbour of all."""
    near = KDTree(tree.data[block]).sparse_distance_matrix(tree, reach, output_type="ndarray")
    near = near[near["i"] + block.start != near["j"]]
    return residual[block][near["i"]] * residual[near["j"]] * (1 - near["v"] / reach)


def bends_of(program: Program | Lowered, points: np.ndarray, normals: np.ndarray, length: float) -> np.ndarray:
    """The curvature [m, 3, 3] of a program's surface at points of it: how its normals turn from place to place; none beside an edge."""
    leaf, _, _, _ = kernels.program_tangent(program, points)
    u = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.6, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-300)
    out, smooth, step = np.zeros((len(points), 3, 3)), np.ones(len(points), bool), BESIDE * length
    for side in (u, np.cross(normals, u)):
        (one, _, _, ahead), (two, _, _, behind) = (kernels.program_tangent(program, points + s * step * side) for s in (1.0, -1.0))
        turn = ahead - behind
        smooth &= (one == leaf) & (two == leaf) & (np.linalg.norm(turn, axis=1) < BENT)
        out += (turn / (2 * step))[:, :, None] * side[:, None, :]
    return np.where(smooth[:, None, None], (out + out.transpose(0, 2, 1)) / 2, 0.0)


@njit(nogil=True, cache=True)
def _share(points, samples, normals, bends, near, sigma, wide, clutter):  # pragma: no cover - compiled
    """As `likelihood._shares`: of each point the share of each near sample [n, k], and how far off the surface there it is."""
    n, k = near.shape
    weight, away = np.zeros((n, k)), np.zeros((n, k))
    e = np.empty(3)
    for i in range(n):
        total = clutter[i]
        for j in range(k):
            q = near[i, j]
            if q >= len(samples):
                continue
            a, b = 0.0, 0.0
            for c in range(3):
                e[c] = points[i, c] - samples[q, c]
                a += e[c] * normals[q, c]
                b += e[c] * e[c]
            b = max(b - a * a, 0.0)
            for c in range(3):
                for d in range(3):
                    a += 0.5 * e[c] * bends[q, c, d] * e[d]
            away[i, j] = a
            weight[i, j] = np.exp(-0.5 * (a * a / (sigma * sigma) + b / (wide * wide)))
            total += weight[i, j]
        for j in range(k):
            weight[i, j] /= total
    return weight, away
