"""The best region of a plane arrangement: faces with the largest sum of gains, less a price for every curve of their boundary.

With a price for each segment the best region is a minimum cut (Greig, Porteous & Seheult 1989). A curve costs once however many segments
it has, which makes it a cooperative cut (Jegelka & Bilmes 2011): it is minimised by repeated cuts, in which each segment bears the share
of its curve's price that it has under the region before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.search.maximum_flow import source_side
from imdim.search.outline_plane import OUTSIDE, WINDOW, OutlinePlane, Segments

CUTS = 4  # minimum cuts for one region, at most
MOVES = 24  # of whole curves
FLIPS = 3  # rounds over all faces
MENDS = 32  # faces, by which a region that touches itself is changed at most
NO_FLOW = 1e-9  # of the gains' sum: an arc with less room is full
AXIS = WINDOW  # the window's left edge, which is the axis of what is turned: no curve is drawn there


@dataclass(frozen=True)
class Region:
    """Faces [f] that are `inside`, the sum of their gains, and the number of curves that bound them."""

    inside: np.ndarray
    gain: float
    curves: int


def best_region(plane: OutlinePlane, gains: np.ndarray, price: float, flips: bool = True) -> Region | None:
    """The region that wins most, by gains [f] and a `price` for a curve; None where none wins anything.

    A region that touches itself in a point is mended by its cheapest face. Without `flips` it takes a tenth of the time, and is worse.
    """
    best, value = None, 0.0
    for inside in _tries(plane, gains, price, flips):
        won = float(gains[inside].sum()) - price * count_curves(plane, inside)
        if won > value:
            best, value = inside, won
    if best is None:
        return None
    whole = mend(plane, best, gains)
    if whole is None:
        return None
    return Region(whole, float(gains[whole].sum()), count_curves(plane, whole))


def _tries(plane: OutlinePlane, gains: np.ndarray, price: float, flips: bool) -> Iterator[np.ndarray]:
    """Regions [f] that may be the best: what wins, and cuts under its curves' prices, again and again; with `flips` what flipping single
    faces makes of each, and of the best face alone."""
    starts = [gains > 0, np.arange(len(gains)) == gains.argmax()] if flips else [gains > 0]
    for inside in starts:
        for _ in range(CUTS):
            if not inside.any():
                break
            inside = _move_curves(plane, _flip(plane, inside, gains, price), gains, price) if flips else inside
            yield inside
            before, inside = inside, _cut(plane.segments, gains, price * _share_curves(plane, inside)[1])
            if np.array_equal(inside, before):
                break


def _flip(plane: OutlinePlane, inside: np.ndarray, gains: np.ndarray, price: float) -> np.ndarray:
    """The region with faces put in and left out, one at a time, as long as that wins."""
    segments, out = plane.segments, np.append(inside, False)
    _flip_faces(segments.wall, segments.nodes, segments.faces, plane.kind == "revolve", out, gains, price)
    return out[:-1]


def _move_curves(plane: OutlinePlane, inside: np.ndarray, gains: np.ndarray, price: float) -> np.ndarray:
    """The region with whole curves moved in or out by the faces beside them, as long as that wins."""

    def value(region: np.ndarray) -> float:
        return float(gains[region].sum()) - price * count_curves(plane, region)

    best = value(inside)
    for _ in range(MOVES):
        moved = ((inside, faces, put_in) for faces, put_in in _beside_curves(plane, inside))
        tried = next((new for new in (_put(*m) for m in moved) if value(new) > best + 1e-12), None)
        if tried is None:
            break
        inside, best = tried, value(tried)
    return inside


def _beside_curves(plane: OutlinePlane, inside: np.ndarray) -> Iterator[tuple[np.ndarray, bool]]:
    """For either side of every curve of a region's boundary the faces there, and whether putting them in would move the curve."""
    segments, sides = plane.segments, np.append(inside, False)[plane.segments.faces]
    bounding = sides[:, 0] != sides[:, 1]
    # a curve goes on where wall, side and node do
    goes_on = (segments.wall[1:] == segments.wall[:-1]) & (segments.nodes[1:, 0] == segments.nodes[:-1, 1])
    goes_on &= bounding[1:] & bounding[:-1] & (sides[1:, 0] == sides[:-1, 0])
    run = np.cumsum(np.append(True, ~goes_on))[bounding]
    for members in np.split(np.flatnonzero(bounding), np.flatnonzero(np.diff(run)) + 1) if bounding.any() else ():
        for column in (0, 1):
            faces = segments.faces[members, column]
            yield faces[faces >= 0], not sides[members[0], column]


def _put(inside: np.ndarray, faces: np.ndarray, put_in: bool) -> np.ndarray:
    out = inside.copy()
    out[faces] = put_in
    return out


def count_curves(plane: OutlinePlane, inside: np.ndarray) -> int:
    """The number of lines and arcs that bound a region [f], a full circle counted as one."""
    return _share_curves(plane, inside)[0]


