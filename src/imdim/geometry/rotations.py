"""Rotation matrices and OpenSCAD's Euler degrees, ``R = Rz(rz) @ Ry(ry) @ Rx(rx)``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from imdim.program.tree import Vec3


def matrix_from_euler(euler_deg: Vec3) -> np.ndarray:
    """The [3, 3] rotation of OpenSCAD's ``rotate([rx, ry, rz])``."""
    return np.array(rotation_rows(*([f(math.radians(a)) for a in euler_deg] for f in (math.cos, math.sin))))


def rotation_rows(cosines: Iterable[Any], sines: Iterable[Any]) -> tuple[tuple[Any, Any, Any], ...]:
    """The rows of ``Rz @ Ry @ Rx`` from the cosines and sines of three angles: floats, arrays or tensors."""
    (cx, cy, cz), (sx, sy, sz) = cosines, sines
    return (
        (cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz),
        (cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz),
        (-sy, sx * cy, cx * cy),
    )


def euler_from_matrix(rotation: np.ndarray) -> Vec3:
    """Euler degrees of a proper rotation; at the gimbal lock (ry = +-90) rx is set to 0."""
    sy = -float(rotation[2, 0])
    if abs(sy) > 1 - 1e-12:
        # here only rz -+ rx is defined
        rz = math.atan2(-rotation[0, 1], rotation[1, 1])
        return (0.0, math.copysign(90.0, sy), math.degrees(rz))
    rx = math.atan2(rotation[2, 1], rotation[2, 2])
    rz = math.atan2(rotation[1, 0], rotation[0, 0])
    return (math.degrees(rx), math.degrees(math.asin(sy)), math.degrees(rz))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two vectors [3]; np.cross takes most of its time to sort out its axes."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def frame_from_axis(axis: np.ndarray) -> np.ndarray:
    """A rotation [3, 3] whose third column is the unit vector `axis`; identity for +z."""
    z = np.asarray(axis, float) / np.linalg.norm(axis)
    seed = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = seed - seed @ z * z
    x /= np.linalg.norm(x)
    return np.stack([x, cross(z, x), z], axis=1)


def turn_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """The rotation [3, 3] by an angle in radians about a unit vector (Rodrigues)."""
    turned = skew(axis)
    return np.eye(3) + math.sin(angle) * turned + (1 - math.cos(angle)) * turned @ turned


def shortest_turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation [3, 3] that takes the unit vector `a` to `b`, which must not be opposite."""
    normal = cross(a, b)
    sine = float(np.linalg.norm(normal))
    return np.eye(3) if sine == 0 else turn_about(normal / sine, math.atan2(sine, float(a @ b)))


def skew(vectors: np.ndarray) -> np.ndarray:
    """The matrices [..., 3, 3] that multiply a vector b to a x b, of each of `vectors` a [..., 3]."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*vectors.shape, 3)


def matrices_from_euler(euler_deg: np.ndarray) -> np.ndarray:
    """The rotations [k, 3, 3] of Euler degrees [k, 3]."""
    return np.array(rotation_rows(*(f(np.radians(np.asarray(euler_deg, float))).T for f in (np.cos, np.sin)))).transpose(2, 0, 1)
