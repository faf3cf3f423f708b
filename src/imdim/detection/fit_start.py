"""First guesses of carrier surfaces from points, with or without normals, by linear algebra alone."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from imdim.detection.fit_ellipsoid import make_ellipsoid, quadric_ellipsoid
from imdim.geometry.axes import half_sphere
from imdim.geometry.rotations import cross
from imdim.geometry.rows import dot_rows
from imdim.geometry.surface import Surface

_UNIT = np.eye(3)


def starts(kind: str, points: np.ndarray, normals: np.ndarray | None) -> list[Surface]:
    """One or more guesses of a sphere, cylinder, cone, torus or ellipsoid through `points` [n, 3], best unknown.

    `normals` [n, 3] are unit vectors of either sign; every use of them here is indifferent to their signs.
    """
    if kind == "sphere":
        return [_sphere(points)]
    if kind == "ellipsoid":
        ball = _sphere(points)
        return [quadric_ellipsoid(points) or make_ellipsoid(np.asarray(ball.point), np.eye(3), np.repeat(ball.sizes, 3))]
    if kind == "elliptic":
        raise ValueError("an elliptic cylinder is fitted from a start")
    if normals is None:
        return _sweep_axes(kind, points) + (_by_own_normals(points) if kind == "torus" and len(points) >= 16 else [])
    normals = np.asarray(normals, float)
    axes = revolution_axes(points, normals)
    if kind == "cylinder":
        # its normals lie on a great circle, whose pole is the axis
        pole = np.linalg.eigh(normals.T @ normals)[1][:, 0]
        found = [_cylinder(points, a) for a in (pole, *(a for _, a in axes))]
    elif kind == "cone":
        found = [_cone(points, p, a) for p, a in axes] + _cone_by_apex(points, normals)
    else:
        found = [_torus(points, p, a) for p, a in axes]
    return [s for s in found if np.isfinite(s.sizes).all() and np.isfinite(s.point).all()] or _sweep_axes(kind, points)


def revolution_axes(points: np.ndarray, normals: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Axes (point, direction) that the normal lines meet: the linear line complex of Pottmann & Randrup 1998, best first.

    The three candidates are the stationary directions; spheres, planes and cylinders leave more than one equally good.
    """
    lines = np.column_stack([np.cross(points, normals), normals])
    moment = lines.T @ lines / len(lines)
    a, b, c = moment[:3, :3], moment[:3, 3:], moment[3:, 3:]
    # eliminate the axis' moment: it enters quadratically and without a constraint
    inverse = np.linalg.pinv(c, rcond=1e-9, hermitian=True)
    _, vectors = np.linalg.eigh(a - b @ inverse @ b.T)
    found = []
    for direction in vectors.T:
        arm = -inverse @ b.T @ direction
        found.append((cross(direction, arm), direction))
    return found


def _sphere(points: np.ndarray) -> Surface:
    solution = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(1), rcond=None)[0]
    center = solution[:3]
    radius = math.sqrt(max(float(solution[3] + center @ center), 1e-12))
    return Surface("sphere", tuple(center), (0.0, 0.0, 1.0), (radius,))