def _cut(segments: Segments, gains: np.ndarray, prices: np.ndarray) -> np.ndarray:
    """The faces [f] on the source's side of the minimum cut; what lies outside of the window is on the sink's."""
    n = len(gains)
    ends = np.where(segments.faces == OUTSIDE, n + 1, segments.faces)
    won, lost = np.flatnonzero(gains > 0), np.flatnonzero(gains < 0)
    tails = np.concatenate([ends[:, 0], np.full(len(won), n), lost])
    heads = np.concatenate([ends[:, 1], won, np.full(len(lost), n + 1)])
    ahead, back = np.concatenate([prices, gains[won], -gains[lost]]), np.concatenate([prices, np.zeros(len(won) + len(lost))])
    return source_side(tails, heads, ahead, back, n, NO_FLOW * float(np.abs(gains).sum()))


def _share_curves(plane: OutlinePlane, inside: np.ndarray) -> tuple[int, np.ndarray]:
    """The number of curves that bound a region, and the share [s] of a curve's price that each segment bears.

    A segment off the boundary would be a new curve, or prolong one: it bears what its length is of both.
    """
    filled = np.append(inside, False)  # OUTSIDE is the last
    sides, segments = filled[plane.segments.faces].astype(np.int8), plane.segments
    share = np.empty(len(sides))
    side = sides[:, 0] - sides[:, 1]
    return _share_runs(segments.wall, segments.nodes, side, segments.length, plane.kind == "revolve", share), share


@njit(nogil=True, cache=True)
def _flip_faces(wall, nodes, faces, turned, inside, gains, price):
    """Flip entries of `inside` [f + 1], whose last stands for what is outside of the window."""
    side = np.empty(len(wall), np.int8)
    length, share = np.ones(len(wall)), np.empty(len(wall))
    for s in range(len(wall)):
        side[s] = np.int8(inside[faces[s, 0]]) - np.int8(inside[faces[s, 1]])
    curves = _share_runs(wall, nodes, side, length, turned, share)
    changed, rounds = True, 0
    while changed and rounds < FLIPS:
        changed = False
        rounds += 1
        for f in range(len(gains)):
            change = -gains[f] if inside[f] else gains[f]
            if change <= -4 * price:
                continue
            inside[f] = not inside[f]
            for s in range(len(wall)):
                side[s] = np.int8(inside[faces[s, 0]]) - np.int8(inside[faces[s, 1]])
            tried = _share_runs(wall, nodes, side, length, turned, share)
            if change - price * (tried - curves) > 1e-12:
                curves, changed = tried, True
            else:
                inside[f] = not inside[f]


@njit(nogil=True, cache=True)
def _share_runs(wall, nodes, side, length, turned, share):
    """The number of runs of segments with one `side` [s] that is not 0, and into `share` [s] each one's part of its run."""
    n, curves, first_of_wall, begins = len(wall), 0, 0, False
    share[:] = 1.0
    i = 0
    while i < n:
        if i == 0 or wall[i] != wall[i - 1]:
            first_of_wall, begins = i, False
        if side[i] == 0:
            i += 1
            continue
        j, total = i + 1, length[i]
        while j < n and wall[j] == wall[i] and side[j] == side[i] and nodes[j, 0] == nodes[j - 1, 1]:
            total += length[j]
            j += 1
        begins = begins or i == first_of_wall
        # the last run of a circle may go on in its first
        closes = begins and i > first_of_wall and (j == n or wall[j] != wall[i])
        closes = closes and nodes[j - 1, 1] == nodes[first_of_wall, 0] and side[first_of_wall] == side[i]
        free = turned and wall[i] == AXIS
        curves += 0 if free or closes else 1
        for k in range(i, j):
            share[k] = 0.0 if free else length[k] / total
        # what continues the run costs what it adds to it, no new curve
        if j < n and wall[j] == wall[i] and side[j] == 0 and nodes[j, 0] == nodes[j - 1, 1]:
            share[j] = length[j] / (total + length[j])
        if i > 0 and wall[i - 1] == wall[i] and side[i - 1] == 0 and nodes[i, 0] == nodes[i - 1, 1]:
            share[i - 1] = min(share[i - 1], length[i - 1] / (total + length[i - 1]))
        i = j
    return curves


def mend(plane: OutlinePlane, inside: np.ndarray, gains: np.ndarray) -> np.ndarray | None:
    """The region changed by its cheapest faces until its boundary passes no node twice; None where that does not end."""
    for _ in range(MENDS):
        node = _pinched(plane, inside)
        if node is None:
            return inside if inside.any() else None
        around = np.unique(plane.segments.faces[(plane.segments.nodes == node).any(1)])
        around = around[around >= 0]
        loss = np.where(inside[around], gains[around], -gains[around])
        face = around[np.argmin(loss)]
        inside = inside.copy()
        inside[face] = not inside[face]
    return None


def _pinched(plane: OutlinePlane, inside: np.ndarray) -> int | None:
    """A node that the boundary passes more than once."""
    _, nodes = plane.boundary(inside)
    times = np.bincount(nodes[:, 0], minlength=len(plane.nodes))
    return int(np.argmax(times)) if (times > 1).any() else None
