"""The best region of a plane arrangement: faces with the largest sum of gains, less a price for every curve of their boundary.

With a price for each segment the best region is a minimum cut (Greig, Porteous & Seheult 1989). A curve costs once however many segments
it has, which makes it a cooperative cut (Jegelka & Bilmes 2011): it is minimised by repeated cuts, in which each segment bears the share
of its curve's price that it has under the region before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from imdim.program.outline import Loop, Outline, Vertex, check_crossings, circle, orient_loops
from imdim.search.outline_plane import OUTSIDE, WINDOW, OutlinePlane, Segments, cross_walls

CUTS = 4  # minimum cuts for one region, at most
NO_LENGTH = 1e-6  # of the unit frame: a curve no longer is none
NEAR_NODE = 0.03  # of the unit frame, within which a tangent point is that of a node
WIDE = 1.5 * math.pi  # radians, from which an arc is drawn as two
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
    segments = plane.segments

    def value(region: np.ndarray) -> float:
        return float(gains[region].sum()) - price * count_curves(plane, region)

    best = value(inside)
    for _ in range(MOVES):
        sides = np.append(inside, False)[segments.faces]
        bounding = sides[:, 0] != sides[:, 1]
        # a run goes on where wall, side and node do
        goes_on = (segments.wall[1:] == segments.wall[:-1]) & (segments.nodes[1:, 0] == segments.nodes[:-1, 1])
        goes_on &= bounding[1:] & bounding[:-1] & (sides[1:, 0] == sides[:-1, 0])
        run = np.cumsum(np.append(True, ~goes_on))
        changed = False
        runs = np.split(np.flatnonzero(bounding), np.flatnonzero(np.diff(run[bounding])) + 1) if bounding.any() else []
        for members in runs:
            for column in (0, 1):
                beside = segments.faces[members, column]
                tried = inside.copy()
                tried[beside[beside >= 0]] = not sides[members[0], column]
                won = value(tried)
                if won > best + 1e-12:
                    inside, best, changed = tried, won, True
                    break
            if changed:
                break
        if not changed:
            break
    return inside


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
    return _source_side(tails, heads, ahead, back, n, NO_FLOW * float(np.abs(gains).sum()))


@njit(nogil=True, cache=True)
def _source_side(tails, heads, ahead, back, n, least):
    """The nodes [n] that the source n still reaches once a maximum flow to the sink n + 1 is found (Dinic 1970).

    Arc i runs from tails[i] to heads[i] with capacity ahead[i], and back with back[i]; below `least` an arc is full.
    """
    starts, arcs = _list_arcs(tails, heads, n + 2)
    to, room = np.empty(2 * len(tails), np.int64), np.empty(2 * len(tails))
    to[::2], to[1::2], room[::2], room[1::2] = heads, tails, ahead, back
    level, queue = np.empty(n + 2, np.int64), np.empty(n + 2, np.int64)
    while _find_levels(starts, arcs, to, room, n, level, queue, least):
        _fill_paths(starts, arcs, to, room, n, level, queue, least)
    return level[:n] >= 0


@njit(nogil=True, cache=True)
def _list_arcs(tails, heads, nodes):
    """Where the arcs of each node start [nodes + 1] in a list [2 m]; arc i leaves its tail as 2 i and its head as 2 i + 1."""
    degree = np.zeros(nodes + 1, np.int64)
    for i in range(len(tails)):
        degree[tails[i] + 1] += 1
        degree[heads[i] + 1] += 1
    starts = np.cumsum(degree)
    fill, arcs = starts[:-1].copy(), np.empty(2 * len(tails), np.int64)
    for i in range(len(tails)):
        arcs[fill[tails[i]]] = 2 * i
        fill[tails[i]] += 1
        arcs[fill[heads[i]]] = 2 * i + 1
        fill[heads[i]] += 1
    return starts, arcs


@njit(nogil=True, cache=True)
def _find_levels(starts, arcs, to, room, source, level, queue, least):
    """The arcs from the source to each node in `level`, -1 for one out of reach; whether the sink is within."""
    level[:] = -1
    level[source], queue[0], first, last = 0, source, 0, 1
    while first < last:
        u = queue[first]
        first += 1
        for k in range(starts[u], starts[u + 1]):
            v = to[arcs[k]]
            if level[v] < 0 and room[arcs[k]] > least:
                level[v], queue[last] = level[u] + 1, v
                last += 1
    return level[source + 1] >= 0


@njit(nogil=True, cache=True)
def _fill_paths(starts, arcs, to, room, source, level, path, least):
    """Fill paths along rising levels until none is left; `path` is room for one."""
    at = starts[:-1].copy()
    u, depth = source, 0
    while True:
        if u == source + 1:
            depth = _fill_path(to, room, path, depth)
            u = to[path[depth] ^ 1]
        arc = -1
        while at[u] < starts[u + 1]:
            arc = arcs[at[u]]
            if room[arc] > least and level[to[arc]] == level[u] + 1:
                break
            at[u] += 1
            arc = -1
        if arc >= 0:
            path[depth] = arc
            u, depth = to[arc], depth + 1
        elif u == source:
            return
        else:
            level[u] = -1
            depth -= 1
            u = to[path[depth] ^ 1]
            at[u] += 1


@njit(nogil=True, cache=True)
def _fill_path(to, room, path, depth):
    """Send what a path bears; the place of its first arc that is full then."""
    flow, cut = np.inf, 0
    for k in range(depth):
        if room[path[k]] < flow:
            flow, cut = room[path[k]], k
    for k in range(depth):
        room[path[k]] -= flow
        room[path[k] ^ 1] += flow
    return cut


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


def _boundary(plane: OutlinePlane, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices [b] of the segments that bound a region, and their nodes [b, 2] in the order that has the region on the left."""
    sides = np.append(inside, False)[plane.segments.faces]
    at = np.flatnonzero(sides[:, 0] != sides[:, 1])
    nodes = plane.segments.nodes[at]
    return at, np.where(sides[at, :1], nodes, nodes[:, ::-1])


