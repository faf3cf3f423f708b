"""The leaf table, its folds and their derivatives as compiled serial loops on numpy arrays; `sdf.py` says what they compute.

At almost every point one leaf decides the program's value, so the derivative is the gradient of that leaf alone: a row of a sparse
Jacobian. It comes in the leaf's own frame (sizes, shift along the local axes, rotation vector in radians about them, right-multiplied),
which has no gimbal lock.

All compiled functions stay in this one file: numba's on-disk cache does not notice a change in an imported one. A flag that
they pass is no literal (`np.bool_(True)`): numba compiles a function once for each literal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from imdim.geometry.lowering import NO_OUTLINES, Lowered, Outlines, lower, pack_all, postfix, split_params
from imdim.program.tree import KINDS, SIMPLE, Primitive, Program, leaves

BOX, SPHERE, CYLINDER, CONE, TORUS, ELLIPSOID, EXTRUDE, REVOLVE, DRAFTED = range(len(KINDS))
BLOCK = 256  # points that are looked at together
LOOSE = 1e-9  # of its size and place, by which a box about a leaf is too large: rounding moves corners


def leaf_table(kinds: np.ndarray, params: np.ndarray, points: np.ndarray, outlines: Outlines = NO_OUTLINES) -> np.ndarray:
    """Signed distances [k, n] of `points` [n, 3] to the leaves `kinds` [k], `params` [k, 9]."""
    lists = _checked(kinds, outlines)
    return _leaf_table(np.require(kinds, np.int64, ["C", "W"]), *split_params(params), *lists, _as_points(points))


def outline_sdf(curves: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances [n] of `points` [n, 2] of the plane to the loops of `curves` [c, 8], as `Outlines` has them."""
    return _outline_values(curves, np.require(points, np.float64, ["C", "W"]).reshape(-1, 2))


