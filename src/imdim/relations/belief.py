"""What a cloud says about a program's numbers: their normal distribution around the fit.

The coordinates are those of `geometry.pose`: nine lengths per leaf. The inverse covariance is the sum of the squared derivatives of
the distances at the cloud's points over the variance of their residuals (Gauss-Newton), plus a prior as wide as the part, which alone
stands where no point shows a number. Outliers are weighed down as in `refine` (Geman and McClure).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered
from imdim.geometry.pose import radii
from imdim.numbers.face_coordinates import move_limited, step_maps
from imdim.numbers.measured import MAD
from imdim.program.tree import PLANE_ENDS, Primitive

EDGE = 2.0  # standard deviations of the noise
SMOOTH = 0.9  # cosine between normals of one smooth face, that far apart
MOST, FEW = 0.3, 12.0  # share of its points and number of points that a face keeps at least
MANY = 1e9  # points' worth, beside which what holds numbers that no point shows is nothing
CUT = 4.0  # residuals well beyond this many standard deviations say nothing


@dataclass(frozen=True)
class WeightedCloud:
    """Points [n, 3] of the target's surface, unit outward normals [n, 3] if known, weights [n]; `length` is the diagonal of their box."""

    points: np.ndarray
    normals: np.ndarray | None
    length: float
    weights: np.ndarray

    @staticmethod
    def of(points: np.ndarray, normals: np.ndarray | None = None) -> WeightedCloud:
        """Raises ValueError unless there are points of some extent, all finite."""
        points = np.ascontiguousarray(points, float)
        if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
            raise ValueError(f"relations need finite points [n, 3], got {list(points.shape)}")
        length = float(np.linalg.norm(np.ptp(points, axis=0)))
        if length == 0:
            raise ValueError("relations need points of some extent, all coincide")
        return WeightedCloud(points, normals, length, np.ones(len(points)))


@dataclass(frozen=True)
class Normal:
    """The normal equations of the distances at a cloud, residuals weighed by the robust scale `scale`.

    `matrix` [k, 9, 9] and `gradient` [k, 9] per leaf in lengths; `cost` is the robust sum of squares.
    """

    cost: float
    matrix: np.ndarray
    gradient: np.ndarray


def normal_equations(numbers: Lowered, cloud: WeightedCloud, scale: float) -> Normal:
    """Evaluate at `numbers`."""
    leaf, value, tangent, normal = kernels.program_tangent(numbers, cloud.points)
    square = (value / scale) ** 2
    trust = cloud.weights if cloud.normals is None else cloud.weights * np.maximum((normal * cloud.normals).sum(1), 0.0) ** 2
    weight = trust / (1 + square) ** 2
    tangent = tangent.copy()
    tangent[:, 6:] /= radii(numbers)[leaf, None]
    k = len(numbers.kinds)
    order = np.argsort(leaf, kind="stable")
    bounds = np.searchsorted(leaf[order], np.arange(k + 1))
    matrix, gradient = np.zeros((k, 9, 9)), np.zeros((k, 9))
    for i in range(k):
        mine = order[bounds[i] : bounds[i + 1]]
        rows = tangent[mine] * weight[mine, None]
        matrix[i], gradient[i] = rows.T @ tangent[mine], rows.T @ value[mine]
    return Normal(float((trust * value**2 / (1 + square)).sum()), matrix, gradient)


def away_from_edges(cloud: WeightedCloud, numbers: Lowered, noise: float) -> WeightedCloud:
    """The cloud without points from which another face is within EDGE standard deviations of the noise.

    There a noisy point is told the face that it lies further out of, which makes solids grow and holes shrink. A face that would lose most
    of its points keeps them all.
    """
    leaf, value, tangent, normal = kernels.program_tangent(numbers, cloud.points)
    foot = cloud.points - value[:, None] * normal
    u = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.6, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-300)
    v = np.cross(normal, u)
    clear = np.ones(len(foot), bool)
    for side in (u, -u, v, -v):
        beside, _, _, there = kernels.program_tangent(numbers, foot + EDGE * noise * side)
        clear &= (beside == leaf) & ((there * normal).sum(1) > SMOOTH)
    # how much each point feels each face of its leaf move: squares of the derivatives [n, 6]
    by_face = np.einsum("ni,nij->nj", tangent[:, :6], step_maps(numbers)[leaf, :6, :6]) ** 2
    support, before = np.zeros((2, len(numbers.kinds), 6))
    np.add.at(support, leaf[clear], by_face[clear])
    np.add.at(before, leaf, by_face)
    poor = (support < MOST * before) | (support < FEW)
    needed = (by_face > 1e-3) & poor[leaf]
    return replace(cloud, weights=np.where(clear | needed.any(1), cloud.weights, 0.1 * cloud.weights))


