"""How far points are from the surface of a primitive, with numpy alone.

For a process that asks a few hundred times and would load the compiled kernels for longer than that takes. `sdf.py` says what is
computed; here it has no sign and no derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from imdim.geometry.lowering import Outlines, draft_motions
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.ellipse import Ellipse, ellipse_distance, holds_point
from imdim.program.outline import Outline
from imdim.program.tree import FULL_TURN, Primitive

_Local = Callable[[Primitive, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def measure_distances(leaf: Primitive, points: np.ndarray) -> np.ndarray:
    """Distances [n] of `points` [n, 3] from the surface of a primitive, of an ellipsoid as `sdf.py` has it."""
    local = (points - np.asarray(leaf.center)) @ matrix_from_euler(leaf.rotation)
    return np.abs(LOCAL[leaf.kind](leaf, *local.T))


def _corner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Signed distance to the corner of two half-planes at right angles."""
    return np.minimum(np.maximum(a, b), 0.0) + np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0))


def _box(leaf: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    a, b, c = (np.abs(at) - size / 2 for at, size in zip((x, y, z), leaf.size, strict=True))
    return _corner(_corner(a, b), c)


def _cone(leaf: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    bottom, top, height = leaf.size
    rho, cap, narrowing = np.hypot(x, y), np.abs(z) - height / 2, top - bottom
    r, h, slant2 = rho - bottom, z + height / 2, narrowing**2 + height**2
    within = np.maximum((r * height - h * narrowing) / math.sqrt(slant2), cap)
    t = np.clip((r * narrowing + h * height) / slant2, 0.0, 1.0)
    to_cap = np.hypot(np.maximum(rho - np.where(z < 0, bottom, top), 0.0), cap)
    return np.where(within > 0, np.minimum(to_cap, np.hypot(r - t * narrowing, h - t * height)), within)


def _ellipsoid(leaf: Primitive, *at: np.ndarray) -> np.ndarray:
    k0, k1 = (np.sqrt(sum((c / s**power) ** 2 for c, s in zip(at, leaf.size, strict=True))) for power in (1, 2))
    return np.maximum(k0 * (k0 - 1) / np.where(k1 > 0, k1, 1.0), -min(leaf.size))


def _extrude(leaf: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    assert leaf.outline is not None
    return _corner(_outline(leaf.outline, x, y, turned=False), np.abs(z) - leaf.size[0] / 2)


def _drafted(leaf: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    assert leaf.outline is not None
    height, draft = leaf.size
    inset = np.clip(z + height / 2, 0.0, height) * math.tan(math.radians(draft))
    curves = Outlines.pack([leaf.outline]).curves
    section = curves.T[:, :, None] + inset * draft_motions(curves).T[:, :, None]
    nearest, odd = _beside_curves(section, x, y)
    return _corner(np.where(odd, -nearest, nearest) * math.cos(math.radians(draft)), np.abs(z) - height / 2)


def _revolve(leaf: Primitive, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    assert leaf.outline is not None
    rho = np.hypot(x, y)
    whole = _outline(leaf.outline, rho, z, turned=True)
    if leaf.size[0] >= FULL_TURN:
        return whole
    at, angle = np.arctan2(y, x) % (2 * math.pi), math.radians(leaf.size[0])
    # of both end faces the one that a point is turned away from less
    off = np.minimum(np.abs(angle - at), np.where(at > angle, 2 * math.pi - at, at))
    beyond = _corner(np.maximum(_outline(leaf.outline, rho * np.cos(off), z, turned=False), 0.0), rho * np.sin(off))
    return np.where(at > angle, beyond, np.maximum(whole, -rho * np.sin(np.minimum(off, math.pi / 2))))


def _outline(outline: Outline, x: np.ndarray, y: np.ndarray, turned: bool) -> np.ndarray:
    """Signed distances [n] of points of the plane; lines along the axis of what is `turned` bound nothing."""
    curves = Outlines.pack([outline]).curves
    on_axis = (curves[:, [0, 2, 4]] == 0).all(axis=1)
    nearest, odd = _beside_curves(curves[(curves[:, 7] >= 0) & ~(turned & on_axis)].T[:, :, None], x, y)
    points = list(zip(x.tolist(), y.tolist(), strict=True))
    for loop in (loop for loop in outline.loops if isinstance(loop, Ellipse)):
        nearest = np.minimum(nearest, [ellipse_distance(loop, point) for point in points])
        odd ^= np.array([holds_point(loop, *point) for point in points], bool)
    return np.where(odd, -nearest, nearest)


def _beside_curves(curves: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances [n] to the nearest of lines and arcs [8, c, 1], or of those of each point [8, c, n], and whether a ray from a point crosses
    them an odd number of times [n].

    The parity is that of the chords, turned for each arc that has the point between it and its chord (see `outline.is_in_loop`).
    """
    if not curves.shape[1]:
        return np.full(len(x), np.inf), np.zeros(len(x), bool)
    ax, ay, ex, ey, bulge, cx, cy, radius = curves
    ux, uy, wx, wy = ex - ax, ey - ay, x - ax, y - ay
    falls = (ey < ay) | ((ey == ay) & (ex < ax))
    side = np.where(falls, uy * (x - ex) - ux * (y - ey), ux * wy - uy * wx)
    left = (side > 0) | ((side == 0) & (uy == 0))
    away, is_arc = np.hypot(x - cx, y - cy), bulge != 0
    odd = (((ay > y) != (ey > y)) & left) ^ (is_arc & (away < radius) & (left == ((bulge > 0) == falls)))
    t = np.clip((wx * ux + wy * uy) / (ux * ux + uy * uy), 0.0, 1.0)
    to_line, to_ends = np.hypot(wx - t * ux, wy - t * uy), np.minimum(np.hypot(wx, wy), np.hypot(x - ex, y - ey))
    scale = radius / np.where(away > 0, away, 1.0)
    beside = ux * (cy + (y - cy) * scale - ay) - uy * (cx + (x - cx) * scale - ax)  # of the nearest point of the whole circle
    to_arc = np.where((beside * bulge <= 0) | (away == 0), np.abs(away - radius), to_ends)
    return np.where(is_arc, to_arc, to_line).min(axis=0), np.logical_xor.reduce(odd, axis=0)


LOCAL: Mapping[str, _Local] = {
    "box": _box,
    "sphere": lambda leaf, x, y, z: np.sqrt(x * x + y * y + z * z) - leaf.size[0],
    "cylinder": lambda leaf, x, y, z: _corner(np.hypot(x, y) - leaf.size[0], np.abs(z) - leaf.size[1] / 2),
    "cone": _cone,
    "torus": lambda leaf, x, y, z: np.hypot(np.hypot(x, y) - leaf.size[0], z) - leaf.size[1],
    "ellipsoid": _ellipsoid,
    "extrude": _extrude,
    "revolve": _revolve,
    "drafted": _drafted,
}
