"""Area-weighted points on extruded and turned outlines, from uniform numbers; `surface_map` has those of the other kinds.

Each curve of the outline makes one face; the two ends are two more, of no area where a turned outline comes back to its start. Points of
an end are drawn from the outline's bounding box, those of a face that is turned from its widest ring, so that some must be dropped.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit

from imdim.geometry.kernels import in_outline
from imdim.geometry.lowering import Outlines, row_curve
from imdim.program.drafting import inset_at_top, shrink
from imdim.program.outline import Outline, curve_bounds, orient_loops
from imdim.program.tree import FULL_TURN

MEANS = 12  # steps of the arithmetic-geometric mean, each of which doubles the digits


def face_areas(kind: str, size: tuple[float, ...], outline: Outline) -> np.ndarray:
    """Areas [c + 2] of the faces: one for each curve, and the two ends."""
    curves, lengths, ends = _curves(outline), _lengths(outline), _ends(kind, size, outline.area)
    if kind == "drafted":
        top = _top(size, outline)
        return np.concatenate([_slant(size) * (lengths + _lengths(top)) / 2, [outline.area, top.area]])
    if kind == "extrude":
        return np.append(size[0] * lengths, ends)
    # Pappus' first theorem: an arc's middle is r (sin b - sin a) / turn beside its centre
    turn, start = 4 * np.arctan(curves[:, 4]), _start_angles(curves)
    is_arc, is_ellipse = turn != 0, curves[:, 7] < 0
    beside = curves[:, 7] * (np.sin(start + turn) - np.sin(start)) / np.where(is_arc, turn, 1.0)
    middle = np.where(is_arc & ~is_ellipse, curves[:, 5] + beside, (curves[:, 0] + curves[:, 2]) / 2)
    return np.append(math.radians(size[0]) * middle * lengths, ends)


def sampling_areas(kind: str, size: tuple[float, ...], outline: Outline) -> np.ndarray:
    """Areas [c + 2] of what the points of each face are drawn from."""
    width, height = np.ptp(np.array(outline.bounds), axis=0)
    ends = _ends(kind, size, float(width * height))
    # even eccentric angles of an ellipse are as far apart as those of the circle about it, at most
    semi_axis = -_curves(outline)[:, 7] * np.maximum(1.0, np.abs(_curves(outline)[:, 4]))
    lengths = np.where(semi_axis > 0, 2 * math.pi * semi_axis, _lengths(outline))
    if kind == "drafted":
        return np.append(_slant(size) * np.maximum(lengths, _lengths(_top(size, outline))), ends)
    if kind == "extrude":
        return np.append(size[0] * lengths, ends)
    return np.append(math.radians(size[0]) * _widest(outline) * lengths, ends)


def map_swept(kind: str, size: tuple[float, ...], outline: Outline, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Local points [n, 3], outward unit normals [n, 3] and the share [n] of them to keep, for uniforms `u` [n, 3]."""
    areas, count = sampling_areas(kind, size, outline), len(_curves(outline))
    face = np.minimum(np.searchsorted(np.cumsum(areas) / areas.sum(), u[:, 0], side="right"), count + 1)
    if kind == "drafted":
        return _map_drafted(size, outline, face, u[:, 1], u[:, 2])
    flat, normal = _on_curves(outline, np.minimum(face, count - 1), u[:, 1])
    share = _even_share(_curves(outline)[np.minimum(face, count - 1)], u[:, 1])
    if kind == "revolve":
        share *= flat[:, 0] / np.maximum(_widest(outline), 1e-300)[np.minimum(face, count - 1)]
    on_end = face >= count
    low, high = np.array(outline.bounds)
    flat[on_end] = low + (high - low) * u[on_end, 1:]
    normal[on_end] = 0.0
    share[on_end] = in_outline(_curves(outline), flat[on_end])
    upper, side = face > count, np.where(on_end, np.where(face > count, 1.0, -1.0), 0.0)
    if kind == "extrude":
        z = np.where(on_end, side / 2, u[:, 2] - 0.5) * size[0]
        return np.column_stack([flat, z]), np.column_stack([normal, side]), share
    angle = math.radians(size[0]) * np.where(on_end, upper, u[:, 2])
    cosine, sine = np.cos(angle), np.sin(angle)
    points = np.column_stack([flat[:, 0] * cosine, flat[:, 0] * sine, flat[:, 1]])
    return points, np.column_stack([normal[:, 0] * cosine - side * sine, normal[:, 0] * sine + side * cosine, normal[:, 1]]), share