def in_outline(curves: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether the loops of `curves` [c, 8] hold `points` [n, 2] of the plane, bool [n]: the sign of `outline_sdf`, known long before."""
    return _hold_in_outline(curves, np.require(points, np.float64, ["C", "W"]).reshape(-1, 2))


def program_sdf(program: Program | Lowered, points: np.ndarray) -> np.ndarray:
    """Values [n] at `points` [n, 3]."""
    return _program_values(*_arguments(program, points))[0]


def inside(program: Program | Lowered, points: np.ndarray) -> np.ndarray:
    """Whether each of `points` [n, 3] lies in the open solid, bool [n]: the sign of `program_sdf`, known long before its value."""
    return _program_inside(*_arguments(program, points))


def inside_each(parts: Sequence[Program], points: np.ndarray, ranges: np.ndarray | None = None) -> np.ndarray:
    """Whether each of `points` [n, 3] lies in each of the open solids `parts`, bool [p, n]; of part i those from `ranges[i]` to
    `ranges[i + 1]` alone, one part after another, bool [ranges[p] - ranges[0]], where these are given."""
    own = [leaf for part in parts for leaf in leaves(part)]
    kinds, params = pack_all(own)
    outlines = Outlines.of(own)
    codes = [np.zeros(1, np.int64) if isinstance(part, Primitive) else postfix(part) for part in parts]
    firsts = np.cumsum([0, *((len(code) + 1) // 2 for code in codes)])
    starts = np.zeros(len(parts), np.int64) if ranges is None else np.require(ranges[:-1], np.int64, ["C", "W"])
    ends = np.full(len(parts), len(points)) if ranges is None else np.require(ranges[1:], np.int64, ["C", "W"])
    lists = np.concatenate([np.empty(0, np.int64), *codes]), firsts, kinds, *split_params(params), outlines.curves, outlines.spans
    held = _each_inside(*lists, _as_points(points), starts, ends)
    return held.reshape(len(parts), len(points)) if ranges is None else held


def program_tangent(program: Program | Lowered, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Deciding leaf int64 [n], value [n], local-frame derivative [n, 9] (sizes, shift, rotation vector), world normal [n, 3]."""
    return _program_tangent(*_arguments(program, points))


def leaf_tangent(program: Program | Lowered, points: np.ndarray, normals: np.ndarray, leaf: np.ndarray) -> np.ndarray:
    """The tangents [m, 9] of `program_tangent` at points [m, 3] of the surface that are known to lie on these leaves, `leaf` [m], where the
    program has these outward `normals` [m, 3]: of a place on an outline its distance, which is nought, does not tell which side is out."""
    _, kinds, sizes, centers, rotations, curves, spans, points = _arguments(program, points)
    return _leaf_tangent(kinds, sizes, centers, rotations, curves, spans, points, _as_points(normals), leaf)


def _arguments(program: Program | Lowered, points: np.ndarray) -> tuple[np.ndarray, ...]:
    p = program if isinstance(program, Lowered) else lower(program)
    return p.code, p.kinds, p.sizes, p.centers, p.rotations, *_checked(p.kinds, p.outlines), _as_points(points)


def _checked(kinds: np.ndarray, outlines: Outlines) -> tuple[np.ndarray, np.ndarray]:
    """Curves and spans; the compiled loops would read past the end of lists that lack an outline."""
    if len(outlines.spans) != len(kinds) and (np.asarray(kinds) >= EXTRUDE).any():
        raise ValueError(f"{len(kinds)} leaves, some of them drawn, with the outlines of {len(outlines.spans)}")
    return outlines.curves, outlines.spans


def _as_points(points: np.ndarray) -> np.ndarray:
    # a read-only array would compile every kernel a second time
    return np.require(points, np.float64, ["C", "W"]).reshape(-1, 3)


@njit(nogil=True, cache=True)
def _faces2(a, b):
    """Distance to the corner of two orthogonal half-planes and its derivatives with respect to `a` and `b`."""
    if a <= 0 and b <= 0:
        return (a, 1.0, 0.0) if a > b else (b, 0.0, 1.0)
    a, b = max(a, 0.0), max(b, 0.0)
    d = math.sqrt(a * a + b * b)
    return d, a / d, b / d


@njit(nogil=True, cache=True)
def _box(s, x, y, z, out):
    ax, ay, az = abs(x) - s[0] / 2, abs(y) - s[1] / 2, abs(z) - s[2] / 2
    side, gx, gy = _faces2(ax, ay)
    d, g, gz = _faces2(side, az)
    gx, gy = g * gx, g * gy
    out[0], out[1], out[2] = -gx / 2, -gy / 2, -gz / 2
    out[3], out[4], out[5] = math.copysign(gx, x), math.copysign(gy, y), math.copysign(gz, z)
    return d


@njit(nogil=True, cache=True)
def _sphere(s, x, y, z, out):
    d = math.sqrt(x * x + y * y + z * z)
    inverse = 1 / d if d > 0 else 0.0
    out[0], out[1], out[2] = -1.0, 0.0, 0.0
    out[3], out[4], out[5] = x * inverse, y * inverse, z * inverse
    return d - s[0]


@njit(nogil=True, cache=True)
def _turn(g_rho, g_z, rho, x, y, out):
    """Write the space derivative of a solid of revolution."""
    inverse = 1 / rho if rho > 0 else 0.0
    out[3], out[4], out[5] = g_rho * x * inverse, g_rho * y * inverse, g_z


@njit(nogil=True, cache=True)
def _cylinder(s, x, y, z, out):
    rho = math.sqrt(x * x + y * y)
    d, g_rho, g_z = _faces2(rho - s[0], abs(z) - s[1] / 2)
    out[0], out[1], out[2] = -g_rho, -g_z / 2, 0.0
    _turn(g_rho, math.copysign(g_z, z), rho, x, y, out)
    return d


@njit(nogil=True, cache=True)
def _cone(s, x, y, z, out):
    rho = math.sqrt(x * x + y * y)
    er, ez = s[1] - s[0], s[2]
    wr, wz = rho - s[0], z + ez / 2
    length2 = er * er + ez * ez
    t = (wr * er + wz * ez) / length2
    nr, nz = ez / math.sqrt(length2), -er / math.sqrt(length2)
    d, cap = wr * nr + wz * nz, abs(z) - ez / 2
    on_cap, bottom = cap > d, z < 0
    beside = 0.0
    if d > 0 or cap > 0:
        t = min(max(t, 0.0), 1.0)
        vr, vz = wr - t * er, wz - t * ez
        beside = max(rho - (s[0] if bottom else s[1]), 0.0)
        on_cap = beside * beside + cap * cap < vr * vr + vz * vz
        d = math.sqrt(vr * vr + vz * vz)
        # on the slant itself the line's normal stands, where the direction to the foot is nought by nought
        if d > 1e-12 * (abs(wr) + abs(wz)):
            nr, nz = vr / d, vz / d
    if not on_cap:
        # the foot is at ((1 - t) r_bottom + t r_top, (t - 1/2) h); its own slide along the slant changes nothing
        out[0], out[1], out[2] = -nr * (1 - t), -nr * t, -nz * (t - 0.5)
        _turn(nr, nz, rho, x, y, out)
        return d
    d, g_rho, g_z = _faces2(beside, cap) if beside > 0 else (cap, 0.0, 1.0)
    out[0], out[1], out[2] = (-g_rho if bottom else 0.0), (0.0 if bottom else -g_rho), -g_z / 2
    _turn(g_rho, math.copysign(g_z, z), rho, x, y, out)
    return d


@njit(nogil=True, cache=True)
def _torus(s, x, y, z, out):
    rho = math.sqrt(x * x + y * y)
    d = math.sqrt((rho - s[0]) * (rho - s[0]) + z * z)
    inverse = 1 / d if d > 0 else 0.0
    g_rho = (rho - s[0]) * inverse
    out[0], out[1], out[2] = -g_rho, -1.0, 0.0
    _turn(g_rho, z * inverse, rho, x, y, out)
    return d - s[1]


@njit(nogil=True, cache=True)
def _ellipsoid(s, x, y, z, out):
    q = (x, y, z)
    k0 = math.sqrt((x / s[0]) ** 2 + (y / s[1]) ** 2 + (z / s[2]) ** 2)
    k1 = math.sqrt((x / s[0] ** 2) ** 2 + (y / s[1] ** 2) ** 2 + (z / s[2] ** 2) ** 2)
    shortest = 0
    for i in range(3):
        if s[i] < s[shortest]:
            shortest = i
    d = k0 * (k0 - 1) / k1 if k1 > 0 else -s[shortest]
    if k1 == 0 or d <= -s[shortest]:
        out[:6] = 0.0
        out[shortest] = -1.0
        return -s[shortest]
    for i in range(3):
        by_k0, by_k1 = (2 * k0 - 1) / k1 * q[i] / (s[i] ** 2 * k0), d / k1 * q[i] / (s[i] ** 4 * k1)
        out[3 + i] = by_k0 - by_k1
        out[i] = (2 * by_k1 - by_k0) * q[i] / s[i]
    return d


@njit(nogil=True, cache=True)
def _beside_ellipse(ux, uy, ratio, cx, cy, x, y):
    """Whether an ellipse about (cx, cy), with a first axis (ux, uy) and its semi-axes in this `ratio`, holds a point; the point's foot on
    it and the outward normal there (see `ellipse.ellipse_foot`)."""
    length = math.sqrt(ux * ux + uy * uy)
    c, s, rx, ry = ux / length, uy / length, length / 2, ratio * length / 2
    u, v = c * (x - cx) + s * (y - cy), c * (y - cy) - s * (x - cx)
    if rx >= ry:
        p, q = _ellipse_foot(rx, ry, abs(u), abs(v))
    else:
        q, p = _ellipse_foot(ry, rx, abs(v), abs(u))
    p, q = math.copysign(p, u), math.copysign(q, v)
    held = (u / rx) ** 2 + (v / ry) ** 2 < 1.0
    mx, my = p * ry / rx, q * rx / ry
    return held, cx + c * p - s * q, cy + s * p + c * q, c * mx - s * my, s * mx + c * my


@njit(nogil=True, cache=True)
def _ellipse_foot(rx, ry, x, y):
    """As `ellipse.ellipse_foot`, for rx >= ry."""
    r, p, q = (rx / ry) ** 2, rx * x / (ry * ry), y / ry
    w = max(q, p - r + 1.0)
    if q == 0.0 and w <= 0.0:
        cosine = p / (r - 1.0) if r > 1.0 else 0.0
        return rx * cosine, ry * math.sqrt(1.0 - cosine * cosine)
    for _ in range(60):
        a, b = p / (w + r - 1.0), q / w
        step = (a * a + b * b - 1.0) / (2.0 * (a * a / (w + r - 1.0) + b * b / w))
        w += step
        if step <= 1e-15 * w:
            break
    a, b = p / (w + r - 1.0), q / w
    return rx * a / math.sqrt(a * a + b * b), ry * b / math.sqrt(a * a + b * b)


@njit(nogil=True, cache=True)
def _outline(curves, x, y, turned):
    """Signed distance of a point of the plane to the loops of `curves` [c, 8], and its derivatives.

    The parity of crossings is that of the chords, turned for each arc that has the point between it and its chord (see
    `outline.is_in_loop`), and for each ellipse that holds the point. Lines along the axis of what is `turned` bound nothing.
    """
    nearest2, odd, fx, fy, nx, ny = np.inf, False, 0.0, 0.0, 0.0, 0.0
    for i in range(len(curves)):
        ax, ay, ex, ey, bulge, cx, cy, radius = curves[i]
        if turned and ax == 0.0 and ex == 0.0 and bulge == 0.0:
            continue
        ux, uy, wx, wy = ex - ax, ey - ay, x - ax, y - ay
        if radius < 0.0:
            held, px, py, mx, my = _beside_ellipse(ux, uy, abs(bulge), cx, cy, x, y)
            if held:
                odd = not odd
            mx, my = math.copysign(1.0, bulge) * mx, math.copysign(1.0, bulge) * my
            d2 = (x - px) ** 2 + (y - py) ** 2
            if d2 < nearest2:
                nearest2, fx, fy, nx, ny = d2, px, py, mx, my
            continue
        falls = ey < ay or (ey == ay and ex < ax)
        side = uy * (x - ex) - ux * (y - ey) if falls else ux * wy - uy * wx
        left = side > 0 or (side == 0 and uy == 0)
        if (ay > y) != (ey > y) and left:
            odd = not odd
        t = min(max((wx * ux + wy * uy) / (ux * ux + uy * uy), 0.0), 1.0)
        px, py, mx, my = ax + t * ux, ay + t * uy, uy, -ux
        if bulge != 0.0:
            qx, qy = x - cx, y - cy
            away = math.sqrt(qx * qx + qy * qy)
            if away < radius and left == ((bulge > 0) == falls):
                odd = not odd
            if away == 0.0:
                qx, qy, away = math.copysign(1.0, bulge) * uy, -math.copysign(1.0, bulge) * ux, math.sqrt(ux * ux + uy * uy)
            gx, gy = cx + qx * radius / away, cy + qy * radius / away
            if (ux * (gy - ay) - uy * (gx - ax)) * bulge <= 0:
                px, py = gx, gy
            else:
                px, py = (ax, ay) if wx * wx + wy * wy < (x - ex) ** 2 + (y - ey) ** 2 else (ex, ey)
            mx, my = math.copysign(px - cx, (px - cx) * bulge), math.copysign(py - cy, (py - cy) * bulge)
        d2 = (x - px) ** 2 + (y - py) ** 2
        if d2 < nearest2:
            nearest2, fx, fy, nx, ny = d2, px, py, mx, my
    d = math.sqrt(nearest2)
    sign = -1.0 if odd else 1.0
    length = math.sqrt(nx * nx + ny * ny)
    if d > 1e-9 * length:
        return sign * d, sign * (x - fx) / d, sign * (y - fy) / d
    return sign * d, nx / length, ny / length


@njit(nogil=True)
def _count_crossings(curves, turned, u, v, odd):
    """Turn `odd` [n] over for each curve that a ray from a point (u, v) [n] crosses: the parity that `_outline` has, a curve at a time."""
    for i in range(len(curves)):
        ax, ay, ex, ey, bulge, cx, cy, radius = curves[i]
        ux, uy = ex - ax, ey - ay
        if radius < 0.0:
            length2 = ux * ux + uy * uy
            across = bulge * bulge
            for j in range(len(u)):
                x, y = u[j] - cx, v[j] - cy
                a, b = x * ux + y * uy, y * ux - x * uy
                odd[j] ^= (a * a + b * b / across) * 4.0 < length2 * length2
            continue
        if turned and ax == 0.0 and ex == 0.0 and bulge == 0.0:
            continue
        falls = ey < ay or (ey == ay and ex < ax)
        ox, oy, sign = (ex, ey, -1.0) if falls else (ax, ay, 1.0)
        flat, inner = uy == 0, (bulge > 0) == falls
        for j in range(len(u)):
            side = sign * (ux * (v[j] - oy) - uy * (u[j] - ox))
            left = (side > 0) | ((side == 0) & flat)
            odd[j] ^= ((ay > v[j]) != (ey > v[j])) & left
            if bulge != 0.0:
                odd[j] ^= ((u[j] - cx) ** 2 + (v[j] - cy) ** 2 < radius * radius) & (left == inner)


@njit(nogil=True, cache=True)
def _outline_values(curves, points):
    out = np.empty(len(points))
    for j in range(len(points)):
        out[j] = _outline(curves, points[j, 0], points[j, 1], np.bool_(False))[0]
    return out


@njit(nogil=True, cache=True)
def _hold_in_outline(curves, points):
    u, v, odd = np.empty(len(points)), np.empty(len(points)), np.zeros(len(points), np.bool_)
    for j in range(len(points)):
        u[j], v[j] = points[j, 0], points[j, 1]
    _count_crossings(curves, np.bool_(False), u, v, odd)
    return odd


@njit(nogil=True, cache=True)
def _extrude(curves, s, x, y, z, out):
    side, gx, gy = _outline(curves, x, y, np.bool_(False))
    d, g, gz = _faces2(side, abs(z) - s[0] / 2)
    out[0], out[1], out[2] = -gz / 2, 0.0, 0.0
    out[3], out[4], out[5] = g * gx, g * gy, math.copysign(gz, z)
    return d


@njit(nogil=True, cache=True)
def _revolve(curves, s, x, y, z, out):
    rho = math.sqrt(x * x + y * y)
    d, g_rho, g_z = _outline(curves, rho, z, np.bool_(True))
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    _turn(g_rho, g_z, rho, x, y, out)
    if s[0] >= 360.0:
        return d
    at, angle = math.atan2(y, x), math.radians(s[0])
    at += 2 * math.pi if at < 0 else 0.0
    if at > angle:
        # of two faces through the axis the nearer one is that which is turned away less
        end = at - angle < 2 * math.pi - at
        off = at - angle if end else 2 * math.pi - at
        flat, g_u, g_v = _outline(curves, rho * math.cos(off), z, np.bool_(False))
        d, g_flat, g_beside = _faces2(max(flat, 0.0), rho * math.sin(off))
        _end_face(end, off, g_flat * g_u, g_flat * g_v, g_beside, s[0], rho, out)
        return d
    for end in range(2):
        off = angle - at if end else at
        # what lies farther round than a right angle has the axis as the nearest of the face, if that is in the outline
        depth = rho * math.sin(min(off, math.pi / 2))
        if -depth > d:
            d = -depth
            if off < math.pi / 2:
                _end_face(end, off, 0.0, 0.0, 1.0, s[0], rho, out)
            else:
                _turn(-1.0, 0.0, rho, x, y, out)
                out[0] = 0.0
    return d


@njit(nogil=True, cache=True)
def _end_face(end, off, g_u, g_v, g_beside, degrees, rho, out):
    """Write the derivatives where an end face of a turned outline decides: along it, in z, and away from it."""
    turned = math.radians(degrees) if end else 0.0
    cosine, sine = math.cos(turned), math.sin(turned)
    ax, ay = (-sine, cosine) if end else (sine, -cosine)
    out[3], out[4], out[5] = g_u * cosine + g_beside * ax, g_u * sine + g_beside * ay, g_v
    out[0] = -math.radians(1.0) * (g_beside * rho * math.cos(off) - g_u * rho * math.sin(off)) if end else 0.0


@njit(nogil=True, cache=True)
def _local(kind, s, curves, x, y, z, out):
    """Value at the local point, and into `out` [>= 6] its derivatives with respect to the sizes and the point."""
    if kind == BOX:
        return _box(s, x, y, z, out)
    if kind == SPHERE:
        return _sphere(s, x, y, z, out)
    if kind == CYLINDER:
        return _cylinder(s, x, y, z, out)
    if kind == CONE:
        return _cone(s, x, y, z, out)
    if kind == TORUS:
        return _torus(s, x, y, z, out)
    if kind == ELLIPSOID:
        return _ellipsoid(s, x, y, z, out)
    if kind == EXTRUDE:
        return _extrude(curves, s, x, y, z, out)
    if kind == REVOLVE:
        return _revolve(curves, s, x, y, z, out)
    return _drafted(curves, _draft_motions(curves), np.empty_like(curves), s, x, y, z, out)


@njit(nogil=True, cache=True)
def _draft_motions(curves):
    """How the `curves` [c, 8] of a drafted outline move per unit of inset, [c, 8]; see `program/drafting.py`. What is inside is on their
    left."""
    out, first = np.zeros_like(curves), 0
    for i in range(len(curves)):
        ax, ay, ex, ey, bulge, cx, cy = curves[i, :7]
        last = i + 1 == len(curves) or ex != curves[i + 1, 0] or ey != curves[i + 1, 1]
        j = first if last else i + 1
        if last:
            first = i + 1
        bx, by, fx, fy, other, dx, dy = curves[j, :7]
        px, py, qx, qy = ay - ey, ex - ax, by - fy, fx - bx
        if bulge != 0.0:
            px, py = (cx - ex) * bulge, (cy - ey) * bulge
        if other != 0.0:
            qx, qy = (dx - bx) * other, (dy - by) * other
        p, q = math.sqrt(px * px + py * py), math.sqrt(qx * qx + qy * qy)
        px, py, qx, qy = px / p, py / p, qx / q, qy / q
        if other != 0.0:
            sx, sy = qx, qy
        elif bulge != 0.0:
            sx, sy = px, py
        else:
            cosine = px * qx + py * qy
            sx, sy = (px + qx) / (1.0 + cosine), (py + qy) / (1.0 + cosine)
        out[i, 2], out[i, 3], out[j, 0], out[j, 1] = sx, sy, sx, sy
        if bulge != 0.0:
            out[i, 7] = -math.copysign(1.0, bulge)
    return out


@njit(nogil=True, cache=True)
def _drafted(curves, motions, section, s, x, y, z, out):
    """The distance to the walls' section at this height, times the cosine of the draft: that to the walls where these are the nearest, an
    estimate beside slanted corners. Written into `section` [c, 8] are the curves there."""
    half, lean = s[0] / 2, math.radians(s[1])
    cosine, slope, within = math.cos(lean), math.tan(lean), abs(z) < half
    up = min(max(z + half, 0.0), s[0])
    for i in range(len(curves)):
        for k in range(8):
            section[i, k] = curves[i, k] + up * slope * motions[i, k]
    d, gx, gy = _outline(section, x, y, np.bool_(False))
    # by how much more than the inset it grows beside a corner, which moves faster than its walls
    fx, fy, near, by = x - d * gx, y - d * gy, 1e-9 * (abs(x) + abs(y) + abs(d)), 1.0
    for i in range(len(curves)):
        if abs(section[i, 0] - fx) <= near and abs(section[i, 1] - fy) <= near:
            by = -(gx * motions[i, 0] + gy * motions[i, 1])
    side, g, cap = _faces2(d * cosine, abs(z) - half)
    by_up = g * cosine * slope * by  # of the height above the foot
    out[0] = by_up * (0.5 if within else 1.0 if z > 0 else 0.0) - cap / 2
    out[1] = math.radians(g * (up * by / cosine - d * math.sin(lean)))
    out[2] = 0.0
    out[3], out[4], out[5] = g * cosine * gx, g * cosine * gy, (by_up if within else 0.0) + math.copysign(cap, z)
    return side


@njit(nogil=True, cache=True)
def _to_local(center, rotation, point):
    x, y, z = point[0] - center[0], point[1] - center[1], point[2] - center[2]
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@njit(nogil=True, cache=True)
def _value(kind, a, b, c, x, y, z):
    """The value of `_local` alone, on scalars, so that the loop over points can be vectorised."""
    if kind == BOX:
        ax, ay, az = abs(x) - a / 2, abs(y) - b / 2, abs(z) - c / 2
        ox, oy, oz = max(ax, 0.0), max(ay, 0.0), max(az, 0.0)
        return math.sqrt(ox * ox + oy * oy + oz * oz) + min(max(ax, ay, az), 0.0)
    if kind == SPHERE:
        return math.sqrt(x * x + y * y + z * z) - a
    if kind == ELLIPSOID:
        k0 = math.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2)
        k1 = math.sqrt((x / a**2) ** 2 + (y / b**2) ** 2 + (z / c**2) ** 2)
        return max(k0 * (k0 - 1) / k1, -min(a, b, c)) if k1 > 0 else -min(a, b, c)
    rho = math.sqrt(x * x + y * y)
    if kind == CYLINDER:
        side, cap = rho - a, abs(z) - b / 2
        outer, upper = max(side, 0.0), max(cap, 0.0)
        return math.sqrt(outer * outer + upper * upper) + min(max(side, cap), 0.0)
    if kind == TORUS:
        return math.sqrt((rho - a) * (rho - a) + z * z) - b
    er, wr, wz, cap = b - a, rho - a, z + c / 2, abs(z) - c / 2
    length2 = er * er + c * c
    within = max((wr * c - wz * er) / math.sqrt(length2), cap)
    t = min(max((wr * er + wz * c) / length2, 0.0), 1.0)
    vr, vz, beside = wr - t * er, wz - t * c, max(rho - (a if z < 0 else b), 0.0)
    return math.sqrt(min(beside * beside + cap * cap, vr * vr + vz * vz)) if within > 0 else within


