"""Lines and circles that noisy points of a plane lie on, found by the difference of point counts in two bands.

The contrast of a curve is how many more points lie in the band about it than in the two strips beside it, of the same width together. It is
nought on average for whatever is strewn evenly, needs no normals, and does not mind how near the next curve is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.spatial import KDTree

BAND = 1.5  # deviations of the noise, half the width of the inner band
SURE = 5.0  # standard errors of a contrast that are no chance
LEAST = 25  # points of contrast
FILLED = 0.3  # of the usual filling: where a curve ends
BINS = 40
QUIET, CROWD = 0.25, 1.3  # the share of points that lie in no crowd, and what times theirs is one
SUBSAMPLED, KEPT = 6, 80  # each so-manieth point judges first; so many hypotheses are judged by all
FEW = 10.0  # points that a band has at least, for its standard error
NEARBY, SCALES, NEIGHBOURS = 0.7, 3, 16  # share of draws from neighbours, in so many steps from near to far, among so many


def sure(inner: np.ndarray, outer: np.ndarray) -> bool:
    """Whether the points in the inner band, a mask [n], are so many more than those in the outer one that it is no chance."""
    a, b = int(inner.sum()), int(outer.sum())
    return a - b >= max(SURE * np.sqrt(a + b), LEAST)


def crowding(shadow: np.ndarray, sigma: float) -> np.ndarray:
    """How many more points than usual lie about each of a shadow: walls fall onto themselves."""
    count = np.asarray(KDTree(shadow).query_ball_point(shadow, 2 * sigma, return_length=True), float)
    return np.maximum(count - CROWD * np.quantile(count, QUIET), 0.0)


def draw_triples(points: np.ndarray, weight: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Indices [count, 3] of points to draw a curve through: a first by `weight` [n], two more beside it, near or far, or anywhere.

    Small curves are hit by near points. How near is drawn too: neighbours are those of ever thinner samples.
    """
    wall = np.flatnonzero(weight > 0)
    picks = rng.choice(wall, size=(count, 3), p=weight[wall] / weight[wall].sum())
    for scale, rows in enumerate(np.array_split(np.arange(int(NEARBY * count)), SCALES)):
        some = wall if scale == 0 else rng.choice(wall, max(len(wall) // 5**scale, 3))
        k = min(NEIGHBOURS, len(some))
        near = np.asarray(KDTree(points[some]).query(points[picks[rows, 0]], k=k)[1]).reshape(len(rows), k)
        picks[rows, 1:] = some[np.take_along_axis(near, rng.integers(k, size=(len(rows), 2)), 1)]
    return picks


def best_curve(
    judge: Callable[..., np.ndarray], points: np.ndarray, picks: np.ndarray, scored: np.ndarray, *limits: float
) -> tuple[float, ...]:
    """What `judge`, `circles` or `lines`, finds clearest through some of the points, `picks` [t, 2 or 3], and its contrast."""
    few = np.ascontiguousarray(scored[::SUBSAMPLED])  # as `scored` is: one kernel to compile
    first = judge(points, picks, few, *limits)
    found = judge(points, picks[np.argsort(-first[:, -1], kind="stable")[:KEPT]], scored, *limits)
    return tuple(found[found[:, -1].argmax()].tolist())


@njit(nogil=True, cache=True)
def circles(points, picks, scored, band, largest):  # pragma: no cover - compiled
    """Centres and radii of the circles through three of the points, `picks` [t, 3], and their contrasts in standard errors."""
    found = np.zeros((len(picks), 4))
    for t in range(len(picks)):
        found[t, 3] = -1.0
        a, b, c = points[picks[t, 0]], points[picks[t, 1]], points[picks[t, 2]]
        bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
        twice = 2 * (bx * cy - by * cx)
        bb, cc = bx * bx + by * by, cx * cx + cy * cy
        if abs(twice) < 0.02 * np.sqrt(bb * cc) + 1e-12:
            continue
        ox, oy = (cy * bb - by * cc) / twice, (bx * cc - cx * bb) / twice
        radius = np.sqrt(ox * ox + oy * oy)
        if radius > largest or radius < 2 * band:
            continue
        x, y = a[0] + ox, a[1] + oy
        inner, outer = 0, 0
        for i in range(len(scored)):
            away = abs(np.sqrt((scored[i, 0] - x) ** 2 + (scored[i, 1] - y) ** 2) - radius)
            inner += away < band
            outer += band <= away < 2 * band
        found[t] = (x, y, radius, (inner - outer) / np.sqrt(inner + outer + FEW))
    return found


@njit(nogil=True, cache=True)
def lines(points, picks, scored, band):  # pragma: no cover - compiled
    """The ends of stretches about two of the points, `picks` [t, 2], thrice as long as they are apart, and their contrasts as well."""
    found = np.zeros((len(picks), 5))
    for t in range(len(picks)):
        found[t, 4] = -1.0
        a, b = points[picks[t, 0]], points[picks[t, 1]]
        dx, dy = b[0] - a[0], b[1] - a[1]
        length = np.sqrt(dx * dx + dy * dy)
        if length < 4 * band:
            continue
        ux, uy = dx / length, dy / length
        inner, outer = 0, 0
        for i in range(len(scored)):
            px, py = scored[i, 0] - a[0], scored[i, 1] - a[1]
            along, away = px * ux + py * uy, abs(px * uy - py * ux)
            near = -length <= along <= 2 * length
            inner += near and away < band
            outer += near and band <= away < 2 * band
        found[t] = (a[0] - dx, a[1] - dy, a[0] + 2 * dx, a[1] + 2 * dy, (inner - outer) / np.sqrt(inner + outer + FEW))
    return found


def fit_circle(shadow: np.ndarray, center: tuple[float, float], radius: float, sigma: float) -> tuple[np.ndarray, float] | None:
    """Weighted Gauss-Newton steps on the points about a circle."""
    middle = np.array(center)
    for width in (2.0, 1.5, 1.5, 1.2, 1.2):
        arm = shadow - middle
        length = np.maximum(np.linalg.norm(arm, axis=1), 1e-12)
        off = length - radius
        weight = np.exp(-0.5 * (off / (width * sigma)) ** 2) * (np.abs(off) < 3 * width * sigma)
        rows = np.column_stack([arm / length[:, None], np.ones(len(arm))])
        normal = (rows * weight[:, None]).T @ rows + 1e-9 * np.eye(3)
        step = np.linalg.solve(normal, (rows * weight[:, None]).T @ off)
        step *= min(1.0, 3 * sigma / max(np.linalg.norm(step), 1e-300))
        middle, radius = middle + step[:2], radius + step[2]
        if radius < 2 * sigma:
            return None
    return middle, float(radius)


def find_filled_stretch(inner: np.ndarray, outer: np.ndarray, sigma: float) -> tuple[float, float] | None:
    """The longest stretch in which one band has more points than the other, between half-filled ends."""
    if len(inner) < LEAST:
        return None
    low, high = float(inner.min()), float(inner.max())
    bins = int(np.clip((high - low) / (2 * sigma), 3, BINS))
    more = np.histogram(inner, bins, (low, high))[0] - np.histogram(outer, bins, (low, high))[0]
    usual = float(np.median(more[more > 0])) if (more > 0).any() else 0.0
    if usual <= 0:
        return None
    full = more > FILLED * usual
    # a single empty bin is chance
    full[1:-1] |= full[:-2] & full[2:]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], full.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    i = int(np.argmax(ends - starts))
    step = (high - low) / bins
    return low + starts[i] * step, low + ends[i] * step


def fit_line(points: np.ndarray, ends: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """A place on the line near the stretch with two `ends` [2, 2], and its normal, by weighted least squares."""
    along = ends[1] - ends[0]
    origin, normal = ends.mean(0), np.array([-along[1], along[0]]) / np.linalg.norm(along)
    points = points[np.linalg.norm(points - origin, axis=1) < np.linalg.norm(along) / 2 + sigma]
    for width in (1.5, 1.2, 1.2):
        off = (points - origin) @ normal
        weight = np.exp(-0.5 * (off / (width * sigma)) ** 2) * (np.abs(off) < 3 * width * sigma)
        origin = (weight[:, None] * points).sum(0) / max(weight.sum(), 1e-12)
        spread = points - origin
        normal = np.linalg.eigh((spread * weight[:, None]).T @ spread)[1][:, 0]
    return origin, normal