def draw_even_swept(
    kind: str, size: tuple[float, ...], outline: Outline, n: int, steps: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Local points and outward unit normals [m, 3]: those of `n` places that lie even as leaves about a stem, by the `steps` of the second
    number and of the chance by which one is kept, which are not dropped. What `map_swept` gives for them, a point at a time."""
    curves, areas = _curves(outline), sampling_areas(kind, size, outline)
    bounds, box = np.concatenate([[0.0], np.cumsum(areas) / areas.sum()]), np.array(outline.bounds)
    if kind == "drafted":
        u, i = (np.arange(n) + 0.5) / n, np.arange(n)
        face = np.minimum(np.searchsorted(bounds[1:], u, side="right"), len(areas) - 1)
        at = (u - bounds[face]) / np.maximum(bounds[face + 1] - bounds[face], 1e-300)
        points, normals, share = _map_drafted(size, outline, face, at, i * steps[0] % 1.0)
        kept = i * steps[1] % 1.0 < share
        return points[kept], normals[kept]
    points, normals, kept, on_end = _draw_swept(kind == "revolve", size[0], curves, _widest(outline), bounds, box, n, *steps)
    # on an end of a turned outline the plane of the outline is that of the radius and the height
    flat = points[on_end, :2] if kind == "extrude" else np.column_stack([np.hypot(points[on_end, 0], points[on_end, 1]), points[on_end, 2]])
    kept[on_end] = in_outline(curves, flat)
    return points[kept], normals[kept]


def _map_drafted(
    size: tuple[float, ...], outline: Outline, face: np.ndarray, at: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `map_swept`, of places at two shares [n] of faces [n]: along a curve and up its wall, or along both edges of the foot's box."""
    height, lean, curves, top = size[0], math.radians(size[1]), _curves(outline), _top(size, outline)
    which, upper = np.minimum(face, len(curves) - 1), face > len(curves)
    (below, normal), (above, _) = _on_curves(outline, which, at), _on_curves(top, which, at)
    flat, up = below + other[:, None] * (above - below), other.copy()
    lengths = np.column_stack([_lengths(outline)[which], _lengths(top)[which]])
    share = (lengths[:, 0] + other * (lengths[:, 1] - lengths[:, 0])) / lengths.max(1)
    normals = np.column_stack([normal * math.cos(lean), np.full(len(face), math.sin(lean))])
    ends, (low, high) = face >= len(curves), np.array(outline.bounds)
    flat[ends] = low + (high - low) * np.column_stack([at, other])[ends]
    for end, section in ((ends & ~upper, outline), (upper, top)):
        share[end] = in_outline(_curves(section), flat[end])
    up[ends], normals[ends] = upper[ends], np.column_stack([np.zeros((len(face), 2)), np.where(upper, 1.0, -1.0)])[ends]
    return np.column_stack([flat, (up - 0.5) * height]), normals, share


def _top(size: tuple[float, ...], outline: Outline) -> Outline:
    return shrink(outline, inset_at_top(*size))


def _slant(size: tuple[float, ...]) -> float:
    """How long drafted walls are from the foot to the top."""
    return size[0] / math.cos(math.radians(size[1]))


@njit(nogil=True, cache=True)
def _draw_swept(turned, size, curves, widest, bounds, box, n, step, chance):  # pragma: no cover - compiled
    points, normals = np.empty((n, 3)), np.empty((n, 3))
    kept, on_end, face, count = np.ones(n, np.bool_), np.zeros(n, np.bool_), 0, len(curves)
    for i in range(n):
        u, other = (i + 0.5) / n, (i * step) % 1.0
        while face < count + 1 and u >= bounds[face + 1]:
            face += 1
        at, side, share = (u - bounds[face]) / max(bounds[face + 1] - bounds[face], 1e-300), 0.0, 1.0
        x, y, nx, ny = box[0, 0] + (box[1, 0] - box[0, 0]) * at, box[0, 1] + (box[1, 1] - box[0, 1]) * other, 0.0, 0.0
        if face < count:
            x, y, nx, ny, share = _place_on_curve(curves[face], at)
            share *= x / max(widest[face], 1e-300) if turned else 1.0
        else:
            on_end[i], side = True, 1.0 if face > count else -1.0
        kept[i] = (i * chance) % 1.0 < share
        if not turned:
            points[i, 0], points[i, 1], points[i, 2] = x, y, (side / 2 if side else other - 0.5) * size
            normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, side
            continue
        angle = math.radians(size) * ((1.0 if side > 0 else 0.0) if side else other)
        cosine, sine = math.cos(angle), math.sin(angle)
        points[i, 0], points[i, 1], points[i, 2] = x * cosine, x * sine, y
        normals[i, 0], normals[i, 1], normals[i, 2] = nx * cosine - side * sine, nx * sine + side * cosine, ny
    return points, normals, kept, on_end


@njit(nogil=True, cache=True)
def _place_on_curve(curve, at):  # pragma: no cover - compiled
    """The point at the share `at` of a curve, the unit normal to its right, and the share of such points to keep."""
    x, y, u, v, bulge, cx, cy, radius = curve
    if radius < 0:
        ax, ay, angle, across = (u - x) / 2, (v - y) / 2, 2 * math.pi * at, abs(bulge)
        cosine, sine = math.cos(angle), math.sin(angle)
        bx, by = -across * ay, across * ax
        nx, ny = cosine * ax * across + sine * bx / max(across, 1e-300), cosine * ay * across + sine * by / max(across, 1e-300)
        length = math.copysign(max(math.hypot(nx, ny), 1e-300), bulge)
        rx, ry = -radius, radius * bulge
        speed = math.hypot(rx * sine, ry * cosine) / max(rx, abs(ry), 1e-300)
        return cx + cosine * ax + sine * bx, cy + cosine * ay + sine * by, nx / length, ny / length, speed
    if bulge != 0:
        angle, sign = math.atan2(y - cy, x - cx) + 4 * math.atan(bulge) * at, math.copysign(1.0, bulge)
        cosine, sine = math.cos(angle), math.sin(angle)
        return cx + radius * cosine, cy + radius * sine, sign * cosine, sign * sine, 1.0
    length = math.hypot(u - x, v - y)
    return x + at * (u - x), y + at * (v - y), (v - y) / length, (x - u) / length, 1.0


@lru_cache(256)
def _curves(outline: Outline) -> np.ndarray:
    """The curves [c, 8], with what is inside on their left."""
    return Outlines.pack([Outline(orient_loops(outline.loops))]).curves


@lru_cache(256)
def _widest(outline: Outline) -> np.ndarray:
    """The largest x [c] of each curve."""
    return np.array([curve_bounds([row_curve(row)])[1][0] for row in _curves(outline)])


@lru_cache(256)
def _lengths(outline: Outline) -> np.ndarray:
    x, y, u, v, bulge, _, _, radius = _curves(outline).T
    lengths = np.where(bulge != 0, radius * np.abs(4 * np.arctan(bulge)), np.hypot(u - x, v - y))
    if not (radius < 0).any():
        return lengths
    return np.where(radius < 0, ellipse_length(-radius, -radius * np.abs(bulge)), lengths)


def ellipse_length(rx: np.ndarray, ry: np.ndarray) -> np.ndarray:
    """The lengths [c] of ellipses of these semi-axes [c]: 2 pi over the arithmetic-geometric mean of the semi-axes, times the squares of
    the larger one less half the sums of its differences (Gauss; Abramowitz & Stegun, 17.6)."""
    a, b = np.maximum(rx, ry), np.minimum(rx, ry)
    rest, power = a * a - (a * a - b * b) / 2, 1.0
    for _ in range(MEANS):
        a, b, half = (a + b) / 2, np.sqrt(np.maximum(a * b, 0.0)), (a - b) / 2
        rest, power = rest - power * half * half, 2 * power
    return 2 * math.pi * rest / np.where(a == 0, 1.0, a)


def _start_angles(curves: np.ndarray) -> np.ndarray:
    return np.arctan2(curves[:, 1] - curves[:, 6], curves[:, 0] - curves[:, 5])


def _ends(kind: str, size: tuple[float, ...], area: float) -> list[float]:
    return [0.0, 0.0] if kind == "revolve" and size[0] == FULL_TURN else [area, area]


def _on_curves(outline: Outline, which: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 2] at shares `along` [n] of the curves `which` [n], and the unit normals [n, 2] to their right."""
    curves = _curves(outline)[which]
    x, y, u, v, bulge, cx, cy, radius = curves.T
    angle = _start_angles(curves) + 4 * np.arctan(bulge) * along
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    chord = np.column_stack([u - x, v - y])
    is_arc = (bulge != 0)[:, None]
    points = np.where(is_arc, np.column_stack([cx, cy]) + radius[:, None] * ray, np.column_stack([x, y]) + along[:, None] * chord)
    right = np.column_stack([chord[:, 1], -chord[:, 0]]) / np.linalg.norm(chord, axis=1)[:, None]
    normals = np.where(is_arc, np.sign(bulge)[:, None] * ray, right)
    return _move_to_ellipses(curves, along, points, normals) if (radius < 0).any() else (points, normals)


def _move_to_ellipses(curves: np.ndarray, along: np.ndarray, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of curves [n, 8] that are ellipses at even eccentric angles, the others as they are."""
    x, y, u, v, ratio, cx, cy, _ = curves.T
    axis, angle = np.column_stack([u - x, v - y]) / 2, 2 * math.pi * along
    across = np.abs(ratio)[:, None] * np.column_stack([-axis[:, 1], axis[:, 0]])
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    outward = cosine * axis * np.abs(ratio)[:, None] + sine * across / np.maximum(np.abs(ratio), 1e-300)[:, None]
    outward *= np.sign(ratio)[:, None] / np.maximum(np.linalg.norm(outward, axis=1), 1e-300)[:, None]
    is_ellipse = curves[:, 7:] < 0
    moved = np.column_stack([cx, cy]) + cosine * axis + sine * across
    return np.where(is_ellipse, moved, points), np.where(is_ellipse, outward, normals)


def _even_share(curves: np.ndarray, along: np.ndarray) -> np.ndarray:
    """The share [n] of the points at these places along curves [n, 8] to keep, so that they lie evenly: even angles of an ellipse are
    dense about its tips."""
    rx, ry, angle = -curves[:, 7], curves[:, 7] * curves[:, 4], 2 * math.pi * along
    speed = np.hypot(rx * np.sin(angle), ry * np.cos(angle)) / np.maximum(np.maximum(rx, np.abs(ry)), 1e-300)
    return np.where(rx > 0, speed, 1.0)