def _row_of(kind):
    """The loop over points for one kind: a loop that branches on the kind, or that reads it from an array, is not vectorised.

    Each has a name of its own: what one process has compiled and another one loads from the cache is joined by names and running numbers,
    and the numbers differ from process to process, so that alike names could stand for different loops.
    """

    def row(a, b, c, cx, cy, cz, r00, r01, r02, r10, r11, r12, r20, r21, r22, xs, ys, zs, out):
        for j in range(len(out)):
            x, y, z = xs[j] - cx, ys[j] - cy, zs[j] - cz
            out[j] = _value(kind, a, b, c, r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z)

    row.__qualname__ = f"row_of_{KINDS[kind]}"
    return njit(nogil=True)(row)


_box_row, _sphere_row, _cylinder_row, _cone_row, _torus_row, _ellipsoid_row = (_row_of(kind) for kind in range(len(SIMPLE)))


@njit(nogil=True, cache=True)
def _outlined_row(kind, size, curves, center, rotation, xs, ys, zs, out):
    point, slope = np.empty(3), np.empty(6)
    motions = _draft_motions(curves) if kind == DRAFTED else curves
    section = np.empty_like(curves)
    for j in range(len(out)):
        point[0], point[1], point[2] = xs[j], ys[j], zs[j]
        x, y, z = _to_local(center, rotation, point)
        if kind == DRAFTED:
            out[j] = _drafted(curves, motions, section, size, x, y, z, slope)
        else:
            out[j] = _local(kind, size, curves, x, y, z, slope)


