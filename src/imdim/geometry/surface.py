"""Unbounded carrier surfaces: what detection finds and what candidate solids are made of.

One uniform record, like `Primitive`: kind, point, axis, sizes.

=========  =======================  ==========================================  ================
kind       point                    axis (unit)                                 sizes
=========  =======================  ==========================================  ================
plane      a point on it            normal                                      ()
sphere     centre                   (0, 0, 1)                                   (r,)
cylinder   a point on the axis      axis                                        (r,)
cone       apex                     from the apex into the nappe that is used   (half_angle_rad,)
torus      centre                   axis                                        (r_major, r_minor)
ellipsoid  centre                   along the third semi-axis                   (rx, ry, rz)
elliptic   a point on the axis      axis                                        (rx, ry)
=========  =======================  ==========================================  ================

An ellipsoid and an elliptic cylinder also have `across`, the unit vector along the first semi-axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imdim.geometry.rotations import cross
from imdim.geometry.rows import dot_rows, lengths
from imdim.program.tree import Vec3

SURFACE_KINDS = ("plane", "sphere", "cylinder", "cone", "torus", "ellipsoid", "elliptic")
AXISLESS = ("sphere", "ellipsoid")  # whose axis is none that other surfaces of a part share
FRAMED = ("ellipsoid", "elliptic")  # that have semi-axes
CLOSED_KINDS = ("sphere", "torus", "ellipsoid")  # that bound a solid by themselves


@dataclass(frozen=True, slots=True)
class Surface:
    """An unbounded surface; see the module's table for the meaning of the fields."""

    kind: str
    point: Vec3
    axis: Vec3
    sizes: tuple[float, ...] = ()
    across: Vec3 = (1.0, 0.0, 0.0)

    @property
    def frame(self) -> np.ndarray:
        """The rotation [3, 3] whose columns are the semi-axes, the third the axis of an elliptic cylinder."""
        x, z = np.asarray(self.across), np.asarray(self.axis)
        return np.stack([x, cross(z, x), z], axis=1)

    @property
    def semi_axes(self) -> np.ndarray:
        """The semi-axes [3] of a FRAMED kind; an elliptic cylinder's third is infinite."""
        return np.array(self.sizes if self.kind == "ellipsoid" else (*self.sizes, np.inf))


@dataclass(frozen=True)
class Patch:
    """A piece of a carrier that the target shows.

    `points` [m, 3] are samples of the piece (mesh vertices or cloud points), `area` its area in squared units,
    `outward` is +1 where the target's outside lies on the positive side of `signed_distance` (a boss, a convex wall),
    -1 where it lies on the negative side (the wall of a hole), 0 where it is not known.
    """

    surface: Surface
    points: np.ndarray
    area: float
    outward: int = 0


def vec(v: np.ndarray) -> Vec3:
    """Plain floats, which keep a `Surface` hashable."""
    return (float(v[0]), float(v[1]), float(v[2]))


def make_elliptic(point: np.ndarray, axis: np.ndarray, across: np.ndarray, semi_axes: np.ndarray) -> Surface:
    """The elliptic cylinder about a line through `point` [3] along a unit `axis` [3], its first semi-axis along `across`."""
    return Surface("elliptic", vec(point), vec(axis), (float(semi_axes[0]), float(semi_axes[1])), vec(across))


def is_spindle(surface: Surface) -> bool:
    """Whether this is a torus that crosses itself, r_minor > r_major, which no primitive is."""
    return surface.kind == "torus" and surface.sizes[1] > surface.sizes[0]