def basis(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors [3] across an axis [3]."""
    u = cross(axis, _UNIT[int(np.abs(axis).argmin())])
    u /= math.sqrt(u @ u)
    return u, cross(axis, u)


def _circle(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """Algebraic circle (Kasa): centre and radius."""
    solution = np.linalg.lstsq(np.column_stack([2 * x, 2 * y, np.ones(len(x))]), x * x + y * y, rcond=None)[0]
    cx, cy = float(solution[0]), float(solution[1])
    return cx, cy, math.sqrt(max(float(solution[2]) + cx * cx + cy * cy, 1e-12))


def _cylinder(points: np.ndarray, axis: np.ndarray) -> Surface:
    u, v = basis(axis)
    cx, cy, radius = _circle(points @ u, points @ v)
    return Surface("cylinder", tuple(cx * u + cy * v), tuple(axis), (radius,))


def _meridian(points: np.ndarray, point: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q = points - point
    h = q @ axis
    return np.sqrt(np.maximum(dot_rows(q, q) - h * h, 0.0)), h


def _cone(points: np.ndarray, point: np.ndarray, axis: np.ndarray) -> Surface:
    """A line through the meridian profile."""
    rho, h = _meridian(points, point, axis)
    centered = np.column_stack([rho - rho.mean(), h - h.mean()])
    along = np.linalg.eigh(centered.T @ centered)[1][:, 1]
    angle = math.atan2(along[0], along[1])
    angle = (angle + math.pi / 2) % math.pi - math.pi / 2
    angle = math.copysign(min(max(abs(angle), 1e-4), math.pi / 2 - 1e-4), angle)
    apex = point + axis * (h.mean() - rho.mean() / math.tan(angle))
    return Surface("cone", tuple(apex), tuple(axis * math.copysign(1.0, angle)), (abs(angle),))


def _cone_by_apex(points: np.ndarray, normals: np.ndarray) -> list[Surface]:
    """Every tangent plane meets the apex; seen from there the points lie on a circle of directions."""
    apex = np.linalg.lstsq(normals, (normals * points).sum(1), rcond=None)[0]
    rays = points - apex
    length = np.linalg.norm(rays, axis=1)
    rays = rays[length > 1e-9] / length[length > 1e-9, None]
    if len(rays) < 3:
        return []
    mean = rays.mean(0)
    axis = np.linalg.eigh((rays - mean).T @ (rays - mean))[1][:, 0]
    axis = axis if axis @ mean >= 0 else -axis
    angle = math.acos(min(max(float(axis @ mean), 1e-4), 1 - 1e-8))
    return [Surface("cone", tuple(apex), tuple(axis), (angle,))]


def _torus(points: np.ndarray, point: np.ndarray, axis: np.ndarray) -> Surface:
    """A circle through the meridian profile."""
    rho, h = _meridian(points, point, axis)
    major, height, minor = _circle(rho, h)
    return Surface("torus", tuple(point + height * axis), tuple(axis), (abs(major), minor))


def _by_own_normals(points: np.ndarray) -> list[Surface]:
    """Tori by the normals of each point's neighbourhood: a short arc of a torus escapes the sweep."""
    _, near = KDTree(points).query(points, k=12)
    around = points[near] - points[near].mean(1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]
    return [_torus(points, p, a) for p, a in revolution_axes(points, normals)]


def _directions(points: np.ndarray, count: int) -> np.ndarray:
    """Principal and coordinate axes, then a Fibonacci half sphere."""
    principal = np.linalg.eigh(np.cov(points.T))[1].T
    return np.vstack([principal, np.eye(3), half_sphere(count)])


def _sweep_axes(kind: str, points: np.ndarray) -> list[Surface]:
    """Guesses without normals: for each of many directions the best quadric of revolution about it is linear; keep the best few."""
    scored = []
    for axis in _directions(points, 60):
        u, v = basis(axis)
        x, y, h = points @ u, points @ v, points @ axis
        columns = [2 * x, 2 * y, np.ones(len(x))]
        if kind != "cylinder":
            columns += [h, h * h]
        matrix, target = np.column_stack(columns), x * x + y * y
        solution = np.linalg.lstsq(matrix, target, rcond=None)[0]
        foot = solution[0] * u + solution[1] * v
        spread = np.sqrt(np.maximum((x - solution[0]) ** 2 + (y - solution[1]) ** 2, 1e-12)).mean()
        scored.append((float(np.abs(matrix @ solution - target).mean()) / spread, foot, axis))
    scored.sort(key=lambda item: item[0])
    # a quadric says little about a torus: there every direction is tried
    best = scored[: len(scored) if kind == "torus" else 6]
    build = {"cylinder": lambda p, _, axis: _cylinder(p, axis), "cone": _cone, "torus": _torus}[kind]
    return [build(points, foot, axis) for _, foot, axis in best]
