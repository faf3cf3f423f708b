"""Compiled twins of the carrier surfaces' distances, and the score of many hypotheses over a cloud."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numba import njit

from imdim.geometry.surface import SURFACE_KINDS, Surface, vec

PLANE, SPHERE, CYLINDER, CONE, TORUS, ELLIPSOID = range(6)
ROW = 12  # numbers of a carrier


def pack(surface: Surface) -> np.ndarray:
    """Point, axis, sizes padded with zeros, and the direction across the axis: [12]."""
    sizes = (*surface.sizes, 0.0, 0.0, 0.0)[:3]
    return np.array([*surface.point, *surface.axis, *sizes, *surface.across])


def unpack(kind: int, row: np.ndarray) -> Surface:
    """The inverse of `pack`, for the kind of index `kind` in SURFACE_KINDS."""
    count = (0, 1, 1, 1, 2, 3)[kind]
    surface = Surface(SURFACE_KINDS[kind], vec(row), vec(row[3:6]), tuple(float(v) for v in row[6 : 6 + count]))
    return replace(surface, across=vec(row[9:])) if kind == ELLIPSOID else surface


@njit(cache=True, inline="always")
def in_ball(row, x, y, z):  # pragma: no cover - compiled
    """A vector in an ellipsoid's frame, each coordinate over its semi-axis."""
    ax, ay, az, bx, by, bz = row[3], row[4], row[5], row[9], row[10], row[11]
    across = (ay * bz - az * by) * x + (az * bx - ax * bz) * y + (ax * by - ay * bx) * z
    return (bx * x + by * y + bz * z) / row[6], across / row[7], (ax * x + ay * y + az * z) / row[8]


@njit(cache=True, inline="always")
def distance_and_cosine(kind, row, x, y, z, nx, ny, nz):  # pragma: no cover - compiled
    """Signed distance to a carrier, and the cosine between its gradient there and a given normal."""
    qx, qy, qz = x - row[0], y - row[1], z - row[2]
    ax, ay, az = row[3], row[4], row[5]
    if kind == PLANE:
        return qx * ax + qy * ay + qz * az, nx * ax + ny * ay + nz * az
    if kind == SPHERE:
        length = math.sqrt(qx * qx + qy * qy + qz * qz)
        return length - row[6], (nx * qx + ny * qy + nz * qz) / max(length, 1e-12)
    if kind == ELLIPSOID:
        u, v, w = in_ball(row, qx, qy, qz)
        nu, nv, nw = in_ball(row, nx, ny, nz)
        level = math.sqrt(u * u + v * v + w * w)
        slope = max(math.sqrt((u / row[6]) ** 2 + (v / row[7]) ** 2 + (w / row[8]) ** 2), 1e-12)
        return level * (level - 1.0) / slope, (nu * u + nv * v + nw * w) / slope
    h = qx * ax + qy * ay + qz * az
    rx, ry, rz = qx - h * ax, qy - h * ay, qz - h * az
    rho = math.sqrt(rx * rx + ry * ry + rz * rz)
    radial = (nx * rx + ny * ry + nz * rz) / max(rho, 1e-12)
    if kind == CYLINDER:
        return rho - row[6], radial
    axial = nx * ax + ny * ay + nz * az
    if kind == CONE:
        c, s = math.cos(row[6]), math.sin(row[6])
        return rho * c - h * s, radial * c - axial * s
    out = rho - row[6]
    length = math.hypot(out, h)
    return length - row[7], (radial * out + axial * h) / max(length, 1e-12)


@njit(cache=True, inline="always")
def gradient(kind, row, x, y, z):  # pragma: no cover - compiled
    """Unit gradient of the distance to a carrier: its cosines with the axes."""
    _, gx = distance_and_cosine(kind, row, x, y, z, 1.0, 0.0, 0.0)
    _, gy = distance_and_cosine(kind, row, x, y, z, 0.0, 1.0, 0.0)
    _, gz = distance_and_cosine(kind, row, x, y, z, 0.0, 0.0, 1.0)
    return gx, gy, gz


@njit(cache=True)
def gains(kind, row, tolerance, points, normals, trust, least_cosine):  # pragma: no cover - compiled
    """Per point 1 - (distance / tolerance)^2, 0 outside of the tolerance (MSAC, Torr & Zisserman 2000).

    A point whose normal disagrees counts by the distrust in its normal only.
    """
    out = np.zeros(len(points))
    for j in range(len(points)):
        d, c = distance_and_cosine(kind, row, points[j, 0], points[j, 1], points[j, 2], normals[j, 0], normals[j, 1], normals[j, 2])
        r = d / tolerance
        if -1.0 < r < 1.0:
            out[j] = 1.0 - r * r
            if abs(c) < least_cosine:
                out[j] *= 1.0 - trust[j]
    return out


@njit(cache=True)
def score(kinds, rows, tolerance, points, normals, trust, least_cosine):  # pragma: no cover - compiled
    """The sum of the `gains` of each hypothesis."""
    out = np.zeros(len(kinds))
    for i in range(len(kinds)):
        out[i] = gains(kinds[i], rows[i], tolerance[i], points, normals, trust, least_cosine).sum()
    return out


@njit(cache=True)
def sharp_gains(kind, row, tolerance, points, normals, trust, least_cosine):  # pragma: no cover - compiled
    """`gains` [n], halved for points beyond a quarter of the tolerance.

    A true carrier lies well within the tolerance; one that is laid over several others does not.
    """
    wide = gains(kind, row, tolerance, points, normals, trust, least_cosine)
    return 0.5 * (wide + gains(kind, row, 0.25 * tolerance, points, normals, trust, least_cosine))


def largest_plane(points: np.ndarray, triples: np.ndarray, tolerance: float) -> int:
    """The most points [n, 3] that one plane through a triple of them [t, 3] holds."""
    a, b, c = points[triples].transpose(1, 0, 2)
    sides, normal = np.hstack([b - a, c - a]), np.cross(b - a, c - a)
    length = np.sqrt((normal**2).sum(1))
    proper = (length >= 0.02 * (sides**2).sum(1)) & (length > 0)
    away = sum((points[:, i] - a[proper, i, None]) * normal[proper, i, None] for i in range(3))
    return int((np.abs(away) < tolerance * length[proper, None]).sum(1).max(initial=0))
