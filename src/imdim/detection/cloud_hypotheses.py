"""Carrier surfaces through minimal sets of cloud points: near points with normals, or few points about an axis already known."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from imdim.detection.cloud_kernels import CONE, CYLINDER, ELLIPSOID, PLANE, ROW, SPHERE, TORUS, pack
from imdim.detection.fit_ellipsoid import quadric_ellipsoid
from imdim.geometry.surface import unit

QUADRIC_POINTS, QUADRIC_SEEDS = (30, 100, 300), 12  # points in a neighbourhood, and neighbourhoods, that ellipsoids are laid through


def propose(
    points: np.ndarray,
    normals: np.ndarray,
    directions: np.ndarray,
    axes: np.ndarray,
    count: int,
    rng: np.random.Generator,
    ellipsoids: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """About 4 `count` hypotheses as kinds [h] and rows [h, 12], every set drawn near one random point (Schnabel et al. 2007, 4.3).

    `directions` [d, 3] and `axes` [a, 6] (point, direction) are those of surfaces already found: designed parts repeat them,
    and with them three points without normals make a cylinder and two a cone.
    """
    draw = _Draw(points, normals, rng)
    found = [_planes(draw, count), _spheres(draw, count // 2), _cylinders(draw, count), _cones(draw, count // 2)]
    if len(directions):
        found += [_cylinders_along(draw, directions, count), _planes_across(draw, directions, count)]
    if len(axes):
        found += _about(draw, axes, count // 2)
    if ellipsoids:
        found.append(_ellipsoids(draw))
    kinds = np.concatenate([np.full(len(rows), kind) for kind, rows in found])
    rows = np.vstack([rows for _, rows in found])
    size = np.ptp(points, axis=0).max() + 1e-12
    good = np.isfinite(rows).all(1) & (np.abs(rows[:, 6]) < 20 * size) & (np.abs(rows[:, :3] - points.mean(0)).max(1) < 50 * size)
    return kinds[good].astype(np.int64), np.ascontiguousarray(rows[good])


class _Draw:
    """Draws sets of points, each set within one neighbourhood of random size."""

    def __init__(self, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> None:
        self.points, self.normals, self.rng = points, normals, rng
        self.tree = KDTree(points)
        self.sizes = [k for k in (8, 16, 40, 120) if k < len(points)] or [len(points)]

    def sets(self, count: int, members: int) -> np.ndarray:
        """Indices [<= count, members]."""
        out = []
        for k in self.sizes:
            seeds = self.rng.integers(len(self.points), size=-(-count // len(self.sizes)))
            near = self.tree.query(self.points[seeds], k=k)[1].reshape(len(seeds), -1)
            picks = self.rng.integers(1 if k > 1 else 0, near.shape[1], size=(len(seeds), members - 1))
            out.append(np.column_stack([seeds, np.take_along_axis(near, picks, 1)]))
        return np.vstack(out)


def _rows(point: np.ndarray, axis: np.ndarray, first: np.ndarray | float = 0.0, second: np.ndarray | float = 0.0) -> np.ndarray:
    out = np.zeros((len(point), ROW))
    out[:, :3], out[:, 3:6], out[:, 6], out[:, 7] = point, axis, first, second
    return out


def _planes(draw: _Draw, count: int) -> tuple[int, np.ndarray]:
    a, b, c = draw.points[draw.sets(count, 3)].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    keep = length > 0.1 * np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1) + 1e-300
    return PLANE, _rows(a[keep], across[keep] / length[keep, None])


def _spheres(draw: _Draw, count: int) -> tuple[int, np.ndarray]:
    """Where two normal lines pass each other."""
    pair = draw.sets(count, 2)
    (a, b), (n, m) = draw.points[pair].transpose(1, 0, 2), draw.normals[pair].transpose(1, 0, 2)
    c = (n * m).sum(1)
    gap, spread = b - a, np.maximum(1 - c * c, 1e-9)
    s = ((gap * n).sum(1) - c * (gap * m).sum(1)) / spread
    t = (c * (gap * n).sum(1) - (gap * m).sum(1)) / spread
    center = (a + s[:, None] * n + b + t[:, None] * m) / 2
    keep = spread > 0.003
    return SPHERE, _rows(center[keep], np.array([0.0, 0.0, 1.0]), (np.abs(s) + np.abs(t))[keep] / 2)


def _cylinders(draw: _Draw, count: int) -> tuple[int, np.ndarray]:
    """The axis is across both normals, and the normal lines seen along it meet on it."""
    pair = draw.sets(count, 2)
    (a, b), (n, m) = draw.points[pair].transpose(1, 0, 2), draw.normals[pair].transpose(1, 0, 2)
    across = np.cross(n, m)
    length = np.linalg.norm(across, axis=1)
    keep = length > 0.05
    a, b, n, m, axis = a[keep], b[keep], n[keep], m[keep], across[keep] / length[keep, None]
    side = np.cross(axis, m)
    s = ((b - a) * side).sum(1) / (n * side).sum(1)
    center = a + s[:, None] * n
    q = b - center
    far = np.linalg.norm(q - (q * axis).sum(1, keepdims=True) * axis, axis=1)
    return CYLINDER, _rows(center, axis, (np.abs(s) + far) / 2)


def _cones(draw: _Draw, count: int) -> tuple[int, np.ndarray]:
    """Three tangent planes meet in the apex; the rays to the three points lie on a circle about the axis."""
    triple = draw.sets(count, 3)
    p, n = draw.points[triple], draw.normals[triple]
    keep = np.abs(np.linalg.det(n)) > 1e-3
    p, n = p[keep], n[keep]
    if not len(p):
        return CONE, np.zeros((0, ROW))
    apex = np.linalg.solve(n, (n * p).sum(2)[:, :, None])[:, :, 0]
    ray = unit(p - apex[:, None])
    axis = unit(np.cross(ray[:, 1] - ray[:, 0], ray[:, 2] - ray[:, 0]))
    height = (axis * ray.mean(1)).sum(1)
    axis = axis * np.where(height < 0, -1.0, 1.0)[:, None]
    angle = np.arccos(np.clip(np.abs(height), 0, 1))
    good = (angle > 0.02) & (angle < 1.52)
    return CONE, _rows(apex[good], axis[good], angle[good])


def _ellipsoids(draw: _Draw) -> tuple[int, np.ndarray]:
    """Quadrics through neighbourhoods of points all over the cloud: nine points fix one, but only if they are exact."""
    rows, largest = [], 2 * float(np.ptp(draw.points, axis=0).max())  # beyond it they are cylinders
    for k in (k for k in QUADRIC_POINTS if k <= len(draw.points)):
        seeds = np.linspace(0, len(draw.points) - 1, QUADRIC_SEEDS).astype(int)
        for near in np.asarray(draw.tree.query(draw.points[seeds], k=k)[1]).reshape(-1, k):
            surface = quadric_ellipsoid(draw.points[near])
            rows += [pack(surface)] if surface and max(surface.sizes) < largest else []
    return ELLIPSOID, np.array(rows).reshape(-1, ROW)


def _bases(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    seed = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    u = unit(np.cross(axis, seed))
    return u, np.cross(axis, u)


def _circles(x: np.ndarray, y: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres of the circles through three points (x, y) [n, 3] as seen from the first, and whether these make a sine of `least`."""
    bx, by, cx, cy = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0], x[:, 2] - x[:, 0], y[:, 2] - y[:, 0]
    twice = 2 * (bx * cy - by * cx)
    bb, cc = bx * bx + by * by, cx * cx + cy * cy
    keep = np.abs(twice) > least * np.sqrt(bb * cc) + 1e-300
    safe = np.where(keep, twice, 1.0)
    return (cy * bb - by * cc) / safe, (bx * cc - cx * bb) / safe, keep


