"""Even points on primitives as compiled loops: the lattice of `sampling.even_surface` through the maps of `surface_map`.

A search draws the surfaces of thousands of primitives, of some hundred points each, for which array operations take most of their time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from imdim.geometry.lowering import pack_all, split_params
from imdim.program.tree import KINDS, Primitive

GOLDEN, PLASTIC = 0.6180339887498949, 0.7548776662466927  # the golden ratio's inverse, that of the plastic number
BOX, SPHERE, CYLINDER, CONE, TORUS, ELLIPSOID = range(6)
assert KINDS[:6] == ("box", "sphere", "cylinder", "cone", "torus", "ellipsoid")


def draw_even(parts: Sequence[Primitive], counts: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """About `counts` points on each of the `parts`, which have no outlines, with outward unit normals, both [n, 3], one part after another;
    and where each part's begin, int64 [k + 1]. Of a torus and an ellipsoid fewer are kept."""
    kinds, params = pack_all(parts)
    sizes, centers, rotations = split_params(params)
    return _draw_even(kinds, sizes, centers, rotations, np.array(counts, np.int64))


@njit(nogil=True, cache=True)
def _draw_even(kinds, sizes, centers, rotations, counts):  # pragma: no cover - compiled
    points, normals = np.empty((counts.sum(), 3)), np.empty((counts.sum(), 3))
    starts, done = np.zeros(len(kinds) + 1, np.int64), 0
    local, normal, ends = np.empty(3), np.empty(3), np.empty(6)
    for k in range(len(kinds)):
        kind, size, n = kinds[k], sizes[k], counts[k]
        _find_ends(kind, size, ends)
        for i in range(n):
            u, golden = (i + 0.5) / n, (i * GOLDEN) % 1.0
            if kind == BOX:
                _on_box(size, ends, u, golden, local, normal)
            elif kind in (CYLINDER, CONE):
                top = size[0] if kind == CYLINDER else size[1]
                _on_cone(size[0], top, size[1] if kind == CYLINDER else size[2], ends, u, golden, local, normal)
            elif not _on_round(kind, size, u, golden, (i * PLASTIC) % 1.0, local, normal):
                continue
            for a in range(3):
                x, y, z = rotations[k, a, 0], rotations[k, a, 1], rotations[k, a, 2]
                points[done, a] = x * local[0] + y * local[1] + z * local[2] + centers[k, a]
                normals[done, a] = x * normal[0] + y * normal[1] + z * normal[2]
            done += 1
        starts[k + 1] = done
    return points[:done], normals[:done], starts


@njit(nogil=True, cache=True)
def _find_ends(kind, size, ends):  # pragma: no cover - compiled
    """Where the first of the uniform numbers passes on to the next face."""
    if kind == BOX:
        a, b, c = size[1] * size[2], size[2] * size[0], size[0] * size[1]
        whole = 2 * (a + b + c)
        ends[0], ends[1], ends[2] = a / whole, (a + b) / whole, 0.5
        for i in range(3):
            ends[3 + i] = 0.5 + ends[i]
    elif kind in (CYLINDER, CONE):
        bottom, top = size[0], (size[0] if kind == CYLINDER else size[1])
        side = (bottom + top) * math.hypot(bottom - top, size[1] if kind == CYLINDER else size[2])
        whole = bottom * bottom + top * top + side
        ends[0], ends[1] = bottom * bottom / whole, (bottom * bottom + top * top) / whole


@njit(nogil=True, cache=True)
def _on_box(size, ends, u, golden, local, normal):  # pragma: no cover - compiled
    face = 0
    while face < 5 and u >= ends[face]:
        face += 1
    start = ends[face - 1] if face else 0.0
    s, t, axis = (u - start) / max((1.0 if face == 5 else ends[face]) - start, 1e-300) - 0.5, golden - 0.5, face % 3
    sign = -1.0 if face < 3 else 1.0
    local[0], local[1], local[2] = s * size[0], (s if axis == 0 else t) * size[1], t * size[2]
    local[axis] = sign * size[axis] / 2
    normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
    normal[axis] = sign


@njit(nogil=True, cache=True)
def _on_cone(bottom, top, height, ends, u, golden, local, normal):  # pragma: no cover - compiled
    angle = 2 * math.pi * golden
    cosine, sine = math.cos(angle), math.sin(angle)
    if u >= ends[1]:
        at = (u - ends[1]) / max(1.0 - ends[1], 1e-300)
        rho = math.sqrt(bottom * bottom + (top * top - bottom * bottom) * at)
        along = at if bottom == top else (rho - bottom) / (top - bottom)
        slant = math.hypot(bottom - top, height)
        local[0], local[1], local[2] = rho * cosine, rho * sine, (along - 0.5) * height
        normal[0], normal[1], normal[2] = height / slant * cosine, height / slant * sine, (bottom - top) / slant
        return
    low = u < ends[0]
    start, end = (0.0, ends[0]) if low else (ends[0], ends[1])
    rho = (bottom if low else top) * math.sqrt((u - start) / max(end - start, 1e-300))
    side = -1.0 if low else 1.0
    local[0], local[1], local[2] = rho * cosine, rho * sine, side * height / 2
    normal[0], normal[1], normal[2] = 0.0, 0.0, side


@njit(nogil=True, cache=True)
def _on_round(kind, size, u, golden, chance, local, normal):  # pragma: no cover - compiled
    """Whether the place is kept: on a torus and an ellipsoid some are dropped, by the `chance`, where they would lie too dense."""
    if kind == TORUS:
        angle, around = 2 * math.pi * u, 2 * math.pi * golden
        rho = size[0] + size[1] * math.cos(around)
        local[0], local[1], local[2] = rho * math.cos(angle), rho * math.sin(angle), size[1] * math.sin(around)
        normal[0], normal[1] = math.cos(around) * math.cos(angle), math.cos(around) * math.sin(angle)
        normal[2] = math.sin(around)
        return chance < rho / (size[0] + size[1])
    height, angle = 2 * u - 1, 2 * math.pi * golden
    ring = math.sqrt(1 - height * height)
    normal[0], normal[1], normal[2] = ring * math.cos(angle), ring * math.sin(angle), height
    if kind == SPHERE:
        for a in range(3):
            local[a] = size[0] * normal[a]
        return True
    square = 0.0
    for a in range(3):
        local[a] = size[a] * normal[a]
        normal[a] /= size[a]
        square += normal[a] * normal[a]
    length = math.sqrt(square)
    for a in range(3):
        normal[a] /= length
    return chance < length * min(size[0], size[1], size[2])
