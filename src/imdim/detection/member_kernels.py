"""Which triangles a carrier explains, compiled: a guess is asked of every free triangle, most of which say no at their first corner."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from imdim.detection.fit_kernels import CODES as FITTED
from imdim.detection.fit_kernels import CONE, CYLINDER, SPHERE, TORUS
from imdim.geometry.surface import FRAMED, Surface

PLANE, OVAL = 4, 5  # beside the kinds that are fitted by kernels
CODES = {**FITTED, "plane": PLANE, "ellipsoid": OVAL, "elliptic": OVAL}


class Carrier(NamedTuple):
    """A surface as kernels have it: a code, its point [3], its axis [3], its frame [3, 3], its sizes [3], in place of a cone's the cosine
    and the sine of that, and by what a frame's directions are stretched from the unit ball [3]."""

    kind: int
    point: np.ndarray
    axis: np.ndarray
    frame: np.ndarray
    sizes: np.ndarray
    stretch: np.ndarray

    @staticmethod
    def of(surface: Surface) -> Carrier:
        is_framed = surface.kind in FRAMED
        frame = np.ascontiguousarray(surface.frame) if is_framed else np.eye(3)
        own = (math.cos(surface.sizes[0]), math.sin(surface.sizes[0])) if surface.kind == "cone" else surface.sizes
        sizes = surface.semi_axes if is_framed else np.array((*own, 0.0, 0.0, 0.0)[:3])
        stretch = np.array((*surface.sizes, 1.0)[:3]) if is_framed else np.ones(3)
        return Carrier(CODES[surface.kind], np.array(surface.point), np.array(surface.axis), frame, sizes, stretch)


@njit(nogil=True, cache=True, error_model="numpy")
def lie_within(carrier, corners, turns, chosen, slack):  # pragma: no cover - compiled
    """Whether of the `chosen` [t] triangles with `corners` [f, 3, 3] each corner is no farther from a carrier than `slack`, by
    `signed_distance`; those alone in which their facet `turns` [f, 3]."""
    good = np.empty(len(chosen), np.bool_)
    for t in range(len(chosen)):
        good[t] = True
        for c in range(3):
            x, y, z = corners[chosen[t], c]
            if turns[chosen[t], c] and abs(_measure(carrier, x, y, z)) > slack:
                good[t] = False
                break
    return good


@njit(nogil=True, cache=True, error_model="numpy")
def follow(carrier, corners, facing, chosen, blur):  # pragma: no cover - compiled
    """Of the `chosen` [t] triangles with `corners` [f, 3, 3], of facets with normals `facing` [t, 3], the least cosine between that and the
    carrier's normals at the corners and the middle, the cosine in the middle, and how far that is off the carrier [t].

    On an ellipsoid, and an elliptic cylinder, directions are compared as those on the ball, or the round cylinder, that it is stretched
    from. Within `blur` of a cone's apex there is no normal.
    """
    least, middle, off = np.empty(len(chosen)), np.empty(len(chosen)), np.empty(len(chosen))
    probe, face, normal = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(chosen)):
        _stretch(carrier, facing[t], face)
        lowest = 1.0
        for c in range(4):
            for k in range(3):
                at = corners[chosen[t], :, k]
                probe[k] = at[c] if c < 3 else (at[0] + at[1] + at[2]) / 3
            along = abs(_turn_to(carrier, probe, face, normal, blur))
            lowest = min(lowest, along)
        least[t], middle[t], off[t] = lowest, along, abs(_measure(carrier, probe[0], probe[1], probe[2]))
    return least, middle, off


@njit(nogil=True, cache=True, error_model="numpy")
def _measure(carrier, x, y, z):  # pragma: no cover - compiled
    """The signed distance of a place."""
    kind, sizes, axis, frame = carrier.kind, carrier.sizes, carrier.axis, carrier.frame
    x, y, z = x - carrier.point[0], y - carrier.point[1], z - carrier.point[2]
    if kind == OVAL:
        level, slope = 0.0, 0.0
        for k in range(3):
            along = (x * frame[0, k] + y * frame[1, k] + z * frame[2, k]) / sizes[k]
            level += along * along
            slope += (along / sizes[k]) ** 2
        level, slope = math.sqrt(level), math.sqrt(slope)
        return (level - 1) * (level / slope if slope > 0 else min(sizes[0], sizes[1], sizes[2]))
    square = x * x + y * y + z * z
    if kind == SPHERE:
        return math.sqrt(square) - sizes[0]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    if kind == PLANE:
        return h
    across = math.sqrt(max(square - h * h, 0.0))
    if kind == CYLINDER:
        return across - sizes[0]
    if kind == CONE:
        return across * sizes[0] - h * sizes[1]
    return math.sqrt((across - sizes[0]) ** 2 + h * h) - sizes[1]


@njit(nogil=True, cache=True, error_model="numpy")
def _stretch(carrier, facing, face):  # pragma: no cover - compiled
    """Fill in a normal `face` [3] as it is on the ball that a carrier with a frame is stretched from, in that frame; others as they are."""
    for k in range(3):
        face[k] = facing[k]
    if carrier.kind == OVAL:
        for k in range(3):
            face[k] = carrier.stretch[k] * (
                facing[0] * carrier.frame[0, k] + facing[1] * carrier.frame[1, k] + facing[2] * carrier.frame[2, k]
            )
        _make_unit(face)


@njit(nogil=True, cache=True, error_model="numpy")
def _turn_to(carrier, probe, face, normal, blur):  # pragma: no cover - compiled
    """The cosine between a normal `face` [3], as `_stretch` gives it, and the carrier's at a `probe` [3]; `normal` [3] is room to work."""
    kind, axis = carrier.kind, carrier.axis
    for k in range(3):
        normal[k] = probe[k] - carrier.point[k]
    if kind == CONE and math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) < blur:
        return 1.0
    if kind == OVAL:
        x, y, z = normal
        for k in range(3):
            local = x * carrier.frame[0, k] + y * carrier.frame[1, k] + z * carrier.frame[2, k]
            normal[k] = carrier.stretch[k] * local / carrier.sizes[k] ** 2
    elif kind == PLANE:
        normal[:] = axis
    elif kind != SPHERE:
        h = normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2]
        x, y, z = normal
        for k in range(3):
            normal[k] -= h * axis[k]
        _make_unit(normal)
        if kind == CONE:
            for k in range(3):
                normal[k] = normal[k] * carrier.sizes[0] - axis[k] * carrier.sizes[1]
        elif kind == TORUS:
            normal[0] = x - carrier.sizes[0] * normal[0]
            normal[1] = y - carrier.sizes[0] * normal[1]
            normal[2] = z - carrier.sizes[0] * normal[2]
    _make_unit(normal)
    return normal[0] * face[0] + normal[1] * face[1] + normal[2] * face[2]


@njit(nogil=True, cache=True, error_model="numpy")
def _make_unit(v):  # pragma: no cover - compiled
    length = max(math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1e-300)
    for k in range(3):
        v[k] /= length