def _cylinders_along(draw: _Draw, directions: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """A circle through three points seen along a known direction."""
    triple = draw.sets(count, 3)
    axis = directions[draw.rng.integers(len(directions), size=len(triple))]
    u, v = _bases(axis)
    p = draw.points[triple]
    x, y = (p * u[:, None]).sum(2), (p * v[:, None]).sum(2)
    ox, oy, keep = _circles(x, y, 0.05)
    center = (x[:, 0] + ox)[:, None] * u + (y[:, 0] + oy)[:, None] * v
    return CYLINDER, _rows(center, axis, np.hypot(ox, oy))[keep]


def _planes_across(draw: _Draw, directions: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """A known direction needs one point only."""
    points = draw.points[draw.rng.integers(len(draw.points), size=count)]
    return PLANE, _rows(points, directions[draw.rng.integers(len(directions), size=count)])


def _about(draw: _Draw, axes: np.ndarray, count: int) -> list[tuple[int, np.ndarray]]:
    """Lines and circles in the half plane about a known axis: cylinders, cones, spheres and tori."""
    triple = draw.sets(count, 3)
    line = axes[draw.rng.integers(len(axes), size=len(triple))]
    foot, axis = line[:, :3], line[:, 3:]
    q = draw.points[triple] - foot[:, None]
    h = (q * axis[:, None]).sum(2)
    rho = np.sqrt(np.maximum((q * q).sum(2) - h * h, 0))
    cylinder = _rows(foot, axis, rho[:, 0])
    return [(CYLINDER, cylinder), _cones_about(foot, axis, rho, h), _spheres_about(foot, axis, rho, h), _tori_about(foot, axis, rho, h)]


def _cones_about(foot: np.ndarray, axis: np.ndarray, rho: np.ndarray, h: np.ndarray) -> tuple[int, np.ndarray]:
    run, rise = rho[:, 1] - rho[:, 0], h[:, 1] - h[:, 0]
    keep = (np.abs(run) > 0.02 * np.abs(rise)) & (np.abs(rise) > 0.02 * np.abs(run)) & (np.abs(rise) > 1e-12)
    foot, axis, rho, h, run, rise = foot[keep], axis[keep], rho[keep], h[keep], run[keep], rise[keep]
    slope = run / rise
    apex = foot + (h[:, 0] - rho[:, 0] / slope)[:, None] * axis
    return CONE, _rows(apex, axis * np.sign(slope)[:, None], np.arctan(np.abs(slope)))


def _spheres_about(foot: np.ndarray, axis: np.ndarray, rho: np.ndarray, h: np.ndarray) -> tuple[int, np.ndarray]:
    rise = h[:, 1] - h[:, 0]
    keep = np.abs(rise) > 1e-9
    rise = np.where(keep, rise, 1.0)
    height = (rho[:, 1] ** 2 - rho[:, 0] ** 2 + h[:, 1] ** 2 - h[:, 0] ** 2) / (2 * rise)
    radius = np.hypot(rho[:, 0], h[:, 0] - height)
    return SPHERE, _rows(foot + height[:, None] * axis, np.array([0.0, 0.0, 1.0]), radius)[keep]


def _tori_about(foot: np.ndarray, axis: np.ndarray, rho: np.ndarray, h: np.ndarray) -> tuple[int, np.ndarray]:
    ox, oy, keep = _circles(rho, h, 0.1)
    major, minor = rho[:, 0] + ox, np.hypot(ox, oy)
    keep &= (major > 1.05 * minor) & (minor > 0)
    return TORUS, _rows(foot + (h[:, 0] + oy)[:, None] * axis, axis, major, minor)[keep]