@njit(nogil=True, cache=True)
def _fill_row(kind, size, curves, center, rotation, xs, ys, zs, out):
    if kind >= EXTRUDE:
        _outlined_row(kind, size, curves, center, rotation, xs, ys, zs, out)
        return
    a, b, c = size
    cx, cy, cz = center
    xx, xy, xz = rotation[0]
    yx, yy, yz = rotation[1]
    zx, zy, zz = rotation[2]
    if kind == BOX:
        _box_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == SPHERE:
        _sphere_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == CYLINDER:
        _cylinder_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == CONE:
        _cone_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    elif kind == TORUS:
        _torus_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)
    else:
        _ellipsoid_row(a, b, c, cx, cy, cz, xx, xy, xz, yx, yy, yz, zx, zy, zz, xs, ys, zs, out)


@njit(nogil=True, cache=True)
def _curves_of(i, kinds, curves, spans):
    return curves[spans[i, 0] : spans[i, 1]] if kinds[i] >= EXTRUDE else curves[:0]


@njit(nogil=True, cache=True)
def _leaf_table(kinds, sizes, centers, rotations, curves, spans, points):
    table = np.empty((len(kinds), len(points)))
    xyz = np.ascontiguousarray(points.T)
    for i in range(len(kinds)):
        _fill_row(kinds[i], sizes[i], _curves_of(i, kinds, curves, spans), centers[i], rotations[i], xyz[0], xyz[1], xyz[2], table[i])
    return table


