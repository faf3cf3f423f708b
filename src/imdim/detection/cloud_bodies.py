"""Bodies of a noisy cloud that stand clearly apart: where points lie densely, and wide gaps are between.

A search for one program finds separate bodies last: what fills the gap between them explains more at once than any of them alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.components import components
from imdim.geometry.sampling import EIGHTH

REACH = 1.5  # spacings to an eighth neighbour, within which points are of one body
CROWDED = 6  # points within this reach, itself included, of one that is no stray
LEAST = 400  # points of a body: fewer do not tell one
NEAR = 4.0  # reaches from a body, within which strays are counted to it
APART = 3.0  # deviations of the noise, that gaps are at least as wide as
CELL = 3.0  # spacings, the side of a column that is looked through
FILLED = 6  # points of a column that counts
DEEP = 2.0  # deviations of the noise by which points of both ends of a column leave any plane
REACHED = (0.03, 0.97)  # quantiles of points between which a body lies, whatever strays are beside it
MIXED = 1.25  # times the distance between neighbours of one cloud, to the nearest of a cloud of the same
CLOSED = 0.7  # of the columns along each axis


def split_cloud(points: np.ndarray, sigma: float) -> list[np.ndarray]:
    """Indices of the points [n, 3] of each body, the one with the most first, where noise has the deviation `sigma`.

    Strays far from all are in none. All are in one where there is one body, or where one is seen from some sides only: its sheets stand
    apart, too.
    """
    whole = [np.arange(len(points))]
    if len(points) < 2 * LEAST:
        return whole
    tree = KDTree(points)
    spacing = float(np.median(tree.query(points, k=EIGHTH + 1)[0][:, -1]))
    if not spacing:  # most points are told several times
        return whole
    reach = max(REACH * spacing, APART * sigma)
    dense = np.flatnonzero(tree.query_ball_point(points, REACH * spacing, return_length=True) >= CROWDED)
    core = KDTree(points[dense])
    rows, columns = core.query_pairs(reach, output_type="ndarray").T
    label = components(rows, columns, len(dense))[1]
    sizes = np.bincount(label, minlength=1)
    bodies = [int(i) for i in np.argsort(-sizes, kind="stable") if sizes[i] >= LEAST]
    kept = np.isin(label, bodies)
    if len(bodies) < 2 or not all(_is_closed(points[dense[label == i]], spacing, sigma) for i in bodies):
        return whole
    away, nearest = KDTree(points[dense[kept]]).query(points)
    own = np.where(away <= NEAR * reach, label[kept][nearest], -1)
    return [np.flatnonzero(own == i) for i in bodies]


def group_alike(bodies: Sequence[np.ndarray], sigma: float) -> list[list[tuple[int, np.ndarray]]]:
    """Groups of bodies, given by their points [n, 3], that differ by where they stand alone: the number of each and the way [3] to it from
    the first of its group. The groups of the most points come first."""
    groups: list[list[tuple[int, np.ndarray]]] = []
    middles = [np.quantile(points, REACHED, axis=0).mean(0) for points in bodies]
    for i, points in enumerate(bodies):
        for group in groups:
            first = group[0][0]
            way = middles[i] - middles[first]
            if _are_alike(bodies[first], points - way, sigma):
                group.append((i, way))
                break
        else:
            groups.append([(i, np.zeros(3))])
    return sorted(groups, key=lambda group: -sum(len(bodies[i]) for i, _ in group))


def _are_alike(one: np.ndarray, other: np.ndarray, sigma: float) -> bool:
    """Whether points of two bodies [n, 3] reach as far, but for the noise, and each cloud has its points where the other has."""
    spans = [np.ptp(np.quantile(points, REACHED, axis=0), axis=0) for points in (one, other)]
    if np.abs(spans[0] - spans[1]).max() > APART * sigma:
        return False
    trees = KDTree(one), KDTree(other)
    own = [np.median(tree.query(tree.data, k=2)[0][:, 1]) for tree in trees]
    across = [np.median(trees[1 - i].query(trees[i].data)[0]) for i in (0, 1)]
    return max(across) < MIXED * max(own)


def _is_closed(points: np.ndarray, spacing: float, sigma: float) -> bool:
    """Whether columns along each axis mostly go in at one place and out at another one: no one plane has their points."""
    return all(_share_of_deep(np.roll(points, -axis, axis=1), CELL * spacing, sigma) >= CLOSED for axis in range(3))


def _share_of_deep(points: np.ndarray, side: float, sigma: float) -> float:
    """Of the columns along z of a `side` the share whose points leave the best plane through them by more than the noise."""
    cell = np.floor(points[:, :2] / side).astype(np.int64)
    column, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)[1:]
    full = count >= FILLED
    if not full.any():
        return 0.0
    x, y = (points[:, :2] / side - cell - 0.5).T
    basis = np.column_stack([np.ones(len(points)), x, y])
    matrix, right = np.zeros((len(count), 3, 3)), np.zeros((len(count), 3))
    np.add.at(matrix, column, basis[:, :, None] * basis[:, None])
    np.add.at(right, column, basis * points[:, 2:])
    plane = np.einsum("cij,cj->ci", np.linalg.pinv(matrix, hermitian=True), right)
    rest = np.bincount(column, (points[:, 2] - (basis * plane[column]).sum(1)) ** 2, len(count))
    return float(np.mean(rest[full] > (DEEP * sigma) ** 2 * (count[full] - 3)))
