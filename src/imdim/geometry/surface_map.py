"""Area-weighted points on one primitive's surface, from uniform numbers: one set of formulas for numpy and torch.

`swept_surface` has those of drawn primitives, in numpy alone.

Each map takes the array namespace `xp` (numpy or torch; only functions that both share), the sizes as floats and uniforms `u` [n, 3].
It returns local points [n, 3], outward unit normals [n, 3] and the probability [n] with which the caller must keep each point for
the density to be even. Box, sphere, cylinder and cone are even already and return 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from imdim.geometry.swept_surface import face_areas, map_swept
from imdim.program.outline import Outline
from imdim.program.tree import Primitive

Array = Any  # numpy.ndarray or torch.Tensor
Mapped = tuple[Array, Array, Array]


def surface_area(kind: str, size: tuple[float, ...], outline: Outline | None = None) -> float:
    """Area of the primitive's surface in squared units; the ellipsoid's by Gauss quadrature."""
    if outline is not None:
        return float(face_areas(kind, size, outline).sum())
    if kind == "box":
        a, b, c = size
        return 2 * (a * b + b * c + c * a)
    if kind == "sphere":
        return 4 * math.pi * size[0] ** 2
    if kind == "cylinder":
        return 2 * math.pi * size[0] * (size[0] + size[1])
    if kind == "cone":
        bottom, top, h = size
        return math.pi * (bottom**2 + top**2 + (bottom + top) * math.hypot(bottom - top, h))
    if kind == "torus":
        return 4 * math.pi**2 * size[0] * size[1]
    return _ellipsoid_area(size)


def _ellipsoid_area(size: tuple[float, ...]) -> float:
    a, b, c = size
    z, weight = np.polynomial.legendre.leggauss(64)
    angle = (np.arange(128) + 0.5) * (math.pi / 64)
    ring = np.sqrt(1 - z**2)[:, None]
    stretch = a * b * c * np.sqrt((ring * np.cos(angle) / a) ** 2 + (ring * np.sin(angle) / b) ** 2 + (z[:, None] / c) ** 2)
    return float(2 * math.pi * (stretch.mean(1) * weight).sum())


def map_surface(primitive: Primitive, u: np.ndarray) -> Mapped:
    """Local points, normals and shares of any primitive, in numpy."""
    if primitive.outline is not None:
        return map_swept(primitive.kind, primitive.size, primitive.outline, u)
    return SURFACE_MAPS[primitive.kind](np, primitive.size, u)


def _box_ends(size: tuple[float, ...]) -> np.ndarray:
    a, b, c = size
    return np.cumsum([b * c, c * a, a * b]) / (b * c + c * a + a * b)


def _cone_ends(size: tuple[float, ...]) -> np.ndarray:
    bottom, top, h = size
    parts = np.array([bottom**2, top**2, (bottom + top) * math.hypot(bottom - top, h)])
    return np.cumsum(parts) / parts.sum()


def _ones(u: Array) -> Array:
    return u[:, 0] * 0 + 1


def _box(xp: Any, size: tuple[float, ...], u: Array) -> Mapped:
    ends = _box_ends(size)
    pick = u[:, 0] * 2
    sign = xp.where(pick < 1, -1.0, 1.0)
    pick = xp.where(pick < 1, pick, pick - 1)
    on_x, on_z = pick < ends[0], pick >= ends[1]
    on_y = ~(on_x | on_z)
    s, t, none = u[:, 1] - 0.5, u[:, 2] - 0.5, u[:, 0] * 0
    # the free coordinates are s and t, the fixed one is at half the edge
    unit = xp.stack([xp.where(on_x, sign / 2, s), xp.where(on_y, sign / 2, xp.where(on_x, s, t)), xp.where(on_z, sign / 2, t)], -1)
    normals = xp.stack([xp.where(flag, sign, none) for flag in (on_x, on_y, on_z)], -1)
    return _scale(xp, unit, size), normals, _ones(u)


def _scale(xp: Any, points: Array, factors: tuple[float, ...]) -> Array:
    return xp.stack([points[:, i] * f for i, f in enumerate(factors)], -1)


def _direction(xp: Any, u: Array) -> Array:
    z, angle = 2 * u[:, 0] - 1, 2 * math.pi * u[:, 1]
    ring = xp.sqrt(1 - z * z)
    return xp.stack([ring * xp.cos(angle), ring * xp.sin(angle), z], -1)


def _sphere(xp: Any, size: tuple[float, ...], u: Array) -> Mapped:
    direction = _direction(xp, u)
    return direction * size[0], direction, _ones(u)


def _ellipsoid(xp: Any, size: tuple[float, ...], u: Array) -> Mapped:
    direction = _direction(xp, u)
    gradient = _scale(xp, direction, tuple(1 / s for s in size))
    length = xp.sqrt((gradient * gradient).sum(-1))
    # a patch of the unit sphere grows by abc |u / s|, at most abc / min(s)
    return _scale(xp, direction, size), gradient / length[:, None], length * min(size)


def _cone(xp: Any, size: tuple[float, ...], u: Array) -> Mapped:
    bottom, top, h = size
    slant = math.hypot(bottom - top, h)
    ends = _cone_ends(size)
    on_bottom, on_side = u[:, 0] < ends[0], u[:, 0] >= ends[1]
    # radii are drawn evenly in their square: on a disc from 0 to its radius, on the slant from the bottom's to the top's
    square = xp.where(on_side, bottom**2 + (top**2 - bottom**2) * u[:, 1], xp.where(on_bottom, bottom**2, top**2) * u[:, 1])
    rho = xp.sqrt(square)
    along = u[:, 1] if bottom == top else (rho - bottom) / (top - bottom)
    z = xp.where(on_side, along - 0.5, xp.where(on_bottom, -0.5, 0.5)) * h
    angle = 2 * math.pi * u[:, 2]
    outward = xp.where(on_side, h / slant, 0.0)
    upward = xp.where(on_side, (bottom - top) / slant, xp.where(on_bottom, -1.0, 1.0))
    cos, sin = xp.cos(angle), xp.sin(angle)
    return xp.stack([rho * cos, rho * sin, z], -1), xp.stack([outward * cos, outward * sin, upward], -1), _ones(u)


def _torus(xp: Any, size: tuple[float, ...], u: Array) -> Mapped:
    major, minor = size
    angle, around = 2 * math.pi * u[:, 0], 2 * math.pi * u[:, 1]
    rho = major + minor * xp.cos(around)
    points = xp.stack([rho * xp.cos(angle), rho * xp.sin(angle), minor * xp.sin(around)], -1)
    normals = xp.stack([xp.cos(around) * xp.cos(angle), xp.cos(around) * xp.sin(angle), xp.sin(around)], -1)
    return points, normals, rho / (major + minor)


SURFACE_MAPS: Mapping[str, Callable[[Any, tuple[float, ...], Array], Mapped]] = {
    "box": _box,
    "sphere": _sphere,
    "cylinder": lambda xp, size, u: _cone(xp, (size[0], size[0], size[1]), u),
    "cone": _cone,
    "torus": _torus,
    "ellipsoid": _ellipsoid,
}