@njit(nogil=True)
def _join(op, left, right, owner, by):
    if op == -1:
        for j in range(len(left)):
            less = right[j] < left[j]
            left[j], owner[j] = right[j] if less else left[j], by[j] if less else owner[j]
        return
    for j in range(len(left)):
        other, its = (right[j], by[j]) if op == -2 else (-right[j], -1 - by[j])
        more = other > left[j]
        left[j], owner[j] = other if more else left[j], its if more else owner[j]


@njit(nogil=True, cache=True)
def _fold(code, table):
    """Values and deciding leaves of the columns of `table`, a row at a time. A complemented owner is stored as -1 - leaf."""
    n = table.shape[1]
    values, owners = np.empty((len(code) // 2 + 1, n)), np.empty((len(code) // 2 + 1, n), np.int64)
    top = -1
    for op in code:
        if op >= 0:
            top += 1
            for j in range(n):
                values[top, j], owners[top, j] = table[op, j], op
            continue
        top -= 1
        _join(op, values[top], values[top + 1], owners[top], owners[top + 1])
    return values[0], owners[0]


@njit(nogil=True, cache=True)
def _program_values(code, kinds, sizes, centers, rotations, curves, spans, points):
    n, block = len(points), 1024
    value, owner = np.empty(n), np.empty(n, np.int64)
    for start in range(0, n, block):
        part = points[start : start + block]
        values, owners = _fold(code, _leaf_table(kinds, sizes, centers, rotations, curves, spans, part))
        for j in range(len(part)):
            value[start + j], owner[start + j] = values[j], owners[j]
    return value, owner


@njit(nogil=True)
def _fill_signs(kind, s, curves, center, rotation, points, row):
    """Write -1 for points [n, 3] in the open solid of an outlined leaf, and 1 for others."""
    n = len(points)
    if kind == DRAFTED:
        motions, section, slope = _draft_motions(curves), np.empty_like(curves), np.empty(6)
        for j in range(n):
            x, y, z = _to_local(center, rotation, points[j])
            row[j] = 1.0
            if abs(z) < s[0] / 2:
                row[j] = -1.0 if _drafted(curves, motions, section, s, x, y, z, slope) < 0 else 1.0
        return
    u, v, odd = np.empty(n), np.empty(n), np.zeros(n, np.bool_)
    for j in range(n):
        x, y, z = _to_local(center, rotation, points[j])
        u[j], v[j] = (x, y) if kind == EXTRUDE else (math.sqrt(x * x + y * y), z)
        at = 0.0
        if kind == REVOLVE and s[0] < 360.0:
            at = math.degrees(math.atan2(y, x))
            at += 360.0 if at < 0 else 0.0
        row[j] = 1.0 if (abs(z) >= s[0] / 2 if kind == EXTRUDE else s[0] < 360.0 and at >= s[0]) else -1.0
    _count_crossings(curves, kind == REVOLVE, u, v, odd)
    for j in range(n):
        row[j] = row[j] if odd[j] else 1.0


@njit(nogil=True, cache=True)
def _fold_signs(code, table, stack, n):
    """Write the signs of the program at the first `n` columns of `table`, which has those of the leaves, into the first row of `stack`."""
    top = -1
    for op in code:
        if op >= 0:
            top += 1
            for j in range(n):
                stack[top, j] = table[op, j]
            continue
        top -= 1
        left, right = stack[top], stack[top + 1]
        for j in range(n):
            if op == -1:
                left[j] = min(left[j], right[j])
            elif op == -2:
                left[j] = max(left[j], right[j])
            else:
                left[j] = max(left[j], -right[j])


@njit(nogil=True)
def _fill_local_box(kind, s, curves, low, high):
    """Write the corners [3] of a box about a leaf, along its own axes."""
    x, y, z = s[0], s[0], s[0]
    if kind == BOX:
        x, y, z = s[0] / 2, s[1] / 2, s[2] / 2
    elif kind == CYLINDER:
        z = s[1] / 2
    elif kind == CONE:
        x, z = max(s[0], s[1]), s[2] / 2
        y = x
    elif kind == TORUS:
        x, z = s[0] + s[1], s[1]
        y = x
    elif kind == ELLIPSOID:
        y, z = s[1], s[2]
    high[0], high[1], high[2] = x, y, z
    low[0], low[1], low[2] = -x, -y, -z
    if kind < EXTRUDE:
        return
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(curves)):
        ax, ay, ex, ey, bulge, cx, cy, radius = curves[i]
        # an arc of half a turn or less leaves its chord by the height, a longer one and an ellipse lie about their centre
        by = abs(bulge) * math.sqrt((ex - ax) ** 2 + (ey - ay) ** 2) / 2
        if radius < 0.0:
            ax, ay, by = cx, cy, -radius * max(1.0, abs(bulge))
            ex, ey = cx, cy
        elif abs(bulge) > 1.0:
            ax, ay, ex, ey, by = cx, cy, cx, cy, radius
        left, right = min(left, ax - by, ex - by), max(right, ax + by, ex + by)
        bottom, top = min(bottom, ay - by, ey - by), max(top, ay + by, ey + by)
    if kind != REVOLVE:
        low[0], low[1], low[2], high[0], high[1], high[2] = left, bottom, -s[0] / 2, right, top, s[0] / 2
    else:
        far = max(abs(left), abs(right))
        low[0], low[1], low[2], high[0], high[1], high[2] = -far, -far, bottom, far, far, top


@njit(nogil=True)
def _find_boxes(kinds, sizes, centers, rotations, curves, spans):
    """Low and high corners [k, 6] of boxes about the leaves."""
    out, low, high = np.empty((len(kinds), 6)), np.empty(3), np.empty(3)
    for i in range(len(kinds)):
        _fill_local_box(kinds[i], sizes[i], _curves_of(i, kinds, curves, spans), low, high)
        for a in range(3):
            middle, reach = centers[i, a], 0.0
            for c in range(3):
                middle += rotations[i, a, c] * (low[c] + high[c]) / 2
                reach += abs(rotations[i, a, c]) * (high[c] - low[c]) / 2
            reach += LOOSE * (reach + abs(middle))
            out[i, a], out[i, 3 + a] = middle - reach, middle + reach
    return out


@njit(nogil=True)
def _find_block_boxes(points):
    """Low and high corners [b, 6] of BLOCK points after another."""
    out = np.empty((-(-len(points) // BLOCK), 6))
    for b in range(len(out)):
        for a in range(3):
            out[b, a], out[b, 3 + a] = np.inf, -np.inf
        for j in range(b * BLOCK, min((b + 1) * BLOCK, len(points))):
            for a in range(3):
                out[b, a], out[b, 3 + a] = min(out[b, a], points[j, a]), max(out[b, 3 + a], points[j, a])
    return out


@njit(nogil=True)
def _are_apart(one, other):
    apart = False
    for a in range(3):
        apart |= one[a] > other[3 + a] or other[a] > one[3 + a]
    return apart


@njit(nogil=True, cache=True)
def _write_inside(code, first, kinds, sizes, centers, rotations, curves, spans, boxes, points, blocks, held):
    """Write whether each of `points` [n, 3] lies within the program of instructions `code`, whose leaves begin with the one at `first`.

    What lies in none of the `boxes` about the leaves needs no look at them: `blocks` are the boxes about BLOCK points after another.
    """
    n, deep = len(points), len(code) // 2 + 1
    table, stack = np.empty((deep, BLOCK), np.int8), np.empty((deep, BLOCK), np.int8)
    xyz, row = np.empty((3, BLOCK)), np.empty(BLOCK)
    for b in range(len(blocks)):
        start, some, copied = b * BLOCK, min(BLOCK, n - b * BLOCK), False
        for k in range(deep):
            i = first + k
            if _are_apart(boxes[i], blocks[b]):
                table[k, :some] = 1
                continue
            of, part = _curves_of(i, kinds, curves, spans), points[start : start + some]
            if kinds[i] >= EXTRUDE:
                _fill_signs(kinds[i], sizes[i], of, centers[i], rotations[i], part, row)
            else:
                if not copied:
                    for j in range(some):
                        xyz[0, j], xyz[1, j], xyz[2, j] = part[j, 0], part[j, 1], part[j, 2]
                    copied = True
                xs, ys, zs = xyz[0, :some], xyz[1, :some], xyz[2, :some]
                _fill_row(kinds[i], sizes[i], of, centers[i], rotations[i], xs, ys, zs, row[:some])
            for j in range(some):
                table[k, j] = -1 if row[j] < 0 else 1 if row[j] > 0 else 0
        _fold_signs(code, table, stack, some)
        for j in range(some):
            held[start + j] = stack[0, j] < 0


@njit(nogil=True, cache=True)
def _program_inside(code, kinds, sizes, centers, rotations, curves, spans, points):
    held = np.empty(len(points), np.bool_)
    boxes, blocks = _find_boxes(kinds, sizes, centers, rotations, curves, spans), _find_block_boxes(points)
    _write_inside(code, np.int64(0), kinds, sizes, centers, rotations, curves, spans, boxes, points, blocks, held)
    return held


@njit(nogil=True, cache=True)
def _each_inside(code, firsts, kinds, sizes, centers, rotations, curves, spans, points, starts, ends):
    """Of program i, whose leaves begin with number `firsts[i]`, whether each of the points from `starts[i]` to `ends[i]` lies in it,
    program after program. The instructions of one with k leaves are 2 k - 1 of `code`."""
    held, done = np.empty((ends - starts).sum(), np.bool_), 0
    boxes, blocks = _find_boxes(kinds, sizes, centers, rotations, curves, spans), np.empty((0, 6))
    for i in range(len(starts)):
        own, n = code[2 * firsts[i] - i : 2 * firsts[i + 1] - i - 1], ends[i] - starts[i]
        some = points[starts[i] : ends[i]]
        if i == 0 or starts[i] != starts[i - 1] or ends[i] != ends[i - 1]:
            blocks = _find_block_boxes(some)
        _write_inside(own, firsts[i], kinds, sizes, centers, rotations, curves, spans, boxes, some, blocks, held[done : done + n])
        done += n
    return held


@njit(nogil=True)
def _write_tangent(sign, kind, size, curves, center, rotation, point, row, normal):
    """Write how the value at a point moves with a leaf's sizes, centre and turn into `row` [9], and its gradient into `normal` [3]."""
    x, y, z = _to_local(center, rotation, point)
    _local(kind, size, curves, x, y, z, row)
    for a in range(6):
        row[a] *= sign
    gx, gy, gz = row[3], row[4], row[5]
    for a in range(3):
        normal[a] = rotation[a, 0] * gx + rotation[a, 1] * gy + rotation[a, 2] * gz
    row[3], row[4], row[5] = -gx, -gy, -gz
    row[6], row[7], row[8] = gy * z - gz * y, gz * x - gx * z, gx * y - gy * x


@njit(nogil=True, cache=True)
def _leaf_tangent(kinds, sizes, centers, rotations, curves, spans, points, normals, leaf):
    tangent, normal = np.empty((len(points), 9)), np.empty(3)
    for j in range(len(points)):
        i, row = leaf[j], tangent[j]
        _write_tangent(1.0, kinds[i], sizes[i], _curves_of(i, kinds, curves, spans), centers[i], rotations[i], points[j], row, normal)
        if normal[0] * normals[j, 0] + normal[1] * normals[j, 1] + normal[2] * normals[j, 2] < 0.0:
            for a in range(9):
                row[a] = -row[a]
    return tangent


@njit(nogil=True, cache=True)
def _program_tangent(code, kinds, sizes, centers, rotations, curves, spans, points):
    value, leaf = _program_values(code, kinds, sizes, centers, rotations, curves, spans, points)
    tangent, normal = np.empty((len(points), 9)), np.empty((len(points), 3))
    for j in range(len(points)):
        sign = 1.0
        if leaf[j] < 0:
            leaf[j], sign = -1 - leaf[j], -1.0
        i = leaf[j]
        curves_of = _curves_of(i, kinds, curves, spans)
        _write_tangent(sign, kinds[i], sizes[i], curves_of, centers[i], rotations[i], points[j], tangent[j], normal[j])
    return leaf, value, tangent, normal
