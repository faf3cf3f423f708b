"""A line of a drawing in steps: a shoulder, a rebate or a rim that the noise all but hides, where one line runs through the middle of it.

Curves are traced through the middle of the points beside them, and one line is the shortest description of a few points on either side of
it. Most points of a whole drawing tell whether a step along their line explains more than its numbers cost.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from operator import itemgetter

import numpy as np

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Point, Ring, flatten_loop, ring_curves
from imdim.program.tree import Primitive
from imdim.search.mdl.candidates.drawn import draw_with, in_plane

NEAR = 4.0  # deviations of the noise, within which a point is of a line
PLACES = 16  # along a line where a step may be
FEWEST = 20  # points of a line
MOST = 4  # drawings of one leaf
SHORT = 1.0  # deviations of the noise: what is shorter is no step
CLEAR = 1.0  # deviations of the noise from the ends of a line, where it has points of its neighbours
WORTH = 2.0  # times what the numbers of its corners cost: less is not worth a look
FLAT = 0.01  # deviations of the noise, by which a corner lies off the line between its neighbours that is none
CHORDS = 48  # of a circle, by which a point's nearest curve is told


def step_lines(leaf: Primitive, points: np.ndarray, sigma: float) -> Iterator[Primitive]:
    """The leaf with a line of its outline in one or two steps along x and y, or in two lines that a step joins, where this explains the
    `points` [n, 3] that it has better than the numbers of its corners cost; `sigma` is the deviation of their noise."""
    if leaf.outline is None or len(plane := in_plane(leaf, points, sigma)) < FEWEST:
        return
    loops, options, nearest, first = leaf.outline.loops, list[tuple[float, tuple[Loop, ...]]](), _nearest_curves(leaf.outline, plane), 0
    for i, loop in enumerate(loops):
        if isinstance(loop, Ellipse):
            continue
        for k, (ax, ay, bx, by, bulge) in enumerate(ring_curves(loop)):
            own = _clear_of_ends((ax, ay), (bx, by), plane[nearest == first + k], sigma)
            if bulge or len(own) < FEWEST:
                continue
            for won, corners in _steps((ax, ay), (bx, by), own, sigma, len(points)):
                options.append((won, (*loops[:i], _put_in(loop, k, corners, FLAT * sigma), *loops[i + 1 :])))
        first += len(loop)
    yield from draw_with(leaf, (option for _, option in heapq.nlargest(MOST, options, key=itemgetter(0))))


def _nearest_curves(outline: Outline, plane: np.ndarray) -> np.ndarray:
    """The number of the curve, over all rings, that each point of the `plane` [n, 2] lies nearest to; -1 for an ellipse."""
    chords, number, curves = list[tuple[float, float, float, float]](), list[int](), 0
    for loop in outline.loops:
        if isinstance(loop, Ellipse):
            corners = flatten_loop(loop, CHORDS)
            chords += [(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
            number += [-1] * len(corners)
            continue
        for ax, ay, bx, by, bulge in ring_curves(loop):
            # an arc and the line back
            walk = [*flatten_loop(((ax, ay, bulge), (bx, by, 0.0)), CHORDS)] if bulge else [(ax, ay), (bx, by)]
            chords += [(*a, *b) for a, b in pairwise(walk)]
            number += [curves] * (len(walk) - 1)
            curves += 1
    return np.array(number)[_squared_distances(np.array(chords), plane).argmin(0)]


def _clear_of_ends(a: Point, b: Point, own: np.ndarray, sigma: float) -> np.ndarray:
    """Those of points [n, 2] that lie beside the line from a to b, not beside its ends."""
    along = np.subtract(b, a) / math.dist(a, b)
    at = (own - a) @ along
    return own[(at > CLEAR * sigma) & (at < math.dist(a, b) - CLEAR * sigma)]


def _squared_distances(chords: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """Those of `chords` [..., c, 4], from end to end, to points of the `plane` [n, 2]: [..., c, n]."""
    start, along = chords[..., None, :2], chords[..., None, 2:] - chords[..., None, :2]
    length2 = np.maximum((along**2).sum(-1), 1e-300)
    at = np.clip(((plane - start) * along).sum(-1) / length2, 0.0, 1.0)
    return ((start + at[..., None] * along - plane) ** 2).sum(-1)


def _steps(a: Point, b: Point, own: np.ndarray, sigma: float, count: int) -> Iterator[tuple[float, list[Point]]]:
    """Rows of corners in the place of the line from a to b, the first and the last in their places, and by how much each tells the `own`
    points [n, 2] in fewer nats: the best along x first, along y first, and of two lines beside the one, if it is more than it costs."""
    before = _cost(np.array([[*a, *b]]), own, sigma)
    length = math.dist(a, b)
    if length < 2 * SHORT * sigma:
        return
    share = np.linspace(0.0, 1.0, PLACES + 2)
    (ax, ay), (bx, by) = a, b
    families = [_parallel(np.array(a), np.array(b), own, share[1:-1])]
    if min(abs(bx - ax), abs(by - ay)) > SHORT * sigma:
        xs, ys = ax + share * (bx - ax), ay + share * (by - ay)
        families += [[[a, (x, ay), (x, by), b] for x in xs.tolist()], [[a, (ax, y), (bx, y), b] for y in ys.tolist()]]
    for rows in families:
        if not rows:
            continue
        corners = np.array(rows)
        costs = _cost(np.concatenate([corners[:, :-1], corners[:, 1:]], axis=2), own, sigma)
        best = int(costs.argmin())
        row = [corner for i, corner in enumerate(rows[best]) if i == 0 or math.dist(corner, rows[best][i - 1]) > SHORT * sigma / 2]
        won = float(before - costs[best]) - WORTH * 0.5 * (len(row) - 2) * math.log(count)
        if won > 0.0 and len(row) > 2:
            yield won, row


def _parallel(a: np.ndarray, b: np.ndarray, own: np.ndarray, share: np.ndarray) -> list[list[Point]]:
    """For each `share` of the line from a to b the corners of two lines along it that meet there in a step, each in the middle of the
    points beside it; none where either has too few."""
    along = (b - a) / np.hypot(*(b - a))
    across = np.array([-along[1], along[0]])
    at, off = (own - a) @ along, (own - a) @ across
    out = []
    for place in share * float((b - a) @ along):
        first = at < place
        if min(first.sum(), (~first).sum()) < FEWEST:
            continue
        low, high = off[first].mean() * across, off[~first].mean() * across
        corner = a + place * along
        out.append([tuple(p.tolist()) for p in (a + low, corner + low, corner + high, b + high)])
    return out


def _put_in(ring: Ring, k: int, corners: Sequence[Point], still: float) -> Ring:
    """The ring with a row of corners in the place of its line k and its ends."""
    new, after = [*ring], (k + 1) % len(ring)
    new[k], new[after] = (*corners[0], 0.0), (*corners[-1], ring[after][2])
    new[k + 1 : k + 1] = [(*corner, 0.0) for corner in corners[1:-1]]
    return _without_flat_corners(new, still)


def _without_flat_corners(ring: Sequence[tuple[float, float, float]], still: float) -> Ring:
    """The ring without corners between two lines that lie off the line through them both by no more than `still`."""
    out = []
    for k, (x, y, bulge) in enumerate(ring):
        (ax, ay, before), (bx, by, _) = ring[k - 1], ring[(k + 1) % len(ring)]
        off = abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / max(math.dist((ax, ay), (bx, by)), 1e-300)
        if bulge or before or off > still:
            out.append((x, y, bulge))
    return tuple(out)


def _cost(chords: np.ndarray, own: np.ndarray, sigma: float) -> np.ndarray:
    """Nats that the distances of points [n, 2] from the nearest of `chords` [..., c, 4] take, beyond a constant."""
    return np.minimum(_squared_distances(chords, own).min(-2) / sigma**2, NEAR**2).sum(-1) / 2