def uniform(k: int) -> Normal:
    """As if one point showed each of the numbers of `k` leaves: a metric in which all lengths weigh alike."""
    return Normal(0.0, np.tile(np.eye(9), (k, 1, 1)), np.zeros((k, 9)))


def by_faces(parts: Sequence[Primitive]) -> Normal:
    """A metric in which the moves of plane faces weigh alike: who moves one end of a part by the shortest way leaves the other end."""
    metric = uniform(len(parts))
    for matrix, part in zip(metric.matrix, parts, strict=True):
        for axis, column in PLANE_ENDS.get(part.kind, {}).items():
            matrix[column, column] = 0.5
            matrix[3 + axis, 3 + axis] += 1.0
    return replace(metric, matrix=MANY * metric.matrix)


def noise_of(numbers: Lowered, cloud: WeightedCloud) -> float:
    """The robust standard deviation of the cloud's distances."""
    return MAD * float(np.median(np.abs(kernels.program_sdf(numbers, cloud.points))))


def apply_step(numbers: Lowered, step: np.ndarray) -> Lowered:
    """The leaves after a step [9 k]; too long ones are cut short, sizes stay positive."""
    k = len(numbers.kinds)
    maps = np.tile(np.eye(9), (k, 1, 1))
    maps[:, range(6, 9), range(6, 9)] /= radii(numbers)[:, None]
    return move_limited(numbers, maps, step.reshape(k, 9))


def prior(numbers: Lowered, length: float) -> np.ndarray:
    """Inverse variances [k, 9] where nothing is known: sizes and places as wide as the part, turns as wide as the leaf."""
    out = np.full((len(numbers.kinds), 9), length**-2.0)
    out[:, 6:] = radii(numbers)[:, None] ** -2.0
    return out


def covariance(numbers: Lowered, cloud: WeightedCloud, noise: float, floor: float) -> np.ndarray:
    """Covariance [9 k, 9 k], block by leaf, of numbers that were fitted in `noise`; `floor` is a length below which nothing counts as
    known."""
    matrix = normal_equations(numbers, cloud, CUT * noise).matrix / noise**2
    known = prior(numbers, cloud.length)
    k = len(known)
    blocks = np.linalg.inv(matrix + known[:, :, None] * np.eye(9)) + floor**2 * np.eye(9)
    out = np.zeros((k, 9, k, 9))
    out[range(k), :, range(k)] = blocks
    return out.reshape(9 * k, 9 * k)


@dataclass(frozen=True)
class DeterminedFaces:
    """Which face coordinates [k, 6] of `face_coordinates` enough points show, and the maps [k, 6, 6] from them to sizes and shifts."""

    faces: np.ndarray
    maps: np.ndarray

    @staticmethod
    def of(numbers: Lowered, cloud: WeightedCloud, noise: float, least: float) -> DeterminedFaces:
        """A face is shown by the points that would feel it move, weighed as in the fit; it takes `least` of them."""
        matrix = normal_equations(numbers, cloud, CUT * noise).matrix[:, :6, :6]
        maps = step_maps(numbers)[:, :6, :6]
        support = np.diagonal(maps.transpose(0, 2, 1) @ matrix @ maps, axis1=1, axis2=2)
        return DeterminedFaces(support >= least, maps)

    @staticmethod
    def everything(numbers: Lowered) -> DeterminedFaces:
        """As if all faces were shown."""
        return DeterminedFaces(np.ones((len(numbers.kinds), 6), bool), step_maps(numbers)[:, :6, :6])

    def rows(self, slopes: np.ndarray) -> np.ndarray:
        """Whether functions with the derivatives `slopes` [n, 9 k] depend on shown faces alone, bool [n]."""
        by_face = np.einsum("nki,kij->nkj", slopes.reshape(len(slopes), -1, 9)[:, :, :6], self.maps)
        return ~((np.abs(by_face) > 1e-9) & ~self.faces).any(axis=(1, 2))