def signed_distance(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distance [n] of `points` [n, 3]: negative on the side of the axis or centre, and behind a plane's normal.

    The cone is the single nappe along +axis; its distance is exact outside the apex region. The ellipsoid's and the elliptic cylinder's
    are those of their own fields, |q| (|q| - 1) / |gradient|, exact to second order near the surface.
    """
    q = np.asarray(points, float) - surface.point
    if surface.kind in FRAMED:
        level, slope = ellipsoid_field(q @ surface.frame, surface.semi_axes)
        return (level - 1) * np.where(slope > 0, level / np.maximum(slope, 1e-300), min(surface.sizes))
    return _distance(surface.kind, q, np.asarray(surface.axis), surface.sizes)


def _distance(kind: str, q: np.ndarray, axis: np.ndarray, sizes: Sequence[Any]) -> np.ndarray:
    """`signed_distance` of points from a surface's own q [n, 3], of a kind without a frame; of one surface, or one for each point: then the
    `axis` is [n, 3] and each size [n]."""
    if kind == "sphere":
        return lengths(q) - sizes[0]
    h = q @ axis if axis.ndim == 1 else dot_rows(q, axis)
    if kind == "plane":
        return h
    rho = np.sqrt(np.maximum(dot_rows(q, q) - h * h, 0.0))
    if kind == "cylinder":
        return rho - sizes[0]
    if kind == "cone":
        cos, sin = _cos_sin(sizes[0])
        return rho * cos - h * sin
    if kind == "torus":
        return np.hypot(rho - sizes[0], h) - sizes[1]
    raise ValueError(f"unknown surface kind {kind!r}; known are {', '.join(SURFACE_KINDS)}")


def _cos_sin(angle: Any) -> tuple[Any, Any]:
    """Of a number, or of many."""
    return (np.cos(angle), np.sin(angle)) if isinstance(angle, np.ndarray) else (math.cos(angle), math.sin(angle))


def normals(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Unit gradients [n, 3] of `signed_distance` at `points` [n, 3]."""
    q = np.asarray(points, float) - surface.point
    if surface.kind in FRAMED:
        return unit((q @ surface.frame) / np.square(surface.semi_axes)) @ surface.frame.T
    return _gradients(surface.kind, q, np.asarray(surface.axis), surface.sizes)


def _gradients(kind: str, q: np.ndarray, axis: np.ndarray, sizes: Sequence[Any]) -> np.ndarray:
    """`normals`, as `_distance` of `signed_distance`."""
    if kind == "plane":
        return np.broadcast_to(axis, q.shape)
    if kind == "sphere":
        return unit(q)
    h = q @ axis if axis.ndim == 1 else dot_rows(q, axis)
    radial = unit(q - h[:, None] * axis)
    if kind == "cylinder":
        return radial
    first = sizes[0][:, None] if isinstance(sizes[0], np.ndarray) else sizes[0]
    if kind == "cone":
        cos, sin = _cos_sin(first)
        return radial * cos - axis * sin
    if kind == "torus":
        return unit(q - first * radial)
    raise ValueError(f"unknown surface kind {kind!r}; known are {', '.join(SURFACE_KINDS)}")


class SurfaceTable:
    """Several surfaces, of which each of many points may have its own."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._surfaces = surfaces
        self._kinds = np.array([SURFACE_KINDS.index(s.kind) for s in surfaces])
        self._points, self._axes = np.array([s.point for s in surfaces], float), np.array([s.axis for s in surfaces], float)
        self._sizes = np.array([(*s.sizes, 0.0, 0.0)[:2] for s in surfaces], float)

    def look(self, points: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distances [n] and normals [n, 3] at points [n, 3] of the surfaces whose numbers are their `own` [n]."""
        away, out = np.empty(len(points)), np.empty((len(points), 3))
        kinds = self._kinds[own]
        for number in np.unique(kinds):
            kind, at = SURFACE_KINDS[number], np.flatnonzero(kinds == number)
            if kind in FRAMED:
                for which in np.unique(own[at]):
                    some = at[own[at] == which]
                    away[some] = signed_distance(self._surfaces[which], points[some])
                    out[some] = normals(self._surfaces[which], points[some])
                continue
            which = own[at]
            q, axes, sizes = points[at] - self._points[which], self._axes[which], [*self._sizes[which].T]
            away[at], out[at] = _distance(kind, q, axes, sizes), _gradients(kind, q, axes, sizes)
        return away, out


def ellipsoid_field(local: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """|q / s| and |q / s^2| of points q [n, 3] in the frame of an ellipsoid of semi-axes s [3]."""
    return lengths(local / sizes), lengths(local / sizes**2)


def unit(v: np.ndarray) -> np.ndarray:
    """Vectors [..., 3] made 1 long, those of no length left."""
    return v / np.maximum(lengths(v), 1e-300)[..., None]
