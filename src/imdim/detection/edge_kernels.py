"""The compiled likelihood of points near an edge under many blends; see `edge_profile`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

ROOT_TWO_PI = math.sqrt(2 * math.pi)


@njit(cache=True, inline="always")
def _normal_below(x):  # pragma: no cover - compiled
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


@njit(cache=True)
def blend_costs(points, inward, along, reach, sigma, fillet, sizes, blurs, strays):  # pragma: no cover - compiled
    """The negative log-density [k] of points [n, 2] under fillets of radii, or bevels of distances, `sizes` [k, 2]; 0 means a sharp corner.
    Points of a blend may be off by `blurs` [k] beside the noise; of the `strays` [s], shares of points from anywhere, the likeliest counts.
    """
    out = np.empty(len(sizes))
    half = math.acos(min(max(along[0, 0] * along[1, 0] + along[0, 1] * along[1, 1], -1.0), 1.0)) / 2
    anywhere = 1 / (math.pi * reach * reach)
    totals = np.empty(len(strays))
    for k in range(len(sizes)):
        one, two = sizes[k, 0], sizes[k, 1]
        radius, turn = one, math.pi - 2 * half
        if fillet:
            one = two = radius / math.tan(half)
        ax, ay, bx, by = along[0, 0] * one, along[0, 1] * one, along[1, 0] * two, along[1, 1] * two
        run = 0.0
        wide = math.hypot(sigma, blurs[k])
        vx, vy = bx - ax, by - ay
        if one > 0:
            run = radius * turn if fillet else math.hypot(vx, vy)
        if not fillet and run > 0:
            vx, vy = vx / run, vy / run
        nx, ny = -vy, vx
        if nx * (ax + bx) + ny * (ay + by) < 0:
            nx, ny = vy, -vx
        cx, cy = ax + inward[0, 0] * radius, ay + inward[0, 1] * radius
        sx, sy = -inward[0, 0], -inward[0, 1]
        ox, oy = (-inward[1, 0] - sx * math.cos(turn)) / math.sin(turn), (-inward[1, 1] - sy * math.cos(turn)) / math.sin(turn)
        length = 2 * reach - one - two + run
        for s in range(len(strays)):
            totals[s] = 0.0
        for i in range(len(points)):
            x, y = points[i, 0], points[i, 1]
            seen = 0.0
            for f in range(2):
                start = one if f == 0 else two
                depth = (x * inward[f, 0] + y * inward[f, 1]) / sigma
                place = (x * along[f, 0] + y * along[f, 1] - start) / sigma
                if abs(depth) < 12:
                    seen += math.exp(-0.5 * depth * depth) / (ROOT_TWO_PI * sigma) * _normal_below(place)
            if run > 0:
                if fillet:
                    px, py = x - cx, y - cy
                    inside = radius - math.hypot(px, py)
                    place = math.atan2(px * ox + py * oy, px * sx + py * sy) * radius
                else:
                    inside = (x - ax) * nx + (y - ay) * ny
                    place = (x - ax) * vx + (y - ay) * vy
                depth = inside / wide
                if abs(depth) < 12:
                    ends = _normal_below(place / wide) - _normal_below((place - run) / wide)
                    seen += math.exp(-0.5 * depth * depth) / (ROOT_TWO_PI * wide) * ends
            for s in range(len(strays)):
                totals[s] -= math.log((1 - strays[s]) * seen / length + strays[s] * anywhere)
        out[k] = totals.min()
    return out