def _pinched(plane: OutlinePlane, inside: np.ndarray) -> int | None:
    """A node that the boundary passes more than once."""
    _, nodes = _boundary(plane, inside)
    times = np.bincount(nodes[:, 0], minlength=len(plane.nodes))
    return int(np.argmax(times)) if (times > 1).any() else None


def draw_outline(plane: OutlinePlane, inside: np.ndarray) -> Outline:
    """The outline of a region. Where walls nearly coincide, vertices at their own crossings may make it cross itself: those are then
    where the nodes are."""
    for exact in (True, False):
        try:
            outline = Outline(trace_loops(plane, inside, exact))
            check_crossings(outline)
            return outline
        except ValueError:
            if not exact:
                raise
    raise AssertionError("one of both has returned or raised")


def trace_loops(plane: OutlinePlane, inside: np.ndarray, exact: bool = True) -> tuple[Loop, ...]:
    """The boundary of a region as loops of lines and arcs, outer ones counter-clockwise; raises ValueError where it does not close.

    Vertices are crossings of their two walls, or without `exact` the nodes that several crossings share.
    """
    at, nodes = _boundary(plane, inside)
    follows = {int(a): k for k, (a, _) in enumerate(nodes)}
    left, loops = set(range(len(at))), []
    while left:
        k = next(iter(sorted(left)))
        ring: list[int] = []
        while k in left:
            left.discard(k)
            ring.append(k)
            k = follows.get(int(nodes[k, 1]), -1)
        if k != ring[0]:
            raise ValueError(f"the boundary of {int(inside.sum())} faces does not close")
        loop = _loop(plane, [(int(at[i]), int(nodes[i, 0]) == int(plane.segments.nodes[at[i], 0])) for i in ring], exact)
        if loop is not None:
            loops.append(loop)
    return orient_loops(loops)


def _loop(plane: OutlinePlane, ring: list[tuple[int, bool]], exact: bool) -> Loop | None:
    """One loop of (segment, whether it is passed forwards), its pieces of one wall joined; None for what has no area."""
    wall = plane.segments.wall[[s for s, _ in ring]].tolist()
    # start where the wall changes, so that no curve is cut in two
    start = next((i for i in range(len(ring)) if wall[i] != wall[i - 1]), None)
    lines = len(plane.walls.offsets)
    if start is None:
        center, radius = plane.walls.centers[wall[0] - lines], plane.walls.radii[wall[0] - lines]
        return circle(float(radius), float(center[0]), float(center[1]))
    runs = list(_same_wall(ring[start:] + ring[:start], wall[start:] + wall[:start]))
    corners = [_corner(plane, runs[i - 1], runs[i], exact) for i in range(len(runs))]
    passed = [
        (run, a, b) for run, a, b in zip(runs, corners, [*corners[1:], corners[0]], strict=True) if not np.allclose(a, b, 0, NO_LENGTH)
    ]
    vertices = [v for run, begin, end in passed for v in _vertices(plane, run, begin, end)]
    return tuple(vertices) if len(vertices) > 2 or any(b for _, _, b in vertices) else None


def _same_wall(ring: list[tuple[int, bool]], wall: list[int]) -> Iterator[list[tuple[int, bool]]]:
    first = 0
    for i in range(1, len(ring) + 1):
        if i == len(ring) or wall[i] != wall[first]:
            yield ring[first:i]
            first = i


def _corner(plane: OutlinePlane, before: list[tuple[int, bool]], after: list[tuple[int, bool]], exact: bool) -> np.ndarray:
    """Where a curve starts [2]: its wall's own crossing with the wall before, which a node shares with others nearby."""
    segments, (first, forwards) = plane.segments, after[0]
    node = plane.nodes[segments.nodes[first, 0 if forwards else 1]]
    if not exact:
        return node
    crossings = cross_walls(plane.walls, int(segments.wall[before[0][0]]), int(segments.wall[first]))
    near = min(crossings, key=lambda p: float(np.linalg.norm(p - node)), default=node)
    near = near if np.linalg.norm(near - node) <= NEAR_NODE else node
    return np.maximum(near, (0.0, -np.inf)) if plane.kind == "revolve" else near


def _vertices(plane: OutlinePlane, run: list[tuple[int, bool]], begin: np.ndarray, end: np.ndarray) -> list[Vertex]:
    """A curve from its begin to its end [2], with its bulge; an arc that is nearly a circle is two, since its ends say little of its
    centre."""
    (x, y), at = begin.tolist(), int(plane.segments.wall[run[0][0]]) - len(plane.walls.offsets)
    if at < 0:
        return [(x, y, 0.0)]
    center, radius = plane.walls.centers[at], float(plane.walls.radii[at])
    about = sum(float(plane.segments.length[s]) for s, _ in run) / radius * (1 if run[0][1] else -1)
    (ax, ay), (bx, by) = begin - center, end - center
    turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    turn += 2 * math.pi * round((about - turn) / (2 * math.pi))
    if abs(turn) < WIDE:
        return [(x, y, math.tan(turn / 4))]
    cosine, sine, bulge = math.cos(turn / 2), math.sin(turn / 2), math.tan(turn / 8)
    return [(x, y, bulge), (float(center[0] + cosine * ax - sine * ay), float(center[1] + sine * ax + cosine * ay), bulge)]
