"""Lines and arcs for the corners of a polygon: the fewest curves that pass all corners within a tolerance, by dynamic programming.

Curves begin and end in corners, so that neighbours meet and no crossing is asked for. An arc through two of them has one number left, which
the corners between tell by least squares: circles through the ends of a chord have their centres on a line. Runs of corners that no line
holds are arcs where their chords turn by little and alike, as those of a tessellated arc do; else their corners were drawn.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from imdim.program.outline import Ring, circle

FEWEST_CHORDS = 4  # of an arc: three equal ones, as of a chamfered corner, always lie on a circle
MOST_TURN, WIDEST = 0.45, 2.6  # radians about the centre of one chord, and times the mean of its arc
ARC = 1.5  # what an arc costs, where a line costs one
LONGEST = 1.5 * math.pi  # radians of one arc, whose ends tell the centre of a longer one badly
FEWEST_SIDES = 12  # of a polygon that is a circle
FLATTEST = 20.0  # radii in the length of a chord: what bends less is drawn with lines


def draw_ring(corners: np.ndarray, tolerance: float) -> Ring | None:
    """The loop through a polygon's `corners` [n, 2], none of which is farther than `tolerance` from it; None where fewer than two curves
    are left."""
    corners = _distinct(corners, tolerance / 4)
    if len(corners) < 3:
        return None
    if len(corners) >= FEWEST_SIDES and (whole := _circle_through(corners, tolerance)) is not None:
        return circle(*whole)
    rows = [_split(_close(corners), tolerance)]
    # the first corner may be one on an arc: begin again where curves ended
    for first in np.unique(rows[0][0][[0, len(rows[0][0]) // 2, -2]]).tolist():
        ends, bulges, cost = _split(_close(np.roll(corners, -first, 0)), tolerance)
        rows.append(((ends + first) % len(corners), bulges, cost))
    ends, bulges, _ = min(rows, key=lambda row: row[2])
    ring = tuple((float(x), float(y), float(b)) for (x, y), b in zip(corners[np.roll(ends, 1) % len(corners)], bulges, strict=True))
    return ring if len(ring) > 2 or (len(ring) == 2 and any(b for _, _, b in ring)) else None


def _close(corners: np.ndarray) -> np.ndarray:
    return np.vstack([corners, corners[:1]])


def _distinct(corners: np.ndarray, nearest: float) -> np.ndarray:
    """Without corners that all but lie on the one before."""
    kept: list[np.ndarray] = []
    for corner in corners:
        if not kept or np.hypot(*(corner - kept[-1])) > nearest:
            kept.append(corner)
    while len(kept) > 1 and np.hypot(*(kept[0] - kept[-1])) <= nearest:
        kept.pop()
    return np.array(kept)


def _circle_through(corners: np.ndarray, tolerance: float) -> tuple[float, float, float] | None:
    """Radius and centre of the circle that all corners lie on, with none of its sides much wider than the others."""
    middle = corners.mean(0)
    q = corners - middle
    solved, _, rank, _ = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q * q).sum(1), rcond=1e-9)
    radius = math.sqrt(max(float(solved[2] + solved[:2] @ solved[:2]), 0.0))
    arms = q - solved[:2]
    if rank < 3 or np.abs(np.hypot(*arms.T) - radius).max() > tolerance:
        return None
    angle = np.arctan2(arms[:, 1], arms[:, 0])
    turn = (np.roll(angle, -1) - angle + math.pi) % (2 * math.pi) - math.pi
    once = abs(abs(float(turn.sum())) - 2 * math.pi) < 1e-6 and (turn > 0).all() != (turn < 0).all()
    even = np.abs(turn).max() < 4 * math.pi / FEWEST_SIDES
    return (radius, *(middle + solved[:2]).tolist()) if once and even else None


@njit(cache=True)
def _bulge(p, first, last, tolerance):  # pragma: no cover - compiled
    """The bulge of the arc through the corners `first` to `last`; 0 where they are on none."""
    hx, hy = (p[last, 0] - p[first, 0]) / 2, (p[last, 1] - p[first, 1]) / 2
    mx, my = p[first, 0] + hx, p[first, 1] + hy
    half = math.hypot(hx, hy)
    if half <= tolerance:
        return 0.0
    ux, uy = hx / half, hy / half
    above, below = 0.0, 0.0
    for k in range(first + 1, last):
        u, v = (p[k, 0] - mx) * ux + (p[k, 1] - my) * uy, (p[k, 1] - my) * ux - (p[k, 0] - mx) * uy
        above += v * (u * u + v * v - half * half)
        below += 2 * v * v
    if below <= 0:
        return 0.0
    rise = above / below  # of the centre over the chord, to its left
    radius = math.hypot(half, rise)
    if radius > FLATTEST * 2 * half:
        return 0.0
    cx, cy = mx - rise * uy, my + rise * ux
    total, widest, way = 0.0, 0.0, 0.0
    for k in range(first, last):
        ax, ay, bx, by = p[k, 0] - cx, p[k, 1] - cy, p[k + 1, 0] - cx, p[k + 1, 1] - cy
        if abs(math.hypot(bx, by) - radius) > tolerance:
            return 0.0
        turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        if turn == 0 or way * turn < 0 or abs(turn) > MOST_TURN:
            return 0.0
        way = turn
        total += turn
        widest = max(widest, abs(turn))
    if abs(total) > LONGEST or widest * (last - first) > WIDEST * abs(total):
        return 0.0
    return math.tan(total / 4)


@njit(cache=True)
def _is_line(p, first, last, tolerance):  # pragma: no cover - compiled
    """Whether the corners between two lie on the line from one to the other, in their order."""
    ux, uy = p[last, 0] - p[first, 0], p[last, 1] - p[first, 1]
    length = math.hypot(ux, uy)
    if length == 0:
        return False
    before = 0.0
    for k in range(first + 1, last):
        x, y = p[k, 0] - p[first, 0], p[k, 1] - p[first, 1]
        along = (x * ux + y * uy) / length
        if abs(x * uy - y * ux) > tolerance * length or along < before or along > length:
            return False
        before = along
    return True


@njit(cache=True)
def _split(p, tolerance):  # pragma: no cover - compiled
    """Where the curves of the cheapest row from the first corner to the last of [n + 1, 2] end, their bulges, and its cost."""
    n = len(p) - 1
    cost, before, bulge = np.full(n + 1, np.inf), np.zeros(n + 1, np.int64), np.zeros(n + 1)
    cost[0] = 0.0
    for i in range(n):
        for j in range(i + 1, n + 1):
            if i == 0 and j == n:
                continue
            if cost[i] + 1 < cost[j] and _is_line(p, i, j, tolerance):
                cost[j], before[j], bulge[j] = cost[i] + 1, i, 0.0
            if j - i >= FEWEST_CHORDS and cost[i] + ARC < cost[j]:
                b = _bulge(p, i, j, tolerance)
                if b != 0:
                    cost[j], before[j], bulge[j] = cost[i] + ARC, i, b
    count, at = 0, n
    while at > 0:
        count += 1
        at = before[at]
    ends, bulges, at = np.empty(count, np.int64), np.empty(count), n
    for k in range(count - 1, -1, -1):
        ends[k], bulges[k] = at, bulge[at]
        at = before[at]
    return ends, bulges, cost[n]
